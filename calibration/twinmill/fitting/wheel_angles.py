# SPDX-License-Identifier: Apache-2.0
"""The angle of each wheel as the captured motion rolls it.

The predicted motion would be off by a turn soon. The wheel's radius is seldom known so well that
the angle stays right over a log: if the errors swing about a turn of a wheel, they tell it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.model.parameters import BASE_GAINS

TIMES = (1, 2, 3)  # a turn: an axle off the centre, an oval, a flat place
NOT_ROLLED = ("none", "ackermann")  # no wheels, or steered ones
HORIZON = 1  # number of the windows' horizon that is short beside a turn
BIN_RAD = 0.25
PADDED = 8  # times as many bins, so that a peak between two is seen
RATIOS = np.linspace(0.85, 1.15, 1201)  # of the radius over the model's
# Times the mean of a power that is noise. Of sums of three that are noise 3 in a million are larger
# (Erlang), and a log has some hundred that are independent.
BEYOND_CHANCE = 18.0


@dataclass(frozen=True)
class Wheel:
    """One wheel, or the wheels of one side where all of them turn alike.

    Attributes:
        words: its name.
        rate: (3,) rad/s of it by each velocity of the body.
        body: (3,) velocities of the body by 1 rad/s of it alone.
    """

    words: str
    rate: np.ndarray
    body: np.ndarray

    def angle(self, moved: np.ndarray) -> np.ndarray:
        """(N,) rad half way to each point, of a body that moved by (N, 3) to it."""
        turned_rad = moved @ self.rate
        return np.cumsum(turned_rad) - turned_rad / 2

    def waves(self, moved: np.ndarray) -> np.ndarray:
        """(N, k) that swing TIMES a turn."""
        angle = self.angle(moved)[:, None] * np.array(TIMES)
        return np.hstack([np.cos(angle), np.sin(angle)])

    def larger(self, ratio: float) -> "Wheel":
        """One of so many times the radius."""
        return replace(self, rate=self.rate / ratio, body=self.body * ratio)


def wheels_of(model: native.Model) -> list[Wheel]:
    """All that the body's motion turns."""
    if model.wheel_kind in NOT_ROLLED:
        return []
    wheels = model.wheels()
    gains = np.array([model.get(name) for name in BASE_GAINS])  # of the body over its rims
    rates = np.array([model.wheel_speeds(*axis) for axis in np.eye(3)]).T / gains
    bodies = [gains * np.array(model.body_velocity(one)) for one in np.eye(len(wheels)).tolist()]
    sides = model.wheel_kind == "differential"
    named = [f"{_side(w)} wheels" if sides else w["words"] for w in wheels]
    every = {n: Wheel(n, r, b) for n, r, b in zip(named, rates, bodies, strict=True)}
    return list(every.values())


def _side(wheel: dict[str, Any]) -> str:
    return "left" if wheel["y_m"] > 0 else "right"


def radius_ratio(
    wheels: Sequence[Wheel], moved: np.ndarray, errors: np.ndarray, ends: np.ndarray
) -> float:
    """Radius at which errors swing with a wheel's angle over the model's; 1 if none do.

    Args:
        wheels: as the model has them.
        moved: (N, 3) of the body, to each point.
        errors: (W, 3) of windows, weighted.
        ends: (W, 2) points between which each window lies.
    """
    if not wheels:
        return 1.0
    power = np.array([_powers(w, moved, np.nan_to_num(errors), ends) for w in wheels])
    noise = np.median(power) / np.log(2)
    of_all = power.sum(axis=1)  # of what swings TIMES a turn
    best = np.unravel_index(int(np.argmax(of_all)), of_all.shape)
    return float(RATIOS[best[1]]) if of_all[best] > BEYOND_CHANCE * noise else 1.0


def _powers(wheel: Wheel, moved: np.ndarray, errors: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(TIMES, RATIOS) power of errors of windows that swing so many times a turn."""
    k, power = _spectrum(wheel, moved, errors, ends)
    return np.array([np.interp(n / RATIOS, k, power) for n in TIMES])


def _spectrum(
    wheel: Wheel, moved: np.ndarray, errors: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(K,) swings a turn, and the power of errors of windows at each, of noise alike at all."""
    first, last = np.cumsum(moved @ wheel.rate)[ends].T
    rolled_rad, place = last - first, np.rint((first + last) / 2 / BIN_RAD).astype(int)
    pulled = np.bincount(place - place.min(), rolled_rad * (errors @ wheel.body))
    several = PADDED * len(pulled)
    scale = np.sum(rolled_rad**2) * (wheel.body @ wheel.body)
    power = np.abs(np.fft.rfft(pulled, several)) ** 2 / max(scale, 1e-12)
    return 2 * np.pi * np.fft.rfftfreq(several, BIN_RAD), power
