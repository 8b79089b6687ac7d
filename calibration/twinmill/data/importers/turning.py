# SPDX-License-Identifier: Apache-2.0
"""Unit of headings, told by the path: as a robot drives round, its heading turns as its course."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

PARTS = 60  # legs of a path, about, over which course and heading are compared
FEWEST = 8  # turns from leg to leg that tell anything
LEAST_RAD = 0.1  # a smaller turn may be noise
CLEARER = 3.0  # times worse than the other unit must be
FACTORS = {"rad": 1.0, "deg": math.pi / 180}


def unit_of_heading(runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> str:
    """Unit, "rad" or "deg", in which headings turn as paths do; empty where that is not told.

    Robots that drive sideways as well tell nothing, nor do those that drive straight on.

    Args:
        runs: of each robot (N, 2) places, in any unit, and (N,) headings.
    """
    turns = [t for xy, heading in runs for t in _turns(xy, heading)]
    if len(turns) < FEWEST:
        return ""
    course, turned = np.array(turns).T
    off = {u: np.median(np.abs(_wrapped(course - turned * f))) for u, f in FACTORS.items()}
    best = min(off, key=lambda unit: off[unit])
    return best if CLEARER * off[best] < max(off.values()) else ""


def _turns(xy: np.ndarray, heading: np.ndarray) -> list[tuple[float, float]]:
    """Turn of the course (rad) and of the heading, from each leg of a path to the next."""
    whole = np.isfinite(xy).all(axis=1) & np.isfinite(heading)
    xy, heading = xy[whole], heading[whole]
    if len(xy) < FEWEST:
        return []
    least = np.hypot(*np.ptp(xy, axis=0)) * math.pi / PARTS
    ends = [0]
    for k in range(1, len(xy)):
        if np.hypot(*(xy[k] - xy[ends[-1]])) > least > 0:
            ends.append(k)
    course = np.arctan2(*np.diff(xy[ends], axis=0).T[::-1])
    middle = heading[[(a + b) // 2 for a, b in pairwise(ends)]]
    steps = zip(_wrapped(np.diff(course)), np.diff(middle), strict=True)
    return [(c, h) for c, h in steps if abs(c) > LEAST_RAD]


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.remainder(angle + math.pi, 2 * math.pi) - math.pi
