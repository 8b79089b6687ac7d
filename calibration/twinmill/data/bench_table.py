# SPDX-License-Identifier: Apache-2.0
"""A bench test: duties and the speeds of wheels that turn freely, no poses.

duty_pct,left_rpm,right_rpm        one duty for all wheels
fl_pct,fr_pct,rl_pct,rr_pct,w1_radps,w2_radps,w3_radps,w4_radps
wheel,duty_pwm,rpm                 one wheel a row
"""

import re

import numpy as np

from twinmill.data.log import LogError
from twinmill.data.measurement_table import Table
from twinmill.data.readings import Readings
from twinmill.data.units import UNITS, plain_name, split_unit

DUTIES = ("fl_pct", "fr_pct", "rl_pct", "rr_pct")
WHEELS = ("w1_radps", "w2_radps", "w3_radps", "w4_radps")
# Wheels by the words of a name: one, or both of a side, which one motor may drive.
NAMED = {
    **{frozenset({name}): (k,) for k, name in enumerate(("fl", "fr", "rl", "rr"))},
    **{frozenset({str(k + 1)}): (k,) for k in range(4)},
    **{
        frozenset({end, side}): (k + first,)
        for end, first in (("front", 0), ("rear", 2), ("back", 2))
        for k, side in enumerate(("left", "right"))
    },
    **{frozenset({name}): (0, 2) for name in ("left", "l")},
    **{frozenset({name}): (1, 3) for name in ("right", "r")},
}
ALL = (0, 1, 2, 3)
NO_WHEEL = frozenset(
    [
        "wheel",
        "wheels",
        "motor",
        "speed",
        "duty",
        "cycle",
        "pwm",
        "rpm",
        "omega",
        "measured",
        "actual",
        "mean",
        "m",
        "w",
    ]
)
LABELS = ("wheel", "motor", "side")  # columns that say which wheel a row is of
FULL_PCT = 100 + 1e-9
A_TURN_A_MINUTE = np.pi / 30  # rad/s: the last digit that a hand-held tachometer shows
TO_NAME = "duty_pct, duty_unit (-1 to 1) or duty_pwm (-255 to 255)"


def is_bench(header: list[str]) -> bool:
    """True if a table has duties and speeds of wheels, and no places."""
    kinds = {_kind(column) for column in header}
    names = [plain_name(column) for column in header]
    placed = "m" in {_quantity(column) for column in header} or {"x", "y"} <= {*names}
    return {"duty", "speed"} <= kinds and not placed


def bench_readings(table: Table) -> Readings:
    """Its rows: duties of four wheels in percent, and speeds of wheels in rad/s.

    Raises:
        LogError: a record over time, a duty without a unit, a wheel that no name tells, a wrong
            cell.
    """
    of_time = [c for c in table.header if _quantity(c) == "s" or plain_name(c) in ("t", "time")]
    if of_time:
        raise LogError(
            f"{table.name}: has duties and wheel speeds over time ({of_time[0]}), and a bench test "
            "tells of steady speeds; write one row for each duty and run, with the speed that the "
            "wheel has kept, and leave the times out."
        )
    count = len(table.rows)
    label = next((c for c in table.header if plain_name(c) in LABELS), None)
    rows_of = [ALL] * count if label is None else [_wheels(table, c) for c in table.cells(label)]
    duty, speed = np.zeros((count, 4)), np.full((count, 4), np.nan)
    unit = np.ones(4)
    for column in filter(_kind, table.header):
        driven, named = _kind(column) == "duty", _wheels(table, split_unit(column)[0])
        values = table.finite(column) if driven else table.numbers(column, True)
        factor = _factor(table, column)
        unit[list(named)] = unit[list(named)] if driven else factor
        for k, value in enumerate(values * factor):
            wheels = [w for w in named if w in rows_of[k]]
            if driven:
                duty[k, wheels] = value
            elif wheels:
                if np.isfinite(speed[k, wheels[0]]):
                    raise _told_twice(table, column, wheels[0])
                speed[k, wheels[0]] = value
    most = np.abs(duty).max(axis=1)
    table.refuse(most > FULL_PCT, "the duty in percent", most, "must lie in -100..100")
    if not (speed < 0).any():  # a tachometer knows no backwards
        speed = np.where(duty < 0, -speed, speed)
    robot = table.finite("robot_id") if table.has("robot_id") else np.ones(count)
    none = (A_TURN_A_MINUTE,) * len(WHEELS)
    return Readings(
        DUTIES, WHEELS, robot, duty, speed, np.zeros(count, bool), tuple(unit), none, none
    )


def _quantity(column: str) -> str:
    """One of our units; empty if the name has none."""
    unit = split_unit(column)[1]
    return UNITS[unit][0] if unit else ""


def _kind(column: str) -> str:
    """Role of a column of wheels: "duty", "speed", or empty if it is neither."""
    name, quantity = plain_name(column), _quantity(column)
    if quantity == "pct" or (not quantity and ("duty" in name or "pwm" in name)):
        return "duty"
    return "speed" if quantity == "radps" or (not quantity and "rpm" in name) else ""


def _factor(table: Table, column: str) -> float:
    """To percent or rad/s."""
    unit = split_unit(column)[1]
    unit = unit or next((u for u in ("rpm", "pwm") if u in plain_name(column)), "")
    if not unit:
        raise LogError(f"{table.name}: column {column} names no unit; call it {TO_NAME}.")
    return UNITS[unit][1]


def _told_twice(table: Table, column: str, wheel: int) -> LogError:
    return LogError(
        f"{table.name}: column {column} tells the speed of wheel {wheel + 1}, and so does one "
        "before; keep the measured one, or name the wheel that each is of (fl_rpm, left_rpm)."
    )


def _wheels(table: Table, name: str) -> tuple[int, ...]:
    """Wheels that a name or a label is of; all where it names none."""
    words = re.split(r"[\s_.-]+|(?<=[a-z])(?=\d)", plain_name(name))
    of_wheel = frozenset(words) - NO_WHEEL - {""}
    if of_wheel and of_wheel not in NAMED:
        raise LogError(
            f"{table.name}: which wheel is '{name}'? Call it left or right, or fl, fr, rl or rr."
        )
    return NAMED[of_wheel] if of_wheel else ALL
