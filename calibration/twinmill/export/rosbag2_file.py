# SPDX-License-Identifier: Apache-2.0
"""A log as a rosbag2 folder (MCAP) of ROS's own messages, which RViz and PlotJuggler open.

Bag time is the recorder's stamp; headers have the sender's. Poses that are not valid are left out.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import turbopi

from twinmill.export.recording import Channel, Recording
from twinmill.export.script import BAG_VERSION
from twinmill.extras import needing

WORLD = "world"
WHEELS = ["front_left", "front_right", "rear_left", "rear_right"]
KINDS = ("pose", "telemetry", "drive", "detection", "truth", "run")  # that ROS has messages for

Said = tuple[str, Any]  # topic and message


def write_rosbag2(recording: Recording, folder: Path) -> Counter[str]:
    """Writes the channels of KINDS as topics of each robot, as /r03/pose; with a prefix /twin_r03.

    Args:
        recording: what to write.
        folder: of the bag; must not exist.

    Returns:
        Messages written, by topic.
    """
    with needing("ros"):  # slow to import
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    speaker, topics, written = Speaker(store.types), {}, Counter()
    known = [c for c in recording.channels if c.type_name in KINDS]
    events = sorted(
        (stamp_us, k, number)
        for k, channel in enumerate(known)
        for number, stamp_us in enumerate(channel.stamps_us)
    )
    with Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
        for stamp_us, k, number in events:
            say = getattr(speaker, known[k].type_name)
            for topic, message in say(_name(known[k]), known[k].messages[number]):
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(topics[topic], 1000 * stamp_us, store.serialize_cdr(message, kind))
                written[topic] += 1
    return written


def left_out(recording: Recording) -> list[str]:
    """Channels that ROS has no messages for."""
    return [c.name for c in recording.channels if c.type_name not in KINDS]


def _name(channel: Channel) -> str:
    """`r03`, or `twin_r03`; truth has its robot last."""
    return (channel.robot or channel.name.rpartition("_")[2]).lower()


class Speaker:
    """Converter of our messages, with a method for each of our types' names."""

    def __init__(self, types: dict[str, type]) -> None:
        self._types = types

    def pose(self, robot: str, m: turbopi.pose_t) -> Iterator[Said]:
        """The pose, and its frame under `world`; nothing where it was lost."""
        if not m.valid:
            return
        header, body = self._header(m.utime_us, WORLD), self._body(m.position_m, m.orientation_wxyz)
        yield f"/{robot}/pose", self._make("geometry_msgs/PoseStamped", header, body)
        place = self._make("geometry_msgs/Vector3", *m.position_m)
        moved = self._make("geometry_msgs/Transform", place, body.orientation)
        frame = self._make("geometry_msgs/TransformStamped", header, f"{robot}/base_link", moved)
        yield "/tf", self._make("tf2_msgs/TFMessage", [frame])

    def truth(self, robot: str, m: turbopi.truth_t) -> Iterator[Said]:
        """The twin's true pose and velocity of the body."""
        half = m.theta_rad / 2
        turn = (float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
        body = self._body((m.x_m, m.y_m, 0.0), turn)
        twist = self._twist(m.vx_mps, m.vy_mps, m.omega_radps)
        unknown = np.zeros(36)
        yield (
            f"/{robot}/truth",
            self._make(
                "nav_msgs/Odometry",
                self._header(m.utime_us, WORLD),
                f"{robot}/truth",
                self._make("geometry_msgs/PoseWithCovariance", body, unknown),
                self._make("geometry_msgs/TwistWithCovariance", twist, unknown),
            ),
        )

    def telemetry(self, robot: str, m: turbopi.telemetry_t) -> Iterator[Said]:
        """Duties in percent, the bit of the camera, the battery."""
        yield f"/{robot}/duty_pct", self._numbers(list(m.wheel_duty_pct))
        yield f"/{robot}/detected", self._make("std_msgs/Int8", m.detected)
        yield f"/{robot}/battery_V", self._make("std_msgs/Float64", m.battery_V)

    def drive(self, robot: str, m: turbopi.drive_t) -> Iterator[Said]:
        """As it was driven: /cmd_vel, /wheels or /duty_pct."""
        header = self._header(m.utime_us, f"{robot}/base_link")
        if m.kind == m.KIND_TWIST:
            stamped = self._make("geometry_msgs/TwistStamped", header, self._twist(*m.value[:3]))
            yield f"/{robot}/cmd_vel", stamped
        elif m.kind == m.KIND_WHEEL_SPEED:
            none, speeds = np.empty(0), np.array(m.value, float)
            joints = self._make("sensor_msgs/JointState", header, WHEELS, none, speeds, none)
            yield f"/{robot}/wheels", joints
        else:
            yield f"/{robot}/duty_pct", self._numbers(list(m.value))

    def detection(self, robot: str, m: turbopi.detection_t) -> Iterator[Said]:
        """Message for a camera's bit: seen or not."""
        yield f"/{robot}/seen", self._make("std_msgs/Bool", bool(m.seen))

    def run(self, robot: str, m: turbopi.run_t) -> Iterator[Said]:
        """The run's model and settings, as TOML."""
        yield f"/{robot}/run", self._make("std_msgs/String", m.config_toml)

    def _make(self, kind: str, *values: Any) -> Any:
        """As `geometry_msgs/Point`, from its fields in their order."""
        return self._types[kind.replace("/", "/msg/")](*values)

    def _header(self, utime_us: int, frame: str) -> Any:
        stamp = self._make("builtin_interfaces/Time", utime_us // 10**6, utime_us % 10**6 * 1000)
        return self._make("std_msgs/Header", stamp, frame)

    def _body(self, place: list[float], turn_wxyz: list[float]) -> Any:
        w, x, y, z = turn_wxyz
        return self._make(
            "geometry_msgs/Pose",
            self._make("geometry_msgs/Point", *place),
            self._make("geometry_msgs/Quaternion", x, y, z, w),
        )

    def _twist(self, vx_mps: float, vy_mps: float, omega_radps: float) -> Any:
        vector = "geometry_msgs/Vector3"
        return self._make(
            "geometry_msgs/Twist",
            self._make(vector, vx_mps, vy_mps, 0.0),
            self._make(vector, 0.0, 0.0, omega_radps),
        )

    def _numbers(self, values: list[float]) -> Any:
        """A Float64MultiArray of one dimension, the wheels."""
        count = len(values)
        dimension = self._make("std_msgs/MultiArrayDimension", "wheels", count, count)
        layout = self._make("std_msgs/MultiArrayLayout", [dimension], 0)
        return self._make("std_msgs/Float64MultiArray", layout, np.array(values, float))
