# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.log import LogError, read_log
from twinmill.data.track import local_line, make_track


@pytest.mark.parametrize("name", ["calibration", "case_s", "case_w"])
def test_recording_is_cut_at_every_pick_up_and_between_its_runs(data_dir, name):
    robot = read_log(data_dir / "hidden_effects" / f"{name}.lcmlog").robots[3]
    runs = 1 + np.count_nonzero(np.diff(robot.pose_t_s) > 1)  # 3 s apart by the description
    lost = np.flatnonzero(np.diff(robot.valid.astype(int)) < 0)  # last valid pose before each

    track = make_track(robot)

    assert (track.segment[~robot.valid] == -1).all()
    assert track.segment.max() + 1 == runs + len(lost)
    for k in lost:
        before = track.segment[:k][track.segment[:k] >= 0].max()
        after = track.segment[k:][track.segment[k:] >= 0].min()
        assert after == before + 1
    # Frames lost alone, two in a thousand by the recording's description, cut nothing.
    assert track.timing.pose_lost_share == pytest.approx(0.002, abs=0.001)


def test_robot_put_elsewhere_is_cut_and_margins_dropped(driven):
    robot = driven()
    robot.pose[600:, :2] += 0.5  # at 5 s
    track = make_track(robot)
    assert track.segment.max() == 1
    used = track.pose_t_s[track.segment >= 0]
    gap = np.argmax(np.diff(used))
    assert used[gap : gap + 2] == pytest.approx([5 - 0.1, 5 + 0.1], abs=2.1 / 120)
    assert any("cut at 4.99" in note and "jumps" in note for note in track.notes)


def test_fast_but_possible_motion_is_not_cut(driven):
    robot = driven()
    robot.pose[:, 0] += 1.0 * robot.pose_t_s
    assert make_track(robot).segment.tolist() == [0] * len(robot.pose_t_s)


@pytest.mark.parametrize("length", [1, 3])
def test_jump_and_jump_back_leaves_one_segment(driven, length):
    robot = driven()
    robot.pose[600 : 600 + length] += [0.3, 0, 2.5]
    track = make_track(robot)
    assert np.flatnonzero(track.segment < 0).tolist() == list(range(600, 600 + length))
    assert track.segment.max() == 0


@pytest.mark.parametrize("beside_m", [0.0, 0.04])
def test_a_while_in_which_the_tracker_turned_the_robot_is_left_out(driven, beside_m):
    """Its front was taken for its back for 1.5 s, about its middle or beside it."""
    robot = driven()
    robot.pose[600:780] += [beside_m, 0, np.pi]
    robot.pose[:, 2] = np.angle(np.exp(1j * robot.pose[:, 2]))
    track = make_track(robot)
    assert (track.segment[600:780] < 0).all() and track.segment.max() == 1
    (said,) = (note for note in track.notes if "tracker" in note)
    assert said.startswith("from 5.000 to 6.492 s") and "180 degrees" in said
    assert not any("jumps" in note or "not tracked" in note for note in track.notes)


def test_a_heading_that_steps_for_good_is_told_as_that(driven):
    robot = driven()
    robot.pose[600:, 2] += 0.3
    track = make_track(robot)
    assert track.segment.max() == 1
    (said,) = track.notes
    assert "at 4.99" in said and "the heading steps by 17 degrees" in said
    assert "the place does not" in said and "jumps" not in said


@pytest.mark.parametrize("turned_deg", [0, 90, 180])
def test_a_heading_opposite_to_the_motion_is_told_of_a_robot_that_drives_in_arcs_alone(
    driven, turned_deg
):
    """As a tag is that was drawn by AprilTag, and read as OpenCV draws it; across is another's."""
    robot = driven()
    robot.pose[:, 2] += np.radians(turned_deg)
    track = make_track(robot)
    said = [note for note in track.notes if "of its heading" in note]
    assert abs(track.astray_rad) == pytest.approx(np.pi * (turned_deg == 180), abs=0.01)
    assert len(said) == (turned_deg == 180)
    assert all("heading_offset_deg={3: " in note and "180" in note for note in said)
    assert all("family='tag36h11'" in note for note in said)


def test_a_pose_that_is_left_out_leaves_no_trace(driven):
    """A camera's glitch far off the floor, and the same frame lost."""
    far, lost = driven(), driven()
    far.pose[600] += [1e8, -1e8, 2.5]
    lost.pose[600], lost.valid[600] = np.nan, False
    one, other = make_track(far), make_track(lost)
    for name in ("pose", "segment", "heading_smooth"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_gap_cuts_and_short_loss_does_not(driven):
    robot = driven()
    robot.valid[300:303] = False
    robot.valid[600:612] = False
    robot.pose[~robot.valid] = np.nan
    track = make_track(robot)
    assert track.segment[299] == track.segment[303] == 0
    assert track.segment[-1] == 1


def test_slow_camera_is_not_cut_at_every_frame(driven):
    robot = driven()
    slow = slice(None, None, 12)  # 10 Hz
    robot = replace(
        robot,
        pose_t_s=robot.pose_t_s[slow],
        pose=robot.pose[slow],
        z_m=robot.z_m[slow],
        valid=robot.valid[slow],
    )
    assert make_track(robot).segment.max() == 0


def test_poses_without_known_duties_are_unusable(driven):
    robot = driven()
    known = (robot.command_t_s < 3) | (robot.command_t_s > 6)
    robot = replace(
        robot,
        command_t_s=robot.command_t_s[known],
        command=robot.command[known],
        battery_V=robot.battery_V[known],
    )
    track = make_track(robot)
    middle = (track.pose_t_s > 3.5) & (track.pose_t_s < 5.5)
    assert (track.segment[middle] == -1).all()
    assert track.segment.max() == 1


def test_lifted_robot_is_cut(driven):
    robot = driven()
    robot.z_m[500:700] += 0.2
    track = make_track(robot)
    assert (track.segment[500:700] == -1).all() and track.segment.max() == 1


@pytest.mark.parametrize("tilt_deg", [3.0, -8.0])
@pytest.mark.parametrize("way_m", [4.0, 0.0], ids=["over the room", "in a line"])
def test_a_robot_under_tilted_axes_is_on_the_floor_unless_it_is_lifted(driven, tilt_deg, way_m):
    """The floor leans along x; the robot drives 4 m of it, and is carried for 1.6 s."""
    robot = driven()
    robot.pose[:, :2] += np.linspace(0, way_m, len(robot.pose))[:, None] + [[1.0, -2.0]]
    if not way_m:
        robot.pose[:, :2] = np.linspace([0, 0], [4, 0], len(robot.pose))
    robot.z_m[:] = 0.1 + np.tan(np.radians(tilt_deg)) * robot.pose[:, 0]
    robot.z_m[500:700] += 0.2
    track = make_track(robot)
    assert np.flatnonzero(track.segment < 0)[[0, -1]] == pytest.approx([500, 699], abs=20)
    assert (track.segment[500:700] == -1).all()
    (said,) = (note for note in track.notes if "tilted" in note)
    assert f"tilted by {abs(tilt_deg):.1f} degrees" in said


def test_a_robot_that_is_carried_elsewhere_tilts_no_floor(driven):
    """It drives within 0.2 m, is held 0.2 m high for 3 of 10 s, and goes 3 m aside with that."""
    robot = driven()
    robot.pose[:, :2] *= 0.15
    robot.z_m[300:660] += 0.2
    robot.pose[300:660, 0] += np.linspace(0, 3, 360)
    robot.z_m[:] += np.random.default_rng(1).normal(0, 3e-4, len(robot.z_m))
    track = make_track(robot)
    assert (track.segment[300:660] == -1).all()
    assert not any("tilted" in note for note in track.notes)


def test_rest_lies_inside_the_stretch_of_zero_commands(driven):
    robot = driven()
    robot.command[(robot.command_t_s >= 2) & (robot.command_t_s < 8)] = 0
    assert make_track(robot).rest == pytest.approx(np.array([[3.5, 7.7]]), abs=1 / 45)


def test_local_line_gives_value_and_slope_of_a_line_exactly_at_uneven_times():
    t = np.cumsum(np.random.default_rng(1).uniform(0.004, 0.012, 400))
    segment = np.repeat([0, -1, 1], [200, 10, 190])
    value, slope = local_line(t, 3 - 2 * t, segment, 0.025)
    assert value[segment >= 0] == pytest.approx((3 - 2 * t)[segment >= 0])
    assert slope[segment >= 0] == pytest.approx(-2)
    assert np.isnan(value[segment < 0]).all()


def test_local_lines_are_those_of_polyfit_through_the_times_of_one_segment_in_the_window():
    random = np.random.default_rng(3)
    t, values = np.cumsum(random.uniform(0.004, 0.012, 60)), random.normal(size=(60, 2))
    segment = np.repeat([0, 1, 2], [30, 1, 29])
    value, slope = local_line(t, values, segment, 0.03)
    for k in (0, 12, 28, 40, 59):
        near = (np.abs(t - t[k]) <= 0.03) & (segment == segment[k])
        expected = np.polyfit(t[near] - t[k], values[near], 1)
        assert np.array([slope[k], value[k]]) == pytest.approx(expected, abs=1e-9)
    assert (value[30] == values[30]).all() and np.isnan(slope[30]).all()


def test_smoothing_lowers_white_noise_like_a_mean_of_its_window(driven):
    robot = driven(60)
    robot.pose[:, 2] += np.random.default_rng(2).normal(0, 0.01, len(robot.pose))
    track = make_track(robot)
    left = (track.heading_smooth - 0.5 * track.pose_t_s)[10:-10]
    # In the middle of seven even samples a line's value is their mean.
    assert left.std() == pytest.approx(0.01 / np.sqrt(7), rel=0.1)


def test_heading_beside_motion_is_told_with_the_angle(driven):
    robot = driven()
    robot.command[:] = 0.6  # straight
    robot.pose[:] = np.column_stack([-0.3 * robot.pose_t_s] + [0 * robot.pose_t_s] * 2)
    assert any("180 degrees" in note for note in make_track(robot).notes)
    robot.command[:] = -0.6
    assert not make_track(robot).notes


def test_frozen_pose_is_told_only_while_driven(driven):
    robot = driven()
    robot.pose[300:420] = robot.pose[300]
    assert any("frozen from 2.500" in note for note in make_track(robot).notes)
    robot.command[:] = 0
    assert not any("frozen" in note for note in make_track(robot).notes)


def test_battery_is_interpolated_where_unknown(driven):
    robot = driven()
    robot.battery_V[:] = np.nan
    assert np.isnan(make_track(robot).battery_V).all()
    robot.battery_V[[0, -1]] = 8, 7
    assert make_track(robot).battery_V == pytest.approx(np.linspace(8, 7, len(robot.battery_V)))


def test_robot_without_commands_is_refused(driven):
    with pytest.raises(LogError, match="robot 3: the log has no commands"):
        make_track(driven(command_t_s=np.empty(0), command=np.empty((0, 4))))


def test_commands_of_another_time_leave_nothing_usable(driven):
    robot = driven()
    track = make_track(replace(robot, command_t_s=robot.command_t_s + 100))
    assert (track.segment == -1).all()
    assert any("no stretch" in note for note in track.notes)


@pytest.mark.parametrize("period_s", [0.01, 0.25])
def test_a_fast_car_does_not_jump_and_is_cut_where_it_is_put_elsewhere(driven, period_s):
    pose_t_s = np.arange(0, 40, period_s)
    speed_mps = 6 * (1 - np.cos(2 * np.pi * pose_t_s / 20))  # to 12 m/s and back, twice
    x_m = np.cumsum(speed_mps * period_s)
    pose = np.column_stack([x_m, 0 * x_m, 0 * x_m])
    count = len(pose_t_s)
    robot = driven(
        40.0, pose_t_s=pose_t_s, pose=pose, z_m=np.zeros(count), valid=np.ones(count, bool)
    )
    assert (make_track(robot).segment == 0).all()
    pose[count // 2 :, 1] += 8.0  # at rest, 20 s
    assert make_track(robot).segment.max() == 1


def test_losing_every_third_frame_at_random_does_not_cut_the_track(driven):
    robot = driven(60.0)
    lost = np.random.default_rng(1).random(len(robot.pose_t_s)) < 1 / 3
    robot.valid[lost] = False
    robot.pose[lost] = np.nan
    track = make_track(robot)
    assert track.segment.max() == 0
    assert track.timing.pose_lost_share == pytest.approx(1 / 3, abs=0.03)


def test_noise_of_five_degrees_is_no_jump(driven):
    robot = driven(30.0)
    robot.pose[:, 2] += np.radians(5) * np.random.default_rng(1).normal(size=len(robot.pose))
    assert make_track(robot).segment.tolist() == [0] * len(robot.pose_t_s)


def test_stamps_that_jitter_by_a_whole_period_are_no_jumps_and_a_pick_up_still_is(driven):
    robot = driven(30.0)
    random = np.random.default_rng(4)
    robot.pose[:, 0] = 0.3 * np.maximum(robot.pose_t_s - 20, 0)  # it stands for most of the time
    off_s = np.median(np.diff(robot.pose_t_s)) * random.normal(size=len(robot.pose_t_s))
    order = np.argsort(robot.pose_t_s + off_s)
    pose = robot.pose[order].copy()
    robot = replace(robot, pose_t_s=(robot.pose_t_s + off_s)[order], pose=pose)
    assert (make_track(robot).segment == 0).all()
    robot.pose[3000:, 1] += 0.4
    assert make_track(robot).segment.max() == 1
