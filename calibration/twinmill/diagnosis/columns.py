# SPDX-License-Identifier: Apache-2.0
"""Hundreds of columns over the rows of logs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import numpy as np

NARROW = 64  # columns


@dataclass(frozen=True)
class Columns:
    """T columns of R rows, in pieces.

    All side by side would be a hundred megabytes, which the system clears before it gives them;
    pieces fit into what was used before. Narrow ones are one: to call for the products of each
    would take longer than these do.

    Attributes:
        pieces: (R, t) some after the other.
    """

    pieces: Sequence[np.ndarray]

    @classmethod
    def beside(cls, logs: Iterable[Sequence[np.ndarray]], count: int) -> "Columns":
        """Stacks the rows of several logs, `count` in all; each log has as many pieces.

        Each log's pieces are made once those before are copied, into the memory that they leave.
        """
        pieces: list[np.ndarray] = []
        first = 0
        for own in map(_joined, logs):
            if len(own[0]) == count:
                return cls(own)
            pieces = pieces or [np.empty((count, p.shape[1])) for p in own]
            for whole, part in zip(pieces, own, strict=True):
                whole[first : first + len(part)] = part
            first += len(own[0])
        return cls(pieces)

    @cached_property
    def _place(self) -> np.ndarray:
        """(2, T) piece of each column, and which it is there."""
        widths = [p.shape[1] for p in self.pieces]
        piece = np.repeat(np.arange(len(widths)), widths)
        return np.array([piece, np.concatenate([np.arange(w) for w in widths])])

    def __len__(self) -> int:
        return self._place.shape[1]

    def some(self, wanted: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """(r, k) of rows of these (r,) numbers, or of all, the columns of these (k,) numbers.

        To be read alone: neighbours are not copied.
        """
        piece, place = self._place[:, wanted]
        if (piece == piece[0]).all():
            return self._of_piece(piece[0], place, rows)
        found = np.empty((len(self.pieces[0]) if rows is None else len(rows), len(piece)))
        for n in np.unique(piece):
            own = piece == n
            found[:, own] = self._of_piece(n, place[own], rows)
        return found

    def _of_piece(self, n: int, place: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
        piece = self.pieces[n] if rows is None else self.pieces[n].take(rows, axis=0)
        if (np.diff(place) == 1).all():
            return piece[:, place[0] : place[-1] + 1]
        return piece.take(place, axis=1)


def _joined(pieces: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Pieces with narrow neighbours joined into one."""
    found: list[np.ndarray] = []
    for narrow, some in groupby(pieces, lambda p: p.shape[1] <= NARROW):
        own = [*some]
        found += [np.hstack(own)] if narrow else own
    return found
