# SPDX-License-Identifier: Apache-2.0
"""Interface of all rivals: the problem that each gets and the answer that it gives."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement, load_measurements
from twinmill.model.model_file import ModelFile
from twinmill.predict.windows import Windows

DOCUMENTED, TUNED = "as documented", "tuned"
# (W, H, 3) displacements seen from the starts of windows of a log: m, m, rad.
Predict = Callable[[Measurement, Windows], np.ndarray]


@dataclass(frozen=True)
class Problem:
    """A log of commands and poses, and the model that its owner has."""

    log: Path
    base: Path

    @cached_property
    def file(self) -> ModelFile:
        """The model's file."""
        return ModelFile.load(str(self.base))

    @cached_property
    def measurement(self) -> Measurement:
        """The log, cleaned."""
        return load_measurements([self.log], self.file.model)[0]

    @cached_property
    def model(self) -> native.Model:
        """The model of this robot."""
        return self.file.model.for_robot(self.measurement.track.robot_id)

    @property
    def noise(self) -> dict[str, float]:
        """Noise of the log that the model was fitted to; empty if it was fitted to none."""
        return tomllib.loads(self.base.read_text()).get("noise", {})


@dataclass(frozen=True)
class Answer:
    """Reply of a rival to a problem.

    Attributes:
        told: something is missing.
        evidence: in the rival's own unit; `told` is a limit on it.
        names: of effects of the catalogue, in the order in which they were found.
        depends_on: words for what the rest depends on, the strongest first.
        predict: with all that was learnt.
        said: the object of `twinmill diagnose --json`, of Twinmill alone.
    """

    told: bool
    evidence: float
    predict: Predict
    names: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    said: dict | None = None


@dataclass(frozen=True)
class Rival:
    """One way to find what a model lacks.

    Attributes:
        name: in tables.
        source: package and version, or paper.
        settings: for people: what is done as documented, and how it was tuned.
        answers: an answer for each of `settings`.
        lacks: columns that it cannot answer, and why.
        once: one computation serves all settings.
    """

    name: str
    source: str
    settings: Mapping[str, str]
    answers: Callable[[Problem], dict[str, Answer]]
    lacks: Mapping[str, str] = field(default_factory=dict)
    once: bool = False


def predicted_by(model: native.Model) -> Predict:
    """Predictions of a model on its own clock."""
    return lambda measurement, windows: windows.predicted(measurement, model)
