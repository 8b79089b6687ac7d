# SPDX-License-Identifier: Apache-2.0
"""Dependence on one speed, one place or the time since a change is told, whatever its form.

The robots are those of `conftest.py`; what hinders them is written here over whole motions.
"""

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.families.family import Humps
from twinmill.fitting.opening import open_measurements

STEP_S = 1 / 480  # of the robot


def swinging(motion: np.ndarray) -> np.ndarray:
    """A tank of 1.3 Hz, damped by 8 %, whose liquid pushes forward by its own speed."""
    rate_radps, damping, share = 2 * np.pi * 1.3, 0.08, 0.12
    kept, at_m, now_mps = motion.copy(), 0.0, 0.0
    change = np.diff(motion[:, 0], prepend=motion[0, 0])
    for k, jump_mps in enumerate(change):
        now_mps -= share * jump_mps
        now_mps -= STEP_S * (rate_radps**2 * at_m + 2 * damping * rate_radps * now_mps)
        at_m += STEP_S * now_mps
        kept[k, 0] += now_mps
    return kept


def dipping(motion: np.ndarray) -> np.ndarray:
    """Forward and back, 10 % are missing near a speed of 0.29 m/s, and nowhere else."""
    kept = motion.copy()
    kept[:, 0] *= 1 - 0.1 * np.exp(-(((np.abs(motion[:, 0]) - 0.29) / 0.03) ** 2))
    return kept


def in_a_strip(motion: np.ndarray) -> np.ndarray:
    """All speeds are 10 % less over every second strip of floor of 0.35 m."""
    heading = np.cumsum(motion[:, 2]) * STEP_S
    kept, x_m = motion.copy(), 0.0
    for k, (forward, left, _) in enumerate(motion):
        kept[k] *= 0.9 if int(np.floor(x_m / 0.35)) % 2 else 1.0
        x_m += STEP_S * (np.cos(heading[k]) * forward - np.sin(heading[k]) * left)
    return kept


def by_strips(motion: np.ndarray, axis: int, rate: float) -> np.ndarray:
    """Every second strip of floor of 0.35 m adds a rate to an axis of whatever drives over it."""
    drives = np.abs(motion).max(axis=1) > 0.005
    kept, x_m, heading = motion.copy(), 0.0, 0.0
    for k in range(len(motion)):
        kept[k, axis] += rate * (drives[k] and int(np.floor(x_m / 0.35)) % 2)
        x_m += STEP_S * (np.cos(heading) * kept[k, 0] - np.sin(heading) * kept[k, 1])
        heading += STEP_S * kept[k, 2]
    return kept


def turned_by_strips(motion: np.ndarray) -> np.ndarray:
    return by_strips(motion, 2, 0.12)


def shifted_by_strips(motion: np.ndarray) -> np.ndarray:
    return by_strips(motion, 1, 0.025)


def course(motion: np.ndarray) -> np.ndarray:
    """(K,) direction in the room in which it drives, rad."""
    return np.cumsum(motion[:, 2]) * STEP_S + np.arctan2(motion[:, 1], motion[:, 0])


def blown(motion: np.ndarray) -> np.ndarray:
    """A wind: 6 % quicker with it, slower against it."""
    return motion * (1 + 0.06 * np.cos(course(motion) - 0.7)[:, None] * (1, 1, 0))


def led_aside(motion: np.ndarray) -> np.ndarray:
    """Grooves: oblique over them the robot is led aside by up to 6 % of its way."""
    kept, share = motion.copy(), 0.06 * np.sin(2 * (course(motion) - 0.4))
    kept[:, 0] += share * motion[:, 1]
    kept[:, 1] -= share * motion[:, 0]
    return kept


def leaning(motion: np.ndarray) -> np.ndarray:
    """A marker on a soft mast stands off by 20 mm for each m/s^2 with which a curve pulls."""
    kept, turn = motion.copy(), motion[:, 2]
    off_m = 0.02 * np.column_stack([turn * motion[:, 1], -turn * motion[:, 0]])
    kept[:, :2] += np.gradient(off_m, STEP_S, axis=0)
    kept[:, :2] += np.column_stack([-turn * off_m[:, 1], turn * off_m[:, 0]])
    return kept


def shaking(motion: np.ndarray) -> np.ndarray:
    """Near 0.29 m/s, whatever the direction, the frame shakes, and it veers left by 0.12 rad/s."""
    kept, travel = motion.copy(), np.hypot(motion[:, 0], motion[:, 1])
    kept[:, 2] += 0.12 * np.exp(-(((travel - 0.29) / 0.03) ** 2))
    return kept


def wound_up(motion: np.ndarray) -> np.ndarray:
    """Tyres give back most of the first 8 degrees that it turns the other way."""
    kept, twist = motion.copy(), 0.0
    for k, turn in enumerate(motion[:, 2] * STEP_S / np.radians(8)):
        against = max(-np.sign(turn) * twist, 0.0)
        kept[k, 2] *= 1 - 0.7 * against
        twist = min(max(twist + turn, -1.0), 1.0)
    return kept


def swung_round(motion: np.ndarray) -> np.ndarray:
    """A castor swings round over the first 60 mm that it drives the other way, and turns it."""
    kept, place = motion.copy(), 1.0
    for k, way in enumerate(motion[:, 0] * STEP_S / 0.03):
        place = min(max(place + way, -1.0), 1.0)
        kept[k, 2] += 0.25 * (1 - place**2) * (way != 0)
    return kept


@pytest.mark.parametrize(
    ("hindrance", "depends_on"),
    [
        (swinging, "change of the command"),
        (dipping, "speed"),
        (in_a_strip, "place"),
        (turned_by_strips, "place"),
        (shifted_by_strips, "place"),
        (blown, "heading"),
        (led_aside, "heading"),
        (shaking, "speed"),
        (leaning, "coupling of the axes"),
        (wound_up, "past motion"),
        (swung_round, "past motion"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_dependence_is_told_where_no_form_is_known(
    hindrance, depends_on, tanh_robot, measure, one_clock_base
):
    class Hindered(tanh_robot):
        def hindered(self, motion):
            return hindrance(motion)

    found = diagnose([measure(Hindered(), 101, 80.0)], one_clock_base)
    assert found.rest.depends_on[0] == depends_on
    assert all(f.certainty == "doubtful" for f in found.findings)


def test_a_driver_that_takes_no_small_change_depends_on_past_motion(
    tanh_robot, measure, one_clock_base
):
    """A wheel holds its duty until the one that it is told is more than 30 % away from it."""

    class Holding(tanh_robot):
        def wheels_mps(self, duty):
            taken, now = np.empty_like(duty), np.zeros(4)
            for k, told in enumerate(duty):
                now = np.where(np.abs(told - now) > 0.3, told, now)
                taken[k] = now
            return super().wheels_mps(taken)

    found = diagnose([measure(Holding(), 62, 80.0)], one_clock_base)
    assert found.verdict == "outside_catalogue"
    assert "past motion" in found.rest.depends_on[:2]


def test_the_floor_follows_a_castor_that_swings_round(tanh_robot, measure, one_clock_base):
    """A swinging castor's turns are no noise: the floor is nearly that of the robot without it."""

    class Hindered(tanh_robot):
        def hindered(self, motion):
            return swung_round(motion)

    logs = [measure(robot, 101, 80.0) for robot in (tanh_robot(), Hindered())]
    plain, swung = (open_measurements([log], one_clock_base)[0].floor.rms for log in logs)
    assert np.all(swung[:, 2] < 1.4 * plain[:, 2])  # 1.7 where it counts as noise


def test_heading_that_the_capture_lets_drift_depends_on_time(measure, one_clock_base):
    def spoil(pose, valid):
        t_s = np.arange(len(pose)) / 120
        return pose + 0.12 * np.sin(2 * np.pi * t_s / 43)[:, None] * (0, 0, 1), valid

    found = diagnose([measure(seed=102, duration_s=80.0, spoil=spoil)], one_clock_base)
    assert found.rest.depends_on[:1] == ["time"]


def test_a_stiff_gear_of_one_wheel_is_told_with_its_wheel(tanh_robot, measure, one_clock_base):
    """The front right wheel loses 25 mm/s at every speed."""

    class Stiff(tanh_robot):
        def wheels_mps(self, duty):
            rims = super().wheels_mps(duty)
            loss_mps = np.minimum(np.abs(rims), 0.025) * (0, 1, 0, 0)
            return rims - np.sign(rims) * loss_mps

    found = diagnose([measure(Stiff(), 61, 60.0)], one_clock_base)
    assert not [f.effect for f in found.findings if f.certainty == "sure"]
    assert found.rest.depends_on[:1] == ["command of the front right wheel"]


def test_humps_share_out_every_value_between_the_outer_ones():
    humps = Humps.over(0.0, 0.8)
    between = np.random.default_rng(1).uniform(*humps.middles[[0, -1]], (50, 1))
    assert humps.of(between).sum(axis=1) == pytest.approx(np.ones(50), abs=1e-6)
