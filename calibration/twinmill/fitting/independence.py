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
        errors: (W, H, 3) of a smooth response; NaN where not judged.
        start_s: (W,) ascending begins of the predictions.
    """
    own = _of_size_one(errors[:, LONGEST])
    alike = _correlations(own, own)
    following, there = _following(start_s)
    again = np.diag(_correlations(own[there], own[following])).clip(0.0, MOST)
    return (1 - again) / (1 + again) / np.sum(alike**2, axis=0).clip(1.0)


def _of_size_one(errors: np.ndarray) -> np.ndarray:
    """(W, 3) errors, of which those of a while in which something happens are no larger than most.

    What a few share says nothing of all others.
    """
    known = np.where(np.isfinite(errors).any(axis=0), errors, 0.0)
    middle = np.nanmedian(np.abs(known), axis=0)
    cut = np.clip(errors, -MOST_SIZE * middle, MOST_SIZE * middle)
    size = np.sqrt(np.nanmean(np.where(middle > 0, cut, 1.0) ** 2, axis=0))
    return np.where(middle > 0, cut, np.nan) / size


def _following(start_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Predictions that begin as others end, and those others."""
    wanted_s = start_s + INDEPENDENT_S
    at = np.searchsorted(start_s, wanted_s - EVERY_S / 2)
    there = np.flatnonzero(at < len(start_s))
    there = there[np.abs(start_s[at[there]] - wanted_s[there]) < EVERY_S]
    return at[there], there


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) of (W, 3) errors of size one; 0 where chance would make so much."""
    product = a[:, :, None] * b[:, None, :]
    count = np.isfinite(product).sum(axis=0)
    mean = np.nansum(product, axis=0) / np.maximum(count, 1)
    chance = SURE / np.sqrt(np.maximum(count * EVERY_S / INDEPENDENT_S, 1))
    return np.where(np.abs(mean) > chance, mean, 0.0)
