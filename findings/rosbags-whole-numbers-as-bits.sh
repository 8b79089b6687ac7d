#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# rosbags 0.11.9: a covariance of whole numbers is written as 5e-324.
#
# Guess: an array of NumPy's integers in a field of float64 is converted, as a plain 1 is in a field beside it
#   and as NumPy itself does, or is refused, as an array of float32 and one of a wrong length are.
# Seen: np.diag([1, 1, 1, 0, 0, 0]) as covariance, whose numbers are integers, is written bit by bit: a reader
#   finds 5e-324 for each 1, thus a measurement without any error. Any type of the same width is taken so:
#   2.0 in a field of int64 is 4611686018427387904. Nothing is said when it is written or read. dtype=float.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet rosbags==0.11.9 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'PY'
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
POSE, NUMBERS = "geometry_msgs/msg/PoseWithCovariance", "std_msgs/msg/Int64MultiArray"


def made(kind, *values):
    return store.types[kind](*values)


def pose(covariance):
    place = made("geometry_msgs/msg/Point", 1, 2, 3)
    turn = made("geometry_msgs/msg/Quaternion", 0, 0, 0, 1)
    return made(POSE, made("geometry_msgs/msg/Pose", place, turn), covariance)


def through_a_bag(name, message):
    """The message as it is read from a bag that it was written into."""
    with Writer(name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/said", message.__msgtype__, typestore=store)
        writer.write(topic, 1, store.serialize_cdr(message, message.__msgtype__))
    with AnyReader([writer.path], default_typestore=store) as reader:
        ((connection, _, data),) = reader.messages()
        return reader.deserialize(data, connection.msgtype)


whole = through_a_bag("whole", pose(np.diag([1, 1, 1, 0, 0, 0]).ravel()))
right = through_a_bag("right", pose(np.diag([1.0, 1, 1, 0, 0, 0]).ravel()))
print("x:", whole.pose.position.x, "variances of x:", whole.covariance[0], right.covariance[0])
assert whole.pose.position.x == 1.0 and right.covariance[0] == 1.0
assert 0 < whole.covariance[0] < 1e-300

layout = made("std_msgs/msg/MultiArrayLayout", [], 0)
counts = through_a_bag("counts", made(NUMBERS, layout, np.array([2.0, 3.0]))).data
print("2.0 as int64:", counts[0])
assert counts[0] == 4611686018427387904

for refused in (np.eye(6, dtype=np.float32).ravel(), np.ones(35)):
    try:
        store.serialize_cdr(pose(refused), POSE)
        raise SystemExit(f"it takes {refused.size} numbers of {refused.dtype} now")
    except Exception as error:
        print(f"{refused.size} numbers of {refused.dtype}: {type(error).__name__}")
PY
