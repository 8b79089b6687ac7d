# SPDX-License-Identifier: Apache-2.0
"""Commands that act later from some time on: one robot's log, not the clock of others."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.log import read_log
from twinmill.data.measurement import load_measurements
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

LATER_S, DURATION_S = 0.1, 60.0
AS_GIVEN = (
    "elay and clock offset keep the values of the model as given: how late the robot follows its "
    "commands changes within run.lcmlog R03"
)


@pytest.fixture(scope="module")
def late(tanh_robot):
    """Half-way through the log its link comes to hold each command back."""

    class Late(tanh_robot):
        def wheels_mps(self, duty):
            half, held_back = len(duty) // 2, round(LATER_S * 480)
            told = np.vstack([duty[:half], duty[half - held_back : -held_back]])
            return super().wheels_mps(told)

    return Late()


def test_a_fit_to_such_a_log_says_that_it_writes_no_clock(
    late, run_log, model_file, tmp_path, true_model
):
    runs = load_measurements([run_log(late, 6, DURATION_S)], true_model.model)
    done = fit(runs, model_file(), tmp_path / "m.toml", "")
    assert done.clock is None and "[clock]" not in (tmp_path / "m.toml").read_text()
    assert any(AS_GIVEN in note for note in done.notes)


@pytest.fixture(scope="module")
def on_one_clock():
    """Reads logs that say that one clock stamped all."""

    def read(path, model):
        log = read_log(path)
        robots = {i: replace(r, same_clock=True) for i, r in log.robots.items()}
        return load_measurements([replace(log, robots=robots)], model)

    return read


LATER = {
    "a while": lambda t: 0.2 * ((t > 18) & (t < 40)),
    "two steps": lambda t: 0.1 * (t > 18) + 0.15 * (t > 40),
    "a drift": lambda t: 0.25 * t / DURATION_S,
}


@pytest.fixture(scope="module")
def changing(tanh_robot, run_log, on_one_clock, true_model):
    """A log of one clock within which its commands come to act later."""

    def make(how):
        class Changing(tanh_robot):
            def wheels_mps(self, duty):
                row = np.arange(len(duty))
                told = np.maximum(row - np.round(480 * LATER[how](row / 480)).astype(int), 0)
                return super().wheels_mps(duty[np.maximum.accumulate(told)])

        return on_one_clock(run_log(Changing(), 6, DURATION_S), true_model.model)

    return make


@pytest.fixture(scope="module")
def told_model(run_log, on_one_clock, tanh_robot, true_model, tmp_path_factory):
    """Model told by a log of the robot in which it follows its commands alike all the time."""
    path = tmp_path_factory.mktemp("told") / "told.toml"
    fit(on_one_clock(run_log(tanh_robot(), 8, DURATION_S), true_model.model), true_model, path, "")
    return ModelFile.load(str(path))


@pytest.mark.parametrize("how", LATER)
def test_no_fit_to_a_log_whose_lateness_changes_is_worse_on_another(
    how, changing, tanh_robot, run_log, on_one_clock, told_model, tmp_path
):
    """Its lag is the one that another log told, and the same robot is predicted as well."""
    runs = changing(how)
    other = on_one_clock(run_log(tanh_robot(), 7, 40.0), told_model.model)
    before = compare(other, told_model).score
    done = fit(runs, told_model, tmp_path / "fitted.toml", "")
    assert any(AS_GIVEN in note for note in done.notes)
    model = ModelFile.load(str(tmp_path / "fitted.toml"))
    lag_s = model.model.get("base.motor_lag_s")
    assert lag_s == pytest.approx(told_model.model.get("base.motor_lag_s"), rel=1e-5)
    assert compare(other, model).score < 1.05 * before


@pytest.mark.parametrize("how", LATER)
def test_a_lag_that_no_log_told_is_fitted_with_the_change_taken_into_account(
    how, changing, tanh_robot, model_file, tmp_path
):
    done = fit(changing(how), model_file(), tmp_path / "fitted.toml", "")
    model = ModelFile.load(str(tmp_path / "fitted.toml")).model
    assert model.get("base.motor_lag_s") == pytest.approx(tanh_robot().lag_s, abs=0.012)
    assert any("The lag is fitted with that taken into account" in note for note in done.notes)


def test_no_effect_that_makes_late_is_added_by_a_log_whose_lateness_changes(
    changing, told_model, tmp_path
):
    out = tmp_path / "m.toml"
    with pytest.raises(ValueError, match="how late it follows its commands changes within run"):
        add("motor_lag", changing("a drift"), told_model, out=out, command="")
    assert not out.exists()
