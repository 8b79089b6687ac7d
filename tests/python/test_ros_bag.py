# SPDX-License-Identifier: Apache-2.0
"""ROS bags written by the library rosbags are read without ROS; broken ones are one sentence."""

import json
import math
import shlex
import sqlite3
import struct
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.importers.ros_bag import (
    BagOptions,
    Topic,
    _rows,
    guess_pairs,
    list_topics,
    numbering,
)
from twinmill.data.importers.ros_messages import (
    COMMANDS,
    joints_as_they_stand,
    joints_beside_wheels,
)
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import app

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
START_S = 1_700_000_000


def _bag(path, storage, robots=("r03",)):
    """Robots that drive a circle of 0.5 m at 0.5 rad/s; receipt is 10 ms after the header."""
    vector, zero = T["geometry_msgs/msg/Vector3"], T["geometry_msgs/msg/Vector3"](x=0, y=0, z=0)
    with Writer(path, version=9, storage_plugin=storage) as writer:
        for robot in robots:
            pose_kind, twist_kind = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/Twist"
            poses = writer.add_connection(f"/{robot}/pose", pose_kind, typestore=STORE)
            commands = writer.add_connection(f"/{robot}/cmd_vel", twist_kind, typestore=STORE)
            for k in range(200):
                t = k * 0.05
                angle = 0.5 * t
                stamp = T["builtin_interfaces/msg/Time"](
                    sec=START_S + int(t), nanosec=round((t % 1) * 1e9)
                )
                message = T[pose_kind](
                    header=T["std_msgs/msg/Header"](stamp=stamp, frame_id="world"),
                    pose=T["geometry_msgs/msg/Pose"](
                        position=T["geometry_msgs/msg/Point"](
                            x=0.5 * math.sin(angle), y=0.5 - 0.5 * math.cos(angle), z=0.1
                        ),
                        orientation=T["geometry_msgs/msg/Quaternion"](
                            x=0, y=0, z=math.sin(angle / 2), w=math.cos(angle / 2)
                        ),
                    ),
                )
                received_ns = START_S * 10**9 + round(t * 1e9) + 10_000_000
                writer.write(poses, received_ns, STORE.serialize_cdr(message, pose_kind))
                twist = T[twist_kind](
                    linear=vector(x=0.25, y=0, z=0), angular=vector(x=zero.x, y=0, z=0.5)
                )
                writer.write(commands, received_ns, STORE.serialize_cdr(twist, twist_kind))
    return path


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_poses_and_commands_come_back_as_written(tmp_path, storage):
    bag = _bag(tmp_path / "bag", storage)
    out = tmp_path / "o.lcmlog"
    options = ImportOptions(pose_topics=("/r03/pose",), command_topics=("/r03/cmd_vel",))
    summary = import_log(None, None, out, bag=bag, options=options)
    robot = read_log(out).robots[3]
    t_s = np.arange(200) * 0.05
    np.testing.assert_allclose(robot.pose_t_s, t_s, atol=2e-6)
    np.testing.assert_allclose(robot.command_t_s, t_s + 0.01, atol=2e-6)
    np.testing.assert_allclose(robot.pose[:, 2], 0.5 * t_s, atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 0], 0.5 * np.sin(0.5 * t_s), atol=1e-9)
    np.testing.assert_allclose(robot.command, np.tile([0.25, 0, 0.5, 0], (200, 1)))
    assert any("10.0 ms after their header stamps" in w for w in summary["warnings"])
    assert any("/r03/cmd_vel: has no header stamps" in w for w in summary["warnings"])


def test_a_bag_is_listed_and_pairs_are_guessed_by_namespace(tmp_path):
    bag = _bag(tmp_path / "bag", StoragePlugin.SQLITE3, ("r03", "r11"))
    topics = list_topics(bag)
    assert [(t.name, t.count) for t in topics if t.role == "pose"] == [
        ("/r03/pose", 200),
        ("/r11/pose", 200),
    ]
    assert guess_pairs(topics) == [("/r03/pose", "/r03/cmd_vel"), ("/r11/pose", "/r11/cmd_vel")]
    result = CliRunner().invoke(app, ["import", "--bag", str(bag), "--json"])
    assert result.exit_code == 0, result.output
    command = json.loads(result.output)["command"]
    assert "--pose /r11/pose --command /r11/cmd_vel" in command


def test_motion_capture_is_suggested_before_odometry_of_the_same_bag(tmp_path):
    """A robot's /odom stands beside a tracker's /mocap/pose and a goal, all in a bag of rosbags."""
    identity = T["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1)
    counts = {"/odom": 6, "/mocap/pose": 20, "/goal_pose": 30, "/cmd_vel": 20}
    kinds = dict.fromkeys(counts, "geometry_msgs/msg/PoseStamped")
    kinds |= {"/odom": "nav_msgs/msg/Odometry", "/cmd_vel": "geometry_msgs/msg/Twist"}
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, count in counts.items():
            kind = kinds[topic]
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for k in range(count):
                at_ns = START_S * 10**9 + k * 10**8
                stamp = T["builtin_interfaces/msg/Time"](*divmod(at_ns, 10**9))
                header = T["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
                place = T["geometry_msgs/msg/Point"](x=0.1 * k, y=0, z=0)
                pose = T["geometry_msgs/msg/Pose"](position=place, orientation=identity)
                zero = T["geometry_msgs/msg/Vector3"](x=0, y=0, z=0)
                twist = T["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
                covered = T["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
                told = T["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
                message = {
                    "/odom": lambda h=header, p=covered, t=told: T[kinds["/odom"]](h, "base", p, t),
                    "/cmd_vel": lambda t=twist: t,
                }.get(topic, lambda h=header, p=pose: T[kinds["/mocap/pose"]](h, p))()
                writer.write(connection, at_ns, STORE.serialize_cdr(message, kind))
    result = CliRunner().invoke(app, ["import", "--bag", str(tmp_path / "bag"), "--json"])
    assert result.exit_code == 0, result.output
    command = json.loads(result.output)["command"]
    assert "--pose /mocap/pose --command /cmd_vel --robot-id 1" in command
    for name in ("/mocap/pose", "/mocap"):
        out = tmp_path / f"{len(name)}.lcmlog"
        options = ImportOptions(robot_id=1, pose_topics=(name,), command_topics=("/cmd_vel",))
        import_log(None, None, out, bag=tmp_path / "bag", options=options)
        np.testing.assert_allclose(read_log(out).robots[1].pose[:, 0], 0.1 * np.arange(20))


@pytest.mark.parametrize(
    ("poses", "best"),
    [
        ({"/r1/odom": "nav_msgs/msg/Odometry", "/vicon/r1/r1": "TransformStamped"}, "/vicon/r1/r1"),
        ({"/r1/odom": "nav_msgs/msg/Odometry", "/amcl_pose": "PoseWithCovarianceStamped"},
         "/amcl_pose"),
        ({"/r1/odom": "nav_msgs/msg/Odometry", "/r2/pose": "PoseStamped"}, "/r1/odom"),
        ({"/r1/odom": "nav_msgs/msg/Odometry", "/r1/goal": "PoseStamped"}, "/r1/odom"),
    ],
    ids=["a tracker", "an estimate", "another robot", "a goal"],
)  # fmt: skip
def test_poses_are_suggested_by_type_and_name_odometry_last(poses, best):
    topics = [Topic("/r1/cmd_vel", "geometry_msgs/msg/Twist", 100, "command")]
    for name, kind in poses.items():
        kind = kind if "/" in kind else f"geometry_msgs/msg/{kind}"
        topics.append(Topic(name, kind, 1000 if "odom" in name else 100, "pose"))
    assert guess_pairs(topics) == [(best, "/r1/cmd_vel")]


def test_odometry_is_said_and_what_others_measured_is_guessed_before_it(tmp_path):
    """A robot counts its wheels 100 times a second; a camera sees it 20 times."""
    bag = _bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    topics = [*list_topics(bag), Topic("/r03/odom", "nav_msgs/msg/Odometry", 1000, "pose")]
    assert guess_pairs(topics) == [("/r03/pose", "/r03/cmd_vel")]
    stamped = Topic("/r03/reference", "geometry_msgs/msg/TwistStamped", 200, "command")
    assert guess_pairs([*topics, stamped]) == [("/r03/pose", "/r03/reference")]
    with Writer(tmp_path / "odom", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {"/odom": "nav_msgs/msg/Odometry", "/cmd_vel": "geometry_msgs/msg/Twist"}
        of = {t: writer.add_connection(t, kind, typestore=STORE) for t, kind in kinds.items()}
        for k in range(5):
            stamp = T["builtin_interfaces/msg/Time"](sec=START_S + k, nanosec=0)
            zero = T["geometry_msgs/msg/Vector3"](x=0, y=0, z=0)
            twist = T["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
            message = T["nav_msgs/msg/Odometry"](
                header=T["std_msgs/msg/Header"](stamp=stamp, frame_id="odom"),
                child_frame_id="base_link",
                pose=T["geometry_msgs/msg/PoseWithCovariance"](
                    pose=T["geometry_msgs/msg/Pose"](
                        position=T["geometry_msgs/msg/Point"](x=0.1 * k, y=0, z=0),
                        orientation=T["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1),
                    ),
                    covariance=np.zeros(36),
                ),
                twist=T["geometry_msgs/msg/TwistWithCovariance"](
                    twist=twist, covariance=np.zeros(36)
                ),
            )
            at_ns = (START_S + k) * 10**9
            writer.write(of["/odom"], at_ns, STORE.serialize_cdr(message, kinds["/odom"]))
            writer.write(of["/cmd_vel"], at_ns, STORE.serialize_cdr(twist, kinds["/cmd_vel"]))
    _, warnings = _import(tmp_path / "odom", ("/odom", "/cmd_vel"), robot_id=1)
    assert "/odom: is odometry" in warnings


def test_what_is_no_bag_or_a_broken_one_is_one_sentence(tmp_path):
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(50))
    for name in ("x.bag", "x.mcap", "gone"):
        with pytest.raises(LogError, match="cannot be read as a ROS bag"):
            list_topics(tmp_path / name)


def test_an_mcap_file_of_another_kind_is_told_by_its_profile(tmp_path):
    """As written by MCAP's own library; `mcap recover` would not help."""
    from mcap.writer import Writer

    with (tmp_path / "x.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="protobuf")
        writer.finish()
    with pytest.raises(LogError, match=r"its profile is 'protobuf', so .* not of ROS 2") as raised:
        list_topics(tmp_path / "x.mcap")
    assert "recover" not in str(raised.value)


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path):
    bag = _bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    options = ImportOptions(pose_topics=("/r03/odom",), command_topics=("/r03/cmd_vel",))
    with pytest.raises(LogError, match=r"no topic /r03/odom; it has /r03/cmd_vel, /r03/pose"):
        import_log(None, None, tmp_path / "o.lcmlog", bag=bag, options=options)
    assert not (tmp_path / "o.lcmlog").exists()


def _written(path, *topics, chunk_bytes=2000, compression=CompressionType.NONE):
    """An MCAP file of the package mcap, with messages packed by hand as CDR (OMG DDS-XTypes).

    Each topic: its name, type, definition, and rows of (time of receipt in s, payload).
    """
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=chunk_bytes, compression=compression)
        writer.start(profile="ros2", library="test")
        for topic, kind, definition, rows in topics:
            schema = writer.register_schema(kind, "ros2msg", definition.encode())
            channel = writer.register_channel(topic, "cdr", schema)
            for t_s, payload in rows:
                t_ns = round(t_s * 1e9)
                writer.add_message(channel, t_ns, b"\x00\x01\x00\x00" + payload, t_ns)
        writer.finish()
    return path


HEADER = (
    "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80 + "\n"
    "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
TURN = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
LINE = "=" * 80 + "\n"
POSE_TYPE = (
    "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
    + LINE
    + HEADER
    + LINE
    + "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\n"
    "geometry_msgs/Quaternion orientation\n"
    + LINE
    + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + LINE
    + TURN
)
TWIST_TYPE = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n" + LINE + VECTOR
TF_TYPE = (
    "geometry_msgs/TransformStamped[] transforms\n"
    + LINE
    + "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/Transform transform\n"
    + LINE
    + HEADER
    + LINE
    + "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\n"
    "geometry_msgs/Quaternion rotation\n" + LINE + VECTOR + LINE + TURN
)
DUTY_TYPE = (
    "std_msgs/MultiArrayLayout layout\nfloat64[] data\n"
    + LINE
    + "MSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"
    + LINE
    + "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n"
)
JOINTS_TYPE = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort\n" + LINE + HEADER
)
STEERED_TYPE = (
    "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
    "float32 acceleration\nfloat32 jerk\n"
)


def _aligned(data, size):
    return data + bytes(-len(data) % size)


def _text(data, text):
    return _aligned(data, 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"


def _stamp(t_s):
    return struct.pack("<iI", int(t_s), round((t_s % 1) * 1e9))


def _header(t_s):
    return _text(_stamp(t_s), "world")


def _floats(data, values):
    return _aligned(data + struct.pack("<I", len(values)), 8) + struct.pack(
        f"<{len(values)}d", *values
    )


def _pose(t_s, x, angle=0.0):
    return _aligned(_header(t_s), 8) + struct.pack(
        "<7d", x, 0, 0, 0, 0, math.sin(angle / 2), math.cos(angle / 2)
    )


def _transforms(t_s, *transforms):
    data = struct.pack("<I", len(transforms))
    for parent, child, x, y, angle in transforms:
        data = _text(_text(data + _stamp(t_s), parent), child)
        turn = (0, 0, math.sin(angle / 2), math.cos(angle / 2))
        data = _aligned(data, 8) + struct.pack("<7d", x, y, 0, *turn)
    return data


TIMES_S = [0.1 * k for k in range(60)]


def _poses(topic="/pose", stamp_of=lambda k, t_s: START_S + t_s):
    rows = [(START_S + t, _pose(stamp_of(k, t), 0.1 * t)) for k, t in enumerate(TIMES_S)]
    return topic, "geometry_msgs/msg/PoseStamped", POSE_TYPE, rows


def _twists(topic="/cmd_vel"):
    rows = [(START_S + t, struct.pack("<6d", 0.1, 0, 0, 0, 0, 0)) for t in TIMES_S]
    return topic, "geometry_msgs/msg/Twist", TWIST_TYPE, rows


def _duties(values):
    data = _floats(struct.pack("<II", 0, 0), values)
    rows = [(START_S + t, data) for t in TIMES_S]
    return "/r1/duty", "std_msgs/msg/Float64MultiArray", DUTY_TYPE, rows


def _import(bag, *pairs, **options):
    out = bag.parent / "o.lcmlog"
    out.unlink(missing_ok=True)
    poses, commands = zip(*(pairs or [("/pose", "/cmd_vel")]), strict=True)
    options = ImportOptions(pose_topics=poses, command_topics=commands, **options)
    summary = import_log(None, None, out, bag=bag, options=options)
    return read_log(out).robots, " ".join(summary["warnings"])


def _printed(bag):
    """Runs the command that the list of a bag prints; the robots of the log."""
    result = CliRunner().invoke(app, ["import", "--bag", str(bag), "--json"])
    assert result.exit_code == 0, result.output
    words = shlex.split(json.loads(result.output)["command"])
    out = bag.parent / f"{bag.stem}.lcmlog"
    result = CliRunner().invoke(app, [*words[1:-1], str(out)])
    assert result.exit_code == 0, result.output
    return read_log(out).robots


def test_the_printed_command_runs_as_printed(tmp_path):
    bag = _written(tmp_path / "root.mcap", _poses(), _twists())
    assert list(_printed(bag)) == [1]
    names = [
        part for n in ("alice", "bob") for part in (_poses(f"/{n}/pose"), _twists(f"/{n}/cmd"))
    ]
    assert sorted(_printed(_written(tmp_path / "names.mcap", *names))) == [1, 2]
    pairs = [("/r2/pose", "/r2/cmd"), ("/bob/pose", "/bob/cmd"), ("/r1/pose", "/r1/cmd")]
    assert numbering(pairs) == {"robot": {"bob": 3}}


def test_a_robot_has_the_number_of_its_name(tmp_path):
    names = [
        part for n in ("alice", "bob") for part in (_poses(f"/{n}/pose"), _twists(f"/{n}/cmd"))
    ]
    bag = _written(tmp_path / "names.mcap", *names)
    pairs = [(f"/{n}/pose", f"/{n}/cmd") for n in ("alice", "bob")]
    with pytest.raises(LogError, match=r"robot=\{'alice': 1\}"):
        _import(bag, *pairs)
    assert sorted(_import(bag, *pairs, robots={"alice": 4, "bob": 9})[0]) == [4, 9]


def test_topics_of_other_numbers_are_said(tmp_path):
    bag = _written(
        tmp_path / "two.mcap", _poses("/r1/pose"), _twists("/r2/cmd"), _twists("/r1/cmd")
    )
    robots, warnings = _import(bag, ("/r1/pose", "/r2/cmd"))
    assert list(robots) == [2] and "/r1/pose and /r2/cmd are taken for robot 2." in warnings
    assert "are taken for robot" not in _import(bag, ("/r1/pose", "/r1/cmd"))[1]


def test_a_clock_that_is_set_back_is_refused_with_the_remedy(tmp_path):
    jump = _poses(stamp_of=lambda k, t: START_S + t - (5 if k >= 30 else 0))
    bag = _written(tmp_path / "jump.mcap", jump, _twists())
    with pytest.raises(LogError, match=r"go back by 4\.900 s at message 31: .*receive_stamps=True"):
        _import(bag, robot_id=1)
    robots, _ = _import(bag, robot_id=1, receive_stamps=True)
    np.testing.assert_allclose(robots[1].pose_t_s, TIMES_S, atol=2e-6)


def test_messages_that_are_exchanged_are_sorted_and_that_is_said(tmp_path):
    swapped = _poses(stamp_of=lambda k, t: START_S + TIMES_S[k ^ 1 if k < 20 else k])
    robots, warnings = _import(_written(tmp_path / "x.mcap", swapped, _twists()), robot_id=1)
    assert len(robots[1].pose_t_s) == 60
    assert "/pose: 10 messages earlier than the one before; sorted." in warnings


def test_a_clock_that_began_at_zero_is_refused_with_the_remedy(tmp_path):
    bag = _written(tmp_path / "sim.mcap", _poses(stamp_of=lambda k, t: t), _twists())
    with pytest.raises(LogError, match=r"do not overlap; .*receive_stamps=True"):
        _import(bag, robot_id=1)
    robots, _ = _import(bag, robot_id=1, receive_stamps=True)
    np.testing.assert_allclose(robots[1].pose_t_s, TIMES_S, atol=2e-6)


def test_what_came_before_a_simulated_clock_is_left_out_and_that_is_said(tmp_path):
    """A recorder with use_sim_time takes time 0 for what it hears before the first /clock."""
    topic, kind, definition, rows = _twists()
    early = [(0.0 if k < 4 else t_s, payload) for k, (t_s, payload) in enumerate(rows)]
    bag = _written(tmp_path / "sim.mcap", _poses(), (topic, kind, definition, early))
    robots, said = _import(bag, robot_id=1)
    assert "/cmd_vel: 4 messages received at time 0" in said
    np.testing.assert_allclose(robots[1].command_t_s, TIMES_S[4:], atol=2e-6)
    np.testing.assert_allclose(robots[1].pose_t_s, TIMES_S, atol=2e-6)


def test_a_frame_of_tf_is_placed_in_the_root_of_its_tree(tmp_path):
    """From map to odom: 1 m along x, a quarter turn to the left; so x in odom is y in map."""
    rows = [(START_S - 1, _transforms(START_S - 1, ("map", "odom", 1, 0, math.pi / 2)))]
    rows += [
        (START_S + t, _transforms(START_S + t, ("odom", "base_link", 0.1 * t, 0.5, 0.2)))
        for t in TIMES_S
    ]
    tree = ("/tf", "tf2_msgs/msg/TFMessage", TF_TYPE, rows)
    bag = _written(tmp_path / "tf.mcap", tree, _twists())
    robot = _printed(bag)[1]
    np.testing.assert_allclose(robot.pose[:, 0], 0.5, atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 1], [0.1 * t for t in TIMES_S], atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 2], math.pi / 2 + 0.2, atol=1e-9)
    with pytest.raises(LogError, match=r"name one as /tf:FRAME"):
        _import(bag, ("/tf", "/cmd_vel"), robot_id=1)


def test_a_frame_that_is_fixed_to_one_that_moves_is_placed_with_it(tmp_path):
    """A marker sits 0.1 m ahead and 0.2 m left of the robot's middle, turned a quarter to the left.

    So the middle is at (-0.2, 0.1) of the marker, turned a quarter to the right.
    """
    marker = [
        (START_S + t, _transforms(START_S + t, ("world", "marker", 0.1 * t, 0.5, 0.2)))
        for t in TIMES_S
    ]
    fixed = _transforms(
        START_S,
        ("marker", "base_link", -0.2, 0.1, -math.pi / 2),
        ("base_link", "base_camera", 0.05, 0, 0),
        ("world", "corner", 1, 1, 0),
    )
    bag = _written(
        tmp_path / "tf.mcap",
        ("/tf", "tf2_msgs/msg/TFMessage", TF_TYPE, marker),
        ("/tf_static", "tf2_msgs/msg/TFMessage", TF_TYPE, [(START_S - 1, fixed)]),
        _twists(),
    )
    names = {t.name for t in list_topics(bag)}
    assert {"/tf:marker", "/tf:base_link", "/tf:base_camera"} < names
    assert "/tf:corner" not in names
    robot = _printed(bag)[1]
    cos, sin = math.cos(0.2), math.sin(0.2)
    x_m = np.array([0.1 * t for t in TIMES_S]) - 0.2 * cos - 0.1 * sin
    np.testing.assert_allclose(robot.pose[:, 0], x_m, atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 1], 0.5 - 0.2 * sin + 0.1 * cos, atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 2], 0.2 - math.pi / 2, atol=1e-9)
    with pytest.raises(LogError, match=r"does not move; .* name it as /tf:base_link"):
        _import(bag, ("/tf_static:base_link", "/cmd_vel"), robot_id=1)


def test_steering_angles_need_the_wheelbase(tmp_path):
    payload = struct.pack("<5f", 0.25, 0, 0.5, 0, 0)
    rows = [(START_S + t, payload) for t in TIMES_S]
    steered = ("/r1/drive", "ackermann_msgs/msg/AckermannDrive", STEERED_TYPE, rows)
    bag = _written(tmp_path / "car.mcap", _poses("/r1/pose"), steered)
    with pytest.raises(LogError, match="wheelbase_m"):
        _import(bag, ("/r1/pose", "/r1/drive"))
    robots, _ = _import(bag, ("/r1/pose", "/r1/drive"), wheelbase_m=0.3)
    np.testing.assert_allclose(robots[1].command[0], [0.5, 0, 0.5 * math.tan(0.25) / 0.3, 0])


@pytest.mark.parametrize(
    ("values", "full", "expected"),
    [
        ([0.5, -1, 0.5, -1], None, [0.5, -1, 0.5, -1]),
        ([50, 20, 50, 20], None, [0.5, 0.2, 0.5, 0.2]),
        ([204, -51], None, [0.8, -0.2, 0.8, -0.2]),
        ([50, 20], 200.0, [0.25, 0.1, 0.25, 0.1]),
        ([500, 1000], 1000.0, [0.5, 1, 0.5, 1]),
        ([500, 1000], None, None),
    ],
)
def test_what_full_duty_is_in_a_bag(tmp_path, values, full, expected):
    bag = _written(tmp_path / "d.mcap", _poses("/r1/pose"), _duties(values))
    pair = ("/r1/pose", "/r1/duty")
    if expected is None:
        with pytest.raises(LogError, match=r"/r1/duty: duties go to 1000.*full_duty"):
            _import(bag, pair)
        return
    robots, warnings = _import(bag, pair, full_duty=full)
    np.testing.assert_allclose(robots[1].command[-1], expected, atol=1e-7)
    assert ("is taken for full duty" in warnings) == (full is None and values[0] != 50)


def test_wheels_are_taken_by_the_names_of_their_joints(tmp_path):
    names = ["arm", "rear_right_wheel", "rear_left_wheel", "front_right_wheel", "front_left_wheel"]
    data = _aligned(_header(START_S), 4) + struct.pack("<I", 5)
    for name in names:
        data = _text(data, name)
    data = _aligned(data, 4) + struct.pack("<I", 0)
    data = _floats(data, [9.0, 4.0, 3.0, 2.0, 1.0])
    rows = [(START_S + t, data + struct.pack("<I", 0)) for t in TIMES_S]
    joints = ("/r1/wheels", "sensor_msgs/msg/JointState", JOINTS_TYPE, rows)
    bag = _written(tmp_path / "j.mcap", _poses("/r1/pose"), joints)
    robots, warnings = _import(bag, ("/r1/pose", "/r1/wheels"), receive_stamps=True)
    np.testing.assert_allclose(robots[1].command[-1], [1, 2, 3, 4])
    assert "/r1/wheels: joints that are called wheels are taken, not arm." in warnings


@pytest.mark.parametrize(
    ("compression", "chunk_bytes"),
    [*((kind, 2000) for kind in CompressionType), (CompressionType.NONE, 10**6)],
)
def test_a_bag_that_was_cut_off_is_read_to_there_and_that_is_said(
    tmp_path, compression, chunk_bytes
):
    rng = np.random.default_rng(2)  # what cannot be packed small
    poses = _poses()
    poses = (
        *poses[:3],
        [(t, _pose(t, x)) for (t, _), x in zip(poses[3], rng.random(60), strict=True)],
    )
    twists = [(t, struct.pack("<6d", *rng.random(6))) for t, _ in _twists()[3]]
    how = {"chunk_bytes": chunk_bytes, "compression": compression}
    whole = _written(tmp_path / "whole.mcap", poses, (*_twists()[:3], twists), **how).read_bytes()
    bag = tmp_path / "cut.mcap"
    bag.write_bytes(whole[: len(whole) * 6 // 10])
    assert [t.name for t in list_topics(bag)] == ["/cmd_vel", "/pose"]
    robots, warnings = _import(bag, robot_id=1)
    assert "cut.mcap: was cut off; what is before the break is read." in warnings
    assert len(robots[1].pose_t_s) == 60 and 0 < len(robots[1].command_t_s) < 60


def test_a_bag_without_its_metadata_is_read_and_an_empty_one_is_an_error(tmp_path):
    bag = _bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    (bag / "metadata.yaml").unlink()
    robots, warnings = _import(bag, ("/r03/pose", "/r03/cmd_vel"))
    assert len(robots[3].pose_t_s) == 200 and "has no metadata.yaml" in warnings
    with pytest.raises(LogError, match="has no messages"):
        list_topics(_written(tmp_path / "empty.mcap"))
    (tmp_path / "folder").mkdir()
    with pytest.raises(LogError, match=r"without metadata\.yaml and with 0 files"):
        list_topics(tmp_path / "folder")


def test_a_bag_of_another_writer_is_read(tmp_path):
    """Packed by hand as CDR (OMG DDS-XTypes), in a file of the package mcap, without metadata."""
    definition = (
        "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n" + "=" * 80 + "\n"
        "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    )
    with (tmp_path / "run.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(
            name="geometry_msgs/msg/Twist", encoding="ros2msg", data=definition.encode()
        )
        channel = writer.register_channel(
            topic="/r05/cmd_vel", message_encoding="cdr", schema_id=schema
        )
        for k in range(20):
            data = b"\x00\x01\x00\x00" + struct.pack("<6d", 0.1 * k, 0, 0, 0, 0, -0.5)
            writer.add_message(channel_id=channel, log_time=10**9 * k, publish_time=0, data=data)
        writer.finish()
    topic = "/r05/cmd_vel"
    rows = _rows(tmp_path / "run.mcap", [(topic, "command")], BagOptions())[topic, "command"]
    kind, utime_us, values = rows.kind, rows.utime_us, rows.value.tolist()
    assert kind == "geometry_msgs/msg/Twist"
    np.testing.assert_array_equal(utime_us, np.arange(20) * 10**6)
    np.testing.assert_allclose(values, [(0.1 * k, 0, -0.5, 0) for k in range(20)])


def test_a_topic_of_a_type_that_cannot_be_parsed_spoils_no_other(tmp_path):
    """As the events of services are, which `ros2 bag record --all` puts beside the topics."""
    event = ("/add/_service_event", "example_interfaces/srv/Add_Event", "MSG: a/b\nint64 a\n", [])
    bag = _written(tmp_path / "run.mcap", event, _poses(), _twists())
    assert [t.name for t in list_topics(bag)] == ["/cmd_vel", "/pose"]
    assert len(_import(bag, robot_id=1)[0][1].pose_t_s) == 60


@pytest.mark.parametrize("kind", ["mcap", "db3"])
def test_whatever_bytes_are_wrong_it_is_one_sentence_or_read(tmp_path, kind):
    if kind == "mcap":
        bag = _written(tmp_path / "whole.mcap", _poses(), _twists())
    else:
        (bag,) = _bag(tmp_path / "bag", StoragePlugin.SQLITE3).glob("*.db3")
    whole, random, refused = bag.read_bytes(), np.random.default_rng(8), 0
    bad = tmp_path / f"bad.{kind}"
    for trial in range(40):
        data = np.frombuffer(whole, np.uint8).copy()
        places = random.integers(0, len(data), (1, 4, 100)[trial % 3])
        data[places] = random.integers(0, 256, len(places))
        end = random.integers(0, len(data)) if trial % 4 == 0 else len(data)
        bad.write_bytes(data[:end].tobytes())
        try:
            topics = [(t.name, t.role) for t in list_topics(bad) if t.role]
            if topics:
                _rows(bad, topics, BagOptions())
        except LogError as error:
            refused += 1
            assert "\n" not in str(error) and len(str(error)) < 700
    assert 0 < refused < 40


def test_a_folder_of_rosbag2_may_end_in_bag(tmp_path):
    _bag(tmp_path / "run.bag", StoragePlugin.MCAP)
    assert {topic.name for topic in list_topics(tmp_path / "run.bag")} == {
        "/r03/pose",
        "/r03/cmd_vel",
    }


PEAK = """
import resource, sys
from pathlib import Path
from twinmill.data.importers.import_log import ImportOptions, import_log
options = ImportOptions(pose_topics=("/r03/pose",), command_topics=("/r03/cmd_vel",))
import_log(None, None, Path(sys.argv[2]), bag=Path(sys.argv[1]), options=options)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
PICTURE_BYTES = 2_000_000


def test_frames_of_a_long_bag_are_counted_as_about_so_many(tmp_path, monkeypatch):
    """It had listed as many as were looked at, and no word of the others."""
    rows = [
        (START_S + t, _transforms(START_S + t, ("odom", "base_link", 0.1 * t, 0.5, 0.2)))
        for t in TIMES_S
    ]
    tree = ("/tf", "tf2_msgs/msg/TFMessage", TF_TYPE, rows)
    bag = _written(tmp_path / "tf.mcap", tree, _twists())
    for looked_at in (20, 1000):
        monkeypatch.setattr("twinmill.data.importers.ros_bag.LOOKED_AT", looked_at)
        frames = [(t.count, t.about) for t in list_topics(bag) if ":" in t.name]
        assert frames == [(len(TIMES_S), looked_at < len(TIMES_S))]


def _with_pictures(path, pictures):
    """A bag with a camera's topic, as the largest ones are: written between the others."""
    image = T["sensor_msgs/msg/Image"]
    header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](START_S, 0), "camera")
    data = np.random.default_rng(1).integers(0, 255, PICTURE_BYTES, np.uint8)
    raw = STORE.serialize_cdr(image(header, 1000, 2000, "mono8", 0, 2000, data), image.__msgtype__)
    _bag(path, StoragePlugin.SQLITE3)
    with sqlite3.connect(next(path.glob("*.db3"))) as base:
        kind = ("sensor_msgs/msg/Image", "cdr", "", "")
        base.execute("insert into topics values (9, '/camera', ?, ?, ?, ?)", kind)
        stamps = ((9, START_S * 10**9 + k, raw) for k in range(pictures))
        base.executemany(
            "insert into messages (topic_id, timestamp, data) values (?, ?, ?)", stamps
        )
    return path


def test_memory_does_not_grow_with_the_length_of_a_bag(tmp_path):
    """Twenty megabytes more of pictures; the system's own count of the most that was held."""
    peak_bytes = []
    for pictures in (1, 11):
        bag = _with_pictures(tmp_path / f"bag{pictures}", pictures)
        command = [sys.executable, "-c", PEAK, bag, tmp_path / f"{pictures}.lcmlog"]
        peak_bytes.append(1024 * int(subprocess.check_output(command, text=True)))
    assert peak_bytes[1] - peak_bytes[0] < 3 * PICTURE_BYTES
    assert len(read_log(tmp_path / "11.lcmlog").robots[3].pose) == 200


def test_joints_beside_the_wheels_are_none():
    """An arm's joint came first, and was taken for the first wheel."""
    _, row_of = COMMANDS["sensor_msgs/msg/JointState"]
    arm = SimpleNamespace(
        name=["arm", "right_wheel_joint", "left_wheel_joint"], velocity=[0.5, 2.0, 1.0]
    )
    assert row_of(arm) == (1.0, 2.0)
    assert joints_beside_wheels(arm) == ["arm"]
    unnamed = SimpleNamespace(name=["a", "b"], velocity=[3.0, 4.0])
    assert row_of(unnamed) == (3.0, 4.0)
    assert joints_beside_wheels(unnamed) == []


@pytest.mark.parametrize(
    ("names", "speeds", "wheels", "beside", "unordered"),
    [
        (["RightWheel", "LeftWheel"], [2.0, 1.0], (1.0, 2.0), [], []),
        (["r1/wheelRight", "r1/caster", "r1/wheelLeft"], [2, 9, 1], (1, 2), ["r1/caster"], []),
        (["RRWheel", "FLWheel", "RLWheel", "FRWheel"], [4, 1, 3, 2], (1, 2, 3, 4), [], []),
        (
            ["arm_1", "drivewhl_r", "grip", "drivewhl_l"],
            [8, 2, 9, 1],
            (1, 2),
            ["arm_1", "grip"],
            [],
        ),
        (["arm_1", "motor_right", "motor_left"], [9, 2, 1], (1, 2), ["arm_1"], []),
        (["motor_b", "motor_a"], [2, 1], (2, 1), [], ["motor_b", "motor_a"]),
    ],
)
def test_names_of_joints_as_people_write_them(names, speeds, wheels, beside, unordered):
    """Camel case was not parted: right and left were exchanged without a word."""
    message = SimpleNamespace(name=names, velocity=speeds)
    assert COMMANDS["sensor_msgs/msg/JointState"][1](message) == wheels
    assert joints_beside_wheels(message) == beside
    assert joints_as_they_stand(message) == unordered
