# SPDX-License-Identifier: Apache-2.0
"""Fits against the constants of a robot of another form, and against their own scatter."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.fitting.compare import open_scenes
from twinmill.fitting.fit import refit
from twinmill.fitting.solve import excited, solve
from twinmill.model.freedom import base_quantities

LOGS = 12


def quantities(model_file, **changes):
    """The base's free quantities; fields of one may be changed by its name."""
    free = base_quantities(model_file.model, ())
    names = {name.replace("__", "."): fields for name, fields in changes.items()}
    assert set(names) <= {f.name for f in free}
    return [replace(f, **names.get(f.name, {})) for f in free]


@pytest.fixture(scope="module")
def truth(tanh_robot):
    """Its speeds at the table's duties, gains, lag."""
    robot = tanh_robot()
    speeds = robot.speed_mps(np.array([0.25, 0.5, 0.75, 1]))
    return {
        **{f"base.wheel_speed_mps.{i + 1}": s for i, s in enumerate(speeds)},
        "base.sideways_gain": robot.sideways,
        "base.yaw_gain": robot.yaw,
        "base.motor_lag_s": robot.lag_s,
    }


@pytest.fixture(scope="module")
def fits(tanh_robot, measure, model_file):
    """(LOGS, P) values and standard errors of logs that differ in script and noise."""
    guess = model_file()
    values, stds = [], []
    for seed in range(LOGS):
        scenes = open_scenes([measure(tanh_robot(), 100 + seed, 30.0)], guess)
        found = refit(scenes, quantities(guess)).estimates
        values.append([e.value for e in found])
        stds.append([e.std for e in found])
    return [e.name for e in found], np.array(values), np.array(stds)


def test_estimates_are_right_on_average(fits, truth):
    """Within three standard errors of the mean, and half a step of the robot's 1/480 s Euler."""
    names, values, _ = fits
    scatter = values.std(axis=0, ddof=1) / np.sqrt(LOGS)
    for name, mean, error in zip(names, values.mean(axis=0), scatter, strict=True):
        form = 1 / 960 if name == "base.motor_lag_s" else 0.003 * truth[name]
        assert mean == pytest.approx(truth[name], abs=3 * error + form), name


def test_standard_errors_tell_the_scatter(fits):
    """Scatter of 12 values is known to 21 %; its mean over 7 quantities to about 10 %.

    Of two standard errors, of the model's noise and of what blocks say, the larger is reported, so
    that the figure may be up to a half too large but not too small.
    """
    names, values, stds = fits
    ratio = values.std(axis=0, ddof=1) / np.sqrt(np.mean(stds**2, axis=0))
    assert np.all((ratio > 0.4) & (ratio < 1.6)), dict(zip(names, ratio, strict=True))
    assert 0.6 < np.sqrt(np.mean(ratio**2)) < 1.2


def test_outliers_do_not_move_the_fit(tanh_robot, measure, model_file, truth):
    """One pose in a hundred is 6 mm off, twenty times its noise: below what counts as a jump."""

    def spoil(pose, valid):
        random = np.random.default_rng(7)
        hit = random.random(len(pose)) < 0.01
        angle = random.uniform(0, 2 * np.pi, len(pose))
        pose = pose.copy()
        pose[hit, :2] += 6e-3 * np.column_stack([np.cos(angle), np.sin(angle)])[hit]
        return pose, valid

    guess = model_file()
    clean, dirty = (
        solve(open_scenes([measure(tanh_robot(), 5, 60.0, spoil=s)], guess), quantities(guess))
        for s in (None, spoil)
    )
    for a, b in zip(clean.estimates, dirty.estimates, strict=True):
        assert b.value == pytest.approx(a.value, abs=3 * a.std + 0.002 * abs(truth[a.name])), a.name
        assert b.std < 3 * a.std


@pytest.fixture(scope="module")
def straight(tanh_robot, measure):
    """Straight runs at 50 and 100 %, which tell nothing of strafing, turning or other duties."""
    legs = [[(d,) * 4] * 48 for d in (100, 0, -100, 0, 50, 0, -50, 0)] * 4
    return measure(tanh_robot(), 6, script_pct=np.concatenate(legs))


def test_what_a_log_does_not_tell_stays_and_is_said_to(straight, model_file):
    guess = model_file()
    scenes = open_scenes([straight], guess)
    free = quantities(guess)
    told = {"base.wheel_speed_mps.2", "base.wheel_speed_mps.4", "base.motor_lag_s"}
    assert {f.name for f in excited(scenes, free, [])} == told
    for estimate, start in zip(solve(scenes, free).estimates, free, strict=True):
        assert estimate.seen == (estimate.name in told), estimate.name
        if not estimate.seen:
            assert estimate.value == pytest.approx(start.start, abs=0.2 * start.prior_std)
            assert estimate.std > 0.9 * start.prior_std


def test_a_narrow_prior_holds_and_a_wide_one_does_not(straight, model_file, truth):
    guess = model_file()
    held, let_go = (
        solve(
            open_scenes([straight], guess),
            quantities(guess, base__motor_lag_s={"prior_std": width}),
        ).estimates[-1]
        for width in (1e-6, 0.3)
    )
    assert held.value == pytest.approx(0.05, abs=1e-4) and not held.seen
    assert let_go.value == pytest.approx(truth["base.motor_lag_s"], abs=0.003) and let_go.seen


def test_an_estimate_at_its_bound_is_marked(straight, model_file):
    guess = model_file()
    for bound, value in (({"max": 0.07}, 0.07), ({"min": 0.12, "start": 0.13}, 0.12)):
        free = quantities(guess, base__motor_lag_s=bound)
        (lag,) = (
            e
            for e in solve(open_scenes([straight], guess), free).estimates
            if e.name == "base.motor_lag_s"
        )
        assert lag.at_bound and lag.value == pytest.approx(value, abs=1e-3)
    free = quantities(guess)
    assert not any(e.at_bound for e in solve(open_scenes([straight], guess), free).estimates)
