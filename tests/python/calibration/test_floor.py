# SPDX-License-Identifier: Apache-2.0
"""The floor is a property of the log: how far its noise takes the robot, whatever model is judged.

Truth: what noise that was put in does, and logs that robots of known constants leave.
"""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.measurement import Measurement
from twinmill.data.track import make_track
from twinmill.fitting.compare import compare
from twinmill.fitting.opening import open_measurements
from twinmill.predict.windows import difference, rms

NO_NOISE = dict(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0)
SWAPPED = [1, 0, 2, 3]
EULER_S = 1 / 480  # step of the robots here


@pytest.fixture(scope="module")
def drive(tanh_robot, measure):
    """A rich run of 40 s."""
    return measure(tanh_robot(), 2, 40.0)


@pytest.fixture(scope="module")
def opened(drive, model_file):
    """The run under a guess."""
    return open_measurements([drive], model_file())[0]


def test_two_models_have_the_same_floor_on_one_log(opened, drive, model_file):
    """A model too slow by a half, with other nodes, an effect and a lag of a third of a second."""
    bad = model_file(
        ("[0, 25, 50, 75, 100]", "[0, 30, 100]"),
        ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.03, 0.2]"),
        ("motor_lag_s = 0.05", "motor_lag_s = 0.3\nyaw_gain = 1.4"),
        extra='[[effect]]\nname = "dead_zone"\nwidth = 0.2\n',
    )
    (other,) = open_measurements([drive], bad)
    assert other.floor.kind == opened.floor.kind == "noise"
    assert np.array_equal(other.floor.rms, opened.floor.rms, equal_nan=True)
    assert np.array_equal(other.floor.keep, opened.floor.keep)
    assert other.score > 1.5 * opened.score


def test_floor_is_how_far_noise_takes_the_robot(opened, tanh_robot, measure):
    """Its truth: the same drive without any noise, which is what a perfect prediction says.

    So it must score 1. At 2 s some 40 errors are independent, which is 10 % of their RMS.
    """
    ideal = measure(tanh_robot(**NO_NOISE), 2, 40.0)
    path = opened.data.windows.measured(ideal)
    errors = difference(opened.data.measured, path)
    truth = rms(np.where(opened.floor.keep[:, None, None], errors, np.nan))
    assert 0.8 < np.sqrt(np.mean((truth / opened.floor.rms) ** 2)) < 1.1
    assert np.all((opened.floor.rms / truth > 0.6) & (opened.floor.rms / truth < 1.6))


def test_a_gain_that_swells_and_ebbs_is_not_all_noise(tanh_robot, measure, model_file):
    """A quarter of the speed more and less, over 20 s: no command tells it, but the time does.

    Blocks of 8 s that are left out are gaps of 12 s between windows, so that a part stays. How far
    the swell alone takes the robot is told by the same drive without it and without noise.
    """

    class Tidal(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            return super().wheels_mps(duty) * (1 + 0.25 * np.sin(2 * np.pi * at_s / 20))[:, None]

    (opened,) = open_measurements([measure(Tidal(), 2, 150.0)], model_file())
    steady = opened.data.windows.measured(measure(tanh_robot(**NO_NOISE), 2, 150.0))
    swell = rms(difference(opened.data.measured, steady))[2:, 0]
    assert np.all(opened.floor.rms[2:, 0] < 0.65 * swell)


def sticks(motion):
    """Slow turning sticks."""
    turn = motion[:, 2]
    return np.column_stack([motion[:, :2], np.where(np.abs(turn) < 1.2, 0.3 * turn, turn)])


def worn(motion):
    """A gear that is worn at one place of a slow wheel: 0.3 more and less, over 3 m of way."""
    way_m = np.cumsum(np.hypot(motion[:, 0], motion[:, 1])) * EULER_S
    gain = 1 + 0.3 * np.cos(2 * np.pi * way_m / 3)
    return motion * np.column_stack([gain, gain, np.ones(len(gain))])


def blown(motion):
    """A wind, 15 %: quicker with it, slower against it, in whatever direction it drives."""
    course = np.cumsum(motion[:, 2]) * EULER_S + np.arctan2(motion[:, 1], motion[:, 0])
    return motion * (1 + 0.15 * np.cos(course - 0.7)[:, None] * (1, 1, 0))


@pytest.mark.parametrize("hidden", [sticks, worn, blown])
def test_physics_that_no_model_has_is_no_noise(hidden, tanh_robot, measure, model_file):
    """The noise is known from the same drive without it, what is hidden from one without both.

    At 1 and 2 s the hidden physics takes the robot five times as far as the noise or more.
    """

    class Hindered(tanh_robot):
        def hindered(self, motion):
            return hidden(motion)

    (opened,) = open_measurements([measure(Hindered(), 2, 120.0)], model_file())

    def away(robot):
        path = opened.data.windows.measured(measure(robot, 2, 120.0))
        return np.sqrt(np.mean(rms(difference(opened.data.measured, path))[3:] ** 2, axis=0))

    noise, without = away(Hindered(**NO_NOISE)), away(tanh_robot(**NO_NOISE))
    floor = np.sqrt(np.mean(opened.floor.rms[3:] ** 2, axis=0))
    hurt = np.argmax(without / noise)
    assert without[hurt] > 5 * noise[hurt]
    assert floor[hurt] < 2 * noise[hurt]


@pytest.mark.parametrize(("until_s", "share", "judged"), [(40.5, 0.0, False), (48.0, 0.6, True)])
def test_what_lasts_is_judged(until_s, share, judged, tanh_robot, measure, model_file):
    """From 40 s on the wheels bring nothing for half a second, or three fifths for eight.

    Windows that hold a begin or an end of what lasts may be left out: 10 of some 35.
    """

    class Tired(tanh_robot):
        def wheels_mps(self, duty):
            at_s = np.arange(len(duty)) * EULER_S
            tired = (at_s > 40) & (at_s < until_s)
            return super().wheels_mps(duty) * np.where(tired, share, 1.0)[:, None]

    (opened,) = open_measurements([measure(Tired(), 2, 100.0)], model_file())
    inside = (opened.data.start_s > 39.5) & (opened.data.start_s < until_s)
    kept = opened.floor.keep[inside]
    assert kept.mean() > 0.5 if judged else not kept.any()


@pytest.mark.parametrize("held_s", [1.0, 2.0])
def test_a_robot_that_is_held_once_has_no_higher_floor_than_one_that_is_not(
    held_s, tanh_robot, measure, model_file
):
    """Predictions that just reach into what happens are no noise of the robot either."""

    class Held(tanh_robot):
        def hindered(self, motion):
            at_s = np.arange(len(motion)) * EULER_S
            held = (at_s > 40) & (at_s < 40 + held_s)
            return np.where(held[:, None], 0.0, motion)

    floors = [
        open_measurements([measure(robot, 2, 100.0)], model_file())[0].floor.rms
        for robot in (Held(), tanh_robot())
    ]
    assert np.all(floors[0] < 1.4 * floors[1])


def test_the_right_model_scores_one_and_a_wrong_one_more(drive, true_model, model_file):
    right = compare([drive], true_model).score
    assert 0.85 <= right <= 1.1
    assert compare([drive], model_file()).score > 3


def test_a_better_prediction_never_scores_worse(opened, true_model):
    """Models between the guess and the truth: each cell's error falls, and so the score does."""
    guess, truth = opened.model.copy(), true_model.model.for_robot(3)
    for model in (guess, truth):
        model.set("clock.offset_s", 0.0)  # as the robot's clocks are
    wrong, right = (opened.data.errors(m) for m in (guess, truth))
    scores = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        errors = right + (1 - share) * (wrong - right)
        cells = rms(np.where(opened.data.keep[:, None, None], errors, np.nan))
        scores.append(np.sqrt(np.mean((cells / opened.floor.rms) ** 2)))
    assert scores == sorted(scores, reverse=True)
    assert opened.data.score(guess) == pytest.approx(scores[0], rel=1e-3)
    assert opened.data.score(truth) == pytest.approx(scores[-1], rel=1e-3)


def test_two_wheels_swapped_score_far_above_one(drive, true_model):
    """The log says that each front wheel got what the other had."""
    track = replace(drive.track, command=np.ascontiguousarray(drive.track.command[:, SWAPPED]))
    assert compare([replace(drive, track=track)], true_model).score > 2


def test_a_log_too_short_gives_no_floor_and_says_why(tanh_robot, measure, model_file):
    """Cut by losses into stretches shorter than the longest prediction."""

    def broken(pose, valid):
        valid = valid.copy()
        valid[np.arange(len(valid)) % 240 < 30] = False  # 0.25 s every 2 s
        return pose, valid

    short, long = measure(tanh_robot(), 3, 20.0, spoil=broken), measure(tanh_robot(), 4, 30.0)
    both = compare([short, long], model_file())
    first, second = both.robots
    assert np.isnan(first.score) and np.isfinite(second.score)
    assert both.score == second.score
    assert any("too few to tell the noise from the motion" in w for w in both.warnings)


def test_what_never_moves_is_not_judged(driven, model_file):
    """Straight on by a robot that holds its heading: nothing turns, nothing is asked of it."""
    robot = driven(40.0)
    steps = np.sign(np.sin(0.9 * robot.command_t_s))
    robot.command[:] = 0.5 * steps[:, None]
    speed = 0.3 * np.sign(np.sin(0.9 * robot.pose_t_s))
    random = np.random.default_rng(1)
    pose = np.zeros((len(speed), 3))
    pose[:, 0] = np.cumsum(speed) / 120
    pose[:, :2] += 3e-4 * random.normal(size=(len(speed), 2))
    measured = Measurement.live(make_track(replace(robot, pose=pose)))
    (opened,) = open_measurements([measured], model_file())
    assert np.isnan(opened.floor.rms[:, 2]).all() and np.isfinite(opened.floor.rms[:, 0]).all()
    assert np.isfinite(opened.score)
