# SPDX-License-Identifier: Apache-2.0
"""Output of all subcommands: JSON or text, and the spinner."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.streams import STDERR_NAME, STDOUT, STDOUT_NAME, naming, refuse_closed

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
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


_told_on: list[TextIO] = []  # where an object was printed
_decided: list[int] = []  # the exit code of what cannot be undone


def begin_telling() -> None:
    """A command begins, and has printed no object."""
    _told_on.clear()
    _decided.clear()


def decide(code: int) -> None:
    """Keeps the exit code of what became of robots, and was told, from any later Ctrl-C."""
    _decided[:] = [code]


def decided_or(code: int) -> int:
    """The exit code that was decided; another where none was."""
    return _decided[0] if _decided else code


def is_decided() -> bool:
    """Something was done that cannot be undone, and need not be done again."""
    return bool(_decided)


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
    """A sentence on stderr, in one line whatever it quotes."""
    with naming(STDERR_NAME):
        print(f"{program}: {plain_line(sentence, MESSAGE_MAX)}", file=sys.stderr, flush=True)


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
