# SPDX-License-Identifier: Apache-2.0
"""How surely frames that no model was fitted to prefer one model of the camera to another.

The ratio of held-out likelihoods alone (split likelihood ratio: Wasserman, Ramdas and Balakrishnan
2020) takes every frame for an independent draw with the model's chance. Where the preferred model
does not give that either, 4 s blocks scatter more than it says they would; the logarithm is divided
by that excess, as a deviance is by its dispersion (McCullagh and Nelder 1989, 4.5). The block with
the most evidence for a model is left out: one strange event proves nothing. A few blocks of
overwhelming likelihood do prove it, though their own scatter is large.
"""

from dataclasses import dataclass

import numpy as np

from twinmill.fitting.detection_fit import HeldOutFrames
from twinmill.predict.detections import UNSEEN_FRAMES, VOTE_ERROR, Detections

ALPHA = 0.05
VOTE_WEIGHT = np.log(1 / VOTE_ERROR - 1)  # of one voted bit that two models tell differently


@dataclass(frozen=True)
class Evidence:
    """For one model against another.

    Attributes:
        gain: of the held-out log likelihood.
        apart: the same without its best block.
        log_ratio: logarithm of the mean of both halves' likelihood ratios, without that block.
        excess: by how much blocks scatter more than the first model says; at least 1.
    """

    gain: float = 0.0
    apart: float = 0.0
    log_ratio: float = 0.0
    excess: float = 1.0

    @property
    def worth(self) -> float:
        """Logarithm of the ratio that counts."""
        return self.log_ratio / self.excess

    def p_value(self, candidates: int) -> float:
        """Bound of the chance of such a ratio if nothing were missing, for all candidates."""
        return float(min(1.0, candidates * np.exp(-self.worth)))


def weigh(cameras: list[Detections], one: HeldOutFrames, other: HeldOutFrames) -> Evidence:
    """Evidence for `one` against `other`."""
    halves, surprise, variance = np.zeros(2), 0.0, 0.0
    best, half_of_best = 0.0, 0
    for i, camera in enumerate(cameras):
        told = np.nan_to_num(one.log_likelihood[i] - other.log_likelihood[i])
        expected, spread = _expected(camera, one, other, i)
        blocks = np.bincount(camera.block, told)
        halves += np.bincount(camera.half, told, 2)
        surprise += float(np.sum(np.bincount(camera.block, told - expected) ** 2))
        variance += float(spread.sum())
        if blocks.max() > best:
            best = float(blocks.max())
            half_of_best = camera.half[camera.block == blocks.argmax()][0]
    gain = float(halves.sum())
    halves[half_of_best] -= best
    log_ratio = float(np.logaddexp(*halves) - np.log(2))
    excess = max(1.0, surprise / variance) if variance > 0 else 1.0
    return Evidence(gain, gain - best, log_ratio, excess)


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
