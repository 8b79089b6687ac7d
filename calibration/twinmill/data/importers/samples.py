# SPDX-License-Identifier: Apache-2.0
"""One table of several topics, as programs merge them: which rows are samples of one of them.

In a row of another topic all cells of this one are empty, which is no sample that was lost.
"""

from collections.abc import Collection

import numpy as np

from twinmill.data.importers.columns import is_usual
from twinmill.data.importers.topics import is_path
from twinmill.data.log import LogError
from twinmill.data.measurement_table import LOST, Table

FEWER = 0.5  # share of rows: of one's own that another topic's column stands in, or of all


def samples_of(
    table: Table, own: Collection[str], of_others: frozenset[str], *, loses: bool
) -> Table:
    """The table without rows in which all own columns are empty, unless they are lost samples.

    They are none where another topic's column stands in them. A column is another topic's where it
    mostly stands in rows without own ones: a counter of frames stands in those of lost poses as in
    all others. One that is known to be another topic's is so where some own rows lack it, or where
    it stands in all and own ones come in few, being slower. Where a program filled others' columns
    forward into all rows, the stamps tell: lost samples are on the beat of the others, not between.

    Args:
        table: with our names.
        own: columns of the topic, by our names.
        of_others: our names for columns of other topics.
        loses: whether a row in which nothing stands is a sample that was lost, as a tracker writes.
    """
    own = [name for name in own if name not in table.constants]
    places = [k for k, name in enumerate(table.header) if name in own]
    if not places or all(
        cell[-1:].isdecimal() for cells in table.rows.parts(places[0]) for cell in cells
    ):
        return table
    sampled = filled_in(table, places)
    if sampled.all() or not sampled.any():
        return table
    foreign, more = np.zeros((2, len(sampled)), bool)
    for k, name in enumerate(table.header):
        if k in places or name in ("t_s", "robot_id", *table.constants):
            continue
        filled, known = filled_in(table, [k]), is_path(name) or is_usual(name, of_others)
        more |= filled & ~sampled
        with_own = filled[sampled].mean()
        if with_own < FEWER or (known and (with_own < 1 or sampled.mean() < FEWER)):
            foreign |= filled
    foreign &= ~sampled
    rest = more & ~foreign
    if rest.any() and _between(table, sampled, rest):
        foreign |= rest
    if foreign.any() and not loses:
        return table.where(sampled)
    return table.where(~foreign)


def _between(table: Table, sampled: np.ndarray, rest: np.ndarray) -> bool:
    """True if most rows lie nearer to a sample of their robot than samples do to each other.

    Args:
        table: with our names.
        sampled: (rows,) bool, the samples.
        rest: (rows,) bool, the rows in question.
    """
    try:
        t_s = table.seconds("t_s")
    except LogError:  # told where stamps are read for good, of one robot
        return False
    robots = np.array(table.cells("robot_id") if table.has("robot_id") else [""] * len(t_s))
    near = np.zeros(len(t_s), bool)
    for robot in np.unique(robots[rest]):
        own_s = np.unique(t_s[sampled & (robots == robot)])
        if len(own_s) < 2:
            continue
        asked = rest & (robots == robot)
        behind = np.searchsorted(own_s, t_s[asked]).clip(1, len(own_s) - 1)
        away_s = np.abs(t_s[asked, None] - own_s[np.stack([behind - 1, behind], axis=1)])
        near[asked] = away_s.min(axis=1) < np.median(np.diff(own_s)) / 2
    return bool(near[rest].mean() >= FEWER)


def filled_in(table: Table, places: list[int]) -> np.ndarray:
    """(rows,) bool, where one of some columns, by their places, holds something."""
    filled = np.zeros(len(table.rows), bool)
    for k in places:
        filled |= np.fromiter(
            (cell.strip().lower() not in LOST for cells in table.rows.parts(k) for cell in cells),
            bool,
            len(filled),
        )
    return filled
