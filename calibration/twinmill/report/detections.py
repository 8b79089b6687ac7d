# SPDX-License-Identifier: Apache-2.0
"""Predicted and measured detections of cameras, as tables and as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from twinmill.predict.detection_errors import SHOWN, Confusion, DetectionComparison
from twinmill.report.canvas import draw
from twinmill.report.html import Figure
from twinmill.report.tables import Cell, Table, number, tone

if TYPE_CHECKING:
    pass

BINS = 6
COLUMNS = ["seen\nboth", "missed", "false", "unseen\nboth", "agree"]
FEWEST = 10  # frames of a place that tell a share


def steps(found: Sequence[tuple[str | None, float]]) -> Table:
    """Scores of the detections with each of the camera's effects that were found."""
    rows = [
        [Cell(f"+ {effect}" if effect else "as given"), Cell(number(score, 4), tone(score))]
        for effect, score in found
    ]
    return Table(
        "Detections: score after each step",
        ["step", "score"],
        rows,
        "1.0 is as good as a right model.",
        words=(0,),
    )


def confusion_tables(detections: DetectionComparison) -> list[Table]:
    """By robot, and by range and bearing of the nearest robot."""
    return [_by_robot(detections), _by_place(detections)]


def _by_robot(detections: DetectionComparison) -> Table:
    rows = [
        [Cell(label), *_counts(confusion), Cell(number(score), tone(score))]
        for label, confusion, score in detections.by_robot()
    ]
    if len(rows) > 1:
        total = [
            Cell("all"),
            *_counts(detections.confusion),
            Cell(number(detections.score), tone(detections.score)),
        ]
        rows.append(total)
    agreed = detections.vote_agreement
    vote = (
        ""
        if agreed is None
        else f" The voted bit follows from the raw ones in {100 * agreed:.1f} % of the frames."
    )
    return Table(
        f"The camera's bit ({'raw' if detections.raw else 'after the vote'})",
        ["robot", *COLUMNS, "score"],
        rows,
        "Frames by what the model's geometry predicts and what the robot reported; score: error of "
        "the predicted probabilities over its expectation for a right model, 1.0 is right." + vote,
    )


def _by_place(detections: DetectionComparison) -> Table:
    rows = []
    edges = np.linspace(0, SHOWN * detections.reach_m, BINS + 1)
    inside = np.abs(detections.bearing_rad) < detections.half_rad
    for near, far in pairwise(edges):
        for ahead in (True, False):
            here = (detections.range_m >= near) & (detections.range_m < far) & (inside == ahead)
            if here.any():
                confusion = Confusion.of(detections.in_view[here], detections.measured[here])
                where = "in the cone" if ahead else "beside it"
                rows.append([Cell(f"{near:.2f} to {far:.2f} m"), Cell(where), *_counts(confusion)])
    return Table(
        "Bits by the place of the nearest robot",
        ["range", "bearing", *COLUMNS],
        rows,
        words=(0, 1),
    )


def _counts(c: Confusion) -> list[Cell]:
    return [
        Cell(str(c.true_positive)),
        Cell(str(c.false_positive), "dim"),
        Cell(str(c.false_negative), "dim"),
        Cell(str(c.true_negative)),
        Cell(f"{100 * c.agreement:.1f} %"),
    ]


def field_of_view(detections: DetectionComparison, title: str = "What the camera sees") -> Figure:
    """Share of frames that see, over range and bearing of the nearest robot."""
    cells = detections.cells()
    ranges = sorted({r for c in cells for r in c["range_m"]})
    bearings = np.degrees(sorted({b for c in cells for b in c["bearing_rad"]}))
    kinds = ("measured", "predicted")
    shares = {kind: np.full((len(ranges) - 1, len(bearings) - 1), np.nan) for kind in kinds}
    for cell in (c for c in cells if c["frames"] >= FEWEST):
        r = ranges.index(cell["range_m"][0])
        b = int(np.searchsorted(bearings, np.degrees(cell["bearing_rad"][0]) - 1e-6))
        for kind in kinds:
            shares[kind][r, b] = cell[f"{kind}_share"]

    def paint(panels: np.ndarray) -> None:
        for axes, kind in zip(panels, kinds, strict=True):
            mesh = axes.pcolormesh(
                bearings, ranges, shares[kind], cmap="viridis", vmin=0, vmax=1, rasterized=False
            )
            half = min(np.degrees(detections.half_rad), 180)
            axes.plot(
                [-half, -half, half, half],
                [0, detections.reach_m, detections.reach_m, 0],
                color="#d55e00",
            )
            axes.set(title=kind, xlabel="bearing (°), left positive", xticks=[-90, 0, 90])
            axes.invert_xaxis()
            axes.grid(visible=False)
        panels[0].set_ylabel("range of the nearest robot (m)")
        panels[0].figure.colorbar(mesh, ax=panels, label="share of frames that see", shrink=0.8)

    return Figure(
        draw(3.0, paint, ncols=2, sharey=True),
        title,
        "Share of frames whose bit is 1, by where the nearest robot was. Inside the orange line "
        "the model's camera sees. Both pictures should be alike; light outside the line is a false "
        "or a farther robot's detection, dark inside a missed one. Places of fewer than "
        f"{FEWEST} frames are left white.",
    )
