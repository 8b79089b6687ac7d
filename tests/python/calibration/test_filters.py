# SPDX-License-Identifier: Apache-2.0
"""Filters, sums and chances are those of SciPy's and NumPy's own, larger or slower ones."""

import numpy as np
import pytest
import twinmill_native as native
from scipy import signal, stats
from scipy.integrate import solve_ivp

from twinmill import chance
from twinmill.filters import Swing, faded, filtered
from twinmill.fitting.dependence import held, wound


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
    found = Swing(step_s, rate, damping).around(pushes)
    assert found == pytest.approx(np.array(means).T, abs=1e-8)


def integrated(velocity, heading_rad, step_s, start, end, at_rad):
    """Where a robot gets after row `start` until row `end`, as seen from a heading."""
    x_m = y_m = turned_rad = 0.0
    for n in range(start + 1, end + 1):
        forward, left, turn = velocity[n] * step_s[n]
        c, s = np.cos(heading_rad[n]), np.sin(heading_rad[n])
        x_m, y_m = x_m + c * forward - s * left, y_m + s * forward + c * left
        turned_rad += turn
    c, s = np.cos(at_rad), np.sin(at_rad)
    return np.array([c * x_m + s * y_m, c * y_m - s * x_m, turned_rad])


@pytest.fixture(name="drive")
def _drive():
    random = np.random.default_rng(1)
    step_s, turns = random.uniform(0.01, 0.1, 50), random.normal(size=50)
    velocity = np.column_stack([random.normal(size=(50, 2)), turns])
    heading_rad = np.cumsum(turns * step_s) - turns * step_s / 2
    return velocity, heading_rad, step_s


STARTS, ENDS, AT_RAD = np.array([0, 7, 7]), np.array([[0, 4], [8, 49], [9, 7]]), np.array([0, 1, 2])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_other_speeds_lead_where_the_steps_add_up_to(drive, axis):
    velocity, heading_rad, step_s = drive
    values = 1e-6 * np.random.default_rng(2).normal(size=(50, 3))
    ahead = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)])
    found = native.displaced_by(values, velocity, axis, step_s, ahead, STARTS, ENDS, 1.0 * AT_RAD)
    for w, (start, at_rad) in enumerate(zip(STARTS, AT_RAD, strict=True)):
        for h, end in enumerate(ENDS[w]):
            for t, value in enumerate(values.T):
                other, turned_rad = velocity.copy(), np.zeros(50)
                other[:, axis] += value
                if axis == 2:
                    angle = np.cumsum(value * step_s) - value * step_s / 2
                    turned_rad = angle - (np.cumsum(value * step_s))[start]
                before, after = (
                    integrated(v, heading_rad + r, step_s, start, end, at_rad)
                    for v, r in ((velocity, 0.0), (other, turned_rad))
                )
                assert found[w, h, :, t] == pytest.approx(after - before, abs=1e-11)


def test_velocities_lead_along_a_direction_as_far_as_the_steps_add_up_to(drive):
    velocity, heading_rad, step_s = drive
    steps = np.column_stack([np.cos(heading_rad), np.sin(heading_rad)]) * step_s[:, None]
    direction = np.array([[1.0, 0.0], [0.0, 2.0], [0.6, 0.8]])
    gains, whole = np.column_stack([np.ones(50), np.arange(50.0)]), np.ones((50, 1))
    signals = np.column_stack([velocity[:, 0], 3 * velocity[:, 0]])
    found = native.led_between(
        *([(gains, signals)], [(velocity[:, 1:2].copy(), whole)]),
        *(steps, STARTS, ENDS[:, 1], direction),
    )
    forward = [g * s for s in (velocity[:, 0], 3 * velocity[:, 0]) for g in gains.T]
    none = np.zeros(50)
    moves = [np.column_stack([v, none, none]) for v in forward]
    moves.append(np.column_stack([none, velocity[:, 1], none]))
    for column, moved in enumerate(moves):
        for row, (start, end) in enumerate(zip(STARTS, ENDS[:, 1], strict=True)):
            way = integrated(moved, heading_rad, step_s, start, end, 0.0)[:2]
            assert found[row, column] == pytest.approx(direction[row] @ way, abs=1e-10)


def test_turning_rates_turn_as_far_as_the_steps_add_up_to(drive):
    velocity, _, step_s = drive
    rates = [(velocity[:, 2:].copy(), np.ones((50, 1)))]
    weight = np.array([[1.0], [2.0], [-0.5]])
    found = native.led_between(rates, [], step_s[:, None], STARTS, ENDS[:, 1], weight)
    turned_rad = np.cumsum(velocity[:, 2] * step_s)
    expected = weight[:, 0] * (turned_rad[ENDS[:, 1]] - turned_rad[STARTS])
    assert found[:, 0] == pytest.approx(expected, abs=1e-12)


def test_a_signal_is_read_between_its_rows_and_goes_on_beyond_them():
    values = np.random.default_rng(4).normal(size=(40, 3))
    places = np.array([-2.0, 0.0, 0.25, 17.9, 60.0])
    read = [np.interp(places, np.arange(40), v) for v in values.T]
    assert native.read_at(values, places) == pytest.approx(np.column_stack(read), abs=0.01)
    inside = places[1:4]
    read = [np.interp(inside, np.arange(40), v) for v in values.T]
    assert native.read_at(values, inside) == pytest.approx(np.column_stack(read), abs=1e-12)
    with pytest.raises(ValueError, match="two rows"):
        native.read_at(values[:1], places)


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


@pytest.mark.parametrize("count", [1, 8, 30])
def test_definite_matrices_are_solved_at_each_rise(count):
    random = np.random.default_rng(5)
    x, moments = random.normal(size=(4, 40, count)), random.normal(size=(4, count))
    grams, rises = x.swapaxes(1, 2) @ x, np.array([[0.1, 3.0]] * 3 + [[-1e4, -1e5]])
    found = native.solved_risen(grams, rises, moments)  # those of the last are negative
    for gram, rise, moment, solved in zip(grams, rises, moments, found, strict=True):
        for r, own in zip(rise, solved, strict=True):
            assert own == pytest.approx(np.linalg.solve(gram + r * np.eye(count), moment))
    with pytest.raises(ValueError, match="of each square matrix"):
        native.solved_risen(grams, rises, moments[:, :0])


def test_sums_refuse_rows_that_are_not_there():
    with pytest.raises(ValueError, match="rows of values"):
        native.led_between(
            *([(np.ones((5, 1)), np.ones((5, 1)))], []),
            *(np.ones((5, 2)), np.array([0]), np.array([5]), np.ones((1, 2))),
        )


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


def test_a_small_change_is_not_taken_until_it_is_large():
    assert held(np.array([0.2, 0.5, 0.45, 0.1, 0.0]), 0.3).tolist() == [0.0, 0.5, 0.5, 0.1, 0.1]


def test_what_is_wound_up_is_so_by_its_way_and_lets_go_at_once():
    way_m = np.array([0.02, 0.02, 0.02, -0.01, -0.08])
    assert wound(way_m, 0.04) == pytest.approx([0.5, 1.0, 1.0, 0.75, -1.0])
