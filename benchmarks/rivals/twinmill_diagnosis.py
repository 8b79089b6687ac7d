# SPDX-License-Identifier: Apache-2.0
"""Twinmill itself: `twinmill explain`, as any user gets it."""

from pathlib import Path
from typing import Any

import numpy as np
import twinmill_native as native

from rivals.protocol import DOCUMENTED, Answer, Predict, Problem, Rival
from twinmill.data.measurement import Measurement
from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.model.parameters import phases
from twinmill.predict.windows import HORIZONS_S, Windows, difference, rms
from twinmill.report import judged

NAMED = ("effect_missing", "ambiguous")
PHASES_RAD = np.radians(np.arange(-180.0, 180.0, 2.0))


def answers(problem: Problem) -> dict[str, Answer]:
    """Its diagnosis, and the model that it writes."""
    found = diagnose([problem.measurement], problem.file)
    file = better(found, problem.file, Path("explained.toml"), "").file
    said: dict[str, Any] = judged.to_json(found)
    told = said["verdict"] in (*NAMED, "outside_catalogue")
    own = file.model.for_robot(problem.measurement.track.robot_id)
    answer = Answer(told, found.before.score, predicted_in_phase(own), said=said)
    return {DOCUMENTED: answer}


def predicted_in_phase(model: native.Model) -> Predict:
    """Predictions of a model whose formulas may recur, each with phases that the log tells.

    What a prediction is compared with tells nothing of its phases: they are those with which the
    log's other predictions, of which none overlaps it, miss least.
    """

    def predicted(measurement: Measurement, windows: Windows) -> np.ndarray:
        own = [model]
        for phase in phases(model):
            own = [_set(m, phase.name, value) for m in own for value in PHASES_RAD]
        every = np.array([windows.predicted(measurement, m) for m in own])
        if len(own) == 1:
            return every[0]
        best = _told_by_others(measurement, windows, every)
        return every[best, np.arange(len(best))]

    return predicted


def _told_by_others(measurement: Measurement, windows: Windows, every: np.ndarray) -> np.ndarray:
    """(W,) which of (B, W, H, 3) predictions miss least in the windows that do not overlap each."""
    off = difference(windows.measured(measurement), every)
    over = off / np.nanmin([rms(o) for o in off], axis=0)
    missed = np.nansum(over**2, axis=(2, 3))
    start_s = measurement.track.pose_t_s[windows.starts]
    apart = np.abs(start_s[:, None] - start_s) > HORIZONS_S[-1]
    return np.argmin(missed @ apart, axis=0)


def _set(model: native.Model, name: str, value: float) -> native.Model:
    other = model.copy()
    other.set(name, value)
    return other


RIVAL = Rival(
    name="Twinmill",
    source="twinmill explain",
    settings={DOCUMENTED: "no option is given; predicts with the model that it writes"},
    answers=answers,
)
