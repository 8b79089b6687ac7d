# SPDX-License-Identifier: Apache-2.0
"""By how much, and for how long at a time, a robot's speed and turning wander by themselves.

Errors of two predictions are multiplied with each other. Where a gain wanders, the mean of these
products is its autocovariance times both ways: the sensor's noise is in none, since no two share a
pose. A first-order process is fitted to it (Uhlenbeck and Ornstein 1930).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinmill.fitting.independence import (
    LONGEST,
    along_the_way,
    by_chance,
    following,
    told_before,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import EVERY_S, HORIZONS_S, rms

HORIZON = HORIZONS_S.index(0.5)
LATER_S = np.arange(HORIZONS_S[HORIZON] + EVERY_S, 8.01, EVERY_S)
DURATIONS_S = np.geomspace(0.5, 20.0, 51)
ONCE = 0.9  # share of the squared errors: they are of one stretch
MOVES = 0.1  # of the usual way: it moves
ALONG, ACROSS, TURN, WITH_TURN = range(4)  # of `along_the_way`


@dataclass(frozen=True)
class Wander:
    """Random wander: first-order processes.

    Attributes:
        way: standard deviation of the way, a share of it; 0 where that is not known to wander.
        way_s: correlation time of it.
        turn_radps, turn_s: the same of the turning rate while the robot moves.
    """

    way: float = 0.0
    way_s: float = 0.0
    turn_radps: float = 0.0
    turn_s: float = 0.0

    @property
    def words(self) -> str:
        """By how much and for how long; empty if that is not known."""
        told = [f"{100 * self.way:.2g} % of the way for {_in_s(self.way_s)}"] if self.way else []
        if self.turn_radps:
            told.append(f"{self.turn_radps:.1g} rad/s for {_in_s(self.turn_s)}")
        return f"by about {' and '.join(told)} at a time" if told else ""


def _in_s(time_s: float) -> str:
    """A correlation time in words; the longest that a fit finds may be longer."""
    more = " or more" if time_s >= DURATIONS_S[-1] else ""
    return f"{time_s:.{0 if time_s >= 1 else 1}f} s{more}"


def wandering(logs: Sequence[tuple[Trajectory, np.ndarray]]) -> Wander | None:
    """Wander in logs; None where errors do not predict the next ones better than chance.

    What wanders by itself does so all the time: what happens once lies in a quarter of the logs.

    Args:
        logs: each with its (W, H, 3) errors; NaN where not judged.
    """
    start_s = _one_after_the_other([data.start_s for data, _ in logs])
    errors = np.concatenate([own for _, own in logs])
    moved = np.concatenate([data.measured for data, _ in logs])
    ways = along_the_way(errors[:, LONGEST], moved[:, LONGEST])
    span_s = sum(data.covered_s for data, _ in logs)
    wanders = (told_before(ways, start_s) > by_chance(span_s)) & _all_the_time(ways)
    if not wanders.any():
        return None
    off = along_the_way(errors[:, HORIZON], moved[:, HORIZON])
    way_m, moves_s = _full(moved[:, HORIZON])
    turning = TURN if wanders[TURN] else WITH_TURN
    along, turn = (
        _first_order(_products(off[:, k], full, start_s)) if wanders[k] else (0.0, 0.0)
        for k, full in ((ALONG, way_m), (turning, moves_s))
    )
    return Wander(*along, *turn)


def _all_the_time(errors: np.ndarray) -> np.ndarray:
    """(C,) whether no quarter of the logs has nearly all of the squares of (W, C) errors."""
    summed = np.concatenate([np.zeros_like(errors[:1]), np.nancumsum(errors**2, axis=0)])
    quarter = len(errors) // 4
    most = (summed[quarter:] - summed[: len(summed) - quarter]).max(axis=0)
    return most < ONCE * summed[-1]


def _one_after_the_other(starts_s: Sequence[np.ndarray]) -> np.ndarray:
    """(W,) begins of all logs, each after the one before by more than predictions are compared."""
    spans_s = [own[-1] - own[0] + 2 * LATER_S[-1] for own in starts_s]
    first_s = np.cumsum([0.0, *spans_s[:-1]])
    return np.concatenate([own - own[0] + f for own, f in zip(starts_s, first_s, strict=True)])


def _full(moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(W,) of (W, 3) displacements: the way, m, and how long it moves, s."""
    usual = np.maximum(rms(moved[:, None])[0], 1e-9)
    moves = (np.abs(moved) > MOVES * usual).any(axis=1)
    return np.hypot(moved[:, 0], moved[:, 1]), np.where(moves, HORIZONS_S[HORIZON], 0.0)


def _products(errors: np.ndarray, full: np.ndarray, start_s: np.ndarray) -> np.ndarray:
    """(2, L) of predictions so much later: products of errors times those of ways, their squares.

    Args:
        errors: (W,) NaN where not judged.
        full: (W,) what is off by the error.
        start_s: (W,) ascending begins.
    """
    found = np.zeros((2, len(LATER_S)))
    for k, later_s in enumerate(LATER_S):
        after, there = following(start_s, later_s)
        ways, off = full[there] * full[after], errors[there] * errors[after]
        ways = np.where(np.isfinite(off), ways, 0.0)
        found[:, k] = np.nansum(off * ways), ways @ ways
    return found


def _first_order(sums: np.ndarray) -> tuple[float, float]:
    """Standard deviation and correlation time, s, that fit (2, L) sums of products best."""
    products, squares = sums
    falls = np.exp(-LATER_S / DURATIONS_S[:, None])
    variance = np.maximum(falls @ products / np.maximum(falls**2 @ squares, 1e-300), 0.0)
    best = int(np.argmax(variance * (2 * falls @ products - variance * (falls**2 @ squares))))
    return float(np.sqrt(variance[best])), float(DURATIONS_S[best])
