# SPDX-License-Identifier: Apache-2.0
"""Where robots touch: what moves one there are not its commands alone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinmill.data.cuts import without
from twinmill.data.track import Track

CORNER = 1.25  # times a body's radius: corners of a nearly square one stand out (TurboPi: 1.24)


def apart(track: Track, others: Sequence[Track], body_radius_m: float) -> Track:
    """A track without the poses at which another robot is near enough to touch.

    Args:
        track: of the robot.
        others: of the other robots in the log, on the same capture's clock.
        body_radius_m: of all of them.
    """
    touching = np.zeros(len(track.pose_t_s), bool)
    for other in others:
        known = other.segment >= 0
        if known.any():
            x_m, y_m = (
                np.interp(track.pose_t_s, other.pose_t_s[known], other.pose[known, k])
                for k in range(2)
            )
            away_m = np.hypot(track.pose[:, 0] - x_m, track.pose[:, 1] - y_m)
            touching |= away_m < 2 * CORNER * body_radius_m
    return replace(track, segment=without(track.segment, touching)) if touching.any() else track
