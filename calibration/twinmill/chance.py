# SPDX-License-Identifier: Apache-2.0
"""Quantiles and tails of the usual distributions.

As `scipy.stats` gives them, by the functions that it calls: importing it takes a third of a second,
a tenth of a short diagnosis.
"""

from scipy.special import chdtrc, chdtri, fdtrc, stdtr, stdtrit


def t_quantile(share: float, free: float) -> float:
    """Of Student's t with so many degrees of freedom."""
    return float(stdtrit(free, share))


def t_above(value: float, free: float) -> float:
    """Chance that Student's t is larger."""
    return float(stdtr(free, -value))


def f_above(value: float, free: float, free_below: float) -> float:
    """Chance that the ratio of two variances (Fisher's F) is larger."""
    return float(fdtrc(free, free_below, max(value, 0.0)))


def chi2_above(value: float, free: float) -> float:
    """Chance that chi squared is larger."""
    return float(chdtrc(free, max(value, 0.0)))


def chi2_median(free: float) -> float:
    """Of chi squared."""
    return float(chdtri(free, 0.5))
