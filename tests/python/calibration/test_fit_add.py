# SPDX-License-Identifier: Apache-2.0
"""`fit` and `add` on logs of a robot whose constants are known and whose form is not the twin's."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.log import LogError
from twinmill.data.measurement import load_measurements
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile

EULER_S = 1 / 480  # the robot's step: times are known to half of it, and lags to as much again
OFFSET_S = 0.06


@pytest.fixture(scope="module")
def fitted(tanh_robot, measure, model_file, tmp_path_factory):
    """A fit to one log of 60 s."""
    path = tmp_path_factory.mktemp("fit") / "fitted.toml"
    run = measure(tanh_robot(offset_s=OFFSET_S), 1, 60.0)
    return fit([run], model_file(), path, "fit it")


def test_fit_finds_speeds_gains_and_lag(fitted, tanh_robot):
    robot = tanh_robot()
    truth = dict(
        zip(
            [f"base.wheel_speed_mps.{i}" for i in (1, 2, 3, 4)],
            robot.speed_mps(np.array([0.25, 0.5, 0.75, 1])),
            strict=True,
        ),
        **{
            "base.sideways_gain": robot.sideways,
            "base.yaw_gain": robot.yaw,
            "base.motor_lag_s": robot.lag_s,
        },
    )
    assert {e.name for e in fitted.parameters} == set(truth)
    for e in fitted.parameters:
        form = EULER_S if e.name == "base.motor_lag_s" else 0.003 * truth[e.name]
        assert e.value == pytest.approx(truth[e.name], abs=3 * e.std + form), e.name
        assert e.seen and not e.at_bound


def test_a_fit_keeps_the_speed_at_which_the_noise_was_seen(fitted, tanh_robot, measure):
    """RMS of the robot's own speeds while it drives, without noise, at the log's commands."""
    still = tanh_robot(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0)
    command = measure(tanh_robot(offset_s=OFFSET_S), 1, 60.0).track.command
    duty = np.repeat(command / np.abs(command).max(), 10, axis=0)  # each for ten of its steps
    way_m = np.linalg.norm(np.diff(still.poses(duty, 0)[:, :2], axis=0), axis=1)
    speed_mps = way_m[way_m > 1e-3 * EULER_S] / EULER_S
    told_mps = ModelFile.load(str(fitted.path)).noise_speed_mps
    assert told_mps == pytest.approx(np.sqrt(np.mean(speed_mps**2)), rel=0.05)


def test_fit_finds_the_clock_offset(fitted):
    assert fitted.clock.value == pytest.approx(OFFSET_S, abs=3 * fitted.clock.std + EULER_S / 2)
    assert fitted.clock.std < 5e-3  # beside a free lag, by errors from 0.1 to 2 s ahead


def test_a_clock_that_is_half_a_second_off_is_found(tanh_robot, measure, model_file):
    """Beyond any network, as cameras on another floor have it."""
    run = measure(tanh_robot(offset_s=0.5), 16, 40.0)
    (found,) = open_measurements([run], model_file())
    assert found.model.get("clock.offset_s") == pytest.approx(0.5, abs=0.05)  # a guessed lag
    same = replace(run, track=replace(run.track, same_clock=True))
    (late,) = open_measurements([same], model_file())
    assert found.score < late.score


def test_a_right_model_is_as_good_as_its_log_can_tell(fitted):
    # An RMS of errors of which some 30 are independent at 2 s is known to 8 %.
    assert fitted.after.score == pytest.approx(1, abs=0.25)
    assert fitted.before.score > 3


def test_logs_with_clocks_of_their_own_keep_them(tanh_robot, measure, model_file, tmp_path):
    offsets_s = (-0.12, 0.15)
    runs = [measure(tanh_robot(offset_s=o), 11 + i, 30.0) for i, o in enumerate(offsets_s)]
    found = fit(runs, model_file(), tmp_path / "m.toml", "")
    assert [r.time_offset_s for r in found.after.robots] == pytest.approx(
        offsets_s, abs=EULER_S / 2 + 1.5e-3
    )
    assert found.clock is None and "[clock]" not in (tmp_path / "m.toml").read_text()
    lag = found.parameters[-1]
    assert lag.value == pytest.approx(tanh_robot().lag_s, abs=3 * lag.std + EULER_S)


def test_logs_with_one_clock_share_its_offset(tanh_robot, measure, model_file, tmp_path):
    runs = [measure(tanh_robot(offset_s=OFFSET_S), 21 + i, 30.0) for i in range(2)]
    found = fit(runs, model_file(), tmp_path / "m.toml", "")
    assert found.clock.value == pytest.approx(OFFSET_S, abs=3 * found.clock.std + EULER_S / 2)
    assert ModelFile.load(str(tmp_path / "m.toml")).model.clock_known


def test_a_clock_that_is_not_the_logs_is_no_noise(tanh_robot, measure, fitted):
    """The fitted model keeps its clock; a log that is 0.1 s off must not look as good as its own.

    At 0.1 s and 0.4 m/s that is up to 40 mm, a hundred times the sensor's noise.
    """
    run = measure(tanh_robot(offset_s=OFFSET_S - 0.1), 91, 30.0)
    found = compare([run], ModelFile.load(str(fitted.path)))
    assert found.score > 3
    noise = found.robots[0].modelled.noise
    assert noise.position.sensor == pytest.approx(tanh_robot().sensor_m, rel=0.1)


@pytest.fixture(scope="module")
def coasting(tanh_robot, measure, fitted, tmp_path_factory):
    """Log in which the robot rolls on at zero duty with 0.7 m/s^2."""
    robot = tanh_robot(offset_s=OFFSET_S, coast_mps2=0.7)
    path = tmp_path_factory.mktemp("add") / "coasting.toml"
    return add(
        "coasting",
        [measure(robot, 31, 60.0)],
        ModelFile.load(str(fitted.path)),
        out=path,
        command="add it",
    )


def test_added_effect_has_the_robots_size(coasting):
    found = {e.name: e for e in coasting.parameters}
    drag, viscous = found["coasting.deceleration_mps2"], found["coasting.viscous_per_s"]
    # From 0.4 m/s the two trade against each other: drag at 0.2 m/s is what stops tell.
    assert drag.value + 0.2 * viscous.value == pytest.approx(0.7, rel=0.06)
    assert drag.value == pytest.approx(0.7, abs=3 * drag.std + 0.02)


def test_added_effect_helps_where_it_was_not_fitted(coasting):
    assert coasting.heldout_after.score < 0.7 * coasting.heldout_refit.score
    assert coasting.heldout_after.score < 1.3
    assert coasting.heldout_refit.score <= 1.02 * coasting.heldout_before.score
    assert coasting.notes == []


def test_added_effect_that_is_not_there_does_not_help(tanh_robot, measure, fitted, tmp_path):
    run = measure(tanh_robot(offset_s=OFFSET_S), 41, 60.0)
    found = add(
        "dead_zone", [run], ModelFile.load(str(fitted.path)), out=tmp_path / "m.toml", command=""
    )
    (width,) = (e for e in found.parameters if e.name == "dead_zone.width")
    assert width.value < 3 * width.std + 0.002
    assert found.heldout_after.score > 0.97 * found.heldout_refit.score
    (note,) = found.notes
    assert note.startswith("Held-out predictions are no better with it")


def picked_up(pose, valid):
    """Taken off the floor for a second after 15 s, and set down a metre away, turned."""
    valid, pose = valid.copy(), pose.copy()
    valid[1800:1920] = False
    c, d = np.cos(2.0), np.sin(2.0)
    away = pose[1920:, :2] - pose[1920, :2]
    pose[1920:, :2] = pose[1920, :2] + [1.0, -0.5] + away @ [[c, d], [-d, c]]
    pose[1920:, 2] += 2.0
    return pose, valid


def with_gaps(pose, valid):
    """Two poses in a thousand are lost, and a third of a second every five."""
    valid = valid & (np.random.default_rng(3).random(len(valid)) > 0.002)
    valid[np.arange(len(valid)) % 600 < 40] = False
    return pose, valid


@pytest.mark.parametrize("spoil", [picked_up, with_gaps])
def test_breaks_in_a_log_do_not_move_a_fit(spoil, tanh_robot, measure, model_file, tmp_path):
    run = measure(tanh_robot(), 51, 40.0, spoil=spoil)
    found = fit([run], model_file(), tmp_path / "m.toml", "")
    assert found.after.score < 1.3
    (lag,) = (e for e in found.parameters if e.name == "base.motor_lag_s")
    assert lag.value == pytest.approx(tanh_robot().lag_s, abs=3 * lag.std + EULER_S)
    assert any("cut at" in w for w in found.after.warnings)


def test_a_truncated_log_is_read_as_far_as_it_goes(tanh_robot, run_log, model_file, tmp_path):
    whole = run_log(tanh_robot(), 61, 40.0).read_bytes()
    path = tmp_path / "cut.lcmlog"
    path.write_bytes(whole[: int(0.9 * len(whole)) + 7])
    found = compare(load_measurements([path]), model_file())
    assert any("breaks off" in w for w in found.warnings)


def test_a_log_that_is_too_short_is_refused_in_one_sentence(run_log, tanh_robot):
    with pytest.raises(LogError, match=r"run\.lcmlog: robot 3 has .* s of usable poses; .*\.$"):
        load_measurements([run_log(tanh_robot(), 71, 8.0)])


def test_commands_that_never_change_give_no_score_and_say_why(
    measure, model_file, tanh_robot, tmp_path
):
    run = measure(tanh_robot(), 81, script_pct=np.zeros((960, 4), int))
    found = compare([run], model_file())
    assert np.isnan(found.score)
    assert any("commands never change" in w for w in found.warnings)
    with pytest.raises(LogError, match="commands never change"):
        fit([run], model_file(), tmp_path / "m.toml", "")


def test_a_fit_to_few_commands_says_that_it_holds_there_alone(
    tanh_robot, measure, model_file, tmp_path
):
    """As a robot that mills has them: one while it sees nobody, and another while it does.

    One that is driven by a stick has no command for long, and very many.
    """
    two = np.repeat([[50, 100, 50, 100], [40, 40, 40, 40]], 100, axis=0)
    step = np.arange(1400)[:, None]
    stick = np.rint(70 * np.sin(step / [23, 31, 37, 29] + [0, 1, 2, 3])).astype(int)
    cases = [(np.tile(two, (7, 1)), True), (None, False), (stick, False)]
    for k, (script, told) in enumerate(cases):
        robot = tanh_robot()
        run = measure(robot, 2, 30.0) if script is None else measure(robot, 2, script_pct=script)
        result = fit([run], model_file(), tmp_path / f"{k}.toml", "test")
        assert bool(result.notes) == told
        assert all("2 different commands" in note for note in result.notes)


def test_a_robot_at_rest_gives_no_score_on_a_known_clock_either(measure, model_file, tanh_robot):
    run = measure(tanh_robot(), 91, script_pct=np.zeros((960, 4), int))
    known = model_file(extra="[clock]\noffset_s = 0.0\n")
    assert compare([run], known).verdict.startswith("No score")
