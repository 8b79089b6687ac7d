# SPDX-License-Identifier: Apache-2.0
"""Finds stretches of a log that were driven twice by the same commands: the honest noise floor."""

from collections import defaultdict

import numpy as np

from twinmill.data.track import Track

CHANGES = 5  # commands in a row that must agree
TIMING_S = 0.006  # agreement of their times: the model knows when each command came
LEAD_S, AHEAD_S = 0.5, 2.0  # commands before and after a window's start that must be repeated
EVERY_S = 0.25
COVERED = 0.5  # share of the log that must have been repeated to speak for all of it


def repeated_starts(track: Track, length: int) -> np.ndarray | None:
    """(P, 2) indices of poses from which the robot was driven by the same commands for 2 s.

    Args:
        track: the measurement.
        length: number of windows of the whole log.

    Returns:
        None if less than half of the log was repeated.
    """
    changed = np.flatnonzero(np.any(np.diff(track.command, axis=0) != 0, axis=1)) + 1
    t_s, value = track.command_t_s[changed], track.command[changed]
    pairs = [
        pair
        for a, b in _partners(t_s, value)
        for pair in _windows(track, t_s[a], t_s[a + CHANGES], t_s[b] - t_s[a])
    ]
    unique = np.unique(np.array(pairs, np.int64).reshape(-1, 2), axis=0)
    return unique if 2 * len(unique) >= COVERED * length else None


def _partners(t_s: np.ndarray, value: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of places (a < b) from which the next changes agree; each place is used once."""
    places = defaultdict(list)
    for i in range(len(t_s) - CHANGES):
        places[value[i : i + CHANGES].tobytes()].append(i)
    pairs = []
    for same in places.values():
        for a, b in zip(same[:-1:2], same[1::2], strict=False):
            apart = np.abs(np.diff(t_s[a : a + CHANGES + 1]) - np.diff(t_s[b : b + CHANGES + 1]))
            if apart.max() <= TIMING_S:
                pairs.append((a, b))
    return pairs


def _windows(track: Track, from_s: float, to_s: float, shift_s: float) -> list[tuple[int, int]]:
    """Pairs of poses, the second `shift_s` after the first, that lie in unbroken stretches."""
    pairs = []
    for start_s in np.arange(from_s + LEAD_S, to_s - AHEAD_S, EVERY_S):
        at = np.searchsorted(track.pose_t_s, [start_s, start_s + shift_s])
        if at.max() < len(track.pose_t_s) and np.all(track.segment[at] >= 0):
            pairs.append((int(at[0]), int(at[1])))
    return pairs
