# SPDX-License-Identifier: Apache-2.0
"""Test whether a model's errors remember what noise alone would not.

A Monte Carlo test (Davison and Hinkley 1997, Bootstrap Methods, ch. 4): correlations of the errors
against those of draws of the noise, whose own memory and ways to enter a prediction are in these.
"""

import numpy as np

HORIZON = 1  # place of 0.2 s among the horizons: the longest whose windows do not overlap
LAGS = 4  # starts 0.25 s apart: over 1 s, the middle of the horizons


def memory(errors: np.ndarray) -> np.ndarray:
    """(F,) correlations of errors with earlier ones of the same channel.

    Of the first 0.2 s of a prediction with those that begin up to 1 s before, and within
    predictions of what each horizon adds with what the one before it has added.

    Args:
        errors: (W, H, 3); NaN where not judged.
    """
    added = np.diff(errors, axis=1, prepend=0.0)
    first = errors[:, HORIZON]
    across = [_correlation(first[lag:], first[:-lag]) for lag in range(1, LAGS + 1)]
    within = [_correlation(added[:, h], added[:, h - 1]) for h in range(1, added.shape[1])]
    return np.concatenate([*across, *within])


def p_value(found: np.ndarray, of_noise: np.ndarray) -> float:
    """Probability that noise alone would cause correlations as far off; NaN without draws.

    Args:
        found: (F,) of a model's errors.
        of_noise: (N, F) of draws.
    """
    if not len(of_noise):
        return float("nan")
    pool = np.concatenate([of_noise, found[None]])
    spread = pool.std(axis=0)
    off = ((pool - pool.mean(axis=0)) / np.where(spread > 0, spread, 1.0)) ** 2
    statistic = off.sum(axis=1)
    return float(np.mean(statistic >= statistic[-1]))


def _correlation(later: np.ndarray, earlier: np.ndarray) -> np.ndarray:
    """(3,) of pairs of errors (P, 3); 0 where there is nothing."""
    seen = np.isfinite(later) & np.isfinite(earlier)
    a, b = (np.where(seen, e, 0.0) for e in (later, earlier))
    size = np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0))
    return (a * b).sum(axis=0) / np.where(size > 0, size, 1.0)
