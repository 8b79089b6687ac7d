# SPDX-License-Identifier: Apache-2.0
"""Robots and their twins in one log, on one time axis."""

import hashlib
import re
from dataclasses import dataclass, replace
from pathlib import Path

from twinmill.data.lcm_log import Events, split_events
from twinmill.data.log import RobotLog, decode_log, read_bytes
from twinmill.data.world_bodies import CHANNEL, WorldBody, world_bodies

TWIN = "TWIN_"  # channel prefix of a twin that shares a network with robots
PREFIXES = ("", TWIN)


@dataclass(frozen=True)
class RecordedRobot:
    """One robot or twin; times of its series are since the earliest stamp of the whole log."""

    prefix: str
    log: RobotLog

    @property
    def name(self) -> str:
        """R<nn> with the channel prefix."""
        return f"{self.prefix}R{self.log.robot_id:02d}"


@dataclass(frozen=True)
class MultiLog:
    """All that speak in a log: robots first, then twins, each by number."""

    robots: list[RecordedRobot]
    t0_utime_us: int
    sha256: str
    warnings: list[str]
    bodies: list[WorldBody]


def read_multi_log(path: Path) -> MultiLog:
    """Reads a log with all channel prefixes.

    Raises:
        LogError: as read_log.
    """
    data = read_bytes(path)
    return multi_log_of(split_events(data, path.name), path, hashlib.sha256(data).hexdigest())


def multi_log_of(events: Events, path: Path, sha256: str = "") -> MultiLog:
    """Log of several robots from events; `path` names them in messages."""
    present = [
        p for p in PREFIXES if any(re.match(rf"{p}R\d{{2,4}}_", c) for c in events.by_channel)
    ]
    logs = {prefix: decode_log(events, path, sha256, prefix) for prefix in present or [""]}
    t0_us = min(log.t0_utime_us for log in logs.values())
    robots = [
        RecordedRobot(prefix, _shifted(robot, (log.t0_utime_us - t0_us) / 1e6))
        for prefix, log in logs.items()
        for robot in log.robots.values()
    ]
    # What one prefix does not know, another does: that is no remark.
    warnings = [w for log in logs.values() for w in log.warnings if "other channels" not in w]
    bodies = world_bodies(events.by_channel.get(CHANNEL, []), t0_us)
    return MultiLog(robots, t0_us, sha256, warnings, bodies)


def _shifted(robot: RobotLog, by_s: float) -> RobotLog:
    times = ("command_t_s", "frame_t_s", "pose_t_s", "seen_t_s")
    return replace(robot, **{name: getattr(robot, name) + by_s for name in times})
