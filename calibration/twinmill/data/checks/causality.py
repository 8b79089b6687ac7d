# SPDX-License-Identifier: Apache-2.0
"""Motion that precedes the command which causes it: by no lag, limit or controller, but by a clock.

How a robot responds is unknown, so no models of the response are compared: its motion up to a time
is caused by the commands given until then. At the changes of the command, the motion before them is
regressed on the command after them, given the motion and the commands until then (Sims 1972, Money,
income, and causality; partialled out by Frisch and Waugh 1933). On one clock that coefficient is
zero, whatever the response, and a controller that reacts to the motion makes it negative.
"""

import numpy as np

from twinmill.data.checks.motion import BLOCK_S
from twinmill.data.track import Track

PAST_COMMANDS = (0, 0.25, 0.5, 1, 1.5, 2.5, 4, 7)  # times the lead: edges of means before a change
PAST_MOTIONS = 3  # stretches before that which is judged, each as long
APART = 1 / 3  # of the lead: changes that are nearer to each other show the same motion
NOTHING_NEW = 1e-9  # share of the squared command that rounding leaves of one that the past tells
FEWEST = 3  # changes for each regressor, and left-out stretches for a standard error


def precedence(track: Track, body: np.ndarray, lead_s: float, spare_s: float) -> float:
    """Largest t statistic, over the channels, of motion that precedes its command; 0: too short.

    Args:
        track: of a robot whose heading was recorded.
        body: (3, 4) velocity of the body by command.
        lead_s: by which the poses may precede the commands.
        spare_s: up to which stamps of one clock differ: motion so shortly before is not judged.
    """
    reach_s = max(lead_s - spare_s, track.timing.pose_period_s)
    change_s = _changes(track, APART * lead_s)
    change_s, frames = _with_frames(track, change_s, reach_s, spare_s)
    regressors = len(PAST_COMMANDS) + PAST_MOTIONS + 1
    block = ((change_s - track.command_t_s[0]) // BLOCK_S).astype(int)
    if len(change_s) < FEWEST * regressors or len(np.unique(block)) < FEWEST:
        return 0.0
    motion, *past = _velocities(track, frames)
    edges_s = [change_s - lead_s * edge for edge in PAST_COMMANDS]
    ahead, *told = _mean_commands(track, body, [change_s + reach_s, *edges_s])
    past += told
    return max(
        _t_statistic(motion[:, k], ahead[:, k], np.column_stack([v[:, k] for v in past]), block)
        for k in range(motion.shape[1])
    )


def _changes(track: Track, apart_s: float) -> np.ndarray:
    """(E,) times at which the command changes, so far apart at least."""
    changed = np.flatnonzero(np.any(np.diff(track.command, axis=0) != 0, axis=1)) + 1
    kept_s: list[float] = []
    for t_s in track.command_t_s[changed]:
        if not kept_s or t_s >= kept_s[-1] + apart_s:
            kept_s.append(t_s)
    return np.array(kept_s)


def _with_frames(
    track: Track, change_s: np.ndarray, reach_s: float, spare_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Changes before which the robot was tracked; (E, PAST_MOTIONS + 2) frames, latest first.

    The latest is the last one that came `spare_s` before the change, or sooner.
    """
    count = max(1, round(reach_s / track.timing.pose_period_s))
    last = np.searchsorted(track.pose_t_s, change_s - spare_s, side="right") - 1
    frames = last[:, None] - count * np.arange(PAST_MOTIONS + 2)
    within = (frames[:, -1] >= 0) & (change_s < track.pose_t_s[-1])
    change_s, frames = change_s[within], frames[within]
    segment = track.segment[frames]
    tracked = (segment == segment[:, :1]).all(axis=1) & (segment[:, 0] >= 0)
    return change_s[tracked], frames[tracked]


def _velocities(track: Track, frames: np.ndarray) -> list[np.ndarray]:
    """(E, 3) forward, left, turning from frame to frame, along the heading at the first of both."""
    found = []
    for end, begin in zip(frames.T[:-1], frames.T[1:], strict=True):
        moved = track.pose[end] - track.pose[begin]
        cos, sin = np.cos(track.pose[begin, 2]), np.sin(track.pose[begin, 2])
        forward, left = cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]
        passed_s = track.pose_t_s[end] - track.pose_t_s[begin]
        found.append(np.column_stack([forward, left, moved[:, 2]]) / passed_s[:, None])
    return found


def _mean_commands(track: Track, body: np.ndarray, edges_s: list[np.ndarray]) -> list[np.ndarray]:
    """(E, 3) of each pair of neighbouring edges, latest first: mean of the velocity commanded."""
    told = track.command @ body.T
    knots_s = np.append(track.command_t_s, edges_s[0].max() + track.command_t_s[-1] + 1)
    area = np.vstack([np.zeros(3), np.cumsum(told * np.diff(knots_s)[:, None], axis=0)])
    at = [
        np.column_stack([np.interp(t_s, knots_s, column) for column in area.T]) for t_s in edges_s
    ]
    return [
        (after - before) / (end_s - begin_s)[:, None]
        for after, before, end_s, begin_s in zip(at, at[1:], edges_s, edges_s[1:], strict=False)
    ]


def _t_statistic(y: np.ndarray, x: np.ndarray, others: np.ndarray, block: np.ndarray) -> float:
    """Coefficient of x over its standard error; by the jackknife over stretches (Efron 1981).

    Args: y, x (E,); others (E, R), with a constant beside them; block (E,) number of its stretch.
    """
    columns = np.column_stack([np.ones(len(x)), others])
    scale = np.abs(columns).max(axis=0)
    columns /= np.where(scale > 0, scale, 1)
    new = x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0]
    if np.sum(new**2) <= NOTHING_NEW * np.sum(x**2):
        return 0.0
    y, x = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0], new
    along, power = (np.bincount(block, v) for v in (x * y, x * x))
    along, power = along[np.unique(block)], power[np.unique(block)]
    without = (along.sum() - along) / (power.sum() - power)
    error = np.sqrt((len(along) - 1) * np.var(without))
    return float(along.sum() / power.sum() / error)
