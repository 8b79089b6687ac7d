# SPDX-License-Identifier: Apache-2.0
"""How many of the errors that a noise floor leaves are independent.

A heading that wanders shows in two channels at once, and one that wanders slowly in the next
prediction as well; of errors that are large in a few turns and small in all straights, those few
decide. Counted as if each were new, they are evidence for whatever resembles them.
"""

import numpy as np

from twinmill.predict.datasets import INDEPENDENT_S
from twinmill.predict.windows import EVERY_S, HORIZONS_S, rms

LONGEST = HORIZONS_S.index(INDEPENDENT_S)
SURE = 2.0  # standard errors of a correlation of which there is none: below it counts as none
MOST = 0.9  # correlation with the next prediction


def independent_shares(errors: np.ndarray, start_s: np.ndarray) -> np.ndarray:
    """(3,) share of the errors of each channel that are independent; 1 where that is not known.

    Of n channels of one disturbance each tells one nth (Kish 1965, section 8.2). Of a first-order
    process of correlation r from one prediction to the next (1 - r) / (1 + r) count (Bayley and
    Hammersley 1946). Of sizes that differ as many count as errors of one size would scatter alike
    in their squares: 1 over a kurtosis in units of the normal distribution's.

    Args:
        errors: (W, H, 3) of a smooth response; NaN where not judged.
        start_s: (W,) ascending begins of the predictions.
    """
    size = rms(errors)[LONGEST]
    own = errors[:, LONGEST] / np.where(size > 0, size, np.nan)
    alike = _correlations(own, own)
    following, there = _following(start_s)
    again = np.diag(_correlations(own[there], own[following])).clip(0.0, MOST)
    return (1 - again) / (1 + again) / np.sum(alike**2, axis=0).clip(1.0) / _unevenness(own)


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


def _unevenness(errors: np.ndarray) -> np.ndarray:
    """(3,) kurtosis of (W, 3) errors of size one over the normal distribution's.

    1 where chance would make so much: of n errors its standard error is sqrt(24 / n) / 3.
    """
    count = np.isfinite(errors).sum(axis=0)
    kurtosis = np.nansum(errors**4, axis=0) / np.maximum(count, 1) / 3
    chance = SURE * np.sqrt(24 / np.maximum(count * EVERY_S / INDEPENDENT_S, 1)) / 3
    return np.where(kurtosis > 1 + chance, kurtosis, 1.0)
