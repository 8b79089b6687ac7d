# SPDX-License-Identifier: Apache-2.0
"""Numbers of a base that are off are no missing effect, and right in the model that is written."""

import numpy as np
import pytest

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.compare import MISSING, compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile


def test_a_data_sheet_of_another_speed_and_lag_is_refitted(
    tanh_robot, measure, model_file, tmp_path
):
    """The robot is 2.2 times as fast as the sheet says, and its lag is nearly twice as long."""
    robot = tanh_robot(top_mps=2.2 * tanh_robot().top_mps)
    sheet = model_file()
    found = diagnose([measure(robot, 8, 40.0)], sheet)
    assert found.answer.verdict == "refit_enough" and not found.answer.findings
    written = better(found, sheet, tmp_path / "better.toml", "").file
    assert not written.model.effects
    assert written.model.get("base.motor_lag_s") == pytest.approx(robot.lag_s, abs=0.004)
    other = [measure(robot, 9, 40.0)]
    assert compare(other, written).score < MISSING < compare(other, sheet).score


def test_lag_and_clock_of_a_short_log_are_told_together(tanh_robot, measure, model_file, tmp_path):
    """0.2 s and 0.35 s; the model is written with the offset that suits its lag."""
    robot, sheet = tanh_robot(lag_s=0.2, offset_s=0.35), model_file()
    run, other = measure(robot, 412, 15.0), [measure(robot, 512, 40.0)]
    found = diagnose([run], sheet)
    assert found.answer.verdict == "refit_enough" and not found.answer.findings
    assert found.late.sum_s == pytest.approx(0.55, abs=0.004 + 3 * found.late.sum_std_s)
    written = better(found, sheet, tmp_path / "better.toml", "")
    assert compare([run], written.file).score == pytest.approx(written.after.score, rel=0.01)
    assert compare(other, written.file).score < MISSING < compare(other, sheet).score


@pytest.mark.parametrize("base", ["known_base", "one_clock_base"])
def test_speeds_that_fell_a_little_are_no_missing_effect(tanh_robot, measure, request, base):
    """Another battery and another floor: 8 % less speed, turns are 10 % less.

    Whether or not the model's file tells what it misses in its own log.
    """
    robot = tanh_robot()
    tired = tanh_robot(top_mps=0.92 * robot.top_mps, yaw=0.9 * robot.yaw)
    found = diagnose([measure(tired, 8, 40.0)], request.getfixturevalue(base))
    assert found.answer.nothing > 0.1 and not found.answer.findings
    assert found.refitted.score < MISSING < found.before.score


@pytest.mark.parametrize("times", [0.45, 2.2])
def test_a_robot_that_is_faster_or_slower_by_one_factor_lacks_nothing(
    tanh_robot, measure, known_base, times
):
    """Another battery, or another gear: no loss that began with the log, and no patch of floor."""
    robot = tanh_robot()
    other = tanh_robot(top_mps=times * robot.top_mps)
    found = diagnose([measure(other, 8, 40.0)], known_base)
    assert found.answer.verdict == "refit_enough" and not found.answer.findings
    assert found.refitted.score < MISSING < found.before.score


def test_a_simulation_without_noise_is_judged(tanh_robot, measure, model_file, tmp_path):
    """Its residuals are numerical errors: nothing is sure to be missing."""
    robot = tanh_robot(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0)
    fit([measure(robot, 13, 30.0)], model_file(), tmp_path / "fitted.toml", "")
    found = diagnose([measure(robot, 14, 30.0)], ModelFile.load(str(tmp_path / "fitted.toml")))
    assert not [f for f in found.answer.findings if f.certainty == "sure"]


@pytest.mark.parametrize("runs", [1, 4])
def test_runs_of_a_robot_that_is_as_it_was_show_nothing(tanh_robot, measure, known_base, runs):
    found = diagnose([measure(tanh_robot(), 310 + k, 20.0) for k in range(runs)], known_base)
    assert found.answer.nothing > 0.1 and not found.answer.findings
    if runs > 1:  # a moment is of one run
        assert found.not_shown["abrupt_loss"].startswith("it begins at a moment of one run")


def test_where_two_levels_are_driven_other_speeds_do_what_a_dead_zone_does(
    tanh_robot, measure, known_base
):
    """Milling knows two levels of the duty."""

    class Sticky(tanh_robot):
        def speed_mps(self, duty):
            return super().speed_mps(np.sign(duty) * np.maximum(np.abs(duty) - 0.04, 0))

    random = np.random.default_rng(3)
    sides = np.array([(75, 100, 75, 100), (100, 75, 100, 75)])
    script_pct = np.repeat(sides[random.integers(2, size=160)], 12, axis=0)
    found = diagnose([measure(Sticky(), 23, script_pct=script_pct)], known_base)
    assert found.answer.verdict in ("cannot_tell", "refit_enough") and not found.answer.findings


def test_an_effect_that_the_model_has_is_named_again_where_it_changed(
    tanh_robot, measure, known_base, tmp_path
):
    """The marker sat turned by 0.1 rad, and was put back turned by 0.3 rad."""

    def turned(bias_rad):
        return lambda pose, valid: (pose + np.array([0, 0, bias_rad]), valid)

    first = diagnose([measure(tanh_robot(), 26, 40.0, spoil=turned(0.1))], known_base)
    better(first, known_base, tmp_path / "better.toml", "").file.write()
    model = ModelFile.load(str(tmp_path / "better.toml"))
    assert model.model.effects == ["heading_bias"]
    found = diagnose([measure(tanh_robot(), 27, 40.0, spoil=turned(0.3))], model).answer
    (bias,) = found.findings
    assert (bias.effect, bias.certainty) == ("heading_bias", "sure")
    value, std = bias.numbers["bias_rad"]
    assert value == pytest.approx(0.2, abs=3 * std)
