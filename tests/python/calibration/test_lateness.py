# SPDX-License-Identifier: Apache-2.0
"""How late a robot follows its commands: delays, lags and clocks are told from each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

from .conftest import STEP_S

DELAY_S, MORE_LAG_S = 0.03, 0.05


def sure(found) -> list[str]:
    return [f.effect for f in found.answer.findings if f.certainty == "sure"]


def numbers(found, effect) -> dict[str, tuple[float, float]]:
    (named,) = [f for f in found.answer.findings if f.effect == effect]
    return named.numbers


def first_order(values, lag_s):
    """(K, n) values behind a first-order filter."""
    part = STEP_S / lag_s
    return lfilter([part], [1, part - 1], values, axis=0)


@pytest.fixture(scope="module")
def late(tanh_robot, measure):
    """Poses that come 30 ms later, of wheels that are slower by 50 ms."""
    robot = tanh_robot()
    return measure(replace(robot, offset_s=DELAY_S, lag_s=robot.lag_s + MORE_LAG_S), 10, 40.0)


def test_on_the_clocks_of_the_bases_own_log_a_shift_in_time_is_a_delay(
    late, measure, tanh_robot, model_file, tmp_path
):
    """As a delayed command, or as a clock that is off: the same in every pose."""
    path = tmp_path / "fitted.toml"
    fit([measure(tanh_robot(), 1, 40.0)], model_file(), path, "")
    found = diagnose([late], ModelFile.load(str(path)))
    assert sure(found) == ["motor_lag"]
    (delayed,) = [f for f in found.answer.findings if f.effect != "motor_lag"]
    assert set(delayed.group) == {"input_delay", "clock_offset"}
    delay_s, std_s = next(iter(delayed.numbers.values()))
    assert delay_s == pytest.approx(DELAY_S, abs=3 * std_s)
    # What is told of the lag is what it is beside the delay.
    extra_s, std_s = numbers(found, "motor_lag")["extra_s"]
    assert extra_s == pytest.approx(MORE_LAG_S, abs=3 * std_s)
    truth_s = tanh_robot().lag_s + MORE_LAG_S + DELAY_S
    assert found.late.sum_s == pytest.approx(truth_s, abs=3 * found.late.sum_std_s + 2 * STEP_S)


def test_on_a_clock_of_its_own_a_log_tells_no_delay_and_says_why(late, known_base, tmp_path):
    path = tmp_path / "own_clock.toml"
    head, _, rest = known_base.text.partition("[clock]")
    path.write_text(head + rest[rest.index("[fit]") :])
    found = diagnose([late], ModelFile.load(str(path)))
    assert sure(found) == ["motor_lag"]
    assert "a delay cannot be told from the offset" in found.not_shown["input_delay"]
    assert "calibration log on the same clocks" in found.not_shown["input_delay"]
    assert not found.late.parted and found.late.delay_s is None


def test_a_delay_is_named_where_one_clock_stamps_all(tanh_robot, measure, known_base):
    found = diagnose([measure(tanh_robot(offset_s=0.08), 10, 40.0)], known_base)
    assert sure(found) == ["input_delay"]
    delay_s, std_s = numbers(found, "input_delay")["delay_s"]
    assert delay_s == pytest.approx(0.08, abs=3 * std_s)
    assert found.late.parted


def test_a_body_that_turns_sooner_than_it_drives_is_named(tanh_robot, measure, known_base):
    """Driving takes the robot's 0.09 s, turning 0.04 s: first orders by themselves, summed."""
    spin = np.array([-1, 1, -1, 1]) / 2

    class Light(tanh_robot):
        def wheels_mps(self, duty):
            target = self.speed_mps(duty)
            turning = np.outer(target @ spin, spin)
            return first_order(target - turning, self.lag_s) + first_order(turning, 0.04)

    found = diagnose([measure(Light(), 24, 40.0)], known_base)
    assert sure(found) == ["yaw_lag"]
    extra_s, std_s = numbers(found, "yaw_lag")["extra_s"]
    assert extra_s == pytest.approx(-0.05, abs=3 * std_s)


def test_wheels_behind_a_filter_are_no_delay(changed, measure, known_base):
    """A filter of 0.05 s before the robot's 0.09 s: both first orders, one after the other."""
    robot = changed(wheels=lambda rims: first_order(rims, 0.05))
    found = diagnose([measure(robot, 25, 40.0)], known_base)
    assert sure(found) == ["second_order_lag"]
    second_s, std_s = numbers(found, "second_order_lag")["second_s"]
    assert second_s == pytest.approx(0.05, abs=3 * std_s)
    assert found.late.lag_s == pytest.approx(0.14, abs=2 * STEP_S + 3 * found.late.sum_std_s)


def test_a_lag_that_is_nearly_as_it_was_is_a_number_of_the_base(
    tanh_robot, measure, known_base, tmp_path
):
    """90 ms in the model's own log; 6 ms more is how robots differ from day to day."""
    lag_s = tanh_robot().lag_s + 0.006
    found = diagnose([measure(tanh_robot(lag_s=lag_s), 12, 60.0)], known_base)
    assert found.answer.nothing > 0.1 and not found.answer.findings
    written = better(found, known_base, tmp_path / "better.toml", "")
    assert not written.added and written.after.score < written.before.score
    assert written.file.model.get("base.motor_lag_s") == pytest.approx(lag_s, abs=0.004)


def duties_of_play(duty: np.ndarray) -> np.ndarray:
    """Duties that wait for 0.05 s at zero where a wheel changes its direction."""
    played, side, left_s = np.empty_like(duty), np.zeros(4), np.zeros(4)
    for k, wanted in enumerate(duty):
        turned = (wanted * side < 0) & (wanted != 0)
        side = np.where(wanted != 0, np.sign(wanted), side)
        left_s = np.where(turned, 0.05, np.maximum(left_s - STEP_S, 0))
        played[k] = np.where(left_s > 0, 0, wanted)
    return played


def test_what_only_resembles_a_lag_is_not_surely_called_one(changed, measure, known_base):
    """With its own name unknown, a lag or a delay explains most, but is not surely the one."""
    run = measure(changed(duties=duties_of_play), 15, 30.0)
    found = diagnose([run], known_base, without=("reversal_dead_time",))
    assert found.answer.nothing < 0.1 and not sure(found)


def test_a_heading_that_comes_late_is_surely_no_slip(tanh_robot, measure, known_base):
    """A tracker that smooths the heading alone: 40 ms. Curves seem to drift to the inside."""
    kept = np.exp(-1 / 120 / 0.04)  # of a filter of 40 ms at 120 Hz

    def smoothed(pose, valid):
        heading = lfilter([1 - kept], [1, -kept], pose[:, 2] - pose[0, 2]) + pose[0, 2]
        return np.column_stack([pose[:, :2], heading]), valid

    sides = np.random.default_rng(5).choice((25, 50, 75, 100), (60, 2))
    script = np.repeat(sides[:, [0, 1, 0, 1]], 48, axis=0)
    found = diagnose([measure(tanh_robot(), 31, script_pct=script, spoil=smoothed)], known_base)
    assert {f.effect for f in found.answer.findings} == {"yaw_lag", "lateral_slip"}
    assert not sure(found)
    assert next(iter(found.answer.depends_on)) == "past"
