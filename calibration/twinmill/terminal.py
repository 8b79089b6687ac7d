# SPDX-License-Identifier: Apache-2.0
"""Rules of terminal output: foreign text as it is, tables and progress of any width uncut."""

import errno
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.measure import Measurement
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from twinmill.foreign_text import printable
from twinmill.streams import STDERR_NAME, STDOUT_NAME, naming

MOST_WIDE = 1000  # columns that no terminal has
# Columns that some characters need (wcwidth(3)); in fewer rich shows less, and in none nothing.
LEAST_WIDE = 2
USUAL = (80, 25)  # columns and lines that rich takes where it cannot know
BAR_FROM = 60  # columns of a terminal that has room for more than words and numbers


class PlainConsole(Console):
    """A console in which no text is markup, and through which no control character gets.

    It has room for text, be it that COLUMNS or LINES is 0.

    Args:
        options: as of rich's Console.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)
        if self.width < LEAST_WIDE or self.height < 1:
            self.size = USUAL

    def print(self, *objects: Any, **options: Any) -> None:
        """Rich's; an OSError names the stream."""
        with naming(STDERR_NAME if self.stderr else STDOUT_NAME):
            super().print(*objects, **options)

    def on_broken_pipe(self) -> None:
        """Nobody reads any more: that is told like any failure.

        Rich's SystemExit would end no more than a thread that writes, and without a word.
        """
        raise BrokenPipeError(errno.EPIPE, "nobody reads it any more")

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments of text and style; those of rich's own control codes stay as they are."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


def whole(command: str) -> Text:
    """A command line that does not wrap, to be copied."""
    return Text(f"  {command}", no_wrap=True, overflow="ignore")


class Fitting:
    """A table, or where the terminal is too narrow for it, each of its rows in running text.

    Args:
        made: the table; its columns are as wide as their longest word, or cell if they do not wrap.
            Where that is too wide, columns that stand left wrap. Its caption goes over the whole
            width.
        listed: columns of lists with commas; where it is too wide, each entry has a line.
        plainer: what is shown in its place where it is too wide, as without bars.
    """

    def __init__(
        self, made: Table, listed: Sequence[int] = (), plainer: "Fitting | None" = None
    ) -> None:
        self.made, self.listed, self.plainer = made, listed, plainer
        self.caption, made.caption = made.caption, None
        self._set_least()

    def _set_least(self, listed: Sequence[int] = ()) -> None:
        for k, column in enumerate(self.made.columns):
            parts = str.splitlines if column.no_wrap or k in listed else str.split
            cells = (str(cell) for cell in (column.header, *column.cells))
            column.min_width = max((cell_len(part) for c in cells for part in parts(c)), default=0)

    def _one_a_line(self) -> None:
        """Entries of lists, of which no number stands apart from its name."""
        for k in self.listed:
            column = self.made.columns[k]
            column._cells = [
                Text(str(cell).replace(", ", ",\n"), getattr(cell, "style", ""))
                for cell in column.cells
            ]
        self._set_least(self.listed)

    def _fits(self, console: Console, options: ConsoleOptions) -> bool:
        return self._measured(console, options).minimum <= options.max_width

    def _measured(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement.get(console, options.update(max_width=MOST_WIDE), self.made)

    def _share_out(self, console: Console, options: ConsoleOptions) -> None:
        """Takes what is too wide from the widest columns, and from none what it needs at least."""
        columns = self.made.columns
        most = [
            max((cell_len(x) for c in (k.header, *k.cells) for x in str(c).splitlines()), default=0)
            for k in columns
        ]
        room = options.max_width - self._measured(console, options).minimum
        room += sum(k.min_width for k in columns)
        widths = most
        for level in range(max(most, default=0), 0, -1):
            widths = [max(k.min_width, min(m, level)) for k, m in zip(columns, most, strict=True)]
            if sum(widths) <= room:
                break
        for column, width in zip(columns, widths, strict=True):
            column.width = width

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        if self.plainer and not self._fits(console, options):
            yield self.plainer
            return
        if self.listed and self._measured(console, options).maximum > options.max_width:
            self._one_a_line()
        if not self._fits(console, options):
            for column in self.made.columns:
                column.no_wrap &= column.justify != "left"
            self._set_least(self.listed)
        if not self._fits(console, options):
            self._set_least()
        if self._fits(console, options):
            if self._measured(console, options).maximum > options.max_width:
                self._share_out(console, options)
            yield self.made
            if self.caption:
                yield from self._below()
            return
        if self.made.title:
            yield Text(str(self.made.title), "bold")
        heads = [" ".join(str(column.header).split()) for column in self.made.columns]
        for row in zip(*(column.cells for column in self.made.columns), strict=True):
            named = zip(heads, row, strict=True)
            told = [Text.assemble((f"{head} ", "dim"), c) for head, c in named if str(c).strip()]
            yield Text("; ").join(told)
        yield from self._below()

    def _below(self) -> RenderResult:
        if self.caption:
            yield Text(str(self.caption), "dim")
        yield Text()


class AsManyAsFit:
    """Rows, as many of them as the terminal has lines for.

    Args:
        count: of all.
        made: gives what is shown of so many of them, and a word on the others.
    """

    def __init__(self, count: int, made: Callable[[int], RenderableType]) -> None:
        self.count, self.made = count, made

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        def lines(shown: int) -> int:
            return len(console.render_lines(self.made(shown), options, pad=False))

        if lines(min(self.count, console.height + 1)) <= console.height:
            yield self.made(self.count)
            return
        few = range(min(self.count, console.height))  # each has a line or more
        yield self.made(max(0, bisect_right(few, console.height, key=lines) - 1))


def progress_bar(counted: bool = True) -> Progress:
    """Work done and time left, on stderr if that is a terminal; gone when the work is done.

    Args:
        counted: says how many are done of how many; else per cent.
    """
    done = MofNCompleteColumn if counted else TaskProgressColumn
    columns = [SpinnerColumn(), _words(), done(table_column=_whole())]
    if PlainConsole(stderr=True).width >= BAR_FROM:
        columns.insert(2, BarColumn(bar_width=None, table_column=Column(max_width=40)))
        columns.append(TimeElapsedColumn(table_column=_whole()))
    left = TextColumn("left", table_column=_whole())
    return _shown([*columns, left, TimeRemainingColumn(table_column=_whole())])


def progress_words(transient: bool = True) -> Progress:
    """Progress display of the task under way and its time, on stderr if that is a terminal.

    Args:
        transient: it is gone when the work is done.
    """
    columns = [SpinnerColumn(), _words(), TimeElapsedColumn(table_column=_whole())]
    return _shown(columns, transient)


def _shown(columns: list[ProgressColumn], transient: bool = True) -> Progress:
    console = PlainConsole(stderr=True)
    return Progress(*columns, console=console, transient=transient, disable=not console.is_terminal)


def _words() -> TextColumn:
    """Column for the task under way; it wraps."""
    return TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))


def _whole() -> Column:
    """Column for numbers, which do not wrap."""
    return Column(no_wrap=True)
