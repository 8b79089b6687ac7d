# SPDX-License-Identifier: Apache-2.0
"""Tables and progress in terminals of any width: no word or number of them is cut."""

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
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
from rich.table import Column, Table
from rich.text import Text

MOST_WIDE = 1000  # columns that no terminal has
BAR_FROM = 60  # columns of a terminal that has room for more than words and numbers


class Fitting:
    """A table, or where the terminal is too narrow for it, each of its rows in running text.

    Args:
        made: the table; its columns are as wide as their longest word, or cell if they do not wrap.
    """

    def __init__(self, made: Table) -> None:
        self.made = made
        for column in made.columns:
            parts = str.splitlines if column.no_wrap else str.split
            cells = (str(cell) for cell in (column.header, *column.cells))
            column.min_width = max((cell_len(part) for c in cells for part in parts(c)), default=0)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        needed = Measurement.get(console, options.update(max_width=MOST_WIDE), self.made).minimum
        if needed <= options.max_width:
            yield self.made
            return
        if self.made.title:
            yield Text(str(self.made.title), "bold")
        heads = [" ".join(str(column.header).split()) for column in self.made.columns]
        for row in zip(*(column.cells for column in self.made.columns), strict=True):
            named = zip(heads, row, strict=True)
            told = [Text.assemble((f"{head} ", "dim"), c) for head, c in named if str(c).strip()]
            yield Text("; ").join(told)
        if self.made.caption:
            yield Text(str(self.made.caption), "dim")
        yield Text()


def progress_bar(counted: bool = True) -> Progress:
    """Work done and time left, on stderr if that is a terminal; gone when the work is done.

    Args:
        counted: says how many are done of how many; else per cent.
    """
    done = MofNCompleteColumn if counted else TaskProgressColumn
    columns = [SpinnerColumn(), _words(), done(table_column=_whole())]
    if Console(stderr=True).width >= BAR_FROM:
        columns.insert(2, BarColumn(bar_width=None, table_column=Column(max_width=40)))
        columns.append(TimeElapsedColumn(table_column=_whole()))
    left = TextColumn("left", table_column=_whole())
    return _shown([*columns, left, TimeRemainingColumn(table_column=_whole())])


def progress_words(transient: bool = True) -> Progress:
    """What is being done and for how long, on stderr if that is a terminal.

    Args:
        transient: it is gone when the work is done.
    """
    columns = [SpinnerColumn(), _words(), TimeElapsedColumn(table_column=_whole())]
    return _shown(columns, transient)


def _shown(columns: list[ProgressColumn], transient: bool = True) -> Progress:
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=transient, disable=not console.is_terminal)


def _words() -> TextColumn:
    """What is being done; it wraps."""
    return TextColumn("{task.description}", table_column=Column(overflow="fold"))


def _whole() -> Column:
    """Of numbers, which do not wrap."""
    return Column(no_wrap=True)
