# SPDX-License-Identifier: Apache-2.0
"""ROS bags: of Foxglove's ROS 2 library, rosbags, PlotJuggler's parser, ROS 2 and ROS 1."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from interop import drive
from interop.cells import Cell, Told, reads, writes

BAG, LOG = "bag", "read.lcmlog"
POSE, TWIST = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/Twist"
ROS2 = ("ros-jazzy-rclpy[fastrtps]==7.1.6", "ros-jazzy-geometry-msgs==5.3.6")
STAMPED = "geometry_msgs/msg/TwistStamped"  # what ros2_control's wheels are told, from Jazzy on
TOPICS = {"/r01/pose": POSE, "/r01/cmd_vel": TWIST, "/r01/reference": STAMPED}
LATE_NS, BARE = 30_000_000, 10  # stamped commands are recorded late; this one has no stamp
FILES = {"foxglove": "bag.mcap", "ros2": "bag_db3", "rclpy": "ros.mcap", "ros1": "drive.bag"}
LINE = "=" * 80 + "\n"
HEADER = [
    "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
    "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
]
VECTORS = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
VELOCITY, SPEEDS = (0.2, -0.1, 0.5), (1.0, 2.0, 3.0, 4.0)  # m/s and rad/s; rad/s of four wheels
DEFINITIONS = {  # as `ros2 bag record` puts them into a file
    POSE: LINE.join(
        [
            "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
            *HEADER,
            "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\n"
            "geometry_msgs/Quaternion orientation\n",
            "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n",
            "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
        ]
    ),
    TWIST: LINE.join([VECTORS, VECTOR]),
    STAMPED: LINE.join(
        [
            "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
            *HEADER,
            f"MSG: geometry_msgs/Twist\n{VECTORS}",
            VECTOR,
        ]
    ),
}


def _write(folder: Path) -> None:
    drive.export(folder, "rosbag2", BAG, _driven_otherwise())


def _driven_otherwise() -> Iterator[drive.Event]:
    """A robot that is told velocities, and one whose wheel speeds are known."""
    import turbopi

    at_us = drive.START_US + drive.COUNT * drive.STEP_US
    kinds = {
        2: (turbopi.drive_t.KIND_TWIST, VELOCITY),
        3: (turbopi.drive_t.KIND_WHEEL_SPEED, SPEEDS),
    }
    for robot, (kind, values) in kinds.items():
        told = turbopi.drive_t()
        told.utime_us, told.robot_id, told.kind = at_us, robot, kind
        told.value = [*values, 0.0][:4]
        yield at_us, f"R{robot:02d}_DRIVE", told.encode()


def _told(rows: dict[str, list]) -> Told:
    """Facts in topics, rows of (stamp of the bag in ns, message)."""
    poses, duties = rows["/r01/pose"], rows["/r01/duty_pct"]
    stamps_us = [m.header.stamp.sec * 10**6 + m.header.stamp.nanosec // 1000 for _, m in poses]
    here = [k for k in range(drive.COUNT) if drive.seen(k)]
    return {
        "poses that are valid": len(poses) == drive.COUNT - drive.LOST,
        "stamps of headers": stamps_us == [drive.START_US + k * drive.STEP_US for k in here],
        "stamps of the bag": [at // 1000 for at, _ in poses] == stamps_us,
        "places": all(
            abs(m.pose.position.x - drive.x_m(k)) < 1e-9
            for k, (_, m) in zip(here, poses, strict=True)
        ),
        "duties": len(duties) == drive.COUNT and list(duties[-1][1].data) == [50.0] * 4,
    }


def _stamped(rows: dict[str, list]) -> Told:
    """The one command of the robot that is told velocities."""
    ((at_ns, message),) = rows["/r02/cmd_vel"]
    twist, stamp = message.twist, message.header.stamp
    same = stamp.sec * 10**9 + stamp.nanosec == at_ns
    told = twist.linear.x, twist.linear.y, twist.angular.z
    return {"velocities, as TwistStamped": same and told == VELOCITY}


def _frames(rows: dict[str, list]) -> Told:
    """Facts about `/tf` beside them, and wheels."""
    frames = [message.transforms[0] for _, message in rows["/tf"]]
    here = [k for k in range(drive.COUNT) if drive.seen(k)]
    return {
        "frames of tf": all(
            abs(one.transform.translation.x - drive.x_m(k)) < 1e-9
            for k, one in zip(here, frames, strict=True)
        ),
        "wheels, as JointState": tuple(rows["/r03/wheels"][0][1].velocity) == SPEEDS,
    }


@writes("rosbag2", "mcap-ros2-support", "mcap-ros2-support==0.6.0", ours=_write)
def foxglove(folder: Path) -> Told:
    """Foxglove's library."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    rows: dict[str, list] = {}
    (path,) = (folder / BAG).glob("*.mcap")
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            rows.setdefault(channel.topic, []).append((message.log_time, decoded))
    return _told(rows) | _stamped(rows) | _frames(rows)


@writes("rosbag2", "rosbags", "rosbags==0.11.9", ours=_write)
def rosbags(folder: Path) -> Told:
    """Its high-level reader, which goes by the folder's metadata."""
    from rosbags.highlevel import AnyReader

    rows: dict[str, list] = {}
    with AnyReader([folder / BAG]) as reader:
        for connection, at_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            rows.setdefault(connection.topic, []).append((at_ns, message))
    return _told(rows) | _stamped(rows) | _frames(rows)


@writes("rosbag2", "ROS 2 Jazzy, its messages", *ROS2, "mcap==1.6.0", ours=_write)
def ros2(folder: Path) -> Told:
    """ROS's own messages out of the file's bytes; the file around them is opened by Foxglove's."""
    import yaml
    from geometry_msgs.msg import PoseStamped, TwistStamped
    from mcap.reader import make_reader
    from rclpy.serialization import deserialize_message
    from std_msgs.msg import Float64, Float64MultiArray, Int8

    known = {POSE: PoseStamped, STAMPED: TwistStamped}
    known |= {f"std_msgs/msg/{kind.__name__}": kind for kind in (Float64, Float64MultiArray, Int8)}
    rows: dict[str, list] = {}
    with (folder / BAG / f"{BAG}.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if schema.name in known:
                decoded = deserialize_message(message.data, known[schema.name])
                rows.setdefault(channel.topic, []).append((message.log_time, decoded))
    information = yaml.safe_load((folder / BAG / "metadata.yaml").read_text())
    of_topics = [
        topic["topic_metadata"]
        for topic in information["rosbag2_bagfile_information"]["topics_with_message_count"]
    ]
    hashes = {topic["type"]: topic["type_description_hash"] for topic in of_topics}
    return (
        _told(rows)
        | _stamped(rows)
        | {"hashes of types": all(hashes[kind] == _hash(kind) for kind in known)}
    )


def _hash(kind: str) -> str:
    """ROS's own, of one of its types."""
    package, _, name = kind.split("/")
    described = Path(sys.prefix) / "share" / package / "msg" / f"{name}.json"
    return json.loads(described.read_text())["type_hashes"][0]["hash_string"]


@writes("rosbag2", "PlotJuggler's parser", "mcap-bag-parser==0.3.1", "mcap==1.6.0", ours=_write)
def plotjuggler(folder: Path) -> Told:
    """`rosx_introspection`, whose names of fields are those of PlotJuggler's curves."""
    import msgpack
    from mcap.reader import make_reader
    from rosx_introspection import Parser

    curves: dict[str, list] = {}
    (path,) = (folder / BAG).glob("*.mcap")
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            parser = Parser(channel.topic, schema.name, schema.data.decode())
            for name, value in msgpack.unpackb(parser.parse_to_msgpack(message.data)).items():
                curves.setdefault(name, []).append(value)
    here = [k for k in range(drive.COUNT) if drive.seen(k)]
    stamps_us = [
        sec * 10**6 + nanosec // 1000
        for sec, nanosec in zip(
            curves["/r01/pose/header/stamp/sec"],
            curves["/r01/pose/header/stamp/nanosec"],
            strict=True,
        )
    ]
    places = zip(here, curves["/r01/pose/pose/position/x"], strict=True)
    return {
        "stamps of headers": stamps_us == [drive.START_US + k * drive.STEP_US for k in here],
        "places": all(abs(x_m - drive.x_m(k)) < 1e-9 for k, x_m in places),
        "duties": [50 * (k >= drive.STANDS) for k in range(drive.COUNT)]
        == curves["/r01/duty_pct/data[3]"],
        "velocities, as TwistStamped": curves["/r02/cmd_vel/twist/linear/y"] == [VELOCITY[1]],
        "wheels, as JointState": curves["/r03/wheels/velocity[1]"] == [SPEEDS[1]],
    }


def _reads(name: str):
    def ours(folder: Path) -> Told:
        import twinmill as tm

        pose, *commands = TOPICS
        told = []
        for command in commands:
            bag = folder / FILES[name]
            log = tm.import_log(bag=bag, pose=[pose], command=[command], robot_id=1)
            log.save(folder / LOG, force=True)
            told.append(drive.told_of_import(folder / LOG, "twist"))
        plain, stamped = told
        by_their_stamps = stamped["commands as twist"] and drive.told_at(folder / LOG)
        return plain | {"commands as stamped twist, by their stamps": by_their_stamps}

    return ours


@reads("rosbag2", "mcap-ros2-support", "mcap-ros2-support==0.6.0", ours=_reads("foxglove"))
def foxglove_writes(folder: Path) -> None:
    """One MCAP file without a folder's metadata."""
    from mcap_ros2.writer import Writer

    with (folder / FILES["foxglove"]).open("wb") as stream:
        writer = Writer(stream)
        schemas = {
            topic: writer.register_msgdef(kind, DEFINITIONS[kind]) for topic, kind in TOPICS.items()
        }
        for k in range(drive.COUNT):
            at_ns = 1000 * (drive.START_US + k * drive.STEP_US)
            writer.write_message("/r01/pose", schemas["/r01/pose"], _pose(k), at_ns, at_ns)
            twist = {
                "linear": _vector(drive.SPEED_MPS * (k >= drive.STANDS)),
                "angular": _vector(0),
            }
            writer.write_message("/r01/cmd_vel", schemas["/r01/cmd_vel"], twist, at_ns, at_ns)
            stamped, late_ns = {"header": _header(_stamp(k)), "twist": twist}, at_ns + LATE_NS
            writer.write_message(
                "/r01/reference", schemas["/r01/reference"], stamped, late_ns, late_ns
            )
        writer.finish()


def _stamp(k: int) -> tuple[int, int]:
    """Stamp of a command, s and ns; all are of their frame but one, which has none."""
    return divmod(1000 * (drive.START_US + k * drive.STEP_US) * (k != BARE), 10**9)


def _header(stamp: tuple[int, int], frame: str = "") -> dict:
    return {"stamp": dict(zip(("sec", "nanosec"), stamp, strict=True)), "frame_id": frame}


def _vector(x: float) -> dict:
    return {"x": float(x), "y": 0.0, "z": 0.0}


def _pose(k: int) -> dict:
    stamp = divmod(1000 * (drive.START_US + k * drive.STEP_US), 10**9)
    x_m = drive.x_m(k) if drive.seen(k) else float("nan")
    return {
        "header": _header(stamp, "map"),
        "pose": {"position": _vector(x_m), "orientation": _vector(0) | {"w": 1.0}},
    }


@reads("rosbag2", "rosbags, SQLite", "rosbags==0.11.9", ours=_reads("ros2"))
def rosbags_writes(folder: Path) -> None:
    """A folder as `ros2 bag record` makes it by SQLite."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder / FILES["ros2"], version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        of = {t: writer.add_connection(t, kind, typestore=store) for t, kind in TOPICS.items()}
        for at_ns, topic, message in _messages(store.types):
            writer.write(of[topic], at_ns, store.serialize_cdr(message, TOPICS[topic]))


@reads("rosbag2", "ROS 2 Jazzy, its messages", *ROS2, "mcap==1.6.0", ours=_reads("rclpy"))
def ros2_writes(folder: Path) -> None:
    """Bytes that a node would send; the file around them is written by Foxglove's library."""
    from geometry_msgs.msg import PoseStamped, TwistStamped
    from mcap.writer import Writer
    from rclpy.serialization import serialize_message

    with (folder / FILES["rclpy"]).open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels = {
            topic: writer.register_channel(
                topic, "cdr", writer.register_schema(kind, "ros2msg", DEFINITIONS[kind].encode())
            )
            for topic, kind in TOPICS.items()
        }
        for k in range(drive.COUNT):
            pose, stamped = PoseStamped(), TwistStamped()
            at_ns = 1000 * (drive.START_US + k * drive.STEP_US)
            pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(at_ns, 10**9)
            stamped.header.stamp.sec, stamped.header.stamp.nanosec = _stamp(k)
            _fill(k, pose, stamped.twist)
            messages = (pose, at_ns), (stamped.twist, at_ns), (stamped, at_ns + LATE_NS)
            for topic, (message, received_ns) in zip(TOPICS, messages, strict=True):
                raw = serialize_message(message)
                writer.add_message(channels[topic], received_ns, raw, received_ns)
        writer.finish()


def _fill(k: int, pose, told) -> None:
    """Messages of ROS, but for their stamps, which differ between ROS 1 and 2."""
    pose.header.frame_id = "map"
    pose.pose.position.x = drive.x_m(k) if drive.seen(k) else float("nan")
    pose.pose.orientation.w = 1.0
    told.linear.x = drive.SPEED_MPS * (k >= drive.STANDS)


@reads("rosbag1", "rosbags", "rosbags==0.11.9", ours=_reads("ros1"))
def rosbags_writes_ros1(folder: Path) -> None:
    """A file as `rosbag record` makes it."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(folder / FILES["ros1"]) as writer:
        of = {t: writer.add_connection(t, kind, typestore=store) for t, kind in TOPICS.items()}
        for at_ns, topic, message in _messages(store.types, seq=0):
            writer.write(of[topic], at_ns, store.serialize_ros1(message, TOPICS[topic]))


@reads("rosbag1", "ROS 1, `rosbag`", "python3-rosbag", "python3-geometry-msgs", ours=_reads("ros1"))
def ros_writes(folder: Path) -> None:
    """ROS's own library, in the Python that Debian built it for."""
    code = f"from interop.rosbag import by_ros; by_ros({str(folder / FILES['ros1'])!r})"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    subprocess.run(["/usr/bin/python3", "-c", code], env=environment, check=True)


def by_ros(path: str) -> None:
    """The drive, each message written as a node would."""
    import rosbag
    from geometry_msgs.msg import PoseStamped, TwistStamped
    from rospy import Duration, Time

    with rosbag.Bag(path, "w") as bag:
        for k in range(drive.COUNT):
            at = Time(*divmod(1000 * (drive.START_US + k * drive.STEP_US), 10**9))
            pose, stamped = PoseStamped(), TwistStamped()
            pose.header.stamp, stamped.header.stamp = at, Time(*_stamp(k))
            _fill(k, pose, stamped.twist)
            bag.write("/r01/pose", pose, at)
            bag.write("/r01/cmd_vel", stamped.twist, at)
            bag.write("/r01/reference", stamped, at + Duration(0, LATE_NS))


def _messages(types: dict, **header):
    """Stamps in ns, topics, and messages of rosbags."""
    point, turn, vector = (
        types[f"geometry_msgs/msg/{name}"] for name in ("Point", "Quaternion", "Vector3")
    )
    for k in range(drive.COUNT):
        at_ns = 1000 * (drive.START_US + k * drive.STEP_US)
        x_m = drive.x_m(k) if drive.seen(k) else float("nan")
        stamp = types["builtin_interfaces/msg/Time"](*divmod(at_ns, 10**9))
        head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map", **header)
        place = types["geometry_msgs/msg/Pose"](point(x_m, 0.0, 0.0), turn(0.0, 0.0, 0.0, 1.0))
        yield at_ns, "/r01/pose", types[POSE](head, place)
        speed_mps = drive.SPEED_MPS * (k >= drive.STANDS)
        twist = types[TWIST](vector(speed_mps, 0.0, 0.0), vector(0.0, 0.0, 0.0))
        yield at_ns, "/r01/cmd_vel", twist
        stamp = types["builtin_interfaces/msg/Time"](*_stamp(k))
        head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **header)
        yield at_ns + LATE_NS, "/r01/reference", types[STAMPED](head, twist)


NOT_RUN = [
    Cell(
        "rosbag2",
        "writes",
        "PlotJuggler, the program",
        why_not="no registry has it; its parser was run",
    ),
    Cell(
        "rosbag2",
        "reads",
        "`ros2 bag`",
        why_not="no registry has rosbag2; ROS's own messages, from PyPI, were run",
    ),
]
