# SPDX-License-Identifier: Apache-2.0
"""Errors that change with time: poses drift or turn, the robot veers, or all swings."""

from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from twinmill.diagnosis.families.family import Family, pushed
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANNELS, SPEEDS, SWELL, TIME, TYPICAL, Term, moves

PARTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the time of all logs: where something may have changed
DRIFTS = 5  # waves of a drift, the slowest over the whole log


def of_drift(t_s: np.ndarray) -> list[Family]:
    """Slow waves over the time of all logs, (N,) s."""
    longest_s = 1.1 * float(np.ptp(t_s))
    rates = [float(f"{2 * np.pi * k / longest_s:.4g}") for k in range(1, 1 + DRIFTS)]
    texts = _texts(rates)

    def moving(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return pushed(own, _swinging(own, rates))

    def turning(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: TYPICAL["omega_radps"] * _swinging(own, rates)}

    at_s = [float(f"{a:.4g}") for a in np.quantile(t_s, PARTS)]
    along = [f"drift({axis}, {t})" for axis in "xy" for t in texts]
    return [
        Family([Term(TIME, CHANNELS[0], t, 1.0, "drift") for t in along], moving),
        Family([Term(TIME, CHANNELS[2], t, 1.0, "drift of heading") for t in texts], turning),
        _veering(rates, "veers at times"),
        *(_veering_from(a) for a in at_s),
        *(_pushing(two) for two in pairwise(rates)),
    ]


def beat_of(opened: Sequence[Opened]) -> float:
    """Rate at which the errors of a log swing, rad/s; 0 at none, and of several logs."""
    return opened[0].response.beat_radps if len(opened) == 1 else 0.0


def of_beat(rate_radps: float) -> list[Family]:
    """Speeds, turning or pushes swing at a rate that the log's errors tell; none at 0."""
    if not rate_radps:
        return []
    rates = [float(f"{rate_radps:.5g}")]

    def gaining(axes: Sequence[int], own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {k: SWELL * _swinging(own, rates) * velocity[:, [k]] for k in axes}

    def of_gain(axes: Sequence[int], name: str, to: str) -> Family:
        size, words = TYPICAL[to] / SWELL, f"{name} swings"
        terms = [Term(TIME, to, f"{t}*{name}", size, words) for t in _texts(rates)]
        return Family(terms, partial(gaining, axes))

    return [
        _pushing(rates),
        _veering(rates, "turning swings"),
        of_gain((0, 1, 2), "rim", "rim_mps"),
        *(of_gain((k,), SPEEDS[k], CHANNELS[k]) for k in range(3)),
    ]


def _veering(rates: Sequence[float], family: str) -> Family:
    """It veers while it moves, to one side and the other at some rates."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: TYPICAL["omega_radps"] * _swinging(own, rates) * moves(velocity)[:, None]}

    return Family(
        [Term(TIME, CHANNELS[2], f"{t}*moves", 1.0, family) for t in _texts(rates)], values
    )


def _pushing(rates: Sequence[float]) -> Family:
    """The robot is pushed along the room while it moves, at one of a few rates."""
    texts = [f"push({axis}, {t})" for axis in "xy" for t in _texts(rates)]
    family = f"pushes at {rates[0]:g} 1/s"

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return pushed(own, _swinging(own, rates) * moves(velocity)[:, None])

    return Family([Term(TIME, CHANNELS[0], t, 1.0, family) for t in texts], values)


def _swinging(own: Opened, rates: Sequence[float]) -> np.ndarray:
    """(N, 2 k) at a log's points."""
    angle = own.response.middle_s[:, None] * np.array(rates)
    return np.hstack([np.cos(angle), np.sin(angle)])


def _texts(rates: Sequence[float]) -> list[str]:
    """Cosine and sine of each rate, as a formula has them."""
    return [f"{wave}({rate:g}*t)" for wave in ("cos", "sin") for rate in rates]


def _veering_from(at_s: float) -> Family:
    """It veers while it moves, before a moment in another way than after it."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        after = np.sign(own.response.middle_s - at_s)
        return {
            2: TYPICAL["omega_radps"] * moves(velocity)[:, None] * np.stack([after**2, after], 1)
        }

    texts = (f"({at_s:g} > 0)*moves", f"sign(t - {at_s:g})*moves")
    return Family([Term(TIME, CHANNELS[2], t, 1.0, f"veers from {at_s:g}") for t in texts], values)
