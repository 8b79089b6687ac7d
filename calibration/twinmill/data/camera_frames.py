# SPDX-License-Identifier: Apache-2.0
"""The camera frames of one robot, as its telemetry or its detections tell them."""

from dataclasses import dataclass

import numpy as np

from twinmill.data.log import RobotLog


@dataclass(frozen=True)
class Frames:
    """K frames, each once, however many control steps used it.

    Attributes:
        t_s: (K,) time stamp, robot's clock; where the log has no stamps of frames, the time of the
            control step.
        stamped: false if it is the control step's.
        raw: (K,) bool, the frame alone; all false if `has_raw` is.
        has_raw: false in logs that keep the voted bit alone.
        voted: (K,) bool, after the vote that the frame closed.
        has_vote: false of cameras that do not vote; `voted` is then `raw`.
    """

    t_s: np.ndarray
    stamped: bool
    raw: np.ndarray
    has_raw: bool
    voted: np.ndarray
    has_vote: bool = True


def frames_of(robot: RobotLog) -> Frames | None:
    """Frames of a robot, or None if its log tells of none.

    Args:
        robot: as read from the log.
    """
    if len(robot.seen_t_s):
        return Frames(robot.seen_t_s, True, robot.seen, True, robot.seen, has_vote=False)
    stamped = bool(np.isfinite(robot.frame_t_s).any())
    if not len(robot.detected) or not (stamped or robot.detected.any()):
        return None
    t_s = robot.frame_t_s if stamped else robot.command_t_s
    known = np.flatnonzero(np.isfinite(t_s))
    fresh = known[np.diff(t_s[known], prepend=-np.inf) > 0]
    raw, voted = robot.detected_raw[fresh] & 1 > 0, robot.detected[fresh] & 1 > 0
    return Frames(t_s[fresh], stamped, raw, bool(raw.any() or not voted.any()), voted)
