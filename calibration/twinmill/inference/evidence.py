# SPDX-License-Identifier: Apache-2.0
"""Marginal likelihood of linear Gaussian models, alone and with a discrepancy.

    y = x' d + f' w + e,   d ~ N(0, 1),   w ~ N(0, size^2),   e ~ N(0, 1)

All columns are whitened and scaled by the standard deviation of their prior. Constants that all
models share are left out. Rasmussen and Williams 2006, chapters 2.7 and 5.4.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import twinmill_native as native
from scipy.linalg.lapack import dtrtrs

KEPT = 8  # blocks of rows whose products are kept: those of one hypothesis


def log_evidence(y: np.ndarray, x: np.ndarray) -> float:
    """Log marginal likelihood of y (R,) with columns x (P, R)."""
    low = _root(x @ x.T, lambda: x)
    half = _through(low, x @ y)
    return -0.5 * float(y @ y - half @ half) - float(np.log(np.diag(low)).sum())


def _root(gram: np.ndarray, x: Callable[[], np.ndarray]) -> np.ndarray:
    """(P, P) Cholesky factor of 1 + x x', of (P, P) x x' and what makes the columns (P, R)."""
    try:
        return np.linalg.cholesky(gram + np.eye(len(gram)))
    except np.linalg.LinAlgError:  # columns so large and alike that squares of them hide the 1
        upper = np.linalg.qr(np.concatenate([np.eye(len(gram)), x().T]), mode="r")
        return (upper * np.sign(np.diag(upper))[:, None]).T


def _through(low: np.ndarray, right: np.ndarray, transposed: bool = False) -> np.ndarray:
    """Solution of triangular equations, by LAPACK itself: most are small."""
    if not right.size:
        return right
    return dtrtrs(low.T, right, lower=0, trans=0 if transposed else 1)[0].reshape(right.shape)


class Bank:
    """White columns (..., R) that many models are compared with: products with these are kept.

    Models share rows: those of a base's discrepancy are in all of them.
    """

    def __init__(self, columns: np.ndarray) -> None:
        self.columns = columns
        self._flat = columns.reshape(-1, columns.shape[-1])
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def dot(self, rows: np.ndarray) -> np.ndarray:
        """(K, N) products with rows (N, R)."""
        _, found = self._known.pop(id(rows), (None, None))
        if found is None:
            found = self._flat @ rows.T
        self._known[id(rows)] = rows, found  # asked for last
        if len(self._known) > KEPT:
            self._known.pop(next(iter(self._known)))
        return found


@dataclass(frozen=True)
class Columns:
    """Columns (P, R) of a model: the sum of roots (N, P), transposed, times white rows (N, R)."""

    rows: tuple[np.ndarray, ...]
    roots: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, x: np.ndarray) -> "Columns":
        """Columns as they are."""
        return cls((x,), (np.eye(len(x)),))

    @property
    def whole(self) -> np.ndarray:
        """(P, R)."""
        return sum(root.T @ rows for rows, root in zip(self.rows, self.roots, strict=True))

    def __len__(self) -> int:
        return self.roots[0].shape[1]

    def weighted(self, weights: np.ndarray) -> np.ndarray:
        """(R,) sum of the columns with weights (P,)."""
        return sum(
            (root @ weights) @ rows for rows, root in zip(self.rows, self.roots, strict=True)
        )


@dataclass(frozen=True)
class Linear:
    """A linear model that was conditioned on its data.

    Attributes:
        parts: its columns, P of all; the last of the first rows are the data, which no column has.
        low: (P, P) Cholesky factor of 1 + x x'.
        half: (P,) low^-1 x y.
    """

    parts: tuple[Columns, ...]
    low: np.ndarray
    half: np.ndarray

    @classmethod
    def of(cls, y: np.ndarray, x: np.ndarray) -> "Linear":
        """Conditions a model on y (R,) with columns x (P, R)."""
        columns = Columns((np.concatenate([x, y[None]]),), (np.eye(len(x) + 1, len(x)),))
        return cls.of_products(columns, x @ x.T, x @ y)

    @classmethod
    def of_products(cls, columns: Columns, gram: np.ndarray, push: np.ndarray) -> "Linear":
        """Conditions a model whose columns have these products (P, P), and (P,) with y."""
        low = _root(gram, lambda: columns.whole)
        return cls((columns,), low, _through(low, push))

    @property
    def y(self) -> np.ndarray:
        """(R,) data."""
        return self.parts[0].rows[0][-1]

    @property
    def x(self) -> np.ndarray:
        """(P, R) columns."""
        return np.concatenate([part.whole for part in self.parts])

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood."""
        return -0.5 * self.left - float(np.log(np.diag(self.low)).sum())

    @property
    def left(self) -> float:
        """Squares of y under the marginal covariance: what is left beside the penalty of d."""
        return float(self.y @ self.y - self.half @ self.half)

    @cached_property
    def mean(self) -> np.ndarray:
        """(P,) posterior mean of d."""
        return _through(self.low, self.half, transposed=True)

    @property
    def covariance(self) -> np.ndarray:
        """(P, P) posterior covariance of d."""
        inverse = np.linalg.inv(self.low)
        return inverse.T @ inverse

    def stds(self, ways: np.ndarray) -> np.ndarray:
        """(M,) posterior standard deviations of sums of d with weights (M, P)."""
        return np.linalg.norm(_through(self.low, ways.T), axis=0)

    @cached_property
    def residuals(self) -> np.ndarray:
        """(R,) y less the posterior mean's prediction."""
        edges = np.cumsum([len(part) for part in self.parts])[:-1]
        means = np.split(self.mean, edges)
        return self.y - sum(p.weighted(m) for p, m in zip(self.parts, means, strict=True))

    def taken(self, columns: np.ndarray | Bank) -> tuple[np.ndarray, np.ndarray]:
        """(K, P) what d takes of columns (K, R), and (K,) their products with y once it has.

        The first are their products with low^-1 x.
        """
        dot = columns.dot if isinstance(columns, Bank) else lambda rows: columns @ rows.T
        each = [[dot(rows) for rows in part.rows] for part in self.parts]
        products = [
            sum(own @ root for own, root in zip(dots, part.roots, strict=True))
            for dots, part in zip(each, self.parts, strict=True)
        ]
        cross = _through(self.low, np.concatenate(products, axis=1).T).T
        return cross, each[0][0][:, -1] - cross @ self.half

    def with_columns(self, more: np.ndarray) -> "Linear":
        """The model with more columns (K, R); itself with none."""
        if not len(more):
            return self
        cross, push = self.taken(more)
        gram = more @ more.T - cross @ cross.T
        return self.with_projected(Columns.of(more), cross, gram, push)

    def with_projected(
        self, more: Columns, cross: np.ndarray, gram: np.ndarray, push: np.ndarray
    ) -> "Linear":
        """The model with K more columns.

        Args:
            more: the columns.
            cross: (K, P) what d takes of them.
            gram: (K, K) their products, once it has.
            push: (K,) their products with y, once it has.
        """
        parts = *self.parts, more
        try:
            own = np.linalg.cholesky(gram + np.eye(len(gram)))
        except np.linalg.LinAlgError:
            return Linear.of(self.y, np.concatenate([part.whole for part in parts]))
        low = np.block([[self.low, np.zeros_like(cross.T)], [cross, own]])
        return Linear(parts, low, np.r_[self.half, _through(own, push)])

    def projected(self, columns: np.ndarray, gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix (K, K) and products with y (K,) of columns, once d has taken its part."""
        cross, push = self.taken(columns)
        return gram - cross @ cross.T, push

    def log_densities(self, block: np.ndarray) -> np.ndarray:
        """(B,) log density of the residuals in each block; `block` (R,) numbers them from 0."""
        return -0.5 * np.bincount(block, self.residuals**2)


def gains_by_size(
    gram: np.ndarray, push: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gain in log evidence by w ~ N(0, size^2), for each size, and the fall of the squares.

    Args:
        gram: (K, K) of the projected columns.
        push: (K,) their products with y.
        sizes: (S,).
    """
    gains, falls = native.gains_by_size([gram], push, sizes)
    return gains[0], falls[0]
