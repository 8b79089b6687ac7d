# SPDX-License-Identifier: Apache-2.0
"""Noise of the steps' errors: white noise of poses and a disturbance of velocity with a memory.

Each channel is an ARMA(1, 2) series, with L the shift by one step and a = exp(-step / memory):

    (1 - a L) e = w + (1 - a L)(1 - L) s
    var w = (drive^2 + gain^2 m^2)(1 - a^2),   var s = sensor^2

where m is how fast the robot moves: motors and floors disturb a robot that drives, not one that
stands. What is left of AR has a banded covariance, whose Cholesky factor whitens errors and columns
alike (Box, Jenkins and Reinsel 2008, ch. 4).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import twinmill_native as native
from scipy.linalg.lapack import dpbtrf
from scipy.optimize import minimize

from twinmill.inference.evidence import log_evidence
from twinmill.inference.settings import PRIORS

MEMORY_S = (0.02, 2.0)  # shorter is white over a step, longer is a dependence on time
FINEST = 1e-5  # m or rad: below it are numerical errors of simulations, as of the noise floor
LEAST = 5e-5, 1e-4  # sensor in m or rad, drive in m/s or rad/s: a tenth of a good capture's
NUDGE = 0.1  # of logarithms, in the differences that tell how well they are known
DRIFT = PRIORS.sheet  # of the logarithms, between two logs of a robot: as of a discrepancy
EVALUATIONS = 60  # of the simplex: its evidence is flat within half a unit by then
SEEN = 0.5  # information in units of the prior, below which a direction says nothing of the noise
HEAVY = 5.0  # standard deviations, beyond which a step weighs as under Student's t


@dataclass(frozen=True)
class Course:
    """Steps that a noise is of.

    Attributes:
        step_s: length of a step.
        stretches: slices of steps that follow each other without a gap.
        pace: (W,) how fast the robot moves, over its usual displacement in a step.
        seen: (C, W) False for steps of a channel that say nothing, whose errors are 0; None where
            all say something.
    """

    step_s: float
    stretches: Sequence[slice]
    pace: np.ndarray = field(repr=False)
    seen: np.ndarray | None = field(default=None, repr=False)

    @cached_property
    def follows(self) -> np.ndarray:
        """(W,) 1 for a step whose predecessor is of its stretch."""
        found = np.ones(len(self.pace))
        found[[part.start for part in self.stretches]] = 0
        return found

    def of(self, channel: int) -> "Course":
        """The course of one channel."""
        return self if self.seen is None else replace(self, seen=self.seen[[channel]])


@dataclass(frozen=True)
class Noise:
    """Noise of the channels of steps, C of them: of a robot in the plane forward, left, turn.

    Attributes:
        sensor: (C,) of a pose, m, m, rad.
        drive, gain: (C,) displacement per step by the disturbance, m, m, rad: always, and at the
            usual pace in proportion to it.
        memory_s: (C,) of the disturbance.
        course: the steps.
        weight: (C, W) of each step's error; None for ones.
        finest: least `sensor`.
    """

    sensor: np.ndarray
    drive: np.ndarray
    gain: np.ndarray
    memory_s: np.ndarray
    course: Course
    weight: np.ndarray | None = None
    finest: float = 0.0

    def whiten(self, rows: np.ndarray) -> np.ndarray:
        """(..., C W) white errors or columns of (..., W, C), channel after channel."""
        return self._filter.white(rows, self.weight)

    def log_sizes(self, observed: np.ndarray) -> np.ndarray:
        """(C W,) log standard deviations of what is whitened: what the likelihood is divided by."""
        found = self._filter.log_sizes
        if self.weight is not None:
            found = found - np.log(self.weight).ravel()
        return found * np.repeat(observed, len(self.course.pace))

    def at(self, logs: np.ndarray) -> "Noise":
        """A noise of the same steps with (4, C) other logarithms."""
        sensor, drive, gain, memory = np.exp(logs)
        return replace(
            self,
            sensor=np.maximum(sensor, self.finest),
            drive=drive,
            gain=gain,
            memory_s=np.clip(memory, *MEMORY_S),
        )

    @property
    def logs(self) -> np.ndarray:
        """(4, C) logarithms of sensor, drive, gain and memory of each channel."""
        return np.log([self.sensor, self.drive, self.gain, self.memory_s])

    @cached_property
    def _filter(self) -> "Filter":
        return Filter.of(self.logs, self.course)


@dataclass(frozen=True)
class Usual:
    """Knowledge of a noise before a log is seen: logarithms with a normal distribution.

    Attributes:
        logs: (4, C) mean of sensor, drive, gain and memory of each channel, see `Noise.logs`.
        cov: (C, 4, 4).
        told: another log told it; then a noise that is unlike it is news.
    """

    logs: np.ndarray
    cov: np.ndarray
    told: bool = True

    @classmethod
    def about(cls, noise: Noise) -> "Usual":
        """Weak: one unit of the logarithms wide."""
        return cls(noise.logs, np.tile(np.eye(4), (noise.logs.shape[1], 1, 1)), told=False)

    def log_density(self, noise: Noise) -> float:
        """Log prior of a noise, up to a constant."""
        return self._log_density(noise, self.cov)

    def log_growth(self, noise: Noise) -> float:
        """Log prior of a noise that something new makes one unit wider, over that of the usual."""
        wide, narrow = (np.linalg.slogdet(c)[1].sum() for c in (self.cov + np.eye(4), self.cov))
        new = self._log_density(noise, self.cov + np.eye(4)) - self.log_density(noise)
        return new - 0.5 * float(wide - narrow)

    def _log_density(self, noise: Noise, cov: np.ndarray) -> float:
        away = (noise.logs - self.logs).T
        return -0.5 * float(np.sum(away * np.linalg.solve(cov, away[..., None])[..., 0]))


@dataclass(frozen=True)
class Filter:
    """Whitens rows of one channel, or of several that stand one after the other.

    Attributes:
        kept: (R,) share of the disturbance that is left from the step before.
        low: (3, R) bands of the Cholesky factor of the covariance of what AR leaves.
        seen: (R,) 0 for rows that say nothing.
    """

    kept: np.ndarray
    low: np.ndarray
    seen: np.ndarray | None = None

    @classmethod
    def of(cls, logs: np.ndarray, course: Course) -> "Filter":
        """Filter with (4, C) logarithms of sensor, drive, gain, memory in s of C channels."""
        sensor2, drive2, gain2 = np.exp(2 * logs[:3])[:, :, None]
        a = np.exp(-course.step_s / np.clip(np.exp(logs[3]), *MEMORY_S))[:, None]
        one = course.follows
        if course.seen is not None:
            one = one * course.seen * np.roll(course.seen, 1, axis=-1)
        two = one.copy()
        two[..., 1:] *= one[..., :-1]
        # shares of the pose before a step, and of the one before that, in what AR leaves
        before, last = -(1 + a * one), a * one
        push2 = (drive2 + gain2 * course.pace**2) * (1 - last**2)
        band = np.zeros((3, *last.shape))
        band[0] = push2 + sensor2 * (1 + before**2 + last**2)
        band[1, :, :-1] = sensor2 * ((before + last * np.roll(before, 1, axis=1)) * one)[:, 1:]
        band[2, :, :-2] = sensor2 * (last * two)[:, 2:]
        seen = None if course.seen is None else course.seen.ravel()
        low, failed = dpbtrf(band.reshape(3, -1), lower=1)
        if failed:
            raise np.linalg.LinAlgError("a noise of no size has no covariance to divide by")
        return cls(last.ravel(), np.ascontiguousarray(low), seen)

    def white(self, rows: np.ndarray, weight: np.ndarray | None = None) -> np.ndarray:
        """(..., R) of (..., W, C), each times a weight (C, W)."""
        many, column = rows.shape[:-2], rows.shape[-2:]
        flat = np.ascontiguousarray(rows).reshape(math.prod(many), *column)
        return native.whitened(flat, self.kept, self.low, weight).reshape(*many, len(self.kept))

    @property
    def log_sizes(self) -> np.ndarray:
        """(R,) log standard deviation of each row, given those before."""
        logs = np.log(self.low[0])
        return logs if self.seen is None else logs * self.seen


def first_noise(course: Course, recorded: dict[str, float]) -> Noise:
    """Where a search for the noise begins: as a model file records it, else a usual capture."""
    sensor = [recorded.get("sensor_m", 1e-3)] * 2 + [recorded.get("sensor_rad", 2e-3)]
    drive = [recorded.get("drive_mps", 5e-3)] * 2 + [recorded.get("drive_radps", 0.03)]
    memory = [recorded.get("drive_s", 0.2)] * 2 + [recorded.get("drive_turn_s", 0.2)]
    half = np.maximum(drive, LEAST[1]) * course.step_s / np.sqrt(2)
    return Noise(
        np.maximum(sensor, LEAST[0]),
        half,
        half,
        np.clip(memory, 1.5 * MEMORY_S[0], MEMORY_S[1]),
        course,
        finest=FINEST,
    )


def fit_noise(errors: np.ndarray, columns: np.ndarray, begin: Noise, usual: Usual) -> Noise:
    """The noise with the largest posterior of a linear model, channel by channel.

    Args:
        errors: (W, C) of the base.
        columns: (K, W, C) of what is free, each with a standard normal prior.
        begin: where to begin.
        usual: its prior.
    """
    logs = begin.logs
    for c, channel in _channels(errors, columns, begin, usual):
        logs[:, c] = channel.fitted(logs[:, c])
    return begin.at(logs)


def usual_after(errors: np.ndarray, columns: np.ndarray, noise: Noise) -> Usual:
    """Knowledge of the noise of other logs, from one log in which it was found.

    Args:
        errors: (W, C) of that log.
        columns: (K, W, C), as of `fit_noise`.
        noise: as found there.
    """
    usual = Usual.about(noise)
    cov = usual.cov.copy()
    for c, channel in _channels(errors, columns, noise, usual):
        cov[c] = channel.spread(noise.logs[:, c])
    return Usual(noise.logs, cov + DRIFT**2 * np.eye(4))


def _channels(
    errors: np.ndarray, columns: np.ndarray, begin: Noise, usual: Usual
) -> Iterator[tuple[int, "_Channel"]]:
    """Number and posterior of each channel that has errors."""
    for c in range(errors.shape[1]):
        if np.any(errors[:, c]):
            used = np.abs(columns[:, :, c]).max(axis=1, initial=0.0) > 1e-12
            course = begin.course.of(c)
            own = _seen(columns[used][:, :, c], Filter.of(begin.logs[:, [c]], course))
            both = np.concatenate([errors[None, :, c], own])
            yield c, _Channel(both, usual.logs[:, c], np.linalg.inv(usual.cov[c]), course)


def _seen(columns: np.ndarray, whitening: Filter) -> np.ndarray:
    """(K', W) directions of (K, W) columns of which a channel tells more than their prior does."""
    white = whitening.white(columns[..., None])
    values, ways = np.linalg.eigh(white @ white.T)
    return ways[:, values > SEEN].T @ columns


@dataclass(frozen=True)
class _Channel:
    """Posterior of the noise of one channel.

    Attributes:
        both: (1 + K, W) errors and columns of what is free.
        mean, precision: (4,), (4, 4) of the logarithms before.
        course: the steps.
    """

    both: np.ndarray
    mean: np.ndarray
    precision: np.ndarray
    course: Course

    def cost(self, logs: np.ndarray) -> float:
        """Negative log posterior of (4,) logarithms, up to a constant."""
        whitening, away = Filter.of(logs[:, None], self.course), logs - self.mean
        white = whitening.white(self.both[..., None])
        found = log_evidence(white[0], white[1:]) - whitening.log_sizes.sum()
        return -found + 0.5 * float(away @ self.precision @ away)

    def fitted(self, start: np.ndarray) -> np.ndarray:
        """(4,) where it is largest."""
        options = {
            "maxfev": EVALUATIONS,
            "xatol": 0.05,
            "fatol": 0.3,
            "initial_simplex": np.vstack([start, *(start + 0.5 * np.eye(4))]),
        }
        return minimize(self.cost, start, method="Nelder-Mead", options=options).x

    def spread(self, at: np.ndarray) -> np.ndarray:
        """(4, 4) covariance by the curvature there; no direction is less known than before."""
        ways = NUDGE * np.eye(4)
        curved = np.empty((4, 4))
        for i, a in enumerate(ways):
            for j, b in enumerate(ways[: i + 1]):
                four = [self.cost(at + s * a + t * b) * s * t for s in (1, -1) for t in (1, -1)]
                curved[i, j] = curved[j, i] = sum(four) / (2 * NUDGE) ** 2
        values, axes = np.linalg.eigh(curved)
        return axes / np.maximum(values, np.linalg.eigvalsh(self.precision)[0]) @ axes.T


def weights_of(left: np.ndarray) -> np.ndarray:
    """(C, W) weights of residuals (C, W), those of Student's t for what is far off."""
    size = np.sqrt(np.median(left**2, axis=1) / 0.455)  # 0.455: median of a squared normal variate
    size = np.where(size > 0, size, 1.0)[:, None]
    return np.minimum(1.0, HEAVY / np.maximum(np.abs(left) / size, 1e-9)) / np.maximum(size, 1.0)
