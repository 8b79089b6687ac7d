# SPDX-License-Identifier: Apache-2.0
"""What acts at some places of the room, or while the robot moves in some of its directions."""

import numpy as np

from twinmill.diagnosis.families.family import HUMPS, Family, Humps
from twinmill.diagnosis.term import PLACE, SWELL, TYPICAL, Term, moves
from twinmill.fitting.opening import Opened

LEAST_M = 0.15  # between the middles of two humps over the place
SIZE = TYPICAL["rim_mps"] / SWELL


def of_place(axis: int, place: np.ndarray) -> list[Family]:
    """At some places all speeds change alike, the floor pushes, or iron turns a compass."""
    name = "xy"[axis]
    count = min(HUMPS, int(np.ptp(place) / LEAST_M))
    if count < 2:
        return []
    humps = Humps.over(float(place.min()), float(place.max()), count)
    texts = humps.texts(name)

    def gain(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        gains = SWELL * humps.of(own.floor.response.pose[:, [axis]])
        return {k: gains * velocity[:, [k]] for k in range(3)}

    def push(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        response = own.floor.response
        pushes = TYPICAL["vx_mps"] * humps.of(response.pose[:, [axis]])
        pushes *= moves(velocity)[:, None]
        waves = [f(response.heading_rad)[:, None] for f in (np.cos, np.sin)]
        return {0: np.hstack([w * pushes for w in waves])}

    def turned(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        angles = SWELL * humps.of(own.floor.response.pose[:, [axis]])
        return {0: -angles * velocity[:, [1]], 1: angles * velocity[:, [0]]}

    along = [f"{t}*{wave}(theta)*moves" for wave in ("cos", "sin") for t in texts]
    return [
        Family([Term(PLACE, "rim_mps", f"{t}*rim", SIZE, f"grip at {name}") for t in texts], gain),
        Family([Term(PLACE, "vx_mps", t, 1.0, f"push at {name}") for t in along], push),
        Family(
            [Term(PLACE, "vy_mps", f"{t}*vx", SIZE, "compass of the place") for t in texts], turned
        ),
    ]


def of_course(n: int) -> Family:
    """The floor's pile, a wind: n times a turn of the course, it is quicker, or is led aside."""
    texts = [f"{w}({n}*course)*{t}" for t in ("travel", "aside") for w in ("cos", "sin")]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        ahead, left = velocity[:, [0]], velocity[:, [1]]
        course = n * (own.floor.response.heading_rad[:, None] + np.arctan2(left, ahead))
        waves = SWELL * np.hstack([np.cos(course), np.sin(course)])
        return {
            0: np.hstack([waves * ahead, -waves * left]),
            1: np.hstack([waves * left, waves * ahead]),
        }

    return Family([Term("heading", "vx_mps", t, SIZE, f"course {n}") for t in texts], values)
