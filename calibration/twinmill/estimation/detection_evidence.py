# SPDX-License-Identifier: Apache-2.0
"""How surely detections that no model was fitted to prefer one model of the camera to another.

The ratio of held-out likelihoods alone (split likelihood ratio: Wasserman, Ramdas and Balakrishnan
2020) takes every frame for an independent draw with the model's chance. Where the preferred model
does not give that either, 4 s blocks scatter more than it says they would; the logarithm is divided
by that excess, as a deviance is by its dispersion (McCullagh and Nelder 1989, 4.5). The block with
the most evidence for a model is left out: one strange event proves nothing. A few blocks of
overwhelming likelihood do prove it, though their own scatter is large.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.predict.detection_errors import brier_ratio
from twinmill.predict.detections import SURE, UNSEEN_FRAMES, VOTE_ERROR, Detections

VOTE_WEIGHT = np.log(1 / VOTE_ERROR - 1)  # of one voted bit that two models predict differently


@dataclass(frozen=True)
class HeldOutFrames:
    """Held-out predictions of each robot's frames, fitted to the other half; a list of (K,) each.

    Attributes:
        log_likelihood: of what was reported; NaN where nothing can be said.
        chance: probability of the bit, raw or voted.
        voted: the bit that the vote must give by the raw ones.
    """

    log_likelihood: list[np.ndarray]
    chance: list[np.ndarray]
    voted: list[np.ndarray]

    @classmethod
    def of(
        cls, cameras: Sequence[Detections], models: Sequence[Sequence[native.Model]]
    ) -> "HeldOutFrames":
        """Each half of the frames by the models in its place, one for each robot."""
        rows = []
        for camera, *own in zip(cameras, *models, strict=True):
            first = camera.half == 0
            both = [_of_robot(camera, model) for model in own]
            rows.append([np.where(first, a, b) for a, b in zip(*both, strict=True)])
        return cls(*(list(column) for column in zip(*rows, strict=True)))

    def score(self, cameras: Sequence[Detections]) -> float:
        """RMS error of the chances over what such chances must err, in all frames that count."""
        chance = [c[s.usable] for s, c in zip(cameras, self.chance, strict=True)]
        bits = [s.bits[s.usable] for s in cameras]
        return brier_ratio(np.concatenate(chance), np.concatenate(bits))


def _of_robot(camera: Detections, own: native.Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    chance = np.clip(camera.reported(own, camera.frames.has_raw), SURE, 1 - SURE)
    return camera.likelihood(own), chance, camera.voted(int(own.detection_model()["vote_frames"]))


@dataclass(frozen=True)
class Evidence:
    """For one model against another.

    Attributes:
        gain: of the held-out log likelihood.
        log_ratio: logarithm of the mean of both halves' likelihood ratios, without the block with
            the most evidence.
        excess: by how much blocks scatter more than the first model says; at least 1.
        blocks_t: t of the relative gain over blocks.
    """

    gain: float
    log_ratio: float
    excess: float
    blocks_t: float


def weigh(cameras: Sequence[Detections], one: HeldOutFrames, other: HeldOutFrames) -> Evidence:
    """Evidence for `one` against `other`."""
    halves, surprise, variance = np.zeros(2), 0.0, 0.0
    best, half_of_best = 0.0, 0
    relative: list[np.ndarray] = []
    for i, camera in enumerate(cameras):
        a, b = (np.nan_to_num(x.log_likelihood[i]) for x in (one, other))
        expected, spread = _expected(camera, one, other, i)
        blocks = np.bincount(camera.block, a - b)
        halves += np.bincount(camera.half, a - b, 2)
        surprise += float(np.sum(np.bincount(camera.block, a - b - expected) ** 2))
        variance += float(spread.sum())
        relative.append(blocks / np.maximum(-np.bincount(camera.block, a + b), 1e-300))
        if blocks.max() > best:
            best = float(blocks.max())
            half_of_best = camera.half[camera.block == blocks.argmax()][0]
    gain = float(halves.sum())
    halves[half_of_best] -= best
    log_ratio = float(np.logaddexp(*halves) - np.log(2))
    excess = max(1.0, surprise / variance) if variance > 0 else 1.0
    return Evidence(gain, log_ratio, excess, _t(np.concatenate(relative)))


def _t(values: np.ndarray) -> float:
    """Mean over its standard error; 0 of one value."""
    if len(values) < 2:
        return 0.0
    return float(values.mean() / max(np.std(values, ddof=1) / np.sqrt(len(values)), 1e-12))


def _expected(
    camera: Detections, one: HeldOutFrames, other: HeldOutFrames, i: int
) -> tuple[np.ndarray, np.ndarray]:
    """(K,) gain of each frame of robot i if `one` were true, and its variance."""
    p, q = one.chance[i], other.chance[i]
    odds = np.log(p / (1 - p)) - np.log(q / (1 - q))
    expected = p * odds + np.log((1 - p) / (1 - q))
    spread = p * (1 - p) * odds**2
    if camera.frames.has_raw:
        differ = one.voted[i] != other.voted[i]
        differ[:UNSEEN_FRAMES] = False
        expected += VOTE_WEIGHT * (1 - 2 * VOTE_ERROR) * differ
        spread += (2 * VOTE_WEIGHT) ** 2 * VOTE_ERROR * (1 - VOTE_ERROR) * differ
    use = np.isfinite(one.log_likelihood[i]) & np.isfinite(other.log_likelihood[i])
    return np.where(use, expected, 0), np.where(use, spread, 0)
