# SPDX-License-Identifier: Apache-2.0
"""AprilTag detections in ROS bags: poses in a tilted camera's frame, on the floor."""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.importers.ros_bag import guess_pairs, list_topics
from twinmill.data.importers.ros_frames import on_floor
from twinmill.data.log import LogError, heading_rad, read_log

START_S = 1_700_000_000
T_S = np.arange(0, 12, 0.05)
# From the floor's axes (z up) to the camera's (x right, y down, z ahead), tilted and turned.
TILT = Rotation.from_euler("xyz", (7, -4, 0), degrees=True) * Rotation.from_euler("x", np.pi)
CAMERA_M = np.array([0.2, -0.1, 2.5])
# Of the tag's own frame in the robot's: its printed top to the front, seen from above.
LIBRARY = Rotation.from_matrix([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])  # x right, y down, z in
OUTWARD = Rotation.from_matrix([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # x right, y up, z out


def driven(line=False):
    """(N, 3) m on the floor and (N,) rad: a circle to the left, or a line."""
    angle = 0.6 * T_S
    if line:
        return np.column_stack([0.1 * T_S, 0 * T_S, 0.12 + 0 * T_S]), 0 * T_S
    place = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.12 + 0 * angle])
    return place, angle + np.pi / 2


def seen(place_m, heading, tag):
    """Place and heading of a tag in the camera's frame."""
    robot = Rotation.from_euler("z", heading[:, None])
    return TILT.apply(place_m - CAMERA_M), TILT * robot * tag


@pytest.mark.parametrize("tag", [LIBRARY, OUTWARD], ids=["z in", "z out"])
@pytest.mark.parametrize("line", [False, True])
def test_poses_of_a_tilted_camera_are_laid_on_the_floor(tag, line):
    place_m, heading = driven(line)
    position_m, turned = seen(place_m, heading, tag)
    found_m, quaternion, said = on_floor(position_m, turned.as_quat(scalar_first=True))
    assert f"tilted by {np.degrees(np.arccos(-TILT.as_matrix()[2, 2])):.1f} degrees" in said
    assert np.ptp(found_m[:, 2]) < 1e-9  # at one height
    # The floor's frame up to a turn about the vertical, and the tag's x to the robot's right.
    ours, theirs = (p[1:, :2] - p[:-1, :2] for p in (found_m, place_m))
    turn = np.angle(np.exp(1j * (np.arctan2(*ours.T[::-1]) - np.arctan2(*theirs.T[::-1]))))
    np.testing.assert_allclose(turn, turn[0], atol=1e-9)
    np.testing.assert_allclose(np.hypot(*ours.T), np.hypot(*theirs.T), rtol=1e-9)
    off = np.exp(1j * (heading_rad(quaternion) + np.pi / 2 - heading - turn[0]))
    np.testing.assert_allclose(np.angle(off), 0, atol=1e-9)


DETECTION = "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n"
ARRAY = "std_msgs/Header header\napriltag_ros/AprilTagDetection[] detections\n"


@pytest.fixture
def bag(tmp_path):
    """Bag of rosbag1: tags 3 and 8 by apriltag_ros, commands of robots 3 and 8."""
    store = get_typestore(Stores.ROS1_NOETIC)
    for text, name in ((DETECTION, "Detection"), (ARRAY, "DetectionArray")):
        store.register(get_types_from_msg(text, f"apriltag_ros/msg/AprilTag{name}"))
    t = store.types
    vector = t["geometry_msgs/msg/Vector3"]

    def header(t_s):
        stamp = t["builtin_interfaces/msg/Time"](START_S + int(t_s), round(t_s % 1 * 1e9))
        return t["std_msgs/msg/Header"](0, stamp, "ceiling_camera")

    def detection(number, t_s, position, turned):
        pose = t["geometry_msgs/msg/Pose"](
            t["geometry_msgs/msg/Point"](*position), t["geometry_msgs/msg/Quaternion"](*turned)
        )
        covered = t["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
        stamped = t["geometry_msgs/msg/PoseWithCovarianceStamped"](header(t_s), covered)
        kind = t["apriltag_ros/msg/AprilTagDetection"]
        return kind(np.array([number], np.int32), np.array([0.1]), stamped)

    place_m, heading = driven()
    position_m, turned = seen(place_m, heading, LIBRARY)
    quaternion = turned.as_quat()
    array_kind, twist_kind = "apriltag_ros/msg/AprilTagDetectionArray", "geometry_msgs/msg/Twist"
    path = tmp_path / "tags.bag"
    with Writer(path) as writer:
        tags = writer.add_connection("/tag_detections", array_kind, typestore=store)
        commands = [
            writer.add_connection(f"/robot{n}/cmd_vel", twist_kind, typestore=store) for n in (3, 8)
        ]
        for k, t_s in enumerate(T_S):
            found = [detection(3, t_s, position_m[k], quaternion[k])]
            found += [detection(8, t_s, position_m[-k], quaternion[-k])] * (k % 2)
            message = t[array_kind](header(t_s), found)
            at_ns = (START_S * 10**9) + round(t_s * 1e9)
            writer.write(tags, at_ns, store.serialize_ros1(message, array_kind))
            twist = t[twist_kind](vector(0.3, 0, 0), vector(0, 0, 0.6))
            for command in commands:
                writer.write(command, at_ns, store.serialize_ros1(twist, twist_kind))
    return path


def test_tags_are_listed_paired_by_their_numbers_and_imported(bag, tmp_path):
    topics = {topic.name: topic for topic in list_topics(bag)}
    assert topics["/tag_detections:3"].role == "pose"
    assert (topics["/tag_detections:3"].count, topics["/tag_detections:8"].count) == (240, 120)
    pairs = guess_pairs(list(topics.values()))
    assert pairs == [(f"/tag_detections:{n}", f"/robot{n}/cmd_vel") for n in (3, 8)]
    options = ImportOptions(pose_topics=tuple(p for p, _ in pairs),
                            command_topics=tuple(c for _, c in pairs),
                            heading_offset_rad=np.pi / 2)  # fmt: skip
    done = import_log(None, None, tmp_path / "o.lcmlog", bag=bag, options=options)
    robots = read_log(tmp_path / "o.lcmlog").robots
    assert sorted(robots) == [3, 8] and len(robots[8].pose_t_s) == 120
    way = np.diff(robots[3].pose[:, :2], axis=0)
    np.testing.assert_allclose(np.hypot(*way.T), 2 * 0.5 * np.sin(0.015), rtol=1e-6)
    turned = np.diff(np.unwrap(robots[3].pose[:, 2]))
    np.testing.assert_allclose(turned, 0.03, atol=1e-9)  # to the left, as it drove
    assert any("put on the floor" in w for w in done["warnings"])
    assert not [w for w in done["warnings"] if "mirrored" in w]
    astray = [w for w in done["warnings"] if "of its heading" in w]
    assert len(astray) == 1 and "robot 8" in astray[0]  # it goes the same way from its end


def test_a_topic_of_many_tags_asks_for_one(bag, tmp_path):
    options = ImportOptions(pose_topics=("/tag_detections",), command_topics=("/robot3/cmd_vel",))
    with pytest.raises(LogError, match="holds many tags; name one as /tag_detections:TAG"):
        import_log(None, None, tmp_path / "o.lcmlog", bag=bag, options=options)
