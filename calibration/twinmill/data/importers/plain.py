# SPDX-License-Identifier: Apache-2.0
"""Poses and commands from plain CSV files, as described under `twinmill import --help`."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import turbopi

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.bench_table import is_bench
from twinmill.data.importers.beat import at_even_beat
from twinmill.data.importers.columns import Mapping
from twinmill.data.importers.mapped import read_mapped
from twinmill.data.importers.samples import filled_in, samples_of
from twinmill.data.importers.series import (
    SIDES,
    CommandSeries,
    DetectionSeries,
    PoseSeries,
    is_no_turn,
    of_both_axles,
    of_its_wheels,
    quaternion_from_heading,
    unit_quaternions,
    velocities_of_steering,
    with_z_up,
)
from twinmill.data.importers.stamps import repeats, sound_rows
from twinmill.data.log import CommandKind, LogError
from twinmill.data.measurement_table import LOST, CellError, Table, is_number
from twinmill.data.units import unit_of_stamps
from twinmill.model.mixing import duties_from_inputs

HEADING_LIKE = re.compile(r"theta|yaw|heading|psi|orient|angle|rot|^q_?[wxyz0-3]$", re.IGNORECASE)
QUATERNION = ("qw", "qx", "qy", "qz")
WORLD = ("vx_world_mps", "vy_world_mps")
INPUTS = ("speed_input", "turn_input")
STEERED = ("vx_mps", "steering_rad")
PASS = 10  # rows that share their times with others: packets that come late are fewer at once
WRAP_DEG = 20  # more than a robot turns from row to row
VALUES: dict[CommandKind, tuple[str, ...]] = {
    "duty": ("fl_pct", "fr_pct", "rl_pct", "rr_pct"),
    "wheel_speed": ("w1_radps", "w2_radps", "w3_radps", "w4_radps"),
    "twist": ("vx_mps", "vy_mps", "omega_radps"),
}
OF_POSES = frozenset({"t_s", "robot_id", "x_m", "y_m", "z_m", "theta_rad", "valid", *QUATERNION})
OF_COMMANDS = frozenset(
    {
        "t_s",
        "robot_id",
        *INPUTS,
        *WORLD,
        *STEERED,
        *(name for names in VALUES.values() for name in names),
    }
)
OF_DETECTIONS = frozenset({"t_s", "robot_id", "seen", "range_m", "bearing_rad"})
KNOWN = OF_POSES | OF_COMMANDS
OF_ALL = frozenset({"t_s", "robot_id"})  # of rows of any kind
Series = TypeVar("Series", PoseSeries, CommandSeries, DetectionSeries)


@dataclass(frozen=True)
class Columns:
    """How to read a table: as `mapped.read_mapped`, and whose rows they are.

    Attributes:
        rename, mapping, topic: as there.
        own_renames: of single robots, by number.
        robot_id: of all rows, for files without that column, or with one name in it.
        robots: robot_id by what stands in that column.
        up: axis that positions and quaternions call up.
        wheelbase_m: of a robot that is told steering angles.
        lacks_robot: what to do about a file without robots, beside adding that column.
    """

    rename: dict[str, str] = field(default_factory=dict)
    mapping: Mapping | None = None
    topic: str | None = None
    own_renames: dict[int, dict[str, str]] = field(default_factory=dict)
    robot_id: int | None = None
    robots: dict[str, int] = field(default_factory=dict)
    up: str = "z"
    wheelbase_m: float | None = None
    lacks_robot: str = ""

    def read(self, path: Path, known: frozenset[str]) -> Table:
        """The table under our names, rows that are no samples of what is known left out."""
        named = read_mapped(path, known, mapping=self.mapping, rename=self.rename, topic=self.topic)
        loses = known == OF_POSES
        return samples_of(named, known - OF_ALL, KNOWN - known, loses=loses)

    def of_robot(self, robot_id: int | None) -> "Columns":
        """Columns that rows of one robot alone have."""
        own = self.own_renames.get(robot_id, {})
        return replace(self, rename={**self.rename, **own}, own_renames={})


def read_poses(path: Path, columns: Columns) -> list[PoseSeries]:
    """Poses by robot; empty or NaN cells are poses that were lost.

    Args:
        path: CSV with t_s, robot_id, x_m, y_m, and theta_rad or QUATERNION where the heading was
            recorded; optional z_m, valid.
        columns: how to read it.

    Raises:
        LogError: as read_table; a wrong value, with its row.
    """
    return _of_file(path, OF_POSES, columns, _poses)


def _poses(table: Table, columns: Columns) -> list[PoseSeries]:
    if is_bench(table.header):
        raise LogError(
            f"{table.name}: has duties and wheel speeds and no poses, as a bench test; it needs no "
            "import: give it to compare, fit or diagnose as it is."
        )
    table, utime_us, ids, notes = _stamped(table, columns)
    height = table.numbers("z_m", True) if table.has("z_m") else np.zeros(len(ids))
    position = np.column_stack([table.numbers("x_m", True), table.numbers("y_m", True), height])
    orientation = _orientation(table)
    valid = np.isfinite(position).all(axis=1)
    if np.isfinite(orientation).any():
        valid &= np.isfinite(orientation).all(axis=1)
    if table.has("valid"):
        valid &= table.flags("valid") != 0
    if table.has("theta_rad"):
        _refuse_degrees(table, ids)
    position[~valid] = orientation[~valid] = np.nan
    position, turned = with_z_up(position, orientation, columns.up)
    if table.has(*QUATERNION):  # an angle on the floor is one about what is up
        orientation = turned
    for number in np.unique(ids):
        utime_us[ids == number], said = at_even_beat(
            utime_us[ids == number], f"{table.name}: robot {number}"
        )
        notes = notes + said
    return [
        PoseSeries(
            number, utime_us[rows], position[rows], orientation[rows], valid[rows], notes, called
        )
        for number, rows, notes, called in _by_robot(table, ids, utime_us, notes)
    ]


def read_commands(path: Path, columns: Columns) -> list[CommandSeries]:
    """Commands by robot.

    Args:
        path: CSV with t_s, robot_id and one group of VALUES, INPUTS or WORLD (inputs may stand
            beside duties, omega_radps beside WORLD); each row is held until the next, and over rows
            with a cell that is empty or NaN.
        columns: how to read it.

    Raises:
        LogError: as read_table; a wrong value, with its row.
    """
    return _of_file(path, OF_COMMANDS, columns, _commands)


def _commands(table: Table, columns: Columns) -> list[CommandSeries]:
    kind, world = _kind(table), table.has(*WORLD)
    table = _complete(table, kind)
    table, utime_us, ids, notes = _stamped(table, columns)
    inputs = (
        np.column_stack([_input(table, name) for name in INPUTS])
        if kind == "duty" and table.has(*INPUTS)
        else np.full((len(ids), 2), np.nan)
    )
    for k, (name, limit) in enumerate(zip(INPUTS, (100, 2), strict=True)):
        table.refuse(
            np.abs(inputs[:, k]) > limit, name, inputs[:, k], f"must lie in -{limit}..{limit}"
        )
    value = _values(table, kind, inputs, columns.wheelbase_m)
    if kind == "wheel_speed" and len(_of_wheels(table)) == SIDES:
        notes = [
            *notes,
            f"{table.name}: w1_radps is of the left wheels, w2_radps of the right ones.",
        ]
    return [
        CommandSeries(
            robot_id=number,
            utime_us=utime_us[rows],
            kind=kind,
            value=value[rows],
            repeat=kind == "duty",
            inputs=inputs[rows],
            detected=np.zeros((len(rows), 2), int),
            mode=turbopi.telemetry_t.MODE_SCRIPT,
            warnings=notes,
            world=world,
            called=called,
            mixed=kind == "duty" and not table.has(*VALUES["duty"]),
        )
        for number, rows, notes, called in _by_robot(table, ids, utime_us, notes, held=value)
    ]


def read_detections(path: Path, columns: Columns) -> list[DetectionSeries]:
    """Detections from cameras, by robot.

    Args:
        path: CSV with t_s (when the picture was taken, the commands' clock), robot_id, and seen, 0
            or 1; optional range_m and bearing_rad, empty where not known.
        columns: how to read it.

    Raises:
        LogError: as read_table; a wrong value, with its row.
    """
    return _of_file(path, OF_DETECTIONS, columns, _seen)


def _seen(table: Table, columns: Columns) -> list[DetectionSeries]:
    table, utime_us, ids, notes = _stamped(table, columns)
    seen = table.flags("seen")
    table.refuse((seen != 0) & (seen != 1), "seen", seen, "must be 0 or 1")
    more = {
        name: table.numbers(name, True) if table.has(name) else np.full(len(ids), np.nan)
        for name in ("range_m", "bearing_rad")
    }
    table.refuse(more["range_m"] < 0, "range_m", more["range_m"], "must not be negative")
    for name, values in more.items():
        idle = (seen == 0) & np.isfinite(values)
        if idle.any():
            notes = [
                *notes,
                f"{table.name}: {counted(np.count_nonzero(idle), 'row')} with {name} though seen "
                f"is 0 (the first is row {table.line[int(idle.argmax())]}); it is left out there.",
            ]
            values[idle] = np.nan
    return [
        DetectionSeries(
            number,
            utime_us[rows],
            seen[rows] > 0,
            more["range_m"][rows],
            more["bearing_rad"][rows],
            notes,
        )
        for number, rows, notes, _ in _by_robot(table, ids, utime_us, notes)
    ]


def _of_file(
    path: Path,
    known: frozenset[str],
    columns: Columns,
    read: Callable[[Table, Columns], list[Series]],
) -> list[Series]:
    """Series of all robots of a file, those whose columns are called otherwise by these names.

    Raises:
        LogError: as read_table; those of no robot can be read.
    """
    if columns.robot_id in columns.own_renames:
        columns = columns.of_robot(columns.robot_id)
    table = _with_robots(columns.read(path, known))
    if not columns.own_renames:
        return _of_sound_robots(table, columns, read)
    ids, _ = _robot_ids(table, columns)
    own = [number for number in columns.own_renames if number in ids]
    rest = table.where(~np.isin(ids, own))
    found = _of_sound_robots(rest, columns, read) if rest.rows else []
    for number in own:
        as_named = columns.of_robot(number)
        again = _with_robots(as_named.read(path, known)).where(ids == number)
        unsaid = [note for note in again.notes if not found or note not in table.notes]
        found += _of_sound_robots(replace(again, notes=unsaid), as_named, read)
    return found


def _of_sound_robots(
    table: Table, columns: Columns, read: Callable[[Table, Columns], list[Series]]
) -> list[Series]:
    """Series of the robots whose cells can all be read; of others the reason is told.

    Raises:
        CellError: those of no robot can.
    """
    left_out = []
    while True:
        try:
            found = read(table, columns)
        except CellError as error:
            ids, _ = _robot_ids(table, columns)
            own = np.flatnonzero(table.line == error.line)  # one a robot, where these stand aside
            number = next(ids[k] for k in own if table.rows[k] == error.row)
            left_out.append(f"Left out: robot {number}: {error}")
            table = table.where(ids != number)
            if not table.rows:
                raise
            continue
        found[0].warnings.extend(left_out)
        return found


def _with_robots(table: Table) -> Table:
    """Without the rows that do not say whose they are."""
    if not table.has("robot_id"):
        return table
    told = np.array([cell.lower() not in LOST for cell in table.cells("robot_id")])
    if told.all() or not told.any():
        return table
    note = (
        f"{table.name}: {counted(np.count_nonzero(~told), 'row')} without robot_id (the first is "
        f"row {table.line[int((~told).argmax())]}); left out."
    )
    return replace(table.where(told), notes=[*table.notes, note])


def _input(table: Table, name: str) -> np.ndarray:
    """(rows,) of one input; beside duties it need not be known."""
    return table.numbers(name, True) if table.has(*VALUES["duty"]) else table.finite(name)


def _kind(table: Table) -> CommandKind:
    groups = {kind: [columns] for kind, columns in VALUES.items()}
    groups["wheel_speed"] = [_of_wheels(table)]
    groups["twist"] += [WORLD, STEERED]
    found = [(kind, columns) for kind in groups for columns in groups[kind] if table.has(*columns)]
    if len(found) > 1:
        raise LogError(
            f"{table.name}: has columns for {' and '.join(', '.join(own) for _, own in found)}, "
            "but a log keeps to one kind of command; remove the others."
        )
    if found:
        return found[0][0]
    if table.has(*INPUTS):
        return "duty"
    # Name the column that is missing from the group that is most complete.
    groups = [*VALUES.values(), INPUTS, WORLD, STEERED]
    group = max(groups, key=lambda names: sum(table.has(name) for name in names) / len(names))
    if not any(map(table.has, group)):
        raise LogError(
            f"{table.name}: no column is known to be a command (it has {', '.join(table.header)}); "
            f"say what its columns are ({option('rename')}), or "
            f"let {option('explain_columns')} write down all columns and give that to "
            f"{option('mapping')}."
        )
    raise table.missing(next(name for name in group if not table.has(name)))


def _columns_of(table: Table, kind: CommandKind) -> tuple[str, ...]:
    """Columns that hold the commands; those of the duties are not there beside inputs alone."""
    if table.has(*WORLD):
        return (*WORLD, *(["omega_radps"] if table.has("omega_radps") else []))
    if table.has(*STEERED) and not table.has(*VALUES[kind]):
        return STEERED
    if kind == "wheel_speed":
        return _of_wheels(table)
    return VALUES[kind] if table.has(*VALUES[kind]) else INPUTS


def _of_wheels(table: Table) -> tuple[str, ...]:
    return of_its_wheels(VALUES["wheel_speed"], table.header)


def _complete(table: Table, kind: CommandKind) -> Table:
    """Without the rows that have an empty cell or NaN: the command before is held over them."""
    places = [table.header.index(name) for name in _columns_of(table, kind)]
    whole = np.all([filled_in(table, [place]) for place in places], axis=0)
    if whole.all() or not whole.any():
        return table
    note = (
        f"{table.name}: {counted(np.count_nonzero(~whole), 'row')} with an empty cell or NaN (the "
        f"first is row {table.line[int((~whole).argmax())]}); left out: the command before is held"
        ", if there is one."
    )
    return replace(table.where(whole), notes=[*table.notes, note])


def _values(
    table: Table, kind: CommandKind, inputs: np.ndarray, wheelbase_m: float | None
) -> np.ndarray:
    """(rows, 4) as in CommandSeries."""
    columns = _columns_of(table, kind)
    if columns == INPUTS:
        return np.array([duties_from_inputs(*row) for row in inputs], float)
    if columns == STEERED:
        return velocities_of_steering(table.name, *map(table.finite, STEERED), wheelbase_m)
    value = np.zeros((len(table.rows), 4))
    for k, name in enumerate(columns):
        value[:, k] = table.finite(name)
        if kind == "duty":
            pwm = f"must lie in -100..100 (PWM of 255 is called {name[:2]}_pwm)"
            table.refuse(np.abs(value[:, k]) > 100, name, value[:, k], pwm)
    top = np.abs(value).max()
    converted = any(abs(table.factor.get(name, 1.0)) != 1 for name in columns)
    if kind == "duty" and not converted and top <= 1 and np.any(value % 1):
        raise LogError(
            f"{table.name}: duties go to {top:g} at most, which is no percent but a share of full "
            f"duty; name the columns {columns[0][:2]}_unit ... in the file, or with "
            f"{option('rename')} "
            f"{columns[0]}={columns[0][:2]}_unit ..."
        )
    sides = kind != "twist" and len(columns) == SIDES
    return of_both_axles(value[:, :SIDES]) if sides else value


def _orientation(table: Table) -> np.ndarray:
    """(rows, 4) unit quaternions; NaN if the table has no heading, by any name.

    Of a robot on the floor qx and qy may be left out: they are 0, or the length tells.
    """
    if not table.has("qw", "qz"):
        half = [name for name in ("qw", "qz") if table.has(name)]
        if half and not table.has("theta_rad"):
            raise table.missing("qz" if half == ["qw"] else "qw")
        if not table.has("theta_rad") and not any(map(HEADING_LIKE.search, table.strange)):
            return np.full((len(table.rows), 4), np.nan)
        return quaternion_from_heading(table.numbers("theta_rad", True))
    zero = np.zeros(len(table.rows))
    quaternion = np.column_stack(
        [table.numbers(name, True) if table.has(name) else zero for name in QUATERNION]
    )
    turned, norm = unit_quaternions(quaternion)
    table.refuse(is_no_turn(norm), "the length of qw, qx, qy, qz", norm, "must be 1")
    return turned


def _refuse_degrees(table: Table, ids: np.ndarray) -> None:
    """Raises LogError where headings named radians jump by 360 as they pass the half turn."""
    theta = table.numbers("theta_rad", True)
    for number in np.unique(ids):
        own = theta[(ids == number) & np.isfinite(theta)]
        jumps = np.abs(np.abs(np.diff(own)) - 360) < WRAP_DEG
        if jumps.any() and np.abs(own).max() < 361:
            top = np.abs(own).max()
            raise LogError(
                f"{table.name}: robot {number}: theta_rad goes to {top:.0f} and jumps "
                "by 360 where the robot turns round: it is in degrees; name it theta_deg, in the "
                f"file or with {option('rename', {'theta_rad': 'theta_deg'})}."
            )


def _robot_ids(table: Table, columns: Columns) -> tuple[np.ndarray, list[str]]:
    """(rows,) robot_id, and what was done with names that are no numbers."""
    if not table.has("robot_id"):
        if columns.robot_id is None:
            remedy = columns.lacks_robot or f"give {option('robot_id')} for a file of one robot"
            raise LogError(f"{table.name}: column robot_id is missing; add it, or {remedy}.")
        return np.full(len(table.rows), columns.robot_id), []
    cells = table.cells("robot_id")
    if "" in cells:
        raise LogError(
            f"{table.name}: row {table.line[cells.index('')]}: robot_id is empty; fill it."
        )
    numbers, notes = _numbered(table.name, sorted(set(cells)), columns)
    ids = np.array([numbers[cell] for cell in cells])
    table.refuse(
        (ids % 1 != 0) | (ids < 0) | (ids > 99), "robot_id", ids, "must be a whole number in 0..99"
    )
    return ids.astype(int), notes


def _numbered(table: str, names: list[str], columns: Columns) -> tuple[dict[str, float], list[str]]:
    """Number of each name: as given, as it stands there, or the last digits in it."""
    numbers: dict[str, float] = {}
    words = [name for name in names if name not in columns.robots and not is_number(name)]
    for name in names:
        digits = re.findall(r"\d+", name)
        if name in columns.robots:
            numbers[name] = columns.robots[name]
        elif name not in words:
            numbers[name] = float(name)
        elif len(names) == 1 and columns.robot_id is not None:
            numbers[name] = columns.robot_id
        elif digits:
            numbers[name] = int(digits[-1])
    if len(numbers) < len(names) or (words and len(set(numbers.values())) < len(names)):
        offer = option("robot", {name: k for k, name in enumerate(words, 1)})
        raise LogError(
            f"{table}: robot_id is {', '.join(repr(name) for name in words[:5])}, which gives no "
            f"number of its own to each robot; number them, for example with {offer}."
        )
    return numbers, [f"{table}: '{name}' is robot {numbers[name]:.0f}." for name in words]


def _stamped(table: Table, columns: Columns) -> tuple[Table, np.ndarray, np.ndarray, list[str]]:
    """The table without rows of no moment, (rows,) utime_us and robot_id, and what was done."""
    t_s, (ids, notes) = table.seconds("t_s"), _robot_ids(table, columns)
    table, kept = sound_rows(table, t_s, ids)
    return table, _utime_us(table, t_s[kept]), ids[kept], notes


def _utime_us(table: Table, t_s: np.ndarray) -> np.ndarray:
    largest = np.abs(t_s).max()
    if (unit := unit_of_stamps(largest)) != "s":
        raise LogError(
            f"{table.name}: t_s goes to {largest:.4g}, which are no seconds; if it counts {unit} "
            f"since 1970, name the column t_{unit} there, or with "
            f"{option('rename', {'t_s': f't_{unit}'})} if no "
            "other file's t_s is in seconds."
        )
    return np.round(t_s * 1e6).astype(np.int64)


def _check_passes(table: Table, rows: np.ndarray, stamps: np.ndarray, where: str) -> None:
    """Raises LogError where a clock was set back, so that rows of two times share their stamps.

    A packet that came late is no such: what is behind it goes on where it was before.
    """
    step = np.diff(stamps)
    if not (step < 0).any():
        return
    at = int(step.argmin()) + 1
    before, behind = stamps[:at], stamps[at:]
    low, high = max(before.min(), behind.min()), min(before.max(), behind.max())
    shared = int(((behind >= low) & (behind <= high)).sum())
    if min(((before >= low) & (before <= high)).sum(), shared) < PASS:
        return
    back_s = f"{-step[at - 1] / 1e6:.6g} s"
    raise LogError(
        f"{where}: row {table.line[rows[at]]} is {back_s} earlier than the row before, and "
        f"{shared} rows behind it fall among those before it: the clock was set back, or two "
        f"recordings stand in one file; make a file of each part, or add {back_s} and the pause "
        "between them to the stamps from that row on."
    )


def _by_robot(
    table: Table,
    ids: np.ndarray,
    utime_us: np.ndarray,
    said: list[str],
    *,
    held: np.ndarray | None = None,
) -> Iterator[tuple[int, np.ndarray, list[str], str]]:
    """Each robot, its rows in order of time, each stamp once (the last row), what was done, a name.

    The first robot tells what was done with the whole table, too. The name is that in the table.
    Of values that are held, (rows, columns), a row that repeats its neighbour loses nothing.
    """
    said = [*table.notes, *said]
    named = table.header.index("robot_id") if table.has("robot_id") else None
    for number in np.unique(ids).tolist():
        rows = np.flatnonzero(ids == number)
        stamps = utime_us[rows]
        where = f"{table.name}: robot {number}"
        _check_passes(table, rows, stamps, where)
        late = int(np.count_nonzero(np.diff(stamps) < 0))
        rows = rows[np.argsort(stamps, kind="stable")]
        last = np.append(np.diff(utime_us[rows]) > 0, True)
        most_s = -np.diff(stamps).min(initial=0) / 1e6
        earlier = f"{counted(late, 'row')} earlier than the row before, by {most_s:.3g} s at most"
        notes = [f"{where}: {earlier}; sorted."] if late else []
        lost = ~last
        if held is not None and lost.any():
            changed = np.diff(held[rows], axis=0).any(axis=1)
            lost &= np.append(True, changed) & np.append(changed, True)
        if lost.any():
            notes.append(repeats(where, np.count_nonzero(lost), len(lost), "row"))
        called = "" if named is None else table.rows[rows[0]][named].strip()
        yield number, rows[last], said + notes, called
        said = []
