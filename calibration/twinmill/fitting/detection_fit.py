# SPDX-License-Identifier: Apache-2.0
"""Fits quantities of the camera to detections, and judges them on frames that were not fitted to.

A detection is drawn with a chance that the model tells, so that the fit is by maximum likelihood:
there is no floor of errors as `ScoreFit` has it. The likelihood has edges where a frame leaves the
cone, hence no slopes: a grid finds where to begin, and Powell's method goes on from there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import twinmill_native as native
from scipy.optimize import minimize

from twinmill.model.parameters import (
    CAMERA_STAGES,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    effect_parameters,
)
from twinmill.predict.detection_errors import brier_ratio
from twinmill.predict.detections import SURE, Detections

MOST_FRAMES = 10000  # a fit takes every Nth frame beyond
STRENGTHS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # times the usual one: where a fit may begin
FAR = (5.0, 10.0)  # more of them where only one quantity is looked for
MOST_EXTRA = 20  # frames of a vote beyond the model's
WIDER = 6  # times a step is doubled until the likelihood falls by more than its grain
FALL = 1.0  # of the log likelihood on both sides together: less may be the grain of frames
REACH = 0.5  # times the usual strength: how far a fit goes from where it begins


@dataclass(frozen=True)
class HeldOutFrames:
    """What a model fitted to the other half says of each robot's frames; a list of (K,) each.

    Attributes:
        log_likelihood: of what was reported; NaN where nothing can be said.
        chance: probability of the bit, raw or voted.
        voted: the bit that the vote must give by the raw ones.
    """

    log_likelihood: list[np.ndarray]
    chance: list[np.ndarray]
    voted: list[np.ndarray]

    @classmethod
    def of(
        cls, cameras: Sequence[Detections], models: tuple[native.Model, native.Model]
    ) -> "HeldOutFrames":
        """Each half of the frames by the model in its place."""
        rows = []
        for camera in cameras:
            both = [_of_robot(camera, m.for_robot(camera.robot_id)) for m in models]
            first = camera.half == 0
            rows.append([np.where(first, a, b) for a, b in zip(*both, strict=True)])
        return cls(*(list(column) for column in zip(*rows, strict=True)))

    def score(self, cameras: Sequence[Detections]) -> float:
        """RMS error of the chances over what such chances must err, in all frames that count."""
        chance = [c[s.usable] for s, c in zip(cameras, self.chance, strict=True)]
        bits = [(s.frames.raw if s.frames.has_raw else s.frames.voted)[s.usable] for s in cameras]
        return brier_ratio(np.concatenate(chance), np.concatenate(bits))


def _of_robot(camera: Detections, own: native.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    chance = np.clip(camera.reported(own, camera.frames.has_raw), SURE, 1 - SURE)
    return camera.likelihood(own), chance, camera.voted(int(own.detection_model()["vote_frames"]))


@dataclass(frozen=True)
class DetectionFit:
    """A model of the camera, perhaps with one effect more, fitted to all frames and to each half.

    Attributes:
        effect: what was added; None if nothing.
        model: fitted to all frames.
        values: of all camera parameters.
        heldout: what fits to either half say of the other.
        score: of these.
        added: estimates of the added effect's quantities.
    """

    effect: str | None
    model: native.Model
    values: np.ndarray
    heldout: HeldOutFrames
    score: float
    added: tuple[ParameterEstimate, ...]


def fit_detections(
    cameras: Sequence[Detections], model: native.Model, effect: str | None = None
) -> DetectionFit:
    """Fits the model's camera effects, and `effect`, which it has not, to all frames.

    Args:
        cameras: frames with poses; at least one.
        model: of all robots; it is copied.
        effect: of the catalogue, at a stage of the camera; None adds none.
    """
    richer = model.copy()
    fresh = []
    if effect:
        richer.add_effect(effect)
        fresh = effect_parameters(richer, effect)
    free = all_effect_parameters(richer, CAMERA_STAGES)
    likelihood = Likelihood(cameras, richer, free)
    values = np.array([richer.get(k.name) for k in free])
    if fresh:
        values = start(likelihood, fresh, values)
    values = climb(likelihood, values) if free else values
    fits = [climb(likelihood, values, 1 - half) if free else values for half in (0, 1)]
    heldout = HeldOutFrames.of(cameras, tuple(likelihood.set(own).copy() for own in fits))
    added = [e for e in estimates(likelihood, values) if effect and e.name.startswith(f"{effect}.")]
    model = likelihood.set(values)
    return DetectionFit(effect, model, values, heldout, heldout.score(cameras), tuple(added))


class Likelihood:
    """Of bits, given values of some parameters."""

    def __init__(self, cameras: Sequence[Detections], model: native.Model, free: list[Parameter]):
        """Takes frames of all robots; the model is copied."""
        self.cameras, self.free = cameras, free
        self.model = model.copy()
        count = sum(len(s.frames.t_s) for s in cameras)
        raw = all(s.frames.has_raw for s in cameras)  # else few frames count as it is
        self.thin = slice(None, None, max(1, -(-count // MOST_FRAMES)) if raw else 1)

    def set(self, values: np.ndarray) -> native.Model:
        """The model with these values."""
        for p, value in zip(self.free, values, strict=True):
            self.model.set(p.name, float(np.clip(value, p.min, p.max)))
        return self.model

    def frames(self, values: np.ndarray, thin: bool = False) -> list[np.ndarray]:
        """(K,) log likelihoods per robot; of every Nth frame if `thin`."""
        model = self.set(values)
        return [s.likelihood(model, self.thin if thin else slice(None)) for s in self.cameras]

    def total(self, values: np.ndarray, half: int | None = None, thin: bool = True) -> float:
        """Sum over the frames of one half, or of both."""
        pick = self.thin if thin else slice(None)
        total = 0.0
        for camera, told in zip(self.cameras, self.frames(values, thin), strict=True):
            total += np.nansum(told if half is None else told[camera.half[pick] == half])
        return float(total) * (self.thin.step if thin else 1)


def grid(parameter: Parameter, far: bool) -> list[float]:
    """Neutral and values on both sides of it, within bounds."""
    p = parameter
    if p.name.endswith("_frames"):  # whole numbers
        return [float(n) for n in range(-MOST_EXTRA, MOST_EXTRA + 1)]
    steps = [*STRENGTHS, *(FAR if far else ())]
    values = {p.usual + s * p.strength for s in [0.0, *steps, *(-s for s in steps)]}
    return sorted({float(np.clip(v, p.min, p.max)) for v in values})


def start(likelihood: Likelihood, fresh: list[Parameter], values: np.ndarray) -> np.ndarray:
    """The best of a grid of values of `fresh`, the last ones; the rest as given."""
    head = values[: len(values) - len(fresh)]
    grids = [grid(p, far=len(fresh) == 1) for p in fresh]
    rows = [np.concatenate([head, row]) for row in product(*grids)]
    return max(rows, key=likelihood.total)


def climb(likelihood: Likelihood, begin: np.ndarray, half: int | None = None) -> np.ndarray:
    """Values near `begin` with the greatest likelihood (Powell 1964: edges have no slope)."""
    free = likelihood.free
    low = np.array(
        [max(k.min, b - REACH * abs(k.strength)) for k, b in zip(free, begin, strict=True)]
    )
    high = np.array(
        [min(k.max, b + REACH * abs(k.strength)) for k, b in zip(free, begin, strict=True)]
    )
    unit = np.array([abs(k.strength) for k in free])
    found = minimize(
        lambda x: -likelihood.total(x * unit, half),
        np.clip(begin, low, high) / unit,
        method="Powell",
        bounds=list(zip(low / unit, high / unit, strict=True)),
        options={"xtol": 1e-2, "ftol": 1e-6, "maxiter": 3},
    )
    values = found.x * unit
    return values if likelihood.total(values, half) > likelihood.total(begin, half) else begin


def estimates(likelihood: Likelihood, values: np.ndarray) -> list[ParameterEstimate]:
    """Values with standard errors from the curvature of the likelihood, one by one."""
    made = []
    middle = likelihood.total(values, thin=False)
    for i, p in enumerate(likelihood.free):
        std = _std(likelihood, values, i, middle)
        at_bound = bool(values[i] in (p.min, p.max))
        known = bool(np.isfinite(std))
        made.append(ParameterEstimate(p.name, float(values[i]), std, p.unit, at_bound, known))
    likelihood.set(values)
    return made


def _std(likelihood: Likelihood, values: np.ndarray, i: int, middle: float) -> float:
    """Of one value: from the shortest steps to both sides that fall by more than the grain."""
    p = likelihood.free[i]
    for k in range(WIDER):
        step = 0.1 * abs(p.strength) * 2**k
        sides = np.clip(values[i] + np.array([-step, step]), p.min, p.max)
        fall = 2 * middle
        for side in sides:
            moved = values.copy()
            moved[i] = side
            fall -= likelihood.total(moved, thin=False)
        if fall > FALL:
            return float(np.sqrt(np.sum((sides - values[i]) ** 2) / (2 * fall)))
    return float("nan")
