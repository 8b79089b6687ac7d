# SPDX-License-Identifier: Apache-2.0
"""Outcome of a command to a swarm: sentence, exit code and `ok` follow from one value."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from twinmill.data.bus import Reach
from twinmill.foreign_text import printable
from twinmill.robots.countdown import DOUBLE, NONE_BEGUN, STOPPED
from twinmill.robots.fleet import (
    AWAITS_START,
    DRIVING,
    DRY_RUN,
    HIDES_START,
    SIGNED_S,
    Robot,
)
from twinmill.robots.hold import State
from twinmill.robots.tell import (
    AHEAD_S,
    CLOCK_WARN_S,
    LATE_S,
    NEVER_HEARD,
    NO_KEY,
    STOP_LEAST_S,
    Answer,
    Start,
)
from twinmill_cli import exit_now, several
from twinmill_cli.swarm_signals import BY_KEY, KEYS

BY_HAND = "SWITCH OFF BY HAND what still drives."
BY_ITS_WORD = "by its word, which nobody can check"
UNHEARD = "may drive all the same"
LEFT_ALONE = "was told nothing by this start and is left alone"


@dataclass(frozen=True)
class Verdict:
    """Did it go as it was meant?

    Attributes:
        ok: it did, and exit code and JSON say so.
        sentence: what a person reads of it.
        ends_well: all stand, and nothing is wrong but that, it may be, a signal ended their start.
        standing: names of robots that it says stand, as they have signed: of these nothing else
            may be said.
    """

    ok: bool
    sentence: str
    ends_well: bool = False
    standing: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Names of files and hosts, which a sentence quotes, may be no text."""
        object.__setattr__(self, "sentence", printable(self.sentence))

    @property
    def code(self) -> int:
        """The command's exit code."""
        return 0 if self.ok else 1

    def code_after(self, signals: Sequence[int]) -> int:
        """The exit code where signals came: after a key a shell's loop ends with it.

        Not where something is wrong: the code tells that.
        """
        return exit_now.STOPPED if self.ends_well and KEYS & {*signals} else self.code

    def beside(self, others: list[str], words: str = "drives, and was not asked") -> Verdict:
        """This outcome with a word on robots that were not told to stop, to go on behind names."""
        if not others:
            return self
        return self.of_some().more(f"{', '.join(others)} {several.of(others, words)}.")

    def of_some(self) -> Verdict:
        """This outcome beside another robot that may drive: "All" are those that were told."""
        told = self.sentence.replace("All stand", "All that were told to stop stand", 1)
        return replace(self, sentence=told)

    def behind(self, words: str) -> Verdict:
        """This outcome behind words without which it would be misread; they may be empty."""
        return replace(self, sentence=_joined(words, self.sentence))

    def more(self, words: str) -> Verdict:
        """This outcome with words that change nothing of it; they may be empty."""
        return replace(self, sentence=_joined(self.sentence, words))


NOBODY_TOLD = Verdict(False, "The start was ended before a robot was told of it.", ends_well=True)


@dataclass(frozen=True)
class Saying:
    """How a stop was said.

    Attributes:
        passed_s: for how long.
        reached_s: for how long it left this computer; None: it need not have been said for longer.
        unheard: machines that were told by name, and from which no robot spoke.
        is_cut_short: a signal ended it.
        reach: how far it got.
        key_fault: a sentence on why no robot's signature could be checked; empty: they were.
        to_all: to all that hear it, none by its number.
        is_deaf: this computer could hear no robot of some network, and `key_fault` says why.
    """

    passed_s: float = 10.0
    reached_s: float | None = None
    unheard: Sequence[str] = ()
    is_cut_short: bool = False
    reach: Reach = field(default_factory=Reach)
    key_fault: str = ""
    to_all: bool = False
    is_deaf: bool = False

    @property
    def hint(self) -> str:
        """Advice where a robot was not heard."""
        other = (
            "Robots of another --lcm-url or --channel-prefix hear none of it; what one with ttl=0 "
            "in its lcm_url says leaves it for no other computer."
        )
        if self.is_deaf:
            return other
        if self.unheard:
            names = ", ".join(self.unheard)
            return (
                f"Nothing was heard from {names}: is the name or address right? Robots answer by "
                "multicast alone: where the network carries none, nobody hears that they obeyed. "
                f"{other}"
            )
        return (
            "Where the network carries no multicast, give a robot's address: swarm stop --host; it "
            f"obeys then, but its answer, by multicast, is not heard. {other}"
        )

    @property
    def lost(self) -> str:
        """A sentence on what did not leave this computer; empty where all did."""
        tries, fails = self.reach.said, self.reach.said - self.reach.out
        if not fails:
            return ""
        if not self.reach.out:
            return f"NOTHING LEFT THIS COMPUTER ({self.reach.fault}; tried {tries} times)."
        return f"{fails} of {tries} times it did not leave this computer ({self.reach.fault})."

    @property
    def cut(self) -> str:
        """A sentence on what ended it early; empty where nothing did."""
        return f"Ended by a signal after {self.passed_s:.1f} s." if self.is_cut_short else ""

    @property
    def unanswered(self) -> str:
        """Sentences where no robot was heard at all."""
        heard = f"No robot was heard in {round(self.passed_s, 1):g} s"
        if self.reach.said and not self.reach.out:
            by_hand = "Stop robots by their buttons, or from a computer that has a network."
            return _joined(self.lost, f"{heard}.", by_hand)
        where = f" on {', '.join(sorted(self.reach.networks))}" if self.reach.networks else ""
        time = "" if self.lost else " all the time"
        return _joined(f"{heard}; stop was said{time}{where}.", BY_HAND, self.lost)


def of_stop(given: list[Answer], how: Saying | None = None, *, is_of_some: bool = False) -> Verdict:
    """All stand, or which robots must be stopped by hand.

    Args:
        given: what they answered.
        how: it was said.
        is_of_some: these alone were asked, and others may be there.
    """
    told = _of_stop(given, how or Saying(), is_of_some=is_of_some)
    return replace(told, standing=_standing(given))


def _is_standing(answer: Answer) -> bool:
    """It has confirmed a stop."""
    return bool(answer.accepted and answer.signed and answer.stands and not answer.is_double)


def _standing(given: Iterable[Answer]) -> frozenset[str]:
    return frozenset(_names([a]) for a in given if _is_standing(a))


def _of_stop(given: list[Answer], how: Saying, *, is_of_some: bool) -> Verdict:
    if not given:
        reached = how.reach.out or not how.reach.said
        hint = how.hint if reached or how.unheard else ""
        return Verdict(False, _joined(how.unanswered, how.cut, hint, how.key_fault))
    double = [a for a in given if a.is_double]
    unconfirmed = [a for a in given if not (_is_standing(a) or a.is_double)]
    if not double and not unconfirmed:
        return _of_standing(given, how, is_of_some=is_of_some)
    told = [f"{_names(unconfirmed)}: no stop was confirmed"] if unconfirmed else []
    told += [f"{_names(double)}: two robots have this number, one may drive"] if double else []
    standing = [a for a in unconfirmed if a.signs_standing]
    is_all = len(standing) == len(unconfirmed) and not double
    silent = [a for a in unconfirmed if a.reason == NEVER_HEARD]
    sure = [a for a in given if a not in unconfirmed and a not in double]
    return Verdict(
        False,
        _joined(
            f"NOT ALL {'HAVE CONFIRMED' if is_all else 'STAND'}: {'; '.join(told)}. {BY_HAND}",
            _driving_on([a for a in unconfirmed if a.is_driving and not a.is_silent]),
            _standing_unconfirmed(standing),
            how.key_fault if unconfirmed else "",
            *_reasons(unconfirmed, how),
            _besides(sure),
            how.lost,
            how.cut,
            f"{_names(sure)} confirmed it." if how.cut and sure else "",
            how.hint if silent or how.unheard else "",
        ),
    )


def _driving_on(given: list[Answer]) -> str:
    """Sentence on robots that drive though they were told to stop; may be empty."""
    return f"{_names(given)} {several.of(given, 'drives')}." if given else ""


def _standing_unconfirmed(given: list[Answer]) -> str:
    """Sentence on robots that sign that they stand, and did not obey this stop; may be empty."""
    if not given:
        return ""
    lost = [a for a in given if a.lost_link]
    why = (
        f": {_names(lost)} had lost {'its' if len(lost) == 1 else 'their'} operator" if lost else ""
    )
    words = several.of(given, "signs all the same that it stands")
    other = "this stop may not reach it, and it may be started again"
    return f"{_names(given)} {words}{why}; {several.of(given, other)}."


def _reasons(given: list[Answer], how: Saying) -> list[str]:
    """Sentences on why no stop was confirmed, as by robots that have another key."""
    known = {"", NO_KEY if how.key_fault else ""}
    sentences = []
    for reason in dict.fromkeys(a.reason for a in given if a.reason not in known):
        those = [a for a in given if a.reason == reason]
        words = several.of(those, reason)
        sentences.append(f"{_names(those)}: {words}{'' if words.endswith('?') else '.'}")
    speaking = [a for a in given if not (a.is_silent or a.signs_standing)]
    unsigned = [a for a in speaking if a.mode == "stopped"]
    if unsigned:
        words = several.of(unsigned, "by its word, which nobody can check, it stands")
        sentences.append(f"{_names(unsigned)}: {words}.")
    return sentences


def _of_standing(given: list[Answer], how: Saying, *, is_of_some: bool) -> Verdict:
    """All that answered have confirmed the stop; others may be there."""
    names = f"{_names(given)} {several.of(given, 'stands')}"
    more = _joined(_besides(given), how.lost, how.key_fault if how.is_deaf else "")
    if how.unheard:
        words = f"NOT ALL STAND: {how.hint} {BY_HAND} Whoever was heard stands: {_names(given)}."
        return Verdict(False, _joined(words, more, how.cut))
    too_short = how.reached_s is not None and how.reached_s < STOP_LEAST_S
    if too_short and not is_of_some:
        words = f"{names}; others may not have been heard yet."
        return Verdict(False, _joined(words, more, how.cut))
    heard = of_heard([a.robot_id for a in given]) if how.to_all else ""
    words = f"{names}." if is_of_some else _joined("All stand.", heard)
    return Verdict(True, _joined(words, more))


def of_heard(robots: Iterable[int], old: Iterable[int] = ()) -> str:
    """Sentence on how many were heard, where nobody said how many there are.

    Args:
        robots: that were.
        old: that were by old news alone, which is not to be counted.
    """
    names, of_old = ([f"R{i:02d}" for i in some] for some in (robots, old))
    were = "robot was" if len(names) == 1 else "robots were"
    told = f": {', '.join(names)}" if names else ""
    told += f", and by old news alone {', '.join(of_old)}" if of_old else ""
    return (
        f"{len(names)} {were} heard{told}. If you have more, name all of them, as "
        "--robots 1,2,3: whoever does not answer is named then."
    )


def of_status(robots: Sequence[Robot]) -> Verdict:
    """Who is heard; it went well where somebody is, all of that is new, and of one robot each."""
    if not robots:
        return Verdict(False, "No robot is heard.")
    heard = f"Heard: {', '.join(f'R{r.robot_id:02d}' for r in robots)}."
    old = of_old_news(robots)
    return Verdict(not old and not any(r.is_double for r in robots), _joined(heard, old))


def of_old_news(robots: Iterable[Robot]) -> str:
    """Sentence on robots that are told by old words alone; empty if none is."""
    old = [r for r in robots if r.is_old_news]
    if not old:
        return ""
    each = "; ".join(f"R{r.robot_id:02d} {r.old_news}" for r in old)
    told = (
        f"NOBODY KNOWS WHAT {', '.join(f'R{r.robot_id:02d}' for r in old)} "
        f"{'DOES' if len(old) == 1 else 'DO'} NOW: {each}."
    )
    if all(r.signs_no_more for r in old):
        return told
    return (
        f"{told} What is old may be a recording that is played while the robot is off or drives "
        "elsewhere; else the network is late, or its clock is behind (NTP) and it hears nothing "
        "from here."
    )


def of_addressed(where: dict[str, Any]) -> str:
    """Sentences on whom a command was for: robots of a bus or prefix of their own, or twins.

    Args:
        where: as of swarm_end.addressed().
    """
    names = {"lcm_url": "--lcm-url", "channel_prefix": "--channel-prefix"}
    options = [word for key, name in names.items() if key in where for word in (name, where[key])]
    bus = f"Only robots with {shlex.join(options)} are meant; of others nothing is known."
    twins = ", ".join(f"R{i:02d}" for i in where.get("twins", ()))
    are = "is a twin, no robot" if len(where.get("twins", ())) == 1 else "are twins, no robots"
    return _joined(bus if options else "", f"{twins} {are}." if twins else "")


def _besides(given: list[Answer]) -> str:
    """Remarks on robots that have confirmed a stop."""
    lost_link = [a for a in given if a.lost_link]
    why = several.of(lost_link, "it had lost its operator")
    before = f"{_names(lost_link)} stood before: {why}." if lost_link else ""
    return _joined(before, of_remarks(given))


def of_remarks(given: list[Answer]) -> str:
    """Words on robots that have confirmed a stop: that they forget it if started anew, or when."""
    late = [a for a in given if a.stood_ago_s is not None and a.stood_ago_s > SIGNED_S]
    each = ", ".join(f"{_names([a])} up to {a.stood_ago_s:.0f} s ago" for a in late)
    why = several.of(late, "packets are late or lost, or it was halted")
    when = f"That was signed by {each}: {why}." if late else ""
    return _joined(*(f"{_names([a])} {a.reason}." for a in given if a.reason), when)


def _joined(*sentences: str) -> str:
    return " ".join(filter(None, sentences))


def of_busy(busy: list[Robot], held: Collection[int] = frozenset()) -> str:
    """That robots drive already, may, or are about to, and for whom; empty where none does.

    Args:
        busy: the robots.
        held: those of them that this program holds.
    """
    by: dict[str, list[str]] = {}
    for robot in busy:
        words = robot.may_drive or _of_busy(robot, _for_whom(robot, held))
        by.setdefault(words, []).append(f"R{robot.robot_id:02d}")
    return "; ".join(
        f"{', '.join(names)} {several.of(names, words)}" for words, names in by.items()
    )


def _for_whom(robot: Robot, held: Collection[int]) -> str:
    """Words on who holds one that drives or is about to, by all that is known yet."""
    if robot.is_tethered is False:
        return "untethered"
    if robot.hears_other_operator:
        return "held by another operator or terminal"
    if robot.is_tethered is None:
        return "and has not signed yet for whom" if robot.link else BY_ITS_WORD
    if robot.robot_id in held:
        return "held from here"
    if robot.hears_operator:
        return "and nobody else is heard yet who holds it"
    return "and no operator is heard who holds it"


def _of_busy(robot: Robot, who: str) -> str:
    """Words on one that is heard to drive, to be about to or to be held, behind its name."""
    in_fault = f" in a fault{_alarms([robot])}" if robot.mode == "fault" else ""
    if robot.awaits_start:
        return f"stands still{in_fault}, {AWAITS_START}, {who}"
    if robot.hides_start and not (robot.drives_by_any_word or robot.hears_operator):
        return f"stands still{in_fault}, and {HIDES_START}"
    if not robot.drives_by_any_word:
        count = " that may be counting down to a start" if robot.may_await_start else ""
        return f"stands still{in_fault}, held by another operator or terminal{count}"
    if in_fault:
        return f"stands still{in_fault}, was started, and drives once that is over: {who}"
    return f"drives already, {who}"


def of_taking_over(busy: list[Robot]) -> str:
    """`of_busy`, and which of them a start from here takes over."""
    ours, theirs = [r for r in busy if r.link], [r for r in busy if not r.link]
    told = [f"{of_busy(ours)}; this start takes over."] if ours else []
    if theirs:
        words = several.of(theirs, "it signs nothing with this operator's key, and obeys no start")
        told.append(f"{of_busy(theirs)}: {words} from here.")
    return _joined(*told)


def of_countdown(busy: list[Robot], behavior: str) -> str:
    """Sentence on robots that may not play what is chosen; empty where all will.

    What the start names that is to come was said before anybody listened here.
    """
    waiting = [f"R{robot.robot_id:02d}" for robot in busy if not robot.drives_by_any_word]
    if not waiting:
        return ""
    return (
        f"{', '.join(waiting)} may not play {behavior}: where a start that is to come names a "
        "behaviour, that is played."
    )


def of_clocks(clock_s: dict[str, float], ahead_s: float) -> str:
    """Whose clock is odd, by how much, and what that makes of a common start; empty if none is.

    Args:
        clock_s: how far that of each robot is ahead of this computer's.
        ahead_s: from now to the start by this computer's clock.
    """
    then = ", ".join(f"{name} {_then(s, ahead_s)}" for name, s in _off_clocks(clock_s).items())
    return f"{_odd_clocks(clock_s)}. By that, {then}" if then else ""


def of_clocks_now(clock_s: dict[str, float]) -> str:
    """Sentence on whose clock is odd and by how much; empty if none is."""
    odd = _odd_clocks(clock_s)
    return f"{odd[0].upper()}{odd[1:]}." if odd else ""


def of_late(robots: Iterable[Robot]) -> str:
    """Sentence on whose words come late; empty if nobody's do. Old news is none of them."""
    late = [r for r in robots if r.late_s > CLOCK_WARN_S and not r.is_old_news]
    if not late:
        return ""
    each = ", ".join(f"{r.late_s:.2f} s from R{r.robot_id:02d}" for r in late)
    if all(r.has_answered for r in late):
        return f"The network is late, as answers show: what is said takes {each}."
    return f"What is said comes late, {each}: the network is late, or a clock is behind (NTP)."


def _off_clocks(clock_s: dict[str, float]) -> dict[str, float]:
    return {name: s for name, s in clock_s.items() if abs(s) > CLOCK_WARN_S}


def _odd_clocks(clock_s: dict[str, float]) -> str:
    off = _off_clocks(clock_s)
    right = [name for name in clock_s if name not in off]
    if not off:
        return ""
    if len(off) > 1 and not right and max(off.values()) - min(off.values()) < 2 * CLOCK_WARN_S:
        middle_s = sum(off.values()) / len(off)
        told = f"this computer's clock is {_off(-middle_s)} those of {', '.join(off)}, which agree"
        whose = "this computer's"
    else:
        told = "; ".join(f"{name}'s clock is {_off(s)} this computer's" for name, s in off.items())
        told += f", with which {', '.join(right)} agree{'s' * (len(right) == 1)}" if right else ""
        whose = ("its" if len(off) == 1 else "theirs") if right else "all"
    return f"{told}: set {whose} (NTP)"


def _off(s: float) -> str:
    return f"{abs(s):.2f} s {'ahead of' if s > 0 else 'behind'}"


def _then(s: float, ahead_s: float) -> str:
    """A robot's start, given how far its clock is ahead."""
    if not -LATE_S < ahead_s - s < AHEAD_S:
        return "refuses the start"
    return f"starts {min(s, ahead_s):.2f} s early" if s > 0 else f"starts {-s:.2f} s late"


def of_arm(given: list[Answer]) -> Verdict:
    """Who may be started."""
    wrong = _wrong(given)
    if not wrong:
        return Verdict(True, "All are armed.")
    are = "are known to be armed" if _are_unknown(given) else "are armed"
    return Verdict(False, f"Not all {are}: {wrong}.")


def of_select(given: list[Answer], behavior: str) -> Verdict:
    """Who does what was chosen."""
    wrong = _wrong(given)
    if wrong:
        did = "Not all did" if any(a.accepted is not False for a in given) else "None did"
        did = "Not all are known to have done so" if _are_unknown(given) else did
        driving = [a for a in given if a.accepted is False and a.mode in DRIVING]
        words = several.of(driving, "goes on with what it did")
        more = f" {_names(driving)} {words}." if driving else ""
        return Verdict(False, f"{did}: {wrong}{_hint(given)}.{more}")
    waiting = [a for a in given if a.reason]
    if waiting:
        words = f"{_names(waiting)} will not play {behavior}{_because(waiting)}"
        return Verdict(False, f"{words}, though all chose it.")
    return Verdict(True, f"All chose {behavior}.")


def _wrong(given: list[Answer]) -> str:
    """Who did not obey, or is two of whom one may not have; empty where all did."""
    double = [a for a in given if a.is_double]
    wrong = [a for a in _disobeyed(given) if a not in double]
    unknown = [a for a in wrong if a.tells_nothing and a.accepted is None]
    wrong = [a for a in wrong if a not in unknown]
    told = [f"{_names(wrong)} did not obey{_because(wrong)}"] if wrong else []
    if unknown:
        words = several.of(unknown, "was not heard to obey")
        told.append(f"{_names(unknown)} {words}{_because(unknown)}")
    told += [f"{_names(double)}: two robots have this number, one may not obey"] if double else []
    return "; ".join(told)


def _are_unknown(given: list[Answer]) -> bool:
    """Whoever did not obey may have, for all that is known of now."""
    wrong = _disobeyed(given)
    return bool(wrong) and all(a.tells_nothing and a.accepted is None for a in wrong)


def of_start(
    begun: Start, ends: str = BY_KEY, *, drove_before: Iterable[int] = frozenset()
) -> Verdict:
    """Who drives.

    Args:
        begun: what became of it.
        ends: what stops those that are held.
        drove_before: robots that did before anything was said from here.
    """
    told = _of_called_off(begun) if begun.called_off else _of_start(begun, ends, drove_before)
    return replace(told, standing=_standing([*begun.stopped, *begun.late]))


def _of_start(begun: Start, ends: str, drove_before: Iterable[int]) -> Verdict:
    given = begun.answers
    at = datetime.fromtimestamp(begun.utime_us / 1e6).strftime("%H:%M:%S.%f")[:-3]
    faulty = [a for a in given if a.mode == "fault"]
    standing = [a for a in given if a.mode not in (*DRIVING, "fault")]
    if len(standing) == len(given):
        return Verdict(False, _of_nobody(begun, at, ends))
    going = [a for a in given if a.accepted is False and a.mode in DRIVING]
    if all(a.accepted is False or a.robot_id in begun.untold for a in given):
        going = going or [a for a in given if a.robot_id in begun.untold and a.mode in DRIVING]
        words = f"NOBODY STARTED: {_why(given)}. {_as_before(going or faulty)}."
        return Verdict(False, words)
    late = {a.robot_id for a in begun.late}
    waiting = [a for a in standing if a.robot_id not in late]
    silent = [a for a in waiting if a.is_silent and a.accepted is not False]
    refusing = [a for a in waiting if a.accepted is False]
    idle = [a for a in waiting if a not in silent and a not in refusing]
    unsure = [a for a in _disobeyed(given) if a.mode in DRIVING and a not in going]
    double = [a for a in given if a.is_double]
    theirs = [a for a in unsure if a.robot_id in begun.untold]
    before = [a for a in unsure if a.robot_id in drove_before and a not in theirs]
    unsure = [a for a in unsure if a not in theirs and a not in before]
    told = [
        f"{_names(faulty)} with a fault{_alarms(faulty)}, and will drive once it is over"
        if faulty
        else "",
        _refused([a for a in refusing if a.stands], ", and stands"),
        _refused([a for a in refusing if not a.stands]),
        f"{_names(idle)} did not{_because(idle) or _alarms(idle)}" if idle else "",
        f"{_unheard(silent)}{_because(silent)}, and {UNHEARD}" if silent else "",
        f"{_unheard(begun.late)} in time{_alarms(begun.late)}, told to stop" if begun.late else "",
        f"refused it{_because(going)}: {_as_before(going)}" if going else "",
        _why_dropped_out(begun),
        f"{_names(double)}: two robots have this number, one may stand" if double else "",
        _unconfirmed(unsure, "drives without having confirmed it"),
        _unconfirmed(before, "drove before, and has not confirmed it"),
        _unconfirmed(theirs, "was told nothing by this start, and drives by somebody else's word"),
        _dry_run(given),
        _remarked(given),
        *_odd_links(begun),
    ]
    if not any(told):
        return Verdict(True, f"Started at {at}. {_going_on(begun, ends)}")
    missing = "; ".join(filter(None, told))
    words = f"Started at {at}, but not all: {missing}. {_going_on(begun, ends)}"
    if begun.late:
        words = f"{words} {of_stop(begun.late, is_of_some=True).sentence}"
    return Verdict(False, words)


def _refused(given: list[Answer], then: str = "") -> str:
    """Words on robots that did not obey, and why; empty where none is so.

    Args:
        given: what they answered.
        then: how each is, to go on behind.
    """
    return f"{_names(given)} refused it{_because(given)}{several.of(given, then)}" if given else ""


def _unconfirmed(given: list[Answer], words: str) -> str:
    return f"{_names(given)} {several.of(given, words)}{_because(given)}" if given else ""


def _unheard(given: list[Answer]) -> str:
    """Words on robots of which nobody knows whether they did; to go on behind."""
    return f"{_names(given)} {several.of(given, 'was')} not heard to start"


def of_dry_run(given: list[Answer]) -> str:
    """Sentence on robots whose stop says nothing of their wheels; empty if none is so."""
    dry = [a for a in given if DRY_RUN in a.alarms]
    words = several.of(dry, "what it signs says nothing of wheels that another program drives")
    return f"{_dry_run(given)}: {words}." if dry else ""


def _dry_run(given: list[Answer]) -> str:
    """Robots that do all but move; words to go on behind."""
    dry = [a for a in given if DRY_RUN in a.alarms]
    words = several.of(dry, "with --dry-run, its motor board not opened")
    return f"{_names(dry)} {words}" if dry else ""


def _remarked(given: list[Answer]) -> str:
    """Words of robots that obey a start, as that no wheel turns by their configuration."""
    those = [a for a in given if a.accepted and a.signed and a.reason]
    return f"{_names(those)} accepted it{_because(those)}" if those else ""


def _as_before(given: list[Answer]) -> str:
    """Who refused a start while it drove, for whomever that is."""
    return f"{_names(given)} {'goes' if len(given) == 1 else 'go'} on as before this start"


def _going_on(begun: Start, ends: str) -> str:
    """How robots that drive stop, as was asked for, and who has not signed that yet."""
    if begun.link_timeout_ms == 0:
        words = "They drive on by themselves"
    else:
        words = f"{ends}; they stop by themselves "
        words += f"{begun.link_timeout_ms / 1e3:g} s after they have lost this command"
    told = [a for a in begun.answers if a.robot_id not in begun.untold]
    taken = [a for a in told if a.mode in DRIVING and a.accepted is not False]
    waiting = [a for a in taken if a.link_timeout_s is None]
    verb = several.of(waiting, "has")
    return f"{words}{f', which {_names(waiting)} {verb} not signed yet' if waiting else ''}."


def _odd_links(begun: Start) -> list[str]:
    """Words on robots that have signed another time without their operator than was sent."""
    asked_s = begun.link_timeout_ms / 1e3
    return [
        f"R{a.robot_id:02d} drives on "
        f"{f'for {a.link_timeout_s:g} s' if a.link_timeout_s else 'for ever'} without this command"
        for a in begun.answers
        if a.link_timeout_s is not None and a.link_timeout_s != asked_s
    ]


def _alarms(given: Sequence[Answer | Robot]) -> str:
    words = "; ".join(sorted({alarm for a in given for alarm in a.alarms}))
    return f" ({words})" if words else ""


def _of_called_off(begun: Start) -> Verdict:
    """Why nobody starts, and what became of those that had accepted."""
    taken = [a for a in begun.answers if a.robot_id in begun.dropouts.taken]
    words = f"Called off: {_why_called_off(begun)}."
    if taken:
        words += f" {_names(taken)}: left to that start."
    if STOPPED in begun.dropouts.words.values():
        words += f" {_who_stopped(begun)}"
    untold = [a for a in begun.answers if a.robot_id in begun.untold]
    if untold:
        words += f" {_names(untold)} {several.of(untold, LEFT_ALONE)}."
    if begun.stopped:
        whom = "The others" if taken or untold else "All"
        stopped = of_stop(begun.stopped, is_of_some=bool(taken or untold)).sentence
        of_all = (STOPPED, NONE_BEGUN, DOUBLE)
        is_of_all = any(w.startswith(of_all) for w in begun.dropouts.words.values())
        more = "" if is_of_all else "; --partial starts some"
        words += f" {whom} were told to stop: {stopped} They must be armed before they start"
        words += f" (--arm){more}."
    return Verdict(False, words)


def _who_stopped(begun: Start) -> str:
    """From where another's stop came, and what to do about it."""
    if begun.stop_heard:
        return f"A stop came from {begun.stop_heard}: ask there before you start them again."
    return "Ask who stopped them before you start them again."


def _of_nobody(begun: Start, at: str, ends: str) -> str:
    """Why none drives though its instant has come."""
    if begun.late:
        stopped = of_stop(begun.late, is_of_some=True).sentence
        words = f"{_unheard(begun.late)} in time{_alarms(begun.late)}. Told to stop: {stopped}"
        return f"NOBODY WAS HEARD TO START: {words}"
    unheard = [a for a in begun.answers if a.is_silent and a.accepted is None]
    more = f"{_names(unheard)} {UNHEARD}." if unheard else ""
    if len(_disobeyed(begun.answers)) == len(begun.answers):
        started = "WAS HEARD TO START" if unheard else "STARTED"
        return _joined(f"NOBODY {started}: {_why(begun.answers)}.", more)
    waiting = [a for a in begun.answers if a.accepted and a.signed]
    is_unheard = any(a.is_silent for a in waiting)
    drives = "WAS HEARD TO DRIVE" if is_unheard else "DRIVES"
    may = "drive, unheard over a late network, or " if is_unheard else ""
    words = f"accepted the start, and may {may}begin late by a clock that is behind"
    told = f"NOBODY {drives}, though it is {at}: {_names(waiting)} {words}. {ends}."
    return _joined(told, more)


def of_end(
    begun: Verdict | None,
    states: dict[str, State],
    stopped: Verdict | None,
    *,
    was_confirmed: bool = False,
) -> Verdict:
    """Outcome for robots that were held.

    Args:
        begun: what came of their start; None: nobody knows, it was ended before.
        states: what was seen of each last, before they were stopped.
        stopped: what came of the stop; None: all stood by themselves before.
        was_confirmed: all had confirmed a start that was ended.
    """
    ends = _of_end(begun, states, stopped, was_confirmed=was_confirmed)
    standing = frozenset(name for name, state in states.items() if state.stands)
    return replace(ends, standing=stopped.standing if stopped else standing)


def _of_end(
    begun: Verdict | None,
    states: dict[str, State],
    stopped: Verdict | None,
    *,
    was_confirmed: bool,
) -> Verdict:
    early: dict[State, list[str]] = {}
    for name, state in states.items():
        if state.stands or state.before:
            early.setdefault(state, []).append(name)
    told = [_told_early(names, state, bool(stopped)) for state, names in early.items()]
    if stopped and not stopped.ok:
        return stopped.more(_joined(*(f"{words}." for words in told)))
    if begun is None:
        known = "all had confirmed it" if was_confirmed else "not all had confirmed it"
        told.append(f"the start was ended before it was known to have begun; {known}")
    elif not begun.ok:
        told.append("not all had started")
    is_meant = all(state.is_meant for state in early)
    is_asked = not any(state.is_by_other for state in early)  # an end that the caller asked for
    ok = begun is not None and begun.ok and is_meant and is_asked
    ends_well = is_meant and (begun is None or begun.ok)
    if not told:
        return Verdict(ok, "All stand.", ends_well)
    words = f"All stand{';' if stopped else ':'} {'; '.join(told)}."
    return Verdict(ok, words, ends_well)


def _told_early(names: list[str], state: State, is_stopped: bool) -> str:
    """Sentence on robots that had ended before they were stopped."""
    if not state.stands:
        return f"{', '.join(names)} {several.of(names, state.before)}"
    words = several.of(names, state.words)
    return f"{', '.join(names)}{' stood before' if is_stopped else ''}: {words}"


def _disobeyed(given: list[Answer]) -> list[Answer]:
    return [a for a in given if not (a.accepted and a.signed)]


def _names(given: list[Answer]) -> str:
    return ", ".join(f"R{a.robot_id:02d}" for a in given)


def _why_called_off(begun: Start) -> str:
    return _why_dropped_out(begun) or _why(begun.answers)


def _why_dropped_out(begun: Start) -> str:
    """Words on robots that another operator or a fault kept from it; empty where none was."""
    by: dict[str, list[str]] = {}
    for robot_id, words in sorted(begun.dropouts.words.items()):
        by.setdefault(words, []).append(f"R{robot_id:02d}")
    return "; ".join(
        f"{', '.join(names)} {several.of(names, f'was {words}')}" for words, names in by.items()
    )


def _why(given: list[Answer]) -> str:
    """Why not all start."""
    refused = [a for a in given if a.accepted is False]
    if refused:
        return f"{_names(refused)} refused{_because(refused)}{_hint(given)}"
    silent = _disobeyed(given)
    return f"{_names(silent)} did not acknowledge in time{_because(silent)}"


def _because(given: list[Answer]) -> str:
    """Reasons that robots gave, or that are known of them; by name where they differ."""
    by: dict[str, list[Answer]] = {}
    for answer in given:
        if answer.reason:
            by.setdefault(answer.reason, []).append(answer)
    if len(by) == 1:
        return f" ({several.of(given, next(iter(by)))})"
    each = "; ".join(f"{_names(who)}: {several.of(who, reason)}" for reason, who in by.items())
    return f" ({each})" if each else ""


def _hint(given: list[Answer]) -> str:
    unknown = any(a.reason.startswith("no behaviour") for a in given)
    return "; `twinmill robot flash --behaviors FILE` brings tables to robots" if unknown else ""
