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

from twinmill.fitting.settings import FLOOR_SETTINGS

LADDER = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0)  # ridges over a group's mean square


@dataclass(frozen=True)
class Parts:
    """Which of R rows lie in each of K parts.

    Attributes:
        inside: (R,) part of each row.
        ends, begins: (R,) other parts that a row touches.
        count: K.
    """

    inside: np.ndarray
    ends: np.ndarray
    begins: np.ndarray
    count: int

    @staticmethod
    def joined(parts: Sequence["Parts"]) -> "Parts":
        """Of rows one after the other."""
        inside, ends, begins = (
            np.concatenate([getattr(p, key) for p in parts]) for key in ("inside", "ends", "begins")
        )
        return Parts(inside, ends, begins, parts[0].count)

    def at(self, rows: np.ndarray) -> "Parts":
        """Of these rows alone."""
        return Parts(self.inside[rows], self.ends[rows], self.begins[rows], self.count)

    @cached_property
    def slices(self) -> list[slice]:
        """Of each part, where rows are in the order of their parts."""
        edges = np.searchsorted(self.inside, np.arange(self.count + 1))
        return [slice(a, b) for a, b in pairwise(edges)]

    @cached_property
    def neighbours(self) -> list[np.ndarray]:
        """Numbers of the rows beside each part."""
        return [np.flatnonzero(self.beside(k)) for k in range(self.count)]

    def beside(self, k: int) -> np.ndarray:
        """(R,) bool: rows of other parts that touch part k."""
        return ((self.begins == k) | (self.ends == k)) & (self.inside != k)


class Learner:
    """One group of features, ready to be fitted to any wanted values.

    Args:
        x: (R, F) rows.
        parts: of the rows, which are in order of the part that they are inside.
        inside, beside: (K, F, F) products of the rows inside each part, and beside it.
    """

    def __init__(self, x: np.ndarray, parts: Parts, inside: np.ndarray, beside: np.ndarray) -> None:
        self.x = x.astype(np.float32)
        self.within, self.beside = parts.slices, parts.neighbours
        self.x_beside = [self.x[k] for k in self.beside]
        self.total = inside.sum(axis=0)
        self.mean = max(float(np.diag(self.total).mean()), 1e-30)
        values, self.vectors = np.linalg.eigh(self.total - inside - beside)
        self.values = np.maximum(values, 0.0)
        self.inside = self.vectors.transpose(0, 2, 1) @ inside @ self.vectors

    @classmethod
    def each(cls, x: np.ndarray, parts: Parts, groups: Iterable[np.ndarray]) -> Iterator["Learner"]:
        """One of each group of columns of (R, F) rows: products of all are quicker at once."""
        inside, beside = (
            np.array([own.T @ own for own in (x[k] for k in rows)])
            for rows in (parts.slices, parts.neighbours)
        )
        for own in groups:
            yield cls(x[:, own], parts, *(gram[:, own[:, None], own] for gram in (inside, beside)))

    def gain(self, wanted: np.ndarray) -> tuple[float, float]:
        """By how much the squared error on left-out parts falls at the best ridge; that ridge."""
        push, pull = self._moments(wanted)
        rise = self.mean * np.array(LADDER)[:, None, None]
        beta = (pull / (self.values + rise)).transpose(1, 0, 2)  # (K, ridges, F)
        falls = np.sum(beta * (2 * push[:, None] - beta @ self.inside), axis=(0, 2))
        best = int(np.argmax(falls))
        return float(falls[best]), LADDER[best]

    def fitted(self, wanted: np.ndarray, ridge: float) -> np.ndarray:
        """(K, F) coefficients without each part."""
        _, pull = self._moments(wanted)
        return np.einsum("kfg,kg->kf", self.vectors, pull / (self.values + self.mean * ridge))

    def left(self, wanted: np.ndarray, each: np.ndarray) -> np.ndarray:
        """(R,) what the fits without each part leave of its rows."""
        made = [self.x[own] @ one for own, one in zip(self.within, each, strict=True)]
        return wanted - np.concatenate(made)

    def _moments(self, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K, F) of the rows of each part, and of those that do not touch it, by eigenvectors."""
        inside = np.array([wanted[k] @ self.x[k] for k in self.within])
        beside = np.array([wanted[k] @ x for k, x in zip(self.beside, self.x_beside, strict=True)])
        both = np.stack([inside, inside.sum(axis=0) - inside - beside], axis=1)
        push, pull = (both @ self.vectors).transpose(1, 0, 2)
        return push, pull


def boosted(
    learners: Sequence[Learner], wanted: np.ndarray, independent: float
) -> Iterator[tuple[int, float]]:
    """Number and ridge of each group taken, in order.

    Args:
        learners: of the same rows.
        wanted: (R,) values.
        independent: how many of the values are. The best of so many groups takes about
            2 ln(groups) / independent of an error that is noise: below twice that nothing is taken.
    """
    by_chance = np.log(max(len(learners), 1)) / independent
    least = max(FLOOR_SETTINGS.group_worth, FLOOR_SETTINGS.group_chance * by_chance)
    wanted = wanted.astype(np.float32)
    if not learners:
        return
    for _ in range(FLOOR_SETTINGS.most_groups):
        gains = [learner.gain(wanted) for learner in learners]
        best = int(np.argmax([fall for fall, _ in gains]))
        if gains[best][0] < least * float(wanted @ wanted):
            return
        each = learners[best].fitted(wanted, gains[best][1])
        wanted = learners[best].left(wanted, each).astype(np.float32)
        yield best, gains[best][1]
