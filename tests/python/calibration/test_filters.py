# SPDX-License-Identifier: Apache-2.0
"""Filters, sums and chances are those of SciPy's and NumPy's own, larger or slower ones."""

import numpy as np
import pytest
import twinmill_native as native
from scipy import signal, stats
from scipy.integrate import solve_ivp

from twinmill import chance
from twinmill.filters import faded, filtered, swung


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


@pytest.mark.parametrize("damping", [0.05, 0.7])
def test_what_swings_does_what_an_integrator_does(damping):
    random, rate = np.random.default_rng(1), 9.0
    step_s, pushes = random.uniform(0.005, 0.1, 50), random.normal(size=50)
    step_s[20] = 0.0  # of no length: nothing changes
    now, means = np.zeros(3), []
    for step, push in zip(step_s, pushes, strict=True):
        if step == 0:
            means.append(now[:2])
            continue
        after = solve_ivp(
            lambda _, s, push=push: [
                s[1],
                rate**2 * (push - s[0]) - 2 * damping * rate * s[1],
                s[0],
            ],
            (0, step),
            [*now[:2], 0.0],
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
        means.append([after[2] / step, (after[0] - now[0]) / step])
        now = after
    assert np.stack(swung(pushes, step_s, rate, damping), axis=1) == pytest.approx(
        np.array(means), abs=1e-8
    )


@pytest.mark.parametrize("shape", [(0, 3), (1, 1), (5, 0), (7, 2), (100, 3)])
def test_running_sums_are_cumsum(shape):
    random = np.random.default_rng(1)
    values, weights = random.normal(size=shape), random.normal(size=shape[0])
    assert native.running_sums(values, weights) == pytest.approx(
        np.cumsum(weights[:, None] * values, axis=0), abs=1e-12
    )


def test_sums_between_are_differences_of_cumsum():
    random = np.random.default_rng(1)
    values, weights = random.normal(size=(50, 3)), random.normal(size=50)
    starts, ends = np.array([0, 7, 7]), np.array([[0, 4], [8, 49], [3, 7]])
    up_to = np.cumsum(weights[:, None] * values, axis=0)
    assert native.sums_between(
        [values[:, :1].copy(), values[:, 1:].copy()], weights, starts, ends
    ) == pytest.approx(up_to[ends] - up_to[starts][:, None], abs=1e-12)


def test_sums_between_refuse_rows_that_are_not_there():
    with pytest.raises(ValueError, match="rows of values"):
        native.sums_between([np.ones((5, 1))], np.ones(5), np.array([0]), np.array([[5]]))


@pytest.mark.parametrize("free", [1, 4, 30])
@pytest.mark.parametrize("value", [0.0, 0.7, 12.0])
def test_chances_are_those_of_the_distributions(free, value):
    assert chance.t_above(value, free) == pytest.approx(stats.t.sf(value, free))
    assert chance.f_above(value, free, 9) == pytest.approx(stats.f.sf(value, free, 9))
    assert chance.chi2_above(value, free) == pytest.approx(stats.chi2.sf(value, free))
    assert chance.t_quantile(0.975, free) == pytest.approx(stats.t.ppf(0.975, free))
    assert chance.chi2_median(free) == pytest.approx(stats.chi2.median(free))
