# SPDX-License-Identifier: Apache-2.0
"""Bags of a robot on 32.5 mm wheels whose speeds are told in other units, on a tilted floor."""

import math
import re

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from twinmill.data.checks.rolling import factor_words
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill.data.track import make_track

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
START_S = 1_700_000_000
RADIUS_M, SPEED_MPS, TURN_RADPS, HALF_TRACK_M = 0.0325, 0.3, 0.15, 0.067
WHEELS = ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]


@pytest.fixture
def bag(tmp_path):
    """Once round a circle of 2 m, as a capture sees it whose axes are tilted."""

    def make(factor=1.0, tilt_deg=0.0):
        tilt = Rotation.from_euler("y", tilt_deg, degrees=True)
        sides = SPEED_MPS + HALF_TRACK_M * TURN_RADPS * np.array([-1, 1, -1, 1])
        told = sides / RADIUS_M / factor
        kinds = {"/r1/pose": "geometry_msgs/msg/PoseStamped",
                 "/r1/wheels": "sensor_msgs/msg/JointState"}  # fmt: skip
        with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            of = {t: writer.add_connection(t, kind, typestore=STORE) for t, kind in kinds.items()}
            for k in range(42 * 20):
                t_s = k / 20
                heading = TURN_RADPS * t_s
                radius_m = SPEED_MPS / TURN_RADPS
                flat = radius_m * np.array([math.sin(heading), 1 - math.cos(heading), 0.05])
                place = tilt.apply(flat)
                x, y, z, w = (tilt * Rotation.from_euler("z", heading)).as_quat()
                at_ns = START_S * 10**9 + k * 50_000_000
                header = T["std_msgs/msg/Header"](
                    stamp=T["builtin_interfaces/msg/Time"](*divmod(at_ns, 10**9)), frame_id="map"
                )
                pose = T["geometry_msgs/msg/Pose"](
                    position=T["geometry_msgs/msg/Point"](*place),
                    orientation=T["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
                )
                joints = T[kinds["/r1/wheels"]](
                    header=header, name=WHEELS, position=np.zeros(4), velocity=told,
                    effort=np.zeros(4),
                )  # fmt: skip
                said = {"/r1/pose": T[kinds["/r1/pose"]](header=header, pose=pose)}
                for topic, message in {**said, "/r1/wheels": joints}.items():
                    writer.write(of[topic], at_ns, STORE.serialize_cdr(message, kinds[topic]))
        return tmp_path / "bag"

    return make


def imported(bag, out, **options):
    topics = {"pose_topics": ("/r1/pose",), "command_topics": ("/r1/wheels",)}
    done = import_log(None, None, out, bag=bag, options=ImportOptions(**topics, **options))
    return read_log(out).robots[1], " ".join(done["warnings"])


def test_of_a_bag_with_tilted_axes_no_pose_is_off_the_floor(bag, tmp_path):
    robot, said = imported(bag(tilt_deg=3.0), tmp_path / "o.lcmlog")
    assert np.ptp(robot.z_m) > 0.2  # 4 m of a floor that leans by 3 degrees
    assert (make_track(robot).segment >= 0).all()
    assert "tilted by 3.0 degrees" in said and "off the floor" not in said


@pytest.mark.parametrize(
    ("words", "factor"),
    [
        ("revolutions per second, on wheels of 3[23] mm", 2 * math.pi),
        ("revolutions per minute, on wheels of 3[23] mm", 2 * math.pi / 60),
        ("degrees per second, on wheels of 3[23] mm", math.pi / 180),
        ("radians per minute, on wheels of 3[23] mm", 1 / 60),
        ("motors before a gear of 1:12 to 1:262", 1 / 50),
        ("motors before a gear of 1:113 to 1:", 2 * math.pi / 60 / 48),
    ],
)
def test_wheel_speeds_of_another_unit_are_named_by_how_far_the_robot_rolls(
    bag, tmp_path, words, factor
):
    path = bag(factor)
    _, said = imported(path, tmp_path / "o.lcmlog")
    assert "the wheel speeds are not the wheels' in rad/s" in said
    assert re.search(words, said)
    robot, said = imported(path, tmp_path / "again.lcmlog", wheel_factor=factor)
    assert "the wheel speeds" not in said
    np.testing.assert_allclose(robot.command[0].mean(), SPEED_MPS / RADIUS_M)


def test_wheel_speeds_in_radians_of_the_wheels_are_left_alone(bag, tmp_path):
    _, said = imported(bag(), tmp_path / "o.lcmlog")
    assert "wheel speeds" not in said
    with pytest.raises(LogError, match=r"wheel_factor=0\.0: must be a number other than 0"):
        imported(tmp_path / "bag", tmp_path / "p.lcmlog", wheel_factor=0.0)


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (0.95 * math.pi / 30, "revolutions per minute"),
        (1.1 * 2 * math.pi, "revolutions per second"),
        (1 / 59, "degrees per second or radians per minute"),
        (1 / 30, "before a gear of about 1:30"),
        (0.5, None),
        (1.6, None),
    ],
)
def test_of_a_robot_whose_wheels_are_known_the_unit_follows_from_the_ratio(ratio, words):
    told = factor_words(ratio)
    assert told is None if words is None else words in told[0]
