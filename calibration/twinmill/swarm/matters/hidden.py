# SPDX-License-Identifier: Apache-2.0
"""Effects that a log does not exclude, and how strong each may be without having shown in it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native
from scipy.stats import norm

from twinmill.data.measurement import Measurement, of_one_robot
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis.infer import HELD, ONE, prepared
from twinmill.inference.candidate import Candidate
from twinmill.inference.hypothesis import Fitter
from twinmill.inference.planar import PlanarProblem
from twinmill.inference.settings import PRIORS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import MOTION_STAGES, catalogue_of

MOST = 3.0  # times the usual strength: more is not thought of, as in a diagnosis
OF_A_LOG = "observe"  # stage of what says nothing of the robot


@dataclass(frozen=True)
class Hidden:
    """One effect.

    Attributes:
        times: how many times its usual strength it may have.
        why: in words.
    """

    effect: str
    times: float
    why: str

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Hidden":
        """The inverse of to_json."""
        return cls(**data)

    def to_json(self) -> dict[str, Any]:
        """Its fields."""
        return vars(self)


def hidden_effects(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Hidden]:
    """All effects of the catalogue that the model lacks, and how strong each may be.

    An effect may have the strength below which it is with 97.5 %, in the posterior of its sizes,
    all grown at once, beside what is free in the base; of several robots in that of the one whose
    log tells it least.

    Args:
        measurements: logs of one robot or several.
        model_file: the model.
        progress: told in words what is being done.

    Raises:
        LogError: there is no log of a robot.
    """
    robots = {m.track.robot_id for m in measurements if isinstance(m, Measurement)}
    each = []
    for robot in sorted(robots):
        progress(f"robot {robot}")
        runs = of_one_robot(measurements, HELD, ONE, robot)
        each.append(_possible(prepared(runs, model_file, (), progress)[0]))
    shown = {name for own in each for name in own}
    times = {name: max(own.get(name, MOST) for own in each) for name in shown}
    return [_hidden(name, model_file.model, times) for name in _lacking(model_file.model)]


def _possible(p: PlanarProblem) -> dict[str, float]:
    """How many times its usual strength each effect may have that acts at all times."""
    fitter = Fitter(p.steps, p.noise, p.prior.columns)
    linear, found = p.base.linear(fitter), {}
    for name, c in p.columns(p.base).items():
        change = _usual(c)
        if change is None:
            continue
        white = fitter.whiten(change[None])
        gram, push = linear.projected(white, white @ white.T)
        precision = gram[0, 0] + PRIORS.size**-2
        found[name] = float(abs(push[0]) / precision + norm.ppf(0.975) / np.sqrt(precision))
    return found


def _usual(c: Candidate) -> np.ndarray | None:
    """(W, C) change by an effect of its usual strength; None of what a place or moment has."""
    if c.where is not None:
        return None
    if c.limits is None:
        return np.asarray(c.columns.sum(axis=0)) if len(c.columns) else None
    values = np.array([parameter.value for parameter in c.parameters])
    nearest = int(np.argmin(np.abs(c.limits.at - values).sum(axis=1)))
    return np.asarray(c.limits.changes[nearest])


def _hidden(name: str, model: native.Model, times: Mapping[str, float]) -> Hidden:
    if name in times:
        most = min(MOST, times[name])
        less = f"more than {most:.2g} times its usual strength would have shown in this log"
        none = f"{MOST:g} times its usual strength would not have shown in this log"
        return Hidden(name, most, less if most < MOST else none)
    if catalogue_of(model)[name]["stage"] in MOTION_STAGES:
        return Hidden(name, MOST, "this log does not show it")
    return Hidden(name, 1.0, "the motion of one robot does not show it")


def unseen_effects(model: native.Model) -> list[Hidden]:
    """Effects without a log: nothing is excluded, and each has its usual strength."""
    return [Hidden(name, 1.0, "no log excludes it") for name in _lacking(model)]


def _lacking(model: native.Model) -> list[str]:
    return [
        name
        for name, card in catalogue_of(model).items()
        if name not in model.effects and card["stage"] != OF_A_LOG and not card["texts"]
    ]
