# SPDX-License-Identifier: Apache-2.0
"""Outliers among a few: how many robust standard deviations each is from the median.

Median and median absolute deviation (Rousseeuw and Croux 1993).
"""

import numpy as np

ODD = 3.5  # scales from the median


def middle_and_scale(values: list[float]) -> tuple[float, float]:
    """Median, and the standard deviation that the median absolute deviation stands for."""
    middle = np.median(values)
    return float(middle), float(1.4826 * np.median(np.abs(np.array(values) - middle)))


def odd_ones(away: dict[int, float]) -> set[int]:
    """Those that are more than ODD scales off: the worst, and always fewer than half."""
    worst = sorted(away, key=lambda i: -away[i])[: max(len(away) - 1, 0) // 2]
    return {i for i in worst if away[i] > ODD}
