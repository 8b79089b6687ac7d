# SPDX-License-Identifier: Apache-2.0
"""Residuals of a smooth response to the commands, fitted to a log's motion: its own noise.

A regression with no physics names: the measured velocity on the commands' levels, each passed
through a few first-order lags, with terms for stopping, for coupling between the axes and for the
room. It is never shown as a model; it separates noise from what some model could explain.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from twinmill.data.measurement import Measurement
from twinmill.data.track import command_at
from twinmill.filters import filtered
from twinmill.predict.residual import StepGrid, rotate

LEVELS = (0.15, 0.3, 0.5, 0.65, 0.8, 0.9, 1.0)  # of the largest command
LAGS_S = (0.0, 0.03, 0.07, 0.15)
USUAL = 2  # of these lags: what is squared, or goes with the voltage
COAST_S = (0.07, 0.15, 0.4)
BLOCK_S = 4.0
FOLDS = 10
RIDGE = 1e-4  # times the squares of a term: what a log barely shows is not made up
# Sums over the wheels that a mecanum base turns into forward, left and turn.
AXES = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]]) / 4


def unexplained(measurement: Measurement, grid: StepGrid, offset_s: float) -> list[np.ndarray]:
    """Two (S, 3) one-step errors in W: of a fit to all of the log, and of fits to the other blocks.

    The first is too small by the share of terms in the log's samples, the second too large by
    nearly the same, as it is fitted on nearly all: their mean power is the noise's.
    """
    track = measurement.track
    step = (track.pose[grid.source] - track.pose[grid.origin]) * grid.share[:, None]
    heading_rad = track.heading_smooth[grid.source]
    body = np.column_stack([*rotate(step[:, 0], step[:, 1], -heading_rad), step[:, 2]])
    body[grid.starts] = 0
    terms = _terms(measurement, grid, offset_s, heading_rad)
    fold = (grid.t_s // BLOCK_S).astype(int) % FOLDS
    fitted = [_fitted(x, y, fold) for x, y in zip(terms, body.T, strict=True)]
    within, across = (body - np.column_stack(predicted) for predicted in zip(*fitted, strict=True))
    return [
        np.column_stack([*rotate(e[:, 0], e[:, 1], heading_rad), e[:, 2]]) for e in (within, across)
    ]


def _fitted(x: np.ndarray, y: np.ndarray, fold: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(S, P) terms and (S,) values to (S,) values by a fit to all, and by fits to other folds."""
    edges = [0, *(1 + np.flatnonzero(np.diff(fold))), len(fold)]
    parts = [(slice(i, j), fold[i]) for i, j in pairwise(edges)]
    grams, moments = np.zeros((FOLDS, x.shape[1], x.shape[1])), np.zeros((FOLDS, x.shape[1]))
    for own, k in parts:
        grams[k] += x[own].T @ x[own]
        moments[k] += x[own].T @ y[own]
    gram, moment = grams.sum(axis=0), moments.sum(axis=0)
    # Of the whole log, so that a term which some folds hardly see is held at zero there.
    ridge = RIDGE * np.diag(np.diag(gram)) + (1e-12 * gram.max() + 1e-30) * np.eye(len(gram))
    without = np.linalg.solve(gram - grams + ridge, (moment - moments)[..., None])[..., 0]
    across = np.concatenate([x[own] @ without[k] for own, k in parts])
    return x @ np.linalg.solve(gram + ridge, moment), across


def _terms(
    measurement: Measurement, grid: StepGrid, offset_s: float, heading_rad: np.ndarray
) -> Iterator[np.ndarray]:
    """For each axis the (S, P) regressors of its velocity."""
    command = _command(measurement, grid, offset_s)
    size, sign = np.abs(command), np.sign(command)
    odd = np.stack([sign * _hat(size, i) for i in range(len(LEVELS))], -1)
    odd = np.einsum("aw,swl->sal", AXES, odd)
    lagged = {tau_s: _lag(odd, tau_s, grid) for tau_s in {*LAGS_S, *COAST_S}}
    linear = [sum(np.moveaxis(lagged[tau_s], -1, 0)) for tau_s in LAGS_S]  # (S, axes) each
    even = [_lag(size @ AXES.T, tau_s, grid) for tau_s in LAGS_S]
    stopped = np.all(command == 0, axis=1)[:, None]
    voltage = command_at(
        grid.t_s - offset_s,
        measurement.track.command_t_s,
        np.nan_to_num(measurement.track.battery_V)[:, None],
    )
    voltage = voltage - voltage.mean()
    moving = (size.max(1) > 0)[:, None] * 1.0
    c, s = np.cos(heading_rad)[:, None] * moving, np.sin(heading_rad)[:, None] * moving
    usual, straight = linear[USUAL], np.hstack([*linear, *even])
    bent = np.hstack([usual * usual[:, [1, 2, 0]], np.abs(usual)])
    for axis in range(3):
        room = {0: [c, s], 1: [-s, c], 2: [moving]}[axis]
        yield np.hstack(
            [
                *(lagged[tau_s][:, axis] for tau_s in LAGS_S),
                *(lagged[tau_s][:, axis] * stopped for tau_s in COAST_S),
                straight,
                usual[:, [axis]] * voltage,
                bent,
                *room,
            ]
        )


def _command(measurement: Measurement, grid: StepGrid, offset_s: float) -> np.ndarray:
    """(S, 4) commands in force in the middle of each step, over the largest of the log."""
    track = measurement.track
    t_s = grid.t_s - offset_s - grid.period_s / 2
    command = command_at(t_s, track.command_t_s, track.command)
    if track.command_kind == "twist":
        command = command[:, :3] @ np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-0.1, 0.1, -0.1, 0.1]])
    return command / max(float(np.abs(command).max()), 1e-9)


def _hat(level: np.ndarray, i: int) -> np.ndarray:
    """Straight-line interpolation: 1 at its own level, 0 at its neighbours."""
    nodes = (0.0, *LEVELS)
    peak = np.zeros(len(nodes))
    peak[i + 1] = 1
    return np.interp(level, nodes, peak)


def _lag(signal: np.ndarray, tau_s: float, grid: StepGrid) -> np.ndarray:
    """Signal (S, ...) through a lag."""
    keep = np.exp(-grid.period_s / tau_s) if tau_s > 0 else 0.0
    return filtered([1 - keep], [1, -keep], signal, axis=0)
