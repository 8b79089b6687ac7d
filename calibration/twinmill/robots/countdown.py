# SPDX-License-Identifier: Apache-2.0
"""Until the instant of a start: who of those that accepted it will not start with the others."""

import time
from dataclasses import dataclass, field
from typing import Any

import turbopi

from twinmill.robots.fleet import GONE_S, TELEMETRY, Fleet, Robot

SIGNED_S = 2.0  # robots sign ten times a second; half of all lost, so many in a row are not

STOPPED = "stopped by another command"
NOT_BEGUN = "not driving when the others had begun"
UNHEARD = "told something by another operator who was not heard here"


@dataclass(frozen=True)
class Dropouts:
    """Robots that have accepted a start and will not begin it with the others.

    Attributes:
        words: why, by number, to go on behind "was" or "were".
        taken: those of them that another operator is to start, by a command that came later.
    """

    words: dict[int, str] = field(default_factory=dict)
    taken: frozenset[int] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.words)

    def beside(self, more: dict[int, str]) -> "Dropouts":
        """These and others; what was known before stays."""
        return Dropouts({**more, **self.words}, self.taken)


def find_dropouts(fleet: Fleet, robots: set[int], seq: int, *, only_stopped: bool) -> Dropouts:
    """Robots that have accepted a start, and what they have signed, or not, speaks against it.

    Args:
        fleet: where they are.
        robots: of whom it is asked.
        seq: the start's number.
        only_stopped: who does not begin is left behind; but a stop is meant for all.
    """
    words, taken = {}, set()
    for robot, ack in _accepted(fleet, robots, seq):
        why, is_taken = _why(fleet, robot, ack)
        if why and (why == STOPPED or not only_stopped):
            words[robot.robot_id] = why
            taken |= {robot.robot_id} if is_taken else set()
    return Dropouts(words, frozenset(taken))


def stopped_by_another(fleet: Fleet, robots: set[int], seq: int) -> dict[int, str]:
    """Those that have accepted a start, and signed since that they obeyed a stop not said here."""
    return {
        robot.robot_id: STOPPED
        for robot, ack in _accepted(fleet, robots, seq)
        if _obeyed_a_stop(fleet, robot, ack)
    }


def _accepted(fleet: Fleet, robots: set[int], seq: int) -> list[tuple[Robot, Any]]:
    known = [fleet.robots[i] for i in sorted(robots) if i in fleet.robots]
    return [(r, ack) for r in known if (ack := r.signed_acks.get(seq)) and ack.accepted]


def _why(fleet: Fleet, robot: Robot, ack: Any) -> tuple[str, bool]:
    """Reason, empty where it will start; and whether it is another operator's."""
    link, now_s = robot.link, time.monotonic()
    if _obeyed_a_stop(fleet, robot, ack):
        return STOPPED, False
    if link.session != ack.session:
        return "started anew, and has forgotten it", False
    others = fleet.others(robot, ack.session)
    start = next((c for c in others if c.starts), None)
    if start:
        return f"taken over by another operator ({start.words})", True
    if link.session_us > ack.session_us:
        if link.status_flags & TELEMETRY.STATUS_LINK_LOST:
            return "without word from this command for too long", False
        if not link.armed:
            return STOPPED, False
        if link.counter > max([fleet.counter, *(c.counter for c in others)]):
            return UNHEARD, False
    if now_s - robot.heard_s > GONE_S or now_s - robot.link_s > SIGNED_S:
        return "not heard any more", False
    return "", False


def _obeyed_a_stop(fleet: Fleet, robot: Robot, since: Any) -> bool:
    """Of somebody else, after this signed_ack_t."""
    return any(
        ack.verb == turbopi.swarm_command_t.VERB_STOP
        and ack.accepted
        and ack.session_us > since.session_us
        for seq, ack in robot.signed_acks.items()
        if seq not in fleet.said and ack.session == since.session
    )
