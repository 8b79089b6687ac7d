# SPDX-License-Identifier: Apache-2.0
"""Tables without names of columns whose form tells them: trajectories, and messages of ROS 2."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from twinmill.data.units import unit_of_stamps

POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
TWIST = tuple(f"twist.{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")
TUM = ("timestamp", "tx", "ty", "tz", *POSE[3:])  # as that format's page names them
OFF_ONE = 0.01  # of a unit quaternion's length
# `ros2 topic echo --csv`: seconds, nanoseconds, frame, and the fields of the message.
STAMPED = re.compile(r"(\d{1,10}),(\d{1,9}),([^,]*[^,\d.-][^,]*|),")
AXES = ("x", "y", "z", "w")
OF_AXIS = re.compile(r"(?<=[./])[xyzw]$")
COVARIANCE = tuple(f"covariance_{k}" for k in range(36))
FIELDS = {  # by the number of cells behind the frame
    7: POSE,
    6: TWIST,
    43: (*POSE, *COVARIANCE),
    42: (*TWIST, *COVARIANCE),
    86: ("child_frame_id", *POSE, *COVARIANCE, *TWIST, *COVARIANCE),
}


@dataclass(frozen=True)
class Named:
    """A line of names for such a table, its lines, and a sentence on what it was taken for."""

    names: str
    lines: Iterator[str]
    note: str


def trajectory(cells: list[str], comment: list[str]) -> str:
    """Names for a trajectory in the form of TUM: a stamp, a place and a quaternion; else empty.

    Args:
        cells: numbers of its first row.
        comment: words of the comment above it.
    """
    if len(cells) != len(TUM) or (comment and tuple(comment) != TUM):
        return ""
    length = float(np.linalg.norm([float(cell) for cell in cells[4:]]))
    stamp = f"t_{unit_of_stamps(float(cells[0]))}"
    return " ".join((stamp, *POSE)) if abs(length - 1) < OFF_ONE else ""


def whole(names: list[str]) -> list[str]:
    """Names of columns with the way to each field, where only the first axis has it.

    `position.x y z` are all of the position, as people write such a header by hand.
    """
    found, way = [], ""
    for name in names:
        if not (way and name in AXES):
            way = OF_AXIS.sub("", name) if OF_AXIS.search(name) else ""
            found.append(name)
        else:
            found.append(way + name)
    return found


def messages(first: str, lines: Iterable[str]) -> Named | None:
    """Table without column names that `ros2 topic echo --csv` writes, with names put in.

    Args:
        first: its first line, by whose stamp and number of fields the type of message is told: a
            stamped pose, a stamped velocity, or odometry.
        lines: all of its lines, in which seconds and nanoseconds of the stamp become one column.

    Returns:
        Header, lines and a remark for people; None where the first line is of no such message.
    """
    found = STAMPED.match(first)
    fields = FIELDS.get(first[found.end() :].count(",") + 1) if found else None
    if not fields:
        return None
    note = "it has no names; read as `ros2 topic echo --csv` writes stamped messages"
    repeated: dict[str, int] = {}
    names = []
    for name in ("t_s", "frame_id", *fields):
        repeated[name] = repeated.get(name, 0) + 1
        names.append(name if repeated[name] == 1 else f"{name}_again")
    return Named(",".join(names) + "\n", map(_with_one_stamp, lines), note)


def _with_one_stamp(line: str) -> str:
    seconds, nanoseconds, rest = [*line.split(",", 2), "", ""][:3]
    return f"{seconds}.{nanoseconds.zfill(9)},{rest}" if rest else line
