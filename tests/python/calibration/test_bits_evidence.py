# SPDX-License-Identifier: Apache-2.0
"""Weight of held-out frames. Truth: draws and sums by numpy here."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.estimation.detection_evidence import HeldOutFrames, weigh
from twinmill.predict.detections import thue_morse

BLOCKS, FRAMES = 400, 60
ONE, OTHER = 0.4, 0.1


def frames(bits: np.ndarray, share: np.ndarray) -> tuple[list, HeldOutFrames, HeldOutFrames]:
    """A robot whose bits are those given; both models differ in the frames of `share` alone."""
    block = np.repeat(np.arange(len(bits) // FRAMES), FRAMES)
    scene = SimpleNamespace(
        block=block, half=thue_morse(block), frames=SimpleNamespace(has_raw=False)
    )
    held = []
    for rate in (ONE, OTHER):
        chance = np.where(share, rate, OTHER)
        told = np.log(np.where(bits, chance, 1 - chance))
        held.append(HeldOutFrames([told], [chance], [np.zeros(len(bits), bool)]))
    return [scene], *held


def draw(blocks: int, rate: float, repeats: int = 1) -> np.ndarray:
    """Independent bits, each reported `repeats` times in a row."""
    random = np.random.default_rng(blocks + repeats)
    return np.repeat(random.random(blocks * FRAMES // repeats) < rate, repeats)


@pytest.mark.parametrize("repeats", [1, 4])
def test_bits_that_come_several_times_count_once(repeats):
    """A sum of n / m draws of weight m varies by m times that of n draws."""
    found = weigh(*frames(draw(BLOCKS, ONE, repeats), np.ones(BLOCKS * FRAMES, bool)))
    assert found.excess == pytest.approx(max(1, repeats), rel=4 * np.sqrt(2 / BLOCKS))


def test_gain_is_the_logarithm_of_the_likelihood_ratio():
    bits = draw(BLOCKS, ONE)
    ones = bits.sum()
    expected = ones * np.log(ONE / OTHER) + (len(bits) - ones) * np.log((1 - ONE) / (1 - OTHER))
    assert weigh(*frames(bits, np.ones(len(bits), bool))).gain == pytest.approx(expected)


@pytest.mark.parametrize(("blocks", "proves"), [(1, False), (5, True)])
def test_few_blocks_prove_an_effect_and_one_does_not(blocks, proves):
    bits = draw(BLOCKS, ONE)
    share = np.arange(len(bits)) < blocks * FRAMES
    found = weigh(*frames(bits, share))
    assert found.gain > np.log(8 / 0.05)  # enough, were one block
    assert bool(found.log_ratio / found.excess > np.log(8 / 0.01)) is proves


def test_a_model_that_frames_speak_against_is_never_proved():
    bits = draw(BLOCKS, OTHER)
    found = weigh(*frames(bits, np.ones(len(bits), bool)))
    assert found.gain < 0
    assert found.log_ratio < 0
