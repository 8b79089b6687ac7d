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
        further: (K, k - 1) bool, bits 2 to k as `told` tells the first; all else is of the first.
    """

    t_s: np.ndarray
    stamped: bool
    raw: np.ndarray
    has_raw: bool
    voted: np.ndarray
    has_vote: bool = True
    further: np.ndarray | None = None

    @property
    def told(self) -> np.ndarray:
        """(K, k) bool, all bits: after their votes, or of the frame where there is no vote."""
        first = (self.voted if self.has_vote else self.raw)[:, None]
        return first if self.further is None else np.hstack([first, self.further])


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
    raw, *_ = _bits(robot.detected_raw[fresh]).T
    voted, *further = _bits(robot.detected[fresh]).T
    return Frames(
        t_s[fresh],
        stamped,
        raw,
        bool(raw.any() or not voted.any()),
        voted,
        further=np.column_stack(further) if further else None,
    )


def _bits(numbers: np.ndarray) -> np.ndarray:
    """(K, k) bool, bit 1 first; k is as many as any of the numbers needs, at least one."""
    count = max(int(np.max(numbers, initial=0)).bit_length(), 1)
    return numbers[:, None] >> np.arange(count) & 1 > 0
