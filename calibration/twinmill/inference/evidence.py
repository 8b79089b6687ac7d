# SPDX-License-Identifier: Apache-2.0
"""Marginal likelihood of linear Gaussian models, alone and with a discrepancy.

    y = x' d + f' w + e,   d ~ N(0, 1),   w ~ N(0, size^2),   e ~ N(0, 1)

All columns are whitened and scaled by the standard deviation of their prior. Constants that all
models share are left out. Rasmussen and Williams 2006, chapters 2.7 and 5.4.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrs


def log_evidence(y: np.ndarray, x: np.ndarray) -> float:
    """Log marginal likelihood of y (R,) with columns x (P, R)."""
    return Linear.of(y, x).log_evidence


def _root(x: np.ndarray) -> np.ndarray:
    """(P, P) Cholesky factor of 1 + x x'."""
    try:
        return np.linalg.cholesky(_with_prior(x @ x.T))
    except np.linalg.LinAlgError:  # columns so large and alike that squares of them hide the 1
        upper = np.linalg.qr(np.concatenate([np.eye(len(x)), x.T]), mode="r")
        return (upper * np.sign(np.diag(upper))[:, None]).T


def _with_prior(gram: np.ndarray) -> np.ndarray:
    gram[np.diag_indices_from(gram)] += 1.0
    return gram


@dataclass(frozen=True)
class Linear:
    """A linear model that was conditioned on its data.

    Attributes:
        y: (R,) data.
        x: (P, R) columns.
        low: (P, P) Cholesky factor of 1 + x x'.
        half: (P,) low^-1 x y.
    """

    y: np.ndarray
    x: np.ndarray
    low: np.ndarray
    half: np.ndarray

    @classmethod
    def of(cls, y: np.ndarray, x: np.ndarray) -> "Linear":
        """Conditions a model on y (R,) with columns x (P, R)."""
        low = _root(x)
        return cls(y, x, low, solve_triangular(low, x @ y, lower=True))

    @cached_property
    def basis(self) -> np.ndarray:
        """(P, R) columns made orthogonal, with the prior taken in: low^-1 x."""
        return solve_triangular(self.low, self.x, lower=True)

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood."""
        return -0.5 * self.left - float(np.log(np.diag(self.low)).sum())

    @property
    def left(self) -> float:
        """Squares of y under the marginal covariance: what is left beside the penalty of d."""
        return float(self.y @ self.y - self.half @ self.half)

    @property
    def mean(self) -> np.ndarray:
        """(P,) posterior mean of d."""
        return solve_triangular(self.low, self.half, lower=True, trans=1)

    @property
    def covariance(self) -> np.ndarray:
        """(P, P) posterior covariance of d."""
        inverse = np.linalg.inv(self.low)
        return inverse.T @ inverse

    @cached_property
    def residuals(self) -> np.ndarray:
        """(R,) y less the posterior mean's prediction."""
        return self.y - self.mean @ self.x

    def with_columns(self, more: np.ndarray) -> "Linear":
        """The model with more columns (K, R); itself with none."""
        if not len(more):
            return self
        x, cross = np.concatenate([self.x, more]), more @ self.basis.T
        try:
            own = np.linalg.cholesky(_with_prior(more @ more.T - cross @ cross.T))
        except np.linalg.LinAlgError:
            return Linear.of(self.y, x)
        low = np.block([[self.low, np.zeros_like(cross.T)], [cross, own]])
        push = more @ self.y - cross @ self.half
        return Linear(self.y, x, low, np.r_[self.half, solve_triangular(own, push, lower=True)])

    def projected(self, columns: np.ndarray, gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix (K, K) and products with y (K,) of columns, once d has taken its part."""
        cross = columns @ self.basis.T
        return gram - cross @ cross.T, columns @ self.y - cross @ self.half

    def log_densities(self, block: np.ndarray) -> np.ndarray:
        """(B,) log density of the residuals in each block; `block` (R,) numbers them from 0."""
        return -0.5 * np.bincount(block, self.residuals**2)


def gains_by_size(gram: np.ndarray, push: np.ndarray, sizes) -> tuple[np.ndarray, np.ndarray]:
    """Gain in log evidence by w ~ N(0, size^2), for each size, and the fall of the squares.

    Args:
        gram: (K, K) of the projected columns.
        push: (K,) their products with y.
        sizes: (S,).
    """
    size2, diagonal = np.square(sizes), np.diag_indices(len(gram))
    each = size2[:, None, None] * gram
    each[:, *diagonal] += 1.0
    low = np.linalg.cholesky(each)
    solved = np.array([dpotrs(factor.T, push)[0] for factor in low])
    along = solved @ push
    gains = 0.5 * size2 * along - np.log(np.diagonal(low, axis1=1, axis2=2)).sum(axis=1)
    return gains, size2 * (along + (solved**2).sum(axis=1))
