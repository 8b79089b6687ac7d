# SPDX-License-Identifier: Apache-2.0
"""Series for the browser, as arrays: thinned to what an eye can resolve."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import twinmill_native as native

from twinmill.data.camera_frames import Frames
from twinmill.data.log import RobotLog
from twinmill.data.measurement import Measurement
from twinmill.data.track import Track, local_line
from twinmill.estimation.opened import NoiseFloor
from twinmill.predict.detections import Detections
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.regimes import HORIZON, regime_masks
from twinmill.predict.residual import StepGrid, body_velocity, rotate
from twinmill.predict.windows import HORIZONS_S, Windows, difference

PATH_S = 0.05  # between points of a path
SPEED_S = 0.04  # between points of a speed
STEP_S = 0.1  # between points of a prediction, and between their starts
AHEAD = 20  # points of a prediction: 2 s
RESTARTS = 5  # starts between those half a second apart, at which paths begin anew
SPEED_HALF_S = 0.06  # half width of the line that tells a measured speed
SHORT, LONG = HORIZONS_S.index(0.5), HORIZONS_S.index(2.0)
WITHIN_95 = 1.96  # standard deviations

Arrays = dict[str, np.ndarray]


def measured_path(t_s: np.ndarray, pose: np.ndarray, known: np.ndarray) -> Arrays:
    """(T, 4) t_s, x_m, y_m, theta_rad of (N, 3) poses; NaN where they are not known."""
    if not len(t_s):
        return {"path": np.empty((0, 4))}
    period_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else PATH_S
    every = max(1, round(PATH_S / period_s))
    pose = np.column_stack([pose[:, :2], np.nan_to_num(pose[:, 2])])
    return {"path": np.column_stack([t_s, np.where(known[:, None], pose, np.nan)])[::every]}


def commands(robot: RobotLog | Track) -> Arrays:
    """(M, 1 + C) robot's clock and commands, where they change and at the end."""
    width = 3 if robot.command_kind == "twist" else 4
    if not len(robot.command_t_s):
        return {"commands": np.empty((0, 1 + width))}
    rows = np.column_stack([robot.command_t_s, robot.command[:, :width]])
    if robot.command_kind == "duty":
        rows[:, 1:] *= 100
    change = np.any(np.diff(rows[:, 1:], axis=0) != 0, axis=1)
    kept = np.concatenate([[True], change])
    kept[-1] = True
    return {"commands": rows[kept]}


def seen(frames: Frames | None) -> Arrays:
    """(K, 1 + k) robot's clock and the k bits that its camera told, where one changes."""
    if frames is None or not len(frames.t_s):
        return {"seen": np.empty((0, 2))}
    kept = np.concatenate([[True], np.any(np.diff(frames.told, axis=0), axis=1)])
    kept[-1] = True
    return {"seen": np.column_stack([frames.t_s, frames.told])[kept]}


def expected(detections: Detections, model: native.Model) -> Arrays:
    """(K, 2) robot's clock and how likely a model has the bit that `seen` tells; NaN if unknown."""
    frames = detections.frames
    chance = np.where(
        detections.usable, detections.reported(model, raw=not frames.has_vote), np.nan
    )
    period_s = float(np.median(np.diff(frames.t_s))) if len(frames.t_s) > 1 else STEP_S
    every = max(1, round(STEP_S / max(period_s, 1e-3)))
    return {"expected": np.column_stack([frames.t_s, chance])[::every]}


def measured_speed(track: Track) -> Arrays:
    """(T, 4) t_s, forward and left in m/s, turn in rad/s, from the poses."""
    half_s = max(SPEED_HALF_S, 1.5 * track.timing.pose_period_s)
    x_mps, y_mps, turn_radps = local_line(track.pose_t_s, track.pose, track.segment, half_s)[1].T
    forward, left = rotate(x_mps, y_mps, -track.heading_smooth)
    every = max(1, round(SPEED_S / track.timing.pose_period_s))
    return {"speed": np.column_stack([track.pose_t_s, forward, left, turn_radps])[::every]}


class RobotView:
    """One robot in one log as it is drawn: what does not depend on the model is found once.

    Args:
        measurement: of the robot.
        noise: its floor.
        clock_free: the clock's offset was found from this log itself.
    """

    def __init__(self, measurement: Measurement, noise: NoiseFloor, clock_free: bool) -> None:
        self.measurement, self.noise, self.clock_free = measurement, noise, clock_free
        self.track = measurement.track
        self.grid = StepGrid.of(measurement)
        self.windows = Windows.of(self.track)
        self._measured = self.windows.measured(measurement)
        self._starts, self._ends = _everywhere(self.track)

    @property
    def floor(self) -> np.ndarray:
        """(H, 3) errors that count as one; NaN without a floor."""
        return self.noise.rms

    def errors(self, model: native.Model) -> np.ndarray:
        """(W, H, 3) measured less predicted; NaN where it is not judged."""
        predicted = self.windows.predicted(self.measurement, model)
        errors = difference(self._measured, predicted)
        return np.where(self.noise.keep[:, None, None], errors, np.nan)

    def modelled(self, model: native.Model) -> ModelledLog:
        """Measurement and model, without the noise, which no drawing needs."""
        return ModelledLog(self.measurement, model, self.grid, self.clock_free)

    def moments(self, model: native.Model) -> dict[tuple[str, str], tuple[np.ndarray, float]]:
        """By group and regime: (K,) s, starts of the predictions in it, and that of the worst."""
        over = (self.errors(model)[:, HORIZON] / self.floor[HORIZON]) ** 2
        squares = over[:, np.isfinite(self.floor[HORIZON])].mean(axis=1)
        t_s = self.track.pose_t_s[self.windows.starts]
        found = {}
        for group, name, inside in regime_masks(self.modelled(model), self.windows):
            worst = np.argmax(np.where(inside & np.isfinite(squares), squares, -1.0))
            found[group, name] = t_s[inside], float(t_s[worst])
        return found

    def measured(self) -> Arrays:
        """Arrays from the log alone: speeds, and the band that a right model keeps to.

        band: (5, 4) horizon_s, forward and left in m, heading in rad: 95 % of the errors of a right
        model are within it.
        """
        band = np.column_stack([HORIZONS_S, WITHIN_95 * self.floor])
        return {**measured_speed(self.track), "band": band}

    def predicted(self, model: native.Model, every: int = 1) -> Arrays:
        """Arrays from the model; of the places where predictions start, each so many-th.

        starts: (S, 4) t_s and pose from which a prediction starts; ahead: (S, AHEAD, 2) places
        after each step, NaN where the track ends; predicted_speed: (T, 4) as the measured one;
        errors: (W, 5) t_s, then position in m and heading in rad, 0.5 s and 2 s ahead.
        """
        started = self.measurement.started
        begin, end = self._starts[::every], self._ends[::every]
        with ThreadPoolExecutor(1) as beside:
            velocity = beside.submit(body_velocity, self.measurement, self.grid, model.copy())
            ahead = native.windows(model, started, begin, end)
            errors = self.errors(model)
        ahead[end < 0] = np.nan
        starts = np.column_stack([self.track.pose_t_s[begin], self.track.pose[begin]])
        stride = max(1, round(SPEED_S / self.grid.period_s))
        start_s = self.track.pose_t_s[self.windows.starts]
        far = [f(errors[:, h]) for h in (SHORT, LONG) for f in (_position_m, _heading_rad)]
        return {
            "starts": starts,
            "ahead": ahead[..., :2],
            "predicted_speed": np.column_stack([self.grid.t_s, velocity.result()])[::stride],
            "errors": np.column_stack([start_s, *far]),
        }

    @property
    def step_s(self) -> float:
        """Between points of a prediction."""
        return _stride(self.track) * self.track.timing.pose_period_s


def _stride(track: Track) -> int:
    return max(1, round(STEP_S / track.timing.pose_period_s))


def _everywhere(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Starts all along the track, and the poses that follow each at even steps."""
    stride = _stride(track)
    starts = np.flatnonzero(track.segment >= 0)[::stride].astype(np.int64)
    ends = starts[:, None] + stride * np.arange(1, AHEAD + 1)
    inside = ends < len(track.pose_t_s)
    ends = np.where(inside, ends, 0)
    ends[~inside | (track.segment[ends] != track.segment[starts][:, None])] = -1
    ends[np.cumsum(ends < 0, axis=1) > 0] = -1
    return starts, ends.astype(np.int64)


def _position_m(errors: np.ndarray) -> np.ndarray:
    return np.hypot(errors[:, 0], errors[:, 1])


def _heading_rad(errors: np.ndarray) -> np.ndarray:
    return errors[:, 2]
