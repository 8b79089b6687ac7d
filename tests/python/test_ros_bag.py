# SPDX-License-Identifier: Apache-2.0
"""ROS bags written by the library rosbags are read without ROS; broken ones are one sentence."""

import json
import math
import struct

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.importers.ros_bag import _rows, guess_pairs, list_topics
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


def test_what_is_no_bag_or_a_broken_one_is_one_sentence(tmp_path):
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(50))
    for name in ("x.bag", "x.mcap", "gone"):
        with pytest.raises(LogError, match="cannot be read as a ROS bag"):
            list_topics(tmp_path / name)


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path):
    bag = _bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    options = ImportOptions(pose_topics=("/r03/odom",), command_topics=("/r03/cmd_vel",))
    with pytest.raises(LogError, match=r"no topic /r03/odom; it has /r03/cmd_vel, /r03/pose"):
        import_log(None, None, tmp_path / "o.lcmlog", bag=bag, options=options)
    assert not (tmp_path / "o.lcmlog").exists()


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
    kind, utime_us, values, _ = _rows(tmp_path / "run.mcap", [topic], receive=False)[topic]
    assert kind == "geometry_msgs/msg/Twist"
    np.testing.assert_array_equal(utime_us, np.arange(20) * 10**6)
    np.testing.assert_allclose(values, [(0.1 * k, 0, -0.5, 0) for k in range(20)])
