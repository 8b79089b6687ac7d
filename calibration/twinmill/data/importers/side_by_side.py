# SPDX-License-Identifier: Apache-2.0
"""Tables whose robots stand side by side (`r1_x`, `r1_y`, `r2_x` ...), made one row a robot."""

import re
from dataclasses import replace

from twinmill.data.importers.columns import is_usual
from twinmill.data.measurement_table import Table

ROBOT = "robot_id"
# A robot has a number: before the name of what is measured (`r1_x`, `robot2.yaw`), or after it.
BEFORE = re.compile(r"^(?P<robot>[A-Za-z]*[_ ]?\d+)[_. /](?P<name>.+)$")
AFTER = re.compile(r"^(?P<name>.+?)[_. /]?(?P<robot>(robot|r)?\d+)$", re.IGNORECASE)
FEWEST = 2  # robots, and columns of each


def in_rows(table: Table) -> Table:
    """The same table with a column `robot_id`, if its columns are those of several robots.

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
        if found and not is_usual(column, table.known) and is_usual(found["name"], table.known):
            places.setdefault(found["robot"], {})[found["name"]] = k
    return places


def _stacked(table: Table, places: dict[str, dict[str, int]]) -> Table:
    of_robots = {k for columns in places.values() for k in columns.values()}
    shared = [k for k in range(len(table.header)) if k not in of_robots]
    names = list(next(iter(places.values())))
    rows = [
        [*(row[k] for k in shared), robot, *(row[columns[name]] for name in names)]
        for row in table.rows
        for robot, columns in places.items()
    ]
    note = f"{table.name}: the robots {', '.join(places)} stand side by side; each has its rows."
    return replace(
        table,
        header=[*(table.header[k] for k in shared), ROBOT, *names],
        rows=rows,
        line=[line for line in table.line for _ in places],
        notes=[*table.notes, note],
    )
