# SPDX-License-Identifier: Apache-2.0
"""Normal distributions that end at bounds.

Where the prior of a number ends, so does its posterior. In a linear model the evidence under the
normal prior is then multiplied by the posterior's share within the bounds, over the prior's
(Gelfand, Smith and Lee 1992, J. Am. Stat. Assoc. 87, 523). Shares of several numbers are multiplied
as if these were independent.
"""

import numpy as np
from scipy.special import log_ndtr


def log_within(low: np.ndarray, high: np.ndarray, mean: np.ndarray, std: np.ndarray) -> np.ndarray:
    """Log of the share of normal distributions that lies within bounds; all shapes broadcast."""
    a, b = (low - mean) / std, (high - mean) / std
    large = a > -b  # where both shares below are nearly one; their mirror images are not
    a, b = np.where(large, -b, a), np.where(large, -a, b)
    return log_ndtr(b) + np.log1p(-np.exp(log_ndtr(a) - log_ndtr(b)))
