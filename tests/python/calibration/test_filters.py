# SPDX-License-Identifier: Apache-2.0
"""Filters, sums and chances are those of SciPy's and NumPy's own, larger or slower ones."""

import numpy as np
import pytest
import twinmill_native as native
from scipy import signal, stats

from twinmill import chance
from twinmill.filters import faded, filtered


@pytest.mark.parametrize(
    ("numerator", "denominator"), [([0.1], [1, -0.9]), ([1, 0.3, 0.2], [1, -0.5, 0.1]), ([2], [1])]
)
@pytest.mark.parametrize("axis", [0, 1, -2])
def test_filter_does_what_lfilter_does(numerator, denominator, axis):
    values = np.random.default_rng(1).normal(size=(7, 60, 3))
    expected = signal.lfilter(numerator, denominator, values, axis=axis)
    assert filtered(numerator, denominator, values, axis) == pytest.approx(expected, abs=1e-12)


def test_filter_of_nothing_is_nothing():
    assert filtered([0.1], [1, -0.9], np.zeros((0, 3))).shape == (0, 3)


def test_what_fades_evenly_does_what_lfilter_does():
    values = np.random.default_rng(1).normal(size=60)
    expected = signal.lfilter([1], [1, -0.9], values)
    assert faded(np.full(60, 0.9), values) == pytest.approx(expected, abs=1e-12)


def test_what_is_forgotten_at_once_leaves_the_last_push():
    keep, pushes = np.array([0.5, 1.0, 0.0, 1.0]), np.array([1.0, 2.0, 4.0, 8.0])
    assert faded(keep, pushes) == pytest.approx([1, 3, 4, 12])
    both = faded(np.stack([keep, keep[::-1]], -1), np.stack([pushes, pushes], -1))
    assert both[:, 1] == pytest.approx([1, 2, 6, 11])


def test_sums_by_shift_are_those_of_the_signal_read_between_its_rows():
    random = np.random.default_rng(4)
    values, beside = random.normal(size=(40, 6)), random.normal(size=(25, 3))
    places = np.sort(random.uniform(2, 37, 25))
    shifts, begins = np.array([0.0, 1.3, -2.0]), np.array([0, 10, 10, 17])
    power, along = native.sums_by_shift(values, places, shifts, beside, begins)
    for s, shift in enumerate(shifts):
        read = np.column_stack([np.interp(places - shift, np.arange(40), v) for v in values.T])
        products = read * np.tile(beside, 2)
        for b, (first, end) in enumerate(((0, 10), (10, 10), (10, 17), (17, 25))):
            assert power[s, b] == pytest.approx((read[first:end] ** 2).sum(axis=0), abs=1e-12)
            assert along[s, b] == pytest.approx(products[first:end].sum(axis=0), abs=1e-12)
    with pytest.raises(ValueError, match="one after the other"):
        native.sums_by_shift(values, places, shifts, beside, np.array([0, 30]))


@pytest.mark.parametrize("free", [1, 4, 30, 400])
@pytest.mark.parametrize("value", [-1.3, 0.0, 0.7, 12.0])
def test_chances_are_those_of_the_distributions(free, value):
    assert chance.t_above(value, free) == pytest.approx(stats.t.sf(value, free))
    assert chance.f_above(value, free, 9) == pytest.approx(stats.f.sf(value, free, 9))
    assert chance.chi2_above(value, free) == pytest.approx(stats.chi2.sf(value, free))
    for share in (0.2, 0.5, 0.975):
        expected = stats.t.ppf(share, free)
        assert chance.t_quantile(share, free) == pytest.approx(expected, abs=1e-12)
    assert chance.chi2_median(free) == pytest.approx(stats.chi2.median(free))
