# SPDX-License-Identifier: Apache-2.0
"""Offset between the robot's clock and the motion capture's: a start value that the fit refines."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from twinmill.data.log import LogError
from twinmill.data.track import Track, local_line
from twinmill.filters import filtered

SEARCH_S = 0.3
COARSE_S, FINE_S = 0.02, 0.005
LAGS_S = (0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.13, 0.17)
GRID_S = 0.005  # commands are filtered on this grid, between them a straight line
SLOPE_S = 0.03  # half width of the window in which velocities are measured
LEVER_M = 0.1  # weighs turning (rad/s) against moving (m/s): about half a robot's length
THIN_S = 0.025  # of so many poses one is used: closer velocities share most of their window
BLOCKS = 10  # the log is cut into so many for the standard error
MIN_EXPLAINED = 0.3  # below it the motion does not follow the commands at all


@dataclass(frozen=True)
class ClockOffset:
    """t_capture = t_robot + offset_s.

    Attributes:
        offset_s: a pure delay of the robot is inside it; a first-order lag is not.
        std_s: standard error by leaving out a tenth of the log at a time. What a wrong form of the
            lag adds, some milliseconds, is not in it.
        lag_s: time constant that went best with it.
        explained: share of the measured motion that the commands then explain.
    """

    offset_s: float
    std_s: float
    lag_s: float
    explained: float


def estimate_offset(track: Track) -> ClockOffset:
    """Finds the shift at which the commands best explain the measured velocities.

    For each offset and lag, velocities (forward, left, turning) are regressed on the lagged
    commands, their square roots and their squares (signs kept), so that neither the speed curve
    nor the kind of wheels need be known. The minimum over both is refined by a parabola.

    Raises:
        LogError: the commands do not explain the motion, never change, or the best offset lies at
            the end of the search.
    """
    fit = _Regression(track)
    coarse = np.arange(-SEARCH_S, SEARCH_S + COARSE_S / 2, COARSE_S)
    near = _minimum(fit.losses(coarse), coarse)[0]
    fine = near + np.arange(-COARSE_S, COARSE_S + FINE_S / 2, FINE_S)
    blocks = fit.losses(fine)
    offset_s, lag_s, residual = _minimum(blocks, fine)
    explained = 1 - residual / fit.total
    if explained < MIN_EXPLAINED or abs(offset_s) >= SEARCH_S - COARSE_S:
        raise LogError(
            f"robot {track.robot_id}: the clock offset is not identifiable from this log "
            f"(best {offset_s:.3f} s, "
            f"where commands explain {explained:.0%} of the motion); check that commands and poses "
            f"are of the same run and within {SEARCH_S} s, or shift the poses when importing."
        )
    return ClockOffset(offset_s, fit.jackknife(fine), lag_s, explained)


def _minimum(losses: np.ndarray, offsets_s: np.ndarray) -> tuple[float, float, float]:
    """Offset, lag and loss at the minimum of (lags, offsets), between offsets by a parabola."""
    lag, k = np.unravel_index(losses.argmin(), losses.shape)
    return place_of_least(offsets_s, losses[lag]), LAGS_S[lag], float(losses[lag, k])


def place_of_least(at: np.ndarray, losses: np.ndarray) -> float:
    """Where (S,) losses at places of one step are least, between these by a parabola."""
    k = int(losses.argmin())
    if 0 < k < len(at) - 1:
        left, middle, right = losses[k - 1 : k + 2]
        curvature = left - 2 * middle + right
        if curvature > 0:
            return float(at[k]) + float(0.5 * (left - right) / curvature * (at[1] - at[0]))
    return float(at[k])


class _Regression:
    """Residuals of velocities regressed on shifted, lagged commands, by normal equations."""

    def __init__(self, track: Track):
        self.t_s, self.velocity = _body_velocity(track)
        if len(self.t_s) < BLOCKS or not np.diff(track.command, axis=0).any():
            raise LogError(
                f"robot {track.robot_id}: the clock offset is not identifiable, because the "
                "commands never change while the robot is tracked; record a run in "
                "which they do."
            )
        self.block = np.arange(len(self.t_s)) * BLOCKS // len(self.t_s)
        self.total = float(np.sum(self.velocity**2))
        end_s = max(track.command_t_s[-1], self.t_s[-1]) + 1
        self.grid_s = np.arange(min(track.command_t_s[0], self.t_s[0]) - 1, end_s, GRID_S)
        shapes = _averaged(self.grid_s, track)
        decay = [np.exp(-GRID_S / lag) for lag in LAGS_S]
        self.lagged = [filtered([1 - a], [1, -a], shapes, axis=0) for a in decay]
        self.sums: list[list[tuple[np.ndarray, np.ndarray]]] = []

    def losses(self, offsets_s: np.ndarray) -> np.ndarray:
        """(lags, offsets) sums of squares that stay unexplained."""
        self.sums = [
            [self._block_sums(lagged, offset) for offset in offsets_s] for lagged in self.lagged
        ]
        return self._solve(np.ones(BLOCKS, bool))

    def jackknife(self, offsets_s: np.ndarray) -> float:
        """Standard error of the minimum of the losses computed last (Efron and Stein 1981)."""
        found = [_minimum(self._solve(np.arange(BLOCKS) != k), offsets_s)[0] for k in range(BLOCKS)]
        return float(np.sqrt((BLOCKS - 1) * np.var(found)))

    def _block_sums(self, lagged: np.ndarray, offset_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Normal equations per block: (BLOCKS, F, F) and (BLOCKS, F, 3)."""
        position = (self.t_s - offset_s - self.grid_s[0]) / GRID_S
        k = np.floor(position).astype(int)
        part = (position - k)[:, None]
        rows = np.hstack([lagged[k] * (1 - part) + lagged[k + 1] * part, np.ones((len(k), 1))])
        edges = np.searchsorted(self.block, np.arange(BLOCKS + 1))
        parts = [slice(first, last) for first, last in pairwise(edges)]
        return (
            np.array([rows[p].T @ rows[p] for p in parts]),
            np.array([rows[p].T @ self.velocity[p] for p in parts]),
        )

    def _solve(self, keep: np.ndarray) -> np.ndarray:
        total = np.sum(self.velocity[keep[self.block]] ** 2)
        return np.array(
            [
                [total - _explained(g[keep].sum(axis=0), h[keep].sum(axis=0)) for g, h in row]
                for row in self.sums
            ]
        )


def _averaged(grid_s: np.ndarray, track: Track) -> np.ndarray:
    """(G, 12) commands, their roots and squares, averaged over the grid step that ends there.

    A point value instead would come half a step late on the mean.
    """
    command = track.command
    shapes = np.hstack(
        [command, np.sign(command) * np.sqrt(np.abs(command)), command * np.abs(command)]
    )
    knots_s = np.append(track.command_t_s, grid_s[-1] + 1)
    area = np.vstack(
        [np.zeros(shapes.shape[1]), np.cumsum(shapes * np.diff(knots_s)[:, None], axis=0)]
    )
    at_grid = np.column_stack([np.interp(grid_s, knots_s, column) for column in area.T])
    return np.diff(at_grid, axis=0, prepend=0.0) / GRID_S


def _explained(gram: np.ndarray, moment: np.ndarray) -> float:
    """Explained sum of squares; a small ridge since left and right wheels often agree."""
    ridge = 1e-6 * np.trace(gram) / len(gram) * np.eye(len(gram))
    return float(np.sum(moment * np.linalg.solve(gram + ridge, moment)))


def _body_velocity(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """(K,) s and (K, 3) forward, left, LEVER_M * turning; m/s; thinned."""
    width_s = max(SLOPE_S, 1.5 * track.timing.pose_period_s)  # three poses at least
    _, slope = local_line(track.pose_t_s, track.pose, track.segment, width_s)
    cos, sin = np.cos(track.heading_smooth), np.sin(track.heading_smooth)
    velocity = np.column_stack(
        [
            cos * slope[:, 0] + sin * slope[:, 1],
            cos * slope[:, 1] - sin * slope[:, 0],
            LEVER_M * slope[:, 2] if track.has_heading else 0 * slope[:, 0],
        ]
    )
    every = max(1, round(THIN_S / track.timing.pose_period_s))
    known = np.flatnonzero(np.isfinite(velocity).all(axis=1))[::every]
    return track.pose_t_s[known], velocity[known]
