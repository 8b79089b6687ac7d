# SPDX-License-Identifier: Apache-2.0
"""Logs of numbers in memory: numpy arrays, or the columns of a data frame, without a file."""

from collections.abc import Iterable, Iterator
from datetime import datetime
from typing import Any, Literal, get_args

import numpy as np
import tomlkit
import turbopi

from twinmill.data.importers.columns import by_name, is_never_sideways
from twinmill.data.importers.log_writer import log_parts
from twinmill.data.importers.plain import OF_COMMANDS, OF_POSES, QUATERNION, STEERED, VALUES
from twinmill.data.importers.series import (
    SIDES,
    CommandSeries,
    PoseSeries,
    is_no_turn,
    of_both_axles,
    of_its_wheels,
    quaternion_from_heading,
    unit_quaternions,
    velocities_of_steering,
)
from twinmill.data.log import Log, LogError, heading_rad, log_of

Kind = Literal["twist", "duty", "wheel_speed", "steering"]
# Columns that an array of commands may have, by its kind.
OF_WHEELS = (SIDES, 3, 4)  # left and right, three omni wheels, four
WIDTHS: dict[Kind, tuple[int, ...]] = {
    "twist": (2, 3),
    "duty": OF_WHEELS,
    "wheel_speed": OF_WHEELS,
    "steering": (2,),
}
WORDS = {OF_WHEELS: "2 (left, right), 3 (omni wheels) or 4 (fl, fr, rl, rr)"}
COLUMNS: dict[Kind, tuple[str, ...]] = {
    "twist": VALUES["twist"],
    "duty": VALUES["duty"],
    "wheel_speed": VALUES["wheel_speed"],
    "steering": STEERED,
}
POSE = ("x_m", "y_m", "theta_rad")
FULL_DUTY_PCT = 100.0
LATEST_S = 253_402_300_800  # end of the year 9999, the last that ISO 8601 has
MOST_ROBOTS = 100  # their numbers have two digits in the names of channels


def poses_of(robot_id: int, t_s: Any, pose: Any) -> PoseSeries:
    """Poses of one robot.

    Args:
        robot_id: 0..99.
        t_s: (N,) s, or numpy's datetime64 or timedelta64; ascending.
        pose: (N, 3) x_m, y_m, theta_rad; or (N, 2) without headings. A row with NaN is a lost pose.

    Raises:
        LogError: they are no such arrays.
    """
    utime_us = _stamps_us("t_s", t_s)
    values = _rows("pose", pose, len(utime_us), (2, 3))
    valid = np.isfinite(values).all(axis=1)
    if not valid.any():
        raise LogError("pose: has no row that is all numbers; give x_m, y_m and theta_rad.")
    heading = values[:, 2] if values.shape[1] == 3 else np.full(len(values), np.nan)
    position_m = np.column_stack([values[:, :2], np.zeros(len(values))])
    orientation = quaternion_from_heading(heading)
    position_m[~valid] = orientation[~valid] = np.nan
    return PoseSeries(robot_id, utime_us, position_m, orientation, valid)


def commands_of(
    robot_id: int, t_s: Any, commands: Any, *, kind: Kind, wheelbase_m: float | None = None
) -> CommandSeries:
    """Commands of one robot; each row is held until the next.

    Args:
        robot_id: 0..99.
        t_s: (M,) as of poses.
        commands: (M, K) by kind. twist: vx_mps, vy_mps, omega_radps, or vx_mps, omega_radps; duty:
            percent, wheel_speed: rad/s, both of left and right (of every axle), or of three omni
            wheels, or of front left, front right, rear left, rear right; steering: vx_mps,
            steering_rad.
        kind: of the commands.
        wheelbase_m: distance of the axles, of a robot told steering angles.

    Raises:
        LogError: they are no such arrays.
    """
    if kind not in get_args(Kind):
        raise LogError(f"kind: is {kind!r}, and must be one of {', '.join(get_args(Kind))}.")
    utime_us = _stamps_us("commands_t_s", t_s)
    values = _rows("commands", commands, len(utime_us), WIDTHS[kind])
    if not np.isfinite(values).all():
        raise LogError("commands: have NaN; leave such rows out, the one before is held.")
    if kind == "duty" and np.abs(values).max() > FULL_DUTY_PCT:
        raise LogError(f"commands: a duty is {np.abs(values).max():g} %; give -100 to 100.")
    if kind == "steering":
        values = velocities_of_steering("commands", values[:, 0], values[:, 1], wheelbase_m)
    elif kind == "twist" and values.shape[1] == 2:
        values = np.insert(values, 1, 0.0, axis=1)
    elif kind in ("duty", "wheel_speed") and values.shape[1] == SIDES:
        values = of_both_axles(values)
    count = len(values)
    return CommandSeries(
        robot_id=robot_id,
        utime_us=utime_us,
        kind="twist" if kind == "steering" else kind,
        value=np.pad(values, ((0, 0), (0, 4 - values.shape[1]))),
        repeat=kind == "duty",
        inputs=np.full((count, 2), np.nan),
        detected=np.zeros((count, 2), int),
        mode=turbopi.telemetry_t.MODE_SCRIPT,
    )


def log_of_series(
    poses: Iterable[PoseSeries], commands: Iterable[CommandSeries], name: str, same_clock: bool
) -> Log:
    """A log of some robots, in memory.

    Args:
        poses: one per robot.
        commands: one per robot, overlapping its poses in time.
        name: of the log.
        same_clock: one clock stamped both.

    Raises:
        LogError: a robot has no poses while it is commanded.
    """
    poses, commands = list(poses), list(commands)
    ends = {p.robot_id: p.utime_us[[0, -1]] / 1e6 for p in poses}
    for own in commands:
        start_s, end_s = own.utime_us[[0, -1]] / 1e6
        first_s, last_s = ends.get(own.robot_id, (np.inf, -np.inf))
        if last_s < start_s or (not own.repeat and first_s > end_s):
            raise LogError(
                f"robot {own.robot_id}: its poses go from {first_s:g} to {last_s:g} s and its "
                f"commands from {start_s:g} to {end_s:g} s; give both in one time."
            )
    source = tomlkit.dumps({"import": {"files": [], "same_clock": same_clock}})
    return log_of(b"".join(log_parts(poses, commands, config_toml=source)), name)


def log_of_frames(
    poses: Any,
    commands: Any,
    *,
    kind: Kind | None,
    robot_id: int,
    wheelbase_m: float | None,
    name: str,
    same_clock: bool,
) -> Log:
    """A log of two data frames, dictionaries or datasets, in memory.

    Args:
        poses: columns t_s and POSE, the last of them optional or by QUATERNION; optional robot_id
            and valid; in another unit where their names say it.
        commands: columns t_s and one group of COLUMNS, or of two sides; optional robot_id.
        kind: of the commands; None: by their columns.
        robot_id: of frames that do not say.
        wheelbase_m: see `commands_of`.
        name: of the log.
        same_clock: one clock stamped both.

    Raises:
        LogError: a column is missing, or the numbers make no run.
    """
    own, poses = commands, _under_our_names(poses, OF_POSES, "poses")
    commands = _under_our_names(commands, OF_COMMANDS, "commands")
    kind = _kind_of(commands, own) if kind is None else kind
    pose = _poses(poses)
    if "valid" in poses:
        pose[~np.asarray(poses["valid"], bool)] = np.nan
    value = _columns(commands, _group_of(kind, commands), "commands")
    pose_t_s, command_t_s = np.asarray(poses["t_s"]), np.asarray(commands["t_s"])
    return log_of_series(
        [
            poses_of(robot, pose_t_s[rows], pose[rows])
            for robot, rows in _by_robot(poses, len(pose_t_s), robot_id)
        ],
        [
            commands_of(robot, command_t_s[rows], value[rows], kind=kind, wheelbase_m=wheelbase_m)
            for robot, rows in _by_robot(commands, len(command_t_s), robot_id)
        ],
        name,
        same_clock,
    )


def _poses(frame: Any) -> np.ndarray:
    """(rows, 3) x_m, y_m, theta_rad; (rows, 2) without headings."""
    if all(name in frame for name in QUATERNION):
        turned, norm = unit_quaternions(_columns(frame, QUATERNION, "poses"))
        if (wrong := is_no_turn(norm)).any():
            row = int(wrong.argmax())
            raise LogError(f"poses: row {row}: qw, qx, qy, qz: is {norm[row]:g} long, must be 1.")
        return np.column_stack([_columns(frame, POSE[:-1], "poses"), heading_rad(turned)])
    return _columns(frame, POSE if POSE[-1] in frame else POSE[:-1], "poses")


def _under_our_names(frame: Any, known: frozenset[str], what: str) -> dict[str, Any]:
    """Our columns of a frame, also by names that say all with their unit, as `left_radps`.

    Raises:
        LogError: two of such names hold one quantity, or there are no times.
    """
    names = list(getattr(frame, "columns", getattr(frame, "variables", frame)))
    found = {name: frame[name] for name in names if name in known}
    own, source = frozenset(found), dict[str, str]()
    for name in names:
        targets, factor = (isinstance(name, str) and by_name(name, known - {"robot_id"})) or ((), 1)
        for target in targets if np.isfinite(factor) else ():
            if target in own:
                continue
            if target in source:
                raise LogError(f"{name}: holds what {source[target]} does; leave one of them out.")
            source[target] = name
            found[target] = factor * np.asarray(frame[name]) if factor != 1 else frame[name]
    if "t_s" not in found:
        remedy = "; of times as pandas' index: frame.reset_index(names='t_s')"
        raise LogError(
            f"{what}: has no column t_s, times in s or dates{remedy * hasattr(frame, 'index')}."
        )
    return found


def _kind_of(frame: Any, own: Any) -> Kind:
    """Kind of the commands, by whole groups of our own names, or else of names with units."""
    found = _kinds(own) or _kinds(frame)
    if len(found) != 1:
        known = "; ".join(", ".join(names) for names in COLUMNS.values())
        has = f"those of {' and of '.join(found)}; say the kind" if found else "none of them whole"
        raise LogError(
            f"commands: must have one of these groups of columns: {known}; of two wheels "
            "left_radps, right_radps (or _rpm), or left_pct, right_pct (or _pwm, _unit); of rims "
            f"in m/s divide by the wheel's radius; has {has}."
        )
    return found[0]


def _kinds(frame: Any) -> list[Kind]:
    return [kind for kind in COLUMNS if all(name in frame for name in _group_of(kind, frame))]


def _group_of(kind: Kind, frame: Any) -> tuple[str, ...]:
    """Columns of a kind, but of wheels and a sideways speed only those that the robot has."""
    names = COLUMNS.get(kind, ())
    if kind == "twist" and is_never_sideways(frame):
        return tuple(name for name in names if name != "vy_mps")
    return of_its_wheels(names, frame) if kind == "wheel_speed" else names


def _columns(frame: Any, names: Iterable[str], what: str) -> np.ndarray:
    """(rows, K) numbers."""
    columns = []
    for name in names:
        if name not in frame:
            raise LogError(f"{what}: has no column {name}.")
        try:
            columns.append(np.asarray(frame[name], float))
        except (TypeError, ValueError) as error:
            raise LogError(f"{what}: column {name} is not all numbers ({error}).") from error
    return np.column_stack(columns)


def _by_robot(frame: Any, rows: int, robot_id: int) -> Iterator[tuple[int, np.ndarray]]:
    """Each robot_id with (rows,) bool."""
    ids = np.asarray(frame["robot_id"]) if "robot_id" in frame else np.full(rows, robot_id)
    for number in np.unique(ids).tolist():
        if number not in range(MOST_ROBOTS):
            raise LogError(f"robot_id: is {number!r}, and must be a whole number within 0 to 99.")
        yield int(number), ids == number


def _stamps_us(name: str, t_s: Any) -> np.ndarray:
    stamps = np.asarray(t_s)
    if stamps.ndim != 1 or len(stamps) < 2:
        raise LogError(f"{name}: has shape {stamps.shape}, and must be a row of two times or more.")
    if stamps.dtype.kind == "O" and isinstance(stamps[0], datetime):  # with a zone, of pandas
        import pandas as pd  # slow to import

        stamps = pd.to_datetime(stamps, utc=True).tz_convert(None).to_numpy()
    if stamps.dtype.kind in "Mm":  # dates, or durations since some start
        utime_us = stamps.astype(f"{stamps.dtype.name[:-4]}[us]").astype(np.int64)
    else:
        try:
            times = stamps.astype(float)
        except (TypeError, ValueError) as error:
            raise LogError(f"{name}: is not all numbers ({error}).") from error
        if not np.isfinite(times).all():
            raise LogError(f"{name}: has times that are no numbers; leave such rows out.")
        if np.abs(times).max() > LATEST_S:
            raise LogError(
                f"{name}: has {stamps[np.abs(times).argmax()]}, which is no time in s; divide by "
                "1e9, 1e6 or 1e3 what counts ns, us or ms, or give dates."
            )
        utime_us = np.round(times * 1e6).astype(np.int64)
    if (np.diff(utime_us) <= 0).any():
        row = int(np.argmax(np.diff(utime_us) <= 0)) + 1
        raise LogError(f"{name}: row {row} is not later than the one before; sort, and drop twins.")
    return utime_us


def _rows(name: str, values: Any, count: int, widths: tuple[int, ...]) -> np.ndarray:
    try:
        array = np.array(values, float)
    except (TypeError, ValueError) as error:
        raise LogError(f"{name}: is not all numbers ({error}).") from error
    array = array[:, None] if array.ndim == 1 else array
    if array.ndim != 2 or len(array) != count or array.shape[1] not in widths:
        width = WORDS[widths] if widths in WORDS else " or ".join(map(str, widths))
        raise LogError(
            f"{name}: has shape {array.shape}, and must have {count} rows, one for each time, and "
            f"{width} columns."
        )
    return array
