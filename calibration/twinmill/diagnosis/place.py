# SPDX-License-Identifier: Apache-2.0
"""Test for errors that repeat at the same places.

Errors of way, and of turning, at two moments far apart in time are multiplied with each other if
the moments are near each other in the room: a quadratic form with a Gaussian kernel over places, as
in Moran's test of spatial correlation (Moran 1950, Biometrika 37). It asks for no formula, so that
joints between tiles are seen like a patch of carpet. Floors are laid in strips, so that one axis of
the room may be enough. What all ways of one block of time have in common, as while a battery sinks,
is taken out before. A drive that repeats its path repeats every error at its place; so the errors
of the smooth response, which knows commands and headings, must do so as well: of its first stage,
since what is added to that may know places, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.opening import Opened
from twinmill.predict.windows import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
LENGTHS_M = (0.1, 0.2, 0.4)  # of the kernel
ACROSS = ([0, 1], [0], [1])  # axes of the room: spots, and strips that run right through it
LEAST_WAY_M = 0.01  # a robot that stands tells nothing of its place
FLIPS = 999
STRETCH_S = 2.0  # of one random sign, and least time between two moments


def comes_again(opened: Sequence[Opened], models: Sequence[native.Model]) -> float:
    """Least share of the squared error that repeats at the same places, in all logs.

    Kernels as wide as what repeats see a part of it.

    Args:
        opened: logs over their floors.
        models: with what was found, one for each.

    Returns:
        0 where it could be chance, or is little.
    """
    of_model = [own.trajectory.errors(model) for own, model in zip(opened, models, strict=True)]
    found, floor = [0.0], None
    for of, (chance, share) in enumerate(_repeats(opened, of_model)):
        if chance < SETTINGS.place_chance and share > SETTINGS.place_share:
            floor = floor or _repeats(opened, [own.response.unboosted for own in opened])
            chance, _ = floor[of]
            found.append(share if chance < SETTINGS.place_chance_of_floor else 0.0)
    return max(found)


def _repeats(opened: Sequence[Opened], errors: Sequence[np.ndarray]) -> list[tuple[float, float]]:
    """Chance of so large a form under random signs of stretches, and the share that repeats.

    Args:
        opened: logs over their floors.
        errors: (W, H, 3) of each.

    Returns:
        Of errors along the way, and of turning.
    """
    kernels = list(product(range(len(LENGTHS_M)), ACROSS))
    total = np.zeros((2, len(kernels), 1 + FLIPS))
    weight = np.zeros(len(kernels))
    random = np.random.default_rng(1)
    for own, each in zip(opened, errors, strict=True):
        ways = _Ways.of(own, each)
        if len(ways.block):
            stretches = ways.stretch.max() + 1
            flips = random.choice([-1.0, 1.0], (FLIPS, stretches))
            signs = np.vstack([np.ones(stretches), flips]).astype(np.float32)
            for k, (length, axes) in enumerate(kernels):
                pairs, full = _products(ways, np.prod(ways.near[length, axes], axis=0))
                total[:, k] += np.sum(signs @ pairs * signs, axis=-1)
                weight[k] += full
    return [_standing_out(of, weight) for of in total]


def _standing_out(total: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Chance and share of the kernel that stands out most.

    Args:
        total: (K, 1 + FLIPS) sums of K kernels, and under random signs.
        weight: (K,) the sum of each if all errors were of places.
    """
    spread = total[:, 1:].std(axis=1, keepdims=True)
    if not spread.all():
        return 1.0, 0.0
    highest = (total / spread).max(axis=0)
    best = int(np.argmax(total[:, 0] / spread[:, 0]))
    return float(np.mean(highest[1:] >= highest[0])), float(total[best, 0] / weight[best])


@dataclass(frozen=True)
class _Ways:
    """Ways of one log in half a second.

    Attributes:
        middle_m: (n, 2) where.
        errors: (2, n) along the way and of turning, each over the RMS of all.
        length: (n,) of the way, over the RMS of all.
        t_s, block, stretch: (n,) when.
    """

    middle_m: np.ndarray
    errors: np.ndarray
    length: np.ndarray
    t_s: np.ndarray
    block: np.ndarray
    stretch: np.ndarray

    @cached_property
    def far(self) -> np.ndarray:
        """(n, n) bool: of pairs that count."""
        apart_s = np.abs(self.t_s[:, None] - self.t_s)
        return (apart_s > STRETCH_S) & (self.block[:, None] != self.block)

    @cached_property
    def near(self) -> np.ndarray:
        """(L, 2, n, n) how near each other places are along each axis of the room, by LENGTHS_M."""
        apart_m = (self.middle_m[:, None] - self.middle_m).transpose(2, 0, 1).astype(np.float32)
        lengths_m = np.array(LENGTHS_M, np.float32)[:, None, None, None]
        return np.exp(-((apart_m / lengths_m) ** 2) / 2)

    @staticmethod
    def of(own: Opened, errors: np.ndarray) -> "_Ways":
        """Ways of a log, with the (W, H, 3) errors of a model."""
        data, pose = own.trajectory, own.trajectory.measurement.track.pose
        error, way = errors[:, HORIZON], (data.measured - errors)[:, HORIZON, :2]
        length_m = np.hypot(*way.T)
        usable = data.keep & (np.nan_to_num(length_m) > LEAST_WAY_M)
        error, way, length_m = error[usable], way[usable], length_m[usable]
        block = data.block.reshape(data.measured.shape)[usable, 0, 0]
        along = np.sum(error[:, :2] * way, axis=1) / length_m
        both = (along, np.nan_to_num(error[:, 2]))
        starts, ends = data.windows.starts[usable], data.windows.ends[usable, HORIZON]
        t_s = data.start_s[usable]
        _, stretch = np.unique(t_s // STRETCH_S, return_inverse=True)
        return _Ways(
            (pose[starts, :2] + pose[ends, :2]) / 2,
            np.array([_over_rms(_without_common(e, length_m, block)) for e in both]),
            _over_rms(length_m),
            t_s,
            block,
            stretch,
        )


def _over_rms(values: np.ndarray) -> np.ndarray:
    return values / max(float(np.sqrt(np.mean(values**2))), 1e-12) if len(values) else values


def _without_common(error: np.ndarray, length_m: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Errors without what is in proportion to the way in a whole block."""
    if not len(block):
        return error
    moment, energy = np.bincount(block, error * length_m), np.bincount(block, length_m**2)
    return error - (moment / np.maximum(energy, 1e-12))[block] * length_m


def _products(ways: _Ways, near: np.ndarray) -> tuple[np.ndarray, float]:
    """(2, S, S) of sums over the pairs of two stretches, and the sum if all errors were of places.

    Pairs of one block, or less than a stretch apart, count for nothing.

    Args:
        ways: n of them.
        near: (n, n) how near each other places are.
    """
    near = near * ways.far
    begins = np.flatnonzero(np.diff(ways.stretch, prepend=-1))  # of stretches, which ascend
    own, whole = (v.astype(np.float32) for v in (ways.errors * ways.length, ways.length**2))
    rows = np.add.reduceat(own[:, :, None] * near, begins, axis=1)
    pairs = np.add.reduceat(rows * own[:, None], begins, axis=2)
    return pairs, float(whole @ near @ whole)
