# SPDX-License-Identifier: Apache-2.0
"""Quantiles and tails of the usual distributions.

As `scipy.stats` gives them: importing SciPy takes a fifth of a second, a tenth of a short
diagnosis.
"""

from collections.abc import Callable
from functools import cache

import twinmill_native as native

HALVINGS = 200  # more than a double has


@cache
def t_quantile(share: float, free: float) -> float:
    """Of Student's t with so many degrees of freedom."""
    if share < 0.5:
        return -t_quantile(1 - share, free)
    return _where(lambda value: native.t_above(value, free) > 1 - share)


def t_above(value: float, free: float) -> float:
    """Chance that Student's t is larger."""
    return native.t_above(value, free)


def f_above(value: float, free: float, free_below: float) -> float:
    """Chance that the ratio of two variances (Fisher's F) is larger."""
    return native.f_above(max(value, 0.0), free, free_below)


def chi2_above(value: float, free: float) -> float:
    """Chance that chi squared is larger."""
    return native.chi2_above(max(value, 0.0), free)


@cache
def chi2_median(free: float) -> float:
    """Of chi squared."""
    return _where(lambda value: native.chi2_above(value, free) > 0.5)


def _where(is_below: Callable[[float], bool]) -> float:
    """The value of 0 or more from which on it no longer holds."""
    low, high = 0.0, 1.0
    while is_below(high):
        low, high = high, 2 * high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return high
