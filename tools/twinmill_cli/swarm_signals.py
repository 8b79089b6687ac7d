# SPDX-License-Identifier: Apache-2.0
"""Signals and messages while robots are commanded: neither cuts short what keeps wheels still."""

from __future__ import annotations

import os
import select
import shlex
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from twinmill.defaults import URL
from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.streams import STDERR, STDOUT, STDOUT_NAME, open_nowhere, refuse_closed
from twinmill_cli import done
from twinmill_cli.ctrl_c import has_terminal, key_reaches
from twinmill_cli.exit_now import STOPPED
from twinmill_cli.handlers import put_back
from twinmill_cli.output import print_object

if TYPE_CHECKING:
    from twinmill.robots.fleet import Fleet

# By default these end no program, or are Python's own: it ignores two, and writing fails instead.
HARMLESS = {
    signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH,
    signal.SIGPIPE, signal.SIGXFSZ,
}  # fmt: skip
# A fault of the program itself comes again for ever where it is handled. Held back, it ends the
# program all the same, and what somebody sent waits (sigprocmask(2)).
OF_FAULTS = {signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL}
# All others end or halt a program: a robot would drive until it has lost its operator.
ENDING = tuple(
    sorted(
        signal.valid_signals()
        - {signal.SIGKILL, signal.SIGSTOP, signal.SIGTTOU}
        - HARMLESS
        - OF_FAULTS
    )
)
# What became of robots where a command was ended that had said something, by its verb.
BECAME = {
    "start": "nothing was started; robots were told that they may be (--arm)",
    "arm": "robots were told that they may be started, and not all had answered; nothing moves",
    "select": "robots were told what to do, and not all had answered; those that drive drive on",
}


STOPS = "stops them"
BY_KEY = f"Ctrl-C {STOPS}"
# Where the network between them breaks, sshd keeps a session for hours, or for ever.
OVER_SSH = (
    "This is run over ssh: if the network on the way breaks, this machine may not notice, and "
    "holds the robots on. `ClientAliveInterval 2` in its sshd_config ends the session then; else "
    "hold robots from a machine beside them."
)
MACHINE_PIDS = "pid:[4026531836]"  # Linux's first namespace of numbers: PROC_PID_INIT_INO
LASTS_S = 0.3  # a shell that hands its terminal from one program to the next takes less
KEYS = {signal.SIGINT, signal.SIGQUIT, signal.SIGTSTP}  # Ctrl-C, Ctrl-\\, Ctrl-Z


def is_over_ssh() -> bool:
    """A session of ssh began this program, or what began it."""
    return "SSH_CONNECTION" in os.environ


def what_ends(lcm_url: str, channel_prefix: str | None, becomes: str = STOPS) -> str:
    """Words on what stops robots that this program holds on a bus.

    Args:
        lcm_url: of the bus.
        channel_prefix: of the robots' channels there.
        becomes: what that does, behind its name.
    """
    if key_reaches():
        return f"Ctrl-C {becomes}"
    bus = ["--lcm-url", lcm_url] if lcm_url != URL else []
    bus += ["--channel-prefix", channel_prefix] if channel_prefix else []
    stop = shlex.join(["twinmill", "swarm", "stop", *bus])
    where = "here" if _has_pid_of_machine() else "inside its container"
    how = f"`{stop}`, or {where} `kill {os.getpid()}`"
    how += ", or closing this terminal, nohup or not" if has_terminal() else ""
    return f"No Ctrl-C reaches this command: {how}, {becomes}"


def _has_pid_of_machine() -> bool:
    """Its number is not one of a container's own, which another program has outside."""
    with suppress(OSError):
        return os.readlink("/proc/self/ns/pid") == MACHINE_PIDS
    return False


class WhatEnds:
    """Words on what stops robots that this program holds, said anew where they change.

    Others may take its terminal, or change the terminal's keys, while somebody relies on them.

    Args:
        lcm_url, channel_prefix: as of `what_ends`.
        say: is told a sentence.
    """

    def __init__(
        self, lcm_url: str, channel_prefix: str | None, say: Callable[[str], None]
    ) -> None:
        self._bus, self._say = (lcm_url, channel_prefix), say
        self._becomes, self._told, self._same_s = STOPS, "", 0.0

    def __call__(self, becomes: str = STOPS) -> str:
        """Words of now, which are relied on from here on."""
        self._becomes, self._same_s = becomes, time.monotonic()
        self._told = what_ends(*self._bus, becomes)
        return self._told

    def look(self) -> None:
        """Says the words of now, where those that were told have been wrong for a while."""
        words, now_s = what_ends(*self._bus, self._becomes), time.monotonic()
        if not self._told or words == self._told:
            self._same_s = now_s
        elif now_s - self._same_s > LASTS_S:
            self._say(f"{self(self._becomes)}.")


def told_of_signals(signals: Sequence[int]) -> str:
    """Sentence on the signal that ended a command first.

    Empty where none did, or a key, as who pressed it knows.
    """
    if not signals or signals[0] in KEYS:
        return ""
    return f"Stopped by {_name(signals[0])}: {signal.strsignal(signals[0])}."


def _name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # of those in real time the first and the last alone have names
        return f"SIGRTMIN+{number - signal.SIGRTMIN}"


@contextmanager
def counting_signals(numbers: Sequence[int] = ENDING) -> Iterator[list[int]]:
    """Signals that ask for the end do nothing but stand in a list.

    Nor does a terminal (`stty tostop`) halt a program in the background that tells something: its
    robots would drive on until they had lost it.
    """
    asked: list[int] = []
    held_back = signal.pthread_sigmask(signal.SIG_BLOCK, OF_FAULTS)
    before = {number: signal.signal(number, lambda n, _: asked.append(n)) for number in numbers}
    # One that this program's starter had blocked would come to nobody.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
    before[signal.SIGTTOU] = signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    try:
        yield asked
    finally:
        asked += _sent_as_faults()
        signal.pthread_sigmask(signal.SIG_SETMASK, held_back)
        put_back(before)


def _sent_as_faults() -> list[int]:
    """Signals of faults that somebody sent: this program has none, or would have ended."""
    sent = []
    while info := signal.sigtimedwait(OF_FAULTS, 0):
        sent.append(info.si_signo)
    return sent


@contextmanager
def ended_by_signals(fleet: Fleet, check: Callable[[], None]) -> Iterator[Sequence[int]]:
    """Signals that ask for the end raise KeyboardInterrupt where the fleet listens, only there.

    So nothing can be cut short but waiting, and a stop not even by a second signal. What kills,
    robots notice by themselves. Gives the signals that came.

    Args:
        fleet: whose watch it is; what it was before goes on.
        check: raises what else is to end it.
    """
    with counting_signals() as asked, watched(fleet, asked, check):
        yield asked


@contextmanager
def watched(
    fleet: Fleet, asked: list[int], check: Callable[[], None] = lambda: None
) -> Iterator[None]:
    """Listening ends by KeyboardInterrupt once a signal stands in the list."""
    watch = fleet.watch

    def look() -> None:
        asked.extend(_sent_as_faults())
        if asked:
            raise KeyboardInterrupt
        watch()
        check()

    fleet.watch = look
    try:
        yield
    finally:
        fleet.watch = watch


@contextmanager
def commanding(
    verb: str, make: Callable[[], Fleet], *, as_json: bool, numbers: Sequence[int] = ENDING
) -> Iterator[Fleet]:
    """A fleet, and one sentence if a signal ends what is done with it: what was said to robots.

    Args:
        verb: the command's name.
        make: joins the bus.
        as_json: an object is printed, too.
        numbers: signals that end it.
    """
    fleet = None
    with counting_signals(numbers) as asked:
        try:
            if as_json:
                refuse_closed(STDOUT, STDOUT_NAME)
            fleet = make()
            done.speaks(lambda: bool(fleet.addressed))
            with watched(fleet, asked):
                yield fleet
        except KeyboardInterrupt:
            if done.is_decided():
                raise  # and told
            became = BECAME[verb] if fleet and fleet.addressed else "nothing was said to any robot"
            sentence = f"Ended by a signal: {became}."
            _tell_end(verb, sentence, asked, as_json=as_json)
            raise
        finally:
            if fleet:
                fleet.close()


def _tell_end(verb: str, sentence: str, signals: Sequence[int], *, as_json: bool) -> None:
    """Tells how it was ended, and does not wait for a terminal: no signal would end that."""
    from twinmill_cli.voice import Voice  # not for --help

    done.decide(STOPPED, sentence)
    voice, data = Voice(as_json=as_json), {"verb": verb, "ok": False, "sentence": sentence}
    if as_json:
        voice.tell(lambda: print_object({**data, "robots": []}))
    voice.say_outcome(sentence)
    voice.end(STOPPED, signals)
    voice.check(signals=signals)


@contextmanager
def saying_nothing() -> Iterator[Callable[[str], None]]:
    """No library's message keeps a stop waiting, as on a full pipe or after Ctrl-S.

    Gives a function that says a sentence where there is room for it, and else says nothing.
    """
    kept, nowhere = STDERR, None
    with suppress(OSError):  # so many files are open that libraries keep their stderr
        nowhere = open_nowhere()
        kept = os.dup(STDERR)
        os.dup2(nowhere, STDERR)

    def say_if_heard(sentence: str) -> None:
        with suppress(OSError):
            if select.select([], [kept], [], 0)[1]:
                os.write(kept, f"twinmill: {plain_line(sentence, MESSAGE_MAX)}\n".encode())

    try:
        yield say_if_heard
    finally:
        if kept != STDERR:
            os.dup2(kept, STDERR)
            os.close(kept)
        if nowhere is not None:
            os.close(nowhere)
