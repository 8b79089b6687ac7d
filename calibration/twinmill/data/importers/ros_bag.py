# SPDX-License-Identifier: Apache-2.0
"""Poses and commands from ROS bags (rosbag1; rosbag2 with sqlite3 or MCAP), without ROS.

Messages are read one by one, so that a bag of any size takes the memory of its poses alone.
"""

import re
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import turbopi

from twinmill.data.importers.series import CommandSeries, PoseSeries
from twinmill.data.log import CommandKind, LogError

Row = tuple[float, ...]


def _pose(pose: Any) -> Row:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.w, q.x, q.y, q.z


def _transform(transform: Any) -> Row:
    p, q = transform.translation, transform.rotation
    return p.x, p.y, p.z, q.w, q.x, q.y, q.z


def _twist(twist: Any) -> Row:
    return twist.linear.x, twist.linear.y, twist.angular.z, 0.0


def _duties(message: Any) -> Row:
    return tuple(float(v) for v in message.data)


POSES: dict[str, Callable[[Any], Row]] = {
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
    "nav_msgs/msg/Odometry": lambda m: _pose(m.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda m: _transform(m.transform),
}
COMMANDS: dict[str, tuple[CommandKind, Callable[[Any], Row]]] = {
    "geometry_msgs/msg/Twist": ("twist", _twist),
    "geometry_msgs/msg/TwistStamped": ("twist", lambda m: _twist(m.twist)),
    "sensor_msgs/msg/JointState": ("wheel_speed", lambda m: tuple(map(float, m.velocity))),
    "std_msgs/msg/Float64MultiArray": ("duty", _duties),
}
WIDTH = 4  # wheels; velocity commands have a zero in the last place


@dataclass(frozen=True)
class Topic:
    """One topic of a bag: `role` is `pose`, `command` or empty."""

    name: str
    kind: str
    count: int
    role: str

    @property
    def namespace(self) -> str:
        """All but the last word."""
        return self.name.rpartition("/")[0]


def list_topics(path: Path) -> list[Topic]:
    """What is in a bag.

    Raises:
        LogError: it is no bag, or broken.
    """
    with _open(path) as reader:
        return [
            Topic(c.topic, c.msgtype, c.msgcount, _role(c.msgtype))
            for c in sorted(reader.connections, key=lambda c: c.topic)
        ]


def _role(kind: str) -> str:
    return "pose" if kind in POSES else "command" if kind in COMMANDS else ""


def guess_pairs(topics: list[Topic]) -> list[tuple[str, str]]:
    """Pose and command topic of each robot: of one namespace; the one with most messages."""
    pairs = []
    for namespace in sorted({t.namespace for t in topics if t.role == "command"}):
        commands = [t for t in topics if t.role == "command" and t.namespace == namespace]
        poses = [t for t in topics if t.role == "pose" and t.namespace == namespace]
        if not poses and namespace == "":
            poses = [t for t in topics if t.role == "pose"]
        if poses:
            best = [max(group, key=lambda t: t.count).name for group in (poses, commands)]
            pairs.append((best[0], best[1]))
    return pairs


def read_bag(
    path: Path, poses: list[str], commands: list[str], robot_id: int | None, receive: bool
) -> tuple[list[PoseSeries], list[CommandSeries]]:
    """Series of each robot.

    Args:
        path: file or folder of the bag.
        poses: topics, one for each robot.
        commands: topics, in the same order of robots.
        robot_id: of the only robot; None: by the last number in its topics.
        receive: take the times of receipt, not those in the headers.

    Raises:
        LogError: unreadable, a topic that is not there or holds nothing that is known.
    """
    if len(poses) != len(commands) or not poses:
        raise LogError("--pose and --command: give one of each for each robot, in the same order.")
    numbers = [_number(p, c, robot_id, len(poses)) for p, c in zip(poses, commands, strict=True)]
    rows = _rows(path, [*poses, *commands], receive)
    pose_series = [_poses(n, *rows[t]) for n, t in zip(numbers, poses, strict=True)]
    command_series = [_commands(n, *rows[t]) for n, t in zip(numbers, commands, strict=True)]
    return pose_series, command_series


def _number(pose: str, command: str, robot_id: int | None, robots: int) -> int:
    if robot_id is not None and robots == 1:
        return robot_id
    digits = re.findall(r"\d+", command) or re.findall(r"\d+", pose)
    if not digits or int(digits[-1]) > 99:
        raise LogError(
            f"{command}: has no number in 0..99 that tells the robot; give --robot-id, one robot "
            "at a time."
        )
    return int(digits[-1])


@contextmanager
def _open(path: Path):
    """The bag, open for reading; what goes wrong inside is one sentence."""
    from rosbags.highlevel import AnyReader, AnyReaderError  # slow to import
    from rosbags.rosbag1 import ReaderError as Error1
    from rosbags.rosbag2 import ReaderError as Error2
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore

    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except (
        *(AnyReaderError, Error1, Error2, SerdeError, OSError, KeyError, AssertionError),
        *(AttributeError, IndexError, UnicodeDecodeError),
    ) as error:
        raise LogError(
            f"{path}: cannot be read as a ROS bag ({error}); name the .bag or .mcap file, or the "
            "folder with metadata.yaml."
        ) from error


def _rows(
    path: Path, topics: list[str], receive: bool
) -> dict[str, tuple[str, np.ndarray, list[Row], list[str]]]:
    """By topic: type, (N,) stamps in us, values, remarks."""
    stamps: dict[str, list[int]] = {topic: [] for topic in topics}
    late: dict[str, list[float]] = {topic: [] for topic in topics}
    values: dict[str, list[Row]] = {topic: [] for topic in topics}
    kinds: dict[str, str] = {}
    with _open(path) as reader:
        chosen = [c for c in reader.connections if c.topic in topics]
        kinds = {c.topic: c.msgtype for c in chosen}
        if missing := [topic for topic in topics if topic not in kinds]:
            names = ", ".join(sorted({c.topic for c in reader.connections}))
            raise LogError(f"{path.name}: has no topic {missing[0]}; it has {names}.")
        for connection, received_ns, raw in reader.messages(connections=chosen):
            topic, kind = connection.topic, connection.msgtype
            value_of = POSES.get(kind) or (COMMANDS[kind][1] if kind in COMMANDS else None)
            if value_of is None:
                raise LogError(f"{path.name}: {topic} holds {kind}, which is not read here.")
            message = reader.deserialize(raw, kind)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            header_ns = stamp.sec * 10**9 + stamp.nanosec if stamp else 0
            if header_ns:
                late[topic].append((received_ns - header_ns) * 1e-9)
            stamps[topic].append((header_ns if header_ns and not receive else received_ns) // 1000)
            values[topic].append(value_of(message))
    return {
        topic: (
            kinds[topic],
            np.array(stamps[topic], np.int64),
            values[topic],
            [_stamps_in_words(topic, late[topic], receive)],
        )
        for topic in topics
    }


def _stamps_in_words(topic: str, late_s: list[float], receive: bool) -> str:
    if not late_s:
        return f"{topic}: has no header stamps; the times of receipt are taken."
    taken = "times of receipt" if receive else "header stamps"
    return (
        f"{topic}: the {taken} are taken; messages were received "
        f"{1000 * float(np.median(late_s)):.1f} ms after their header stamps (median)."
    )


def _ordered(utime_us: np.ndarray) -> np.ndarray:
    """Rows in order of time, the last of each stamp."""
    rows = np.argsort(utime_us, kind="stable")
    return rows[np.append(np.diff(utime_us[rows]) > 0, True)]


def _poses(
    robot_id: int, kind: str, utime_us: np.ndarray, values: list[Row], notes: list[str]
) -> PoseSeries:
    if kind not in POSES or not values:
        raise LogError(f"--pose: robot {robot_id}: the topic holds {kind}, which is no pose.")
    rows = _ordered(utime_us)
    value = np.array(values)[rows]
    norm = np.linalg.norm(value[:, 3:], axis=1)
    valid = np.isfinite(value).all(axis=1) & (np.abs(norm - 1) < 0.05)
    value[~valid] = np.nan
    value[valid, 3:] /= norm[valid, None]
    return PoseSeries(robot_id, utime_us[rows], value[:, :3], value[:, 3:], valid, notes)


def _commands(
    robot_id: int, kind: str, utime_us: np.ndarray, values: list[Row], notes: list[str]
) -> CommandSeries:
    if kind not in COMMANDS or not values:
        raise LogError(f"--command: robot {robot_id}: the topic holds {kind}, which is no command.")
    widths = {len(v) for v in values}
    if len(widths) > 1 or not widths <= {2, 3, WIDTH}:
        raise LogError(
            f"--command: robot {robot_id}: {kind} has {max(widths)} numbers a message, but a robot "
            "here has two to four wheels; choose another topic."
        )
    rows = _ordered(utime_us)
    value = np.array(values, float)[rows]
    if value.shape[1] == 2:  # left, right
        value = value[:, [0, 1, 0, 1]]
    elif value.shape[1] == 3:
        value = np.column_stack([value, np.zeros(len(value))])
    command_kind = COMMANDS[kind][0]
    if not np.isfinite(value).all() or (command_kind == "duty" and np.abs(value).max() > 100):
        raise LogError(
            f"--command: robot {robot_id}: holds numbers that are not finite, or duties beyond "
            "-100..100 percent; correct the program that recorded them."
        )
    if command_kind == "duty" and np.abs(value).max() <= 1:
        value = value * 100
        notes = [*notes, "duties go to 1 at most: taken for shares of full duty."]
    unknown = np.full((len(rows), 2), np.nan)
    return CommandSeries(
        robot_id,
        utime_us[rows],
        command_kind,
        value,
        command_kind == "duty",
        unknown,
        np.zeros((len(rows), 2), int),
        turbopi.telemetry_t.MODE_SCRIPT,
        notes,
    )
