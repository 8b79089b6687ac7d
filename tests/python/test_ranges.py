# SPDX-License-Identifier: Apache-2.0
"""Ranges of a model's numbers against the algebra of the multivariate normal."""

import json

import numpy as np
import pytest
import twinmill_native as native
import yaml
from scipy.stats import chi2, norm, truncnorm

from twinmill.model.ranges import Quantity, sampled
from twinmill_cli.main import run

COUNT = 20_000
FIT = """
[fit.covariance]
names = ["base.yaw_gain", "dead_zone.width"]
values = [[0.0004, -0.00018], [-0.00018, 0.0001]]
"""


def quantity(value, std, low=-1e9, high=1e9):
    return Quantity("q", "1", value, std, low, high, "fit")


def test_samples_have_the_covariance_and_their_distances_are_chi_squared():
    """Mean and covariance within four standard errors; of P = 3 normals d^2 is chi2 of 3."""
    root = np.array([[1, 0, 0], [-0.8, 0.6, 0], [0.3, 0.4, 0.5]]) * [[1], [0.01], [5]]
    covariance = root @ root.T
    stds = np.sqrt(np.diag(covariance))
    known = [quantity(v, s) for v, s in zip((1, 0.2, -7), stds, strict=True)]
    drawn, tried = sampled(known, covariance, COUNT, 1)
    assert tried >= COUNT
    assert np.all(np.abs(drawn.mean(0) - (1, 0.2, -7)) < 4 * stds / np.sqrt(COUNT))
    apart = np.abs(np.cov(drawn.T) - covariance)
    error = np.sqrt((np.outer(stds, stds) ** 2 + covariance**2) / COUNT)
    assert np.all(apart < 4 * error)
    off = drawn - (1, 0.2, -7)
    squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off)
    inside = np.mean(squared < chi2.ppf(0.95, 3))
    assert inside == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / COUNT))


def test_a_bound_cuts_the_normal_off_and_piles_nothing_up_there():
    """The mean of a normal cut off at one std below it, by scipy."""
    drawn, tried = sampled([quantity(0.1, 0.05, low=0.05)], np.array([[0.0025]]), COUNT, 2)
    within = norm.cdf(1)  # the bound is a standard deviation below the mean
    assert COUNT / tried == pytest.approx(within, abs=4 * np.sqrt(within * (1 - within) / tried))
    assert drawn.min() > 0.05
    whole = truncnorm(-1, np.inf, loc=0.1, scale=0.05)
    assert drawn.mean() == pytest.approx(whole.mean(), abs=4 * whole.std() / np.sqrt(COUNT))


def test_a_value_far_out_of_bounds_is_one_sentence():
    with pytest.raises(ValueError, match=r"hardly any sample.*record logs"):
        sampled([quantity(0.0, 0.01, low=1.0)], np.array([[1e-4]]), 10, 1)


@pytest.fixture
def model(tmp_path, monkeypatch, model_text):
    monkeypatch.chdir(tmp_path)
    text = model_text("m", yaw_gain=0.9) + "[base.std]\nyaw_gain = 0.02\nmotor_lag_s = 0.005\n"
    text += '[[effect]]\nname = "dead_zone"\nwidth = 0.05\nstd = { width = 0.01 }\n'
    text += "[idiosyncrasy]\ntheta_a1_std = 0.03\n"
    (tmp_path / "m.toml").write_text(text + FIT)
    return tmp_path


def test_three_files_say_the_same_and_every_sample_is_a_valid_model(model):
    run(["export-model", "m.toml", "--ranges", "--samples", "50", "--seed", "4"])
    as_json = json.loads((model / "m_ranges.json").read_text())
    as_yaml = yaml.safe_load((model / "m_ranges.yaml").read_text())
    assert as_json == as_yaml
    arrays = np.load(model / "m_ranges.npz")
    np.testing.assert_array_equal(arrays["samples"], as_json["samples"])
    by_name = {q["name"]: q for q in as_json["quantities"]}
    assert {n: q["source"] for n, q in by_name.items()} == {
        "base.yaw_gain": "fit",
        "dead_zone.width": "fit",
        "base.motor_lag_s": "std",
        "theta_a1": "robots",
    }
    gain = by_name["base.yaw_gain"]
    assert (gain["low"], gain["high"]) == pytest.approx((0.9 - 1.96 * 0.02, 0.9 + 1.96 * 0.02))
    names = list(arrays["names"])
    own = np.ix_(*[[names.index(n) for n in ("base.yaw_gain", "dead_zone.width")]] * 2)
    np.testing.assert_allclose(arrays["covariance"][own], [[4e-4, -1.8e-4], [-1.8e-4, 1e-4]])
    sampled_model = native.Model.load("m.toml")
    for row in arrays["samples"]:
        for name, value in zip(names, row, strict=True):
            sampled_model.set(name, value)  # refuses what is out of bounds


def test_a_quantity_that_its_bound_truncates_is_named_with_what_its_samples_are(model, capsys):
    """0.005 +- 0.01 above 0: mean and std of the half that is left, by scipy."""
    text = (model / "m.toml").read_text().replace("motor_lag_s = 0.005", "motor_lag_s = 0.01")
    lag = next(line for line in text.splitlines() if line.startswith("motor_lag_s"))
    (model / "near.toml").write_text(text.replace(lag, "motor_lag_s = 0.005", 1))
    run(["export-model", "near.toml", "--ranges", "--samples", "4000", "--json"])
    (said,) = json.loads(capsys.readouterr().out)["warnings"]
    whole = truncnorm(-0.5, np.inf, loc=0.005, scale=0.01)
    assert said.startswith("base.motor_lag_s = 0.005 ± 0.01 is truncated: 31 % ")
    mean, std = (float(said.split(f" {k} ")[1].split()[0].rstrip(",")) for k in ("mean", "std"))
    error = whole.std() / np.sqrt(4000)
    assert (mean, std) == pytest.approx((whole.mean(), whole.std()), abs=4 * error)
    found = json.loads((model / "near_ranges.json").read_text())
    assert found["truncated"] == ["base.motor_lag_s"]
    assert np.load(model / "near_ranges.npz")["truncated"].tolist() == ["base.motor_lag_s"]


def test_what_no_bound_touches_is_not_called_truncated(model, capsys):
    run(["export-model", "m.toml", "--ranges", "--json"])
    assert json.loads(capsys.readouterr().out)["warnings"] == []


def test_a_covariance_of_what_the_model_has_not_is_refused_with_the_nearest_name(model):
    text = (model / "m.toml").read_text()
    (model / "odd.toml").write_text(text.replace('"dead_zone.width"', '"effect.dead_zone.width"'))
    with pytest.raises(ValueError, match=r"'effect.dead_zone.width' is no.*'dead_zone.width'"):
        run(["export-model", "odd.toml", "--ranges"])
    assert not list(model.glob("odd_*"))


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(model):
    for out, seed in (("a", 1), ("b", 1), ("c", 2)):
        run(["export-model", "m.toml", "--ranges", "--out", f"{out}.x", "--seed", str(seed)])
    a, b, c = ((model / f"{out}_ranges.yaml").read_bytes() for out in "abc")
    assert a == b != c


def test_a_model_that_was_never_fitted_says_so(model, model_text):
    (model / "bare.toml").write_text(model_text("bare"))
    with pytest.raises(ValueError, match=r"bare.toml: has no standard errors; fit it"):
        run(["export-model", "bare.toml", "--ranges"])
    assert not list(model.glob("bare_*"))
