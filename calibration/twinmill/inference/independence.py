# SPDX-License-Identifier: Apache-2.0
"""How many of the errors that a noise floor leaves are independent.

A heading that wanders shows in two channels at once, and one that wanders slowly in the next
prediction as well. Counted as if each were new, they are evidence for whatever resembles them.
"""

import numpy as np

from twinmill.predict.datasets import INDEPENDENT_S
from twinmill.predict.windows import EVERY_S, HORIZONS_S

LONGEST = HORIZONS_S.index(INDEPENDENT_S)
SURE = 2.0  # standard errors of a correlation of which there is none: below it counts as none
MOST_SIZE = 3.0  # times the median size: errors beyond are as large
MOST = 0.9  # correlation with the next prediction


def independent_shares(errors: np.ndarray, start_s: np.ndarray) -> np.ndarray:
    """(3,) share of the errors of each channel that are independent; 1 where that is not known.

    Of n channels of one disturbance each tells one nth (Kish 1965, section 8.2). Of a first-order
    process of correlation r from one prediction to the next (1 - r) / (1 + r) count (Bayley and
    Hammersley 1946).

    Args:
        errors: (W, H, 3) by noise; NaN where not judged.
        start_s: (W,) ascending begins of the predictions.
    """
    own = _of_size_one(errors[:, LONGEST])
    alike = _correlations(own, own)
    after, there = following(start_s)
    again = np.diag(_correlations(own[there], own[after])).clip(0.0, MOST)
    return _fresh(again) / np.sum(alike**2, axis=0).clip(1.0)


def _fresh(again: np.ndarray) -> np.ndarray:
    """Share that counts of a first-order process of such correlations."""
    return (1 - again) / (1 + again)


def _of_size_one(errors: np.ndarray) -> np.ndarray:
    """(W, 3) errors, of which those of a while in which something happens are no larger than most.

    What a few share says nothing of all others.
    """
    known = np.where(np.isfinite(errors).any(axis=0), errors, 0.0)
    middle = np.nanmedian(np.abs(known), axis=0)
    cut = np.clip(errors, -MOST_SIZE * middle, MOST_SIZE * middle)
    size = np.sqrt(np.nanmean(np.where(middle > 0, cut, 1.0) ** 2, axis=0))
    return np.where(middle > 0, cut, np.nan) / size


def following(start_s: np.ndarray, later_s: float = INDEPENDENT_S) -> tuple[np.ndarray, np.ndarray]:
    """Predictions that begin so much later than others, and those others."""
    wanted_s = start_s + later_s
    at = np.searchsorted(start_s, wanted_s - EVERY_S / 2)
    there = np.flatnonzero(at < len(start_s))
    there = there[np.abs(start_s[at[there]] - wanted_s[there]) < EVERY_S]
    return at[there], there


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) of (W, 3) errors of size one; 0 where chance would make so much."""
    mean, count = _means(a, b)
    return np.where(np.abs(mean) > by_chance(count * EVERY_S), mean, 0.0)


def by_chance(span_s: np.ndarray | float) -> np.ndarray | float:
    """Up to which a correlation of predictions that span so long counts as none."""
    return SURE / np.sqrt(np.maximum(span_s / INDEPENDENT_S, 1))


def _means(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) mean products of (W, 3) errors, and of how many."""
    product = a[:, :, None] * b[:, None, :]
    count = np.isfinite(product).sum(axis=0)
    return np.nansum(product, axis=0) / np.maximum(count, 1), count
