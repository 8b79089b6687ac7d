# SPDX-License-Identifier: Apache-2.0
"""A script as a bag of ROS 2 in SQLite: rosbags, and ROS's own messages."""

import math
import sqlite3
from itertools import pairwise
from pathlib import Path

from interop.cells import Told, writes
from interop.robot import TEXT
from interop.ros_node import ROWS, SCRIPT
from interop.rosbag import ROS2

BAG = "drive_bag"
END_S, LONGEST_S = 3.0, 0.1  # of the script; a controller of ros2_control waits for five times that


def _write(folder: Path) -> None:
    """By `twinmill robot characterise --script-as bag`."""
    from twinmill_cli.main import run

    (folder / "m.toml").write_text(TEXT)
    (folder / "s.csv").write_text(SCRIPT)
    words = ["characterise", "--robot", "3", "--script", str(folder / "s.csv")]
    words += ["--model", str(folder / "m.toml"), "--script-as", "bag"]
    assert run([*words, "--out", str(folder / BAG)]) == 0


def _told(rows: list) -> Told:
    """Facts in the bag, rows of (stamp in ns, Twist)."""
    told = [(1e-9 * at_ns, (m.linear.x, m.linear.y, m.angular.z)) for at_ns, m in rows]
    at = [next(t_s for t_s, twist in told if twist == row) for row in ROWS]
    steps_s = [b - a for (a, _), (b, _) in pairwise(told)]
    return {
        "rows, to the microsecond": all(abs(t_s - k) < 1e-6 for k, t_s in enumerate(at)),
        "said again": max(steps_s) < LONGEST_S,
        "stands at the end": math.isclose(told[-1][0], END_S) and not any(told[-1][1]),
    }


@writes("rosbag2 of a script", "rosbags", "rosbags==0.11.9", ours=_write)
def rosbags(folder: Path) -> Told:
    """Its high-level reader, which goes by the folder's metadata."""
    from rosbags.highlevel import AnyReader

    with AnyReader([folder / BAG]) as reader:
        return _told([(at, reader.deserialize(raw, c.msgtype)) for c, at, raw in reader.messages()])


@writes("rosbag2 of a script", "ROS 2 Jazzy, its messages", *ROS2, ours=_write)
def ros2(folder: Path) -> Told:
    """ROS's own messages out of the file's bytes; the file around them is SQLite's."""
    from geometry_msgs.msg import Twist
    from rclpy.serialization import deserialize_message

    (path,) = (folder / BAG).glob("*.db3")
    with sqlite3.connect(path) as base:
        found = base.execute("select timestamp, data from messages order by timestamp").fetchall()
    return _told([(at_ns, deserialize_message(data, Twist)) for at_ns, data in found])
