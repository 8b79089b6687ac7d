# SPDX-License-Identifier: Apache-2.0
"""Rows of a table that no moment belongs to: damaged stamps, and rows that were written twice."""

from dataclasses import replace

import numpy as np

from twinmill.counted import counted
from twinmill.data.log import ALONE
from twinmill.data.measurement_table import Table

LEAST_S = 1.0  # nearer than that to the others a stamp is no damaged one
BACK, BACK_SHARE = 2, 0.02  # rows out of order, of so few, are damaged by the longest other step
FEWEST = 5  # rows that tell how the others lie
REPEATED = 0.9  # share of the rows under a stamp that they share with another, of equal values
MOST_NAMED = 3  # damaged rows in a sentence


def sound_rows(table: Table, t_s: np.ndarray, ids: np.ndarray) -> tuple[Table, np.ndarray]:
    """The table without such rows, with a sentence on each kind, and which rows are left.

    Args:
        table: as it was read.
        t_s: (rows,) stamps.
        ids: (rows,) robots.
    """
    kept, notes = np.ones(len(t_s), bool), list(table.notes)
    for number in np.unique(ids):
        rows = np.flatnonzero(ids == number)
        damaged = rows[_damaged(t_s[rows])]
        kept[damaged] = False
        if len(damaged):
            notes.append(_of_damaged(table, t_s, damaged, int(number)))
        twice = _written_twice(table, t_s, rows[kept[rows]])
        kept[twice] = False
        if len(twice):
            repeated = counted(len(twice), "row repeats", "rows repeat")
            notes.append(
                f"{table.name}: robot {number}: {repeated} another's stamp and values; each was "
                "taken once."
            )
    if kept.all():
        return table, kept
    return replace(table.where(kept), notes=notes), kept


def repeats(where: str, count: int, total: int, noun: str) -> str:
    """Sentence on samples that came under the stamp of another, of which one was kept.

    Args:
        where: the file, the robot, the topic.
        count: of those that were not kept.
        total: of all.
        noun: for one of them.
    """
    repeat = "repeats" if count == 1 else "repeat"
    told = f"{where}: {count} of {total} {noun}s {repeat} a stamp; the last of each was kept"
    if count < total / 2:
        return f"{told}."
    return f"{told}: stamps are coarser than the times between {noun}s; write all their digits."


def _damaged(t_s: np.ndarray) -> np.ndarray:
    """Places of stamps that lie by themselves, far before or after all the others.

    A first command may be held for long, and so may the last but one: in the order of the file a
    stamp must lie further away to be no moment of this run. In a file without order none is out of
    it.
    """
    left, found = np.argsort(t_s, kind="stable"), []
    ordered = np.count_nonzero(np.diff(t_s) < 0) <= BACK + BACK_SHARE * len(t_s)
    while len(left) > FEWEST:
        gaps_s = np.diff(t_s[left])
        for end, gap_s, others_s in ((0, gaps_s[0], gaps_s[1:]), (-1, gaps_s[-1], gaps_s[:-1])):
            in_place = left[end] == (left.min() if end == 0 else left.max())
            most_s = others_s.max() if ordered and not in_place else ALONE * others_s.sum()
            if gap_s > max(LEAST_S, most_s):
                found.append(left[end])
                left = np.delete(left, end)
                break
        else:
            break
    return np.array(sorted(found), int)


def _of_damaged(table: Table, t_s: np.ndarray, damaged: np.ndarray, number: int) -> str:
    named = [f"row {table.line[k]} ({t_s[k]:.10g} s)" for k in damaged[:MOST_NAMED]]
    more = f" and {len(damaged) - MOST_NAMED} more" if len(damaged) > MOST_NAMED else ""
    return (
        f"{table.name}: robot {number}: the stamp of {', '.join(named)}{more} is far from all the "
        "others, so it is damaged; left out."
    )


def _written_twice(table: Table, t_s: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows, of those of one robot, that only say again what another says of the same moment.

    Frames of a robot that stands may come under one stamp: they are frames where those of a robot
    that moves differ.
    """
    rows = rows[np.argsort(t_s[rows], kind="stable")]
    same_stamp = np.flatnonzero(np.diff(t_s[rows]) == 0) + 1
    again = [k for k in same_stamp if table.rows[rows[k]] == table.rows[rows[k - 1]]]
    enough = len(again) > 0 and len(again) >= REPEATED * len(same_stamp)
    return rows[again] if enough else np.empty(0, int)
