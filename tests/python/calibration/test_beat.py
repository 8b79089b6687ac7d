# SPDX-License-Identifier: Apache-2.0
"""Swings in time are told if they come by themselves, and not if the drive makes them."""

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.beat import beat_radps
from twinmill.fitting.opening import open_measurements

STEP_S = 1 / 480  # of the robot
POSE_S = 1 / 120


def test_a_regulator_that_hunts_is_told_with_its_rate(tanh_robot, measure, one_clock_base):
    """All wheels are quicker and slower by 15 % at 0.9 Hz."""
    rate_radps = 2 * np.pi * 0.9

    class Hunting(tanh_robot):
        def wheels_mps(self, duty):
            swing = 0.15 * np.sin(rate_radps * np.arange(len(duty)) * STEP_S)
            return super().wheels_mps(duty) * (1 + swing)[:, None]

    run = measure(Hunting(), 51, 60.0)
    found = diagnose([run], one_clock_base)
    assert found.verdict == "outside_catalogue" and found.rest.depends_on[0] == "time"
    (opened,) = open_measurements([run], one_clock_base)
    assert opened.floor.response.beat_radps == pytest.approx(rate_radps, abs=2 * np.pi / 60 / 4)


def test_a_slow_swing_beside_a_noisy_sensor_is_told(tanh_robot, measure, one_clock_base):
    """All wheels are quicker and slower by 3 % with a period of 5.6 s; poses err by 3 mm."""
    rate_radps, random = 2 * np.pi / 5.6, np.random.default_rng(7)

    class Pulsing(tanh_robot):
        def wheels_mps(self, duty):
            swing = 0.03 * np.sin(rate_radps * np.arange(len(duty)) * STEP_S)
            return super().wheels_mps(duty) * (1 + swing)[:, None]

    def noisy(pose, valid):
        return pose + random.normal(size=pose.shape) * [3e-3, 3e-3, 0.0], valid

    run = measure(Pulsing(), 53, 100.0, spoil=noisy)
    (opened,) = open_measurements([run], one_clock_base)
    assert opened.floor.response.beat_radps == pytest.approx(rate_radps, abs=2 * np.pi / 100 / 4)


def test_a_fan_that_swings_slowly_is_told(tanh_robot, measure, one_clock_base):
    """It pushes along the room by up to 20 mm/s, with a period of 17 s."""
    direction, rate_radps = 0.7, 2 * np.pi / 17

    def blown(pose, valid):
        t_s = np.arange(len(pose)) * POSE_S
        blown_m = 0.02 / rate_radps * (1 - np.cos(rate_radps * t_s))[:, None]
        moved = pose[:, :2] + blown_m * [np.cos(direction), np.sin(direction)]
        return np.column_stack([moved, pose[:, 2]]), valid

    found = diagnose([measure(tanh_robot(), 52, 80.0, spoil=blown)], one_clock_base)
    assert found.verdict == "outside_catalogue" and found.rest.depends_on[0] == "time"


def test_a_push_aside_that_swings_is_told_in_full(tanh_robot, measure, one_clock_base):
    """The body is pushed to its left and right by 30 mm/s while it moves, every 2.7 s."""
    rate_radps = 2 * np.pi / 2.7

    class Pushed(tanh_robot):
        def hindered(self, motion):
            swing = 0.03 * np.sin(rate_radps * np.arange(len(motion)) * STEP_S)
            moves = np.abs(motion).max(axis=1) > 0.01
            return motion + np.outer(swing * moves, [0.0, 1.0, 0.0])

    found = diagnose([measure(Pushed(), 54, 80.0)], one_clock_base)
    assert found.verdict == "outside_catalogue" and found.rest.depends_on[0] == "time"
    assert _wave(found, "vy_mps") == pytest.approx((0.03, rate_radps), rel=0.1)
    curve = found.rest.proven.curve  # over one period, where the truth is a sine
    assert curve.period == pytest.approx(2.7, rel=0.01) and (curve.at >= 0).all()
    assert np.corrcoef(curve.left, np.sin(rate_radps * curve.at))[0, 1] > 0.9


def test_way_that_swings_slowly_while_turns_do_not_is_told_in_full(
    tanh_robot, measure, one_clock_base
):
    """It drives quicker and slower by 12 % every 25 s, as on a battery of its own for turns."""
    rate_radps = 2 * np.pi / 25

    class Swelling(tanh_robot):
        def hindered(self, motion):
            swing = 0.12 * np.sin(rate_radps * np.arange(len(motion)) * STEP_S)
            return motion * (1 + np.outer(swing, [1.0, 1.0, 0.0]))

    found = diagnose([measure(Swelling(), 55, 90.0)], one_clock_base)
    assert found.rest.depends_on[0] == "time"
    assert _wave(found, "travel") == pytest.approx((0.12, rate_radps), rel=0.15)


def _wave(found, adds_to):
    """Size and rate of the wave that was proven there."""
    formula = found.rest.proven
    assert formula.forms[0].adds_to == adds_to
    size = np.hypot(*(n.value for n in formula.numbers[:2]))
    return size, formula.forms[0].constant


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_calm_robot_has_no_beat(seed, tanh_robot, measure, one_clock_base):
    (opened,) = open_measurements([measure(tanh_robot(), seed, 60.0)], one_clock_base)
    assert opened.floor.response.beat_radps == 0.0


def test_what_the_drive_makes_swing_is_no_beat():
    """Noise with a line at 0.8 Hz, which the drive has, too, or has not."""
    random, t_s = np.random.default_rng(6), np.arange(0, 90, 0.05)
    line = np.sin(2 * np.pi * 0.8 * t_s)
    errors, drive = line + random.normal(size=len(t_s)), random.normal(size=len(t_s))
    assert beat_radps(t_s, [errors], [drive]) == pytest.approx(2 * np.pi * 0.8, abs=0.02)
    assert beat_radps(t_s, [errors], [drive, line + 0.5 * drive]) == 0.0


def test_a_line_far_stronger_than_that_of_the_drive_is_no_work_of_the_drive():
    """A camera sways by 20 times the noise, and the robot's steps have a faint line there."""
    random, t_s = np.random.default_rng(8), np.arange(0, 90, 0.05)
    line = np.sin(2 * np.pi * 0.4 * t_s)
    drive = 0.3 * line + random.normal(size=len(t_s))
    for strength, rate_hz in ((0.3, 0.0), (20.0, 0.4)):
        errors = strength * line + random.normal(size=len(t_s))
        found = beat_radps(t_s, [errors], [drive]) / (2 * np.pi)
        assert found == pytest.approx(rate_hz, abs=0.01)
