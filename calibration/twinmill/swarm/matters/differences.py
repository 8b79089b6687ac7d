# SPDX-License-Identifier: Apache-2.0
"""Differences between runs of two models with the same seeds."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest, bootstrap

RESAMPLES = 1000


@dataclass(frozen=True)
class Difference:
    """One number of the swarm before and after a change.

    Attributes:
        before, after: shares, or medians over runs; NaN where no run has one.
        low, high: interval of after minus before.
    """

    before: float
    after: float
    low: float
    high: float

    @property
    def change(self) -> float:
        """Value after the change less the value before, in the unit of both."""
        return self.after - self.before

    def to_json(self) -> dict[str, Any]:
        """Its fields and the change."""
        return {**vars(self), "change": self.change}


def share_difference(before: np.ndarray, after: np.ndarray, level: float = 0.95) -> Difference:
    """Difference of two shares over the same seeds.

    The interval is that of Newcombe 1998 (Statistics in Medicine 17:2635, method 10): Wilson's
    intervals of both shares, joined by how the pairs go together.

    Args:
        before: (S,) whether each run got there.
        after: (S,) the same after the change.
        level: of the interval.
    """
    n = len(before)
    p, q = before.mean(), after.mean()
    (p_low, p_high), (q_low, q_high) = (_wilson(x, level) for x in (before, after))
    both, neither = np.sum(before & after), np.sum(~before & ~after)
    lost, won = np.sum(before & ~after), np.sum(~before & after)
    margins = float(both + lost) * (won + neither) * (both + won) * (lost + neither)
    apart = float(both * neither - lost * won)
    if apart > 0:
        apart = max(apart - n / 2, 0.0)
    phi = apart / np.sqrt(margins) if margins > 0 else 0.0
    change = float(q - p)
    below = (q - q_low) ** 2 - 2 * phi * (q - q_low) * (p_high - p) + (p_high - p) ** 2
    above = (q_high - q) ** 2 - 2 * phi * (q_high - q) * (p - p_low) + (p - p_low) ** 2
    return Difference(
        float(p), float(q), change - float(np.sqrt(below)), change + float(np.sqrt(above))
    )


def _wilson(hits: np.ndarray, level: float) -> tuple[float, float]:
    interval = binomtest(int(hits.sum()), len(hits)).proportion_ci(level, method="wilson")
    return float(interval.low), float(interval.high)


def median_difference(before: np.ndarray, after: np.ndarray, seed: int) -> Difference:
    """Difference of two medians over equal seeds, runs without a value left out of both.

    The interval is the percentile one of a bootstrap over pairs (Efron 1979).

    Args:
        before: (S,) values, NaN where a run has none.
        after: (S,) the same after the change.
        seed: of the resampling.
    """
    both = np.isfinite(before) & np.isfinite(after)
    if both.sum() < 2:
        return Difference(np.nan, np.nan, np.nan, np.nan)
    a, b = before[both], after[both]
    found = bootstrap(
        (a, b),
        lambda x, y, axis: np.median(y, axis=axis) - np.median(x, axis=axis),
        n_resamples=RESAMPLES,
        paired=True,
        vectorized=True,
        method="percentile",
        rng=seed,
    ).confidence_interval
    return Difference(float(np.median(a)), float(np.median(b)), float(found.low), float(found.high))
