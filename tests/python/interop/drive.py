# SPDX-License-Identifier: Apache-2.0
"""The drive whose files other programs are given, or give, and its numbers by hand.

A robot stands for 2 s and then drives along x at SPEED_MPS; three poses of fifty are lost.
"""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

LOG = "drive.lcmlog"
START_US = 1_700_000_000_000_000
COUNT, STEP_US = 400, 10_000
SPEED_MPS, STANDS = 0.3, 200
LOST = 24
ROBOT = 1
Event = tuple[int, str, bytes]


def x_m(k: int) -> float:
    """Place in frame k."""
    return max(0, k - STANDS) * SPEED_MPS * STEP_US * 1e-6


def seen(k: int) -> bool:
    """True if the capture had it in frame k."""
    return k % 50 < 47


def write_log(folder: Path, more: Iterable[Event] = ()) -> Path:
    """The drive as a log, and `more` after it, by LCM's own writer for Python."""
    import lcm

    path = folder / LOG
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for event in (*events(), *more):
        log.write_event(*event)
    log.close()
    return path


def events() -> Iterator[Event]:
    """Stamp in us, channel and message of each; the messages' code is what lcm-gen makes."""
    import turbopi

    for k in range(COUNT):
        pose, told = turbopi.pose_t(), turbopi.telemetry_t()
        pose.utime_us = told.utime_us = START_US + k * STEP_US
        pose.robot_id = told.robot_id = ROBOT
        pose.seq, pose.valid = k, int(seen(k))
        pose.position_m = [x_m(k), 0.0, 0.1] if seen(k) else [math.nan] * 3
        pose.orientation_wxyz = [1.0, 0.0, 0.0, 0.0]
        told.seq, told.wheel_duty_pct = k, [50 * (k >= STANDS)] * 4
        told.battery_V = 8.0 if k % 10 == 0 else math.nan
        told.speed_input = told.turn_input = math.nan
        yield pose.utime_us, f"R{ROBOT:02d}_POSE", pose.encode()
        yield told.utime_us, f"R{ROBOT:02d}_TELEMETRY", told.encode()


def export(folder: Path, to: str, name: str, more: Iterable[Event] = ()) -> None:
    """Writes the log into a folder in the form that another program reads."""
    import twinmill as tm

    tm.load(write_log(folder, more)).export(folder / name, to=to)


def told_at(log_path: Path) -> bool:
    """True if each command of a file that was imported is at the time of its frame."""
    import numpy as np

    from twinmill.data.log import read_log

    robot = read_log(log_path).robots[ROBOT]
    due_s = robot.pose_t_s[0] + np.arange(COUNT) * STEP_US * 1e-6
    return len(robot.command_t_s) == COUNT and np.allclose(robot.command_t_s, due_s, atol=2e-6)


def told_of_import(log_path: Path, kind: str) -> dict[str, bool]:
    """Verdicts on a file that was imported: times, places, gaps and commands."""
    import numpy as np

    from twinmill.data.log import read_log

    robot = read_log(log_path).robots[ROBOT]
    k = np.arange(COUNT)
    there = np.array([seen(n) for n in k])
    places = np.array([x_m(n) for n in k])
    moving = robot.command[:, 0] != 0
    return {
        "stamps": np.allclose(robot.pose_t_s - robot.pose_t_s[0], k * STEP_US * 1e-6, atol=2e-6),
        "places": np.allclose(robot.pose[robot.valid, 0], places[there], atol=1e-6),
        "lost poses": np.array_equal(robot.valid, there),
        f"commands as {kind}": robot.command_kind == kind and moving.any() and not moving.all(),
    }
