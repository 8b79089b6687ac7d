# SPDX-License-Identifier: Apache-2.0
"""Componentwise boosting: ridge regressions of one group of features each, added one at a time.

In each round every group is fitted to what is left, without each part of the data, and the one that
lowers the error on the parts left out most is taken (Buhlmann and Yu 2003; groups as in Tutz and
Binder 2006). It ends where none lowers that error by what is worth it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.fitting.settings import FLOOR_SETTINGS

LADDER = np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0])  # ridges over a group's mean square


@dataclass(frozen=True)
class Parts:
    """Which of R rows lie in each of K parts, and which touch it from another.

    Rows that are inside one part and touch the same others are a cell: what is summed over the rows
    of each cell gives the sums over all rows inside a part, and over all that do not touch it.

    Attributes:
        inside: (R,) part of each row.
        ends, begins: (R,) other parts that a row touches.
        count: K.
    """

    inside: np.ndarray
    ends: np.ndarray
    begins: np.ndarray
    count: int

    @property
    def order(self) -> np.ndarray:
        """(R,) rows cell by cell, and part by part."""
        return np.lexsort((self.begins, self.ends, self.inside))

    def at(self, rows: np.ndarray) -> "Parts":
        """Parts of these rows alone."""
        return Parts(self.inside[rows], self.ends[rows], self.begins[rows], self.count)

    @cached_property
    def slices(self) -> list[slice]:
        """Slice of each part, where rows are in order."""
        edges = np.searchsorted(self.inside, np.arange(self.count + 1))
        return [slice(a, b) for a, b in pairwise(edges)]

    @cached_property
    def cells(self) -> list[slice]:
        """Slice of each of S cells, where rows are in order."""
        same = np.column_stack([self.inside, self.ends, self.begins])
        changes = np.flatnonzero((same[1:] != same[:-1]).any(axis=1)) + 1
        return [slice(a, b) for a, b in pairwise([0, *changes, len(same)])]

    @cached_property
    def _owners(self) -> np.ndarray:
        """(2 K, S): 1 where a cell is inside a part, and where it neither is nor touches it."""
        first = np.array([cell.start for cell in self.cells])
        own = [of[first] == np.arange(self.count)[:, None] for of in self._names]
        return np.vstack([own[0], ~(own[0] | own[1] | own[2])]).astype(float)

    @property
    def _names(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.inside, self.ends, self.begins

    def summed(self, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K, ...) of (S, ...) sums over cells: inside each part, and of all apart from it."""
        flat = self._owners @ cells.reshape(len(cells), -1)
        both = flat.reshape(-1, *cells.shape[1:])
        return both[: self.count], both[self.count :]


def squares(x: np.ndarray, parts: Sequence[slice]) -> np.ndarray:
    """(S, F, F) products of (R, F) columns with each other, over the rows of each part.

    All into one array: one after the other in arrays of their own takes twice the time.
    """
    found = np.empty((len(parts), x.shape[1], x.shape[1]))
    for own, rows in zip(found, parts, strict=True):
        np.matmul(x[rows].T, x[rows], out=own)
    return found


class _Alike:
    """Groups of as many features each, ready to be fitted to any wanted values.

    Args:
        numbers: (L,) of the groups.
        columns: (L, F) of each among all features.
        inside, others: (K, L, F, F) products of the rows inside each part, and of those that do not
            touch it.
    """

    def __init__(
        self, numbers: np.ndarray, columns: np.ndarray, inside: np.ndarray, others: np.ndarray
    ) -> None:
        self.numbers, self.columns, self.inside, self.others = numbers, columns, inside, others
        self.mean = np.maximum(np.einsum("klff->l", inside) / columns.shape[1], 1e-30)

    @classmethod
    def joined(cls, some: Sequence[tuple[np.ndarray, ...]]) -> "_Alike":
        """Joins the products of all batches of features."""
        numbers, columns, *products = zip(*some, strict=True)
        gathered = [np.concatenate(own, axis=1) for own in products]
        return cls(np.concatenate(numbers), np.concatenate(columns), *gathered)

    def gains(self, push: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """(L, ridges) by how much each lowers the squared error on left-out parts.

        Args:
            push: (K, all features) moments of the rows inside each part.
            pull: of those that do not touch it.
        """
        beta = at_ridges(self.others, self.mean[:, None] * LADDER, pull[:, self.columns])
        left = 2 * push[:, self.columns][:, :, None] - beta @ self.inside
        return np.einsum("klrf,klrf->lr", beta, left)

    def fitted(self, k: int, pull: np.ndarray, ridge: float) -> np.ndarray:
        """(K, F) coefficients of the k-th without each part."""
        rise = self.mean[k] * np.array([ridge])
        return at_ridges(self.others[:, k], rise, pull[:, self.columns[k]])[:, 0]


def at_ridges(grams: np.ndarray, ridges: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """(..., V, F) coefficients by (..., F, F) products, (..., F) moments, at ridges (..., V)."""
    *each, count = moments.shape
    rises = np.broadcast_to(ridges, (*each, ridges.shape[-1])).reshape(-1, ridges.shape[-1])
    found = native.solved_risen(
        np.ascontiguousarray(grams).reshape(-1, count, count),
        np.ascontiguousarray(rises),
        np.ascontiguousarray(moments).reshape(-1, count),
    )
    return found.reshape(*each, -1, count)


class Learners:
    """Groups of features of the same rows.

    Args:
        batches: (R, f) rows of some features, in order of the parts, and the columns of each group
            among them.
        parts: of the rows.
    """

    def __init__(
        self, batches: Iterable[tuple[np.ndarray, Sequence[np.ndarray]]], parts: Parts
    ) -> None:
        self.parts = parts
        self._rows: list[np.ndarray] = []
        self._places: list[tuple[int, np.ndarray]] = []  # of each group: its batch, columns there
        found: dict[int, list[tuple[np.ndarray, ...]]] = {}
        first = 0
        for x, groups in batches:
            grams = parts.summed(squares(x, parts.cells))
            for width in dict.fromkeys(map(len, groups)):
                alike = np.flatnonzero([len(own) == width for own in groups])
                own = np.array([groups[k] for k in alike.tolist()])
                products = (gram[:, own[:, :, None], own[:, None]] for gram in grams)
                found.setdefault(width, []).append((len(self) + alike, first + own, *products))
            self._places += [(len(self._rows), own) for own in groups]
            self._rows.append(x.astype(np.float32))
            first += x.shape[1]
        self._alike = [_Alike.joined(some) for some in found.values()]

    def __len__(self) -> int:
        return len(self._places)

    def best(self, wanted: np.ndarray) -> tuple[float, int, float, np.ndarray]:
        """Best group: the one that lowers the squared error on left-out parts most.

        Returns:
            By how much, its number, its best ridge, and its (K, F) coefficients without each part.
        """
        push, pull = self._moments(wanted)
        gains = [own.gains(push, pull) for own in self._alike]
        own, falls = max(zip(self._alike, gains, strict=True), key=lambda pair: pair[1].max())
        k, ridge = np.unravel_index(int(np.argmax(falls)), falls.shape)
        each = own.fitted(int(k), pull, LADDER[ridge])
        return float(falls[k, ridge]), int(own.numbers[k]), float(LADDER[ridge]), each

    def rows_of(self, number: int) -> np.ndarray:
        """(R, F) rows of a group."""
        batch, columns = self._places[number]
        return self._rows[batch][:, columns]

    def left(self, wanted: np.ndarray, number: int, each: np.ndarray) -> np.ndarray:
        """(R,) what a group's fits without each part leave of its rows."""
        x = self.rows_of(number)
        made = [x[own] @ one for own, one in zip(self.parts.slices, each, strict=True)]
        return wanted - np.concatenate(made)

    def _moments(self, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K, all features) of the rows of each part, and of those that do not touch it."""
        batches = [[wanted[k] @ x[k] for k in self.parts.cells] for x in self._rows]
        return self.parts.summed(np.concatenate(batches, axis=1, dtype=float))


def boosted(
    learners: Learners, wanted: np.ndarray, independent: float
) -> Iterator[tuple[int, float, float]]:
    """Number and ridge of each group taken, in order, and how many times beyond chance it is.

    Args:
        learners: of rows.
        wanted: (R,) values of these.
        independent: how many of the values are. The best of so many groups takes about
            2 ln(groups) / independent of an error that is noise: below twice that nothing is taken.
    """
    if not len(learners):
        return
    by_chance = FLOOR_SETTINGS.group_chance * np.log(len(learners)) / independent
    wanted = wanted.astype(np.float32)
    for _ in range(FLOOR_SETTINGS.most_groups):
        fall, number, ridge, each = learners.best(wanted)
        share = fall / max(float(wanted @ wanted), 1e-30)
        if share < max(FLOOR_SETTINGS.group_worth, by_chance):
            return
        wanted = learners.left(wanted, number, each).astype(np.float32)
        yield number, ridge, share / by_chance
