# SPDX-License-Identifier: Apache-2.0
"""What every reader of foreign measurements hands over: poses and commands of one robot."""

from dataclasses import dataclass, field

import numpy as np

from twinmill.data.log import CommandKind


@dataclass(frozen=True)
class PoseSeries:
    """Poses of one robot.

    Attributes:
        robot_id: 0..99.
        utime_us: (N,) int, ascending.
        position_m: (N, 3) in W, z up.
        orientation_wxyz: (N, 4) unit quaternions.
        valid: (N,) bool; elsewhere position and orientation are NaN.
    """

    robot_id: int
    utime_us: np.ndarray
    position_m: np.ndarray
    orientation_wxyz: np.ndarray
    valid: np.ndarray


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


def quaternion_from_heading(heading_rad: np.ndarray) -> np.ndarray:
    """(N,) rad to (N, 4) w, x, y, z."""
    zero = np.zeros_like(heading_rad)
    return np.column_stack([np.cos(heading_rad / 2), zero, zero, np.sin(heading_rad / 2)])


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
