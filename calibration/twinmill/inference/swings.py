# SPDX-License-Identifier: Apache-2.0
"""A swing of one frequency, which smooth functions of time are too slow for: a regulator hunts.

Its frequency and what swings are one of many alike, so that the evidence of the likeliest has their
number as its price (a bound of the mean over all; MacKay 2003, Information Theory, ch. 28).
"""

import numpy as np
import twinmill_native as native

from twinmill.inference.discrepancy import CHANCE, SIZES, TIME, Kernel, gains, pushes, way_aside
from twinmill.inference.evidence import Linear
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.steps import Motion

SLOWEST_S = 8.0  # shortest wave of all functions of time, see `discrepancy`
PER_STEP = 0.25  # fastest, in turns a step: four steps show a wave
AT_ONCE = 64  # frequencies: memory for their columns


def swing(m: Motion, base: Hypothesis, fitter: Fitter) -> Kernel | None:
    """The likeliest swing beside a base; None of a log too short for any.

    Args:
        m: the motion, as the base predicts it.
        base: fitted, nothing missing.
        fitter: of the log, under its noise.
    """
    span_s = float(np.ptp(m.t_s))
    highest = PER_STEP / float(np.median(m.step_s))
    rates = 2 * np.pi * np.arange(1 / SLOWEST_S, highest, 1 / (2 * max(span_s, SLOWEST_S)))
    if not len(rates):
        return None
    linear, ways = base.linear(fitter), _ways(m)
    best = -np.inf, 0, 0.0
    for at in np.array_split(rates, -(-len(rates) // AT_ONCE)):
        waves = _waves(m, at)
        for kind, way in enumerate(ways):
            gain = _gains(linear, fitter.whiten(_swinging(waves, way)))
            if gain.max() > best[0]:
                best = float(gain.max()), kind, float(at[gain.argmax()])
    own = _swinging(_waves(m, np.array([best[2]])), ways[best[1]])[0]
    return Kernel(TIME, f"{TIME}: swing", own, False, -float(np.log(len(ways) * len(rates))))


def _ways(m: Motion) -> list[np.ndarray]:
    """(D, W, 3) what may swing together: gains, a heading that is off, and pushes."""
    still = np.ones((1, len(m.t_s)))
    return [
        *(gains(m, still, which) for which in ("all", "travel", "turn")),
        way_aside(m, still),
        *(pushes(m, still, frame) for frame in ("room", "body", "turn")),
    ]


def _waves(m: Motion, rates: np.ndarray) -> np.ndarray:
    """(F, 2, W) of each of F rates in rad/s, with a peak of one."""
    angle = rates[:, None] * (m.t_s - m.t_s[0])
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _swinging(waves: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(F, K, W, 3) columns of (F, 2, W) waves along a way."""
    every = waves[:, :, None, :, None] * way
    return np.asarray(every.reshape(len(waves), -1, *way.shape[1:]))


def _gains(linear: Linear, white: np.ndarray) -> np.ndarray:
    """(F,) gain in log evidence by each of F swings of their likeliest size, (F, K, R) white."""
    count = white.shape[1]
    cross, push = linear.taken(white.reshape(-1, white.shape[-1]))
    taken = cross.reshape(-1, count, cross.shape[1])
    grams = white @ white.transpose(0, 2, 1) - taken @ taken.transpose(0, 2, 1)
    of_sizes, _ = native.gains_by_size([*grams], push, SIZES)
    return np.asarray((of_sizes + np.log(CHANCE)).max(axis=1))
