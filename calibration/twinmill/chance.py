# SPDX-License-Identifier: Apache-2.0
"""Quantiles and tails of the usual distributions, as numbers.

`scipy.stats` has them, too, and takes half a second to import; these are the functions below it.
"""

import numpy as np
from scipy import special

LOG_ROOT_TWO_PI = np.log(np.sqrt(2 * np.pi))


def t_quantile(share: float, free: float) -> float:
    """Quantile of Student's t with so many degrees of freedom."""
    return float(special.stdtrit(free, share))


def t_above(value: float, free: float) -> float:
    """Chance that Student's t is larger."""
    return float(special.stdtr(free, -value))


def f_above(value: float, free: float, free_below: float) -> float:
    """Chance that the ratio of two variances (Fisher's F) is larger."""
    return float(special.fdtrc(free, free_below, max(value, 0.0)))


def chi2_above(value: float, free: float) -> float:
    """Chance that chi squared is larger."""
    return float(special.chdtrc(free, max(value, 0.0)))


def chi2_median(free: float) -> float:
    """Median of chi squared."""
    return float(special.chdtri(free, 0.5))


def normal_log_density(
    value: np.ndarray | float, mean: np.ndarray | float, std: np.ndarray | float
) -> np.ndarray:
    """Log density of normal distributions, of the shape that the three broadcast to."""
    return np.asarray(-(((value - mean) / std) ** 2) / 2.0 - LOG_ROOT_TWO_PI - np.log(std))
