# SPDX-License-Identifier: Apache-2.0
"""What robots say on the LCM bus, and the one channel on which they are told."""

import re
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import lcm
import turbopi

URL = "udpm://239.255.76.67:7667?ttl=1"
BACKLOG_S = 0.02  # what waits is taken in for so long at once
WINDOW_S = 2.0  # over which rates and detections are told
RUN_PERIOD_S = 5.5  # robots say who they are every 5 s
GONE_S = 1.0  # a robot that said nothing for so long is not there; it speaks 30 times a second
MODES = ("stopped", "running", "script", "fault")
CAMERA_LOST = turbopi.telemetry_t.STATUS_CAMERA_LOST
FRAME_STALE = turbopi.telemetry_t.STATUS_FRAME_STALE


@dataclass
class Robot:
    """What one robot said last.

    Attributes:
        telemetry, run: its newest messages.
        heard_s: when it said anything last, by time.monotonic().
        run_heard_s: when it said who it is.
        recent: (time.monotonic(), telemetry_t) of the last WINDOW_S.
        clock_s: how far its clock is ahead of ours, less the delay of the network.
        acks: by number of the command.
    """

    robot_id: int
    telemetry: Any = None
    run: Any = None
    heard_s: float = 0.0
    run_heard_s: float = 0.0
    recent: deque = field(default_factory=deque)
    acks: dict = field(default_factory=dict)

    @property
    def mode(self) -> str:
        """In words, or empty before the first telemetry."""
        return MODES[self.telemetry.mode] if self.telemetry else ""

    @property
    def is_here(self) -> bool:
        """It said something just now."""
        return time.monotonic() - self.heard_s < GONE_S

    @property
    def clock_s(self) -> float:
        """NaN before the first telemetry."""
        return max(
            (t.utime_us / 1e6 - heard_utime_s for _, heard_utime_s, t in self.recent),
            default=float("nan"),
        )

    @property
    def detected_frac(self) -> float:
        """Share of the last seconds' control steps in which it saw a neighbour; NaN without any."""
        if not self.recent:
            return float("nan")
        return sum(t.detected for _, _, t in self.recent) / len(self.recent)

    @property
    def camera(self) -> str:
        """In words: lost, no frames, or how many a second."""
        if not self.telemetry:
            return "?"
        if self.telemetry.status_flags & CAMERA_LOST:
            return "lost"
        if self.telemetry.status_flags & FRAME_STALE:
            return "no frames"
        frames = {t.frame_seq for _, _, t in self.recent}
        passed_s = self.recent[-1][0] - self.recent[0][0] if self.recent else 0
        return f"{(len(frames) - 1) / passed_s:.0f} fps" if passed_s > 0.5 else "works"

    def to_json(self) -> dict:
        """All that is known."""
        t, run = self.telemetry, self.run
        return {
            "robot_id": self.robot_id,
            "source": run.source if run else None,
            "version": run.version if run else None,
            "behavior": run.behavior if run else None,
            "mode": self.mode or None,
            "battery_V": t.battery_V if t else None,
            "camera": self.camera,
            "clock_ahead_s": self.clock_s,
            "last_heard_s": time.monotonic() - self.heard_s,
            "detected": bool(t.detected) if t else None,
            "detected_frac": self.detected_frac,
            "status_flags": t.status_flags if t else None,
        }


class Fleet:
    """All robots of a bus."""

    def __init__(
        self,
        url: str = URL,
        channel_prefix: str = "",
        connect: Callable[[str], Any] = lcm.LCM,
    ):
        """Joins the bus.

        Args:
            url: of the bus.
            channel_prefix: before all channels, the command's too.
            connect: makes something that behaves like lcm.LCM.

        Raises:
            ValueError: there is no such bus.
        """
        self.robots: dict[int, Robot] = {}
        # Called again and again while listening; what it raises ends that.
        self.watch: Callable[[], None] = lambda: None
        self._prefix = channel_prefix
        try:
            self.bus = connect(url)
            channels = re.escape(channel_prefix) + "R[0-9][0-9]+_(TELEMETRY|RUN|ACK)"
            self.bus.subscribe(channels, self._on_message).set_queue_capacity(1000)
        except RuntimeError as error:
            raise ValueError(
                f"--lcm-url {url}: cannot be joined; is there a network with a route for multicast "
                "(ip route add 224.0.0.0/4 dev DEVICE)?"
            ) from error

    def _on_message(self, channel: str, data: bytes) -> None:
        name, _, kind = channel.removeprefix(self._prefix).partition("_")
        try:
            message = getattr(turbopi, f"{kind.lower()}_t").decode(data)
        except ValueError:
            return  # another program's type on this channel
        robot = self.robots.setdefault(int(name[1:]), Robot(int(name[1:])))
        now_s = robot.heard_s = time.monotonic()
        if kind == "ACK":
            robot.acks[message.seq] = message
        elif kind == "RUN":
            robot.run, robot.run_heard_s = message, now_s
        else:
            robot.telemetry = message
            robot.recent.append((now_s, time.time(), message))
            while robot.recent[0][0] < now_s - WINDOW_S:
                robot.recent.popleft()

    def listen(self, duration_s: float, enough: Callable[[], bool] = lambda: False) -> None:
        """Takes in what robots say for some time, or until that is enough.

        What has come already is taken in before anybody judges what has not.
        """
        end_s = time.monotonic() + duration_s
        while not enough() and (left_s := end_s - time.monotonic()) > 0:
            self.bus.handle_timeout(max(1, min(20, int(1000 * left_s))))
            backlog_end_s = time.monotonic() + BACKLOG_S
            while time.monotonic() < backlog_end_s and self.bus.handle_timeout(0):
                pass
            self.watch()

    def send(self, command: Any) -> None:
        """Says a swarm_command_t once."""
        self.bus.publish(f"{self._prefix}SWARM_COMMAND", command.encode())

    def here(self) -> set[int]:
        """Robots that are there now."""
        return {robot.robot_id for robot in self.robots.values() if robot.is_here}
