# SPDX-License-Identifier: Apache-2.0
"""At what rate errors swing in time, as a regulator does that hunts, or a fan that turns.

A line in the spectrum of a log's errors stands far above its neighbours, and nothing that the robot
did has one there: neither its motion nor its heading, its place, or the angles of its wheels.
"""

from collections.abc import Iterable, Sequence

import numpy as np

# Numbers of the windows' horizons: one is short beside a quick period, one far above the noise.
HORIZONS = (1, 2)
BIN_S = 0.05
PADDED = 4  # times as many bins, so that a line between two is seen
SHORTEST_S = 0.5  # period
LEAST_PERIODS = 8  # in a log
NEIGHBOURS = 24  # lines on either side, whose median tells the noise
# Times the mean of a power that is noise: of noise one in 65 million is larger (exponential), and a
# log has some thousand that are independent.
BEYOND_CHANCE = 18.0
IN_THE_DRIVE = 6.0  # the same of what the robot did ...
FAR_BEYOND_THE_DRIVE = 10.0  # ... unless the errors' line is so many times as far above its noise


def beat_radps(t_s: np.ndarray, errors: Sequence[np.ndarray], done: Iterable[np.ndarray]) -> float:
    """Rate at which errors swing and nothing that the robot did does, rad/s; 0 if there is none.

    Args:
        t_s: (W,) of windows, in order.
        errors: (W,) of each channel that may swing.
        done: (W,) of each thing that the robot did; made only if they are looked at.
    """
    bins = np.rint((t_s - t_s[0]) / BIN_S).astype(int)
    lines = PADDED * (bins[-1] + 1)
    rate_hz = np.fft.rfftfreq(lines, BIN_S)
    asked = (rate_hz > LEAST_PERIODS / (t_s[-1] - t_s[0])) & (rate_hz < 1 / SHORTEST_S)
    if bins[-1] < 4 * NEIGHBOURS or not asked.any():
        return 0.0
    count = int(np.flatnonzero(asked)[-1]) + 1
    power = asked[:count] * _highest(bins, errors, count)
    if power.max() > BEYOND_CHANCE:  # else what the robot did need not be looked at
        least = np.maximum(IN_THE_DRIVE, power / FAR_BEYOND_THE_DRIVE)
        power *= _highest(bins, done, count) < least
    best = int(np.argmax(power))
    return float(2 * np.pi * rate_hz[best]) if power[best] > BEYOND_CHANCE else 0.0


def _highest(bins: np.ndarray, signals: Iterable[np.ndarray], count: int) -> np.ndarray:
    """(K,) highest power over noise that one of some signals has in each of the first K lines.

    The noise is the mean around each line.
    """
    even = np.array([np.bincount(bins, signal) for signal in signals])
    even /= np.maximum(np.bincount(bins), 1)
    tapered = (even - even.mean(axis=1, keepdims=True)) * np.hanning(even.shape[1])
    alone = -(-count // PADDED)  # lines without padding
    lines = np.fft.rfft(tapered, PADDED * even.shape[1])[:, : PADDED * (alone + NEIGHBOURS)]
    power = np.abs(lines) ** 2
    padded = np.pad(power[:, ::PADDED], ((0, 0), (NEIGHBOURS, 0)), mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1, axis=1)
    medians = np.median(around, axis=2)
    noise = np.repeat(medians, PADDED, axis=1)[:, :count] / np.log(2)
    return np.max(power[:, :count] / np.maximum(noise, 1e-30), axis=0)
