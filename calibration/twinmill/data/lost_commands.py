# SPDX-License-Identifier: Apache-2.0
"""Stretches whose commands are not in the log, told from commands that hold for long.

Programs that write a command when it changes leave gaps on purpose. One that says the same command
again and again while it holds does not, so that a gap in its beat is a loss.
"""

import numpy as np

from twinmill.counted import counted
from twinmill.data.log import RobotLog

EVEN, FEWEST = 0.5, 30  # of the usual step: on the beat; commands from which a beat is told
BEAT = 0.85  # share of the steps on the beat: a gap a second leaves more
HOLE_S, HOLE_BEATS = 0.5, 8  # longest gap that may be a late message
AGAIN, AGAIN_SHARE = 3, 0.1  # stretches as long as a hole in which one command is said again
STANDING_M, STANDING_RAD = 0.05, 0.1  # within which a robot that stands is seen


def lost_commands(robot: RobotLog) -> np.ndarray:
    """(K, 2) s, last command before each hole and first one after it; (0, 2) where none is lost.

    A program that falls silent while the robot stands as it was told has lost nothing.
    """
    t_s, holes = robot.command_t_s, np.empty((0, 2))
    if len(t_s) < FEWEST:
        return holes
    steps_s = np.diff(t_s)
    longest_s = max(HOLE_S, HOLE_BEATS * float(np.median(steps_s)))
    if not keeps_beat(t_s):
        return holes
    if not _says_again(robot, longest_s):
        return holes
    last = np.flatnonzero(steps_s > longest_s)
    gaps = [(k, t_s[k], t_s[k + 1]) for k in last]
    found = [
        (begin_s, end_s)
        for k, begin_s, end_s in gaps
        if robot.command[k].any() or not _stands(robot, begin_s, end_s)
    ]
    return np.array(found).reshape(-1, 2)


def keeps_beat(t_s: np.ndarray) -> bool:
    """True if stamps come at a beat, and not when something changes."""
    steps_s = np.diff(t_s)
    return bool(len(steps_s) and _on_the_beat(steps_s).mean() >= BEAT)


def beat_s(t_s: np.ndarray) -> float:
    """Time from stamp to stamp: the mean of usual steps, since stamps may be rounded."""
    steps_s = np.diff(t_s)
    return float(steps_s[_on_the_beat(steps_s)].mean())


def _on_the_beat(steps_s: np.ndarray) -> np.ndarray:
    """(K,) bool: steps about as long as usual."""
    usual_s = np.median(steps_s)
    return np.abs(steps_s - usual_s) <= EVEN * usual_s


def words(robot: RobotLog, lost_s: np.ndarray) -> str:
    """When commands are missing, and how often they come."""
    beat_ms = 1000 * float(np.median(np.diff(robot.command_t_s)))
    stretches = [f"from {begin_s:.2f} to {end_s:.2f} s" for begin_s, end_s in lost_s[:3]]
    more = f" and {counted(len(lost_s) - 3, 'time')} more" if len(lost_s) > 3 else ""
    return f"no commands {', '.join(stretches)}{more}; they come every {beat_ms:.0f} ms"


def _says_again(robot: RobotLog, longest_s: float) -> bool:
    """True if one command is repeated for as long as a hole lasts, here and there."""
    t_s = robot.command_t_s
    changes = (np.diff(robot.command, axis=0) != 0).any(axis=1) | (np.diff(t_s) > longest_s)
    begin = np.flatnonzero(np.concatenate([[True], changes]))
    held_s = t_s[np.append(begin[1:], len(t_s)) - 1] - t_s[begin]
    long_s = held_s[held_s >= longest_s]
    return len(long_s) >= AGAIN and long_s.sum() > AGAIN_SHARE * np.ptp(t_s)


def _stands(robot: RobotLog, begin_s: float, end_s: float) -> bool:
    """True if the robot is seen to stand, once it has come to rest."""
    rest_s = begin_s + HOLE_S
    within = robot.valid & (robot.pose_t_s > rest_s) & (robot.pose_t_s < end_s)
    if np.count_nonzero(within) < 2:
        return True
    low, high = np.nanquantile(robot.pose[within], (0.01, 0.99), axis=0)
    span = np.nan_to_num(high - low)
    return bool((span < (STANDING_M, STANDING_M, STANDING_RAD)).all())
