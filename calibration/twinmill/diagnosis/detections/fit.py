# SPDX-License-Identifier: Apache-2.0
"""Fits quantities of the camera to reported bits by maximum likelihood."""

from itertools import product

import numpy as np
import twinmill_native as native
from scipy.optimize import minimize

from twinmill.model.parameters import (
    Parameter,
    ParameterEstimate,
    catalogue,
    effect_names,
    effect_parameters,
)
from twinmill.predict.detections import Detections

STAGES = ("view", "decide")
MOST_FRAMES = 10000  # a fit takes every Nth frame beyond
STRENGTHS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # times the usual one: where a fit may begin
FAR = (5.0, 10.0)  # more of them where only one quantity is looked for
MOST_EXTRA = 20  # frames of a vote beyond the model's
WIDER = 6  # times a step is doubled until the likelihood falls by more than its grain
FALL = 1.0  # of the log likelihood on both sides together: less may be the grain of frames
REACH = 0.5  # times the usual strength: how far a fit goes from where it begins


def camera_effects(model: native.Model) -> list[str]:
    """Effects of the camera that a model could lack, in the catalogue's order."""
    return [n for n, e in catalogue().items() if e["stage"] in STAGES and n not in model.effects]


def camera_parameters(model: native.Model) -> list[Parameter]:
    """Free quantities of all camera effects that the model has."""
    entries = catalogue()
    own = [n for n in effect_names(model) if entries[n.split("#")[0]]["stage"] in STAGES]
    return [p for name in own for p in effect_parameters(model, name)]


class Likelihood:
    """Of bits, given values of some parameters."""

    def __init__(self, scenes: list[Detections], model: native.Model, free: list[Parameter]):
        """Takes frames of all robots; the model is copied."""
        self.scenes, self.free = scenes, free
        self.model = model.copy()
        count = sum(len(s.frames.t_s) for s in scenes)
        raw = all(s.frames.has_raw for s in scenes)  # else few frames count as it is
        self.thin = slice(None, None, max(1, -(-count // MOST_FRAMES)) if raw else 1)

    def set(self, values: np.ndarray) -> native.Model:
        """The model with these values."""
        for p, value in zip(self.free, values, strict=True):
            self.model.set(p.name, float(np.clip(value, p.min, p.max)))
        return self.model

    def frames(self, values: np.ndarray, thin: bool = False) -> list[np.ndarray]:
        """(K,) log likelihoods per robot; of every Nth frame if `thin`."""
        model = self.set(values)
        return [s.likelihood(model, self.thin if thin else slice(None)) for s in self.scenes]

    def total(self, values: np.ndarray, half: int | None = None, thin: bool = True) -> float:
        """Sum over the frames of one half, or of both."""
        pick = self.thin if thin else slice(None)
        total = 0.0
        for scene, told in zip(self.scenes, self.frames(values, thin), strict=True):
            total += np.nansum(told if half is None else told[scene.half[pick] == half])
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
