# SPDX-License-Identifier: Apache-2.0
"""Tables in terminals of any width: no word of them is cut."""

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

MOST_WIDE = 1000  # columns that no terminal has


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
