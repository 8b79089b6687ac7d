# SPDX-License-Identifier: Apache-2.0
"""The most precise numbers that two runs tell, about where a fit of their predictions ended.

Predictions over several horizons overlap, so that a fit to them counts the same disturbance many
times. Errors over steps that do not overlap, made white by the noise of each run, tell each of them
once: one step of Gauss and Newton to their least squares is as precise as any unbiased estimate
(generalised least squares, Aitken 1935). Its curvature is the bound of Cramér and Rao.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from twinmill.estimation.score_fit import ScoreFit
from twinmill.inference.noise import Course, Usual, first_noise, fit_noise, weights_of
from twinmill.inference.steps import Steps, StepsOfLog, motion_of
from twinmill.predict.datasets import Trajectory


@dataclass(frozen=True)
class WhiteStep:
    """The step, and how sure its end is.

    Attributes:
        step: (P,) from the fit's unknowns.
        covariance: (P, P) by leaving out blocks of time.
        by_curvature: (P, P) the bound, if the noise is what it was taken for.
    """

    step: np.ndarray
    covariance: np.ndarray
    by_curvature: np.ndarray


@dataclass(frozen=True)
class _Block:
    """Contribution of a block of time to curvature and slope of the squares, (P, P) and (P,)."""

    gram: np.ndarray
    pull: np.ndarray


def white_step(fit: ScoreFit) -> WhiteStep:
    """Takes the step from a fit to trajectories."""
    blocks = [block for i in range(len(fit.datasets)) for block in _blocks(fit, i)]
    precision = np.diag(1 / fit.std**2)
    gram = precision + sum(b.gram for b in blocks)
    step = np.linalg.solve(gram, (fit.usual - fit.x) / fit.std**2 + sum(b.pull for b in blocks))
    bound = np.linalg.inv(gram)
    moved = np.array([np.linalg.solve(gram - b.gram, b.gram @ step - b.pull) for b in blocks])
    spread = moved.T @ moved * (len(blocks) - 1) / len(blocks)
    return WhiteStep(step, spread + bound @ precision @ bound, bound)


def _blocks(fit: ScoreFit, i: int) -> list[_Block]:
    """Blocks of one run."""
    data, own = fit.trajectories[i], fit.columns[i]
    steps = Steps([StepsOfLog(data.measurement)])
    kept = _kept(steps, data)
    up = np.where(fit.x + fit.step <= fit.high, fit.step, -fit.step)[own]
    points = np.concatenate([fit.x[None, own], fit.x[own] + np.diag(up)])
    errors = steps.errors(fit.models[i], fit.names[i], points)[:, kept]
    columns = (errors[0] - errors[1:]) / up[:, None, None]
    moved = steps.predicted(fit.models[i])
    pace = motion_of(steps, moved, moved).pace[kept]
    begin = first_noise(Course(float(np.median(steps.step_s)), _stretches(steps, kept), pace), {})
    noise = fit_noise(errors[0], columns * fit.std[own][:, None, None], begin, Usual.about(begin))
    both = noise.whiten(np.concatenate([errors[:1], columns]))
    weight = weights_of(both[0].reshape(3, -1)).reshape(-1)
    left, slopes = both[0] * weight, both[1:] * weight
    block = np.tile(steps.block[kept], 3)
    found = []
    for number in np.unique(block):
        rows = block == number
        gram, pull = np.zeros((len(fit.x), len(fit.x))), np.zeros(len(fit.x))
        gram[np.ix_(own, own)] = slopes[:, rows] @ slopes[:, rows].T
        pull[own] = slopes[:, rows] @ left[rows]
        found.append(_Block(gram, pull))
    return found


def _kept(steps: Steps, data: Trajectory) -> np.ndarray:
    """(W,) steps that begin where predictions are judged."""
    begin_s = steps.t_s - steps.step_s / 2
    last = np.searchsorted(data.start_s, begin_s + data.every_s / 2, side="right") - 1
    return data.keep[np.maximum(last, 0)]


def _stretches(steps: Steps, kept: np.ndarray) -> Sequence[slice]:
    """Stretches of kept steps that follow each other without a gap."""
    number = np.zeros(len(steps), int)
    for k, part in enumerate(steps.stretches):
        number[part] = k
    index = np.flatnonzero(kept)
    apart = (np.diff(index) > 1) | (np.diff(number[index]) > 0)
    edges = [0, *(np.flatnonzero(apart) + 1).tolist(), len(index)]
    return [slice(a, b) for a, b in pairwise(edges)]
