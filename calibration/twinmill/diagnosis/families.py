# SPDX-License-Identifier: Apache-2.0
"""Families of terms that are judged together, each of which acts in one narrow range.

A dip of the speed at one speed, a strip of floor that tilts, or a liquid that swings after each
change of the command has no form that is known before. A few humps over the speed, over the place,
or over the time since, take any of them; and a few slow waves take a capture that drifts.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from twinmill.diagnosis.term import (
    CHANGE,
    CHANNELS,
    PLACE,
    SPEEDS,
    STILL,
    SWELL,
    TIME,
    TYPICAL,
    Term,
    displaced,
    moves,
)
from twinmill.fitting.opening import Opened

HUMPS = 8  # over the range of a speed, or of a place
LEAST_M = 0.15  # between the middles of two humps over the place
DRIFTS = 5  # waves of a drift, the slowest over the whole log
AGO_S = (0.15, 0.3, 0.5, 0.8, 1.2, 1.8)  # since a change of the command: ends of ranges

# From a log and the (N, 3) velocities of its robot to (N, k) additions in axes of the body.
Values = Callable[[Opened, np.ndarray], dict[int, np.ndarray]]


@dataclass(frozen=True)
class Family:
    """Terms, and the (N, k) velocities that they add to axes of the body at their strengths."""

    terms: list[Term]
    values: Values

    def columns(self, own: Opened, velocity: np.ndarray) -> np.ndarray:
        """(R, k) change of a log's rows, as (N, 3) `velocity` moves the robot."""
        values = self.values(own, np.where(np.abs(velocity) < STILL, 0.0, velocity))
        response = own.floor.response
        change = sum(displaced(response, velocity, v, axis) for axis, v in values.items())
        weight = np.nan_to_num(own.data.weight)[..., None]
        return (change * weight).reshape(-1, len(self.terms))


def families_of(opened: Sequence[Opened], velocities: Sequence[np.ndarray]) -> list[Family]:
    """Over the speeds, the places and the past of all logs.

    Args:
        opened: logs over their floors.
        velocities: (N, 3) of the body in each, m/s and rad/s, at the points of its response.
    """
    moving = np.concatenate(velocities)
    axes = [k for k in range(3) if np.abs(moving[:, k]).max() > STILL[k]]
    pose = np.concatenate([own.floor.response.pose for own in opened])
    return [
        *(_of_speed(k, np.abs(moving[:, k])) for k in axes),
        *(_of_past(k, max(float(np.std(moving[:, k])), STILL[k])) for k in axes),
        *(f for k in range(2) for f in _of_place(k, pose[:, k])),
        *_of_drift(np.concatenate([own.floor.response.middle_s for own in opened])),
    ]


def _of_speed(axis: int, speed: np.ndarray) -> Family:
    """One axis is faster or slower at some of its speeds."""
    name, to = SPEEDS[axis], CHANNELS[axis]
    middles, width = _humps(np.array([0.0, np.quantile(speed, 0.99)]), HUMPS)
    group = "turning rate" if name == "omega" else "speed"
    texts = [f"sign({name})*{_text(f'abs({name})', m, width)}" for m in middles]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        v = velocity[:, [axis]]
        return {axis: TYPICAL[to] * np.sign(v) * _hump(np.abs(v), middles, width)}

    return Family([Term(group, to, t, 1.0, f"at some {name}") for t in texts], values)


def _of_past(axis: int, size: float) -> Family:
    """One axis does something for a while after each change of its speed."""
    name, to = SPEEDS[axis], CHANNELS[axis]
    texts = [f"ago({name}, {a:g}) - ago({name}, {b:g})" for a, b in _ranges()]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        t_s = own.floor.response.middle_s
        past = [np.interp(t_s - ago, t_s, velocity[:, axis]) for ago in (0.0, *AGO_S)]
        return {axis: -TYPICAL[to] / size * np.diff(past, axis=0).T}

    return Family([Term(CHANGE, to, t, size, f"after changes of {name}") for t in texts], values)


def _ranges() -> Iterator[tuple[float, float]]:
    return zip((0.0, *AGO_S[:-1]), AGO_S, strict=True)


def _of_place(axis: int, place: np.ndarray) -> list[Family]:
    """At some places all speeds change alike, the floor pushes, or iron turns a compass."""
    name = "xy"[axis]
    count = min(HUMPS, int(np.ptp(place) / LEAST_M))
    if count < 2:
        return []
    middles, width = _humps(place, count)
    texts = [_text(name, m, width) for m in middles]

    def gain(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        humps = SWELL * _hump(own.floor.response.pose[:, [axis]], middles, width)
        return {k: humps * velocity[:, [k]] for k in range(3)}

    def push(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        response = own.floor.response
        humps = TYPICAL["vx_mps"] * _hump(response.pose[:, [axis]], middles, width)
        humps *= moves(velocity)[:, None]
        waves = [f(response.heading_rad)[:, None] for f in (np.cos, np.sin)]
        return {0: np.hstack([w * humps for w in waves])}

    def turned(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        humps = SWELL * _hump(own.floor.response.pose[:, [axis]], middles, width)
        return {0: -humps * velocity[:, [1]], 1: humps * velocity[:, [0]]}

    size = TYPICAL["rim_mps"] / SWELL
    along = [f"{t}*{wave}(theta)*moves" for wave in ("cos", "sin") for t in texts]
    return [
        Family([Term(PLACE, "rim_mps", f"{t}*rim", size, f"grip at {name}") for t in texts], gain),
        Family([Term(PLACE, "vx_mps", t, 1.0, f"push at {name}") for t in along], push),
        Family(
            [Term(PLACE, "vy_mps", f"{t}*vx", size, "compass of the place") for t in texts], turned
        ),
    ]


def _of_drift(t_s: np.ndarray) -> list[Family]:
    """All that is captured moves or turns slowly, whatever the robot does."""
    longest_s = 1.1 * float(np.ptp(t_s))
    rates = [float(f"{2 * np.pi * k / longest_s:.4g}") for k in range(1, 1 + DRIFTS)]
    texts = [f"{wave}({rate:g}*t)" for wave in ("cos", "sin") for rate in rates]

    def swinging(own: Opened) -> np.ndarray:
        angle = own.floor.response.middle_s[:, None] * np.array(rates)
        return np.hstack([np.cos(angle), np.sin(angle)])

    def moving(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        heading, waves = own.floor.response.heading_rad[:, None], swinging(own)
        c, s = (TYPICAL["vx_mps"] * f(heading) * waves for f in (np.cos, np.sin))
        return {0: np.hstack([c, s]), 1: np.hstack([-s, c])}

    def turning(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: TYPICAL["omega_radps"] * swinging(own)}

    along = [f"drift({axis}, {t})" for axis in "xy" for t in texts]
    return [
        Family([Term(TIME, "vx_mps", t, 1.0, "drift") for t in along], moving),
        Family([Term(TIME, "omega_radps", t, 1.0, "drift of heading") for t in texts], turning),
    ]


def _humps(values: np.ndarray, count: int) -> tuple[np.ndarray, float]:
    """(k,) middles of humps that cover a range evenly, to three digits, and their half width."""
    low, high = float(np.min(values)), float(np.max(values))
    width = max((high - low) / count, 1e-9)
    middles = low + width * (np.arange(count) + 0.5)
    return np.array([float(f"{m:.3g}") for m in middles]), float(f"{width:.3g}")


def _hump(values: np.ndarray, middles: np.ndarray, width: float) -> np.ndarray:
    """(N, k) of (N, 1) values: 1 at a hump's middle, and 0 from its width on."""
    return np.maximum(0.0, 1.0 - np.abs(values - middles) / width)


def _text(name: str, middle: float, width: float) -> str:
    """A hump, as the effect `equation` takes it."""
    return f"max(0, 1 - abs({name} - {middle:g})/{width:g})"
