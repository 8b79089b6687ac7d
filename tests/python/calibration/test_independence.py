# SPDX-License-Identifier: Apache-2.0
"""How many errors are independent: of noises for which algebra says it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.inference.independence import independent_shares
from twinmill.predict.datasets import INDEPENDENT_S
from twinmill.predict.windows import EVERY_S, HORIZONS_S

COUNT = 6000  # predictions


def shares(errors):
    """(3,) of (COUNT, 3) errors, at all horizons alike."""
    at_all = np.repeat(errors[:, None], len(HORIZONS_S), axis=1)
    return independent_shares(at_all, EVERY_S * np.arange(len(errors)))


def normal(seed, channels=3):
    return np.random.default_rng(seed).normal(size=(COUNT, channels))


def test_errors_of_their_own_count_whole():
    assert shares(normal(1)) == pytest.approx([1, 1, 1], abs=0.02)


def test_one_disturbance_in_two_channels_counts_once():
    errors = normal(2)
    errors[:, 2] = -3 * errors[:, 1]
    assert shares(errors) == pytest.approx([1, 0.5, 0.5], abs=0.02)


def test_a_slow_wander_counts_as_often_as_it_is_new():
    """A first-order process counts (1 - r) / (1 + r) of its samples, correlated by r."""
    lost_s = 3.0
    r = np.exp(-EVERY_S / lost_s)
    errors = normal(3)
    errors[:, 2] = lfilter([1], [1, -r], errors[:, 2])
    again = np.exp(-INDEPENDENT_S / lost_s)
    assert shares(errors)[2] == pytest.approx((1 - again) / (1 + again), rel=0.15)


def test_what_was_not_judged_says_nothing():
    errors = normal(5)
    errors[:, 1] = np.nan
    assert shares(errors) == pytest.approx([1, 1, 1], abs=0.02)


def test_what_happened_once_is_no_property_of_all():
    """For 10 of 1500 s both are off by six times as much as usual."""
    errors = normal(6)
    errors[:40, :2] += 6
    assert shares(errors) == pytest.approx([1, 1, 1], abs=0.1)


def test_few_errors_that_are_alike_by_chance_count_whole():
    """Sixteen seconds: what eight independent errors tell of their correlation is chance."""
    found = [shares(normal(seed)[:64]) for seed in range(40)]
    assert np.mean(found) > 0.85
