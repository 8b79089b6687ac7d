# SPDX-License-Identifier: Apache-2.0
"""Commands that are repeated until acknowledged: any one packet may be lost, either way."""

import time
from dataclasses import dataclass

import turbopi

from twinmill.robots.fleet import Fleet

REPEAT_S = 0.03
ALL = -1
FIND_S = 1.0  # robots that speak 30 times a second are found, though half of it is lost
# Before the common instant: time to call a start off that not all have acknowledged.
CALL_OFF_S = 0.3
STOP_LEAST_S = 1.0  # a stop is said for so long at least, for robots not heard of yet
VERBS = turbopi.swarm_command_t


@dataclass(frozen=True)
class Answer:
    """What a robot answered: accepted is None if it did not."""

    robot_id: int
    accepted: bool | None
    reason: str
    mode: str

    def to_json(self) -> dict:
        """As printed."""
        return vars(self)


def make_command(verb: int, behavior: str = "", start_utime_us: int = 0):
    """A command of this instant to all robots.

    Its number comes from the clock, so that two operators do not use the same one.
    """
    command = VERBS()
    command.utime_us = time.time_ns() // 1000
    command.seq = command.utime_us // 1000 % 2**31
    command.robot_id, command.verb = ALL, verb
    command.behavior, command.start_utime_us = behavior, start_utime_us
    return command


def find(fleet: Fleet, robots: set[int]) -> set[int]:
    """The robots asked for, or, without, all that are there.

    Raises:
        ValueError: none is there.
    """
    if robots:
        fleet.listen(FIND_S, lambda: robots <= fleet.here())
        return robots
    fleet.listen(FIND_S)
    if not fleet.here():
        raise ValueError(
            f"no robot was heard in {FIND_S:g} s; are they switched on and on this network, and is "
            "--lcm-url that of their configuration?"
        )
    return fleet.here()


def tell(fleet: Fleet, command, robots: set[int], until_s: float) -> list[Answer]:
    """Repeats one command to some robots until each has answered, or time.monotonic() is until_s.

    Copies carry the same utime_us and seq: a robot that has obeyed acknowledges again.
    """
    while (waiting := _unanswered(fleet, command, robots)) and time.monotonic() < until_s:
        _say(fleet, command, waiting)
        fleet.listen(REPEAT_S, lambda: not _unanswered(fleet, command, robots))
    return answers(fleet, command, robots)


def stop(fleet: Fleet, robots: set[int], timeout_s: float = 10.0) -> list[Answer]:
    """Says stop until all robots have acknowledged it and say that they stand.

    Args:
        fleet: where they are.
        robots: whom to stop; empty: all that are, or come to be, there.
        timeout_s: gives up after.

    Returns:
        What each answered.
    """
    command = make_command(VERBS.VERB_STOP)
    begin_s = time.monotonic()

    def stopped() -> bool:
        asked = robots or set(fleet.robots)
        return bool(asked) and all(
            (robot := fleet.robots.get(i)) and command.seq in robot.acks and stands(robot)
            for i in asked
        )

    while (passed_s := time.monotonic() - begin_s) < timeout_s:
        if stopped() and (robots or passed_s > STOP_LEAST_S):
            break
        _say(fleet, command, robots or {ALL})
        fleet.listen(REPEAT_S)
    return answers(fleet, command, robots or set(fleet.robots))


def stands(robot) -> bool:
    """Its newest telemetry says so; a robot that never sent any is believed its acknowledgement."""
    return robot.mode in ("", "stopped")


@dataclass(frozen=True)
class Start:
    """What became of a common start.

    Attributes:
        utime_us: the instant.
        answers: of each robot.
        called_off: not all had acknowledged in time, and all were stopped.
    """

    utime_us: int
    answers: list[Answer]
    called_off: bool


def start(
    fleet: Fleet,
    robots: set[int],
    behavior: str,
    ahead_s: float,
    partial: bool,
    verb: int = VERBS.VERB_START,
) -> Start:
    """Starts robots at one instant of their clocks; all of them or, unless partial, none.

    Args:
        fleet: where they are.
        robots: whom to start.
        behavior: to select first, or the script to play; empty: as they are.
        ahead_s: from now to the instant.
        partial: start though some do not answer or refuse.
        verb: start, or play script.
    """
    command = make_command(verb, behavior)
    command.start_utime_us = command.utime_us + int(ahead_s * 1e6)
    instant_s = time.monotonic() + ahead_s
    try:
        given = tell(fleet, command, robots, instant_s - CALL_OFF_S)
        called_off = not partial and not all(a.accepted for a in given)
        if called_off:
            stop(fleet, robots)
        else:
            fleet.listen(instant_s - time.monotonic())
            accepted = [fleet.robots[a.robot_id] for a in given if a.accepted]
            fleet.listen(0.5, lambda: not any(map(stands, accepted)))
    except BaseException:
        stop(fleet, robots)
        raise
    return Start(command.start_utime_us, answers(fleet, command, robots), called_off)


def answers(fleet: Fleet, command, robots: set[int]) -> list[Answer]:
    """What each of some robots answered to a command."""
    made = []
    for robot_id in sorted(robots):
        robot = fleet.robots.get(robot_id)
        ack = robot.acks.get(command.seq) if robot else None
        made.append(
            Answer(
                robot_id,
                bool(ack.accepted) if ack else None,
                ack.reason if ack else "no answer",
                robot.mode if robot else "",
            )
        )
    return made


def _unanswered(fleet: Fleet, command, robots: set[int]) -> set[int]:
    return {i for i in robots if i not in fleet.robots or command.seq not in fleet.robots[i].acks}


def _say(fleet: Fleet, command, robots: set[int]) -> None:
    for command.robot_id in sorted(robots):
        fleet.send(command)
