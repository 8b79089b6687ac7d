# SPDX-License-Identifier: Apache-2.0
"""`import` says what is wrong with velocity commands and poses, before any model is asked.

The drive is algebra: a unicycle that obeys at once, whose path is summed here.
"""

import re

import numpy as np
import pytest

import twinmill as tm
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log

STEP_S, HELD_S, DURATION_S = 0.02, 1.2, 60.0
TWIST = """
name = "t"
[base]
drive = "twist"
wheels = "none"
control_period_s = 0.02
speed_per_input_mps = 0.0036
"""
TURNED = 0.4  # the heading at the beginning


def _drive(seed=3, every=1):
    """(N,) s; (N, 2) m/s ahead and rad/s to the left; (N, 3) m, m, rad.

    Args:
        seed: of the drive.
        every: row that is told; 0 in those between.
    """
    random = np.random.default_rng(seed)
    t_s = np.arange(0, DURATION_S, STEP_S)
    choices = np.array(
        [[0.25, 0], [-0.2, 0], [0, 1.0], [0, -0.8], [0.2, 0.7], [0.15, -0.9], [0, 0]]
    )
    order = random.integers(0, len(choices), int(DURATION_S / HELD_S) + 1)
    told = choices[order[(t_s / HELD_S).astype(int)]]
    told[np.arange(len(told)) % every > 0] = 0
    heading = TURNED + np.concatenate([[0], np.cumsum(told[:-1, 1])]) * STEP_S
    middle = heading + told[:, 1] * STEP_S / 2
    steps = told[:, :1] * np.column_stack([np.cos(middle), np.sin(middle)]) * STEP_S
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)])
    place += random.normal(0, 3e-4, place.shape)
    return t_s, told, np.column_stack([place, heading])


def _said(folder, pose_names, poses, command_names, commands):
    """Warnings of the import of two tables of one robot."""
    files = {"p.csv": (pose_names, poses), "c.csv": (command_names, commands)}
    for name, (header, rows) in files.items():
        np.savetxt(folder / name, rows, "%.7f", ",", header=f"t_s,{header}", comments="")
    options = ImportOptions(robot_id=1, same_clock=True)
    done = import_log(folder / "p.csv", folder / "c.csv", folder / "o.lcmlog", options=options)
    return " ".join(done["warnings"])


POSES, BODY = "x_m,y_m,theta_rad", "vx_mps,vy_mps,omega_radps"


def test_a_right_drive_is_imported_without_a_word(tmp_path):
    t_s, told, pose = _drive()
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    assert not _said(tmp_path, POSES, np.column_stack([t_s, pose]), BODY, commands)


@pytest.mark.parametrize(
    ("speed", "place", "words"),
    [
        (1e3, 1, "commanded speeds are in millimetres per second"),
        (1e2, 1, "commanded speeds are in centimetres per second"),
        (10, 1, "off by ten"),
        (0.1, 1, "off by ten"),
        (1, 10, "off by ten"),
        (1, 0.1, "off by ten"),
    ],
)
def test_units_of_speeds_are_told_at_import(tmp_path, speed, place, words):
    t_s, told, pose = _drive()
    commands = np.column_stack([t_s, speed * told[:, 0], 0 * t_s, told[:, 1]])
    poses = np.column_stack([t_s, place * pose[:, :2], pose[:, 2]])
    assert words in _said(tmp_path, POSES, poses, BODY, commands)


@pytest.mark.parametrize(("unit", "in_a_second"), [("ms", 1e3), ("us", 1e6)])
def test_stamps_in_another_unit_are_told_and_not_judged(tmp_path, unit, in_a_second):
    """A second has so many of each (SI); way and turns are then as much too slow."""
    t_s, told, pose = _drive()
    (tmp_path / "twist.toml").write_text(TWIST)
    stamps = in_a_second * t_s
    log = tm.Log.from_arrays(stamps, pose, stamps, told, kind="twist", same_clock=True)
    with pytest.raises(tm.LogError, match=rf"stamps are in {unit}, not in s: .*t_{unit}"):
        tm.compare(log, tmp_path / "twist.toml")
    right = tm.Log.from_arrays(t_s, pose, t_s, told, kind="twist", same_clock=True)
    assert tm.compare(right, tmp_path / "twist.toml").score < 2


def test_stamps_in_milliseconds_of_quick_poses_are_told_at_import(tmp_path):
    """A thousand poses a second, which are a second apart where ms count as s."""
    t_s, told, pose = _drive()
    quick_s = np.arange(0, t_s[-1], 0.001)
    quick = np.column_stack([np.interp(quick_s, t_s, column) for column in pose.T])
    commands = np.column_stack([1e3 * t_s, told[:, 0], 0 * t_s, told[:, 1]])
    said = _said(tmp_path, POSES, np.column_stack([1e3 * quick_s, quick]), BODY, commands)
    assert "the stamps are in ms, not in s" in said and "rename={'t_s': 't_ms'}" in said


def test_turns_in_degrees_are_told_at_import(tmp_path):
    t_s, told, pose = _drive()
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, np.degrees(told[:, 1])])
    poses = np.column_stack([t_s, pose])
    assert "turns are in degrees per second" in _said(tmp_path, POSES, poses, BODY, commands)


def test_a_compass_is_told_at_import(tmp_path):
    """It counts from the y axis, to the right: 90 degrees less the heading."""
    t_s, told, pose = _drive()
    compass = np.column_stack([t_s, pose[:, :2], np.pi / 2 - pose[:, 2]])
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    said = _said(tmp_path, POSES, compass, BODY, commands)
    assert "counted clockwise" in said and "flip=['theta_rad'], heading_offset_deg=90" in said


def test_velocities_of_the_room_under_the_names_of_the_bodys_are_told(tmp_path):
    t_s, told, pose = _drive()
    x, y = told[:, 0] * np.cos(pose[:, 2]), told[:, 0] * np.sin(pose[:, 2])
    poses, commands = np.column_stack([t_s, pose]), np.column_stack([t_s, x, y, told[:, 1]])
    assert "along the room's axes" in _said(tmp_path, POSES, poses, BODY, commands)
    (tmp_path / "o.lcmlog").unlink()
    room = "vx_world_mps,vy_world_mps,omega_radps"
    assert not _said(tmp_path, POSES, poses, room, commands)


def test_the_z_of_a_quaternion_is_no_heading(tmp_path):
    t_s, told, pose = _drive()
    half = np.sin(np.angle(np.exp(1j * pose[:, 2])) / 2)
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    said = _said(tmp_path, POSES, np.column_stack([t_s, pose[:, :2], half]), BODY, commands)
    assert said.count("robot 1:") == 1 and "the z of a quaternion" in said


@pytest.mark.parametrize("every", [3, 6])
@pytest.mark.parametrize("obeys_both", [False, True])
def test_zeros_of_an_idle_sender_are_told_where_the_robot_does_not_obey_them(
    tmp_path, every, obeys_both
):
    t_s, mixed, pose = _drive(every=every)
    if not obeys_both:
        pose = _drive()[2]
    commands = np.column_stack([t_s, mixed[:, 0], 0 * t_s, mixed[:, 1]])
    said = _said(tmp_path, POSES, np.column_stack([t_s, pose]), BODY, commands)
    assert said.count("robot 1:") == (0 if obeys_both else 1)
    if not obeys_both:
        assert "zeros stand between its commands" in said
        times = float(re.search(r"robot is ([\d.]+) times", said)[1])
        assert times == pytest.approx(every, rel=0.1)


@pytest.mark.parametrize("late_s", [-0.4, -0.08, 0.0, 0.08, 0.4])
def test_poses_before_their_commands_belie_one_clock_and_those_after_are_a_delay(tmp_path, late_s):
    t_s, told, pose = _drive()
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    said = _said(tmp_path, POSES, np.column_stack([t_s + late_s, pose]), BODY, commands)
    assert ("before the commands that they follow, which one clock" in said) == (late_s < 0)
    assert ("a delay of the robot (input_delay" in said) == (late_s > 0)
    if late_s:
        told_s = float(re.search(r"(\d+\.\d+) s (before|after)", said)[1])
        assert told_s == pytest.approx(abs(late_s), abs=0.02)
    if late_s < 0:
        shift_s = float(re.search(r"pose_shift_s=(\d+\.\d+)", said)[1])
        (tmp_path / "o.lcmlog").unlink()
        mended = np.column_stack([t_s + late_s + shift_s, pose])
        assert not _said(tmp_path, POSES, mended, BODY, commands)


def test_a_heading_that_nobody_measured_is_taken_from_the_path_instead(tmp_path):
    t_s, told, pose = _drive()
    tables = {
        "p.csv": (POSES, np.column_stack([t_s, pose[:, :2], 0 * t_s + 0.3])),
        "c.csv": (BODY, np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])),
    }
    for name, (header, rows) in tables.items():
        np.savetxt(tmp_path / name, rows, "%.7f", ",", header=f"t_s,{header}", comments="")
    options = ImportOptions(robot_id=1)
    done = import_log(*(tmp_path / n for n in tables), tmp_path / "o.lcmlog", options=options)
    assert "not measured" in done["warnings"][0] and "heading_from_path=True" in done["warnings"][0]
    options = ImportOptions(robot_id=1, path_heading=True, force=True)
    done = import_log(*(tmp_path / n for n in tables), tmp_path / "o.lcmlog", options=options)
    (robot,) = read_log(tmp_path / "o.lcmlog").robots.values()
    heading_rad = np.interp(robot.pose_t_s[robot.valid], t_s, pose[:, 2])
    off_rad = np.angle(np.exp(1j * (robot.pose[robot.valid, 2] - heading_rad)))
    assert robot.valid.mean() > 0.2 and np.abs(np.median(off_rad)) < 0.02


def test_clocks_that_run_apart_by_a_thousandth_are_told_at_import(tmp_path):
    t_s, told, pose = _drive()
    poses = np.column_stack([1.0015 * t_s, pose])
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    for name, header, rows in (("p.csv", POSES, poses), ("c.csv", BODY, commands)):
        np.savetxt(tmp_path / name, rows, "%.7f", ",", header=f"t_s,{header}", comments="")
    done = import_log(
        tmp_path / "p.csv",
        tmp_path / "c.csv",
        tmp_path / "o.lcmlog",
        options=ImportOptions(robot_id=1),
    )
    assert any("the two clocks run apart" in w and "pose_clock_ppm=" in w for w in done["warnings"])


def test_headings_in_degrees_are_told_and_nothing_that_follows_from_them(tmp_path):
    """Speeds along the axes of a wrong heading are no speeds of the robot."""
    t_s, told, pose = _drive()
    poses = np.column_stack([t_s, pose[:, :2], np.degrees(pose[:, 2])])
    commands = np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]])
    said = _said(tmp_path, POSES, poses, BODY, commands)
    assert said.count("robot 1:") == 1 and "the headings are in degrees" in said


def test_of_a_second_run_that_is_wrong_it_is_said_that_the_first_is_not(tmp_path):
    """As of a motor whose wires were exchanged between the days."""
    (tmp_path / "t.toml").write_text(TWIST)
    for day, sign in (("monday", 1), ("friday", -1)):
        t_s, told, pose = _drive()
        commands = np.column_stack([t_s, told[:, 0], 0 * t_s, sign * told[:, 1]])
        _said(tmp_path, POSES, np.column_stack([t_s, pose]), BODY, commands)
        (tmp_path / "o.lcmlog").rename(tmp_path / f"{day}.lcmlog")
    runs = (tmp_path / "monday.lcmlog", tmp_path / "friday.lcmlog", tmp_path / "t.toml")
    with pytest.raises(LogError, match=r"omega_radps has the wrong .*; monday\.lcmlog has no such"):
        tm.compare_runs(*runs)
