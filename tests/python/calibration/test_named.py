# SPDX-License-Identifier: Apache-2.0
"""One hidden effect of a wheel, a motor, a marker or a compass: named, with its size."""

import numpy as np

from twinmill.diagnosis.diagnose import diagnose

from .conftest import STEP_S


def sure(found) -> list[str]:
    return [f.effect for f in found.answer.findings if f.certainty == "sure"]


def is_told(found, effect, truth: dict[str, float]) -> bool:
    """True if an effect's numbers are those, within three standard deviations."""
    (named,) = [f for f in found.answer.findings if f.effect == effect]
    return all(abs(named.numbers[n][0] - v) < 3 * named.numbers[n][1] for n, v in truth.items())


def test_a_weak_wheel_is_named_with_its_size(changed, measure, known_base):
    """A quarter less is more than motors of a kind differ by, but nothing else does the same."""
    found = diagnose([measure(changed(wheels=lambda r: r * (0.75, 1, 1, 1)), 23, 40.0)], known_base)
    assert [f.effect for f in found.answer.findings] == sure(found) == ["wheel_gain"]
    assert is_told(found, "wheel_gain", {"fl": -0.25, "fr": 0.0, "rl": 0.0, "rr": 0.0})


def test_play_in_the_gears_is_no_weak_wheel(changed, measure, known_base):
    """Each wheel rests while its motor turns back by 0.15 rad, as a stop that is dragged along."""
    gap_m = 0.15 * known_base.model.get("robot.wheel_radius_m")

    def loose(rims):
        way = np.cumsum(rims, axis=0) * STEP_S
        wheel = np.zeros_like(way)
        for k in range(1, len(way)):
            wheel[k] = np.clip(wheel[k - 1], way[k] - gap_m, way[k])
        return np.diff(wheel, axis=0, prepend=0.0) / STEP_S

    found = diagnose([measure(changed(wheels=loose), 28, 40.0)], known_base)
    assert sure(found) == ["backlash"]
    assert is_told(found, "backlash", {"gap_rad": 0.15})


def test_duties_that_are_ramped_are_a_slew_limit(changed, measure, known_base):
    """They take 0.2 s from 0 to 1."""

    def slewed(duty):
        now, limited = np.zeros(4), np.empty_like(duty)
        for k, wanted in enumerate(duty):
            now = now + np.clip(wanted - now, -STEP_S / 0.2, STEP_S / 0.2)
            limited[k] = now
        return limited

    found = diagnose([measure(changed(duties=slewed), 15, 40.0)], known_base)
    assert sure(found) == ["slew_limit"]
    assert is_told(found, "slew_limit", {"ramp_s": 0.2})


def test_wheels_that_stand_at_small_duties_and_go_as_usual_above(tanh_robot, measure, known_base):
    """Duties are 25, 50, 75 and 100 %: the edge lies between 50 and 75 %."""

    class Sticks(tanh_robot):
        def speed_mps(self, duty):
            return np.where(np.abs(duty) > 0.6, super().speed_mps(duty), 0.0)

    found = diagnose([measure(Sticks(), 4, 60.0)], known_base)
    assert sure(found) == ["stiction"]
    below, std = found.answer.findings[0].numbers["below"]
    assert 0.5 - 3 * std < below < 0.75 + 3 * std


def test_dead_zone_and_curve_are_both_found_in_a_log(tanh_robot, measure, model_file):
    """Wheels stand below 0.2 of the duty and then rise as a root; the base is a straight line."""

    class Worn(tanh_robot):
        def speed_mps(self, duty):
            over = np.maximum(np.abs(duty) - 0.2, 0) / 0.8
            return np.sign(duty) * self.top_mps * np.sqrt(over)

    line = model_file(("[0, 25, 50, 75, 100]", "[0, 100]"), ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.4]"))
    found = diagnose([measure(Worn(), 12, 40.0)], line)
    named = {effect for f in found.answer.findings for effect in (f.effect, *f.group)}
    assert named == {"dead_zone", "speed_curve"}  # a curve alone comes near: both, or either


def test_a_compass_that_errs_with_heading_is_no_turned_marker(tanh_robot, measure, known_base):
    """Iron in the floor: the heading is wrong by up to 6 degrees, to the left in the north."""

    def iron(pose, valid):
        error_rad = 0.1 * np.sin(pose[:, 2] + 0.5)
        return np.column_stack([pose[:, :2], pose[:, 2] + error_rad]), valid

    found = diagnose([measure(tanh_robot(), 23, 40.0, spoil=iron)], known_base)
    assert sure(found) == ["compass_deviation"]
    truth = {"cos_rad": 0.1 * np.sin(0.5), "sin_rad": 0.1 * np.cos(0.5)}
    assert is_told(found, "compass_deviation", truth)


def test_a_heading_bias_along_one_heading_may_be_one_that_changes_with_it(
    tanh_robot, measure, known_base
):
    """Legs to and fro along one line of the room, without a turn."""
    legs = [[(d,) * 4] * 48 for d in (100, 0, -100, 0, 50, 0, -50, 0)]
    run = measure(tanh_robot(), 6, script_pct=np.concatenate(legs * 4))
    run = run.with_pose(run.track.pose + np.array([0, 0, 0.06]))
    found = diagnose([run], known_base)
    (named,) = found.answer.findings
    assert set(named.group) == {"heading_bias", "compass_deviation"}
