# SPDX-License-Identifier: Apache-2.0
"""Stamps in another unit than s: commanded ways against measured ones, before any are aligned.

Poses and commands that count ms as s make a run so many times too long: its commands tell a way and
turns that many times too large. Lengths in another unit change the way alone. Wheel speeds in
another unit do the same as stamps: rows tell these apart, unless poses come a thousand a second.
"""

import numpy as np
import twinmill_native as native

from twinmill.data.checks.commands import anew_with, body_by_command
from twinmill.data.checks.finding import InputFinding, in_words
from twinmill.data.checks.rolling import factor_words
from twinmill.data.log import RobotLog
from twinmill.data.units import unit_of_steps

# Measured over commanded ways and turns, as for units of lengths, and what then counts as s.
STAMPS_IN = (((1 / 3e3, 1 / 3e2), "ms"), ((1 / 3e6, 1 / 3e5), "us"), ((1 / 3e9, 1 / 3e8), "ns"))


def check_stamps(
    robot: RobotLog, model: native.Model | None, label: str, own: int | None = None
) -> list[InputFinding]:
    """A finding where both the way and the turns are too small by what a unit of time makes.

    Args:
        robot: as it was read.
        model: tells what wheels do. Without one, only velocity commands are checked.
        label: name of its log.
        own: robot_id that options are to name; None where the log has no other robot.
    """
    body = body_by_command(model, robot.command_kind)
    ratios = _measured_over_commanded(robot, body) if body is not None else np.zeros(2)
    for (low, high), unit in STAMPS_IN:
        if np.all((low < ratios) & (ratios < high)):
            mend, of_all = in_words(anew_with({"t_s": f"t_{unit}"}), own)
            what = f"the stamps are in {unit}, not in s"
            wheels = _of_wheels(robot, ratios)
            if wheels:
                what = f"{wheels[0]}; or {what}"
                mend, of_all = (f"{wheels[1]}; or {text}" for text in (mend, of_all))
            return [
                InputFinding(
                    what,
                    f"the robot drives {ratios[0]:.2g} and turns {ratios[1]:.2g} times as fast as "
                    "its commands say",
                    mend,
                    True,
                    label,
                    robot.robot_id,
                    remedy_of_all=of_all,
                )
            ]
    return []


def _of_wheels(robot: RobotLog, ratios: np.ndarray) -> tuple[str, str] | None:
    """A unit of wheel speeds that makes the same ratios, and its remedy; None if rows belie it."""
    if robot.command_kind != "wheel_speed" or len(robot.pose_t_s) < 2:
        return None
    step_s = float(np.median(np.diff(robot.pose_t_s)))
    return factor_words(float(np.mean(ratios))) if unit_of_steps(step_s) == "s" else None


def _measured_over_commanded(robot: RobotLog, body: np.ndarray) -> np.ndarray:
    """(2,) way and turns between changes of the command; zero of what is not known.

    Args:
        robot: M commands, N poses.
        body: (3, 4) velocities by unit of each column.
    """
    changed = np.append(True, np.any(np.diff(robot.command, axis=0), axis=1))
    known = robot.valid & np.isfinite(robot.pose).all(axis=1)
    if np.count_nonzero(known) < 2 or not changed.any():
        return np.zeros(2)
    t_s, pose = robot.pose_t_s[known], robot.pose[known]
    at_s = np.clip(np.append(robot.command_t_s[changed], t_s[-1]), t_s[0], t_s[-1])
    place = np.column_stack([np.interp(at_s, t_s, column) for column in pose[:, :2].T])
    turned_rad = np.abs(np.diff(np.interp(at_s, t_s, np.unwrap(pose[:, 2])))).sum()
    moved = [np.linalg.norm(np.diff(place, axis=0), axis=1).sum(), turned_rad]
    ways = np.abs(robot.command[changed] @ body.T) * np.diff(at_s)[:, None]
    told = np.array([np.hypot(ways[:, 0], ways[:, 1]).sum(), ways[:, 2].sum()])
    return np.divide(moved, told, out=np.zeros(2), where=told > 0)
