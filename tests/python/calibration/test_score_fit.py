# SPDX-License-Identifier: Apache-2.0
"""Fits of the score, against the constants of a robot of another form and their own scatter."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.fit import base_names, fit
from twinmill.fitting.opening import judged, open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import base_parameters, effect_parameters

LOGS = 6
LAG = "base.motor_lag_s"
FLEXIBLE = "p0*sin(7*theta) + p1*cos(7*theta) + p2*sin(5*theta) + p3*cos(5*theta)"
QUIET = {"sensor_m": 1e-4, "sensor_rad": 3e-4, "drive_mps": 3e-4, "drive_radps": 1e-3}


@pytest.fixture(scope="module")
def truth(tanh_robot):
    """Its speeds at the table's duties, gains, lag."""
    robot = tanh_robot()
    speeds = robot.speed_mps(np.array([0.25, 0.5, 0.75, 1]))
    return {
        **{f"base.wheel_speed_mps.{i + 1}": s for i, s in enumerate(speeds)},
        "base.sideways_gain": robot.sideways,
        "base.yaw_gain": robot.yaw,
        LAG: robot.lag_s,
    }


def parameters(guess, opened, **changes):
    """The base's free quantities; fields of one may be changed by its name."""
    names = {name.replace("__", "."): fields for name, fields in changes.items()}
    free = base_parameters(guess.model, base_names(guess.model, opened))
    assert set(names) <= {p.name for p in free}
    return [replace(p, **names.get(p.name, {})) for p in free]


def score_fit(runs, guess, **changes):
    """A fit of the base to runs."""
    opened = judged(open_measurements(runs, guess))
    free = parameters(guess, opened, **changes)
    return ScoreFit([o.data for o in opened], [o.model for o in opened], free).fit()


@pytest.fixture(scope="module")
def fits(tanh_robot, measure, model_file):
    """(LOGS, P) values and standard errors of logs that differ in script and noise."""
    guess = model_file()
    found = [
        score_fit([measure(tanh_robot(), 100 + seed, 30.0)], guess).shared_estimates()
        for seed in range(LOGS)
    ]
    values, stds = (np.array([[getattr(e, k) for e in f] for f in found]) for k in ("value", "std"))
    return [e.name for e in found[0]], values, stds


def test_estimates_are_right_on_average(fits, truth):
    """Within three standard errors of the mean, and half a step of the robot's 1/480 s Euler."""
    names, values, _ = fits
    scatter = values.std(axis=0, ddof=1) / np.sqrt(LOGS)
    for name, mean, error in zip(names, values.mean(axis=0), scatter, strict=True):
        form = 1 / 960 if name == LAG else 0.005 * truth[name]
        assert mean == pytest.approx(truth[name], abs=3 * error + form), name


def test_intervals_cover_the_truth(fits, truth):
    """At least 36 of 42 intervals of 95 %: a binomial of 0.95 has fewer once in 70 times."""
    names, values, stds = fits
    true = np.array([truth[name] for name in names])
    inside = np.abs(values - true) < 1.96 * stds
    assert inside.sum() >= 0.85 * inside.size, dict(zip(names, inside.mean(axis=0), strict=True))


def test_intervals_are_not_so_wide_that_they_say_nothing(fits):
    """Stated errors are within three times the scatter, pooled: 35 degrees of freedom."""
    _, values, stds = fits
    scatter = (values - values.mean(axis=0)) / np.sqrt(np.mean(stds**2, axis=0))
    assert np.sum(scatter**2) / ((LOGS - 1) * values.shape[1]) > 1 / 9


def test_intervals_cover_the_truth_beside_a_small_effect_that_is_not_modelled(
    tanh_robot, measure, model_file, truth
):
    """Left turns are 3 % faster than right ones, and no model knows it."""

    class Lopsided(tanh_robot):
        def wheels_mps(self, duty):
            speeds = super().wheels_mps(duty)
            spin = (speeds * (-1, 1, -1, 1)).mean(axis=1)
            return speeds + 0.03 * np.abs(spin)[:, None] * (-1, 1, -1, 1)

    inside = []
    for seed in range(3):
        found = score_fit([measure(Lopsided(), 150 + seed, 30.0)], model_file())
        inside += [
            abs(e.value - truth[e.name]) < 1.96 * e.std + 0.003 * truth[e.name]
            for e in found.shared_estimates()
        ]
    assert np.mean(inside) >= 0.8


@pytest.mark.parametrize("spread_s", [0.02, 0.04])
def test_an_interval_is_as_wide_as_runs_disagree(spread_s, tanh_robot, measure, model_file):
    """Lags of eight runs scatter by some ms: the mean is known to that over sqrt(8).

    The scatter of eight is itself known to a quarter; the mean, to 2.4 standard errors at 95 %.
    """
    lags_s = 0.09 + spread_s * np.array([-1.2, 0.9, -0.4, 1.3, -1.0, 0.1, 1.1, -0.8])
    runs = [measure(tanh_robot(lag_s=lag, **QUIET), 180 + k, 12.0) for k, lag in enumerate(lags_s)]
    lag = next(e for e in score_fit(runs, model_file()).shared_estimates() if e.name == LAG)
    error_s = np.std(lags_s, ddof=1) / np.sqrt(len(lags_s))
    assert lag.value == pytest.approx(lags_s.mean(), abs=2.4 * error_s)
    assert error_s / 1.5 < lag.std < 1.5 * error_s


def chance_of_a_turned_marker(measurement, guess):
    """Probability, by a fit with `heading_bias`, that it is nothing."""
    (opened,) = judged(open_measurements([measurement], guess))
    model = opened.model.copy()
    model.add_effect("heading_bias")
    free = [*parameters(guess, [opened]), *effect_parameters(model, "heading_bias", fresh=True)]
    return ScoreFit([opened.data], [model], free).fit().chance_of_none("heading_bias")


@pytest.mark.parametrize("lag_s", [0.02, 0.2])
def test_a_fit_never_raises_the_score(lag_s, fits, tanh_robot, measure, model_file, tmp_path):
    """From a guess, and again from what was fitted to another log. 1 %: the prior's pull."""
    run = measure(tanh_robot(), 100, 30.0)
    guess = model_file(("motor_lag_s = 0.05", f"motor_lag_s = {lag_s}"))
    once = fit([run], guess, tmp_path / "once.toml", "")
    assert once.after.score <= once.before.score
    kept = ModelFile.load(str(once.path)).covariance
    assert kept.names == tuple(e.name for e in once.parameters if e.seen)
    other = measure(tanh_robot(yaw=0.75), 101, 30.0)
    again = fit([other], ModelFile.load(str(once.path)), tmp_path / "again.toml", "")
    assert again.after.score <= 1.01 * again.before.score


def test_a_smoothed_log_keeps_its_gains(tanh_robot, measure, model_file, truth):
    """Poses averaged over 0.3 s, as many a capture program gives them: gains stay within 0.02."""

    def smoothed(pose, valid):
        kernel = np.ones(36) / 36
        padded = np.pad(pose, ((18, 17), (0, 0)), mode="edge")
        return np.column_stack([np.convolve(c, kernel, "valid") for c in padded.T]), valid

    found = {
        e.name: e.value
        for e in score_fit(
            [measure(tanh_robot(), 7, 60.0, spoil=smoothed)], model_file()
        ).shared_estimates()
    }
    for name in ("base.sideways_gain", "base.yaw_gain"):
        assert found[name] == pytest.approx(truth[name], abs=0.02), name
    full = "base.wheel_speed_mps.4"
    assert found[full] / truth[full] == pytest.approx(1, abs=0.02)


def test_left_out_parts_are_predicted_by_fits_to_the_others(tanh_robot, measure, model_file):
    """One Newton step stands for a refit: here the refit is made."""
    guess = model_file()
    (opened,) = open_measurements([measure(tanh_robot(), 5, 30.0)], guess)
    free = parameters(guess, [opened])
    whole = ScoreFit([opened.data], [opened.model], free).fit()
    out = whole.datasets[0].part == 2
    windows = ~out.reshape(opened.data.measured.shape).any(axis=(1, 2))
    rest = replace(opened.data, keep=opened.data.keep & windows)
    alone = ScoreFit([rest], [opened.model], free).fit()
    other = opened.data.rows(alone.models[0], [LAG], np.array([[alone.models[0].get(LAG)]]))[0]
    by_refit, by_step = np.sum(other[out] ** 2), np.sum(whole.held_out[0][out] ** 2)
    assert by_step == pytest.approx(by_refit, rel=0.1)
    assert by_step > np.sum(whole.state[0][0][out] ** 2)


def test_a_jump_of_few_poses_does_not_move_the_fit(tanh_robot, measure, model_file, truth):
    """One pose in a thousand is 6 mm off, twenty times its noise: below what counts as a jump."""

    def spoil(pose, valid):
        random = np.random.default_rng(7)
        hit = random.random(len(pose)) < 0.001
        angle = random.uniform(0, 2 * np.pi, len(pose))
        pose = pose.copy()
        pose[hit, :2] += 6e-3 * np.column_stack([np.cos(angle), np.sin(angle)])[hit]
        return pose, valid

    clean, dirty = (
        score_fit([measure(tanh_robot(), 5, 40.0, spoil=s)], model_file()).shared_estimates()
        for s in (None, spoil)
    )
    for a, b in zip(clean, dirty, strict=True):
        assert b.value == pytest.approx(a.value, abs=3 * a.std + 0.002 * abs(truth[a.name])), a.name
        assert b.std < 3 * a.std


@pytest.fixture(scope="module")
def straight(tanh_robot, measure):
    """Straight runs at 50 and 100 %, which tell nothing of strafing, turning or other duties."""
    legs = [[(d,) * 4] * 48 for d in (100, 0, -100, 0, 50, 0, -50, 0)] * 4
    return measure(tanh_robot(), 6, script_pct=np.concatenate(legs))


def test_the_covariance_is_of_what_the_log_tells_and_as_wide_as_the_stds(straight, model_file):
    fitted = score_fit([straight], model_file())
    told = [e for e in fitted.shared_estimates() if e.seen]
    covariance = fitted.shared_covariance()
    assert covariance.names == tuple(e.name for e in told)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance.values)), [e.std for e in told])


def test_what_a_log_does_not_tell_stays_and_is_said_to(straight, model_file):
    guess = model_file()
    fitted = score_fit([straight], guess)
    told = {"base.wheel_speed_mps.2", "base.wheel_speed_mps.4", LAG}
    for estimate, start in zip(fitted.shared_estimates(), fitted.shared, strict=True):
        assert estimate.seen == (estimate.name in told), estimate.name
        if not estimate.seen:
            assert estimate.value == pytest.approx(start.value, abs=0.3 * start.std)
            assert estimate.std > 0.5 * start.std


def test_what_a_log_tells_of_wheels_together_is_kept_though_none_is_told_alone(
    straight, model_file
):
    """Plain wheels driven straight on: it shows that a side is weaker, not which wheel makes it.

    Were they told each by itself, half the difference of the sides would spread as one wheel does.
    """
    plain = ('wheels = "mecanum"', 'wheels = "differential"')
    guess = model_file(plain, extra='[[effect]]\nname = "wheel_gain"\n')
    opened = judged(open_measurements([straight], guess))
    free = effect_parameters(guess.model, "wheel_gain")
    free += base_parameters(guess.model, ["base.sideways_gain"])
    fitted = ScoreFit([o.data for o in opened], [o.model for o in opened], free).fit()
    *wheels, sideways = fitted.shared_estimates()
    assert [e.seen for e in wheels] == [False] * 4 and all(e.together for e in wheels)
    assert not sideways.seen and not sideways.together
    covariance = fitted.shared_covariance()
    assert covariance.names == tuple(e.name for e in wheels)
    side = np.array([1, -1, 1, -1]) / 2
    assert np.sqrt(side @ covariance.values @ side) < 0.3 * wheels[0].std


def test_plain_wheels_have_no_gain_sideways(straight, model_file):
    """They cannot roll sideways, whatever they are told."""
    for wheels, moves in (("mecanum", True), ("differential", False)):
        guess = model_file(('wheels = "mecanum"', f'wheels = "{wheels}"'))
        names = base_names(guess.model, open_measurements([straight], guess), ())
        assert ("base.sideways_gain" in names) == moves
        assert "base.yaw_gain" in names


def test_a_narrow_prior_holds_and_a_wide_one_does_not(straight, model_file, truth):
    held, let_go = (
        score_fit([straight], model_file(), base__motor_lag_s={"std": width}).shared_estimates()[-1]
        for width in (1e-6, 0.3)
    )
    assert held.value == pytest.approx(0.05, abs=1e-4) and not held.seen
    assert let_go.value == pytest.approx(truth[LAG], abs=0.01) and let_go.seen


def test_an_interval_reaches_back_over_what_the_prior_pulled(straight, model_file):
    """The free estimate lies where a fit without the prior puts it, far from the prior's middle."""
    (free,) = (e for e in score_fit([straight], model_file()).shared_estimates() if e.name == LAG)
    far = free.value + 0.05
    pulled = score_fit([straight], model_file(), base__motor_lag_s={"usual": far, "std": 0.01})
    (held,) = (e for e in pulled.shared_estimates() if e.name == LAG)
    assert abs(held.value - free.value) < 1.96 * held.std
    assert held.std > 0.7 * abs(held.value - free.value)


def test_an_estimate_at_its_bound_is_marked(straight, model_file):
    for bound, value in (({"max": 0.07}, 0.07), ({"min": 0.12, "value": 0.13}, 0.12)):
        found = score_fit([straight], model_file(), base__motor_lag_s=bound).shared_estimates()
        lag = next(e for e in found if e.name == LAG)
        assert lag.at_bound and lag.value == pytest.approx(value, abs=1e-3)
    assert not any(e.at_bound for e in score_fit([straight], model_file()).shared_estimates())


def test_an_estimate_within_wide_limits_is_at_none(straight, model_file):
    """The one of the usual limits is not at a bound, so it is not where these are further away."""
    found = score_fit([straight], model_file(), base__motor_lag_s={"max": 1000.0})
    assert not any(e.at_bound for e in found.shared_estimates())


def test_a_disturbed_log_does_not_speak_for_all(tanh_robot, measure, model_file):
    """Two calm robots and one whose gains are 30 % off: the common gain is that of the two."""
    runs = [measure(tanh_robot(), 160 + i, 30.0) for i in range(2)]
    runs.append(measure(tanh_robot(yaw=0.55), 162, 30.0))
    found = {e.name: e.value for e in score_fit(runs, model_file()).shared_estimates()}
    assert found["base.yaw_gain"] == pytest.approx(tanh_robot().yaw, abs=0.08)


def test_a_flexible_formula_wins_where_it_is_fitted_and_loses_where_it_is_not(
    tanh_robot, measure, one_clock_base
):
    """Nothing is hidden. Wilks 1938: needless parameters lower the cost where they are fitted.

    A fit to some parts is as far off as chance takes it, so that the others are told worse.
    """
    gains, losses = [], []
    for seed in range(5):
        (opened,) = open_measurements([measure(tanh_robot(), 200 + seed, 20.0)], one_clock_base)
        base = base_parameters(opened.model, base_names(opened.model, [opened], ()))
        poor = ScoreFit([opened.data], [opened.model], base).fit()
        richer = poor.models[0].copy()
        richer.add_effect("equation", {"adds_to": "vx_mps", "formula": FLEXIBLE})
        more = [p.at(richer.get(p.name)) for p in base] + effect_parameters(richer, "equation")
        rich = ScoreFit([opened.data], [richer], more).fit()
        gains.append(poor.scores[0] - rich.scores[0])
        losses.append(rich.held_scores[0] - poor.held_scores[0])
    assert min(gains) > 0
    assert np.mean(losses) > 0
