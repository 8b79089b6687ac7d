# SPDX-License-Identifier: Apache-2.0
"""A sweep as a phase diagram: in each cell what becomes of the swarm, and how surely."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from twinmill.swarm.axes import Axis
from twinmill.swarm.classes import COLORS, interval, reached
from twinmill.swarm.request import Request

CLASSES = list(COLORS)


@dataclass(frozen=True)
class Phase:
    """Counts by cell; cells in the order of `points`.

    Attributes:
        points: (C, axes) axis values.
        counts: (C, classes) seeds that ended in each of CLASSES.
        hits: (C,) seeds that reached the goal.
        seeds: in each cell.
        circliness, radius_m, odd_ratio: (C,) medians over seeds.
    """

    request: Request
    table: pa.Table
    goal: str
    points: np.ndarray
    counts: np.ndarray
    hits: np.ndarray
    seeds: int
    circliness: np.ndarray
    radius_m: np.ndarray
    odd_ratio: np.ndarray

    @property
    def axes(self) -> list[Axis]:
        """Axes of the sweep, in the order of its dimensions."""
        return self.request.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis, the first axis last, as numpy indexes `points`."""
        return tuple(len(axis.values) for axis in reversed(self.axes))

    @property
    def mode(self) -> np.ndarray:
        """(C,) index in CLASSES of the most frequent class."""
        return self.counts.argmax(axis=1)

    @property
    def share(self) -> np.ndarray:
        """(C, classes) probability of each class."""
        return self.counts / self.seeds

    @property
    def outcomes(self) -> np.ndarray:
        """(C, kinds) probabilities of what a run can show: the classes, or goal and no goal."""
        if self.goal in CLASSES:
            return self.share
        hit = self.hits / self.seeds
        return np.stack([hit, 1 - hit], axis=1)

    def intervals(self) -> np.ndarray:
        """(C, 2) 95 % interval of the probability of the goal."""
        return np.array([interval(hits, self.seeds) for hits in self.hits])

    def where(self, cell: int, axes: int | None = None) -> str:
        """A cell in words, of the first so many axes; what is the same in all cells is left out."""
        pairs = list(zip(self.axes, self.points[cell], strict=True))[:axes]
        varied = [f"{axis.name} {value:.4g}" for axis, value in pairs if len(axis.values) > 1]
        return ", ".join(varied) or "the only cell"

    def slice(self, at: dict[str, float]) -> np.ndarray:
        """(rows, columns) cells over the second and first axis; the others at values near `at`."""
        index = np.arange(len(self.points)).reshape(self.shape)
        for axis in reversed(self.axes[2:]):
            wanted = at.get(axis.name, axis.values[len(axis.values) // 2])
            index = index[int(np.argmin(np.abs(np.array(axis.values) - wanted)))]
        return np.atleast_2d(index)

    def to_json(self) -> list[dict[str, Any]]:
        """One object for each cell."""
        bounds = self.intervals()
        return [
            {
                **dict(zip((a.name for a in self.axes), point.tolist(), strict=True)),
                "class": CLASSES[self.mode[c]],
                "counts": {
                    name: int(k) for name, k in zip(CLASSES, self.counts[c], strict=True) if k
                },
                "probability": float(self.hits[c] / self.seeds),
                "low": bounds[c, 0],
                "high": bounds[c, 1],
                "circliness": self.circliness[c],
                "radius_m": self.radius_m[c],
            }
            for c, point in enumerate(self.points)
        ]


def phase_of(request: Request, table: pa.Table, goal: str) -> Phase:
    """Sums up a sweep's rows by cell."""
    cells, seeds = len(request.points), request.seeds
    ended = np.array([CLASSES.index(name) for name in table["class"].to_pylist()])
    ended = ended.reshape(cells, seeds)

    def median(name: str) -> np.ndarray:
        return np.median(table[name].to_numpy().reshape(cells, seeds), axis=1)

    return Phase(
        request=request,
        table=table,
        goal=goal,
        points=np.array(request.points),
        counts=np.stack([(ended == k).sum(axis=1) for k in range(len(CLASSES))], axis=1),
        hits=reached(table, goal).reshape(cells, seeds).sum(axis=1),
        seeds=seeds,
        circliness=median("circliness"),
        radius_m=median("radius_m"),
        odd_ratio=median("odd_ratio"),
    )
