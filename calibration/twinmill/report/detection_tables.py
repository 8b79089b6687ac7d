# SPDX-License-Identifier: Apache-2.0
"""Predicted and measured bits as tables."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from twinmill.predict.detection_errors import SHOWN, Confusion, DetectionComparison
from twinmill.report.tables import Cell, Table, number, tone

BINS = 6
COLUMNS = ["seen\nboth", "missed", "false", "unseen\nboth", "agree"]


def detection_steps(steps: Sequence[tuple[str | None, float]]) -> Table:
    """The camera's effects as they were found, on frames that were not fitted to."""
    rows = [
        [Cell(f"+ {effect}" if effect else "as given"), Cell(number(score, 4), tone(score))]
        for effect, score in steps
    ]
    return Table(
        "The bits, step by step",
        ["step", "held-out\nscore"],
        rows,
        "On frames that were not fitted to: 1.0 is right.",
        words=(0,),
    )


def detection_tables(bits: DetectionComparison) -> list[Table]:
    """By robot, and by range and bearing of the nearest robot."""
    return [_by_robot(bits), _by_place(bits)]


def _by_robot(bits: DetectionComparison) -> Table:
    rows = [
        [Cell(label), *_counts(confusion), Cell(number(score), tone(score))]
        for label, confusion, score in bits.by_robot()
    ]
    if len(rows) > 1:
        total = [Cell("all"), *_counts(bits.confusion), Cell(number(bits.score), tone(bits.score))]
        rows.append(total)
    vote = (
        ""
        if bits.vote_agreement is None
        else f" The voted bit follows from the raw ones in {100 * bits.vote_agreement:.1f} % of "
        "the frames."
    )
    return Table(
        f"The camera's bit ({'raw' if bits.raw else 'after the vote'})",
        ["robot", *COLUMNS, "score"],
        rows,
        "Frames by what the model's geometry says and what the robot reported; score: how far off "
        "the model's chances are over how far such chances must be, 1.0 is right." + vote,
    )


def _by_place(bits: DetectionComparison) -> Table:
    rows = []
    edges = np.linspace(0, SHOWN * bits.reach_m, BINS + 1)
    inside = np.abs(bits.bearing_rad) < bits.half_rad
    for near, far in pairwise(edges):
        for ahead in (True, False):
            here = (bits.range_m >= near) & (bits.range_m < far) & (inside == ahead)
            if here.any():
                confusion = Confusion.of(bits.in_view[here], bits.measured[here])
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
