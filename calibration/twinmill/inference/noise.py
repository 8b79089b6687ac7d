# SPDX-License-Identifier: Apache-2.0
"""Noise of the steps' errors: white noise of poses and a disturbance of velocity with a memory.

Each channel is an ARMA(1, 2) series, with L the shift by one step and a = exp(-step / memory):

    (1 - a L) e = w + (1 - a L)(1 - L) s,   var w = drive^2 (1 - a^2),   var s = sensor^2

so that one recursive filter whitens errors and columns alike (Box, Jenkins and Reinsel
2008, ch. 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from twinmill.inference.evidence import log_evidence

ROWS = 60  # of the banded Toeplitz matrix whose last Cholesky row is the MA part, converged
MEMORY_S = (0.02, 2.0)  # shorter is white over a step, longer is a dependence on time
LEAST = 5e-5, 1e-4  # sensor in m or rad, drive in m/s or rad/s: a tenth of a good capture's
EVALUATIONS = 45  # of the simplex: its evidence is flat within half a unit by then
SEEN = 0.5  # information in units of the prior, below which a direction says nothing of the noise
HEAVY = 5.0  # standard deviations, beyond which a step weighs as under Student's t


@dataclass(frozen=True)
class Noise:
    """Noise of three channels.

    Attributes:
        sensor: (3,) of a pose, m, m, rad.
        drive: (3,) displacement per step by the disturbance, m, m, rad.
        memory_s: (3,) of the disturbance.
        step_s: length of a step.
        weight: (3, W) of each step's error; None for ones.
    """

    sensor: np.ndarray
    drive: np.ndarray
    memory_s: np.ndarray
    step_s: float
    weight: np.ndarray | None = None

    def whiten(self, rows: np.ndarray, stretches: Sequence[slice]) -> np.ndarray:
        """(..., 3 W) white errors or columns of (..., W, 3), channel after channel."""
        out = np.empty((*rows.shape[:-2], 3, rows.shape[-2]))
        for c in range(3):
            _filter(rows[..., c], stretches, self._filters[c], out[..., c, :])
        if self.weight is not None:
            out *= self.weight
        return out.reshape(*rows.shape[:-2], 3 * rows.shape[-2])

    def log_size(self, count: int, observed: np.ndarray) -> float:
        """Sum of log standard deviations over `count` steps: what the likelihood is divided by."""
        scales = [self._filters[c][2] for c in np.flatnonzero(observed)]
        found = count * float(np.sum(np.log(scales)))
        return found if self.weight is None else found - float(np.log(self.weight[observed]).sum())

    def log_odds(self, usual: "Noise") -> float:
        """Log prior of such a noise over that of the usual one: one unit of the logarithms wide."""
        return -0.5 * float(np.sum((self.logs - usual.logs) ** 2))

    @property
    def logs(self) -> np.ndarray:
        """(3, 3) logarithms of sensor, drive and memory of each channel."""
        return np.log([self.sensor, self.drive, self.memory_s])

    @cached_property
    def _filters(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        a = np.exp(-self.step_s / self.memory_s)
        return [arma(self.sensor[c], self.drive[c], a[c]) for c in range(3)]


def arma(sensor: float, drive: float, a: float) -> tuple[np.ndarray, np.ndarray, float]:
    """AR and MA coefficients of one channel, and the standard deviation of its innovations."""
    d = np.array([1.0, -(1 + a), a]) * sensor
    g = np.array([d @ d + drive**2 * (1 - a**2), d[:2] @ d[1:], d[0] * d[2]])
    band = np.zeros((ROWS, ROWS))
    for k in range(3):
        i = np.arange(ROWS - k)
        band[i, i + k] = band[i + k, i] = g[k]
    last = np.linalg.cholesky(band)[-1]
    scale = last[-1]
    return np.array([1.0, -a]), np.array([1.0, last[-2] / scale, last[-3] / scale]), float(scale)


def first_noise(step_s: float, recorded: dict[str, float]) -> Noise:
    """Where a search for the noise begins: as a model file records it, else a usual capture."""
    sensor = [recorded.get("sensor_m", 1e-3)] * 2 + [recorded.get("sensor_rad", 2e-3)]
    drive = [recorded.get("drive_mps", 5e-3)] * 2 + [recorded.get("drive_radps", 0.03)]
    memory = [recorded.get("drive_s", 0.2)] * 2 + [recorded.get("drive_turn_s", 0.2)]
    return Noise(
        np.maximum(sensor, LEAST[0]),
        np.maximum(drive, LEAST[1]) * step_s,
        np.clip(memory, 1.5 * MEMORY_S[0], MEMORY_S[1]),
        step_s,
    )


def fit_noise(errors: np.ndarray, columns: np.ndarray, stretches, begin: Noise) -> Noise:
    """The noise with the largest evidence of a linear model, channel by channel.

    Args:
        errors: (W, 3) of the base, m and rad.
        columns: (K, W, 3) of what is free, each with a standard normal prior.
        stretches: of the steps.
        begin: where to begin, with a weak prior of one unit of the logarithms about it.
    """
    logs = begin.logs
    for c in range(3):
        if np.any(errors[:, c]):
            used = np.abs(columns[:, :, c]).max(axis=1, initial=0.0) > 1e-12
            own = _seen(columns[used][:, :, c], stretches, logs[:, c], begin.step_s)
            both = np.concatenate([errors[None, :, c], own])
            logs[:, c] = _fit_channel(both, stretches, logs[:, c], begin.step_s)
    sensor, drive, memory = np.exp(logs)
    return replace(begin, sensor=sensor, drive=drive, memory_s=np.clip(memory, *MEMORY_S))


def _white(
    rows: np.ndarray, stretches, logs: np.ndarray, step_s: float
) -> tuple[np.ndarray, float]:
    """(K, W) white rows of one channel under a noise, and the scale of its innovations."""
    a = np.exp(-step_s / np.clip(np.exp(logs[2]), *MEMORY_S))
    filters = arma(np.exp(logs[0]), np.exp(logs[1]), a)
    white = np.empty(rows.shape)
    _filter(rows, stretches, filters, white)
    return white, filters[2]


def _filter(
    rows: np.ndarray,
    stretches: Sequence[slice],
    filters: tuple[np.ndarray, np.ndarray, float],
    out: np.ndarray,
) -> None:
    """Whitens (..., W) rows by the filters of `arma` into `out`, each stretch by itself."""
    ar, ma, scale = filters
    for part in stretches:
        out[..., part] = lfilter(ar, ma, rows[..., part], axis=-1) / scale


def _seen(columns: np.ndarray, stretches, logs: np.ndarray, step_s: float) -> np.ndarray:
    """(K', W) directions of (K, W) columns of which a channel tells more than their prior does."""
    white, _ = _white(columns, stretches, logs, step_s)
    values, ways = np.linalg.eigh(white @ white.T)
    return ways[:, values > SEEN].T @ columns


def _fit_channel(both: np.ndarray, stretches, start: np.ndarray, step_s: float) -> np.ndarray:
    """(3,) logarithms of sensor, drive and memory; `both` holds (1 + K, W) errors and columns."""

    def cost(logs: np.ndarray) -> float:
        white, scale = _white(both, stretches, logs, step_s)
        found = log_evidence(white[0], white[1:]) - white.shape[1] * np.log(scale)
        return -found + 0.5 * float(np.sum((logs - start) ** 2))

    options = {
        "maxfev": EVALUATIONS,
        "xatol": 0.05,
        "fatol": 0.3,
        "initial_simplex": np.vstack([start, *(start + 0.5 * np.eye(3))]),
    }
    return minimize(cost, start, method="Nelder-Mead", options=options).x


def weights_of(left: np.ndarray) -> np.ndarray:
    """(3, W) weights of residuals (3, W), those of Student's t for what is far off."""
    size = np.sqrt(np.median(left**2, axis=1) / 0.455)  # 0.455: median of a squared normal variate
    size = np.where(size > 0, size, 1.0)[:, None]
    return np.minimum(1.0, HEAVY / np.maximum(np.abs(left) / size, 1e-9)) / np.maximum(size, 1.0)
