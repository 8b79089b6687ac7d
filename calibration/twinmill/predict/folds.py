# SPDX-License-Identifier: Apache-2.0
"""Two halves of a log, drive by drive: what is fitted on one is judged on the other.

Functions of a scene are open to scenes of other kinds of measurement (functools.singledispatch).
"""

from functools import singledispatch

import numpy as np

from twinmill.predict.problem import CLOCK, Scene
from twinmill.predict.windows import Windows

LONGEST_S = 12.0  # a drive from rest to rest that lasts longer is cut into blocks
BLOCK_S = 4.0
FEWEST = 6  # drives, below which blocks are taken
MARGIN_S = 0.3  # steps after a change of half still remember the other through noise and wheels


@singledispatch
def halves(scene: Scene) -> np.ndarray:
    """(N,) 0 or 1 for each pose.

    Drives go to the halves by the Thue-Morse sequence (0 1 1 0 1 0 0 1 ...), which no rhythm of the
    commands follows: forward and backward, rising and falling duties come into both.
    """
    edges = _edges(scene)
    drive = np.searchsorted(edges[1:], scene.measurement.track.pose_t_s, side="right")
    return thue_morse(drive)


def thue_morse(number: np.ndarray) -> np.ndarray:
    """(N,) 0 or 1: the sequence 0 1 1 0 1 0 0 1 ... at these places."""
    return np.array([bin(int(n)).count("1") % 2 for n in number])


def _edges(scene: Scene) -> np.ndarray:
    """Times (capture's clock) at which a drive starts; what is before the first belongs to it."""
    track = scene.measurement.track
    moving = np.any(track.command != 0, axis=1)
    starts = track.command_t_s[1:][moving[1:] & ~moving[:-1]] + scene.model.get(CLOCK) - 0.1
    lengths = np.diff(starts)
    if len(starts) >= FEWEST and np.median(lengths) >= BLOCK_S / 2 and lengths.max() <= LONGEST_S:
        return starts
    return np.arange(track.pose_t_s[0], track.pose_t_s[-1], BLOCK_S)


@singledispatch
def step_mask(scene: Scene, half: np.ndarray, which: int) -> np.ndarray:
    """(S,) bool: steps of one half, without those just after a change of half."""
    own = half[scene.grid.source] == which
    changed_s = scene.grid.t_s[1:][own[1:] != own[:-1]]
    since = np.searchsorted(changed_s, scene.grid.t_s, side="right")
    fresh = np.zeros(len(own), bool)
    if len(changed_s):
        fresh = (since > 0) & (scene.grid.t_s - changed_s[np.maximum(since - 1, 0)] < MARGIN_S)
    return own & ~fresh


def window_mask(windows: Windows, half: np.ndarray, which: int) -> np.ndarray:
    """(W, H) bool: predictions that start and end in one half."""
    inside = (half[windows.starts] == which)[:, None] & (half[windows.ends] == which)
    return inside & (windows.ends >= 0)


@singledispatch
def held_errors(scene: Scene, half: np.ndarray, which: int) -> np.ndarray:
    """(W, H, 3) errors of predictions within one half; NaN elsewhere."""
    windows = Windows.of(scene.measurement.track)
    inside = window_mask(windows, half, which)
    return np.where(inside[..., None], windows.errors(scene), np.nan)
