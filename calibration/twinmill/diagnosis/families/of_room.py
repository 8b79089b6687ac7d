# SPDX-License-Identifier: Apache-2.0
"""Families of effects at some places of the room, or in some directions of motion."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product

import numpy as np

from twinmill.diagnosis.families.family import HUMPS, Family, Humps, pushed
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANNELS, PLACE, SWELL, TYPICAL, Term, moves, times

LEAST_M = 0.15  # between the middles of two humps over the place
SQUARES = 3  # along each side
SIZE = TYPICAL["rim_mps"] / SWELL
TURNS = TYPICAL["omega_radps"] / SWELL


def of_places(pose: np.ndarray) -> list[Family]:
    """Over all (N, 2) places of logs: in strips along either side of the floor, and in squares."""
    along = [_over(axis, pose[:, axis], HUMPS) for axis in range(2)]
    found = []
    for axis, humps in enumerate(along):
        if humps:
            found += _at("xy"[axis], humps.texts("xy"[axis]), partial(_strips, axis, humps))
    sides = [humps for axis in range(2) if (humps := _over(axis, pose[:, axis], SQUARES))]
    if len(sides) == 2:
        across = product(*(humps.texts(name) for humps, name in zip(sides, "xy", strict=True)))
        found += _at("squares", ["*".join(pair) for pair in across], partial(_squares, sides))
    return found


def of_pushes() -> list[Family]:
    """The whole floor pushes, as if it sloped, or a wind on a fin turns the robot."""
    texts = [f"{wave}(theta)*moves" for wave in ("cos", "sin")]

    def push(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return pushed(own, moves(velocity)[:, None])

    def veer(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        heading = own.response.heading_rad
        waves = np.column_stack([np.cos(heading), np.sin(heading)])
        return {2: TYPICAL["omega_radps"] * waves * moves(velocity)[:, None]}

    return [
        Family([Term("heading", CHANNELS[0], t, 1.0, "push") for t in texts], push),
        Family([Term("heading", CHANNELS[2], t, 1.0, "veers by heading") for t in texts], veer),
    ]


def _over(axis: int, place: np.ndarray, most: int) -> Humps | None:
    """Humps over one side; None if it is too short for two."""
    count = min(most, int(np.ptp(place) / LEAST_M))
    return Humps.over(float(place.min()), float(place.max()), count) if count > 1 else None


def _strips(axis: int, humps: Humps, own: Opened) -> np.ndarray:
    return humps.of(own.response.pose[:, [axis]])


def _squares(sides: Sequence[Humps], own: Opened) -> np.ndarray:
    x, y = (_strips(axis, humps, own) for axis, humps in enumerate(sides))
    return (x[:, :, None] * y[:, None, :]).reshape(len(x), -1)


def _at(where: str, texts: Sequence[str], bells: Callable[[Opened], np.ndarray]) -> list[Family]:
    """Families for one kind of place.

    All speeds change alike, or turning alone. The floor pushes along the room, or adds a rate of
    its own to one axis of the body. Iron turns a compass.

    Args:
        where: a name for the places.
        texts: of the K bells.
        bells: (N, K) of a log: 1 in the middle of each place.
    """

    def gain(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        gains = SWELL * bells(own)
        return {k: gains * velocity[:, [k]] for k in range(3)}

    def push(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return pushed(own, bells(own) * moves(velocity)[:, None])

    def turn(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: SWELL * bells(own) * velocity[:, [2]]}

    def added(axis: int, own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {axis: TYPICAL[CHANNELS[axis]] * bells(own) * moves(velocity)[:, None]}

    def turned(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        angles = SWELL * bells(own)
        return {0: -angles * velocity[:, [1]], 1: angles * velocity[:, [0]]}

    toward = [f"{t}*{wave}(theta)*moves" for wave in ("cos", "sin") for t in texts]
    return [
        Family([Term(PLACE, "rim_mps", f"{t}*rim", SIZE, f"grip at {where}") for t in texts], gain),
        Family(
            [Term(PLACE, CHANNELS[2], f"{t}*omega", TURNS, f"turns at {where}") for t in texts],
            turn,
        ),
        Family([Term(PLACE, "vx_mps", t, 1.0, f"push at {where}") for t in toward], push),
        *(
            Family(
                [Term(PLACE, to, f"{t}*moves", 1.0, f"{to} added at {where}") for t in texts],
                partial(added, axis),
            )
            for axis, to in enumerate(CHANNELS)
        ),
        Family(
            [Term(PLACE, "vy_mps", f"{t}*vx", SIZE, f"compass at {where}") for t in texts], turned
        ),
    ]


def of_course(n: int) -> Family:
    """The floor's pile, a wind: n times a turn of the course, it is quicker, or is led aside."""
    texts = [f"{w}({times(n, 'course')})*{t}" for t in ("travel", "aside") for w in ("cos", "sin")]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        ahead, left = velocity[:, [0]], velocity[:, [1]]
        course = n * (own.response.heading_rad[:, None] + np.arctan2(left, ahead))
        waves = SWELL * np.hstack([np.cos(course), np.sin(course)])
        return {
            0: np.hstack([waves * ahead, -waves * left]),
            1: np.hstack([waves * left, waves * ahead]),
        }

    return Family([Term("heading", "vx_mps", t, SIZE, f"course {n}") for t in texts], values)
