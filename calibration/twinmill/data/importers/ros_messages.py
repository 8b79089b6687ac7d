# SPDX-License-Identifier: Apache-2.0
"""Readers of ROS message types: poses, commands, places of frames (tf) or of tags."""

import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from twinmill.data.log import CommandKind

Row = tuple[float, ...]
TF = "tf2_msgs/msg/TFMessage"
TAGS = tuple(  # poses of tags in the camera's frame, by several packages
    f"{package}/msg/AprilTagDetectionArray"
    for package in (
        "apriltag_ros",
        "apriltags2_ros",
        "apriltags_ros",
        "isaac_ros_apriltag_interfaces",
    )
)
CORNERS = "apriltag_msgs/msg/AprilTagDetectionArray"  # without poses: these are on /tf
STAND_IN = (
    "is odometry: the speeds that it measured stand in for commands, so that lags and losses of "
    "the motors do not show"
)
JOINTS = "sensor_msgs/msg/JointState"
ODOMETRY = "nav_msgs/msg/Odometry"
ESTIMATES = (ODOMETRY, "geometry_msgs/msg/PoseWithCovarianceStamped")  # often of the robot itself
MANY = (TF, *TAGS)  # of one topic
STEERED = ("ackermann_msgs/msg/AckermannDrive", "ackermann_msgs/msg/AckermannDriveStamped")
WHEEL = re.compile("wheel|whl", re.IGNORECASE)
WORDS = re.compile("[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+")  # of front_left, FrontLeft, FLWheel
DEFINITIONS = {  # of types that the library does not bring; older bags hold none
    STEERED[0]: "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
    "float32 acceleration\nfloat32 jerk\n",
    STEERED[1]: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
}


def _pose(pose: Any) -> Row:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.w, q.x, q.y, q.z


def transforms_of(message: Any) -> Iterator[tuple[str, str, Any]]:
    """Frame, its parent and the stamped transform of each in a message of tf."""
    for transform in message.transforms:
        yield transform.child_frame_id.lstrip("/"), transform.header.frame_id.lstrip("/"), transform


def transform_row(transform: Any) -> Row:
    """x, y, z in m, then the quaternion, w first."""
    p, q = transform.translation, transform.rotation
    return p.x, p.y, p.z, q.w, q.x, q.y, q.z


def tag_rows(message: Any) -> Iterator[tuple[str, Row]]:
    """Number and pose of each tag; of a bundle that of its first."""
    for detection in message.detections:
        number, pose = detection.id, detection.pose
        while hasattr(pose, "pose"):  # with stamp, with covariance
            pose = pose.pose
        yield str(number if isinstance(number, int) else int(number[0])), _pose(pose)


def _twist(twist: Any) -> Row:
    return twist.linear.x, twist.linear.y, twist.angular.z, 0.0


def _steered(drive: Any) -> Row:
    """Speed, steering angle: velocities follow with the wheelbase."""
    return drive.speed, drive.steering_angle


def _duties(message: Any) -> Row:
    return tuple(float(v) for v in message.data)


def _wheel_speeds(message: Any) -> Row:
    """In our order where the joints' names tell the wheel, else as they stand.

    Where some joints are called wheels, or tell their sides, the others (an arm, a pan) are none.
    """
    speeds = tuple(map(float, message.velocity))
    names = tuple(message.name)
    return tuple(speeds[k] for k in _taken(names)) if len(names) == len(speeds) else speeds


@cache
def _taken(names: tuple[str, ...]) -> tuple[int, ...]:
    """Places of the joints that are wheels, in our order where their names tell it."""
    wheels = _wheels_among(names)
    order = _order([names[k] for k in wheels])
    return tuple(wheels[k] for k in order) if order else tuple(wheels)


def _wheels_among(names: tuple[str, ...]) -> list[int]:
    """Places of the joints that are called wheels, or else tell their sides; all if none does."""
    called = [k for k, name in enumerate(names) if WHEEL.search(name)]
    sided = [k for k, name in enumerate(names) if _wheel(name)]
    return called or (sided if len(sided) in (2, 4) else list(range(len(names))))


def _order(names: list[str]) -> list[int] | None:
    """In which order they are left, right or ours; None if the names do not tell."""
    places = [_wheel(name) for name in names]
    if len(places) == 2:
        places = [place and (1, place[1]) for place in places]
    if not all(place and all(place) for place in places) or len(set(places)) < len(places):
        return None
    return sorted(range(len(places)), key=lambda k: places[k])


def joints_beside_wheels(message: Any) -> list[str]:
    """Names of the joints in a JointState that are taken for no wheels."""
    if len(message.name) != len(message.velocity):
        return []
    return [name for k, name in enumerate(message.name) if k not in _taken(tuple(message.name))]


def joints_as_they_stand(message: Any) -> list[str]:
    """Names of the wheels in a JointState whose order is not told by their names."""
    if len(message.name) != len(message.velocity):
        return []
    names = [message.name[k] for k in _wheels_among(tuple(message.name))]
    return [] if _order(names) else names


def _wheel(name: str) -> tuple[int, int] | None:
    """Front 1 or rear 2, left 1 or right 2; 0 where the name does not say."""
    words = {word.lower() for word in WORDS.findall(name.rpartition("/")[2])}
    front = bool(words & {"front", "fl", "fr", "lf", "rf"})
    rear = bool(words & {"rear", "back", "rl", "rr", "bl", "br"})
    left = bool(words & {"left", "l", "fl", "rl", "bl", "lf"})
    right = bool(words & {"right", "r", "fr", "rr", "br", "rf"})
    if (front and rear) or left == right:
        return None
    return 1 if front else 2 if rear else 0, 1 if left else 2


POSES: dict[str, Callable[[Any], Row]] = {
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
    ODOMETRY: lambda m: _pose(m.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda m: transform_row(m.transform),
}
COMMANDS: dict[str, tuple[CommandKind, Callable[[Any], Row]]] = {
    "geometry_msgs/msg/Twist": ("twist", _twist),
    "geometry_msgs/msg/TwistStamped": ("twist", lambda m: _twist(m.twist)),
    ODOMETRY: ("twist", lambda m: _twist(m.twist.twist)),
    STEERED[0]: ("twist", _steered),
    STEERED[1]: ("twist", lambda m: _steered(m.drive)),
    JOINTS: ("wheel_speed", _wheel_speeds),
    **{
        f"std_msgs/msg/{number}MultiArray": ("duty", _duties)
        for number in ("Float64", "Float32", "Int16", "Int32")
    },
}


def roles_of(kind: str) -> list[str]:
    """`pose` and `command`, as a message of a type can be either; odometry is a pose first."""
    return [role for role, kinds in (("pose", POSES), ("command", COMMANDS)) if kind in kinds]
