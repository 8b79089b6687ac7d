# SPDX-License-Identifier: Apache-2.0
"""Rows of text cells in a tenth of the memory of lists: one string for each column of many rows."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

ROWS = 8192  # packed together
BETWEEN = "\0"  # no cell holds it: where a file does, it is shown as what no letter is
NO_LETTER = "\ufffd"


class PackedRows(Sequence[list[str]]):
    """A sequence of rows, all as wide; read column by column at best.

    All but the newest rows are packed, by ROWS.
    """

    def __init__(self, rows: Iterable[list[str]] = ()) -> None:
        self._packed: list[tuple[str, ...]] = []
        self._newest: list[list[str]] = []
        self._unpacked: tuple[int, list[list[str]]] = (-1, [])  # number of a part, and its rows
        for row in rows:
            self.append(row)

    def append(self, row: list[str]) -> None:
        """Adds a row at the end."""
        if len(self._newest) > ROWS:
            self._packed.append(tuple(map(_packed, zip(*self._newest[:ROWS], strict=True))))
            del self._newest[:ROWS]
        self._newest.append(row)

    def pop(self) -> list[str]:
        """Takes the last row away."""
        return self._newest.pop()

    def __len__(self) -> int:
        return ROWS * len(self._packed) + len(self._newest)

    def __getitem__(self, k: int) -> list[str]:
        part, within = divmod(int(k) % len(self), ROWS)
        if part >= len(self._packed):
            return self._newest[ROWS * (part - len(self._packed)) + within]
        if self._unpacked[0] != part:
            self._unpacked = part, list(_rows(self._packed[part]))
        return self._unpacked[1][within]

    def __iter__(self) -> Iterator[list[str]]:
        for part in self._packed:
            yield from _rows(part)
        yield from self._newest

    def parts(self, place: int) -> Iterator[list[str]]:
        """Cells of the column at a place, many rows at a time."""
        for part in self._packed:
            yield part[place].split(BETWEEN)
        yield [row[place] for row in self._newest]

    def hold(self, text: str) -> bool:
        """True if any cell holds the text."""
        packed = any(text in column for part in self._packed for column in part)
        return packed or any(text in cell for row in self._newest for cell in row)

    def at(self, index: np.ndarray) -> "PackedRows":
        """The rows at some numbers, which rise."""
        ends = np.searchsorted(index, ROWS * np.arange(len(self._packed) + 1))
        found = PackedRows()
        for part, begin, end in zip(self._packed, ends[:-1], ends[1:], strict=True):
            if end > begin:
                rows = list(_rows(part))
                for k in (index[begin:end] % ROWS).tolist():
                    found.append(rows[k])
        for k in (index[ends[-1] :] - ROWS * len(self._packed)).tolist():
            found.append(self._newest[k])
        return found

    def rearranged(self, columns: Sequence[int | str]) -> "PackedRows":
        """Rows with other columns: by their places, or a text that all rows hold."""
        found = PackedRows()
        whole = [_packed([c] * ROWS) if isinstance(c, str) else "" for c in columns]
        found._packed = [
            tuple(w or part[c] for w, c in zip(whole, columns, strict=True))
            for part in self._packed
        ]
        found._newest = [
            [c if isinstance(c, str) else row[c] for c in columns] for row in self._newest
        ]
        return found

    def changed(self, change: Callable[[str], str]) -> "PackedRows":
        """Rows with a change applied to each cell."""
        return PackedRows([change(cell) for cell in row] for row in self)


def _packed(cells: Sequence[str]) -> str:
    text = BETWEEN.join(cells)
    if text.count(BETWEEN) < len(cells):
        return text
    return BETWEEN.join(cell.replace(BETWEEN, NO_LETTER) for cell in cells)


def _rows(part: tuple[str, ...]) -> Iterator[list[str]]:
    return map(list, zip(*(column.split(BETWEEN) for column in part), strict=True))
