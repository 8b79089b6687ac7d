# SPDX-License-Identifier: Apache-2.0
"""Until the instant of a start: who of those that accepted it will not start with the others."""

import math
import time
from dataclasses import dataclass, field
from typing import Any

import turbopi

from twinmill.robots.fleet import (
    DRY_RUN,
    GONE_S,
    NO_MORE,
    SIGNED_S,
    TELEMETRY,
    Fleet,
    Heard,
    Robot,
)

ARM = turbopi.signed_command_t.VERB_ARM
STOPPED = "stopped by another command"
DOUBLE = "heard as two robots of one number"  # which refuses a start before it is said
NOT_BEGUN = "not driving when the others had begun"
NONE_BEGUN = "not driving when the instant of the start was past"  # clocks may have been set
NOT_HEARD_SINCE = "not heard since the instant of the start (a hang, or a late network)"
UNHEARD = "told something by another operator or terminal whose words were not heard here"
HELD_BY_ANOTHER = "taken over by another operator or terminal, whose command was not heard here"


@dataclass(frozen=True)
class Dropouts:
    """Robots that will not begin a start as it was meant, though they may have accepted it.

    Attributes:
        words: why, by number, to go on behind "was" or "were".
        taken: those of them that another operator starts, by a command that came later.
    """

    words: dict[int, str] = field(default_factory=dict)
    taken: frozenset[int] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.words)

    @property
    def theirs(self) -> "Dropouts":
        """Those that another operator starts."""
        return Dropouts({i: self.words[i] for i in self.taken}, self.taken)

    def beside(self, more: dict[int, str]) -> "Dropouts":
        """These and others; what was known before stays."""
        return Dropouts({**more, **self.words}, self.taken)


def find_dropouts(
    fleet: Fleet,
    robots: set[int],
    seq: int,
    *,
    only_stopped: bool,
    link_timeout_ms: int | None = None,
) -> Dropouts:
    """Robots for which a start is over, by what they have signed, or not, since they were armed.

    Or as they turn out to be two of one number, of whom nothing else is known then.

    Who refuses it for a reason of his own is none of them; but who accepts it and says that he will
    not do it is, as one whose motor board is not opened.

    Args:
        fleet: where they are.
        robots: of whom it is asked.
        seq: the start's number.
        only_stopped: who does not begin is left behind; but a stop is meant for all, and two robots
            of one number are no start's.
        link_timeout_ms: that was sent with it; None: nobody is judged by it.
    """
    words, taken = {}, set()
    double = {i: DOUBLE for i in robots if (r := fleet.robots.get(i)) and r.is_double}
    for robot in _linked(fleet, robots - {*double}):
        ack = robot.signed_acks.get(seq)
        whose = _whose(fleet, robot, ack, link_timeout_ms) if seq in fleet.said else ""
        why = whose or (_why(fleet, robot, ack) if ack else "")
        why = why or (_unfit(robot, ack, link_timeout_ms) if ack and ack.accepted else "")
        if why and (why == STOPPED or not only_stopped):
            words[robot.robot_id] = why
            taken |= {robot.robot_id} if whose else set()
    return Dropouts(double | words, frozenset(taken))


def stopped_by_another(fleet: Fleet, robots: set[int], seq: int) -> dict[int, str]:
    """Those that have accepted a start, and signed since that they obeyed a stop not said here."""
    return {
        robot.robot_id: STOPPED
        for robot, ack in _answered(fleet, robots, seq)
        if ack.accepted and _obeyed_a_stop(fleet, robot, ack.session, after_us=ack.session_us)
    }


def _linked(fleet: Fleet, robots: set[int]) -> list[Robot]:
    return [r for i in sorted(robots) if (r := fleet.robots.get(i)) and r.link]


def _answered(fleet: Fleet, robots: set[int], seq: int) -> list[tuple[Robot, Any]]:
    return [(r, ack) for r in _linked(fleet, robots) if (ack := r.signed_acks.get(seq))]


def _whose(fleet: Fleet, robot: Robot, ack: Any, link_timeout_ms: int | None) -> str:
    """Words on another operator who starts it, by its own word; empty where none does.

    Args:
        fleet: where it is.
        robot: it must have a link.
        ack: its answer to the start from here; None: it has not answered.
        link_timeout_ms: as of find_dropouts().
    """
    link = robot.link
    others = fleet.others(robot, ack.session if ack else link.session)
    start = next((c for c in others if c.starts), None)
    if start:
        since = robot.signed_acks.get(start.seq)
        after_us = since.session_us if since else math.inf
        is_over = _obeyed_a_stop(fleet, robot, link.session, after_us=after_us)
        return "" if is_over else f"taken over by another operator or terminal ({start.words})"
    is_unheard = ack and ack.accepted and link.session == ack.session
    # A start alone changes that time; one that is untethered has nobody who says that he is there.
    is_of_start = link_timeout_ms is not None and link.link_timeout_ms != link_timeout_ms
    if is_unheard and _obeys_unheard(fleet, robot, others):
        return HELD_BY_ANOTHER if is_of_start or robot.hears_other_operator else ""
    return ""


def _obeys_unheard(fleet: Fleet, robot: Robot, others: list[Heard]) -> bool:
    """A command is in force that is above all that were heard."""
    return robot.link.armed and robot.link.counter > max(
        [fleet.counter, *(c.counter for c in others)]
    )


def _why_not(fleet: Fleet, robot: Robot, ack: Any) -> str:
    """Reason of one that refused, where that is another's stop since it was armed."""
    armed_us = [
        a.session_us
        for a in robot.signed_acks.values()
        if a.verb == ARM and a.accepted and a.session == ack.session
    ]
    between = {"after_us": max(armed_us, default=0), "before_us": ack.session_us}
    return STOPPED if _obeyed_a_stop(fleet, robot, ack.session, **between) else ""


def _why(fleet: Fleet, robot: Robot, ack: Any) -> str:
    """Reason of one that has answered and is nobody else's; empty where it will start."""
    if not ack.accepted:
        return _why_not(fleet, robot, ack)
    if robot.is_old_news:
        return NO_MORE if robot.signs_no_more else "not heard any more, but by old news"
    link, now_s = robot.link, time.monotonic()
    if _obeyed_a_stop(fleet, robot, ack.session, after_us=ack.session_us):
        return STOPPED
    if link.session != ack.session:
        return "started anew, and has forgotten it"
    if link.session_us > ack.session_us:
        if link.status_flags & TELEMETRY.STATUS_LINK_LOST:
            return "without word from this command for too long"
        if not link.armed:
            return STOPPED
        if _obeys_unheard(fleet, robot, fleet.others(robot, ack.session)):
            return UNHEARD
    if now_s - robot.heard_s > GONE_S or now_s - robot.link_s > SIGNED_S:
        return "not heard any more"
    return ""


def _unfit(robot: Robot, ack: Any, link_timeout_ms: int | None) -> str:
    """Words on one that has accepted, and not what was meant, by its own word; may be empty.

    By these a start fails in any case: known before the instant, they keep the others from it.
    """
    if ack.reason or DRY_RUN in robot.alarms:
        return f"not able to drive ({ack.reason or DRY_RUN})"
    link = robot.link
    is_since = link.session == ack.session and link.session_us > ack.session_us
    if link_timeout_ms is None or not is_since or link.link_timeout_ms == link_timeout_ms:
        return ""
    lasts = f"for {link.link_timeout_ms / 1e3:g} s" if link.link_timeout_ms else "for ever"
    return f"about to drive on {lasts} without this command"


def _obeyed_a_stop(
    fleet: Fleet, robot: Robot, session: int, *, after_us: int, before_us: float = math.inf
) -> bool:
    """True if it obeyed somebody else's stop, in this time of this session."""
    return any(
        ack.verb == turbopi.swarm_command_t.VERB_STOP
        and ack.accepted
        and after_us < ack.session_us < before_us
        for seq, ack in robot.signed_acks.items()
        if seq not in fleet.said and ack.session == session
    )
