# SPDX-License-Identifier: Apache-2.0
"""A log can, or cannot, tell that an effect is one number."""

import numpy as np
import pytest

from twinmill.diagnosis.constancy import RIM, OneHeading, changes_of
from twinmill.diagnosis.diagnose import diagnose, first_state
from twinmill.diagnosis.trials import fitted, with_effects
from twinmill.fitting.opening import judged, open_measurements
from twinmill.formulas.term import PLACE

BIAS_RAD = 0.06


@pytest.mark.parametrize("turn", [False, True])
def test_a_heading_bias_along_one_heading_may_be_one_that_changes_with_it(
    turn, tanh_robot, measure, model_file
):
    """Legs to and fro along one line of the room, or with a turn on the spot between them."""
    legs = [[(d,) * 4] * 48 for d in (100, 0, -100, 0, 50, 0, -50, 0)]
    spin = [[(-60, 60, -60, 60)] * 30] if turn else []
    run = measure(tanh_robot(), 6, script_pct=np.concatenate([*legs, *spin] * 4))
    run = run.with_pose(run.track.pose + np.array([0, 0, BIAS_RAD]))
    guess = model_file()
    state = first_state(judged(open_measurements([run], guess)), guess, ())
    told = changes_of(fitted(with_effects(state, ["heading_bias"])))
    assert isinstance(told.get("heading_bias"), OneHeading) != turn


@pytest.mark.parametrize("turn", [False, True])
def test_an_error_of_the_compass_that_turns_alone_tell_may_be_of_the_turns(
    turn, tanh_robot, measure, model_file
):
    """A turn on the spot between legs, and back again, or on to the next heading.

    Turns whose speed hangs on the heading show the same headings; only the way that is driven
    along several tells them from a compass that errs.
    """
    legs = [[(d,) * 4] * 48 for d in (100, 0, -100, 0)]
    spin, rest = [[(-60, 60, -60, 60)] * 70], [[(0,) * 4] * 24]
    back = [] if turn else [[(60, -60, 60, -60)] * 70]
    run = measure(
        tanh_robot(), 6, script_pct=np.concatenate([*legs, *spin, *rest, *back, *rest] * 6)
    )
    error_rad = 0.1 * np.sin(run.track.pose[:, 2] + 1)
    run = run.with_pose(run.track.pose + error_rad[:, None] * np.array([0, 0, 1]))
    guess = model_file()
    state = first_state(judged(open_measurements([run], guess)), guess, ())
    told = changes_of(fitted(with_effects(state, ["compass_deviation"])))
    assert isinstance(told.get("compass_deviation"), OneHeading) != turn


@pytest.mark.parametrize("iron", [False, True])
def test_a_heading_bias_that_is_of_one_side_of_the_room_is_not_one_number(
    iron, tanh_robot, measure, true_model
):
    """Iron under the floor leads the compass astray near it; a bias is the same everywhere."""
    run = measure(tanh_robot(), 6, 120.0)
    place_m = run.track.pose[:, :2]
    apart_m = np.hypot(*(place_m - np.quantile(place_m, 0.75, axis=0)).T)
    share = np.exp(-((apart_m / (np.ptp(place_m, axis=0).max() / 3)) ** 2)) if iron else 1.0
    error_rad = np.broadcast_to(0.1 * share, len(place_m))
    run = run.with_pose(run.track.pose + error_rad[:, None] * np.array([0, 0, 1]))
    state = first_state(judged(open_measurements([run], true_model)), true_model, ())
    told = changes_of(fitted(with_effects(state, ["heading_bias"]))).get("heading_bias")
    assert (told.on if told else None) == (PLACE if iron else None)


@pytest.mark.parametrize("warms", [False, True])
def test_a_wheel_that_gets_weaker_as_its_motor_warms_is_no_weak_wheel(
    warms, tanh_robot, measure, true_model
):
    """Equal loss on the mean: from begin to end, or more and more."""

    class Weak(tanh_robot):
        def wheels_mps(self, duty):
            t_s = np.arange(len(duty)) / 480
            lost = 0.08 * (1 - np.exp(-t_s / 25)) if warms else np.full(len(duty), 0.04)
            speeds = super().wheels_mps(duty)
            speeds[:, 1] *= 1 - lost
            return speeds

    found = diagnose([measure(Weak(), 6, 80.0)], true_model)
    assert [f.effect for f in found.findings] == ["wheel_gain"]
    assert ("time" in found.rest.depends_on) == warms
    assert found.verdict == ("outside_catalogue" if warms else "effect_missing")


@pytest.mark.parametrize("loaded", [False, True])
def test_a_robot_that_answers_later_from_one_moment_on_has_no_bad_clock(
    loaded, tanh_robot, measure, true_model
):
    """Later and later looks like a clock that runs slow; no crystal is off by so much."""

    class Loaded(tanh_robot):
        def wheels_mps(self, duty):
            half = len(duty) // 2 if loaded else len(duty)
            late = tanh_robot(lag_s=0.15).wheels_mps(duty)
            return np.vstack([super().wheels_mps(duty)[:half], late[half:]])

    found = diagnose([measure(Loaded(), 6, 80.0)], true_model)
    assert bool(found.findings) == loaded
    assert all(f.certainty == "doubtful" for f in found.findings)


@pytest.mark.parametrize("tight", [False, True])
def test_a_wheel_with_a_tight_bearing_is_no_weak_wheel(tight, tanh_robot, measure, true_model):
    """It loses the same speed at all speeds; a weak wheel the same share."""

    class Rubbed(tanh_robot):
        def wheels_mps(self, duty):
            speeds = super().wheels_mps(duty)
            share = 0.06 * speeds[:, 1]
            speeds[:, 1] -= 0.02 * np.tanh(speeds[:, 1] / 0.005) if tight else share
            return speeds

    levels = np.random.default_rng(3).choice((-100, -20, 20, 100), (160, 2))
    legs = [[(left, right) * 2] * 50 for left, right in levels]
    run = measure(Rubbed(), 6, script_pct=np.concatenate(legs))
    state = first_state(judged(open_measurements([run], true_model)), true_model, ())
    told = changes_of(fitted(with_effects(state, ["wheel_gain"]))).get("wheel_gain")
    assert (told.on if told else None) == (RIM if tight else None)
