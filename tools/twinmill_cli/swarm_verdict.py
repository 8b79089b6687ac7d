# SPDX-License-Identifier: Apache-2.0
"""Outcome of a command to a swarm: sentence, exit code and `ok` follow from one value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from twinmill.robots.fleet import Robot
from twinmill.robots.hold import State
from twinmill.robots.tell import NEVER_HEARD, Answer, Start

DRIVING = ("running", "script")


@dataclass(frozen=True)
class Verdict:
    """Did it go as it was meant?

    Attributes:
        ok: it did, and exit code and JSON say so.
        sentence: what a person reads of it.
    """

    ok: bool
    sentence: str

    @property
    def code(self) -> int:
        """The command's exit code."""
        return 0 if self.ok else 1

    def beside(self, driving: list[str]) -> Verdict:
        """This outcome with a word on robots that were not asked, and that drive."""
        if not driving:
            return self
        verb = "drives" if len(driving) == 1 else "drive"
        return Verdict(self.ok, f"{self.sentence} {', '.join(driving)} {verb}, and was not asked.")


def of_stop(
    given: list[Answer],
    timeout_s: float = 10.0,
    *,
    is_of_some: bool = False,
    unheard: Sequence[str] = (),
) -> Verdict:
    """All stand, or which robots must be stopped by hand.

    Args:
        given: what they answered.
        timeout_s: for how long it was said.
        is_of_some: these alone were asked, and others may be there.
        unheard: machines that were told by name, and from which no robot spoke.
    """
    hint = "Where the network carries no multicast, give a robot's address: swarm stop --host."
    if unheard:
        hint = f"Nothing was heard from {', '.join(unheard)}: is the name or address right?"
    if not given:
        words = f"No robot was heard in {timeout_s:g} s; stop was said all the time. {hint}"
        return Verdict(False, words)
    double = [a for a in given if a.is_double]
    unconfirmed = [a for a in given if not ((a.accepted and a.signed and a.stands) or a.is_double)]
    if not double and not unconfirmed:
        if unheard:
            return Verdict(False, f"NOT ALL STAND: {hint} Whoever was heard stands.")
        verb = "stands" if len(given) == 1 else "stand"
        return Verdict(True, f"{_names(given)} {verb}." if is_of_some else "All stand.")
    told = [f"{_names(unconfirmed)}: no stop was confirmed"] if unconfirmed else []
    told += [f"{_names(double)}: two robots have this number, one may drive"] if double else []
    words = f"NOT ALL STAND: {'; '.join(told)}. SWITCH OFF BY HAND what still drives."
    silent = [a for a in unconfirmed if a.reason == NEVER_HEARD]
    words += f" {_names(silent)}: {NEVER_HEARD}." if silent else ""
    return Verdict(False, f"{words} {hint}" if silent or unheard else words)


def of_driving(driving: list[Robot]) -> str:
    """That robots drive already, and who has them in hand; empty where none drives."""
    by: dict[str, list[str]] = {}
    for robot in driving:
        who = {
            None: "untethered",
            True: "held by another operator",
            False: "and no operator is heard who holds it",
        }[robot.is_held]
        by.setdefault(who, []).append(f"R{robot.robot_id:02d}")
    return "; ".join(
        f"{', '.join(names)} {'drives' if len(names) == 1 else 'drive'} already, {who}"
        for who, names in by.items()
    )


def of_arm(given: list[Answer]) -> Verdict:
    """Who may be started."""
    wrong = _disobeyed(given)
    if wrong:
        return Verdict(False, f"Not all are armed: {_names(wrong)} did not obey, see above.")
    return Verdict(True, "All are armed.")


def of_select(given: list[Answer], behavior: str) -> Verdict:
    """Who does what was chosen."""
    wrong = _disobeyed(given)
    if wrong:
        words = f"Not all did: {_names(wrong)} did not obey, see above{_hint(given)}."
        return Verdict(False, words)
    return Verdict(True, f"All chose {behavior}.")


def of_start(begun: Start, untethered: bool) -> Verdict:
    """Who drives."""
    given = begun.answers
    if begun.called_off:
        told = f"All were told to stop: {of_stop(begun.stopped).sentence}"
        more = "" if begun.by_another else "; --partial starts some"
        return Verdict(
            False,
            f"Called off: {_why_called_off(begun)}. {told} They must be armed before they start "
            f"(--arm){more}.",
        )
    going_on = "They drive on by themselves." if untethered else "Ctrl-C stops them."
    at = datetime.fromtimestamp(begun.utime_us / 1e6).strftime("%H:%M:%S.%f")[:-3]
    faulty = [a for a in given if a.mode == "fault"]
    standing = [a for a in given if a.mode not in (*DRIVING, "fault")]
    if len(standing) == len(given):
        return Verdict(False, _of_nobody(begun, at))
    late = {a.robot_id for a in begun.late}
    idle = [a for a in standing if a.robot_id not in late]
    unsure = [a for a in _disobeyed(given) if a.mode in DRIVING]
    told = [
        f"{_names(faulty)} with a fault, and will drive once it is over" if faulty else "",
        f"{_names(idle)} did not" if idle else "",
        f"{_names(begun.late)} did not in time, told to stop" if begun.late else "",
        f"{_names(unsure)} drive without having confirmed it" if unsure else "",
    ]
    if not any(told):
        return Verdict(True, f"Started at {at}. {going_on}")
    missing = "; ".join(filter(None, told))
    words = f"Started at {at}, but not all: {missing}, see above. {going_on}"
    if begun.late:
        words = f"{words} {of_stop(begun.late, is_of_some=True).sentence}"
    return Verdict(False, words)


def _of_nobody(begun: Start, at: str) -> str:
    """Why none drives though its instant has come."""
    if begun.late:
        stopped = of_stop(begun.late, is_of_some=True).sentence
        return f"NOBODY STARTED: {_names(begun.late)} did not in time. Told to stop: {stopped}"
    if len(_disobeyed(begun.answers)) == len(begun.answers):
        return f"NOBODY STARTED: {_why(begun.answers)}."
    return f"NOBODY DRIVES, though it is {at}: see above. Ctrl-C stops them."


def of_end(begun: Verdict | None, states: dict[str, State], stopped: Verdict | None) -> Verdict:
    """Outcome for robots that were held.

    Args:
        begun: what came of their start; None: nobody knows, it was ended before.
        states: what was seen of each last, before they were stopped.
        stopped: what came of the stop; None: all stood by themselves before.
    """
    if stopped and not stopped.ok:
        return stopped
    early: dict[State, list[str]] = {}
    for name, state in states.items():
        if state.is_taken or (state.stands and not (stopped and state.is_meant)):
            early.setdefault(state, []).append(name)
    told = [_told_early(names, state, bool(stopped)) for state, names in early.items()]
    if begun is None:
        told.append("the start was ended before all had confirmed it")
    elif not begun.ok:
        told.append("not all had started")
    ok = begun is not None and begun.ok and all(state.is_meant for state in early)
    if not told:
        return Verdict(ok, "All stand.")
    return Verdict(ok, f"All stand{';' if stopped else ':'} {'; '.join(told)}.")


def _told_early(names: list[str], state: State, is_stopped: bool) -> str:
    """Sentence on robots that had ended before they were stopped."""
    if not state.stands:
        return f"{', '.join(names)} {state.words}"
    return f"{', '.join(names)}{' stood before' if is_stopped else ''}: {state.words}"


def _disobeyed(given: list[Answer]) -> list[Answer]:
    return [a for a in given if not (a.accepted and a.signed)]


def _names(given: list[Answer]) -> str:
    return ", ".join(f"R{a.robot_id:02d}" for a in given)


def _why_called_off(begun: Start) -> str:
    if not begun.by_another:
        return _why(begun.answers)
    names = ", ".join(f"R{i:02d}" for i in begun.by_another)
    return f"{names} {'was' if len(begun.by_another) == 1 else 'were'} stopped by another command"


def _why(given: list[Answer]) -> str:
    """Why not all start."""
    refused = [a for a in given if a.accepted is False]
    if refused:
        return f"{_names(refused)} refused, see above{_hint(given)}"
    return f"{_names(_disobeyed(given))} did not acknowledge in time"


def _hint(given: list[Answer]) -> str:
    unknown = any(a.reason.startswith("no behaviour") for a in given)
    return "; `twinmill robot flash --behaviors FILE` brings tables to robots" if unknown else ""
