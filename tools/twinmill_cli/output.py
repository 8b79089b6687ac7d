# SPDX-License-Identifier: Apache-2.0
"""Output of all subcommands: JSON or text, and the spinner."""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.streams import STDERR_NAME, STDOUT, STDOUT_NAME, naming, refuse_closed
from twinmill_cli import done
from twinmill_cli.handlers import put_back

if TYPE_CHECKING:
    from rich.console import RenderableType

AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout, nothing else.")
]


CHANGED = 3  # exit code where something changed, for scripts


@contextmanager
def unstopped() -> Iterator[None]:
    """Meanwhile Ctrl-C does nothing: what takes a moment is told whole."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {signal.SIGINT: signal.signal(signal.SIGINT, signal.SIG_IGN)}
    try:
        yield
    finally:
        put_back(before)


_told_on: list[TextIO] = []  # where an object was printed


def begin_telling() -> None:
    """A command begins, and has printed no object."""
    _told_on.clear()
    done.begin()


def has_told() -> bool:
    """True if an object was printed where objects go now."""
    return any(stream is sys.stdout for stream in _told_on)


def print_object(data: dict[str, Any]) -> None:
    """One JSON object on stdout, in one line."""
    from twinmill.files import plain  # not for --help

    refuse_closed(STDOUT, STDOUT_NAME)
    with naming(STDOUT_NAME):
        print(json.dumps(plain(data), allow_nan=False), flush=True)
    _told_on[:] = [sys.stdout]


def say(sentence: str, program: str = "twinmill") -> None:
    """A sentence on stderr, in one line whatever it quotes; where nobody reads that, see below."""
    line = f"{program}: {plain_line(sentence, MESSAGE_MAX)}"
    try:
        with naming(STDERR_NAME):
            print(line, file=sys.stderr, flush=True)
    except BrokenPipeError:
        if not say_at_terminal(line):
            raise


def say_at_terminal(line: str) -> bool:
    """A line at the terminal that this program belongs to, whatever its streams are; False: none.

    As where Ctrl-C has ended its reader, too. A terminal that is halted (Ctrl-S) goes on.
    """
    try:
        terminal = os.open("/dev/tty", os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:  # there is none, or it is closed
        return False
    # One that wants no words of the background (`stty tostop`) would halt this program.
    held_back = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
    try:
        if not select.select([], [terminal], [], 0)[1]:
            let_go_on(terminal)
        os.write(terminal, f"{line}\n".encode(errors="replace"))
    except OSError:
        return False
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, held_back)
        os.close(terminal)
    return True


def let_go_on(terminal: int) -> None:
    """Undoes Ctrl-S, as Ctrl-C would: what is told last is seen, and its command ends."""
    with suppress(termios.error):  # it is gone
        # The kernel lets only those go on that a program has halted (Linux: n_tty_ioctl_helper)
        termios.tcflow(terminal, termios.TCOOFF)
        termios.tcflow(terminal, termios.TCOON)


def deliver(data: dict[str, Any], text: RenderableType | None, as_json: bool) -> None:
    """Prints the one or the other on stdout; text that must not wrap is not cut either."""
    with unstopped():
        if as_json:
            print_object(data)
        else:
            from twinmill.terminal import PlainConsole  # slow to import, and JSON needs none

            PlainConsole().print(text, crop=False)


@contextmanager
def busy(what: str) -> Iterator[None]:
    """Shows on stderr, if that is a terminal, what is being done and for how long."""
    with telling(what):
        yield


@contextmanager
def telling(what: str) -> Iterator[Callable[[str], None]]:
    """A spinner with a function that says where the work has got to."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from twinmill.terminal import progress_words  # slow to import

    progress = progress_words()
    task = progress.add_task(what, total=None)
    progress.start()
    try:
        yield lambda words: progress.update(task, description=f"{what}: {words}")
    finally:
        with unstopped():
            progress.stop()
