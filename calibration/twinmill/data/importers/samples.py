# SPDX-License-Identifier: Apache-2.0
"""One table of several topics, as programs merge them: which rows are samples of one of them.

In a row of another topic all cells of this one are empty, which is no sample that was lost.
"""

from collections.abc import Collection

import numpy as np

from twinmill.data.importers.columns import is_usual
from twinmill.data.importers.topics import is_path
from twinmill.data.measurement_table import LOST, Table

FEWER = 0.5  # share of rows: of one's own that another topic's column stands in, or of all


def samples_of(table: Table, own: Collection[str], of_others: frozenset[str]) -> Table:
    """The table without rows in which all own columns are empty and another topic's are not.

    A column is another topic's where it mostly stands in rows without own ones: a counter of frames
    stands in those of lost poses as in all others. One that is known to be another topic's is so
    where some own rows lack it, or where it stands in all and own ones come in few, being slower.

    Args:
        table: with our names.
        own: columns of the topic, by our names.
        of_others: our names for columns of other topics.
    """
    places = [k for k, name in enumerate(table.header) if name in own]
    if not places or all(
        cell[-1:].isdecimal() for cells in table.rows.parts(places[0]) for cell in cells
    ):
        return table
    sampled = filled_in(table, places)
    if sampled.all() or not sampled.any():
        return table
    foreign = np.zeros(len(sampled), bool)
    for k, name in enumerate(table.header):
        if k in places or name in ("t_s", "robot_id"):
            continue
        filled, known = filled_in(table, [k]), is_path(name) or is_usual(name, of_others)
        with_own = filled[sampled].mean()
        if with_own < FEWER or (known and (with_own < 1 or sampled.mean() < FEWER)):
            foreign |= filled
    return table.where(sampled | ~foreign)


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
