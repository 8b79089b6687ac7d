# SPDX-License-Identifier: Apache-2.0
"""Reads steady-state tables: per robot and input the median of its runs, and how far to trust it.

They tell how a robot moves, or how its wheels turn on a bench.

Errors of typing and timing are common in such tables, so medians are taken, of runs as well as of
their scatter: a wrong number hardly moves them.
"""

import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twinmill.chance import chi2_median
from twinmill.data.bench_table import bench_readings, is_bench
from twinmill.data.log import LogError
from twinmill.data.measurement_table import Table, read_table
from twinmill.data.readings import Readings

INPUTS = ("speed_input", "direction_deg", "turn_input")
MOTION = ("speed_mps", "turn_radps")
COLUMNS = ("robot_id", *INPUTS, "run", *MOTION, "note")
LIMITS = {"robot_id": (0, 99), "speed_input": (-100, 100), "turn_input": (-2, 2)}
# Half a wheel's turn in a circle, and 3 degrees in a second, pass for "on the spot" and "straight".
READ_AS_ZERO = (0.05, 0.05)  # m/s, rad/s
READING = (0.005, 0.02)  # m/s, rad/s: of a single run by stopwatch; repeated ones tell their own
STILL_MPS = 0.03  # rim speed below which a wheel is said to stand still
# What a measurement must have for an effect to show, and why a table does not have it.
LACKS = {
    "changes": "acts only while the speed changes, and a steady table has no starts and stops",
    "clocks": "a steady table has no clocks",
    "poses": "a steady table has no poses",
    "heading": "a steady table has no poses",
    "room": "a steady table does not say where and in which direction of the room the robot drove",
    "battery": "a steady table does not say how full the battery was",
    "history": "a steady table does not say how long the robot had been driving",
    "wheel_angle": "a steady table gives means over many turns of the wheels",
}
POOLED = 3.0  # cells that the spread of all cells counts for in the spread of one


@dataclass(frozen=True)
class Spread:
    """Relative scatter of one channel: of runs of one robot, and of robots of one kind.

    `robots` is NaN where fewer than two robots share an input.
    """

    runs: float
    robots: float


@dataclass(frozen=True)
class SteadyTable:
    """One robot in one table; U inputs in their order of appearance.

    Attributes:
        input_names, columns: of I inputs and of C values: INPUTS and MOTION, or of a bench test
            duties and speeds of wheels.
        inputs: (U, I) by vendor's convention: 90 is forward, turn positive clockwise.
        value: (U, C) median m/s, rad/s (counter-clockwise); NaN where not measured.
        floor: (U, C) standard deviation to be expected of it about a model of its kind.
        runs: (U,) how many.
        still: (U,) bool: a note says that one side of the robot stood still.
        cell_spread: (U, C) relative standard deviation over robots at this input; NaN for one.
        spread: of each column, over all inputs and robots of the table.
        fold: 0 or 1, the half that this robot belongs to; None if the table has only one.
    """

    log_name: str
    log_sha256: str
    robot_id: int
    input_names: tuple[str, ...]
    columns: tuple[str, ...]
    inputs: np.ndarray
    value: np.ndarray
    floor: np.ndarray
    runs: np.ndarray
    still: np.ndarray
    cell_spread: np.ndarray
    spread: tuple[Spread, ...]
    fold: int | None
    warnings: list[str]
    recorded_utime_us: int = 0
    time_base: None = None

    @property
    def label(self) -> str:
        """Short name of table and robot."""
        return f"{self.log_name} R{self.robot_id:02d}"

    @property
    def of_wheels(self) -> bool:
        """True if it is of wheels on a bench, which tell nothing of how the robot moves."""
        return self.columns != MOTION

    def __repr__(self) -> str:
        return f"SteadyTable({self.label})"


def is_steady_table(path: Path) -> bool:
    """True if the name of a file is that of a table of steady speeds."""
    return Path(path).name.endswith((".csv", ".csv.gz"))


def read_steady_tables(path: Path) -> list[SteadyTable]:
    """Reads a file: one table per robot.

    Raises:
        LogError: no such table, or a wrong cell, with its row.
    """
    path = Path(path)
    readings = _readings(path, read_table(path, frozenset(COLUMNS), can_rename=False))
    cells = _cells(readings)
    channels = [_channel(cells, readings, c) for c in range(len(readings.columns))]
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    robots = sorted({robot for robot, _ in cells})
    sheets = []
    for place, robot in enumerate(robots):
        keys = [key for key in cells if key[0] == robot]
        own = [np.array([channel[0][key] for key in keys]) for channel in channels]
        sheets.append(
            SteadyTable(
                log_name=path.name,
                log_sha256=sha256,
                robot_id=robot,
                input_names=readings.input_names,
                columns=readings.columns,
                inputs=np.array([key[1] for key in keys]),
                value=np.column_stack([o[:, 0] for o in own]),
                floor=np.column_stack([o[:, 1] for o in own]),
                runs=np.array([len(cells[key].values) for key in keys]),
                still=np.array([cells[key].still for key in keys]),
                cell_spread=np.column_stack([o[:, 2] for o in own]),
                spread=tuple(channel[1] for channel in channels),
                fold=place % 2 if len(robots) > 1 else None,
                warnings=[],
            )
        )
    _check(path, sheets)
    return sheets


def _readings(path: Path, table: Table) -> Readings:
    """Rows of a table of drives, or of a bench test."""
    missing = [name for name in COLUMNS if not table.has(name)]
    if not missing:
        return _of_drives(table)
    if is_bench(table.header):
        return bench_readings(table)
    raise LogError(
        f"{path}: column {missing[0]} is missing; a steady-state table has {','.join(COLUMNS)} "
        "(poses and commands become a log by `twinmill import`), or the duties and the speeds of "
        "wheels (duty_pct,left_rpm,right_rpm)."
    )


def _of_drives(table: Table) -> Readings:
    robot, inputs = table.finite("robot_id"), [table.finite(name) for name in INPUTS]
    for name, values in zip(("robot_id", *INPUTS), (robot, *inputs), strict=True):
        low, high = LIMITS.get(name, (-360, 360))
        table.refuse((values < low) | (values > high), name, values, f"must lie in {low}..{high}")
    table.refuse(robot % 1 != 0, "robot_id", robot, "must be a whole number")
    speed, turn = (table.numbers(name, True) for name in MOTION)
    sided = [bool(re.search(r"\bside\b", note)) for note in table.cells("note")]
    return Readings(
        INPUTS,
        MOTION,
        robot,
        np.column_stack(inputs),
        np.column_stack([np.abs(speed), turn]),  # the tape knows no backwards
        np.array(sided) & np.isnan(speed),
        (1.0, 1.0),
        READ_AS_ZERO,
        READING,
    )


@dataclass
class _Cell:
    """Runs of one robot at one input, of C values each."""

    values: list[np.ndarray]
    still: bool = False

    def runs(self, channel: int) -> list[float]:
        """Those that were measured."""
        return [float(v[channel]) for v in self.values if np.isfinite(v[channel])]


Key = tuple[int, tuple[float, ...]]


def _cells(readings: Readings) -> dict[Key, _Cell]:
    cells: dict[Key, _Cell] = defaultdict(lambda: _Cell([]))
    for k, robot in enumerate(readings.robot):
        cell = cells[int(robot), tuple(readings.inputs[k].tolist())]
        cell.values.append(readings.values[k])
        cell.still |= bool(readings.still[k])
    return cells


def _channel(
    cells: dict[Key, _Cell], readings: Readings, k: int
) -> tuple[dict[Key, tuple], Spread]:
    """For each cell median, floor, relative spread over robots; and the spread of all.

    Args: k of the value.
    """
    unit, zero, reading = (own[k] for own in (readings.unit, readings.as_zero, readings.reading))
    runs = {key: cell.runs(k) for key, cell in cells.items()}
    middle = {key: float(np.median(r)) if r else np.nan for key, r in runs.items()}
    by_input: dict[tuple, list[float]] = defaultdict(list)
    for (_, inputs), value in middle.items():
        if np.isfinite(value) and value != 0:
            by_input[inputs].append(value)
    pooled = Spread(_scatter(runs.values()), _scatter(by_input.values()))
    known = np.nan_to_num(pooled.runs), np.nan_to_num(pooled.robots)
    if not np.isnan(pooled.runs):
        reading = unit * _digit(np.concatenate([*runs.values()]) / unit) / np.sqrt(12)
    found = {}
    for key, value in middle.items():
        robots = np.array(by_input[key[1]])
        relative = robots / robots.mean() - 1 if len(robots) > 1 else np.zeros(0)
        between = (POOLED * known[1] ** 2 + np.sum(relative**2)) / (
            POOLED + max(len(relative) - 1, 0)
        )
        variance = between + known[0] ** 2 / max(len(runs[key]), 1)
        floor = zero if value == 0 else np.hypot(reading, abs(value) * variance**0.5)
        seen = float(relative.std(ddof=1)) if len(relative) else np.nan
        found[key] = (value, floor, seen)
    return found, pooled


def _digit(values: np.ndarray) -> float:
    """Unit of the last digit to which values are written."""
    digits = (10.0**-d for d in range(7))
    return next((d for d in digits if np.allclose(values / d, np.round(values / d))), 1e-6)


def _scatter(groups: Iterable[list[float]]) -> float:
    """Relative standard deviation within groups, by their median; NaN without any of two."""
    found = []
    for group in groups:
        if (freedom := np.count_nonzero(group) - 1) > 0:
            values = np.array(group)[np.array(group) != 0]
            usual = np.sqrt(chi2_median(freedom) / freedom)  # median of such an estimate over sigma
            found.append(values.std(ddof=1) / abs(values.mean()) / usual)
    return float(np.median(found)) if found else np.nan


def _check(path: Path, sheets: list[SteadyTable]) -> None:
    if not any(np.isfinite(s.value).any() for s in sheets):
        raise LogError(f"{path}: no speed and no turn rate was measured; fill in the table.")
