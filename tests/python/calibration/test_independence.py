# SPDX-License-Identifier: Apache-2.0
"""How many errors are independent: of noises for which algebra says it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.diagnosis.evidence import STRETCH_S, Evidence
from twinmill.fitting.independence import along_the_way, fresh_shares, independent_shares
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


@pytest.mark.parametrize("slow", [True, False])
def test_a_wander_tells_again_of_what_is_slow_alone(slow):
    """Products with a slow wave are as correlated as the wander, those with signs are not."""
    lost_s, start_s = 3.0, EVERY_S * np.arange(COUNT)
    r = np.exp(-EVERY_S / lost_s)
    errors = lfilter([1], [1, -r], normal(3), axis=0) * (1, 0, 0)
    wave = np.cos(0.01 * start_s)
    signs = np.repeat(np.random.default_rng(4).choice([-1.0, 1.0], COUNT // 4), 4)
    explained = np.column_stack([wave if slow else signs] * 3)
    new, once = fresh_shares(errors, explained, start_s)
    again = np.exp(-INDEPENDENT_S / lost_s)
    assert new == pytest.approx((1 - again) / (1 + again) if slow else 1.0, abs=0.2)
    assert once == pytest.approx(1.0)


def test_what_one_disturbance_says_in_two_channels_counts_once():
    made, errors = np.ones((COUNT, 3)) * (0, 1, 1), normal(7)
    errors[:, 2] = errors[:, 1]
    new, once = fresh_shares(errors, made, EVERY_S * np.arange(COUNT))
    assert new == pytest.approx(1.0, abs=0.1) and once == pytest.approx(0.5, abs=0.02)


def test_a_gain_shows_along_the_way_in_whatever_direction():
    """Ten percent more of each way and of each turn."""
    moved = np.array([[1.0, 0, 0.5], [-1, 0, -0.5], [0, 2, 0.5], [0.6, -0.8, -0.5]])
    ways = along_the_way(0.1 * moved, moved)
    assert ways[:, 0] == pytest.approx([0.1, 0.1, 0.2, 0.1])
    assert ways[:, 1] == pytest.approx(0, abs=1e-12)
    assert ways[:, 3] == pytest.approx(0.05)


@pytest.mark.parametrize(("again", "least", "most"), [(0.0, 0.9, 1.0), (0.7, 0.3, 0.75)])
def test_a_wander_is_seen_in_the_half_of_a_log_that_judges(again, least, most):
    """Two minutes, a prediction each second, every other stretch: 30 s of pairs tell 0.5 of chance.

    By algebra 0.34 of what a process of correlation 0.7 in two seconds says is new; it is mostly
    seen to be, and hardly ever of what has none.
    """
    start_s = np.arange(0.0, 120.0)
    judged = (start_s // STRETCH_S % 2 == 0) & (start_s % STRETCH_S <= STRETCH_S - INDEPENDENT_S)
    rows = Evidence.__new__(Evidence)
    rows.begin_s, rows.longest, rows.every_s = start_s, np.ones(len(start_s), bool), 1.0
    found = []
    for seed in range(60):
        r = again**0.5
        says = lfilter([1], [1, -r], np.random.default_rng(seed).normal(size=300))[-len(start_s) :]
        rows.left = says + 1.0
        found.append(rows.fresh(judged, np.ones(judged.sum())))
    assert least < np.mean(found) <= most
