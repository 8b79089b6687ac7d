# SPDX-License-Identifier: Apache-2.0
"""Paths that a model predicts, begun anew at measured poses."""

import numpy as np
import twinmill_native as native

from twinmill.predict.modelled_log import ModelledLog


def predicted_path(modelled: ModelledLog, restart_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses that follow from the commands alone, from a measured one on.

    Args:
        modelled: a robot in a log, with its model.
        restart_s: a prediction goes on for so long, or to the end of an unbroken stretch of poses,
            where the next begins; infinite for a stretch as a whole.

    Returns:
        (N,) index of the pose at which the prediction of each pose began, -1 of lost ones; (N, 3)
        predicted poses, x and y in m, heading in rad; the first of each prediction is the measured
        one.
    """
    track, period_s = modelled.measurement.track, modelled.grid.period_s
    since = np.full(len(track.pose), -1, dtype=np.int64)
    for number in np.unique(track.segment[track.segment >= 0]):
        index = np.flatnonzero(track.segment == number)
        passed_s = track.pose_t_s[index] - track.pose_t_s[index[0]] + period_s / 2
        _, first, part = np.unique(
            np.floor(passed_s / restart_s), return_index=True, return_inverse=True
        )
        since[index] = index[first][part]
    known = np.flatnonzero(since >= 0)
    starts, first, row = np.unique(since[known], return_index=True, return_inverse=True)
    after = np.arange(len(known)) - first[row]  # poses since the first of each prediction
    ends = np.full((len(starts), after.max() + 1), -1, dtype=np.int64)
    ends[row, after] = known
    ahead = native.windows(modelled.model, modelled.measurement.started, starts, ends[:, 1:])
    pose = np.full_like(track.pose, np.nan)
    pose[starts], later = track.pose[starts], ends[:, 1:] >= 0
    pose[ends[:, 1:][later]] = ahead[later]
    return since, pose
