# SPDX-License-Identifier: Apache-2.0
"""Fate of robots that were started, by their signed words, until they stand."""

import time
from dataclasses import dataclass, replace

import turbopi

from twinmill.robots.fleet import (
    MAY_MOVE,
    NO_MORE,
    OF_A_PART,
    TELEMETRY,
    Fleet,
    Heard,
    Robot,
)
from twinmill.robots.tell import Start

# A robot signs ten times a second; without a word for as long as it would wait for its operator,
# nobody knows what it does.
SILENT_S = 2.0
SETTLE_S = 0.3  # a state that lasts is told; a camera that stutters would be a flood of words


@dataclass(frozen=True)
class State:
    """Motion of a robot by its last words.

    Attributes:
        words: to go on behind its name; of one that stands, why it does.
        before: the same of one that has been stopped since, if that was not as it should be.
        stands: it has signed so, and will not drive on by itself.
        is_meant: somebody wished it so: it drives, or was stopped by a person or its script.
        is_by_other: that was another operator, and not who holds it.
        is_taken: another operator has commanded it since, and it is his.
    """

    words: str
    before: str = ""
    stands: bool = False
    is_meant: bool = False
    is_by_other: bool = False
    is_taken: bool = False

    def told_of(self, name: str) -> str:
        """A sentence without its full stop."""
        if self.stands:
            return f"{name} stands: {self.words}"
        more = ", and is not held from here any more; the end of this command stops it all the same"
        return f"{name} {self.words}{more if self.is_taken else ''}"


DRIVES = State("drives", is_meant=True)
WAITS = State(
    "has accepted the start, and is not heard to drive yet: its clock may be behind, or the "
    "network late",
    "had accepted the start, and was not heard to drive yet",
)
AWAITS = State(
    "waits for another start, unheard here, and begins by itself",
    "waited for another start, unheard here",
)
DRIVES_AS_UNHEARD = State(
    "drives, and obeyed another operator or terminal whose words were not heard here",
    "had obeyed another operator or terminal whose words were not heard here",
)
DRIVES_ANEW = State(
    "drives, though its program was started anew: it has autostart",
    "drove after its program was started anew: it has autostart",
)
SILENT = State(
    "is not heard any more: nobody knows whether it stands",
    "had not been heard for a while",
)
OLD_NEWS = State(
    "is told by old news alone, as a recording or a late network brings: nobody knows whether it "
    "stands",
    "had been told by old news alone for a while",
)
UNSIGNED = State(
    f"is {NO_MORE}: nobody knows whether it stands",
    "was not heard to sign with this operator's key for a while",
)
DOUBLE = State(
    "is two robots of one number, or hears another: nobody knows which does what",
    "had been two robots of one number, or heard another",
)
UNCONFIRMED = State(
    "says that it stands, but not that its motor board took zero",
    "had said that it stood, and not that its motor board had taken zero",
)
RESTARTED = State("its program was started anew", stands=True)
LINK_LOST = State("it had lost its link to this command", stands=True)
LINK_LOST_TO_OTHER = State("it had lost its link to that command", stands=True)
BY_COMMAND = State("stopped by another command", stands=True, is_meant=True, is_by_other=True)
SCRIPT_OVER = State("its script is over, or its button was pressed", stands=True, is_meant=True)
BY_BUTTON = State("its button was pressed", stands=True, is_meant=True)
BY_UNHEARD = State(
    "it obeyed another operator or terminal whose words were not heard here",
    stands=True,
    is_meant=True,
    is_by_other=True,
)


def of_taken(command: Heard, then: State | None = None) -> State:
    """A robot that was taken over by another operator, and why it stands by now, if that is known.

    One of which it is not may wait for the instant of his start.
    """
    words = f"taken over by another operator or terminal ({command.words})"
    if not then:
        return State(f"was {words}", f"was {words}", is_taken=True)
    became = LINK_LOST_TO_OTHER if then is LINK_LOST else then
    return State(f"{words}, then {became.words}", stands=True, is_taken=True)


class Held:
    """Robots that were started together.

    One that obeys another operator's start since is that operator's: it is held from here no more.
    """

    def __init__(self, fleet: Fleet, begun: Start):
        """Takes all of them that have signed that they start, or drive and have not refused it.

        Of who was told by old news alone nobody knows that it drives.
        """
        self._fleet = fleet
        known = [fleet.robots[a.robot_id] for a in begun.answers if a.robot_id in fleet.robots]
        signed = {a.robot_id: bool(a.accepted) for a in begun.answers if a.signed}
        linked = [r for r in known if r.link]
        moving = {r.robot_id: r.last_mode != "stopped" and not r.is_old_news for r in linked}
        self.robots = [r for r in linked if signed.get(r.robot_id, moving[r.robot_id])]
        self._sessions = {
            r.robot_id: begun.sessions.get(r.robot_id, r.link.session) for r in self.robots
        }
        # Mode in which a robot drove last, and by which command: session and counter.
        self._drove: dict[int, tuple[int, int, int]] = {}
        self._told = dict.fromkeys(self._sessions, DRIVES)
        self._seen = dict.fromkeys(self._sessions, (DRIVES, 0.0))  # and since when
        self._begin_s = time.monotonic()

    def _state(self, robot: Robot) -> State:
        """By its newest link, which what it says unsigned may only contradict."""
        link = robot.link
        if robot.is_double:
            self._forget(robot)
            return DOUBLE
        if robot.signs_only_old_news:
            return OLD_NEWS
        if time.monotonic() - robot.link_s > SILENT_S:
            return UNSIGNED if robot.is_here else SILENT
        if robot.link_s < self._begin_s:
            return self._told[robot.robot_id]
        taken = self._taken(robot)
        is_anew = link.session != self._sessions[robot.robot_id]
        if taken and link.mode == TELEMETRY.MODE_FAULT:
            return of_taken(taken)
        if link.mode == TELEMETRY.MODE_FAULT:
            what = ", ".join(robot.alarms) or OF_A_PART
            return State(
                f"has a fault: {what}; it may drive again once that is over",
                f"had a fault: {what}",
            )
        if link.mode != TELEMETRY.MODE_STOPPED:
            self._drove[robot.robot_id] = (link.mode, link.session, link.counter)
            if taken:
                return of_taken(taken)
            return DRIVES_ANEW if is_anew else self._drives(robot)
        if robot.mode in ("running", "script"):
            return self._told[robot.robot_id]
        if robot.awaits_start:
            return of_taken(taken) if taken else self._waits(robot)
        if not (link.stands and robot.stands) or link.status_flags & MAY_MOVE:
            return UNCONFIRMED
        if is_anew and not taken:
            return RESTARTED
        why, told = self._why_it_stands(robot), self._told[robot.robot_id]
        others = self._others(robot)
        if not why and told.stands and not (others and others[0].starts):
            return told
        return of_taken(taken, why) if taken else why or self._of_told_since(robot, others)

    def _forget(self, robot: Robot) -> None:
        """Nobody knows which of two of one number did what: it is as if one had begun just now."""
        self._drove.pop(robot.robot_id, None)
        self._sessions[robot.robot_id] = robot.link.session

    def _why_it_stands(self, robot: Robot) -> State | None:
        """As its signed words tell; None: they tell no more, as of one that was armed since.

        A command that it obeyed after it drove last lets it forget a stop.
        """
        link = robot.link
        if link.status_flags & TELEMETRY.STATUS_LINK_LOST:
            return LINK_LOST
        if link.status_flags & TELEMETRY.STATUS_LATCHED:
            return BY_COMMAND
        mode, *by = self._drove.get(robot.robot_id, (None,))
        if by != [link.session, link.counter]:
            return None
        return SCRIPT_OVER if mode == TELEMETRY.MODE_SCRIPT else BY_BUTTON

    def _waits(self, robot: Robot) -> State:
        """Who has not driven yet waits for the start from here."""
        return AWAITS if robot.robot_id in self._drove else WAITS

    def _of_told_since(self, robot: Robot, others: list[Heard]) -> State:
        """Who stands, and has obeyed another operator since it drove, or has not driven yet."""
        if robot.robot_id not in self._drove:
            return WAITS
        if not others:
            return BY_UNHEARD
        return replace(BY_UNHEARD, words=f"another operator or terminal said {others[0].words}")

    def _taken(self, robot: Robot) -> Heard | None:
        """The start of another operator that it obeyed last."""
        return next((c for c in self._others(robot) if c.starts), None)

    def _drives(self, robot: Robot) -> State:
        """As was told from here, or as another operator told it."""
        link, others = robot.link, self._others(robot)
        if others and not self._is_overridden(robot, others[0]):
            return State(
                f"drives: another operator or terminal said {others[0].words}", is_meant=True
            )
        known = max([self._fleet.counter, *(c.counter for c in robot.commands.values())])
        is_own = link.session == self._sessions[robot.robot_id]
        return DRIVES_AS_UNHEARD if is_own and link.counter > known else DRIVES

    @staticmethod
    def _is_overridden(robot: Robot, command: Heard) -> bool:
        """Another behaviour was selected before the instant of a start that selects one itself."""
        is_select = command.verb == turbopi.swarm_command_t.VERB_SELECT
        return is_select and bool(robot.run) and robot.run.behavior != command.behavior

    def _others(self, robot: Robot) -> list[Heard]:
        return self._fleet.others(robot, self._sessions[robot.robot_id])

    def news(self) -> list[str]:
        """A sentence of each robot that has for a while been in another state than was told."""
        said, now_s = [], time.monotonic()
        for robot in self.robots:
            if robot.link and self._taken(robot):
                self._fleet.held.discard(robot.robot_id)
            state, (before, since_s) = self._state(robot), self._seen[robot.robot_id]
            if state != before:
                self._seen[robot.robot_id] = state, now_s
            elif state != self._told[robot.robot_id] and now_s - since_s >= SETTLE_S:
                self._told[robot.robot_id] = state
                said.append(f"{state.told_of(f'R{robot.robot_id:02d}')}.")
        return said

    @property
    def states(self) -> dict[str, State]:
        """Last state of each robot, by name."""
        return {f"R{i:02d}": state for i, state in self._told.items()}

    def settle(self) -> None:
        """Before a stop: who stands by now does so for a reason of its own, told or not."""
        for robot in self.robots:
            state = self._state(robot)
            if state.stands:
                self._told[robot.robot_id] = state

    def ends(self) -> dict[str, State]:
        """After a stop: `states`, but for those that the stop reached when they stood already.

        Not of a number that two robots have: nobody knows which of them was so.
        """
        known = [robot for robot in self.robots if not robot.is_double]
        return {f"R{robot.robot_id:02d}": self._end(robot) for robot in known}

    def _end(self, robot: Robot) -> State:
        told = self._told[robot.robot_id]
        if told.stands or told.is_taken or robot.is_old_news:
            return told
        if robot.link.session != self._sessions[robot.robot_id]:
            return RESTARTED if told is not DRIVES_ANEW else told
        return LINK_LOST if robot.lost_link else told

    @property
    def is_over(self) -> bool:
        """All stand, as was told and as they sign now."""
        return all(self._told[r.robot_id].stands and self._state(r).stands for r in self.robots)
