# SPDX-License-Identifier: Apache-2.0
"""Mistakes of the input are named, and nothing else is. The robot here is simulated by hand."""

import re
from dataclasses import replace

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.checks import check_commanded, check_poses, check_tracks, clocks
from twinmill.data.checks.lateness import lateness_of
from twinmill.data.log import LogError, RobotLog
from twinmill.data.measurement import load_measurements
from twinmill.data.track import make_track
from twinmill_cli.swarm_as_whole import robots_recorded

LEVER_M, TOP_MPS, LAG_S, RADIUS_M = 0.126, 0.36, 0.07, 0.0325
MECANUM = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]]) / 4  # Muir and Neuman 1987
MODEL = """
[robot]
wheel_radius_m = 0.0325
half_wheelbase_m = 0.059
half_track_m = 0.067
[base]
drive = "{drive}"
wheels = "mecanum"
duty_pct = [0, 100]
wheel_speed_mps = [0, 0.36]
"""


def _robot(robot_id=3, duration_s=60.0, seed=1, pose_hz=50) -> RobotLog:
    """A mecanum robot that saturates, lags, slips and wavers, driven at random on all axes."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0, duration_s, 0.005)
    axes = rng.choice([-0.8, -0.4, 0, 0.4, 0.8], (int(duration_s / 0.7) + 1, 3))
    forward, left, turn = axes[(t_s / 0.7).astype(int)].T
    wheels = [forward - left - turn, forward + left + turn, forward + left - turn]
    duty = np.clip(np.column_stack([*wheels, forward - left + turn]), -1, 1).round(2)
    rim = TOP_MPS * np.sign(duty) * np.abs(duty) ** 0.7
    felt = np.zeros(4)
    pose = np.zeros((len(t_s), 3))
    for k in range(1, len(t_s)):
        felt += 0.005 / LAG_S * (rim[k - 1] - felt)
        vx, vy, w = MECANUM @ felt * [1, 0.88, 0.93 / LEVER_M] + rng.normal(size=3) * 0.02
        c, s = np.cos(pose[k - 1, 2]), np.sin(pose[k - 1, 2])
        pose[k] = pose[k - 1] + 0.005 * np.array([c * vx - s * vy, s * vx + c * vy, w])
    seen = slice(None, None, round(200 / pose_hz))
    told = slice(None, None, 5)
    noisy = pose[seen] + rng.normal(size=pose[seen].shape) * [0.0005, 0.0005, 0.003]
    count = len(t_s[told])
    flags, nan = np.zeros(count, np.int8), np.full(count, np.nan)
    return RobotLog(
        robot_id=robot_id,
        source="robot",
        behavior="",
        command_kind="duty",
        command_t_s=t_s[told],
        command=duty[told],
        battery_V=nan,
        frame_t_s=nan,
        mode=flags,
        detected_raw=flags,
        detected=flags,
        speed_input=nan,
        turn_input=nan,
        pose_t_s=t_s[seen] + 0.04,  # the clocks differ
        pose=noisy,
        z_m=np.zeros(len(noisy)),
        valid=np.ones(len(noisy), bool),
    )


@pytest.fixture(scope="module")
def robot():
    return _robot()


def _findings(robots, drive="duty"):
    model = native.Model.from_toml(MODEL.format(drive=drive), "test")
    found = [f for r in robots for f in check_commanded(r, "log") or check_poses(r, "log")]
    if not any(f.fatal for f in found):
        found += check_tracks([("log", make_track(r)) for r in robots], model)
    return found


def _one(robots, *words, fatal=True):
    """The one finding that there must be holds these words."""
    found = _findings(robots)
    assert len(found) == 1, found
    for word in words:
        assert word in f"{found[0].what}; {found[0].remedy}", found[0]
    assert found[0].fatal is fatal
    assert str(found[0]).count(";") == 1 and str(found[0]).endswith(".")


def _by_encoders(robot):
    """Log with the speeds that its wheels are to have, rad/s, in the place of duties."""
    rim_mps = TOP_MPS * np.sign(robot.command) * np.abs(robot.command) ** 0.7
    return replace(robot, command_kind="wheel_speed", command=rim_mps / RADIUS_M)


def _with_pose(robot, x=None, y=None, theta=None):
    pose = robot.pose.copy()
    for k, values in enumerate((x, y, theta)):
        if values is not None:
            pose[:, k] = values
    return replace(robot, pose=pose)


def test_a_right_log_has_no_findings(robot):
    assert _findings([robot]) == []


@pytest.mark.parametrize(
    ("order", "signs", "words"),
    [
        ((1, 0, 3, 2), (1, 1, 1, 1), ("left and the right wheels are swapped",)),
        ((2, 3, 0, 1), (1, 1, 1, 1), ("front and the rear wheels are swapped",)),
        ((1, 0, 2, 3), (1, 1, 1, 1), ("fl_pct and fr_pct are swapped", "'fl_pct': 'fr_pct'")),
        ((0, 1, 2, 3), (-1, 1, 1, 1), ("fl_pct has the wrong sign", "flip=['fl_pct']")),
        ((0, 1, 2, 3), (-1, 1, -1, 1), ("left wheels have the wrong sign",)),
        ((0, 1, 2, 3), (-1, -1, -1, -1), ("all wheels have the wrong sign",)),
    ],
)
def test_wheels_that_are_swapped_or_turned_round_are_named(robot, order, signs, words):
    wrong = replace(robot, command=robot.command[:, order] * signs)
    _one([wrong], *words)


def test_axes_that_are_swapped_or_mirrored_are_named(robot):
    x, y, theta = robot.pose.T
    _one([_with_pose(robot, x=y, y=x)], "x and y are swapped", "'x_m': 'y_m'")
    _one([_with_pose(robot, y=-y)], "y has the wrong sign", "flip=['y_m']")
    _one([_with_pose(robot, y=-y, theta=-theta)], "mirrored", "flip=['y_m', 'theta_rad']")
    _one([_with_pose(robot, theta=-theta)], "counted clockwise", "flip=['theta_rad']")


@pytest.mark.parametrize("off_deg", [-90, 40, 180])
def test_a_heading_that_is_off_by_a_constant_is_named_with_the_angle(robot, off_deg):
    wrong = _with_pose(robot, theta=robot.pose[:, 2] - np.radians(off_deg))
    found = _findings([wrong])
    assert len(found) == 1
    told_deg = float(found[0].remedy.split("heading_offset_deg=")[1].split()[0].rstrip("."))
    assert abs((told_deg - off_deg + 180) % 360 - 180) < 4


def test_an_effect_of_physics_is_no_mistake(robot):
    # Ten degrees of heading bias, a wheel at three quarters, a tracked point off the middle.
    theta = robot.pose[:, 2]
    x = robot.pose[:, 0] + 0.04 * np.cos(theta)
    y = robot.pose[:, 1] + 0.04 * np.sin(theta)
    assert _findings([_with_pose(robot, x=x, y=y, theta=theta + np.radians(10))]) == []
    weak = robot.command * [0.75, 1, 1, 1]
    assert _findings([replace(robot, command=weak)]) == []


@pytest.mark.parametrize("drive", ["twist", "wheel_speed"])
def test_a_model_that_is_driven_otherwise_is_named(robot, drive):
    (found,) = _findings([robot], drive)
    assert found.fatal and "commands are duties" in found.what and drive in found.evidence


def test_units_are_told_from_speeds(robot):
    _one([_with_pose(robot, *(1000 * robot.pose[:, :2]).T)], "in mm", "x_mm")
    _one([_with_pose(robot, *(1e9 * robot.pose[:, :2]).T)], "none of a robot in a room")
    _one([_with_pose(robot, theta=np.degrees(robot.pose[:, 2]))], "degrees", "theta_deg")


def test_a_height_in_the_place_of_y_is_named(robot):
    flat = 0.05 + 1e-4 * np.random.default_rng(1).normal(size=len(robot.pose))
    _one([replace(_with_pose(robot, y=flat), z_m=robot.pose[:, 1])], "y is up", "the other up")


def test_headings_that_are_none_are_named(robot):
    _one([_with_pose(robot, theta=0.5 + 0 * robot.pose[:, 2])], "heading was not measured")
    _one([_with_pose(robot, theta=np.nan * robot.pose[:, 2])], "heading is not recorded")
    noise = np.random.default_rng(1).normal(size=len(robot.pose))
    noisy = _with_pose(robot, theta=robot.pose[:, 2] + np.radians(5) * noise)
    _one([noisy], "headings are noisy", fatal=False)


def test_names_that_are_exchanged_are_told_for_both(robot):
    other = _robot(robot_id=5, seed=2)
    assert _findings([robot, other]) == []
    found = _findings([replace(robot, robot_id=5), replace(other, robot_id=3)])
    assert found == []  # whole robots under another number are right
    pose = {k: getattr(robot, k) for k in ("pose_t_s", "pose", "z_m", "valid")}
    theirs = {k: getattr(other, k) for k in pose}
    found = _findings([replace(robot, **theirs), replace(other, **pose)])
    assert [f.robot_id for f in found] == [3, 5]
    assert "exchanged with that of robot 5" in found[0].what
    assert {f.remedy for f in found} == {"import anew with exchange=[(3, 5)]"}


@pytest.mark.parametrize("ppm", [-1000, 1000])
def test_drift_of_the_clocks_is_measured(robot, ppm):
    found = _findings([replace(robot, pose_t_s=robot.pose_t_s * (1 + 1e-6 * ppm))])
    assert [f.what for f in found] == ["the two clocks run apart"]
    assert not found[0].fatal
    told, std = (float(w) for w in found[0].evidence.split(" ppm")[0][3:].split(" +- "))
    assert abs(told - ppm) < 4 * std + 20


def test_how_late_a_robot_is_is_looked_for_once_in_a_log(robot, monkeypatch):
    """It is half of the time of the checks; a mistake asks for it, and what is no mistake again."""
    asked = []

    def counted(search):
        asked.append(search)
        return lateness_of(search)

    monkeypatch.setattr(clocks, "lateness_of", counted)
    pose = robot.pose + np.random.default_rng(1).normal(size=robot.pose.shape) * [0.01, 0.01, 0.06]
    _findings([replace(robot, pose=pose)])
    assert len(asked) == 1


@pytest.mark.parametrize("late_s", [-3.0, 1.7, 4.4, 6.1])
def test_clocks_far_apart_are_told_with_the_shift(robot, late_s):
    """The shift is told to milliseconds: with one clock for both nothing searches the rest."""
    (f,) = _findings([replace(robot, pose_t_s=robot.pose_t_s + late_s)])
    assert f.fatal and ("late" if late_s > 0 else "early") in f.what
    shift_s = float(re.search(r"pose_shift_s=(.+);", f.remedy)[1])
    clocks_s = 0.04  # of the robot as it is
    assert abs(clocks_s + late_s + shift_s) < 0.005
    moved = replace(robot, pose_t_s=robot.pose_t_s + late_s + shift_s)
    assert _findings([moved]) == []


@pytest.mark.parametrize("by_s", [-0.493, 0.3, 2.0])
def test_a_clock_that_was_set_within_the_log_is_told_with_time_and_step(robot, by_s):
    """Poses of one time are stamped in order; a step back leaves two streams mixed."""
    stamps_s = robot.pose_t_s + np.where(robot.pose_t_s < 30, 0, by_s)
    order = np.argsort(stamps_s, kind="stable")
    (f,) = _findings([replace(robot, pose_t_s=stamps_s[order], pose=robot.pose[order])])
    assert f.fatal and f.what == "a clock was set within the log"
    at_s = float(f.evidence.split("about ")[1].split(" s")[0])
    step_s = float(f.evidence.split("come ")[1].split(" s")[0])
    assert abs(at_s - 30) <= 3  # the stretches that are judged are as long
    assert abs(step_s - abs(by_s)) < 0.1
    assert ("later" if by_s > 0 else "sooner") in f.evidence


@pytest.mark.parametrize("drive", ["duty", "wheel_speed"])
@pytest.mark.parametrize(
    ("by_s", "from_s"), [(0.06, 30), (0.12, 30), (-0.3, 30), (0.4, 30), (0.08, 15), (-0.08, 45)]
)
def test_commands_that_act_later_from_a_moment_on_are_no_clock(robot, by_s, from_s, drive):
    """The robot's deeds of 30 s come `by_s` later; each pose is stamped when it was taken.

    It is neither a drift, which would be mended by a rate, nor a clock that was set, which leaves
    the poses' beat broken.
    """
    t_s = robot.pose_t_s
    done_s = np.where(t_s > from_s, t_s - by_s, t_s)
    late = _with_pose(robot, *(np.interp(done_s, t_s, column) for column in robot.pose.T))
    (f,) = _findings([late if drive == "duty" else _by_encoders(late)], drive)
    assert not f.fatal and "pose_clock_ppm" not in f.remedy
    than = "later" if by_s > 0 else "sooner"
    assert f.what.startswith(f"the robot follows its commands {than} from about ")
    assert not f.steady
    assert abs(float(f.what.split("about ")[1].split(" s")[0]) - from_s) <= 3
    assert abs(float(f.evidence.split("come ")[1].split(" s")[0]) - abs(by_s)) <= 0.02


@pytest.mark.parametrize("ppm", [0, 300])
@pytest.mark.parametrize("more_s", [0.0, 0.15])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_robot_whose_lateness_follows_from_its_drive_has_no_step(seed, more_s, ppm):
    """Its poses come later by up to `more_s`, the slower it drives; the clocks drift a little."""
    robot = _robot(seed=seed)
    t_s = robot.pose_t_s
    told = np.abs(robot.command).max(axis=1)
    slow = np.interp(t_s, robot.command_t_s, np.convolve(1 - told, np.ones(40) / 40, "same"))
    late = _with_pose(robot, *(np.interp(t_s - more_s * slow, t_s, c) for c in robot.pose.T))
    late = replace(late, pose_t_s=t_s * (1 + 1e-6 * ppm))
    for kind, log in (("duty", late), ("wheel_speed", _by_encoders(late))):
        assert _findings([log], kind) == []


def test_a_step_too_long_to_be_told_by_a_diagnosis_parts_the_log(robot):
    t_s = robot.pose_t_s
    late = [np.interp(np.where(t_s > 30, t_s - 0.8, t_s), t_s, c) for c in robot.pose.T]
    (f,) = _findings([_with_pose(robot, *late)])
    assert f.fatal and "follows its commands later" in f.what and "logs of their own" in f.remedy


def test_what_is_as_much_a_step_as_a_drift_is_neither_surely(robot):
    """From 20 to 40 of 60 s it comes to be 100 ms later: half way between the two."""
    t_s = robot.pose_t_s
    done_s = t_s - np.interp(t_s, [20, 40], [0, 0.1])
    (f,) = _findings([_with_pose(robot, *(np.interp(done_s, t_s, c) for c in robot.pose.T))])
    assert not f.fatal and "run apart, or the robot follows its commands later" in f.what
    assert "pose_clock_ppm" not in f.remedy


@pytest.mark.parametrize("ppm", [-2500, 4000])
def test_clocks_that_run_apart_fast_are_no_step(robot, ppm):
    (f,) = _findings([replace(robot, pose_t_s=robot.pose_t_s * (1 + 1e-6 * ppm))])
    assert f.what.startswith("the two clocks run apart, or") and not f.fatal
    assert float(f.evidence.split(" ")[1]) == pytest.approx(ppm, rel=0.1)


def test_steps_one_after_the_other_are_told_with_time_and_size(robot):
    """At 20 s and at 40 s it comes to be 60 ms later: the commands wait in a buffer that fills."""
    t_s = robot.pose_t_s
    done_s = t_s - 0.06 * (t_s > 20) - 0.06 * (t_s > 40)
    (f,) = _findings([_with_pose(robot, *(np.interp(done_s, t_s, c) for c in robot.pose.T))])
    assert not f.fatal and f.lateness.shape == "steps"
    assert f.lateness.at(np.array([10, 30, 50])) == pytest.approx([0, 0.06, 0.12], abs=0.01)
    at_s = [float(words.split(" s on")[0]) for words in f.what.split("from about ")[1:]]
    assert at_s == pytest.approx([20, 40], abs=3)
    assert "look at what sent the commands" in f.remedy


@pytest.mark.parametrize(
    ("shape", "later"),
    [
        ("step", lambda t: -0.12 * (t > 40)),
        ("while", lambda t: 0.2 * ((t > 18) & (t < 38))),
        ("steps", lambda t: 0.1 * (t > 20) + 0.12 * (t > 42)),
        ("drift", lambda t: 0.25 * t / 60),
    ],
)
def test_how_lateness_changes_in_a_log_of_one_clock_is_told(robot, shape, later):
    """Each pose is stamped when it was taken; what it shows was due so much earlier."""
    t_s = robot.pose_t_s
    late = [np.interp(t_s - later(t_s), t_s, column) for column in robot.pose.T]
    (f,) = _findings([replace(_with_pose(robot, *late), same_clock=True)])
    assert not f.fatal and not f.steady and f.lateness.shape == shape
    away_s = f.lateness.at(t_s) - later(t_s)
    assert np.quantile(np.abs(away_s), 0.85) < 0.015  # a step is found to a stretch or two
    if shape == "drift":
        assert f.what.endswith("250 ms a minute") or abs(f.lateness.late_s[-1] - 0.25) < 0.015


def _slower(robot, time_constant_s):
    """Its pose through a lag more, of (N,) seconds, which may change."""
    pose = robot.pose.copy()
    share = 1 - np.exp(-np.diff(robot.pose_t_s) / np.maximum(time_constant_s[1:], 1e-3))
    for k in range(1, len(pose)):
        pose[k] = pose[k - 1] + share[k - 1] * (robot.pose[k] - pose[k - 1])
    return _with_pose(robot, *pose.T)


@pytest.mark.parametrize(
    "time_constant",
    [lambda t: 0.15 * (t > 30), lambda t: 0.15 * t / 60, lambda t: 0.1 * np.sin(t) ** 2],
    ids=["a load from 30 s on", "gears that stiffen", "to and fro"],
)
def test_a_lag_that_changes_is_no_delay_that_changes(robot, time_constant):
    slower = _slower(robot, time_constant(robot.pose_t_s))
    assert _findings([replace(slower, same_clock=True)]) == []


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_commands_that_come_each_at_its_own_delay_have_no_lateness_that_changes(seed):
    """By up to 0.15 s, at random, as over a busy link."""
    robot, rng = _robot(seed=seed), np.random.default_rng(seed)
    t_s = robot.pose_t_s
    jitter_s = np.repeat(rng.uniform(0, 0.15, len(t_s) // 35 + 1), 35)[: len(t_s)]
    done_s = np.maximum.accumulate(t_s - jitter_s)
    late = [np.interp(done_s, t_s, column) for column in robot.pose.T]
    assert _findings([replace(_with_pose(robot, *late), same_clock=True)]) == []


def test_stamps_that_are_rounded_are_no_clock_that_was_set():
    """60 poses a second by whole milliseconds: the usual step, 17 ms, is not the mean one."""
    from twinmill.data.lost_commands import beat_s

    assert beat_s(np.arange(0, 60, 1 / 60).round(3)) == pytest.approx(1 / 60, rel=1e-4)


@pytest.mark.parametrize("noise_m", [0.0, 0.0004, 0.003])
def test_poses_that_do_not_move_although_commands_do_are_named(robot, noise_m):
    still = np.full(robot.pose.shape, 0.3)
    noise = np.random.default_rng(1).normal(size=still.shape) * [noise_m, noise_m, 5 * noise_m]
    _one([replace(robot, pose=still + noise)], "do not move although the robot is driven")


@pytest.mark.parametrize("count", [2, 3])
def test_robots_under_one_number_are_told(robot, count):
    """Their poses come in turn, as a tracker sends them, or as the network mixed them."""
    others = [_robot(seed=1 + k).pose + np.array([0.9 * k, 0, 0]) for k in range(count)]
    in_turn = np.stack(others, axis=1).reshape(-1, 3)
    t_s = np.interp(np.arange(len(in_turn)) / count, np.arange(len(robot.pose)), robot.pose_t_s)
    some = np.random.default_rng(1).random(len(t_s)) < 0.8
    for kept in (slice(None), some):
        pose = in_turn[kept]
        mixed = replace(
            robot,
            pose=pose,
            pose_t_s=t_s[kept],
            valid=np.ones(len(pose), bool),
            z_m=np.zeros(len(pose)),
        )
        _one([mixed], "two robots or more under one number", "robot_id")


def _parts_in_turn(first, second):
    """(t_s, pose) of two parts, each (t_s, pose), sorted by stamp."""
    t_s, pose = (np.concatenate(columns) for columns in zip(first, second, strict=True))
    order = np.argsort(t_s, kind="stable")
    return t_s[order], pose[order]


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_stamps_that_step_back_are_told_from_two_robots(seed):
    """A clock set back by 12 s after 40 s; then a guest for 20 s that leaves where it came."""
    robot = _robot(seed=seed)
    t_s, pose = robot.pose_t_s, robot.pose
    late = t_s > 40
    stepped = _parts_in_turn((t_s[~late], pose[~late]), (t_s[late] - 12.006, pose[late]))
    (told,) = check_poses(replace(robot, pose_t_s=stepped[0], pose=stepped[1]), "log")
    assert "the stamps of the poses step back by 12.0 s: " in str(told)
    assert "after 40.0 s begin again at 28.0 s" in str(told)
    out_and_back = np.minimum(np.arange(1000), np.arange(1000)[::-1])
    guest = t_s[1000:2000] + 0.006, _robot(seed=seed + 10).pose[out_and_back] + [0.3, 0, 0]
    mixed = _parts_in_turn((t_s, pose), guest)
    everywhere = np.zeros(len(mixed[0]))
    robots = replace(
        robot,
        pose_t_s=mixed[0],
        pose=mixed[1],
        z_m=everywhere,
        valid=everywhere == 0,
    )
    (told,) = check_poses(robots, "log")
    assert "two robots or more under one number" in str(told)


def test_a_robot_that_stands_as_it_is_told_is_no_mistake(robot):
    noise = np.random.default_rng(1).normal(size=robot.pose.shape) * 0.0004
    assert check_poses(replace(robot, pose=noise, command=0.1 * robot.command), "log") == []
    turns_alone = _with_pose(robot, x=noise[:, 0], y=noise[:, 1])
    assert check_poses(turns_alone, "log") == []


def test_too_few_poses_are_told(robot):
    lost = np.random.default_rng(1).random(len(robot.pose)) < 1 / 3
    pose = np.where(lost[:, None], np.nan, robot.pose)
    _one([replace(robot, pose=pose, valid=~lost)], "many poses are lost", fatal=False)
    _one([_robot(duration_s=12)], "the log is short", fatal=False)
    _one([_robot(pose_hz=4)], "poses come slowly", fatal=False)


def test_wheels_of_the_model_are_named_beside_columns_that_seem_wrong(robot):
    """Three wheels at 120 degrees (Campion et al. 1996), told of a model with four mecanum ones."""
    forward, left, turn = np.linalg.lstsq(MECANUM.T, robot.command.T, rcond=None)[0] * 0.5
    at_rad = np.radians([60, 180, 300])
    rims = -np.sin(at_rad) * forward[:, None] + np.cos(at_rad) * left[:, None] + turn[:, None]
    found = _findings([replace(robot, command=np.column_stack([rims, 0 * forward]))])
    assert any(f.fatal for f in found)
    assert all("base.wheels" in f.remedy for f in found if f.fatal), found


def test_commands_that_are_all_zero_are_told(robot):
    _one([replace(robot, command=0 * robot.command)], "all commands are zero")


def test_wheels_on_which_alike_commands_are_a_turn_are_not_called_astray(robot):
    """Marker 5 cm before the middle of a robot that spins on the spot, all wheels alike."""
    t_s = robot.pose_t_s
    theta = 0.5 + 1.5 * t_s
    x, y = 0.05 * np.cos(theta), 0.05 * np.sin(theta)
    alike = np.full(robot.command.shape, 0.5)
    spins = replace(_with_pose(robot, x=x, y=y, theta=theta), command=alike)
    assert make_track(spins).astray_rad == 0
    across = _with_pose(robot, x=0.2 * t_s, y=0 * t_s, theta=0 * t_s + np.pi / 2)
    track = make_track(replace(across, command=alike))
    assert track.astray_rad == pytest.approx(-np.pi / 2, abs=0.01)


@pytest.mark.parametrize(
    ("headings_rad", "turned_rad", "flipped", "astray_rad"),
    [
        ((0.3, 1.5, 2.7, -0.9), 0.0, None, 0.0),
        ((0.3, 1.5, 2.7, -0.9), 0.8, None, 0.8),
        ((0.3, 1.5, 2.7, -0.9), 0.0, "x", 0.0),
        ((0.3, 1.5, 2.7, -0.9), 0.0, "y", 0.0),
        ((1.0, 1.4), 0.0, "y", 0.0),  # one angle leads 92 % of the way there
    ],
)
def test_a_mirrored_axis_is_no_turned_marker(robot, headings_rad, turned_rad, flipped, astray_rad):
    """Straight ahead along one heading after the other, by algebra."""
    per = len(robot.pose_t_s) // len(headings_rad) + 1
    theta = np.repeat(headings_rad, per)[: len(robot.pose_t_s)]
    step_m = 0.2 * np.diff(robot.pose_t_s, prepend=robot.pose_t_s[0])
    at = {"x": np.cumsum(step_m * np.cos(theta)), "y": np.cumsum(step_m * np.sin(theta))}
    if flipped:
        at[flipped] = -at[flipped]
    alike = np.full(robot.command.shape, 0.5)
    posed = _with_pose(robot, **at, theta=theta - turned_rad)
    track = make_track(replace(posed, command=alike))
    assert track.astray_rad == pytest.approx(astray_rad, abs=0.02)
    assert any("turn the poses" in note for note in track.notes) == bool(astray_rad)


def test_commands_of_another_run_are_told(robot):
    _one([replace(robot, command=_robot(seed=7).command)], "do not explain the motion")


def test_a_table_of_several_robots_is_no_swarm(data_dir):
    sheet = data_dir / "turbopi_actuation" / "steady_state.csv"
    measurements = load_measurements([sheet])
    assert len(measurements) == 4  # by the table's description
    assert robots_recorded(sheet, measurements) == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_turn_of_the_wrong_sign_is_named_where_the_robot_seldom_turns(robot, seed):
    """Unicycle by algebra: each drive an arc of its own; the log tells every turn mirrored."""
    rng = np.random.default_rng(seed)
    told_s, drive_s, count = 0.05, 3.0, 20
    v_mps, w_radps = rng.uniform(0.1, 0.3, count), rng.uniform(-1.2, 1.2, count)
    w_radps[rng.random(count) < 0.6] = 0
    per = round(drive_s / told_s)
    v, w = np.repeat(v_mps, per), np.repeat(w_radps, per)
    theta = np.cumsum(np.r_[0, w[:-1]]) * told_s
    middle = theta + w * told_s / 2
    steps = np.column_stack([v * np.cos(middle), v * np.sin(middle)]) * told_s
    xy = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)[:-1]])
    pose = np.column_stack([xy, theta]) + rng.normal(size=(len(v), 3)) * [0.001, 0.001, 0.004]
    t_s = np.arange(len(v)) * told_s
    nan, flags = np.full(len(v), np.nan), np.zeros(len(v), np.int8)
    command = np.column_stack([v, 0 * v, -w, 0 * v])
    log = replace(
        robot,
        **dict.fromkeys(("battery_V", "frame_t_s", "speed_input", "turn_input"), nan),
        **dict.fromkeys(("mode", "detected_raw", "detected"), flags),
        command_kind="twist",
        command_t_s=t_s,
        command=command,
        pose_t_s=t_s,
        pose=pose,
        valid=np.ones(len(v), bool),
        z_m=np.zeros(len(v)),
    )
    found = _findings([log], "twist")
    assert any("omega_radps has the wrong sign" in f.what for f in found), found
    assert _findings([replace(log, command=command * [1, 1, -1, 1])], "twist") == []


def _told(robot, until_s, last=None, every=1):
    """The robot without telemetry, its commands recorded until then; one row of so many."""
    kept = np.flatnonzero(robot.command_t_s <= until_s)[::every]
    command = robot.command[kept].copy()
    if last is not None:
        command[-1] = last
    none = np.empty(0, np.int8)
    series = {"command_t_s": robot.command_t_s[kept], "command": command, "mode": none}
    return replace(robot, **series, battery_V=robot.battery_V[kept])


def _used_s(robot):
    """When the last pose is that is used."""
    track = make_track(robot)
    return track.pose_t_s[track.segment >= 0][-1], " ".join(track.notes)


@pytest.mark.parametrize("last", [None, 0.0], ids=["driving", "zeros"])
def test_poses_after_the_record_of_commands_are_left_out_with_a_word(robot, last):
    """The robot is driven for a minute, and the recorder of its commands ends after half of it."""
    used_s, notes = _used_s(_told(robot, 30.0, last))
    assert 29.9 < used_s < 30.1
    assert "the last is at 29." in notes or "the last is at 30.000" in notes


def test_a_command_that_is_sent_when_it_changes_may_hold_for_long(robot):
    rows = robot.command_t_s.searchsorted([0, 12, 24, 36])
    changed = {"command_t_s": robot.command_t_s[rows], "command": robot.command[rows]}
    none = np.empty(0, np.int8)
    used_s, notes = _used_s(replace(robot, **changed, mode=none, battery_V=robot.battery_V[rows]))
    assert used_s > 59.9 and "no commands" not in notes
    alone = {name: values[:1] for name, values in changed.items()}
    used_s, _ = _used_s(replace(robot, **alone, mode=none, battery_V=robot.battery_V[:1]))
    assert used_s > 59.9


def test_a_robot_that_was_told_to_stand_and_stands_is_used_to_the_end(robot):
    pose = robot.pose.copy()
    late = robot.pose_t_s > 30.5
    pose[late] = pose[late][0] + (pose[late] - pose[late]).round()
    used_s, notes = _used_s(replace(_told(robot, 30.0, 0.0), pose=pose))
    assert used_s > 59.9 and "no commands" not in notes


def _without_commands(robot, kept):
    """The robot without telemetry, and without the commands that are not kept: (M,) bool."""
    return _told(
        replace(
            robot,
            command_t_s=robot.command_t_s[kept],
            command=robot.command[kept],
            battery_V=robot.battery_V[kept],
        ),
        np.inf,
    )


def test_a_hole_in_the_beat_of_the_commands_is_told_and_cut(robot):
    """The recorder of the commands is out of order for six seconds, or for one of every two."""
    t_s = robot.command_t_s
    log = _without_commands(robot, (t_s < 20) | (t_s >= 26))
    track = make_track(log)
    used_s = track.pose_t_s[track.segment >= 0]
    assert not ((used_s > 20.01) & (used_s < 26.3)).any()
    assert used_s[0] < 0.1 and used_s[-1] > 59.9
    assert any("no commands from 19.98 to 26.00 s" in n and "every 25 ms" in n for n in track.notes)
    assert _findings([log]) == []
    halves = _without_commands(robot, t_s % 2 < 1)
    track = make_track(halves)
    used_s = track.pose_t_s[track.segment >= 0]
    assert len(used_s) > 500 and (used_s[used_s < 59] % 2 < 1.01).all()
    (found,) = [f for f in _findings([halves]) if "commands are lost" in f.what]
    assert "in 29 holes" in found.evidence and not found.fatal


def test_a_hole_in_the_telemetry_keeps_its_own_words(robot):
    kept = (robot.command_t_s < 20) | (robot.command_t_s >= 26)
    alike = ("command_t_s", "command", "battery_V", "mode")
    track = make_track(replace(robot, **{name: getattr(robot, name)[kept] for name in alike}))
    assert "taken while no commands are in the log" in " ".join(track.notes)


def test_commands_that_are_written_when_they_change_have_no_holes(robot):
    """A stick that is moved and held: a beat, and long steps that are no loss."""
    changes = (np.diff(robot.command, axis=0, prepend=9.0) != 0).any(axis=1)
    ramps = np.sin(robot.command_t_s)[:, None] * robot.command
    held = np.sin(0.5 * robot.command_t_s) > 0
    stick = replace(robot, command=np.where(held[:, None], robot.command[0], ramps))
    moved = (np.diff(stick.command, axis=0, prepend=9.0) != 0).any(axis=1)
    for log, kept in ((robot, changes), (stick, moved)):
        log = _without_commands(log, kept)
        assert np.diff(log.command_t_s).max() > 0.5
        assert "no commands" not in " ".join(make_track(log).notes)


@pytest.mark.parametrize("stands", [True, False])
def test_silence_after_a_stop_is_no_loss_while_the_robot_stands(robot, stands):
    """A deadman's switch: nothing is sent while the stick is let go, after one zero."""
    t_s = robot.command_t_s
    silent = (t_s >= 20) & (t_s < 26)
    command = np.where(((t_s >= 19.5) & silent | (t_s > 19.5) & (t_s < 26))[:, None], 0.0, 1.0)
    pose, pose_t_s = robot.pose.copy(), robot.pose_t_s
    if stands:
        still = (pose_t_s > 19.6) & (pose_t_s < 26)
        pose[still] = pose[still][0]
    log = replace(robot, command=command * robot.command, pose=pose)
    notes = " ".join(make_track(_without_commands(log, ~silent)).notes)
    assert ("no commands from 19.98 to 26.00 s" in notes) is not stands


@pytest.mark.parametrize("count", [2, 3])
def test_commands_of_robots_under_one_number_are_told(robot, count):
    others = [_robot(seed=1 + k).command for k in range(count)]
    in_turn = np.stack(others, axis=1).reshape(-1, 4)
    t_s = np.interp(np.arange(len(in_turn)) / count, np.arange(len(others[0])), robot.command_t_s)
    mixed = {"command": in_turn, "command_t_s": t_s, "battery_V": np.full(len(t_s), np.nan)}
    mixed["mode"] = np.empty(0, np.int8)
    _one([replace(robot, **mixed)], "commands are those of two robots or more", "robot_id")


def test_a_robot_that_switches_between_two_commands_is_one(robot):
    """By a bit that flickers at each control step, and by a script that drives and stops."""
    bit = np.random.default_rng(1).random(len(robot.command)) < 0.5
    table = np.array([[1, 0.4, 1, 0.4], [0.4, 1, 0.4, 1]])[bit.astype(int)]
    assert check_commanded(replace(robot, command=table), "log") == []
    steps = np.arange(60) % 2 * np.ones((4, 1))
    script = replace(robot, command=steps.T, command_t_s=np.arange(60.0))
    assert check_commanded(script, "log") == []


@pytest.mark.parametrize("wrong", [1e20, -1e4, np.inf])
def test_a_command_that_no_robot_follows_is_named_by_its_row(robot, wrong):
    command = robot.command.copy()
    command[100:103, 1] = wrong
    _one([replace(robot, command=command)], "none that a robot could follow", "correct or delete")
    (found,) = check_commanded(replace(robot, command=command), "log")
    assert "wheel 2" in found.evidence and "row 101 " in found.evidence


def test_speeds_divided_by_the_time_of_day_are_told(robot):
    """As odometry has them that takes a whole stamp in ns for a step of the clock."""
    small = replace(robot, command=robot.command * 1e-14)
    _one([small], "commands are next to nothing", "a time step in a wrong unit")
    assert check_commanded(replace(robot, command=robot.command * 1e-3), "log") == []
    parked = replace(small, pose=0 * small.pose)
    assert check_commanded(parked, "log") == []


def test_commands_in_another_unit_are_not_taken_for_single_mistakes(robot):
    """Millimetres a second as metres: all of them are large."""
    twist = np.zeros_like(robot.command)
    twist[:, 0] = 720 * np.sign(robot.command[:, 0])
    large = replace(robot, command_kind="twist", command=twist)
    assert check_commanded(large, "log") == []


def test_one_valid_pose_is_not_told_as_none(robot):
    """As import says it: the two had disagreed."""
    valid = np.zeros(len(robot.valid), bool)
    valid[3] = True
    with pytest.raises(LogError, match=rf"1 of its {len(valid)} poses are valid"):
        make_track(replace(robot, valid=valid))


def _mixed_up(robot: RobotLog, begin_s: float, end_s: float) -> RobotLog:
    """Log with the commands of a while in another order than they were driven."""
    legs = np.floor(robot.command_t_s / 0.7 + 1e-9).astype(int)
    own = np.unique(legs[(robot.command_t_s >= begin_s) & (robot.command_t_s < end_s)])
    command, driven = robot.command.copy(), np.random.default_rng(4).permutation(own)
    for leg, other in zip(own, driven, strict=True):
        command[legs == leg] = robot.command[np.flatnonzero(legs == other)[0]]
    return replace(robot, command=command)


def test_commands_that_were_mixed_up_for_a_while_are_told_and_cut():
    """They are no physics: a loss had been found where none was, surely."""
    (found,) = _findings([_mixed_up(_robot(duration_s=90.0), 30.0, 50.0)])
    assert "do not belong to the motion" in found.what and not found.fatal
    ((begin_s, end_s),) = found.cut_s
    assert begin_s == pytest.approx(30.0, abs=1.5) and end_s == pytest.approx(50.0, abs=2.5)


def _pose_held(robot: RobotLog, begin_s: float, end_s: float, share: float) -> RobotLog:
    """Log with a robot that goes a share of its way for a while."""
    slow = (robot.pose_t_s >= begin_s) & (robot.pose_t_s < end_s)
    heading = robot.pose[:, 2]
    step = np.diff(robot.pose, axis=0, prepend=robot.pose[:1])
    c, s = np.cos(heading), np.sin(heading)
    body = np.column_stack([c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0]])
    body, turn = (np.where(slow[:, None], share * b, b) for b in (body, step[:, 2:]))
    heading = np.cumsum(turn[:, 0])
    c, s = np.cos(heading), np.sin(heading)
    way = np.column_stack([c * body[:, 0] - s * body[:, 1], s * body[:, 0] + c * body[:, 1]])
    return replace(robot, pose=np.column_stack([np.cumsum(way, axis=0), heading]))


@pytest.mark.parametrize("share", [0.0, 0.3, -1.0])
def test_a_robot_that_is_held_or_weak_or_turned_round_for_a_while_is_not_cut(share):
    """It still goes by a share of its commands, or not at all."""
    assert not _findings([_pose_held(_robot(duration_s=90.0), 30.0, 50.0, share)])
