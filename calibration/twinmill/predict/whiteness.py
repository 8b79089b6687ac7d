# SPDX-License-Identifier: Apache-2.0
"""Test whether one-step errors, whitened by the noise, have a memory that the noise has not."""

import numpy as np
from scipy.stats import chi2

MEMORY_S = 0.5  # over which a memory is looked for: the middle of the horizons of predictions


def whiteness(white: np.ndarray, period_s: float) -> float:
    """P-value of the test of Ljung and Box 1978, Biometrika 65(2), of the least white channel.

    The least of several p-values counts as many times (Bonferroni).

    Args:
        white: (S, 3) whitened errors; zero where nothing was measured or the filter settles.
        period_s: of the steps.
    """
    lags = np.arange(1, max(round(MEMORY_S / period_s), 1) + 1)
    found = [_ljung_box(channel, lags) for channel in white.T if channel.any()]
    return min(1.0, len(found) * min(found, default=1.0))


def _ljung_box(white: np.ndarray, lags: np.ndarray) -> float:
    seen = white != 0
    count = np.count_nonzero(seen)
    centred = np.where(seen, white - white[seen].mean(), 0.0)
    products = np.array([centred[lag:] @ centred[:-lag] for lag in lags])
    correlation = products / max(centred @ centred, count)  # what is less than noise is none
    statistic = count * (count + 2) * np.sum(correlation**2 / (count - lags))
    return float(chi2.sf(statistic, len(lags)))
