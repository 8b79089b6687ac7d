# SPDX-License-Identifier: Apache-2.0
"""The noise floor of a log: the errors that the noise of the best model found would cause.

The search begins at the robot's form refitted to the log, so that the floor belongs to the log and
not to the model that is judged over it. What the best model leaves is noise, which is drawn again
and again along the drive: it makes errors in windows.
"""

import hashlib
from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import SMOOTH_S, local_line
from twinmill.estimation.opened import NoiseFloor, known_offset_s
from twinmill.estimation.refit import refitted, too_poor
from twinmill.filters import faded
from twinmill.inference.best import Best, best_effects, settled
from twinmill.inference.independence import independent_shares
from twinmill.inference.noise import MEMORY_S
from twinmill.inference.planar import PlanarProblem, problem_of
from twinmill.inference.steps import StepsOfLog
from twinmill.model.form_file import form_file
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import CLOCK, HEADING
from twinmill.predict.datasets import Trajectory
from twinmill.predict.residual import rotate
from twinmill.predict.whiteness import memory
from twinmill.predict.windows import HORIZONS_S, rms

DRAWS = 64  # of the noise: 90 s have 45 independent errors over 2 s, whose RMS 64 tell to 1.3 %
WITHIN = (0.025, 0.975)  # quantiles of the scores of a right model
MOST_HIDDEN = 0.25  # share of the windows that moments may keep from being judged
FEW = 8  # of them, of which correlations are taken

_found: dict[str, NoiseFloor] = {}  # by log and form: each measurement is opened several times


def noise_floor(measurement: Measurement, model_file: ModelFile) -> NoiseFloor:
    """Finds the noise floor of one robot in one log.

    Args:
        measurement: of the robot.
        model_file: only the robot's form is used, and the offset of its clocks where other logs
            told it.
    """
    offset_s = known_offset_s(measurement, model_file)
    form = form_file(model_file, (0.0, 100.0), clock=offset_s is not None)
    key = _digest(measurement, form, offset_s)
    if key not in _found:
        data = Trajectory.of(measurement.punctual())
        if reason := too_poor(data):
            return NoiseFloor.none(data, reason)
        refit = refitted(data, model_file, offset_s)
        problem = problem_of([measurement], refit.file, sheet=True)
        floor = _floor(data, problem)
        base = refit.base
        _found[key] = replace(floor, offset_s=base.get(CLOCK), heading_rad=base.get(HEADING))
    return _found[key]


def _digest(measurement: Measurement, form: ModelFile, offset_s: float | None) -> str:
    """Hash of all that a floor follows from."""
    track = measurement.punctual().track
    found = hashlib.blake2b(f"{form.text}{offset_s}{track.command_kind}".encode())
    for values in (
        track.pose, track.pose_t_s, track.segment, track.command, track.command_t_s,
        track.battery_V, track.heading_smooth,
    ):  # fmt: skip
        found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


def _floor(data: Trajectory, problem: PlanarProblem) -> NoiseFloor:
    (log,), (h, view) = problem.steps.logs, best_effects(problem)
    models = settled(h, problem, view, sudden=True)
    likeliest, _ = max(models, key=lambda m: m[1])
    keep = _undisturbed(data, likeliest.hidden_s(log))
    if keep.mean() < 1 - MOST_HIDDEN:  # a robot that is disturbed so often is so by itself
        models, keep = settled(h, problem, view, sudden=False), np.ones(len(keep), bool)
        likeliest, _ = max(models, key=lambda m: m[1])
    seen = np.isfinite(data.measured) & keep[:, None, None]
    random = np.random.default_rng(0)
    first, each, memories = [], [], []
    for best, share in models:
        drive, draws = _Drive(data, log, best), round(share * DRAWS)
        for k in range(draws):
            errors = np.where(seen, drive.errors(random), np.nan)
            each.append(rms(errors))
            memories.append(memory(errors))
            first += [errors] if best is likeliest and k < FEW else []
    moves = rms(data.measured) > 1e-9
    floor = np.where(moves, np.sqrt(np.mean(np.square(each), axis=0)), np.nan)
    scores = np.sqrt(np.nanmean((each / floor) ** 2, axis=(1, 2)))
    low, high = np.quantile(scores, WITHIN)
    apart_s = np.ptp(data.start_s) + 2 * HORIZONS_S[-1]
    start_s = np.concatenate([data.start_s + k * apart_s for k in range(FEW)])
    return NoiseFloor(
        floor,
        keep,
        kind="noise",
        independent=independent_shares(np.concatenate(first), start_s),
        by_chance=(float(low), float(high)),
        memories=np.array(memories),
    )


def _undisturbed(data: Trajectory, hidden_s: np.ndarray) -> np.ndarray:
    """(W,) windows in which nothing happened."""
    begin_s, end_s = hidden_s.T[:, :, None]
    reach_s = data.start_s + HORIZONS_S[-1]
    return ~((data.start_s < end_s) & (reach_s > begin_s)).any(axis=0)


class _Drive:
    """A drive as it was measured, along which noise is drawn.

    To first order in the errors of the heading, which turn all motion after them.
    """

    def __init__(self, data: Trajectory, log: StepsOfLog, best: Best) -> None:
        track, windows, noise = data.measurement.track, data.windows, best.noise
        t_s, pose = track.pose_t_s, track.pose
        self._heading = track.heading_smooth[log.starts]
        self._step = pose[log.ends, :2] - pose[log.starts, :2]
        spans = t_s[log.starts], t_s[log.ends]
        self._begins = _Place.at(t_s[windows.starts], *spans)
        self._ends = _Place.at(t_s[windows.ends], *spans)
        self._way = pose[windows.ends, :2] - pose[windows.starts, :2][:, None]
        self._begin_rad = track.heading_smooth[windows.starts]
        self._smoothing = Smoothing.of(data.measurement, best.h.model).at(windows.starts)
        weight = np.ones((3, len(log.t_s))) if noise.weight is None else noise.weight
        observed = np.where(log.observed, 1.0, 0.0)
        self._sensor = observed * noise.sensor / np.median(weight, axis=1)
        pace = noise.course.pace[:, None]
        size = np.sqrt(noise.drive**2 + noise.gain**2 * pace**2)
        self._size = observed * size / weight.T
        kept = np.exp(-noise.course.step_s / np.clip(noise.memory_s, *MEMORY_S))
        self._kept = kept * noise.course.follows[:, None]

    def errors(self, random: np.random.Generator) -> np.ndarray:
        """(W, H, 3) errors of one draw, seen from the starts; m, m, rad."""
        new = np.sqrt(1 - self._kept**2) * random.normal(size=self._kept.shape)
        ahead, left, turn = (self._size * faded(self._kept, new)).T
        turned = np.cumsum(turn) - turn / 2
        x, y = rotate(ahead, left, self._heading)
        pushed = np.column_stack([
            x - turned * self._step[:, 1], y + turned * self._step[:, 0], turn
        ])  # fmt: skip
        before = np.cumsum(pushed, axis=0) - pushed
        begin = self._begins.of(before, pushed)
        moved = self._ends.of(before, pushed) - begin[:, None]
        noise_rad = random.normal(size=len(begin)) * self._sensor[2]
        wrong_rad = self._smoothing.bias_rad + self._smoothing.share * noise_rad
        off_rad = (begin[:, 2] + wrong_rad)[:, None]
        moved[..., 0] += off_rad * self._way[..., 1]
        moved[..., 1] -= off_rad * self._way[..., 0]
        moved[..., 2] -= noise_rad[:, None]
        seen = rotate(moved[..., 0], moved[..., 1], -self._begin_rad[:, None])
        moved[..., 0], moved[..., 1] = seen
        start = random.normal(size=(len(begin), 1, 3)) * self._sensor * (1, 1, 0)
        return moved + random.normal(size=moved.shape) * self._sensor - start


@dataclass(frozen=True)
class Smoothing:
    """Errors of smoothed headings at some poses.

    Attributes:
        bias_rad: what a straight line misses of the motion.
        share: of the noise of one reading that is left.
    """

    bias_rad: np.ndarray
    share: np.ndarray

    @classmethod
    def of(cls, measurement: Measurement, model: native.Model) -> "Smoothing":
        """Those of all poses of a robot that turns as a model does."""
        track = measurement.track
        if not track.has_heading:
            return cls(np.zeros(len(track.pose)), np.zeros(len(track.pose)))
        ahead = native.one_step(model, measurement.played)[:, 2]
        turns = np.nan_to_num(ahead[1:] - track.pose[:-1, 2])
        turned = np.cumsum(np.r_[0.0, np.where(np.abs(turns) < np.pi, turns, 0.0)])
        smooth, _ = local_line(track.pose_t_s, turned, track.segment, SMOOTH_S)
        begin, end = (
            np.searchsorted(track.pose_t_s, track.pose_t_s + reach_s)
            for reach_s in (-SMOOTH_S, SMOOTH_S)
        )
        return cls(np.nan_to_num(smooth - turned), 1 / np.sqrt(np.maximum(end - begin, 1)))

    def at(self, poses: np.ndarray) -> "Smoothing":
        """Those of some poses."""
        return Smoothing(self.bias_rad[poses], self.share[poses])


@dataclass(frozen=True)
class _Place:
    """Times among steps: the number of the step, and the share of it that has passed."""

    step: np.ndarray
    share: np.ndarray

    @classmethod
    def at(cls, t_s: np.ndarray, begin_s: np.ndarray, end_s: np.ndarray) -> "_Place":
        """Places of some times; before the first step, and in a gap, that of the next begin."""
        step = np.minimum(np.searchsorted(end_s, t_s), len(end_s) - 1)
        share = (t_s - begin_s[step]) / (end_s - begin_s)[step]
        return cls(step, np.clip(share, 0.0, 1.0)[..., None])

    def of(self, before: np.ndarray, each: np.ndarray) -> np.ndarray:
        """(..., K) of (S, K) sums before each step, and of what each adds."""
        return before[self.step] + self.share * each[self.step]
