# SPDX-License-Identifier: Apache-2.0
"""A printed sheet that a hand pushes along a ruler, with stops at its marks: how far poses are off.

Where the ruler lies and which way its marks run is fitted; its length is not. What is left is the
error of the poses, and that of the hand: about half a millimetre for reading a mark.
"""

from dataclasses import dataclass

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.series import PoseSeries
from twinmill.data.log import heading_rad

GOOD_M, GOOD_RAD = 0.003, float(np.radians(1.0))  # what poses of a camera are good for
WINDOW_S = 0.6  # over which a speed is measured
STILL_MPS = 0.006  # a hand holds a sheet steadier than that, and pushes it faster
SHORTEST_S = 0.8  # of a stop
SAME = 0.25  # of the least distance of marks: stops that are nearer are one


@dataclass(frozen=True)
class Stop:
    """The sheet at one mark.

    Attributes:
        mark_m: as the ruler says.
        along_m, across_m: where the poses put it, in the axes of the ruler.
        turn_rad: from its mean heading.
        from_s, to_s: when it lay there.
    """

    mark_m: float
    along_m: float
    across_m: float
    turn_rad: float
    from_s: float
    to_s: float

    @property
    def miss_m(self) -> float:
        """How far the poses are from the mark."""
        return float(np.hypot(self.along_m - self.mark_m, self.across_m))


@dataclass(frozen=True)
class Ruler:
    """Agreement of the poses with a ruler along which a tag was moved by hand.

    Attributes:
        stops: in the order of the marks.
        scale: length by the poses over that by the ruler.
        noise_m, noise_rad: standard deviation of a pose at rest, the hand's tremor included.
    """

    stops: list[Stop]
    scale: float
    noise_m: float
    noise_rad: float

    @property
    def miss_m(self) -> float:
        """The worst."""
        return max(stop.miss_m for stop in self.stops)

    @property
    def turn_rad(self) -> float:
        """The worst."""
        return max(abs(stop.turn_rad) for stop in self.stops)

    @property
    def good(self) -> bool:
        """True if each stop is where the ruler says."""
        return self.miss_m <= GOOD_M and self.turn_rad <= GOOD_RAD

    @property
    def sentence(self) -> str:
        """The verdict, and where to look if it is bad."""
        miss = f"{1e3 * self.miss_m:.1f} mm and {np.degrees(self.turn_rad):.2f}° at worst"
        limits = f"{1e3 * GOOD_M:g} mm and {np.degrees(GOOD_RAD):g}°"
        if self.good:
            return f"Good: {miss}, within {limits}."
        bad = f"Not good: {miss}, beyond {limits}; "
        span_m = self.stops[-1].mark_m - self.stops[0].mark_m
        if abs(self.scale - 1) * span_m > self.miss_m:  # half of it at either end
            longer = "long" if self.scale > 1 else "short"
            return (
                f"{bad}lengths come out {100 * abs(self.scale - 1):.1f} % too {longer}: see "
                f"{option('height')} (0 for a sheet on the floor), the floor's points and the tape."
            )
        if self.miss_m <= GOOD_M:
            return f"{bad}the sheet turned: push it along the ruler by its edge, and film again."
        worst = max(self.stops, key=lambda stop: stop.miss_m)
        return (
            f"{bad}worst at the mark {1e3 * worst.mark_m:g} mm: see the floor's points, and the "
            "lens in that part of the picture."
        )


def against_ruler(poses: PoseSeries, marks_m: list[float]) -> Ruler:
    """How poses of a sheet agree with the marks at which it stopped, in their order.

    Raises:
        ValueError: it did not stop as often as there are marks.
    """
    t_s = 1e-6 * poses.utime_us[poses.valid]
    xy_m = poses.position_m[poses.valid, :2]
    theta = np.unwrap(heading_rad(poses.orientation_wxyz[poses.valid]))
    marks = np.array(marks_m)
    rests = _rests(t_s, xy_m, SAME * np.abs(np.diff(marks)).min())
    if len(rests) != len(marks):
        seen = ", ".join(f"{t_s[a]:.1f} to {t_s[b - 1]:.1f} s" for a, b in rests) or "none"
        raise ValueError(
            f"{len(rests)} stops are seen ({seen}), but {len(marks)} marks are given; let the "
            "sheet lie still for two seconds at each mark, also the first and the last, push "
            "it on within some seconds, and keep hands off its tag."
        )
    place = np.array([xy_m[a:b].mean(axis=0) for a, b in rests])
    turn = np.array([theta[a:b].mean() for a, b in rests])
    way = (marks - marks.mean()) @ place
    way /= np.linalg.norm(way)
    along = (place - place.mean(axis=0)) @ way + marks.mean()
    across = (place - place.mean(axis=0)) @ [-way[1], way[0]]
    off = [np.column_stack([xy_m[a:b], theta[a:b]]) for a, b in rests]
    spread = np.vstack([part - part.mean(axis=0) for part in off]).std(axis=0)
    stops = [
        Stop(*map(float, row), float(t_s[a]), float(t_s[b - 1]))
        for row, (a, b) in zip(
            zip(marks, along, across, turn - turn.mean(), strict=True), rests, strict=True
        )
    ]
    scale = float(np.polyfit(marks, along, 1)[0])
    return Ruler(stops, scale, float(np.hypot(*spread[:2]) / np.sqrt(2)), float(spread[2]))


def _rests(t_s: np.ndarray, xy_m: np.ndarray, apart_m: float) -> list[tuple[int, int]]:
    """First row and end of each stop; what a tremor breaks is one, if it is in one place."""
    still = np.array([_speed_mps(t_s, xy_m, at_s) < STILL_MPS for at_s in t_s])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
    joined: list[tuple[int, int]] = []
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if joined and np.linalg.norm(_middle(xy_m, (a, b)) - _middle(xy_m, joined[-1])) < apart_m:
            joined[-1] = (joined[-1][0], b)
        else:
            joined.append((a, b))
    return [(a, b) for a, b in joined if t_s[b - 1] - t_s[a] >= SHORTEST_S]


def _middle(xy_m: np.ndarray, rows: tuple[int, int]) -> np.ndarray:
    return np.median(xy_m[slice(*rows)], axis=0)


def _speed_mps(t_s: np.ndarray, xy_m: np.ndarray, at_s: float) -> float:
    """By a straight line through the poses about a time; infinite where there are too few."""
    near = np.abs(t_s - at_s) <= WINDOW_S / 2
    if np.count_nonzero(near) < 3:
        return np.inf
    return float(np.linalg.norm(np.polyfit(t_s[near] - at_s, xy_m[near], 1)[0]))
