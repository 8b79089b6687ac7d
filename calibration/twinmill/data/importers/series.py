# SPDX-License-Identifier: Apache-2.0
"""Series that every reader of foreign measurements hands over: poses and commands of one robot."""

from collections.abc import Container
from dataclasses import dataclass, field, replace

import numpy as np

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.log import CommandKind, LogError, heading_rad

SIDES = 2  # left and right: the least that a robot is driven by
TURNED_RAD = 0.02  # turns a velocity by 2 % of itself


@dataclass(frozen=True)
class PoseSeries:
    """Poses of one robot.

    Attributes:
        robot_id: 0..99.
        utime_us: (N,) int, ascending.
        position_m: (N, 3) in W, z up.
        orientation_wxyz: (N, 4) unit quaternions; all NaN where the heading was not recorded.
        valid: (N,) bool; elsewhere position and orientation are NaN.
        warnings: sentences.
        called: name of the robot in the source; empty where it has none.
    """

    robot_id: int
    utime_us: np.ndarray
    position_m: np.ndarray
    orientation_wxyz: np.ndarray
    valid: np.ndarray
    warnings: list[str] = field(default_factory=list)
    called: str = ""


@dataclass(frozen=True)
class CommandSeries:
    """Commands of one robot.

    Attributes:
        robot_id: 0..99.
        utime_us: (M,) int, ascending.
        kind: what `value` holds.
        value: (M, 4) duty in percent, wheel speeds in rad/s, or twist, as in drive_t.
        repeat: whether each duty was held until the next row, rather than one row per step.
        inputs: (M, 2) speed_input, turn_input (NaN where not known).
        detected: (M, 2) int, this frame alone, and the vote.
        mode: of the telemetry.
        warnings: sentences.
        world: whether velocities are along the axes of W, not of the body.
        called: name of the robot in the source; empty where it has none.
        mixed: whether duties follow from `inputs` by the robot's own mixing.
    """

    robot_id: int
    utime_us: np.ndarray
    kind: CommandKind
    value: np.ndarray
    repeat: bool
    inputs: np.ndarray
    detected: np.ndarray
    mode: int
    warnings: list[str] = field(default_factory=list)
    world: bool = False
    called: str = ""
    mixed: bool = False


def of_both_axles(sides: np.ndarray) -> np.ndarray:
    """(rows, 4) commands of all wheels, from (rows, 2) of the left and the right ones."""
    return np.tile(sides, 2)


def of_its_wheels(names: tuple[str, ...], there: Container[str]) -> tuple[str, ...]:
    """Names of four wheels' columns; the first two or three, where no others are there."""
    count = next((k for k, name in enumerate(names) if name not in there), len(names))
    no_more = not any(name in there for name in names[count:])
    return names[:count] if count >= SIDES and no_more else names


def stopped_when_silent(series: CommandSeries, timeout_s: float) -> CommandSeries:
    """Commands of a robot that stands once it has heard none for so long, until the next."""
    timeout_us = round(1e6 * timeout_s)
    pauses_us = np.append(np.diff(series.utime_us), np.iinfo(np.int64).max)
    silent = np.flatnonzero((pauses_us > timeout_us) & series.value.any(axis=1))
    if not len(silent):
        return series
    after = silent + 1
    note = f"stopped {counted(len(silent), 'time')}, {timeout_s:g} s after the last command before"
    return replace(
        series,
        utime_us=np.insert(series.utime_us, after, series.utime_us[silent] + timeout_us),
        value=np.insert(series.value, after, 0.0, axis=0),
        inputs=np.insert(series.inputs, after, 0.0 * series.inputs[silent], axis=0),
        detected=np.insert(series.detected, after, series.detected[silent], axis=0),
        warnings=[*series.warnings, f"robot {series.robot_id}: {note}."],
    )


@dataclass(frozen=True)
class DetectionSeries:
    """Bits and times from one robot's camera.

    Attributes:
        robot_id: 0..99.
        utime_us: (K,) int, ascending, the commands' clock.
        seen: (K,) bool.
        range_m, bearing_rad: (K,) NaN where not known.
        warnings: sentences.
    """

    robot_id: int
    utime_us: np.ndarray
    seen: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    warnings: list[str] = field(default_factory=list)


def in_body_frame(commands: CommandSeries, poses: PoseSeries | None) -> CommandSeries:
    """World-frame velocities turned into the body's, by the heading at the time.

    Held for long, such a velocity turns in the body's frame as the robot turns, so a row is added
    wherever the heading has changed by TURNED_RAD. Without headings the robot is taken to hold
    heading 0, and the velocities stay as they are.
    """
    known = poses is not None and poses.valid & np.isfinite(poses.orientation_wxyz[:, 0])
    if not np.any(known):
        return replace(commands, world=False)
    pose_us, heading = poses.utime_us[known], heading_rad(poses.orientation_wxyz[known])
    heading = np.unwrap(heading)
    utime_us = np.unique(np.concatenate([commands.utime_us, pose_us]))
    utime_us = utime_us[utime_us >= commands.utime_us[0]]
    row = np.searchsorted(commands.utime_us, utime_us, side="right") - 1
    at_rad = np.interp(utime_us, pose_us, heading)
    fresh = np.isin(utime_us, commands.utime_us)
    kept, told_rad = [], np.inf
    for k, angle_rad in enumerate(at_rad):
        if fresh[k] or abs(angle_rad - told_rad) > TURNED_RAD:
            kept.append(k)
            told_rad = angle_rad
    utime_us, row, at_rad = utime_us[kept], row[kept], at_rad[kept]
    value = commands.value[row].copy()
    c, s = np.cos(at_rad), np.sin(at_rad)
    x, y = commands.value[row, 0], commands.value[row, 1]
    value[:, 0], value[:, 1] = c * x + s * y, c * y - s * x
    return replace(
        commands,
        utime_us=utime_us,
        value=value,
        inputs=commands.inputs[row],
        detected=commands.detected[row],
        world=False,
    )


def velocities_of_steering(
    where: str, speed_mps: np.ndarray, steering_rad: np.ndarray, wheelbase_m: float | None
) -> np.ndarray:
    """(M, 4) velocities of the body: omega = v tan(steering) / wheelbase (Rajamani 2012, ch. 2).

    Raises:
        LogError: the wheelbase is not known.
    """
    if wheelbase_m is None or not wheelbase_m > 0:
        raise LogError(
            f"{where}: tells steering angles; give the distance of the axles in m, "
            f"{option('wheelbase_m')}."
        )
    zero = np.zeros_like(speed_mps)
    omega_radps = speed_mps * np.tan(steering_rad) / wheelbase_m
    return np.column_stack([speed_mps, zero, omega_radps, zero])


def quaternion_from_heading(heading_rad: np.ndarray) -> np.ndarray:
    """(N,) rad to (N, 4) w, x, y, z; all NaN where the heading is."""
    zero = 0 * heading_rad
    return np.column_stack([np.cos(heading_rad / 2), zero, zero, np.sin(heading_rad / 2)])


def unit_quaternions(quaternion_wxyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 4) of length 1, NaN where the length is 0, as of a lost pose; and the lengths, (N,)."""
    norm = np.linalg.norm(quaternion_wxyz, axis=1)
    return quaternion_wxyz / np.where(norm > 0, norm, np.nan)[:, None], norm


def is_no_turn(norm: np.ndarray) -> np.ndarray:
    """(N,) bool, lengths that are of no unit quaternion, nor of a lost pose."""
    return (np.abs(norm - 1) > 0.05) & (norm > 0)


def with_z_up(
    position_m: np.ndarray, quaternion_wxyz: np.ndarray, up: str
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) and (N, 4) in axes that follow each other as before, the one that is up as z."""
    order, sign = {
        "x": ([1, 2, 0], [1, 1, 1]),
        "y": ([0, 2, 1], [1, -1, 1]),
        "z": ([0, 1, 2], [1, 1, 1]),
    }[up]
    turned = quaternion_wxyz[:, [0, *(1 + k for k in order)]] * [1, *sign]
    return position_m[:, order] * sign, turned


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions, (N, 4) or (4,) each, w first."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )
