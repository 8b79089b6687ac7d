# SPDX-License-Identifier: Apache-2.0
"""Tables whose robots stand side by side (`r1_x`, `r1_y`, `r2_x` ...), made one row a robot."""

import re
from dataclasses import replace

import numpy as np

from twinmill.data.importers.columns import is_usual
from twinmill.data.importers.samples import FEWER, filled_in
from twinmill.data.importers.topics import is_path
from twinmill.data.measurement_table import Table
from twinmill.data.packed_rows import PackedRows

ROBOT = "robot_id"
# A robot has a number: before the name of what is measured (`r1_x`, `robot2.yaw`), or after it.
BEFORE = re.compile(r"^/?(?P<robot>[A-Za-z]*[_ ]?\d+)[_. /](?P<name>.+)$")
AFTER = re.compile(r"^(?P<name>.+?)[_. /]?(?P<robot>(robot|r)?\d+)$", re.IGNORECASE)
FEWEST = 2  # robots, and columns of each


def in_rows(table: Table) -> Table:
    """Table with a column `robot_id`, if the given columns are those of several robots.

    All robots must have the same columns, each of a usual name. Others stay, as the time.
    """
    if table.has(ROBOT):
        return table
    for pattern in (BEFORE, AFTER):
        places = _places(table, pattern)
        names = [list(columns) for columns in places.values()]
        alike = bool(names) and names.count(names[0]) == len(names)
        if alike and len(names) >= FEWEST and len(names[0]) >= FEWEST:
            return _stacked(table, places)
    return table


def _places(table: Table, pattern: re.Pattern) -> dict[str, dict[str, int]]:
    """Where each column of each robot stands in a row."""
    places: dict[str, dict[str, int]] = {}
    for k, column in enumerate(table.header):
        found = pattern.match(column)
        of_robot = is_path(column) or not is_usual(column, table.known)
        if found and of_robot and is_usual(found["name"], table.known):
            places.setdefault(found["robot"], {})[found["name"]] = k
    return places


def _stacked(table: Table, places: dict[str, dict[str, int]]) -> Table:
    of_robots = {k for columns in places.values() for k in columns.values()}
    shared = [k for k in range(len(table.header)) if k not in of_robots]
    names = list(next(iter(places.values())))
    sampled = _sampled(table, places)
    rows, line = PackedRows(), []
    for n, (row, number) in enumerate(zip(table.rows, table.line, strict=True)):
        for robot, columns in places.items():
            if sampled[robot][n]:
                rows.append([*(row[k] for k in shared), robot, *(row[columns[c]] for c in names)])
                line.append(number)
    note = f"{table.name}: the robots {', '.join(places)} stand side by side; each has its rows."
    return replace(
        table,
        header=[*(table.header[k] for k in shared), ROBOT, *names],
        rows=rows,
        line=np.array(line),
        notes=[*table.notes, note],
    )


def _sampled(table: Table, places: dict[str, dict[str, int]]) -> dict[str, np.ndarray]:
    """(rows,) bool by robot: those with something of it; all, unless others mostly stand elsewhere.

    Robots that one frame shows have rows in common: one that is empty there was lost.
    """
    filled = {robot: filled_in(table, [*own.values()]) for robot, own in places.items()}
    for robot, own in filled.items():
        others = np.any([f for name, f in filled.items() if name != robot], axis=0)
        if not own.any() or others[own].mean() >= FEWER:
            filled[robot] = np.ones(len(own), bool)
    return filled
