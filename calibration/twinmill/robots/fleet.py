# SPDX-License-Identifier: Apache-2.0
"""Words of robots on the LCM bus, and the one channel on which they are told."""

import math
import re
import secrets
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, NamedTuple

import turbopi

from twinmill.arguments import option
from twinmill.data.bus import Address, Reach, Senders, open_bus, why_no_socket
from twinmill.defaults import URL
from twinmill.foreign_text import LINE_MAX, NAME_MAX, plain_line
from twinmill.robots import key as keys

BACKLOG_S = 0.02  # what waits is taken in for so long at once
CLOCKS_PART = 1e-3  # two clocks that nobody sets, while NTP makes each 500 ppm faster or slower
WINDOW_S = 2.0  # over which rates and detections are told
RUN_PERIOD_S = 5.5  # robots say who they are every 5 s
SIGNED_S = 2.0  # robots sign ten times a second; half of all lost, so many in a row are not
GONE_S = 1.0  # a robot that said nothing for so long is not there; it speaks 30 times a second
ALL, ROBOTS_MAX = -1, 100  # in swarm_command_t, robot_id is one of 0..99, or all
MODES = ("stopped", "running", "script", "fault")
DRIVING = ("running", "script")
TELEMETRY = turbopi.telemetry_t
NO_MORE = "not heard to sign with this operator's key any more"
DRY_RUN = "dry run: its motor board is not opened"
# What keeps a robot from doing what it is told, or hides it, loudest first.
ALARMS = (
    (TELEMETRY.STATUS_STOP_UNCONFIRMED, "STOP NOT CONFIRMED: WHEELS MAY TURN"),
    (TELEMETRY.STATUS_BOARD_LOST, "BOARD LOST"),
    (TELEMETRY.STATUS_DOUBLE, "HEARS ANOTHER ROBOT OF ITS NUMBER"),
    (TELEMETRY.STATUS_UNGUARDED, "unguarded: its watching process is gone"),
    (TELEMETRY.STATUS_DRY_RUN, DRY_RUN),
    (TELEMETRY.STATUS_LINK_LOST, "lost its operator"),
    (TELEMETRY.STATUS_CAMERA_LOST, "camera lost"),
    (TELEMETRY.STATUS_FRAME_STALE, "no new picture from the camera"),
    (TELEMETRY.STATUS_BATTERY_LOW, "battery low"),
    (TELEMETRY.STATUS_LOG_LOST, "rows of a log lost"),
    (TELEMETRY.STATUS_LATCH_LOST, "forgets a stop if started anew: run_dir cannot be written"),
)
# A fault for which there is no flag: a button, lights or battery that cannot be read.
OF_A_PART = "a part does not answer"
AWAITS_START = "waits for a start and begins by itself"
HIDES_START = "may wait for a start and begin by itself: its version cannot say"
# A robot with one of these may be moving, or is about to, whatever it was told.
MAY_MOVE = (
    TELEMETRY.STATUS_BOARD_LOST | TELEMETRY.STATUS_STOP_UNCONFIRMED | TELEMETRY.STATUS_AWAITS_START
)
# Fields of text, which may be anybody's: most of these messages are not signed.
TEXTS = {"source": NAME_MAX, "version": NAME_MAX, "behavior": NAME_MAX, "reason": LINE_MAX}
SIGNED_COMMANDS, PLAIN_COMMANDS = "SWARM_SIGNED", "SWARM_COMMAND"
# A verb that no robot knows: each refuses it, and the answer tells how long words take.
ASK = 127
COMMANDS = {
    turbopi.swarm_command_t.VERB_START: "start",
    turbopi.swarm_command_t.VERB_SELECT: "select",
    turbopi.swarm_command_t.VERB_SCRIPT: "play",
    turbopi.signed_command_t.VERB_ARM: "arm",
}
FRESH_US = 3_000_000  # FW_COMMAND_FRESH_US: robots obey no older word
# How long robots drive on without their operator unless he says otherwise; firmware's default, too.
LINK_TIMEOUT_MS = 2000
HOLD_S = 0.1  # so often robots that were started hear that the operator is there
# What waits after this program was halted is taken in for so long at most: a flood has no end.
CATCH_UP_S = 1.0
# Then for so long: each robot signs, and whoever holds it says so, three times in it.
LOOK_ROUND_S = 0.3


class Step(NamedTuple):
    """One message of telemetry.

    Attributes:
        heard_s, heard_utime_s: when it was taken in, by time.monotonic() and time.time().
        telemetry: telemetry_t.
        waited_s: for so long at most it had waited here, as while this program was halted.
        host: address of the machine that sent it; empty where the bus cannot tell.
    """

    heard_s: float
    heard_utime_s: float
    telemetry: Any
    waited_s: float = 0.0
    host: str = ""

    @property
    def age_s(self) -> float:
        """How old it was when it came, by both clocks; not that it had waited here."""
        return self.heard_utime_s - self.waited_s - self.telemetry.utime_us / 1e6


@dataclass(frozen=True)
class Answered:
    """Bounds on a robot's clock by the quickest answer to a word from here.

    Attributes:
        session: of the robot.
        most_s: its session's clock is ahead of time.monotonic() by so much at most: as if its
            answer had been made when the word was said.
        heard_s: when it was heard, by time.monotonic().
    """

    session: int
    most_s: float
    heard_s: float

    @property
    def most_now_s(self) -> float:
        """By so much at most now."""
        return self.most_s + self._worn_s

    @property
    def is_worn(self) -> bool:
        """Another is to be had before this one makes old news of what is new."""
        return self._worn_s > SIGNED_S / 4

    @property
    def _worn_s(self) -> float:
        return CLOCKS_PART * (time.monotonic() - self.heard_s)


@dataclass(frozen=True)
class Heard:
    """A command that an operator was heard to sign.

    Attributes:
        seq, verb, session, counter: as in swarm_command_t and signed_command_t.
        words: the command as a person would write it, and when it was said, by its sender's clock:
            a computer that slept hears it late.
        behavior: that it names.
        start_utime_us: instant of a start, us since the Unix epoch, by its sender's clock.
    """

    seq: int
    verb: int
    session: int
    counter: int
    words: str
    behavior: str = ""
    start_utime_us: int = 0

    @property
    def starts(self) -> bool:
        """It makes a robot drive."""
        command = turbopi.swarm_command_t
        return self.verb in (command.VERB_START, command.VERB_SCRIPT)


@dataclass
class Robot:
    """Last words of one robot.

    What it signed, or said, too long ago is old news (`is_old_news`), and tells nothing of now:
    no mode, that it drives, is armed or held, who commands it, nor an alarm. Nor does what it said
    before it fell silent (`tells_of_now`): then it may do what it was about to (`may_drive`).

    Attributes:
        telemetry, run: its newest messages.
        runs: programs that said what they are, by what that was: "robot" or "twin".
        first_s, heard_s: when it said anything first and last, by time.monotonic().
        recent: telemetry of the last WINDOW_S.
        senders: of its telemetry.
        acks, signed_acks: by number of the command; the latter with the robot's signature.
        link, link_s: its newest link_t with its signature, and when that was heard.
        signed_s: when anything with its signature was heard last, be it a copy of older words.
        answered: its quickest answer.
        took_s: from a command's first word to its first signed answer here, by its number.
        hold_s: when an operator was heard last, or said from here, that somebody is there.
        other_hold_s: when another operator was.
        commands: that operators were heard to sign for it, by their counters.
        speakers: what is last known of each that speaks as it, as of a robot of its own; by its
            session, or by its address where it signs nothing.
        sessions: that were signed last, by the address from which.
        peers: all that are heard, by number: a program may go on as another of them.
        addresses: from which a speaker spoke.
    """

    robot_id: int
    telemetry: Any = None
    run: Any = None
    runs: dict[str, set[Any]] = field(default_factory=dict)
    first_s: float = field(default_factory=time.monotonic)
    heard_s: float = 0.0
    recent: deque[Step] = field(default_factory=deque)
    senders: Senders = field(default_factory=Senders)
    acks: dict = field(default_factory=dict)
    signed_acks: dict = field(default_factory=dict)
    link: Any = None
    link_s: float = 0.0
    signed_s: float = 0.0
    answered: Answered | None = None
    took_s: dict[int, float] = field(default_factory=dict)
    hold_s: float = 0.0
    other_hold_s: float = -math.inf
    commands: dict[int, Heard] = field(default_factory=dict)
    speakers: dict[int | Address | None, "Robot"] = field(default_factory=dict)
    sessions: dict[Address | None, int] = field(default_factory=dict)
    peers: dict[int, "Robot"] = field(default_factory=dict, repr=False, compare=False)
    addresses: set[Address] = field(default_factory=set)

    @property
    def mode(self) -> str:
        """In words, or empty where nobody knows: before the first telemetry, or not of now."""
        return self.last_mode if self.tells_of_now else ""

    @property
    def last_mode(self) -> str:
        """As its newest telemetry says, however old that is."""
        return _mode_of(self.telemetry) if self.telemetry else ""

    @property
    def source(self) -> str:
        """Its kind by its own word, "robot" or "twin"; both of one number that both have."""
        return ", ".join(sorted(self.runs))

    @property
    def is_twin(self) -> bool:
        """All that speak as it have said that they are no robot."""
        return self.source == "twin" and self.programs <= self.runs["twin"]

    @property
    def twins(self) -> list[str]:
        """Addresses of the machines on which a twin speaks as it, in order."""
        return sorted({program[0] for program in self.runs.get("twin", ()) if program})

    @property
    def is_source_known(self) -> bool:
        """All that speak as it have said what they are."""
        said = set().union(*self.runs.values())
        return bool(said) and self.programs <= said

    @property
    def programs(self) -> set[Address]:
        """Addresses of those that speak as it, or did and may drive unheard."""
        return self.senders.programs.union(self.addresses, *(s.addresses for s in self.lost))

    @property
    def hosts(self) -> list[str]:
        """Machines of its `programs`, in order."""
        return sorted({program[0] for program in self.programs})

    def speaker(self, sender: Address | None, session: int | None = None) -> "Robot":
        """Finds whoever said something as it, or adds that one.

        Args:
            sender: from where that came; None: the bus cannot tell.
            session: in which it was signed; None: it was not, and whoever last signed from there
                said it.
        """
        if session is not None:
            self.sessions[sender] = session
        who = self._who(sender)
        if who not in self.speakers:
            shared = {"first_s": time.monotonic(), "commands": self.commands}
            self.speakers[who] = Robot(self.robot_id, **shared)
            unsigned = [known for known in self.speakers if not isinstance(known, int)]
            if len(unsigned) > ROBOTS_MAX:  # anybody can be many
                del self.speakers[unsigned[0]]
        if sender:
            self.speakers[who].addresses.add(sender)
        return self.speakers[who]

    def _who(self, sender: Any) -> Any:
        """Session that was signed from an address last, or one address of all its program has.

        By now: it may have been known under another one before. Any other name is its own.
        """
        return self.sessions.get(sender, self.senders.program_of(sender))

    def is_anew(self, before: "Robot") -> bool:
        """This speaker is another one, started anew: on its machine, and silent before this began.

        What is signed has its successor only in what is.
        """
        return (
            self.first_s > before.heard_s
            and {*self.hosts} <= {*before.hosts}
            and bool(self.link or not before.link)
            and not self.is_old_news
        )

    @property
    def _known(self) -> list["Robot"]:
        """Each of its speakers once, whatever it was known under."""
        named = {self._who(who): speaker for who, speaker in self.speakers.items()}
        return [self.speakers.get(who, speaker) for who, speaker in named.items()]

    @property
    def lost(self) -> list["Robot"]:
        """Those of several speakers that fell silent and may drive.

        One that was started anew is not lost, be it as a robot of another number.
        """
        known = self._known
        if len(known) < 2:
            return []
        heirs = [s for robot in self.peers.values() for s in robot._known] or known
        alive = [s for s in known if not any(heir.is_anew(s) for heir in heirs)]
        return [s for s in alive if s.may_drive] if len(alive) > 1 else []

    @property
    def is_here(self) -> bool:
        """It said something just now."""
        return time.monotonic() - self.heard_s < GONE_S

    @property
    def tells_of_now(self) -> bool:
        """It said something just now that is new: by nothing else the present is told."""
        return self.is_here and not self.is_old_news

    @property
    def may_drive(self) -> str:
        """Words on one that fell silent as it drove or waited for a start, to go on behind a name.

        Empty where it is heard, or stood when it was heard last; so each of several that speak.
        """
        if lost := self.lost:
            return " and ".join(f"(one{_at(s.hosts)}) {s.may_drive}" for s in lost)
        if self.tells_of_now or self.is_old_news:
            return ""
        heard = f"when it was last heard, at {_time_of_day(1e6 * self._heard_utime_s)}"
        modes = {self.last_mode, _mode_of(self.link) if self.link else ""}
        if modes & {*DRIVING}:
            return f"drove {heard}, and may drive on"
        if "fault" in modes:
            return f"had a fault {heard}, and may drive once that is over"
        if not self._flags & TELEMETRY.STATUS_AWAITS_START:
            return ""
        instant_us = max((c.start_utime_us for c in self._starts), default=0)
        if not instant_us:
            return f"waited for a start {heard}, and may drive by now"
        instant = _time_of_day(instant_us)
        if time.time_ns() < 1000 * instant_us:
            return f"waited for a start at {instant} {heard}, and may begin by itself then"
        return f"may drive since {instant}: it waited for that start {heard}"

    @property
    def _heard_utime_s(self) -> float:
        return time.time() - (time.monotonic() - self.heard_s)

    @property
    def _starts(self) -> list[Heard]:
        """Starts that it has signed to obey in the session of its newest link."""
        known = [c for c in self.commands.values() if c.starts and self.has_obeyed(c)]
        return [c for c in known if self.link and c.session == self.link.session]

    @property
    def says_that_it_drives(self) -> bool:
        """Its telemetry of just now does; not what it had said before it fell silent.

        Of two of one number, that of either; not of one that may be a recording.
        """
        now_s, older = time.monotonic(), self.older_s if self.is_double else ()
        new = [s for s in self.recent if now_s - s.heard_s < GONE_S and s.host not in older]
        said = new if self.is_double else new[-1:]
        return not self.is_old_news and any(_mode_of(s.telemetry) in DRIVING for s in said)

    @property
    def stands(self) -> bool:
        """Its newest telemetry says so, its board obeys, and no start is to come."""
        t = self.telemetry
        return (
            self.last_mode == "stopped"
            and not t.status_flags & MAY_MOVE
            and not any(t.wheel_duty_pct)
        )

    @property
    def signs_that_it_stands(self) -> bool:
        """It has signed just now, by its own stamp, that its board took zero, and awaits no start.

        What else it says, signed or not, may only contradict that.
        """
        link = self.link
        return bool(
            link
            and self.signed_ago_s < SIGNED_S
            and link.stands
            and not link.status_flags & MAY_MOVE
            and self.stands
            and self.is_here
            and self.awaits_start is False
            and not self.is_double
        )

    @property
    def answered_now(self) -> Answered | None:
        """Its quickest answer in the session of its newest link; None: it gave none."""
        link, answered = self.link, self.answered
        return answered if link and answered and link.session == answered.session else None

    @property
    def signed_ago_s(self) -> float:
        """How long ago it signed what is known of it; a recording that is played is no news.

        At most, where it has answered in this session. Else by both clocks: one that is ahead for
        so long that it could hide that leaves it open, as nothing signed does: infinite.
        """
        link, answered, now_s = self.link, self.answered_now, time.monotonic()
        if not link:
            return math.inf
        if answered:
            return now_s + answered.most_now_s - link.session_us / 1e6
        stamped_s = time.time() - link.utime_us / 1e6
        return max(stamped_s, now_s - self.link_s) if stamped_s > -SIGNED_S else math.inf

    @property
    def is_old_news(self) -> bool:
        """When it was last heard, nobody knew that it said so just then: it may drive elsewhere.

        A recording that is played is, and so is what a network brings that late. Of a robot with
        another key its telemetry tells, which may be anybody's.
        """
        if not self.link:
            return self.late_s > SIGNED_S
        silent_s = max(0.0, time.monotonic() - self.heard_s)
        return self.signed_ago_s - silent_s > SIGNED_S

    @property
    def signs_only_old_news(self) -> bool:
        """As `is_old_news`, and not by silence of its signature alone, beside words that are new.

        Something old is heard then: with its signature, or without one.
        """
        comes_signed = self.signed_s > time.monotonic() - SIGNED_S
        return self.is_old_news and (comes_signed or self.late_s > SIGNED_S)

    @property
    def signs_no_more(self) -> bool:
        """Its signature alone is silent, beside words that are new, as of one with a new key."""
        return self.is_old_news and not self.signs_only_old_news

    @property
    def old_news(self) -> str:
        """Words on how old is what is known of it, or why that tells nothing; empty where it does.

        To go on behind its name.
        """
        if not self.is_old_news:
            return ""
        if self.signs_no_more:
            return f"is {NO_MORE}"
        if not self.link:
            return f"by what it said {self.late_s:.0f} s ago, or its clock is behind"
        if self.signed_ago_s == math.inf:
            return "its clock is ahead, and it answers nothing: nobody knows when it said that"
        how = "at most" if self.answered_now else "if its clock is right"
        return f"by what it signed {self.signed_ago_s:.0f} s ago, {how}"

    def take(self, step: Step) -> None:
        """Telemetry came. A speaker that signs is heard by what it signs: all else is anybody's."""
        self.telemetry = step.telemetry
        self.heard_s = self.heard_s if self.link else step.heard_s
        self.recent.append(step)
        while self.recent[0].heard_s < step.heard_s - WINDOW_S:
            self.recent.popleft()

    def says_since(self, utime_us: int) -> bool:
        """Its newest telemetry was said after an instant, us since the Unix epoch.

        By its own clock, which begins a start; or by ours, where its own is behind for sure. Over a
        late network it tells for a while only how it was before.
        """
        return self._is_since(self.telemetry, utime_us)

    def signs_since(self, utime_us: int) -> bool:
        """Its newest link was signed after an instant, as of `says_since`."""
        return self._is_since(self.link, utime_us)

    def _is_since(self, message: Any, utime_us: int) -> bool:
        behind_us = -1e6 * min(0.0, self.clock_s)
        return bool(message) and message.utime_us + behind_us >= utime_us

    def confirms(self, seq: int) -> bool:
        """It has signed that it obeyed this stop, and that its board took zero since.

        What else it says, signed or not, may only contradict that.
        """
        ack = self.signed_acks.get(seq)
        later = self.link if ack and self.link and self.link.session == ack.session else None
        if later and later.session_us <= ack.session_us:
            later = None
        return bool(
            ack
            and ack.accepted
            and (later.stands if later else ack.stands)
            and not (later and (later.status_flags & MAY_MOVE or _may_await(later)))
            and (self.stands or not self.telemetry)
        )

    def confirmed_ago_s(self, seq: int, said_s: float) -> float | None:
        """How long ago, at most, it signed that it stands since this stop; None: it did not.

        Args:
            seq: of the stop, which nobody could answer before it was said.
            said_s: when it was said first, by time.monotonic().
        """
        if not self.confirms(seq):
            return None
        ack, link, answered = self.signed_acks[seq], self.link, self.answered
        now_s = time.monotonic()
        signed = [said.session_us for said in (ack, link) if said and said.session == ack.session]
        bounds_s = [now_s - said_s]
        if answered and answered.session == ack.session:
            bounds_s.append(now_s + answered.most_now_s - max(signed) / 1e6)
        return min(bounds_s)

    def has_obeyed(self, command: Heard) -> bool:
        """It has signed so, to whoever said it or in its link."""
        ack, link = self.signed_acks.get(command.seq), self.link
        is_newest = bool(link) and (link.session, link.counter) == (
            command.session,
            command.counter,
        )
        return is_newest or bool(ack and ack.accepted and ack.session == command.session)

    @property
    def session_us(self) -> int:
        """Now by its clock since its session began, or a little before; it must have a link."""
        return self.link.session_us + round(1e6 * (time.monotonic() - self.link_s))

    @property
    def link_timeout_s(self) -> float | None:
        """How long it goes on without its operator, 0: for ever; None as `is_tethered`.

        By a link that itself tells of the start; one from before tells of no start, or of another.
        """
        link = self.link
        if not (link and self.tells_of_now):
            return None
        awaits = bool(link.status_flags & TELEMETRY.STATUS_AWAITS_START)
        is_older = any(c.counter > link.counter for c in self._starts)
        is_started = awaits or link.mode != TELEMETRY.MODE_STOPPED
        return link.link_timeout_ms / 1e3 if is_started and not is_older else None

    @property
    def is_armed(self) -> bool | None:
        """It may be started; None if it has not signed that."""
        return bool(self.link.armed) if self.link and self.tells_of_now else None

    @property
    def awaits_start(self) -> bool | None:
        """It stands and, as it says, signed or not, begins at the instant of a start to come.

        None: nobody knows, as it fell silent, or its program is older than the word for that.
        """
        if not self.tells_of_now:
            return None
        if self.last_mode in DRIVING:
            return False
        if self._flags & TELEMETRY.STATUS_AWAITS_START:
            return True
        is_sure = self._flags & TELEMETRY.STATUS_TELLS_START or not self.may_await_start
        return False if is_sure else None

    @property
    def hides_start(self) -> bool:
        """It signs, stands, and its version cannot say whether it waits for a start."""
        return bool(self.link) and self.tells_of_now and self.awaits_start is None

    @property
    def may_begin(self) -> bool:
        """It waits for a start, or cannot say so, or fell silent and may drive."""
        return bool(self.awaits_start or self.hides_start or self.may_drive)

    @property
    def may_await_start(self) -> bool:
        """It may have obeyed a start that is to come.

        Not one that has signed that it must be armed first, or obeyed nothing in its session yet.
        """
        return self.is_armed is None or bool(self.link.armed and self.link.counter)

    @property
    def is_tethered(self) -> bool | None:
        """It stops when its operator is lost; None if it was not started or has not signed that."""
        return None if self.link_timeout_s is None else self.link_timeout_s > 0

    @property
    def lost_link(self) -> bool:
        """It stands, as it has signed, because it had lost its operator."""
        link = self.link
        is_lost = bool(link) and bool(link.status_flags & TELEMETRY.STATUS_LINK_LOST)
        return is_lost and not self.is_old_news and link.mode == TELEMETRY.MODE_STOPPED

    @property
    def drives(self) -> bool:
        """It has signed so; one in a fault drives on once that is over."""
        is_moving = bool(self.link) and self.link.mode != TELEMETRY.MODE_STOPPED
        return is_moving and self.tells_of_now

    @property
    def drives_by_any_word(self) -> bool:
        """It has signed so, or says so unsigned, as a robot of another key: anybody may say it.

        What it signs just now rules: what says more unsigned is another that has its number.
        """
        if self.link and self.signed_ago_s < SIGNED_S:
            return self.drives
        return self.drives or self.says_that_it_drives

    @property
    def is_held(self) -> bool | None:
        """An operator is heard who holds it, driving or in the count; None if it needs none."""
        return self.hears_operator if self.is_tethered else None

    @property
    def hears_operator(self) -> bool:
        """Somebody says that he is there for it, be it that it drives or that it is to."""
        return time.monotonic() - self.hold_s < GONE_S and not self.is_old_news

    @property
    def hears_other_operator(self) -> bool:
        """Somebody else says that he is there for it."""
        return time.monotonic() - self.other_hold_s < GONE_S and not self.is_old_news

    @property
    def is_double(self) -> bool:
        """Two robots speak as this one, as is heard here or by one of them, or one of them is lost.

        One that is heard on two ways hears itself.
        """
        return self.is_double_now or bool(self.lost)

    @property
    def is_double_now(self) -> bool:
        """Both speak."""
        flags = self.telemetry.status_flags if self.telemetry and not self.is_old_news else 0
        hears_one = bool(flags & TELEMETRY.STATUS_DOUBLE) and not self.senders.on_two_ways
        return self.senders.are_double or hears_one

    @property
    def alarms(self) -> list[str]:
        """Alarms about it that a person must know, loudest first."""
        if self.is_old_news:
            what = "SIGNS NO MORE" if self.signs_no_more else "OLD NEWS"
            return [*self._double_alarm, f"{what}: {self.old_news}"]
        return self.last_alarms

    @property
    def last_alarms(self) -> list[str]:
        """Alarms by its last words, however old these are."""
        flags = self._flags
        if flags & TELEMETRY.STATUS_CAMERA_LOST:  # which tells that there is no picture
            flags &= ~TELEMETRY.STATUS_FRAME_STALE
        if self.senders.on_two_ways:
            flags &= ~TELEMETRY.STATUS_DOUBLE
        told = self._double_alarm + [words for flag, words in ALARMS if flags & flag]
        if self.last_mode == "fault" and not told:
            told = [OF_A_PART]
        told += [HIDES_START] if self.hides_start else []
        return [*told, AWAITS_START] if self.awaits_start else told

    @property
    def _flags(self) -> int:
        """STATUS_* of its newest words, signed or not."""
        flags = self.telemetry.status_flags if self.telemetry else 0
        return flags | (self.link.status_flags if self.link else 0)

    @property
    def _double_alarm(self) -> list[str]:
        hosts, ways = (", ".join(h) for h in (self.hosts, self.senders.on_two_ways))
        if self.senders.are_double or self.lost:
            return [f"TWO ROBOTS OF THIS NUMBER ({hosts})"]
        return [f"heard on two ways, as over a relay ({ways})"] if ways else []

    @property
    def clock_s(self) -> float:
        """How far its clock is ahead of ours, as far as no delay explains it; NaN before telemetry.

        What it says cannot come before it was said, nor an answer be made before its question: the
        first tells how far its clock is ahead at least, the other at most.
        """
        least_s, most_s = self._clock_least_s, self._clock_most_s
        if not least_s <= 0:
            return least_s
        return most_s if least_s <= most_s < 0 else 0.0

    @property
    def _clock_least_s(self) -> float:
        return max(
            (step.telemetry.utime_us / 1e6 - step.heard_utime_s for step in self.recent),
            default=float("nan"),
        )

    @property
    def _clock_most_s(self) -> float:
        """Infinite where nothing was answered in this session."""
        link, answered = self.link, self.answered_now
        if not (link and answered):
            return math.inf
        set_to_s = (link.utime_us - link.session_us) / 1e6
        return answered.most_now_s + set_to_s - (time.time() - time.monotonic())

    @property
    def age_s(self) -> float:
        """As of the freshest Step of what it says; NaN without any."""
        return min((step.age_s for step in self.recent), default=float("nan"))

    @property
    def older_s(self) -> dict[str, float]:
        """How much older all is that a machine says as it than what another does, by its address.

        Of machines of which that is old news alone: each may play a recording.
        """
        ages_s: dict[str, float] = {}
        for step in self.recent:
            ages_s[step.host] = min(step.age_s, ages_s.get(step.host, math.inf))
        older_s = {host: age_s - self.age_s for host, age_s in ages_s.items()}
        return {host: s for host, s in older_s.items() if s > SIGNED_S}

    def has_newer(self, step: Step) -> bool:
        """Its machine is heard with words that are newer by far: this waited on its way.

        As what a program said before it was started anew, which is no second robot. A recording
        that begins anew is older than its end, of which nothing more is heard.
        """
        age_s, since_s = step.age_s, step.heard_s - LOOK_ROUND_S
        return any(
            s.host == step.host and s.heard_s > since_s and age_s - s.age_s > SIGNED_S
            for s in self.recent
        )

    @property
    def late_s(self) -> float:
        """As `age_s`, less what its clock is behind for sure."""
        return self.age_s + min(self.clock_s, 0.0)

    @property
    def round_trip_s(self) -> float:
        """From a word to the answer, at most; infinite where nothing was answered."""
        return self._clock_most_s - self._clock_least_s

    @property
    def has_answered(self) -> bool:
        """A late network can be told from a clock that is behind."""
        return self.round_trip_s < math.inf

    @property
    def detected_frac(self) -> float:
        """Share of the last seconds' control steps in which it saw a neighbour; NaN without any."""
        if not self.recent:
            return float("nan")
        return sum(step.telemetry.detected != 0 for step in self.recent) / len(self.recent)

    @property
    def camera(self) -> str:
        """In words: lost, no frames, or how many a second."""
        if not self.telemetry:
            return "?"
        if self.telemetry.status_flags & TELEMETRY.STATUS_CAMERA_LOST:
            return "lost"
        if self.telemetry.status_flags & TELEMETRY.STATUS_FRAME_STALE:
            return "no frames"
        frames = {step.telemetry.frame_seq for step in self.recent}
        passed_s = self.recent[-1].heard_s - self.recent[0].heard_s if self.recent else 0
        return f"{(len(frames) - 1) / passed_s:.0f} fps" if passed_s > 0.5 else "works"

    def to_json(self) -> dict:
        """All that is known."""
        t, run = self.telemetry, self.run
        return {
            "robot_id": self.robot_id,
            "source": self.source or None,
            "version": run.version if run else None,
            "behavior": run.behavior if run else None,
            "mode": self.mode or None,
            "may_drive": self.may_drive or None,
            "stands": None if self.hides_start else self.signs_that_it_stands,
            "alarms": self.alarms,
            "hosts": self.hosts,
            "signed": self.link is not None,
            "armed": self.is_armed,
            "awaits_start": self.awaits_start,
            "tethered": self.is_tethered,
            "held": self.is_held,
            "signed_ago_s": self.signed_ago_s if self.link else None,
            "link_timeout_s": self.link_timeout_s,
            "battery_V": t.battery_V if t else None,
            "camera": self.camera,
            "clock_ahead_s": self.clock_s,
            "late_s": self.late_s,
            "last_heard_s": time.monotonic() - self.heard_s,
            "detected": bool(t.detected) if t else None,
            "bits": t.detected if t else None,
            "detected_frac": self.detected_frac,
            "status_flags": t.status_flags if t else None,
        }


def _may_await(link: Any) -> bool:
    """It was told something since it was stopped, and cannot say that it is a start to come."""
    tells = link.status_flags & TELEMETRY.STATUS_TELLS_START
    return not tells and bool(link.armed and link.counter)


def _at(hosts: list[str]) -> str:
    return f" at {', '.join(hosts)}" if hosts else ""


def _mode_of(telemetry: Any) -> str:
    mode = telemetry.mode
    return MODES[mode] if 0 <= mode < len(MODES) else f"unknown mode {mode}"


def _time_of_day(utime_us: float) -> str:
    with suppress(ValueError, OverflowError, OSError):
        return f"{datetime.fromtimestamp(utime_us / 1e6):%H:%M:%S}"
    return f"{datetime.now():%H:%M:%S}"  # no calendar has that time


def _time_passed_s() -> float:
    """A clock that nobody sets, and that goes on while the computer sleeps."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Fleet:
    """All robots of a bus."""

    def __init__(
        self,
        url: str = URL,
        channel_prefix: str = "",
        connect: Callable[[str], Any] = open_bus,
        key: bytes | None = None,
    ):
        """Joins the bus.

        Args:
            url: of the bus.
            channel_prefix: before all channels, the command's too.
            connect: makes something that behaves like lcm.LCM.
            key: the operator's; without it nothing is signed, and no signature believed.

        Raises:
            ValueError: there is no such bus.
        """
        self.robots: dict[int, Robot] = {}
        # Called again and again while listening; what it raises ends that.
        self.watch: Callable[[], None] = lambda: None
        # Robots that shall hear all the time that the operator is there.
        self.held: set[int] = set()
        # When commands were said from here first, by number, and the highest counter of those.
        self.said: dict[int, float] = {}
        self.counter = 0
        # Robots that were told something from here that is signed, as to start.
        self.addressed: set[int] = set()
        # From where stops of others came, and when, by the robot that was told; the newest last.
        self._stops: dict[int, str] = {}
        self.url, self._prefix, self.key, self._hold_s = url, channel_prefix, key, 0.0
        self._deaf = ""
        self._hold_seq = secrets.randbelow(2**31)  # by it what is said from here is known
        self._looked_s = _time_passed_s()
        self._empty_s = time.monotonic()  # nothing waited here then
        try:
            self.bus = connect(url)
            kinds = "TELEMETRY|RUN|ACK|LINK|SIGNED_ACK"
            commands = f"{SIGNED_COMMANDS}|{PLAIN_COMMANDS}"
            channels = f"{re.escape(channel_prefix)}(R[0-9]{{2,3}}_({kinds})|{commands})"
            self.bus.subscribe(channels, self._on_message)
        except RuntimeError as error:
            words = f"{option('lcm_url', url)}: cannot be joined: {error}"
            raise ValueError(words if words.endswith((".", "?")) else f"{words}.") from error

    def close(self) -> None:
        """Leaves the bus; other buses than a UdpBus leave by themselves."""
        if hasattr(self.bus, "close"):
            self.bus.close()

    def hear(self) -> None:
        """Begins to hear where the bus only spoke; `deaf` says why it cannot, if so."""
        try:
            if hasattr(self.bus, "hear"):
                self.bus.hear()
        except OSError as error:
            self._deaf = f"No robot can be heard: {why_no_socket(error, self.bus.group[1])}"

    @property
    def deaf(self) -> str:
        """Sentence on why robots of all networks, or of some, cannot be heard now; else empty."""
        on = getattr(self.bus, "unheard", "")
        return self._deaf or (f"No robot can be heard on {on}." if on else "")

    def _on_message(self, channel: str, data: bytes) -> None:
        name, _, kind = channel.removeprefix(self._prefix).partition("_")
        if channel == self._prefix + SIGNED_COMMANDS:
            self._on_command(data)
            return
        if channel == self._prefix + PLAIN_COMMANDS:
            self._on_plain_command(data)
            return
        try:
            message = getattr(turbopi, f"{kind.lower()}_t").decode(data)
        except (ValueError, struct.error, IndexError):
            return  # another program's type on this channel, or half a message
        for text, most in TEXTS.items():
            if hasattr(message, text):
                setattr(message, text, plain_line(getattr(message, text), most))
        robot_id = int(name[1:])
        robot = self.robots.setdefault(robot_id, Robot(robot_id, peers=self.robots))
        now_s = robot.heard_s = time.monotonic()
        sender = getattr(self.bus, "sender", None)
        if kind == "TELEMETRY" and robot.senders.is_copy(sender, data):
            return
        if kind in ("LINK", "SIGNED_ACK"):
            if self._has_signed(robot, data):
                robot.signed_s = now_s
                for known in (robot, robot.speaker(sender, message.session)):
                    self._on_signed(known, kind, message)
        elif kind == "ACK":
            robot.acks[message.seq] = message
        elif kind == "RUN":
            robot.run = message
            robot.runs.setdefault(message.source, set()).add(sender)
        else:
            waited_s = max(0.0, now_s - self._empty_s)
            host = sender[0] if sender else ""
            step = Step(now_s, time.time(), message, waited_s, host)
            if not robot.has_newer(step):
                robot.senders.add(sender)
            for known in (robot, robot.speaker(sender)):
                known.take(step)

    def _has_signed(self, robot: Robot, data: bytes) -> bool:
        return bool(self.key) and keys.is_signed(keys.of_robot(self.key, robot.robot_id), data)

    def _on_signed(self, robot: Robot, kind: str, message: Any) -> None:
        """Believes what was signed as a robot, or as one speaker; older words are no news."""
        if kind == "SIGNED_ACK":
            robot.signed_acks[message.seq] = message
            self._on_answer(robot, message)
            return
        old = robot.link
        if not old or message.session != old.session or message.session_us > old.session_us:
            if (
                old
                and old.session == message.session
                and robot.session_us < (message.session_us - FRESH_US)
            ):  # what was heard before was a recording; so were the holds that were fresh by it
                robot.hold_s, robot.other_hold_s = 0.0, -math.inf
            robot.link = message
            robot.link_s = robot.heard_s = time.monotonic()
            if robot.answered_now and robot.signed_ago_s < 0:
                robot.answered = None  # this computer slept, and its clock did not go on

    def _on_answer(self, robot: Robot, ack: Any) -> None:
        """Keeps the quickest."""
        if ack.seq not in self.said:
            return
        said_s, now_s = self.said[ack.seq], time.monotonic()
        robot.took_s.setdefault(ack.seq, now_s - said_s)
        found = Answered(ack.session, ack.session_us / 1e6 - said_s, now_s)
        known = robot.answered
        if not known or known.session != ack.session or found.most_s <= known.most_now_s:
            robot.answered = found

    def _on_command(self, data: bytes) -> None:
        """Notes what operators sign: that they hold a robot, or what they tell it."""
        try:
            sealed = turbopi.signed_command_t.decode(data)
            command = turbopi.swarm_command_t.decode(sealed.command)
        except (ValueError, struct.error, IndexError):
            return
        robot = self.robots.get(sealed.robot_id)
        if not (self.key and robot and robot.link and robot.link.session == sealed.session):
            return
        is_fresh = sealed.made_us > robot.session_us - FRESH_US
        if not is_fresh or not keys.is_signed(keys.of_robot(self.key, robot.robot_id), data):
            return
        if command.verb == sealed.VERB_HOLD:
            robot.hold_s = time.monotonic()
            if command.seq != self._hold_seq:
                robot.other_hold_s = robot.hold_s
        elif sealed.counter not in robot.commands:
            behavior = plain_line(command.behavior, NAME_MAX)
            words = f"{COMMANDS.get(command.verb, '?')} {behavior}"
            words = f"{words.strip()} at {_time_of_day(command.utime_us)}"
            robot.commands[sealed.counter] = Heard(
                *(command.seq, command.verb, sealed.session, sealed.counter, words, behavior),
                start_utime_us=command.start_utime_us,
            )

    def _on_plain_command(self, data: bytes) -> None:
        """Notes where a stop comes from, which anybody may say."""
        try:
            command = turbopi.swarm_command_t.decode(data)
        except (ValueError, struct.error, IndexError):
            return
        sender, robot_id = getattr(self.bus, "sender", None), command.robot_id
        is_stop = command.verb == command.VERB_STOP and ALL <= robot_id < ROBOTS_MAX
        if is_stop and command.seq not in self.said and sender:
            self._stops.pop(robot_id, None)
            self._stops[robot_id] = f"{sender[0]} at {datetime.now():%H:%M:%S}"

    def stop_heard(self, robots: set[int]) -> str:
        """From where the newest stop of one of some robots came, and when; empty if none did."""
        heard = [words for i, words in self._stops.items() if i in {ALL, *robots}]
        return heard[-1] if heard else ""

    def others(self, robot: Robot, session: int) -> list[Heard]:
        """Commands of other operators that a robot has obeyed since it was told from here.

        Args:
            robot: it must have a link.
            session: in which it was told; all that it obeyed in a later one came after that.

        Returns:
            The newest first; none by old news: it may have been told anything since.
        """
        if robot.is_old_news:
            return []
        since = self.counter if robot.link.session == session else 0
        heard = sorted(robot.commands.values(), key=lambda c: c.counter, reverse=True)
        return [
            c
            for c in heard
            if c.seq not in self.said
            and c.session == robot.link.session
            and c.counter > since
            and robot.has_obeyed(c)
        ]

    def listen(self, duration_s: float, enough: Callable[[], bool] = lambda: False) -> None:
        """Takes in what robots say for some time, or until that is enough.

        What has come already is taken in before anybody judges what has not; all of it, and what is
        said then, where this program was halted, or the computer slept.
        """
        end_s = time.monotonic() + duration_s
        self._catch_up()
        while not enough() and (left_s := end_s - time.monotonic()) > 0:
            self._take_in(max(1, min(20, int(1000 * left_s))))
            backlog_end_s = time.monotonic() + BACKLOG_S
            while time.monotonic() < backlog_end_s and self._take_in(0):
                pass
            self._catch_up()
            self._hold()
            self.watch()

    def _catch_up(self) -> None:
        """Hears who has the robots by now, where time went on for long and nobody listened here.

        Half of what was said meanwhile tells of robots that lost this operator, and not yet of the
        one who has started them since.
        """
        before_s, self._looked_s = self._looked_s, _time_passed_s()
        if self._looked_s - before_s < GONE_S:
            return
        end_s = time.monotonic() + CATCH_UP_S
        while self._take_in(0) and time.monotonic() < end_s:
            pass
        end_s = time.monotonic() + LOOK_ROUND_S
        while (left_s := end_s - time.monotonic()) > 0:
            self._take_in(max(1, int(1000 * left_s)))
        self._looked_s = _time_passed_s()

    def _take_in(self, timeout_ms: int) -> bool:
        """Waits for a message; False if none came."""
        begin_s = time.monotonic()
        is_one = self.bus.handle_timeout(timeout_ms)
        self._empty_s = self._empty_s if is_one else begin_s
        return is_one

    @contextmanager
    def unwatched(self) -> Iterator[None]:
        """Runs a block to its end: nobody is asked on the way whether to go on."""
        watch, self.watch = self.watch, lambda: None
        try:
            yield
        finally:
            self.watch = watch

    def _hold(self) -> None:
        """Tells the robots that the operator is there, where that is due."""
        if time.monotonic() < self._hold_s:
            return
        self._hold_s = time.monotonic() + HOLD_S
        command = turbopi.swarm_command_t()
        command.verb, command.seq = turbopi.signed_command_t.VERB_HOLD, self._hold_seq
        for robot_id in sorted(self.held):
            robot = self.robots.get(robot_id)
            if robot and robot.link:
                with suppress(OSError):  # the robots notice
                    self.send_signed(command, robot, robot.link.session, 0)
                    robot.hold_s = time.monotonic()

    def send_signed(
        self,
        command: Any,
        robot: Robot,
        session: int,
        counter: int,
        *,
        link_timeout_ms: int = LINK_TIMEOUT_MS,
    ) -> None:
        """Says a command once to one robot that has been heard, with the operator's signature.

        Args:
            command: swarm_command_t.
            robot: for whom it is; it must have a link.
            session: for which of its sessions.
            counter: above that of all commands that it has obeyed; copies have the same.
            link_timeout_ms: of a start, as in signed_command_t.

        Raises:
            OSError: there is no way to.
        """
        sealed = turbopi.signed_command_t()
        sealed.utime_us = time.time_ns() // 1000
        sealed.robot_id = command.robot_id = robot.robot_id
        sealed.session, sealed.counter = session, counter
        sealed.made_us, sealed.link_timeout_ms = robot.session_us, link_timeout_ms
        sealed.command = command.encode()
        sealed.command_size = len(sealed.command)
        sealed.tag = bytes(keys.TAG_BYTES)
        message = keys.sign(keys.of_robot(self.key, robot.robot_id), sealed.encode())
        self.said.setdefault(command.seq, time.monotonic())
        self.counter = max(self.counter, counter)
        self.bus.publish(self._prefix + SIGNED_COMMANDS, message)

    def send(self, command: Any, host: str = "") -> None:
        """Says a swarm_command_t once, to all or to one machine.

        Raises:
            OSError: there is no way to.
        """
        self.said.setdefault(command.seq, time.monotonic())
        channel = self._prefix + PLAIN_COMMANDS
        if not host:
            self.bus.publish(channel, command.encode())
        elif hasattr(self.bus, "tell"):  # other buses know no machines
            self.bus.tell(host, channel, command.encode())

    @property
    def addressed_by(self) -> dict[str, str]:
        """Parts of its address that are not the default, by the names of their options."""
        bus = {"lcm_url": "" if self.url == URL else self.url, "channel_prefix": self._prefix}
        return {name: value for name, value in bus.items() if value}

    @property
    def has_key(self) -> bool:
        """True if signed words of robots can be told from anybody's."""
        return self.key is not None

    @property
    def reach(self) -> Reach:
        """How far that got what was said to all since `reach_anew`; other buses do not tell."""
        return getattr(self.bus, "reach", Reach())

    @property
    def fault(self) -> str:
        """Why nobody outside of this computer can be heard now; empty if somebody may be."""
        return getattr(self.bus, "fault", "")

    @property
    def stays_here(self) -> bool:
        """Packets from here reach programs of this computer alone."""
        return getattr(self.bus, "ttl", 1) == 0

    def reach_anew(self) -> None:
        """From here on."""
        if hasattr(self.bus, "reach"):
            self.bus.reach = Reach()

    def here(self) -> set[int]:
        """Robots that are there now."""
        return {robot.robot_id for robot in self.robots.values() if robot.is_here}
