# SPDX-License-Identifier: Apache-2.0
"""Velocity that the base model misses, step by step, beside all that it could depend on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy.signal import lfilter

from rivals.protocol import Predict
from twinmill.data.measurement import Measurement
from twinmill.predict.residual import rotate
from twinmill.predict.windows import HORIZONS_S, Windows

MEMORY_S, LOAD_S = 0.3, 30.0
BLOCK_S = 8.0  # what is fitted to one block is judged on others
SPEED, CHANGE, PAST, HEADING, PLACE, TIME, BATTERY, WHEELS = (
    "speed",
    "change",
    "past",
    "heading",
    "place",
    "time",
    "battery",
    "wheel angle",
)


@dataclass(frozen=True)
class Steps:
    """A log in steps that share only their ends.

    Attributes:
        step_s: length of each.
        t_s: (N,) middle, capture's clock.
        start: (N, 3) measured pose at the start.
        body: (N, 3) the base's mean velocity in the frame of the start: m/s, m/s, rad/s.
        missed: (N, 3) measured less that.
        known: (N, K) what commands alone tell; `columns` are the names, K first.
        columns, groups: of `features`.
        block: (N,) number of the BLOCK_S that a step is in.
    """

    step_s: float
    t_s: np.ndarray
    start: np.ndarray
    body: np.ndarray
    missed: np.ndarray
    known: np.ndarray
    columns: tuple[str, ...]
    groups: tuple[str, ...]

    @classmethod
    def of(cls, measurement: Measurement, model: native.Model, step_s: float) -> "Steps":
        """Cuts a log into steps."""
        track = measurement.track
        start, end = _cut(measurement, step_s)
        ahead = native.windows(model, measurement.played, start, end[:, None])[:, 0]
        span_s = (track.pose_t_s[end] - track.pose_t_s[start])[:, None]
        pose, heading_rad = track.pose, track.heading_smooth[start]
        body = _seen(pose[start], ahead, heading_rad) / span_s
        missed = _seen(pose[start], pose[end], heading_rad) / span_s - body
        t_s = (track.pose_t_s[start] + track.pose_t_s[end]) / 2
        known, columns, groups = _known(measurement, model, t_s, body, step_s=step_s)
        return cls(
            step_s,
            t_s,
            pose[start],
            body,
            missed,
            known,
            (*columns, "sin", "cos", "x", "y"),
            (*groups, HEADING, HEADING, PLACE, PLACE),
        )

    @property
    def features(self) -> np.ndarray:
        """(N, F) of each step."""
        return _with_pose(self.known, self.start)

    @property
    def block(self) -> np.ndarray:
        """(N,) number of the block."""
        return ((self.t_s - self.t_s[0]) // BLOCK_S).astype(int)

    def of_group(self, group: str) -> np.ndarray:
        """(F,) bool: columns of a group."""
        return np.array([g == group for g in self.groups])


def corrected(
    model: native.Model, step_s: float, missed: Callable[[np.ndarray], np.ndarray]
) -> Predict:
    """Predictions of the base, with the velocity that it misses put in step by step.

    Args:
        model: the base.
        step_s: of the steps that `missed` was learnt from; predictions go in steps of the shortest
            horizon.
        missed: (M, F) features to (M, 3) velocities.
    """

    def predict(measurement: Measurement, windows: Windows) -> np.ndarray:
        steps = Steps.of(measurement, model, step_s)
        fine_s = HORIZONS_S[0]
        count = round(HORIZONS_S[-1] / fine_s)
        base = _fine(measurement, model, windows, fine_s, count=count)
        t_s = measurement.track.pose_t_s[windows.starts]
        first_rad = measurement.track.heading_smooth[windows.starts]
        begin = np.column_stack([measurement.track.pose[windows.starts, :2], first_rad])
        at, seen = begin.copy(), {}
        for k in range(count):
            known = np.column_stack(
                [np.interp(t_s + (k + 0.5) * fine_s, steps.t_s, c) for c in steps.known.T]
            )
            moved = base[:, k] + fine_s * missed(_with_pose(known, at))
            middle = at[:, 2] + moved[:, 2] / 2
            at += np.column_stack([*rotate(moved[:, 0], moved[:, 1], middle), moved[:, 2]])
            seen[k + 1] = _seen(begin, at, first_rad)
        found = np.stack([seen[round(h / fine_s)] for h in HORIZONS_S], axis=1)
        found[windows.ends < 0] = np.nan
        return found

    return predict


def scale(missed: np.ndarray) -> np.ndarray:
    """(3,) spread of each channel by its quartiles, which a few bumps do not move."""
    low, high = np.percentile(missed, [25, 75], axis=0)
    return np.maximum((high - low) / 1.349, 1e-6)


def _cut(measurement: Measurement, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Places of the poses that begin and end each step."""
    track, starts, ends = measurement.track, [], []
    every = max(1, round(step_s / track.timing.pose_period_s))
    for number in np.unique(track.segment[track.segment >= 0]):
        index = np.flatnonzero(track.segment == number)[::every]
        starts.append(index[:-1])
        ends.append(index[1:])
    return np.concatenate(starts).astype(np.int64), np.concatenate(ends).astype(np.int64)


def _seen(start: np.ndarray, end: np.ndarray, heading_rad: np.ndarray) -> np.ndarray:
    """(N, 3) displacement in a frame of these headings."""
    d = end - start
    turn = np.remainder(d[:, 2] + np.pi, 2 * np.pi) - np.pi
    return np.column_stack([*rotate(d[:, 0], d[:, 1], -heading_rad), turn])


def _with_pose(known: np.ndarray, pose: np.ndarray) -> np.ndarray:
    heading = pose[:, 2]
    return np.column_stack([known, np.sin(heading), np.cos(heading), pose[:, :2]])


def _known(measurement, model, t_s, body, *, step_s):
    """Regressors of each step from commands, battery and clock: columns, their names and groups."""
    axes = ("forward", "left", "turn")
    change = np.diff(body, axis=0, prepend=body[:1]) / step_s
    keep = np.exp(-step_s / MEMORY_S)
    past = lfilter([1 - keep], [1, -keep], body, axis=0) - body
    keep = np.exp(-step_s / LOAD_S)
    size = np.linalg.norm(body / np.maximum(np.abs(body).max(axis=0), 1e-9), axis=1)
    load = lfilter([1 - keep], [1, -keep], size)
    columns = [body, change, past, load[:, None], (t_s / t_s[-1])[:, None]]
    names = [*axes, *(f"change of {a}" for a in axes), *(f"past {a}" for a in axes), "load", "time"]
    groups = [SPEED] * 3 + [CHANGE] * 3 + [PAST] * 4 + [TIME]
    track = measurement.track
    if np.isfinite(track.battery_V).all() and np.ptp(track.battery_V) > 0:
        columns.append(np.interp(t_s, track.command_t_s, track.battery_V)[:, None])
        names.append("battery")
        groups.append(BATTERY)
    angle = _wheel_angles(model, body, step_s)
    columns += [np.sin(angle), np.cos(angle)]
    names += [f"{f} of wheel {i + 1}" for f in ("sin", "cos") for i in range(angle.shape[1])]
    groups += [WHEELS] * (2 * angle.shape[1])
    return np.column_stack(columns), tuple(names), tuple(groups)


def _wheel_angles(model: native.Model, body: np.ndarray, step_s: float) -> np.ndarray:
    """(N, wheels) rad in the middle of each step; none of a robot without known wheels."""
    if not model.wheels():
        return np.empty((len(body), 0))
    gains = [model.get(f"base.{g}_gain") for g in ("forward", "sideways", "yaw")]
    to_wheels = np.column_stack([model.wheel_speeds(*axis) for axis in np.eye(3)])
    turned = np.cumsum(body / gains @ to_wheels.T, axis=0) * step_s
    return turned - turned[:1] / 2


def _fine(measurement, model, windows, fine_s, *, count) -> np.ndarray:
    """(W, count, 3) what the base moves in each fine step of each window, in its own frame."""
    track = measurement.track
    half_s = track.timing.pose_period_s / 2
    wanted_s = track.pose_t_s[windows.starts][:, None] + fine_s * np.arange(1, count + 1) - half_s
    ends = np.minimum(np.searchsorted(track.pose_t_s, wanted_s), len(track.pose_t_s) - 1)
    ahead = native.windows(model, measurement.played, windows.starts, ends.astype(np.int64))
    before = np.concatenate([track.pose[windows.starts][:, None], ahead[:, :-1]], axis=1)
    d = ahead - before
    middle = before[..., 2] + d[..., 2] / 2
    return np.stack([*rotate(d[..., 0], d[..., 1], -middle), d[..., 2]], -1)
