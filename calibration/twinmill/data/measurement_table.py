# SPDX-License-Identifier: Apache-2.0
"""Text tables of measurements, turned to numbers with errors that name the row."""

import csv
import difflib
import gzip
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TextIO

import numpy as np
import rich.progress
from rich.console import Console

from twinmill.data.log import LogError


@contextmanager
def open_text(path: Path) -> Iterator[TextIO]:
    """Opens a text file, `.gz` too; on a terminal with a progress bar.

    Raises:
        LogError: it cannot be read, is no text, or ends in `.gz` and is not gzip.
    """
    try:
        with rich.progress.open(
            path,
            "rb",
            description=path.name,
            transient=True,
            console=Console(stderr=True),
            disable=not sys.stderr.isatty(),
        ) as raw:
            binary = gzip.GzipFile(fileobj=raw) if path.suffix == ".gz" else raw
            yield io.TextIOWrapper(binary, encoding="utf-8-sig", newline="")
    except (OSError, EOFError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise LogError(
            f"{path}: cannot be read as text ({reason}); check the name and the format."
        ) from error


@dataclass(frozen=True)
class Table:
    """Cells of a file with one header row; row k is line `line[k]` of the file."""

    name: str
    header: list[str]
    rows: list[list[str]]
    line: list[int]
    known: frozenset[str]  # columns that have a meaning: never proposed for renaming
    factor: dict[str, float] = field(default_factory=dict)  # of columns in another unit

    def under(self, sources: dict, flips: frozenset[str]) -> "Table":
        """The same cells under other names and in other units; columns that nobody names stay."""
        place = {name: k for k, name in enumerate(self.header)}
        taken = {source.column for source in sources.values()}
        rest = [name for name in self.header if name not in taken and name not in sources]
        rows = [
            [
                *(
                    row[place[s.column]] if s.column else repr(float(s.value))
                    for s in sources.values()
                ),
                *(row[place[name]] for name in rest),
            ]
            for row in self.rows
        ]
        factor = {
            name: source.factor * (-1 if name in flips else 1) for name, source in sources.items()
        }
        return replace(self, header=[*sources, *rest], rows=rows, factor=factor)

    def has(self, *columns: str) -> bool:
        """Whether all these columns are there."""
        return set(columns) <= set(self.header)

    @property
    def strange(self) -> list[str]:
        """Columns without a meaning."""
        return [name for name in self.header if name not in self.known]

    def numbers(self, column: str, empty_is_nan: bool = False) -> np.ndarray:
        """(rows,) floats of a column.

        Args:
            column: its name.
            empty_is_nan: take empty cells for lost measurements.

        Raises:
            LogError: the column is missing, or a cell is no number (its row is named).
        """
        if column not in self.header:
            raise self.missing(column)
        place = self.header.index(column)
        cells = [row[place].strip() for row in self.rows]
        if empty_is_nan:
            cells = [cell or "nan" for cell in cells]
        try:
            return np.array([float(cell) for cell in cells]) * self.factor.get(column, 1.0)
        except ValueError:
            bad = next(k for k, cell in enumerate(cells) if not _is_number(cell))
            raise LogError(
                f"{self.name}: row {self.line[bad]}: {column} is '{cells[bad]}', not a "
                "number; correct or remove the row."
            ) from None

    def finite(self, column: str) -> np.ndarray:
        """Like numbers, but NaN and infinity are errors too."""
        values = self.numbers(column)
        self.refuse(~np.isfinite(values), column, values, "must be a finite number")
        return values

    def refuse(self, bad: np.ndarray, column: str, values: np.ndarray, why: str) -> None:
        """Raises LogError on the first row that is bad, with its value and why."""
        if bad.any():
            k = int(np.argmax(bad))
            raise LogError(
                f"{self.name}: row {self.line[k]}: {column} is {values[k]:g}, but "
                f"{why}; correct or remove the row."
            )

    def missing(self, column: str) -> LogError:
        """The error to raise where this column is needed and not there."""
        near = difflib.get_close_matches(column, self.strange, n=1, cutoff=0.0)
        if not near:
            return LogError(f"{self.name}: column {column} is missing; add it.")
        return LogError(
            f"{self.name}: column {column} is missing (nearest is '{near[0]}'); rename "
            f"it in the file or with --rename {near[0]}={column}."
        )


def read_table(path: Path, rename: dict[str, str], known: frozenset[str]) -> Table:
    """Reads a CSV file with one header row.

    Args:
        path: of the file, `.gz` too.
        rename: column in the file to column as we name it.
        known: all columns that have a meaning.

    Raises:
        LogError: unreadable, empty or ragged.
    """
    with open_text(path) as text:
        reader = csv.reader(text)
        header = [rename.get(cell.strip(), cell.strip()) for cell in next(reader, [])]
        rows, line = [], []
        for row in reader:
            if not any(cell.strip() for cell in row):
                continue
            if len(row) != len(header):
                raise LogError(
                    f"{path.name}: row {reader.line_num}: has {len(row)} cells, but the "
                    f"header has {len(header)}; correct or remove the row."
                )
            rows.append(row)
            line.append(reader.line_num)
    if not rows:
        raise LogError(
            f"{path.name}: has no rows of numbers, so there is nothing to import; check "
            "that the export worked."
        )
    return Table(path.name, header, rows, line, known)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
