# SPDX-License-Identifier: Apache-2.0
"""Results of a fit against ordinary least squares, SciPy and algebra."""

import pickle
import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from joblib.externals import loky
from scipy import optimize, stats

import twinmill as tm

RATE_MPS, INPUTS = 0.0036, np.arange(10, 101, 5.0)
BASE = '[base]\ndrive = "twist"\nwheels = "none"\nspeed_per_input_mps = 0.0036\n'
TWIST = f'name = "t"\n{BASE}control_period_s = 0.02\n'
GAIN = "base.forward_gain"
EXACT = tm.FitSettings(rounds=50, tolerance=1e-12)


@pytest.fixture(scope="module")
def sheet(tmp_path_factory) -> tuple[np.ndarray, np.ndarray, str, str]:
    """Speeds y at inputs x in m/s, of which the model's are x times a gain; errors grow with x."""
    folder = tmp_path_factory.mktemp("sheet")
    x = RATE_MPS * INPUTS
    y = 0.93 * x + np.random.default_rng(1).normal(0, 0.006, len(x)) * (INPUTS / 50)
    columns = {"robot_id": 1, "speed_input": INPUTS, "direction_deg": 90, "turn_input": 0, "run": 1}
    rows = pd.DataFrame({**columns, "speed_mps": y, "turn_radps": np.nan, "note": ""})
    rows.to_csv(folder / "sheet.csv", index=False)
    (folder / "twist.toml").write_text(TWIST)
    return x, y, str(folder / "sheet.csv"), str(folder / "twist.toml")


def test_a_linear_fit_is_ordinary_least_squares(sheet):
    """With a prior so wide that it says nothing: the slope, each residual, and the likelihood."""
    x, y, log, model = sheet
    fitted = tm.fit(log, model, free=[GAIN], priors={GAIN: (1.0, 100.0)}, settings=EXACT)
    (slope,), *_ = np.linalg.lstsq(x[:, None], y, rcond=None)
    assert fitted.params[GAIN] == pytest.approx(slope, rel=1e-7)
    left = fitted.residuals()
    np.testing.assert_allclose(left["residual"], y - slope * x, atol=1e-9)
    over = (y - slope * x) / left["floor"]
    # Greene 2018, Econometric Analysis, eq. 14-34: the likelihood at its best scale.
    likelihood = -len(x) / 2 * (np.log(2 * np.pi * np.mean(over**2)) + 1)
    assert fitted.log_likelihood == pytest.approx(likelihood) and fitted.nobs == len(x)
    assert fitted.converged
    ended = tm.fit(log, model, free=[GAIN], settings=tm.FitSettings(rounds=1, tolerance=1e-12))
    assert not ended.converged


def test_its_interval_is_that_of_the_jackknife(sheet):
    """Slopes without each row by algebra (Efron and Tibshirani 1993, eq. 11.5), Student's t."""
    x, y, log, model = sheet
    fitted = tm.fit(log, model, free=[GAIN], priors={GAIN: (1.0, 100.0)}, settings=EXACT)
    slope, n = (x @ y) / (x @ x), len(x)
    without = (x @ y - x * y) / (x @ x - x**2)
    jackknife = np.sqrt((n - 1) / n * np.sum((without - slope) ** 2))
    for alpha in (0.05, 0.32):
        half = stats.t.ppf(1 - alpha / 2, n - 1) * jackknife
        lower, upper = fitted.conf_int(alpha).loc[GAIN]
        assert (upper - lower) / 2 == pytest.approx(half, rel=1e-4)
        assert (upper + lower) / 2 == pytest.approx(slope, rel=1e-7)
    with pytest.raises(ValueError, match="alpha: is 5"):
        fitted.conf_int(5)


def test_a_prior_pulls_as_scipy_says(sheet):
    x, y, log, model = sheet
    fitted = tm.fit(log, model, free=[GAIN], priors={GAIN: (0.8, 0.01)}, settings=EXACT)
    floor = fitted.residuals()["floor"].to_numpy()

    def cost(gain: float) -> float:
        return len(x) * np.log(np.mean(((y - gain * x) / floor) ** 2)) + ((gain - 0.8) / 0.01) ** 2

    best = optimize.minimize_scalar(cost, bounds=(0.7, 1.1), options={"xatol": 1e-9})
    assert fitted.params[GAIN] == pytest.approx(best.x, abs=1e-6)
    assert 0.8 < best.x < 0.92  # it does pull


@pytest.mark.parametrize("deviation", [1e-4, 1e-3, 0.01, 0.1])
def test_a_posterior_is_as_wide_as_the_conjugate_normal_is(sheet, deviation):
    """Gelman et al. 2013, eq. 2.12: precisions add, where the prior is about what the data tell."""
    _, _, log, model = sheet
    alone = tm.fit(log, model, free=[GAIN], priors={GAIN: (1.0, 100.0)}, settings=EXACT)
    prior = {GAIN: (float(alone.params[GAIN]), deviation)}
    fitted = tm.fit(log, model, free=[GAIN], priors=prior, settings=EXACT)
    width = 1 / np.hypot(1 / deviation, 1 / alone.stderr[GAIN])
    assert fitted.stderr[GAIN] == pytest.approx(width, rel=0.1)
    assert fitted.stderr[GAIN] <= deviation
    assert ("from the prior" in str(fitted)) == (deviation < alone.stderr[GAIN])
    assert "not determined" not in str(fitted)
    assert ("(from the prior)" in fitted.summary()) == (deviation < alone.stderr[GAIN])


def test_a_prior_that_contradicts_the_data_is_no_less_sure_than_it_says(sheet):
    """A posterior is no wider than its normal prior, wherever the data are."""
    _, _, log, model = sheet
    fitted = tm.fit(log, model, free=[GAIN], priors={GAIN: (0.8, 0.001)}, settings=EXACT)
    lower, upper = fitted.conf_int().loc[GAIN]
    assert fitted.stderr[GAIN] <= 0.001 and (upper - lower) / 2 <= 1.96 * 0.0010001
    (told,) = fitted.to_json()["parameters"]
    assert told["std"] == fitted.stderr[GAIN] == np.sqrt(fitted.covariance().iloc[0, 0])


def unicycle(gains: tuple[float, float], seed: int) -> tm.Log:
    """A robot whose motion is algebra: arcs at its gains times what it is told, 1 mm of noise."""
    rng = np.random.default_rng(seed)
    step_s, held_s = 0.02, 1.0
    told = np.column_stack([rng.uniform(-0.3, 0.3, 60), rng.uniform(-1, 1, 60)])
    v, w = np.repeat(told * gains, int(held_s / step_s), axis=0).T
    heading = np.concatenate([[0], np.cumsum(w * step_s)])
    middle, chord = heading[:-1] + w * step_s / 2, v * step_s * np.sinc(w * step_s / 2 / np.pi)
    path = np.cumsum(np.column_stack([chord * np.cos(middle), chord * np.sin(middle)]), axis=0)
    pose = np.column_stack([np.vstack([[0, 0], path]), heading])
    pose += rng.normal(0, [1e-3, 1e-3, 2e-3], pose.shape)
    t_s = np.arange(len(pose)) * step_s
    return tm.Log.from_arrays(
        t_s, pose, np.arange(60) * held_s, told, kind="twist", same_clock=True, name=f"arcs{seed}"
    )


@pytest.fixture(scope="module")
def arcs(sheet) -> tuple[tm.Fit, tm.Log, str]:
    log = unicycle((0.9, 1.1), 1)
    return tm.fit(log, sheet[3], hold=["base.motor_lag_s", "base.sideways_gain"]), log, sheet[3]


def test_gains_of_a_path_that_is_algebra_are_found_within_their_errors(arcs):
    fitted, _, _ = arcs
    gains = fitted.params[[GAIN, "base.yaw_gain"]]
    away = (gains - [0.9, 1.1]) / fitted.stderr[gains.index]
    assert (away.abs() < 4).all() and (fitted.stderr.dropna() < 0.01).all()
    ahead = fitted.residuals().query("channel == 'forward' and horizon_s == 0.1")["residual"]
    # A millimetre at the start and one at the end; 0.15 is three errors of a deviation of 240.
    assert ahead.std() == pytest.approx(np.sqrt(2) * 1e-3, rel=0.15)


def test_predictions_stand_beside_what_was_measured(arcs):
    """Arcs by algebra: at v and w the way forward in t is v t sinc(w t / pi), the turn is w t."""
    fitted, log, model = arcs
    poses = log.table().set_index("t_s")[["x_m", "y_m", "theta_rad"]]
    for rows in (fitted.residuals(), tm.compare(log, model).residuals()):
        assert len(rows) > 2000
        away = rows["measured"] - rows["predicted"] - rows["residual"]
        assert away.abs().max() < 1e-9
        half = rows.query("horizon_s == 0.5 and t_s == t_s.round(2)")
        x, y, theta = poses.loc[half["t_s"].unique()].T.to_numpy()
        ends = (half["t_s"].unique() + 0.5).round(2)
        end_x, end_y, end_theta = poses.loc[ends].T.to_numpy()
        ahead = (end_x - x) * np.cos(theta) + (end_y - y) * np.sin(theta)
        for channel, told in (("forward", ahead), ("heading", end_theta - theta)):
            measured = half.loc[half["channel"] == channel, "measured"]
            np.testing.assert_allclose(measured, told, atol=0.02)  # headings are smoothed


def test_there_is_one_standard_error(arcs):
    fitted, _, _ = arcs
    written = tomllib.loads(fitted.model.file.text)
    file = {f"base.{key}": value for key, value in written["base"]["std"].items()}
    table = fitted.table().set_index("name")["std"]
    told = {p["name"]: p["std"] for p in fitted.to_json()["parameters"]}
    half = (fitted.conf_int()["upper"] - fitted.conf_int()["lower"]) / 2 / 1.96
    diagonal = np.sqrt(np.diag(fitted.covariance()))
    found = fitted.stderr.dropna()  # without what was held
    for name, std in found.items():
        assert table[name] == told[name] == std
        assert file[name] == pytest.approx(std, rel=1e-5)
        assert half[name] == pytest.approx(std)
    np.testing.assert_allclose(diagonal, found)
    assert np.linalg.eigvalsh(fitted.covariance()).min() > 0


def test_a_number_that_the_log_does_not_tell_is_marked(sheet):
    """A robot that only stands and goes straight ahead tells nothing of how it turns."""
    t_s = np.arange(0, 60, 0.02)
    v = np.where((t_s // 1.2) % 3 == 1, 0.2, 0.0)
    pose = np.column_stack([np.append(0, np.cumsum(v[:-1]) * 0.02), 0 * t_s, 0 * t_s])
    pose += np.random.default_rng(3).normal(0, 5e-4, pose.shape)
    told = np.column_stack([v, 0 * v])[::60]
    log = tm.Log.from_arrays(t_s, pose, t_s[::60], told, kind="twist", same_clock=True)
    said = tm.fit(log, sheet[3], free=["base.forward_gain", "base.yaw_gain"]).summary()
    assert re.search(r"^base\.yaw_gain .*\(not determined by this log\)$", said, re.M)
    assert re.search(r"^base\.forward_gain .* 1$", said, re.M)


def test_what_is_held_is_listed_and_marked(arcs, tmp_path):
    """At the values given here: as lmfit lists what does not vary, without an error."""
    _, log, model = arcs
    given = tm.Model.load(model).set({"base.yaw_gain": 1.05, "sensor.range_m": 0.7})
    fitted = tm.fit(log, given, hold=["base.yaw_gain", "sensor.range_m", "robot"])
    held = {"base.yaw_gain": 1.05, "sensor.range_m": 0.7}
    table = fitted.table().set_index("name")
    assert dict(table.query("held")["value"]) == held
    assert dict(fitted.params[list(held)]) == held
    assert (
        fitted.stderr[list(held)].isna().all()
        and fitted.conf_int().loc[list(held)].isna().all().all()
    )
    assert set(fitted.covariance().index) == set(table.query("not held").index)
    assert re.search(r"^base\.yaw_gain +1\.05 .*\(held\)$", fitted.summary(), re.M)
    assert not re.search(r"^base\.forward_gain .*\(held\)", fitted.summary(), re.M)
    assert {h["name"]: (h["value"], h["unit"]) for h in fitted.to_json()["held"]} == {
        "base.yaw_gain": (1.05, "1"),
        "sensor.range_m": (0.7, "m"),
    }
    fitted.report(tmp_path / "page")
    page = re.sub("<[^>]+>", " ", (tmp_path / "page/index.html").read_text())
    assert re.search(r"base\.yaw_gain\s+1\.05\d*\s+-\s+held", page)
    only = tm.fit(log, model, free=["base.yaw_gain"]).table().query("held")["name"]
    assert "base.forward_gain" in set(only) and "base.yaw_gain" not in set(only)


def test_what_is_held_keeps_its_value_fitted_or_not(arcs):
    fitted, log, model = arcs
    held = ["base.yaw_gain", "sensor.range_m", "robot"]  # the latter are never fitted to poses
    other = tm.fit(log, tm.Model.load(model).set({"base.yaw_gain": 1.05}), hold=held)
    assert other.model["base.yaw_gain"] == 1.05
    assert "base.yaw_gain" in fitted.stderr.dropna()
    alone = tm.fit(log, model, free=["base.yaw_gain"])
    assert list(alone.stderr.dropna().index) == ["base.yaw_gain"]
    with pytest.raises(tm.ModelError, match=r"base\.yaw_gian: .* the nearest is base\.yaw_gain"):
        tm.fit(log, model, hold=["base.yaw_gian"])
    with pytest.raises(tm.ModelError, match=r"a prior of 1 \+- 0 cannot be"):
        tm.fit(log, model, priors={GAIN: (1.0, 0.0)})
    with pytest.raises(TypeError, match=r"prior of base\.forward_gain: is 1"):
        tm.fit(log, model, priors={GAIN: 1})
    with pytest.raises(tm.ModelError, match=r"half_track_m: has a prior and is not fitted; name"):
        tm.fit(log, model, priors={"robot.half_track_m": (0.08, 0.001)})
    with pytest.raises(tm.ModelError, match=r"yaw_gain: has a prior and is held"):
        tm.fit(log, model, priors={"base.yaw_gain": (1, 0.1)}, hold=["base.yaw_gain"])
    for hold in ("base.yaw_gain", "base"):
        with pytest.raises(tm.ModelError, match=r"yaw_gain: is in `free` and is held"):
            tm.fit(log, model, free=["base.yaw_gain"], hold=[hold])
    with pytest.raises(tm.ModelError, match="moves nothing"):
        tm.fit(log, model, free=["sensor.range_m"])


def test_fits_to_several_logs_are_told_apart_and_are_small(arcs):
    """A fit pickles to a few times its log, whose numbers it has, and is named by it."""
    fitted, log, model = arcs
    assert "arcs1" in repr(fitted) and "arcs1" in repr(fitted.model)
    assert "fitted" not in repr(tm.Model.load(model))
    size = len(pickle.dumps(log))
    assert len(pickle.dumps(fitted)) < 8 * size
    again = pickle.loads(pickle.dumps(fitted))
    assert again.residuals().equals(fitted.residuals()) and str(again) == str(fitted)


def test_results_go_to_other_processes_and_come_back(arcs):
    fitted, log, model = arcs
    worker = loky.get_reusable_executor(max_workers=1)  # what joblib sends its work to
    there, here = worker.submit(tm.compare, log, model).result(), tm.compare(log, model)
    assert there.to_json() == here.to_json() and str(there) == str(here)
    again = pickle.loads(pickle.dumps(fitted))
    assert again.summary() == fitted.summary() and str(again) == str(fitted)
    assert again.residuals().equals(fitted.residuals())
