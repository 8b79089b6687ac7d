# SPDX-License-Identifier: Apache-2.0
"""Noise of a log: white sensor noise and coloured drive noise, and the filter that whitens both.

One-step errors of a right model are e_k = dt n_k + s_k - s_(k-1): s is the sensor's noise, white; n
is a disturbance of the velocity, first order: n_(k+1) = phi n_k + sqrt(1 - phi^2) sigma_d w_k with
phi = exp(-dt / tau). Whitened, they have unit variance and no memory.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from twinmill.filters import filtered
from twinmill.predict.residual import StepGrid

CHUNK = 256  # steps of one periodogram: 2 s at 120 Hz, a few times the disturbance's memory
FEWEST_CHUNKS = 6
FINER = 2  # frequencies per bin at which the spectrum is taken: exact up to memories of a stretch
TRANSIENT = 20  # steps after a break in which the filter settles
# Least noise of sensor and drive, of position and heading: less than any capture and floor have.
# Residuals of a noise-free log are numerical error.
LEAST = ((1e-5, 1e-4), (1e-4, 1e-3))
LEAST_MEMORY_S = 0.15
MEMORIES_S = (0.03, 0.15, 0.6)  # at which a fit begins
MEMORY_S = (0.01, 2.0)  # beyond these a fit is held back ...
HELD_BACK = 1e3  # ... by this times the square of the logarithm
LOGS = (-25.0, 5.0)  # of all quantities
ROUNDS = 60
CONVERGED = 1e-9  # fall of the cost
TINY = 1e-9  # curvature of what has no trace


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one channel: sensor (m or rad), drive (m/s or rad/s), its memory."""

    sensor: float
    drive: float
    memory_s: float

    def spectrum(self, frequency_Hz: np.ndarray, period_s: float) -> np.ndarray:
        """Power of one-step errors per sample at these frequencies."""
        sensor, drive, _ = self.spectra(frequency_Hz, period_s)
        return sensor + drive

    def spectra(
        self, frequency_Hz: np.ndarray, period_s: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Power of the sensor and of the drive, and the drive's slope by the log of its memory."""
        cosine = np.cos(2 * np.pi * frequency_Hz * period_s)
        phi = np.exp(-period_s / self.memory_s)
        poles = 1 + phi**2 - 2 * phi * cosine
        drive = (period_s * self.drive) ** 2 * (1 - phi**2) / poles
        by_phi = -2 * phi / (1 - phi**2) - 2 * (phi - cosine) / poles
        return (
            self.sensor**2 * (2 - 2 * cosine),
            drive,
            drive * by_phi * phi * period_s / self.memory_s,
        )

    def whitening(self, period_s: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Filter (numerator, denominator) and standard deviation of what comes out of it."""
        phi = np.exp(-period_s / self.memory_s)
        fresh = (period_s * self.drive) ** 2 * (1 - phi**2)
        variance = self.sensor**2
        # Autocovariance of (1 - phi B) e, factored into the minimum-phase moving average.
        lags = [
            variance * phi,
            -variance * (1 + phi) ** 2,
            fresh + variance * (1 + (1 + phi) ** 2 + phi**2),
        ]
        roots = np.roots([*lags, lags[1], lags[0]])
        inside = roots[np.argsort(np.abs(roots))][:2]
        average = np.real(np.poly(inside))
        scale = np.sqrt(lags[0] / average[2])
        return np.array([1.0, -phi]), average, float(scale)


@dataclass(frozen=True)
class Noise:
    """Noise of a log: position and heading.

    Attributes:
        speed_mps: RMS speed of the log while it drives; 0 where that is not known.
    """

    position: ChannelNoise
    heading: ChannelNoise
    speed_mps: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """The interface's field names."""
        return {
            "sensor_m": self.position.sensor,
            "sensor_rad": self.heading.sensor,
            "drive_mps": self.position.drive,
            "drive_radps": self.heading.drive,
            "drive_s": self.position.memory_s,
            "drive_turn_s": self.heading.memory_s,
        }

    def loudness(self, period_s: float) -> float:
        """Log of the one-step variance that remains when all memory is used, over channels."""
        scales = [noise.whitening(period_s)[2] for noise in (self.position, self.heading)]
        return float(4 * np.log(scales[0]) + 2 * np.log(scales[1]))

    def whiten(self, errors: np.ndarray, grid: StepGrid) -> np.ndarray:
        """(..., S, 3) one-step errors to whitened ones; zero where the filter still settles."""
        white = np.zeros_like(errors)
        for channels, noise in ((slice(0, 2), self.position), (slice(2, 3), self.heading)):
            numerator, denominator, scale = noise.whitening(grid.period_s)
            for part in grid.slices:
                white[..., part, channels] = (
                    filtered(numerator, denominator, errors[..., part, channels], axis=-2) / scale
                )
        for start in grid.starts:
            white[..., start : start + TRANSIENT, :] = 0
        return white


def fit_noise(errors: list[np.ndarray], moving: np.ndarray, grid: StepGrid) -> Noise:
    """Estimates the noise from what a flexible model leaves.

    Args:
        errors: (S, 3) one-step errors; their mean power is taken. A channel that was not measured
            (NaN) has the least noise of all.
        moving: (S,) bool: the disturbance acts only then.
        grid: of the steps.

    The median over stretches of 2 s keeps passing physics (a start, a stop) out of the noise. Poses
    that are too few for the shortest stretch tell no noise: it is the least.
    """
    chunk = CHUNK
    while (pieces := _pieces(grid, moving, chunk)) is None:
        chunk //= 2
    if not len(pieces):
        position, heading = (ChannelNoise(*least, LEAST_MEMORY_S) for least in LEAST)
        return Noise(position, heading)
    bins, taken = _bins(chunk)
    power = np.mean([_median_power(np.nan_to_num(e), pieces, bins) for e in errors], axis=0)
    return Noise(
        _fit_channel(power[:, :2].mean(1), taken, grid.period_s, LEAST[0]),
        _fit_channel(power[:, 2], taken, grid.period_s, LEAST[1]),
    )


def _pieces(grid: StepGrid, moving: np.ndarray, chunk: int) -> np.ndarray | None:
    """(C,) starts of overlapping stretches in which the robot moves; None if there are too few.

    Of the shortest stretches all are taken where it never moves for so long.
    """
    each = [
        np.arange(part.start + TRANSIENT, part.stop - chunk, chunk // 2) for part in grid.slices
    ]
    everywhere = np.concatenate([np.zeros(0, int), *each])
    moved = np.concatenate([[0], np.cumsum(moving)])  # steps so far
    starts = everywhere[moved[everywhere + chunk] - moved[everywhere] > 0.9 * chunk]
    if len(starts) < FEWEST_CHUNKS and chunk > CHUNK // 8:
        return None
    return starts if len(starts) else everywhere


@cache
def _bins(chunk: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights that make a spectrum, and how they blur it.

    Returns:
        (F, chunk) weights whose sums over a stretch are its spectrum: taper, wave, mean left out;
        (F, N) what each bin takes in of N frequencies from 0 up, of either sign, FINER than the
        bins.
    """
    taper = np.hanning(chunk + 1)[:-1]
    wave = np.exp(-2j * np.pi * np.outer(np.arange(1, chunk // 2), np.arange(chunk)) / chunk)
    weights = taper * wave / np.sqrt(np.sum(taper**2))
    weights -= weights.mean(axis=1, keepdims=True)
    half = FINER * chunk // 2
    either = np.abs(np.fft.fft(weights, 2 * half, axis=1)) ** 2 / (2 * half)
    taken = either[:, : half + 1].copy()
    taken[:, 1:half] += either[:, :half:-1]
    return weights, taken


def _median_power(errors: np.ndarray, pieces: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """(F, 3) power per sample: the median over stretches, over that of exponential variates."""
    stretches = errors[pieces[:, None] + np.arange(bins.shape[1])]
    power = np.abs(np.einsum("fk,ckx->cfx", bins, stretches, optimize=True)) ** 2
    return np.median(power, axis=0) / _median_of_exponentials(len(pieces))


def _median_of_exponentials(count: int) -> float:
    """Expected median of so many of mean 1: their k-th has mean 1/count + ... of k terms."""
    waits = np.cumsum(1 / np.arange(count, 0, -1))
    return float(waits[[(count - 1) // 2, count // 2]].mean())


def _fit_channel(
    power: np.ndarray, taken: np.ndarray, period_s: float, least: tuple[float, float]
) -> ChannelNoise:
    """Whittle's likelihood over sensor, drive and memory, with what each bin takes in from others.

    Debiased as by Sykulski et al. 2019, Biometrika 106(2): a short stretch blurs the spectrum, and
    leaving out its mean takes part of the slow drive noise away.
    """
    frequency_Hz = np.fft.rfftfreq(2 * (taken.shape[1] - 1), period_s)
    quiet = ChannelNoise(*least, LEAST_MEMORY_S)
    power = np.maximum(power, taken @ quiet.spectrum(frequency_Hz, period_s))
    sensor = np.sqrt(power[-len(power) // 4 :].mean() / 4)
    drive = np.sqrt(power[: len(power) // 8].mean()) / period_s / 5

    whittle = _Whittle(power, taken, frequency_Hz, period_s)
    fits = [whittle.least(np.log([sensor, drive, memory_s])) for memory_s in MEMORIES_S]
    return ChannelNoise(*np.exp(min(fits, key=lambda fit: fit[0])[1]))


@dataclass(frozen=True)
class _Whittle:
    """The cost of a noise whose sensor, drive and memory have these logarithms.

    Attributes:
        power: (F,) that was found.
        taken: (F, N) what each bin takes in of N frequencies.
        frequency_Hz: (N,) these.
        period_s: of the steps.
    """

    power: np.ndarray
    taken: np.ndarray
    frequency_Hz: np.ndarray
    period_s: float

    def at(self, logs: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Cost, its (3,) slope and (3, 3) expected curvature (Fisher's information)."""
        spectra = ChannelNoise(*np.exp(logs)).spectra(self.frequency_Hz, self.period_s)
        sensor, drive, bent = (self.taken @ np.stack(spectra, axis=-1)).T
        model = sensor + drive
        slopes = np.array([2 * sensor, 2 * drive, bent]) / model
        over = logs[2] - np.clip(logs[2], *np.log(MEMORY_S))
        cost = np.sum(np.log(model) + self.power / model) + HELD_BACK * over**2
        push = slopes @ (1 - self.power / model) + (0, 0, 2 * HELD_BACK * over)
        curvature = slopes @ slopes.T + np.diag([0, 0, 2 * HELD_BACK * (over != 0)])
        return float(cost), push, curvature

    def least(self, logs: np.ndarray) -> tuple[float, np.ndarray]:
        """Least cost near some logs, and where it is: Fisher's scoring, damped."""
        damping, (cost, push, curvature) = 1e-3, self.at(logs)
        for _ in range(ROUNDS):
            lifted = curvature + np.diag(damping * np.diag(curvature) + TINY)
            moved = np.clip(logs - np.linalg.solve(lifted, push), *LOGS)
            then = self.at(moved)
            if not then[0] < cost:
                damping *= 10
                continue
            fell, logs, damping = cost - then[0], moved, damping / 10
            cost, push, curvature = then
            if fell < CONVERGED:
                break
        return cost, logs
