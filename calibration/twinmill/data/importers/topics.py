# SPDX-License-Identifier: Apache-2.0
"""Columns that are called after fields of messages, as in `/odom/pose/pose/position/x`."""

import re
from collections.abc import Collection

from twinmill.data.units import plain_name

# Where a field stands in a message of ROS, as tables of bags have it before its name.
OF_MESSAGE = re.compile(r"^%?(field_)?((pose|transform|twist|drive)_)*(?=[a-z])")
APART = re.compile(r"[/.]+")
# Parts of messages: what stands below one is no field of a topic's own.
PARTS = frozenset(
    ("linear", "angular", "position", "orientation", "translation", "rotation", "covariance")
) | frozenset(("header", "stamp", "angular_velocity", "linear_acceleration", "magnetic_field"))
AXES = "xyzw"
OF_DRIVE = ("speed", "steering_angle")  # of ackermann_msgs/AckermannDrive, in m/s and rad
# Fields that are in m, rad and s wherever they stand (REP 103).
SI = frozenset(
    f"{part}_{axis}"
    for part in ("position", "orientation", "translation", "rotation", "linear", "angular")
    for axis in AXES
)


def is_path(column: str) -> bool:
    """True if a name is that of a field in a message, with the way to it."""
    return bool(APART.search(column.strip().strip("%")))


def is_si(column: str, field: str) -> bool:
    """True if a column is a field whose unit its message fixes.

    Args:
        column: its name in the file.
        field: the usual name of it.
    """
    words = APART.split(column.lower())
    return len(words) > 1 and (field in SI or ("drive" in words[:-1] and field in OF_DRIVE))


def field_of(column: str, usual: Collection[str]) -> tuple[str, str]:
    """Topic, and the usual name of the field; of other columns an empty topic and a plain name.

    Args:
        column: its name in the file.
        usual: names of fields that are known.
    """
    plain = plain_name(column)
    if plain in usual or not is_path(column):
        return "", plain if plain in usual else OF_MESSAGE.sub("", plain)
    words = [plain_name(word) for word in APART.split(column.strip()) if word]
    for k in range(len(words)):
        field = OF_MESSAGE.sub("", "_".join(words[k:]))
        if field in usual and (k == 0 or words[k - 1] not in PARTS):
            return "/".join(words[:k]), field
    return "", OF_MESSAGE.sub("", plain)
