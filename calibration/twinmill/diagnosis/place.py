# SPDX-License-Identifier: Apache-2.0
"""Whether errors come again where the robot comes by again.

Errors of way at two moments far apart in time are multiplied with each other if the moments are
near each other in the room: a quadratic form with a Gaussian kernel over places, as in Moran's test
of spatial correlation (Moran 1950, Biometrika 37). It asks for no formula, so that joints between
tiles are seen like a patch of carpet. A drive that repeats its path repeats every error at its
place; so both the model's errors and those of the smooth response, which knows commands and
headings, must do so.
"""

from collections.abc import Sequence

import numpy as np
import twinmill_native as native

from twinmill.fitting.opening import Opened
from twinmill.predict.windows import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
LENGTHS_M = (0.1, 0.2, 0.4)  # of the kernel
LEAST_WAY_M = 0.01  # a robot that stands tells nothing of its place
FLIPS = 999
CHANCE = 0.01


def comes_again(opened: Sequence[Opened], models: Sequence[native.Model]) -> bool:
    """Whether errors repeat at the same places beyond chance, in the logs taken together.

    Args:
        opened: logs over their floors.
        models: with what was found, one for each.
    """
    of_model = [own.data.errors(model) for own, model in zip(opened, models, strict=True)]
    of_response = [own.floor.across for own in opened]
    return all(_repeats(opened, errors) for errors in (of_model, of_response))


def _repeats(opened: Sequence[Opened], errors: Sequence[np.ndarray]) -> bool:
    """Whether the form is larger than almost always under random signs of blocks."""
    total = np.zeros((len(LENGTHS_M), 1 + FLIPS))
    random = np.random.default_rng(1)
    for own, each in zip(opened, errors, strict=True):
        middle_m, strength, block = _of_way(own, each)
        if len(block):
            flips = random.choice([-1.0, 1.0], (FLIPS, block.max() + 1))
            signs = np.vstack([np.ones(block.max() + 1), flips])
            for k, length_m in enumerate(LENGTHS_M):
                pairs = _products(middle_m, strength, block, length_m)
                total[k] += np.einsum("fi,ij,fj->f", signs, pairs, signs)
    spread = total[:, 1:].std(axis=1, keepdims=True)
    if not spread.all():
        return False
    highest = (total / spread).max(axis=0)
    return bool(np.mean(highest[1:] >= highest[0]) < CHANCE)


def _of_way(own: Opened, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2) middles of ways, (n,) errors along them over their size times the way, (n,) blocks."""
    data, pose = own.data, own.data.measurement.track.pose
    error, way = errors[:, HORIZON, :2], data.measured[:, HORIZON, :2] - errors[:, HORIZON, :2]
    length_m = np.hypot(*way.T)
    usable = data.keep & (np.nan_to_num(length_m) > LEAST_WAY_M)
    error, way, length_m = error[usable], way[usable], length_m[usable]
    along = np.sum(error * way, axis=1) / length_m
    ends = (data.windows.starts[usable], data.windows.ends[usable, HORIZON])
    middle_m = (pose[ends[0], :2] + pose[ends[1], :2]) / 2
    strength = along * length_m / max(float(np.sqrt(np.mean(along**2))), 1e-12)
    return middle_m, strength, data.block.reshape(data.measured.shape)[usable, 0, 0]


def _products(
    middle_m: np.ndarray, strength: np.ndarray, block: np.ndarray, length_m: float
) -> np.ndarray:
    """(B, B) of sums over the pairs of two blocks; zero within one."""
    apart_m2 = np.sum((middle_m[:, None] - middle_m[None]) ** 2, axis=-1)
    near = np.exp(-apart_m2 / (2 * length_m**2)) * np.outer(strength, strength)
    member = (block[:, None] == np.arange(block.max() + 1)).astype(float)
    pairs = member.T @ near @ member
    np.fill_diagonal(pairs, 0.0)
    return pairs
