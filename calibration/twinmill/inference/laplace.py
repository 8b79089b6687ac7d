# SPDX-License-Identifier: Apache-2.0
"""Evidence of a likelihood that is known by its values alone (Laplace's method).

About its best numbers x the log likelihood L is a parabola with slope g and curvature H; numbers
have independent normal priors p with mean m and standard deviations S, within bounds:

    log Z = L/d + log p(x) + q' A^-1 q / 2 + log|2 pi A^-1| / 2 + log c
    A = H/d + S^-2        q = g/d - S^-2 (x - m)

The slope q vanishes at a mode within bounds, but not at a bound beyond which the likelihood still
rises, nor where x was fitted before the dispersion d was known. c is the share of each posterior
within bounds, over that of its prior: the factor 2 of half a normal prior is such a share. (Tierney
and Kadane 1986, JASA 81, 82; d divides the log likelihood of what scatters more than a model says:
McCullagh and Nelder 1989, 4.5; Pauli, Racugno and Ventura 2011, Statistica Sinica 21, 149.)
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

FALL = 1.0  # of the log likelihood on both sides together, at least: less may be grain ...
STEEP = 4.0  # ... and this at most: farther away it may be no parabola
STEP, STEPS = 0.1, 8  # first step, times the usual strength, and halvings or doublings of it
FAR, NODES = 10.0, 2001  # reach in widths, and nodes, over which moments of a posterior are summed
BOUND = 1e-3  # times the prior's width: nearer a number is at its bound

Separate = Callable[[np.ndarray, Collection[int] | None], np.ndarray]


@dataclass(frozen=True)
class Prior:
    """Independent normal distributions of P numbers within bounds.

    Attributes:
        mean, std, low, high, unit: (P,) of each, and its usual strength.
        shows: for each, the parts of the likelihood that it changes.
    """

    mean: np.ndarray
    std: np.ndarray
    low: np.ndarray
    high: np.ndarray
    unit: np.ndarray
    shows: Sequence[set[int]]

    def log_within(self, mean: np.ndarray, std: np.ndarray) -> np.ndarray:
        """(P,) log share of normal distributions within the bounds."""
        low, high = (self.low - mean) / std, (self.high - mean) / std
        low, high = np.where(low > 0, -high, low), np.where(low > 0, -low, high)
        top = log_ndtr(high)
        return top + np.log1p(-np.exp(log_ndtr(low) - top))


@dataclass(frozen=True)
class Laplace:
    """A log likelihood about the best of P numbers.

    Attributes:
        log_likelihood: there.
        value: (P,) numbers, the mode of the posterior without a dispersion.
        slope: (P,) of the log likelihood, which counts at bounds.
        curvature: (P, P) negative second derivatives.
        prior: of the numbers.
    """

    log_likelihood: float
    value: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    prior: Prior

    def log_evidence(self, dispersion: float = 1.0) -> float:
        """Log of the integral of prior and likelihood, which the dispersion tempers."""
        prior = self.prior
        middle, cov, pull = self._normal(dispersion)
        away = (self.value - prior.mean) / prior.std
        density = -0.5 * away @ away - np.log(prior.std).sum()
        spread = np.sqrt(np.diag(cov))
        within = prior.log_within(middle, spread) - prior.log_within(prior.mean, prior.std)
        volume = 0.5 * pull @ cov @ pull + 0.5 * np.linalg.slogdet(cov)[1]
        return float(self.log_likelihood / dispersion + density + volume + within.sum())

    def posterior(self, dispersion: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """(P,) means and standard deviations of the numbers within their bounds."""
        middle, cov, _ = self._normal(dispersion)
        spread = np.sqrt(np.diag(cov))
        mode = np.clip(middle, self.prior.low, self.prior.high)
        width = FAR * spread / np.maximum(np.abs(middle - mode) / spread, 1)
        low, high = (
            np.maximum(self.prior.low, mode - width),
            np.minimum(self.prior.high, mode + width),
        )
        at = np.linspace(low, high, NODES)
        weight = np.exp(0.5 * ((mode - middle) ** 2 - (at - middle) ** 2) / spread**2)
        weight[[0, -1]] /= 2  # trapezia
        weight /= weight.sum(axis=0)
        mean = (weight * at).sum(axis=0)
        return mean, np.sqrt((weight * (at - mean) ** 2).sum(axis=0))

    def _normal(self, dispersion: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean (P,) and covariance (P, P) without bounds, and slope (P,) at the numbers.

        A number that a bound holds moves no other one.
        """
        prior = self.prior
        back = (self.value - prior.mean) / prior.std**2  # the slope at a mode within bounds
        near = BOUND * prior.std
        held = (self.value > prior.high - near) & (self.slope > back)
        held |= (self.value < prior.low + near) & (self.slope < back)
        alone = np.logical_or.outer(held, held) & ~np.eye(len(held), dtype=bool)
        scale = np.outer(prior.std, prior.std)
        values, axes = np.linalg.eigh(np.where(alone, 0, self.curvature) * scale / dispersion)
        own = axes / (1 + np.maximum(values, 0.0))  # what does not fall tells nothing
        cov = (own @ axes.T) * scale
        pull = np.where(held, self.slope, back) / dispersion - back
        return self.value + cov @ pull, cov, pull


def laplace(
    told: Separate, value: np.ndarray, prior: Prior, known: Laplace | None = None
) -> Laplace:
    """A log likelihood of several parts about the mode of its posterior.

    Steps are as long as the likelihood needs to fall by more than its grain, so that the parabola
    holds where the posterior is.

    Args:
        told: (N,) log likelihood of all parts at (P,) numbers, or of some of them and else 0.
        value: (P,) the mode.
        prior: of the numbers.
        known: slope and curvature of the first of them, if they are known.
    """
    first = len(known.value) if known else 0
    slope, curvature = np.zeros(len(value)), np.zeros((len(value),) * 2)
    if known:
        slope[:first], curvature[:first, :first] = known.slope, known.curvature
    middle, sides = told(value, None), [_sides(told, value, k, prior) for k in range(len(value))]
    for k in range(first, len(value)):
        own = sorted(prior.shows[k])
        (a, up), (b, down) = ((by, (side - middle)[own].sum()) for by, side in sides[k])
        curvature[k, k] = 2 * (up / a - down / b) / (b - a)
        slope[k] = up / a + curvature[k, k] * a / 2
        for j in range(k):
            both = sorted(prior.shows[k] & prior.shows[j])
            mixed = []
            for (a, side), (b, other) in zip(sides[k], sides[j], strict=True):
                moved = value.copy()
                moved[[k, j]] += a, b
                corner = told(moved, both) if both else middle
                mixed.append((corner + middle - side - other)[both].sum() / (a * b))
            curvature[k, j] = curvature[j, k] = -np.mean(mixed)
    return Laplace(float(middle.sum()), value, slope, curvature, prior)


def _sides(
    told: Separate, value: np.ndarray, k: int, prior: Prior
) -> list[tuple[float, np.ndarray]]:
    """Two steps of a number within its bounds, to both sides or to one, and (N,) what they give."""
    own, middle = sorted(prior.shows[k]), told(value, prior.shows[k])
    low, high = prior.low[k] - value[k], prior.high[k] - value[k]
    step = STEP * prior.unit[k]
    found: list[tuple[float, np.ndarray]] = []
    for _ in range(STEPS):
        by = (-step, step)
        if -step < low:
            by = step, 2 * step
        elif step > high:
            by = -step, -2 * step
        found = []
        for offset in by:
            moved = value.copy()
            moved[k] += offset
            found.append((offset, told(moved, prior.shows[k])))
        change = sum(abs((side - middle)[own].sum()) for _, side in found)
        if FALL <= change <= STEEP:
            break
        step = min(2 * step, (high - low) / 2) if change < FALL else step / 2
    return found
