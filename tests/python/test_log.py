# SPDX-License-Identifier: Apache-2.0
import lcm
import numpy as np
import pytest
import turbopi

from twinmill.data.lcm_log import decode
from twinmill.data.log import LogError, read_log
from twinmill.export.recording import read_recording


def drive_and_pose(message, count=3):
    """Events of robot 7 that drives; the last event is a pose."""
    events = []
    for k in range(count):
        events.append(("R07_TELEMETRY", message("telemetry", utime_us=1000 * k, robot_id=7)))
        events.append(("R07_POSE", message("pose", utime_us=1000 * k + 500, robot_id=7)))
    return events


@pytest.mark.parametrize("name", ["calibration", "case_d", "case_w"])
def test_recording_equals_what_lcm_and_the_generated_types_decode(data_dir, name):
    path = data_dir / "hidden_effects" / f"{name}.lcmlog"
    duty, battery, poses = {}, {}, {}
    for event in lcm.EventLog(str(path), "r"):
        if event.channel == "R03_TELEMETRY":
            told = turbopi.telemetry_t.decode(event.data)
            duty[told.utime_us], battery[told.utime_us] = told.wheel_duty_pct, told.battery_V
        else:
            pose = turbopi.pose_t.decode(event.data)
            poses[pose.utime_us] = pose

    log = read_log(path)

    assert list(log.robots) == [3]
    robot = log.robots[3]
    assert robot.command_kind == "duty"
    stamps_us = log.t0_utime_us + np.round(robot.command_t_s * 1e6).astype(int)
    assert stamps_us.tolist() == sorted(duty)
    np.testing.assert_array_equal(robot.command, np.array([duty[t] for t in sorted(duty)]) / 100)
    np.testing.assert_array_equal(robot.battery_V, [battery[t] for t in sorted(duty)])
    valid = np.array([poses[t].valid == 1 for t in sorted(poses)])
    np.testing.assert_array_equal(robot.valid, valid)
    place = np.array([poses[t].position_m[:2] for t in sorted(poses)])
    np.testing.assert_array_equal(robot.pose[valid, :2], place[valid])
    # These poses turn about z alone, so half the heading is the angle of (w, z).
    wz = np.array([poses[t].orientation_wxyz for t in sorted(poses)])[valid]
    turn = np.exp(1j * (robot.pose[valid, 2] - 2 * np.arctan2(wz[:, 3], wz[:, 0])))
    np.testing.assert_allclose(turn, 1, atol=1e-9)
    assert np.abs(np.diff(robot.pose[valid, 2])).max() <= np.pi


def test_truncation_at_every_byte_of_the_last_event_keeps_the_others(write_log, message, tmp_path):
    whole = write_log(*drive_and_pose(message)).read_bytes()
    start = whole.rfind(b"\xed\xa1\xda\x01")
    cut_log = tmp_path / "cut.lcmlog"
    for size in range(start, len(whole) + 1):
        cut_log.write_bytes(whole[:size])
        log = read_log(cut_log)
        assert len(log.robots[7].pose_t_s) == (3 if size == len(whole) else 2)
        broken = [w for w in log.warnings if f"byte {start} of {size}" in w]
        assert len(broken) == (start < size < len(whole))


def test_junk_between_events_is_skipped_and_told(write_log, message):
    path = write_log(*drive_and_pose(message))
    data = path.read_bytes()
    second = data.find(b"\xed\xa1\xda\x01", 4)
    path.write_bytes(data[:second] + b"junk" + data[second:])
    log = read_log(path)
    assert len(log.robots[7].pose_t_s) == 3
    assert any(f"bytes {second} to {second + 4}" in w for w in log.warnings)


@pytest.mark.parametrize("content", [b"", b"t_s,robot_id\n0,1\n", b"\xed\xa1\xda\x01" * 9])
def test_other_files_are_refused(tmp_path, content):
    (tmp_path / "a.lcmlog").write_bytes(content)
    with pytest.raises(LogError, match=r"a\.lcmlog: .* no LCM log"):
        read_log(tmp_path / "a.lcmlog")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(LogError, match="No such file"):
        read_log(tmp_path / "none.lcmlog")


def test_message_of_another_type_is_refused_with_channel_and_type(write_log, message):
    path = write_log(("R07_POSE", message("drive", robot_id=7)))
    with pytest.raises(LogError, match=r"R07_POSE.*turbopi\.pose_t"):
        read_log(path)


def _damaged(path, channel, numbers, place):
    """Flips a bit in the payload of those messages of a channel."""
    events, data = list(lcm.EventLog(str(path), "r")), path.read_bytes()
    of_channel = [event.data for event in events if event.channel == channel]
    data, begin = bytearray(data), 0
    for number, payload in enumerate(of_channel):
        begin = data.index(payload, begin)
        if number in numbers:
            data[begin + place] ^= 1
        begin += len(payload)
    path.write_bytes(data)
    return path


@pytest.fixture
def hundred(write_log, message):
    """A log of a hundred poses and commands, in each of which a number says which it is."""
    events = [
        event
        for k in range(100)
        for event in (
            ("R07_POSE", message("pose", utime_us=k, robot_id=7, position_m=[k, 0.0, 0.0])),
            ("R07_DRIVE", message("drive", utime_us=k, robot_id=7, kind=2)),
        )
    ]
    return write_log(("R07_RUN", message("run", utime_us=0, robot_id=7)), *events)


@pytest.mark.parametrize("channel", ["R07_POSE", "R07_DRIVE"])
def test_a_message_with_a_flipped_bit_in_its_type_is_left_out_and_counted(hundred, channel):
    log = read_log(_damaged(hundred, channel, {40}, 3))
    assert log.warnings == [f"{channel}: 1 of 100 messages are damaged; left out."]
    robot = log.robots[7]
    assert len(robot.pose) + len(robot.command) == 199
    assert (40 in robot.pose[:, 0]) == (channel == "R07_DRIVE")
    recording = read_recording(hundred)
    assert recording.warnings == log.warnings
    (damaged,) = [c for c in recording.channels if c.name == channel]
    assert [m.utime_us for m in damaged.messages] == [k for k in range(100) if k != 40]
    assert len(damaged.stamps_us) == 99


@pytest.mark.parametrize(
    ("channel", "place"), [("R07_POSE", 9), ("R07_DRIVE", 9), ("R07_DRIVE", 20)]
)
def test_a_flipped_bit_in_a_stamp_or_a_kind_is_damage(hundred, channel, place):
    """Years away, one stamp had asked for arrays of 400 TB; of a byte of the wire see drive_t."""
    log = read_log(_damaged(hundred, channel, {40}, place))
    assert log.warnings == [f"{channel}: 1 of 100 messages are damaged; left out."]
    robot = log.robots[7]
    assert robot.pose_t_s.max() < 1 and robot.command_t_s.max() < 1
    assert len(robot.pose) + len(robot.command) == 199


@pytest.mark.parametrize("count", [40, 900])
@pytest.mark.parametrize("by_s", [-134, 134, -9])
def test_a_stamp_out_of_its_order_is_damage_and_moves_no_other(write_log, message, count, by_s):
    """One early stamp had been the beginning of the log: all times told of it were minutes off."""
    stamps_s = np.arange(count) * 90 / count
    told_s = stamps_s.copy()
    told_s[count // 2] += by_s
    events = [
        (f"R07_{kind.upper()}", message(kind, utime_us=int(1e15 + 1e6 * t_s), robot_id=7))
        for t_s in told_s
        for kind in ("pose", "drive", "detection")
    ]
    log = read_log(write_log(*events))
    assert [w for w in log.warnings if "damaged" in w] == [
        f"R07_{kind}: 1 of {count} messages are damaged; left out."
        for kind in ("DRIVE", "POSE", "DETECTION")
    ]
    robot = log.robots[7]
    for t_s in (robot.pose_t_s, robot.command_t_s, robot.seen_t_s):
        np.testing.assert_allclose(t_s, np.delete(stamps_s, count // 2), atol=2e-6)


@pytest.mark.parametrize("held", [0, 27])
def test_a_command_that_is_held_for_minutes_is_no_damage(write_log, message, held):
    """Commands that are sent when they change: one circle of five minutes before or after the rest.

    It had been left out, and with it all poses of that time.
    """
    steps_s = np.full(28, 1.2)
    steps_s[held] = 300.0
    t_s = np.concatenate([[0.0], np.cumsum(steps_s)])
    drives = [message("drive", utime_us=int(1e15 + 1e6 * t), robot_id=7) for t in t_s]
    log = read_log(write_log(*[("R07_DRIVE", drive) for drive in drives]))
    assert len(log.robots[7].command_t_s) == 29 and not any("damaged" in w for w in log.warnings)


def test_stamps_that_a_network_disorders_are_sorted(write_log, message):
    """Two halves of a log that were joined in the wrong order, too: they are no damage."""
    t_s = np.arange(0, 90, 0.1)
    for told_s in (t_s + 0.4 * np.sin(7 * np.arange(900)), np.roll(t_s, 400)):
        poses = [message("pose", utime_us=int(1e6 * t), robot_id=7) for t in told_s]
        log = read_log(write_log(*[("R07_POSE", pose) for pose in poses]))
        assert not any("damaged" in w for w in log.warnings)
        assert any("sorted" in w for w in log.warnings)
        assert len(log.robots[7].pose_t_s) == 900


@pytest.mark.filterwarnings("error")
def test_numbers_that_no_pose_has_are_lost_poses(write_log, message):
    poses = [
        message("pose", utime_us=0, robot_id=7, valid=True, position_m=[1e300, 0.0, 0.0]),
        message("pose", utime_us=1, robot_id=7, valid=True, orientation_wxyz=[1e200, 0, 0, 0]),
        message("pose", utime_us=2, robot_id=7, valid=True, orientation_wxyz=[1.0, 0, 0, 0]),
    ]
    log = read_log(write_log(*[("R07_POSE", pose) for pose in poses]))
    assert log.robots[7].valid.tolist() == [False, False, True]
    assert any("2 poses marked valid without position" in w for w in log.warnings)


def test_many_messages_of_another_type_are_no_damage(hundred):
    _damaged(hundred, "R07_POSE", set(range(0, 100, 10)), 3)
    with pytest.raises(LogError, match=r"R07_POSE.*other message types"):
        read_log(hundred)
    with pytest.raises(LogError, match=r"R07_POSE.*damaged"):
        read_recording(hundred)


def test_what_a_robot_said_of_itself_before_stands_for_a_damaged_last_word(write_log, message):
    said = [("R07_RUN", message("run", robot_id=7, behavior=name)) for name in ("first", "last")]
    pose = ("R07_POSE", message("pose", robot_id=7, position_m=[0.0, 0.0, 0.0]))
    log = read_log(_damaged(write_log(pose, *said), "R07_RUN", {1}, 2))
    assert log.robots[7].behavior == "first"
    assert "R07_RUN: 1 of 2 messages are damaged; left out." in log.warnings


def test_log_without_robots_is_refused(write_log, message):
    with pytest.raises(LogError, match=r"R<nn>.*SWARM_COMMAND"):
        read_log(write_log(("SWARM_COMMAND", message("swarm_command"))))


def test_twin_prefix_is_found_and_truth_never_read(write_log, message):
    events = [(f"TWIN_{channel}", m) for channel, m in drive_and_pose(message)]
    log = read_log(write_log(*events, ("TWIN_TRUTH_R07", b"anything"), ("CAMERA", b"x")))
    assert len(log.robots[7].pose_t_s) == 3
    assert any("TWIN_" in w for w in log.warnings)
    assert any("CAMERA" in w and "TRUTH" not in w for w in log.warnings)


def test_disordered_and_repeated_stamps_are_sorted_and_the_last_kept(write_log, message):
    events = [
        ("R07_POSE", message("pose", utime_us=t, robot_id=7, position_m=[x, 0.0, 0.0]))
        for t, x in [(30, 3.0), (10, 1.0), (20, 2.0), (20, 2.5)]
    ]
    log = read_log(write_log(*events))
    np.testing.assert_array_equal(log.robots[7].pose[:, 0], [1, 2.5, 3])
    np.testing.assert_allclose(log.robots[7].pose_t_s, [0, 10e-6, 20e-6])
    assert any("sorted" in w for w in log.warnings) and any("repeat" in w for w in log.warnings)


def test_duties_beyond_full_are_clamped_and_told(write_log, message):
    path = write_log(
        ("R07_TELEMETRY", message("telemetry", robot_id=7, wheel_duty_pct=[-128, 50, 101, 100]))
    )
    log = read_log(path)
    np.testing.assert_array_equal(log.robots[7].command, [[-1, 0.5, 1, 1]])
    assert any("1 command has a duty outside" in w for w in log.warnings)
    assert any("no poses" in w for w in log.warnings)


def test_kinds_of_drive_must_not_mix(write_log, message):
    path = write_log(
        ("R07_DRIVE", message("drive", robot_id=7, kind=1)),
        ("R07_DRIVE", message("drive", robot_id=7, kind=2, utime_us=1)),
    )
    with pytest.raises(LogError, match="kinds 1, 2"):
        read_log(path)


def test_what_drove_a_robot_stands_beside_what_its_camera_saw(write_log, message):
    """As a twin says that is told velocities: its firmware's duties drove nothing."""
    telemetry = [
        (
            "R07_TELEMETRY",
            message("telemetry", robot_id=7, utime_us=t, detected=t // 10, battery_V=8.0),
        )
        for t in (10, 20, 30)
    ]
    drive = [
        ("R07_DRIVE", message("drive", robot_id=7, utime_us=t, kind=2, value=[t / 100, 0, -1.0, 0]))
        for t in (20, 30, 40)
    ]
    log = read_log(write_log(*telemetry, *drive))
    robot = log.robots[7]
    assert robot.command_kind == "twist" and robot.command[:, 0].tolist() == [0.2, 0.3]
    np.testing.assert_allclose(robot.command_t_s, [0, 10e-6])
    assert robot.detected.tolist() == [2, 3] and robot.battery_V.tolist() == [8, 8]
    assert any("2 messages of telemetry or drive" in w for w in log.warnings)

    log = read_log(write_log(*telemetry, *drive[2:]))
    assert log.robots[7].command_kind == "duty" and len(log.robots[7].command) == 3
    assert any("telemetry was used" in w for w in log.warnings)


def test_valid_pose_without_unit_quaternion_is_lost(write_log, message):
    path = write_log(
        ("R07_POSE", message("pose", robot_id=7, orientation_wxyz=[0.0] * 4)),
        ("R07_POSE", message("pose", robot_id=7, utime_us=9)),
    )
    log = read_log(path)
    assert log.robots[7].valid.tolist() == [False, True]
    assert np.isnan(log.robots[7].pose[0]).all()
    assert any("1 pose marked valid" in w for w in log.warnings)


@pytest.mark.parametrize("name", ["telemetry_t", "pose_t", "drive_t", "truth_t"])
def test_layouts_are_those_that_lcm_writes(name):
    kind = getattr(turbopi, name)
    message = kind()
    for k, field in enumerate(kind.__slots__):
        value = getattr(message, field)
        setattr(message, field, [k] * len(value) if isinstance(value, list) else k)
    (row,) = decode([message.encode()], kind, "R01")
    assert row.dtype.names[1:] == tuple(kind.__slots__)
    for k, field in enumerate(kind.__slots__):
        assert np.all(row[field] == k), field


def test_a_log_of_detections_alone_says_what_it_lacks(write_log, message):
    path = write_log(("R07_DETECTION", message("detection", robot_id=7)))
    with pytest.raises(LogError, match=r"what cameras saw.*import the poses and commands"):
        read_log(path)
