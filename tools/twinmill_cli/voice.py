# SPDX-License-Identifier: Apache-2.0
"""Words and tables of a command that moves robots, written by a thread that it never waits for.

A terminal that is halted (Ctrl-S), a full pipe or a slow disk keep only that thread waiting: the
robots hear their operator, and his stop, all the same.
"""

from __future__ import annotations

import errno
import os
import select
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from queue import Queue
from typing import TYPE_CHECKING

from rich.live import Live
from rich.text import Text

from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.streams import STDERR, STDOUT, closed_at_first, leads_nowhere
from twinmill.terminal import PlainConsole
from twinmill_cli import done
from twinmill_cli.exit_now import exit_now
from twinmill_cli.output import let_go_on, say_at_terminal

if TYPE_CHECKING:
    from rich.console import RenderableType

SHOW_PERIOD_S = 0.25
JOIN_S = 0.05
LAST_WORD_S = 0.5  # in which a terminal that takes anything has taken the last sentence
PATIENCE_S = 2.0  # for a terminal that is halted, or a reader who is slow, once all else is done


STREAMS = (STDOUT, STDERR)
NOBODY = "nobody reads any more what is told, so nobody could be told of a fault"


def can_be_heard() -> bool:
    """Stdout or stderr is a file, or has somebody at its other end.

    Both have lost him, as when a connection by ssh breaks that had no terminal: no signal comes.
    Or neither ever had one (`>&- 2>&-`).
    """
    return len(_broken() | closed_at_first & {*STREAMS}) < len(STREAMS)


def _broken() -> set[int]:
    """Streams that had somebody at their other end, and have nobody."""
    poll = select.poll()
    for stream in STREAMS:
        poll.register(stream, 0)  # that nobody is there is told unasked
    return {stream for stream, what in poll.poll(0) if what & (select.POLLERR | select.POLLHUP)}


def refuse_deaf() -> None:
    """Raises OSError if nobody can be told anything any more."""
    if not can_be_heard():
        raise OSError(errno.EPIPE, NOBODY)


def all_take_words() -> bool:
    """Nobody keeps a writer waiting: who writes for long then is slow itself."""
    return len(select.select([], STREAMS, [], 0)[1]) == len(STREAMS)


def let_terminals_go_on() -> None:
    """Undoes Ctrl-S at those that are streams of this program."""
    for stream in filter(os.isatty, STREAMS):
        let_go_on(stream)


def _line(sentence: str) -> str:
    return f"twinmill: {plain_line(sentence, MESSAGE_MAX)}"


class Voice:
    """A thread that writes, in order, what it is given.

    Sentences go to stderr; where that leads nowhere (`2>/dev/null`) to stdout, unless this is to
    have an object alone.

    Args:
        as_json: it is.

    Attributes:
        failure: why something could not be written, as a disk that is full; None: all was.
    """

    def __init__(self, *, as_json: bool = False) -> None:
        self.failure: Exception | None = None
        self._waiting: Queue[Callable[[], object] | None] = Queue()
        is_stderr = as_json or not leads_nowhere(STDERR)
        self._console = PlainConsole(stderr=is_stderr)
        self._stream = STDERR if is_stderr else STDOUT
        self._last, self._heard_on = "", {*STREAMS}
        self._live: Live | None = None
        self._newest: RenderableType = ""
        self._shown_s = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tell(self, write: Callable[[], object]) -> None:
        """Has a function called that writes."""
        self._waiting.put(write)

    def say(self, sentence: str) -> None:
        """A sentence, above what is shown there."""
        self.tell(lambda: self._print(sentence))

    def _print(self, sentence: str) -> None:
        """On its stream; at the terminal, if there is one, where nobody reads that any more."""
        try:
            self._console.print(Text(_line(sentence)), soft_wrap=True)
        except BrokenPipeError:
            if not say_at_terminal(_line(sentence)):
                raise
            self._last = "" if sentence == self._last else self._last

    def say_instead(self, sentence: str) -> None:
        """A sentence in the place of what is shown, which is no longer so."""
        self.clear()
        self.say(sentence)

    def say_outcome(self, sentence: str) -> None:
        """A sentence on what became of robots, which has to be heard: see `end`."""

        def say() -> None:
            self._print(sentence)
            done.told(sentence)

        done.became(sentence)
        self._last, self._heard_on = sentence, {self._stream}
        self.tell(say)

    def tell_outcome(self, write: Callable[[], object], sentence: str) -> None:
        """Has a function write what became of robots on stdout, or else on stderr."""
        done.became(sentence)
        self._last, self._heard_on = sentence, {*STREAMS}
        self.tell(write)

    def show(self, make: Callable[[], RenderableType]) -> None:
        """Draws at the end of a terminal, in the place of what was drawn before; nowhere else.

        Args:
            make: called at once, and only where it is time for another picture.
        """
        now_s = time.monotonic()
        if not self._console.is_terminal or now_s < self._shown_s + SHOW_PERIOD_S:
            return
        self._newest, self._shown_s = make(), now_s
        if self.is_idle:
            self.tell(self._draw)

    def show_or_say(self, words: str) -> None:
        """Draws words as show() does; where there is no terminal, says them instead."""
        if self._console.is_terminal:
            self.show(lambda: Text(words))
        else:
            self.say(words)

    def _draw(self) -> None:
        if self._live is None:
            self._live = Live(
                console=self._console,
                auto_refresh=False,
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._live.start()
        self._live.update(self._newest, refresh=True)

    def clear(self) -> None:
        """Takes away what is shown: it is no longer so."""
        self.tell(self._clear)

    def _clear(self) -> None:
        if self._live:
            self._live.stop()
            self._live = None

    def _run(self) -> None:
        while write := self._waiting.get():
            try:
                write()
            except Exception as error:  # what follows may be of another stream
                self.failure = self.failure or error
            self._waiting.task_done()

    @property
    def is_idle(self) -> bool:
        """All is written."""
        return self._waiting.unfinished_tasks == 0

    def check(self, *, signals: Sequence[int] = ()) -> None:
        """Raises OSError or ValueError if anything could not be written.

        Args:
            signals: by which the command was ended. Who reads its words may have been ended with
                it, and the exit code tells all the same what became of robots.
        """
        if signals and isinstance(self.failure, BrokenPipeError):
            return
        if isinstance(self.failure, OSError):
            raise self.failure
        if self.failure:
            raise ValueError(f"what is to be told cannot be: {self.failure}.") from self.failure

    def check_listener(self) -> None:
        """Raises as check() does, and as refuse_deaf() does."""
        self.check()
        refuse_deaf()

    def wait(self, look: Callable[[float], None]) -> None:
        """Waits until all is written, or nobody is to wait any longer for who takes nothing.

        Args:
            look: waits for so many seconds, and raises what ends this sooner.
        """
        for _ in self._patience(lambda: not self.is_idle):
            look(JOIN_S)

    def end(self, code: int, signals: Sequence[int] = ()) -> None:
        """Waits as wait() does. Who does not want to wait any more (Ctrl-C) need not.

        The outcome is said at the terminal where nobody has come to read what it was written to, as
        where Ctrl-C ended `tee`, too.

        Args:
            code: with which the program then ends at once.
            signals: one more that stands there asks for that.
        """
        self._waiting.put(None)
        before = len(signals)
        try:
            for _ in self._patience(lambda: self._thread.is_alive() and len(signals) == before):
                self._thread.join(JOIN_S)
        except KeyboardInterrupt:
            pass
        self._thread.join(LAST_WORD_S)
        if self._last and _broken() >= self._heard_on and say_at_terminal(_line(self._last)):
            done.told(self._last)
        if self._thread.is_alive():
            exit_now(code)  # it may hold what the interpreter would wait for

    @staticmethod
    def _patience(is_waiting: Callable[[], bool]) -> Iterator[None]:
        """Yields while something waits and may; a terminal that halts it goes on before the end."""
        for patience_s in (PATIENCE_S, LAST_WORD_S):
            blocked_s = 0.0
            while is_waiting() and blocked_s < patience_s:
                begin_s = time.monotonic()
                yield
                blocked_s += 0.0 if all_take_words() else time.monotonic() - begin_s
            if is_waiting():
                let_terminals_go_on()
