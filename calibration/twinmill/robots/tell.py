# SPDX-License-Identifier: Apache-2.0
"""Commands that are repeated until acknowledged: any one packet may be lost, either way.

A stop is said unsigned, so that anybody can, and holds until robots are armed. All else carries the
operator's signature for each robot and its session. Who is believed what: firmware/RADIO.md.
"""

import math
import secrets
import socket
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import turbopi

from twinmill.arguments import option
from twinmill.foreign_text import plain_line
from twinmill.robots.countdown import (
    NONE_BEGUN,
    NOT_BEGUN,
    NOT_HEARD_SINCE,
    Dropouts,
    find_dropouts,
    stopped_by_another,
)
from twinmill.robots.fleet import (
    ALL,
    ASK,
    DRIVING,
    GONE_S,
    LINK_TIMEOUT_MS,
    MODES,
    NO_MORE,
    TELEMETRY,
    Fleet,
    Robot,
)

REPEAT_S = 0.03
FIND_S = 1.0  # robots that speak 30 times a second are found, though half of it is lost
# Before the common instant: time to call a start off that not all have acknowledged.
CALL_OFF_S = 0.3
OTHERS_S = 0.3  # in which who was not asked is heard: robots speak 10 times a second or more
BEGUN_S = 0.5  # after the instant: all that start have said that they drive
ASK_S = 3.0  # robots answer to no word that takes longer
CLOCK_WARN_S = 0.05  # a clock, or a network, that is off by less is as it should be
LATE_S = 2.0  # the same where nobody goes on watching; as late a start robots still obey
ARM_S = 5.0  # in which a robot that is there has answered, whatever is lost
AHEAD_S = 600.0  # robots obey no start that is further ahead by their clocks
TELL_S = 0.3  # most robots have signed by then; a person waits in silence no longer
STOP_S = 10.0  # a stop that is not confirmed is said for so long
STOP_LEAST_S = 1.0  # a stop is said for so long at least, for robots not heard of yet
VERBS = turbopi.swarm_command_t
SIGNED_VERBS = turbopi.signed_command_t
STARTS = (VERBS.VERB_START, VERBS.VERB_SCRIPT)
STANDING = ("stopped", "fault")
# Of looking a name up: nobody knows whether there is a machine of it.
UNASKED = (socket.EAI_AGAIN, socket.EAI_FAIL)
NEVER_HEARD = "was not heard by this command"
OLD_ANSWER = "no answer, and what is heard of it is old news"
# It signs, and by its key: the packet with the signature was lost, or is late.
UNSEALED = "answered, and its signed answer has not come"
NO_KEY = "cannot be checked without the operator's key"
_FLASH = "for lost packets or another key: `twinmill robot flash` brings robots theirs"
NO_SIGNATURE = f"is not heard to sign with this operator's key, {_FLASH}"
SIGNS_NO_MORE = f"is {NO_MORE}, {_FLASH}"


@dataclass(frozen=True)
class Answer:
    """Reply of a robot to a command.

    Attributes:
        accepted: None if it did not answer.
        signed: the answer has the robot's signature; another may be anybody's.
        mode: as it was last heard.
        stands: it has signed that its motor board took zero, and nothing contradicts it; never of a
            number that two robots have, nor of one that is not heard any more.
        is_double: two robots speak as this one.
        alarms: what a person must know of it, loudest first.
        last_heard_s: how long ago it said anything; None if it never did.
        link_timeout_s: of a start that it accepted: how long it drives on without hearing this
            operator, as it has signed since; 0: for ever.
        lost_link: it has signed that it stood because it had lost its operator.
        clock_ahead_s: how far its clock is ahead of this computer's; None if nothing new was heard.
        is_old_news: nothing that is heard of it is of now, or of after the instant of a start that
            is past; it has no mode then, and drives or not.
        signs_no_more: the same, as it signs nothing with this key any more; what is heard is new.
        signs_standing: it signs so just now, be it that it has not confirmed a stop.
        stood_ago_s: how long ago, at most, it signed that it `stands`; None where it does not. Over
            a slow network that is old, and its answer to a stop of now all the same: then neither
            mode nor alarms are called old news.
    """

    robot_id: int
    accepted: bool | None
    signed: bool
    reason: str
    mode: str
    stands: bool
    is_double: bool
    alarms: list[str]
    last_heard_s: float | None = None
    link_timeout_s: float | None = None
    lost_link: bool = False
    clock_ahead_s: float | None = None
    is_old_news: bool = False
    signs_no_more: bool = False
    signs_standing: bool = False
    stood_ago_s: float | None = None

    @property
    def is_driving(self) -> bool:
        """Its telemetry says so."""
        return self.mode in DRIVING

    @property
    def is_silent(self) -> bool:
        """Nobody knows what it does: it was not heard, or not just now, or tells nothing of now."""
        return self.last_heard_s is None or self.last_heard_s > GONE_S or self.tells_nothing

    @property
    def tells_nothing(self) -> bool:
        """It is heard by words alone that are old, or not signed any more."""
        return self.is_old_news or self.signs_no_more

    @property
    def untethered(self) -> bool | None:
        """It drives on for ever without its operator; None where it has not said so."""
        return None if self.link_timeout_s is None else self.link_timeout_s == 0

    def to_json(self) -> dict:
        """As printed."""
        return vars(self) | {"untethered": self.untethered}


@dataclass
class Order:
    """A command and how it is signed.

    Attributes:
        message: swarm_command_t.
        link_timeout_ms: of a start, as in signed_command_t.
        counter: above those of all commands that its robots have obeyed; 0: not known yet.
        sessions: of the robots that it was signed for: a robot that starts anew meanwhile does not
            obey what was meant for the one before.
    """

    message: Any
    link_timeout_ms: int = LINK_TIMEOUT_MS
    counter: int = 0
    sessions: dict[int, int] = field(default_factory=dict)


def make_command(verb: int, behavior: str = "", start_utime_us: int = 0):
    """A command to all robots, stamped now, and not signed yet.

    Its sequence number is random, so that nobody can guess it.

    Args:
        verb: of swarm_command_t, such as START or STOP.
        behavior: lookup table to select, or script to play.
        start_utime_us: when to start, us since the Unix epoch; 0: now.
    """
    command = VERBS()
    command.utime_us = time.time_ns() // 1000
    command.seq = secrets.randbelow(2**31)
    command.robot_id, command.verb = ALL, verb
    command.behavior, command.start_utime_us = behavior, start_utime_us
    return command


def find(fleet: Fleet, robots: set[int]) -> set[int]:
    """The robots asked for, or, without, all that are there.

    Raises:
        ValueError: none is there.
    """
    if robots:
        fleet.listen(FIND_S, lambda: robots <= fleet.here() and all_linked(fleet, robots))
        return robots
    fleet.listen(FIND_S)
    if not fleet.here():
        raise ValueError(f"no robot was heard in {FIND_S:g} s: {why_unheard(fleet)}")
    return fleet.here()


def why_unheard(fleet: Fleet) -> str:
    """Words on what may keep robots from being heard, and what to do."""
    if fleet.fault:
        return f"this computer has no network ({fleet.fault})."
    return fleet.deaf or (
        f"are they switched on and on this network, is {option('lcm_url')} that of their "
        "configuration, with ttl=1 in both (what is said with ttl=0 leaves no computer), and does "
        "the network carry multicast? Where it does not, `twinmill swarm stop` with "
        f"{option('host')} stops a robot by its address."
    )


def ask_clocks(fleet: Fleet, robots: set[int], within_s: float = ASK_S) -> None:
    """Asks robots of which all comes late, or was signed long ago, for an answer.

    By that a network that is late is told from a clock that is behind, and a robot that is there
    from a recording of it. Without the operator's key no answer is believed, and none asked for.

    Args:
        fleet: where they are.
        robots: the robots.
        within_s: no answer is awaited for longer.
    """
    end_s = time.monotonic() + within_s
    while _unasked(fleet, robots) and time.monotonic() < end_s:
        ask_once(fleet, robots)
        fleet.listen(REPEAT_S, lambda: not _unasked(fleet, robots))


def ask_once(fleet: Fleet, robots: set[int]) -> None:
    """As ask_clocks(), and waits for nothing."""
    for robot_id in sorted(_unasked(fleet, robots)):
        command = make_command(ASK)
        command.robot_id = robot_id
        with suppress(OSError):
            fleet.send(command)


def _unasked(fleet: Fleet, robots: set[int]) -> set[int]:
    """Those that are late and have not answered, or old news, or soon will seem to be."""
    here = [fleet.robots[i] for i in robots & fleet.here()] if fleet.has_key else []
    return {
        r.robot_id
        for r in here
        if (r.age_s > CLOCK_WARN_S and not r.has_answered)
        or (r.link and (r.is_old_news or ((a := r.answered_now) and a.is_worn)))
    }


def find_busy(fleet: Fleet, robots: set[int]) -> list[Robot]:
    """Those of some robots that drive already, or may, or wait for a start, or that are held.

    Be it by a word that nobody can check: a robot of another key signs nothing. Who holds them is
    heard by then. To be asked before this program holds any.
    """
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i))]
    fleet.listen(OTHERS_S, lambda: all(robot.hears_operator for robot in known))
    fleet.listen(FIND_S, lambda: all(_is_told_for_whom(r) for r in known))
    return [r for r in known if r.drives_by_any_word or r.may_begin or r.hears_operator]


def _is_told_for_whom(robot: Robot) -> bool:
    """It is known who holds it, or that it needs nobody; or no signature of it can be checked."""
    is_open = robot.link and (robot.drives or robot.awaits_start) and robot.is_tethered is None
    return robot.is_held is not False and not is_open


def hear_doubles(fleet: Fleet, robots: set[int]) -> list[Robot]:
    """Those of some robots that are two of one number. All that speak as them are heard by then."""
    known = [r for i in sorted(robots) if (r := fleet.robots.get(i))]
    fleet.listen(OTHERS_S, lambda: any(robot.is_double for robot in known))
    _hear_copies(fleet, known)
    return [robot for robot in known if robot.is_double]


def _hear_copies(fleet: Fleet, robots: list[Robot]) -> None:
    """Those that are double turn out to be one on two ways, if what a relay repeats was heard."""
    fleet.listen(FIND_S, lambda: not any(robot.is_double for robot in robots))


def all_linked(fleet: Fleet, robots: set[int]) -> bool:
    """All of some robots were heard, and have signed how they may be commanded."""
    return all(i in fleet.robots and fleet.robots[i].link for i in robots)


def tell(
    fleet: Fleet,
    command,
    robots: set[int],
    *,
    until_s: float,
    link_timeout_ms: int = LINK_TIMEOUT_MS,
    enough: Callable[[], object] = lambda: False,
) -> list[Answer]:
    """Repeats one command to some robots until each has answered, or time.monotonic() is until_s.

    Copies carry the same number and counter: a robot that has obeyed acknowledges again.

    Args:
        fleet: where they are.
        command: swarm_command_t; any but a stop is signed.
        robots: whom to tell.
        until_s: when to give up.
        link_timeout_ms: of a start: how long robots drive on without hearing the operator; 0: for
            ever. A robot's configuration has no say in it.
        enough: what else ends it.
    """
    order = Order(command, link_timeout_ms)
    while (waiting := _unanswered(fleet, command, robots)) and time.monotonic() < until_s:
        if enough():
            break
        for robot_id in sorted(waiting):
            _say_signed(fleet, order, robot_id)
        fleet.listen(REPEAT_S, lambda: not _unanswered(fleet, command, robots))
    return answers(fleet, command, robots)


def _say_signed(fleet: Fleet, order: Order, robot_id: int) -> None:
    robot = fleet.robots.get(robot_id)
    if not robot or not robot.link:
        return
    if not order.counter:
        known = [r.link.counter for r in fleet.robots.values() if r.link]
        # Its last link may be older than what was said from here since.
        order.counter = max(time.time_ns() // 1000, *(n + 1 for n in [fleet.counter, *known]))
    session = order.sessions.setdefault(robot_id, robot.link.session)
    if session == robot.link.session:
        fleet.addressed.add(robot_id)
        fleet.send_signed(
            order.message, robot, session, order.counter, link_timeout_ms=order.link_timeout_ms
        )


def arm(fleet: Fleet, robots: set[int], timeout_s: float = ARM_S) -> list[Answer]:
    """Releases robots from the stop that they were told, so that a later start is obeyed.

    They stay at rest until then.
    """
    command = make_command(SIGNED_VERBS.VERB_ARM)
    return tell(fleet, command, robots, until_s=time.monotonic() + timeout_s)


def stop(
    fleet: Fleet,
    robots: set[int],
    timeout_s: float = STOP_S,
    *,
    hosts: "Hosts | None" = None,
    waiting: Callable[[set[int]], None] = lambda _: None,
    driving: Callable[[set[int]], None] = lambda _: None,
    enough: Callable[[], object] = lambda: False,
) -> list[Answer]:
    """Says stop until all robots have signed that they stand.

    By multicast, and to each machine that speaks as one of them: whatever else is wrong on the bus
    or with what is heard there, this goes out. It is said to the end, whatever the fleet's watch
    would raise, and though no network takes it: that may come back. `fleet.reach` tells how far it
    got.

    Args:
        fleet: where they are; robots that it held are held no more.
        robots: whom to stop; empty: all that are, or come to be, there.
        timeout_s: gives up after.
        hosts: machines to be told besides; each has to be heard.
        waiting: told once, soon after stop was first said, which of the robots that were asked or
            heard have not signed; it must not block.
        driving: told of those that are heard to drive though stop is said, each once, be it that
            they begin to by themselves; as `waiting`.
        enough: what else ends it, once it was said.

    Returns:
        What each answered.
    """
    with fleet.unwatched():
        hosts = hosts or Hosts(())
        told = {"waiting": waiting, "driving": driving}
        return _stop(fleet, robots, timeout_s, hosts, **told, enough=enough)


def say_stop(fleet: Fleet, robots: set[int]) -> None:
    """Says stop once to some robots, or to all if these are none; who answers is not asked."""
    command = make_command(VERBS.VERB_STOP)
    for command.robot_id in sorted(robots or {ALL}):
        with suppress(OSError):
            fleet.send(command)


def _stop(
    fleet: Fleet,
    robots: set[int],
    timeout_s: float,
    hosts: "Hosts",
    *,
    waiting: Callable[[set[int]], None],
    driving: Callable[[set[int]], None],
    enough: Callable[[], object],
) -> list[Answer]:
    command, moving = make_command(VERBS.VERB_STOP), Moving(fleet)
    fleet.held -= robots or set(fleet.held)
    fleet.reach_anew()
    begin_s, was_told = time.monotonic(), False

    def open_robots() -> set[int]:
        return {
            i
            for i in robots or set(fleet.robots)
            if not ((robot := fleet.robots.get(i)) and _has_done(fleet, robot, command.seq))
        }

    def stopped() -> bool:
        return bool(robots or fleet.robots) and not open_robots() and not hosts.unheard(fleet)

    while (passed_s := time.monotonic() - begin_s) < timeout_s:
        if stopped() and (robots or reached_s(fleet, passed_s) > STOP_LEAST_S):
            break
        if passed_s > TELL_S and not (was_told or stopped()):
            was_told = True
            waiting(open_robots())
        if new := moving.new(open_robots()):
            driving(new)
        for command.robot_id in sorted(robots or {ALL}):
            with suppress(OSError):
                fleet.send(command)
        hosts.tell(fleet, command, robots)
        fleet.listen(REPEAT_S)
        if enough():
            break
    told = [fleet.robots[i] for i in robots or fleet.robots if i in fleet.robots]
    fleet.listen(OTHERS_S, lambda: all(_says_since(robot, command.seq) for robot in told))
    _hear_copies(fleet, told)
    # Nobody knows which copy a robot answered: one that was switched on since is not late by that.
    ask_clocks(fleet, {robot.robot_id for robot in told}, OTHERS_S)
    return answers(fleet, command, robots or set(fleet.robots))


class Moving:
    """Robots that drive on while stop is said: what stops at once was on its way.

    Args:
        fleet: where they are.
    """

    def __init__(self, fleet: Fleet):
        self._fleet = fleet
        self._since_s: dict[int, float] = {}
        self._told: set[int] = set()

    def new(self, robots: set[int]) -> set[int]:
        """Those of some robots that have been heard to drive for TELL_S, and were not given yet."""
        now_s = time.monotonic()
        known = [r for i in robots if (r := self._fleet.robots.get(i))]
        driving = {r.robot_id for r in known if r.is_here and r.drives_by_any_word}
        self._since_s = {i: self._since_s.get(i, now_s) for i in driving}
        new = {i for i, since_s in self._since_s.items() if now_s - since_s > TELL_S} - self._told
        self._told |= new
        return new


def _has_done(fleet: Fleet, robot: Robot, seq: int) -> bool:
    """Nothing more is to be had of it.

    It has signed that it stands; or says so, where no signature can be checked. One of which no
    signature has come may have another key, or its packets are lost: it is asked to the end.
    """
    if robot.lost:
        return False
    return robot.confirms(seq) or (not fleet.has_key and seq in robot.acks and robot.stands)


def reached_s(fleet: Fleet, passed_s: float) -> float:
    """For how long a stop has left this computer, where it was said for that long."""
    if not fleet.reach.said:
        return passed_s
    begin_s = fleet.reach.begin_s
    return 0.0 if begin_s is None else time.monotonic() - begin_s


def _says_since(robot: Robot, seq: int) -> bool:
    """It has signed how it is since it obeyed; by what it had stood before stands in that."""
    ack = robot.signed_acks.get(seq)
    if not (ack and robot.link):
        return not ack
    return robot.link.session != ack.session or robot.link.session_us > ack.session_us


class Hosts:
    """Machines by name, looked up in threads of their own: a name server may take seconds.

    Args:
        names: or addresses.
    """

    def __init__(self, names: Sequence[str]):
        self._address_of = dict.fromkeys(names, "")
        self._faults: dict[str, str] = {}
        for name in names:
            threading.Thread(target=self._look_up, args=(name,), daemon=True).start()

    def _look_up(self, name: str) -> None:
        try:
            self._address_of[name] = socket.gethostbyname(name)
        except (OSError, UnicodeError) as error:
            is_unknown = not isinstance(error, socket.gaierror) or error.errno not in UNASKED
            self._faults[name] = (
                "there is no machine of that name"
                if is_unknown
                else "no name server answered; give the address instead, as --host 192.168.1.23"
            )

    def tell(self, fleet: Fleet, command, robots: set[int]) -> None:
        """Says a command to them, and to the machines that speak as some robots, or all."""
        asked = [fleet.robots[i] for i in robots or fleet.robots if i in fleet.robots]
        speaking = {host for robot in asked for host in robot.hosts}
        for host in speaking - set(self._address_of.values()):
            with suppress(OSError):  # it shows in what is not answered
                _say_to(fleet, command, robots, host)
        for name, address in self._address_of.items():
            if address:
                self._faults.pop(name, None)
                try:
                    _say_to(fleet, command, robots, address)
                except OSError as error:
                    self._faults[name] = error.strerror or str(error)

    def unheard(self, fleet: Fleet) -> list[str]:
        """Those from which no robot has spoken, and why they were not told, where they were not."""
        heard = {host for robot in fleet.robots.values() for host in robot.hosts}
        unheard = [name for name, address in self._address_of.items() if address not in heard]
        return [
            f"{plain_line(name)} ({self._faults[name]})"
            if name in self._faults
            else plain_line(name)
            for name in unheard
        ]


def _say_to(fleet: Fleet, command, robots: set[int], host: str) -> None:
    for command.robot_id in sorted(robots or {ALL}):
        fleet.send(command, host)


@dataclass(frozen=True)
class Start:
    """Result of a common start.

    Attributes:
        utime_us: the instant.
        answers: of each robot; of a start that was called off, those for which it was.
        sessions: that the start was meant for, by robot; of those that have signed it.
        called_off: nobody was to start, or to drive on.
        stopped: what they answered to the stop where it was called off.
        late: what those answered to a stop that were to drive on by themselves, and were not heard
            to begin: they had accepted, or not answered.
        dropouts: robots for which it was called off; of a partial start that was not, those that
            drive by another's.
        link_timeout_ms: that was sent with it; 0: they drive on without their operator.
        stop_heard: from where a stop came that was not said here, and when; empty: none was heard.
        untold: robots that were asked for and told nothing, as they sign nothing with this key:
            what they do is by somebody else's word.
    """

    utime_us: int
    answers: list[Answer]
    sessions: dict[int, int]
    called_off: bool = False
    stopped: list[Answer] = field(default_factory=list)
    late: list[Answer] = field(default_factory=list)
    dropouts: Dropouts = field(default_factory=Dropouts)
    link_timeout_ms: int = LINK_TIMEOUT_MS
    stop_heard: str = ""
    untold: frozenset[int] = frozenset()

    @property
    def left_alone(self) -> set[int]:
        """Robots of another operator, which a start that was called off did not stop."""
        return {*self.untold, *self.dropouts.taken} if self.called_off else set()

    @property
    def begun_utime_us(self) -> int | None:
        """The instant; None where no robot was to start at it in the end."""
        told = [a for a in self.answers if a.robot_id not in self.untold]
        begin = [a for a in told if a.accepted or (a.accepted is None and a.is_driving)]
        return self.utime_us if begin and not self.called_off else None


def start(
    fleet: Fleet,
    robots: set[int],
    behavior: str,
    *,
    ahead_s: float,
    partial: bool,
    verb: int = VERBS.VERB_START,
    link_timeout_ms: int = LINK_TIMEOUT_MS,
    stopping: Callable[[Fleet, set[int]], list[Answer]] | None = None,
) -> Start:
    """Starts robots at one instant of their clocks; all of them or, unless partial, none.

    Up to the instant a robot may drop out: it starts anew, is not heard any more, is stopped by
    another, be it before it could accept, told something else, or heard as two of its number. Then
    all others are told to stop, and if one does not begin with them, too. Robots that another
    operator is to start instead are left to him, and those alone that were told nothing: they may
    drive for somebody else.

    From the instant on they are held: as long as the fleet listens, they hear that the operator is
    there. Where this raises, as the fleet's watch does, they may drive: who calls it stops them.
    One of a partial start that is to drive on by itself, and is not heard to begin, is stopped: by
    a clock that is behind it would begin when nobody expects it, and where its answer was lost it
    drives, and nobody knows.

    Args:
        fleet: where they are.
        robots: whom to start.
        behavior: to select first, or the script to play; empty: as they are.
        ahead_s: from now to the instant.
        partial: start though some do not answer, refuse, or drop out; not if one is stopped.
        verb: start, or play script.
        link_timeout_ms: as of tell().
        stopping: says stop to robots that are not to start; else stop() does.
    """
    command, stopping = make_command(verb, behavior), stopping or stop
    command.start_utime_us = command.utime_us + int(ahead_s * 1e6)
    instant_s = time.monotonic() + ahead_s
    fleet.held |= robots if link_timeout_ms else set()

    def all_dropouts(*, only_stopped: bool) -> Dropouts:
        told = {"only_stopped": only_stopped, "link_timeout_ms": link_timeout_ms}
        return find_dropouts(fleet, robots, command.seq, **told)

    def dropouts() -> Dropouts:
        return all_dropouts(only_stopped=partial)

    given = tell(
        fleet,
        command,
        robots,
        until_s=instant_s - CALL_OFF_S,
        link_timeout_ms=link_timeout_ms,
        enough=dropouts,
    )
    agreed = partial or all(a.accepted and a.signed for a in given)
    if agreed:
        fleet.listen(instant_s - time.monotonic(), dropouts)
    if dropouts().taken:  # that operator may be about to tell more of them
        fleet.listen(min(OTHERS_S, instant_s - CALL_OFF_S - time.monotonic()))
    out, others, stopped, late = dropouts(), Dropouts(), [], []
    if agreed and not out:
        patience_s = LATE_S if partial and not link_timeout_ms else BEGUN_S
        waiting = _not_begun(fleet, command, given, patience_s)
        waiting |= set() if link_timeout_ms else _unanswering(fleet, command, robots)
        # Those that drive may do so by another's start: their own word tells.
        others = all_dropouts(only_stopped=False).theirs
        waiting -= others.taken
        is_nobodys = others.taken >= {a.robot_id for a in given if a.accepted}
        if others and (is_nobodys or not partial):
            out = others
        elif waiting and not partial:
            why = NOT_BEGUN if len(waiting) < len(given) else NONE_BEGUN
            words = {i: _not_driving(fleet.robots[i], command, why) for i in waiting}
            out = dropouts().beside(words)
        elif waiting and not link_timeout_ms:
            late = stopping(fleet, waiting)
    called_off = bool(out) or not agreed
    fleet.held -= out.taken | others.taken
    if called_off:
        told = (robots & fleet.addressed) - out.taken
        stopped = stopping(fleet, told) if told else []
        out = out.beside(stopped_by_another(fleet, told, command.seq))
    sessions = {
        i: robot.signed_acks[command.seq].session
        for i in robots
        if (robot := fleet.robots.get(i)) and command.seq in robot.signed_acks
    }
    if not called_off:
        fleet.listen(
            OTHERS_S,
            lambda: (
                _all_say_how_long(fleet, command, robots) and _all_say_since(fleet, command, robots)
            ),
        )
    final = [_as_it_stands(a, [*stopped, *late]) for a in answers(fleet, command, robots)]
    if called_off:
        final = [
            _at_call_off(a, now, fleet.robots.get(a.robot_id), command.seq)
            for now, a in zip(final, given, strict=True)
        ]
    begun = (command.start_utime_us, final, sessions, called_off, stopped, late, out or others)
    untold = frozenset(robots - fleet.addressed)
    return Start(*begun, link_timeout_ms, fleet.stop_heard(robots), untold)


def _as_it_stands(answer: Answer, stopped: list[Answer]) -> Answer:
    """Answer to a start of a robot that may have signed since that it stands, as it was told to."""
    still = next((a for a in stopped if a.robot_id == answer.robot_id and a.stands), None)
    now = ("mode", "stands", "stood_ago_s", "signs_standing", "alarms")
    now += ("is_old_news", "signs_no_more")
    return replace(answer, **{name: getattr(still, name) for name in now}) if still else answer


def _at_call_off(then: Answer, now: Answer, robot: Robot | None, seq: int) -> Answer:
    """Answer of a robot when a start was called off, with the reason by all that came since."""
    reason = then.reason if then.signed else now.reason
    if now.signed and not then.signed and robot and seq in robot.took_s:
        reason = late_words(robot.took_s[seq])
    return replace(now, accepted=then.accepted, signed=then.signed, reason=reason)


def late_words(took_s: float) -> str:
    """Words on an answer to a start that came so long after that was said, and what to do."""
    return (
        f"answered too late, after {took_s:.2f} s: the network is late; {in_s_option(took_s)} "
        "leaves time for it"
    )


def in_s_option(took_s: float) -> str:
    """How far ahead a start must be where answers take so long; with room for slower ones."""
    return f"--in-s {math.ceil(2 * (CALL_OFF_S + took_s))}"


def have_confirmed(fleet: Fleet, robots: set[int]) -> bool:
    """All of some robots have signed that they obey a start that was said from here."""
    return all(
        i in fleet.robots
        and any(
            ack.accepted and ack.verb in STARTS and seq in fleet.said
            for seq, ack in fleet.robots[i].signed_acks.items()
        )
        for i in robots
    )


def _not_begun(fleet: Fleet, command, given: list[Answer], patience_s: float) -> set[int]:
    """Waits until those that have accepted drive. Returns those not heard to, or in a fault."""
    accepted = [fleet.robots[a.robot_id] for a in given if a.accepted]

    def waiting() -> set[int]:
        return {
            r.robot_id
            for r in accepted
            if r.last_mode in STANDING or r.is_old_news or not r.says_since(command.start_utime_us)
        }

    fleet.listen(patience_s, lambda: not waiting())
    return waiting()


def _unanswering(fleet: Fleet, command, robots: set[int]) -> set[int]:
    """Those that were told to start, have not answered, and are not heard to drive."""
    linked = [r for i in robots if (r := fleet.robots.get(i)) and r.link]
    return {
        r.robot_id for r in linked if command.seq not in r.signed_acks and not r.says_that_it_drives
    }


def _not_driving(robot: Robot, command, why: str) -> str:
    if not robot.says_since(command.start_utime_us):
        return NOT_HEARD_SINCE
    alarms = "; ".join(robot.alarms)
    return f"{why} ({alarms})" if alarms else why


def answers(fleet: Fleet, command, robots: set[int]) -> list[Answer]:
    """Replies of some robots to a command."""
    return [_answer(fleet, fleet.robots.get(i) or Robot(i), command) for i in sorted(robots)]


def _answer(fleet: Fleet, robot: Robot, command) -> Answer:
    unsigned = NO_SIGNATURE if fleet.has_key else NO_KEY
    signed = robot.signed_acks.get(command.seq)
    if signed and (signed.command_utime_us, signed.verb) != (command.utime_us, command.verb):
        signed = None
    ack = signed or robot.acks.get(command.seq)
    reason = ack.reason if ack else _why_silent(fleet, robot, unsigned)
    if ack and not signed:
        is_known = robot.link or robot.signed_acks
        unsealed = SIGNS_NO_MORE if robot.signs_no_more else UNSEALED
        reason = reason or (unsealed if is_known else unsigned)
    stood_ago_s = _stood_ago_s(fleet, robot, command, signed)
    stands = stood_ago_s is not None
    is_before = _changes(command, signed) and not robot.says_since(command.start_utime_us)
    is_unknown = (robot.is_old_news or is_before) and not stands
    signs_no_more = is_unknown and robot.signs_no_more
    mode = MODES[TELEMETRY.MODE_STOPPED] if stands else robot.last_mode
    return Answer(
        robot_id=robot.robot_id,
        accepted=bool(ack.accepted) if ack else None,
        signed=signed is not None,
        reason=reason,
        mode="" if is_unknown else mode,
        stands=stands,
        is_double=robot.is_double,
        alarms=robot.last_alarms if stands else robot.alarms,
        last_heard_s=time.monotonic() - robot.heard_s if robot.heard_s else None,
        link_timeout_s=_link_timeout_s(robot, signed) if command.verb in STARTS else None,
        lost_link=robot.lost_link,
        clock_ahead_s=robot.clock_s if robot.recent and not robot.is_old_news else None,
        is_old_news=is_unknown and not signs_no_more,
        signs_no_more=signs_no_more,
        signs_standing=robot.signs_that_it_stands and (stands or not is_before),
        stood_ago_s=stood_ago_s,
    )


def _all_say_since(fleet: Fleet, command, robots: set[int]) -> bool:
    """Those that are there tell how they are since the instant of a start."""
    known = [fleet.robots[i] for i in robots & fleet.here()]
    return all(robot.says_since(command.start_utime_us) for robot in known)


def _all_say_how_long(fleet: Fleet, command, robots: set[int]) -> bool:
    """Those that accepted a start have signed for how long they need no operator."""
    given = answers(fleet, command, robots)
    return all(a.link_timeout_s is not None for a in given if a.accepted and a.signed)


def _link_timeout_s(robot: Robot, ack) -> float | None:
    """In force since a start, as the robot's newest link says that was signed later."""
    link = robot.link
    if not (ack and ack.accepted and link and link.session == ack.session):
        return None
    return link.link_timeout_ms / 1e3 if link.session_us > ack.session_us else None


def _changes(command, signed) -> bool:
    """The instant of a start is past by this computer's clock: the robot may have begun since.

    Args:
        command: the start; another changes nothing later.
        signed: the robot's signed answer, if any; whoever has refused is then as it was before.
    """
    is_due = command.verb in STARTS and time.time_ns() >= 1000 * command.start_utime_us
    return is_due and not (signed and not signed.accepted)


def _stood_ago_s(fleet: Fleet, robot: Robot, command, signed) -> float | None:
    """How long ago, at most, it confirmed this stop; or signed that it stands, of another command.

    None where it did not.
    """
    if command.verb != VERBS.VERB_STOP:
        is_now = not _changes(command, signed) or robot.signs_since(command.start_utime_us)
        return robot.signed_ago_s if robot.signs_that_it_stands and is_now else None
    if robot.is_double:
        return None
    return robot.confirmed_ago_s(command.seq, fleet.said.get(command.seq, -math.inf))


def _why_silent(fleet: Fleet, robot: Robot, unsigned: str) -> str:
    if not robot.heard_s:
        return NEVER_HEARD
    if not (robot.link or robot.signed_acks):
        return unsigned
    if robot.signs_no_more:
        return SIGNS_NO_MORE
    if robot.is_old_news:
        return OLD_ANSWER
    kept = f"; by ttl=0 in {option('lcm_url')} nothing left this computer"
    return f"no answer{kept if fleet.stays_here else ''}"


def _unanswered(fleet: Fleet, command, robots: set[int]) -> set[int]:
    return {i for i in robots if not (i in fleet.robots and _is_done(fleet.robots[i], command))}


def _is_done(robot: Robot, command) -> bool:
    """It has answered; without its signature, an answer may be anybody's."""
    return command.seq in robot.signed_acks if robot.link else _is_known(robot)


def _is_known(robot: Robot) -> bool:
    """It was heard for long enough to have signed something, had it the key."""
    return bool(robot.recent) and time.monotonic() - robot.first_s > FIND_S
