# SPDX-License-Identifier: Apache-2.0
"""Reads steady-state tables: per robot and input the median of its runs, and how far to trust it.

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
from twinmill.data.log import LogError
from twinmill.data.measurement_table import Table, read_table
from twinmill.data.units import UNITS, plain_name, split_unit

INPUTS = ("speed_input", "direction_deg", "turn_input")
COLUMNS = ("robot_id", *INPUTS, "run", "speed_mps", "turn_radps", "note")
LIMITS = {"robot_id": (0, 99), "speed_input": (-100, 100), "turn_input": (-2, 2)}
# Half a wheel's turn in a circle, and 3 degrees in a second, pass for "on the spot" and "straight".
READ_AS_ZERO = (0.05, 0.05)  # m/s, rad/s
READING = (0.005, 0.02)  # m/s, rad/s: of a single run by stopwatch; repeated ones tell their own
STILL_MPS = 0.03  # rim speed below which a wheel is said to stand still
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
        inputs: (U, 3) as INPUTS, vendor's convention: 90 is forward, turn positive clockwise.
        value: (U, 2) median m/s and rad/s (counter-clockwise); NaN where not measured.
        floor: (U, 2) standard deviation to be expected of it about a model of its kind.
        runs: (U,) how many.
        still: (U,) bool: a note says that one side of the robot stood still.
        cell_spread: (U, 2) relative standard deviation over robots at this input; NaN for one.
        spread: of speed and turn, over all inputs and robots of the table.
        fold: 0 or 1, the half that this robot belongs to; None if the table has only one.
    """

    log_name: str
    log_sha256: str
    robot_id: int
    inputs: np.ndarray
    value: np.ndarray
    floor: np.ndarray
    runs: np.ndarray
    still: np.ndarray
    cell_spread: np.ndarray
    spread: tuple[Spread, Spread]
    fold: int | None
    warnings: list[str]
    recorded_utime_us: int = 0
    time_base: None = None

    @property
    def label(self) -> str:
        """Short name of table and robot."""
        return f"{self.log_name} R{self.robot_id:02d}"

    def __repr__(self) -> str:
        return f"SteadyTable({self.label})"


def is_steady_table(path: Path) -> bool:
    """Whether a file is such a table, by its name."""
    return Path(path).name.endswith((".csv", ".csv.gz"))


def read_steady_tables(path: Path) -> list[SteadyTable]:
    """Reads a file: one table per robot.

    Raises:
        LogError: no such table, or a wrong cell, with its row.
    """
    path = Path(path)
    table = read_table(path, frozenset(COLUMNS))
    missing = [name for name in COLUMNS if not table.has(name)]
    if missing:
        refuse_bench(path.name, table.header)
        raise LogError(
            f"{path}: column {missing[0]} is missing; a steady-state table has {','.join(COLUMNS)} "
            "(poses and commands become a log by `twinmill import`)."
        )
    cells = _cells(table)
    channels = [_channel(cells, k) for k in (0, 1)]
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
                inputs=np.array([key[1] for key in keys]),
                value=np.column_stack([o[:, 0] for o in own]),
                floor=np.column_stack([o[:, 1] for o in own]),
                runs=np.array([len(cells[key].speed) for key in keys]),
                still=np.array([cells[key].still for key in keys]),
                cell_spread=np.column_stack([o[:, 2] for o in own]),
                spread=(channels[0][1], channels[1][1]),
                fold=place % 2 if len(robots) > 1 else None,
                warnings=[],
            )
        )
    _check(path, sheets)
    return sheets


def refuse_bench(name: str, header: list[str]) -> None:
    """Raises LogError where a table is of a bench test: duties and wheel speeds, no places."""
    names = [plain_name(column) for column in header]
    units = {unit for unit in (split_unit(column)[1] for column in header) if unit}
    kinds = {UNITS[unit][0] for unit in units}
    duties = "pct" in kinds or any("duty" in own or "pwm" in own for own in names)
    turning = "radps" in kinds or any("rpm" in own for own in names)
    placed = "m" in kinds or {"x", "y"} <= {*names}
    if duties and turning and not placed:
        raise LogError(
            f"{name}: has duties and wheel speeds and no poses, as a bench test; write it as a "
            "steady-state table and give that to compare, fit or diagnose: "
            f"{','.join(COLUMNS)}, with the duty as speed_input, 90, 0, and the wheel's speed "
            "times its radius as speed_mps."
        )


@dataclass
class _Cell:
    """Runs of one robot at one input."""

    speed: list[float]
    turn: list[float]
    still: bool = False

    def runs(self, channel: int) -> list[float]:
        """Those that were measured; the tape knows no backwards."""
        values = [self.turn, [abs(v) for v in self.speed]][channel == 0]
        return [v for v in values if np.isfinite(v)]


Key = tuple[int, tuple[float, ...]]


def _cells(table: Table) -> dict[Key, _Cell]:
    robot, inputs = table.finite("robot_id"), [table.finite(name) for name in INPUTS]
    for name, values in zip(("robot_id", *INPUTS), (robot, *inputs), strict=True):
        low, high = LIMITS.get(name, (-360, 360))
        table.refuse((values < low) | (values > high), name, values, f"must lie in {low}..{high}")
    table.refuse(robot % 1 != 0, "robot_id", robot, "must be a whole number")
    speed, turn = table.numbers("speed_mps", True), table.numbers("turn_radps", True)
    notes = [row[table.header.index("note")] for row in table.rows]
    cells: dict[Key, _Cell] = defaultdict(lambda: _Cell([], []))
    for k, note in enumerate(notes):
        cell = cells[int(robot[k]), tuple(float(values[k]) for values in inputs)]
        cell.speed.append(speed[k])
        cell.turn.append(turn[k])
        cell.still |= bool(re.search(r"\bside\b", note)) and np.isnan(speed[k])
    return cells


def _channel(cells: dict[Key, _Cell], k: int) -> tuple[dict[Key, tuple], Spread]:
    """For each cell median, floor, relative spread over robots; and the spread of all."""
    runs = {key: cell.runs(k) for key, cell in cells.items()}
    middle = {key: float(np.median(r)) if r else np.nan for key, r in runs.items()}
    by_input: dict[tuple, list[float]] = defaultdict(list)
    for (_, inputs), value in middle.items():
        if np.isfinite(value) and value != 0:
            by_input[inputs].append(value)
    pooled = Spread(_scatter(runs.values()), _scatter(by_input.values()))
    known = np.nan_to_num(pooled.runs), np.nan_to_num(pooled.robots)
    reading = READING[k] if np.isnan(pooled.runs) else _digit(runs.values()) / np.sqrt(12)
    found = {}
    for key, value in middle.items():
        robots = np.array(by_input[key[1]])
        relative = robots / robots.mean() - 1 if len(robots) > 1 else np.zeros(0)
        between = (POOLED * known[1] ** 2 + np.sum(relative**2)) / (
            POOLED + max(len(relative) - 1, 0)
        )
        variance = between + known[0] ** 2 / max(len(runs[key]), 1)
        floor = READ_AS_ZERO[k] if value == 0 else np.hypot(reading, abs(value) * variance**0.5)
        seen = float(relative.std(ddof=1)) if len(relative) else np.nan
        found[key] = (value, floor, seen)
    return found, pooled


def _digit(groups: Iterable[list[float]]) -> float:
    """Unit of the last digit to which values are written."""
    values = np.concatenate([np.array(group, float) for group in groups])
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
