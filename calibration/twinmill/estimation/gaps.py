# SPDX-License-Identifier: Apache-2.0
"""Moments within gaps of the measurement, which are known to the gap and no better.

Predictions are the same wherever within a gap it is, so that the curvature of the cost tells
nothing of how wide the interval is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinmill.model.parameters import NORMAL_95, ParameterEstimate
from twinmill.predict.datasets import Dataset, Trajectory
from twinmill.predict.windows import EVERY_S, HORIZONS_S


def gaps_s(datasets: Sequence[Dataset]) -> np.ndarray:
    """(K, 2) s since the first command, in which no data set was measured for two seconds."""
    tracks = [d.measurement.track for d in datasets if isinstance(d, Trajectory)]
    if not tracks:
        return np.empty((0, 2))
    t_s = np.sort(np.concatenate([t.pose_t_s[t.segment >= 0] - t.command_t_s[0] for t in tracks]))
    long = np.flatnonzero(np.diff(t_s) > HORIZONS_S[-1])
    return np.column_stack([t_s[long], t_s[long + 1]])


def known_to_gap(estimate: ParameterEstimate, gaps: np.ndarray) -> ParameterEstimate:
    """A moment's estimate; where it is in a gap, its 95 % interval is all of that."""
    reach_s = NORMAL_95 * estimate.std
    low_s, high_s = estimate.value - reach_s, estimate.value + reach_s
    for begin_s, end_s in gaps:
        meets = low_s <= end_s and high_s >= begin_s
        if meets and (low_s > begin_s or high_s < end_s):
            half_s = max((end_s - begin_s) / 2 + EVERY_S, reach_s)
            middle_s = float(begin_s + end_s) / 2
            return replace(estimate, value=middle_s, std=float(half_s / NORMAL_95))
    return estimate
