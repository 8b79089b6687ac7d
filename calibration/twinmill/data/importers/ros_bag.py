# SPDX-License-Identifier: Apache-2.0
"""Poses and commands from ROS bags (rosbag1; rosbag2 with sqlite3 or MCAP), without ROS.

Messages are read one by one, so that a bag of any size takes the memory of its poses alone, 72
bytes each.
"""

import re
import struct
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import turbopi

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.importers.beat import at_even_beat
from twinmill.data.importers.ros_cut import check_chunks, is_cut, write_whole
from twinmill.data.importers.ros_frames import Frames, on_floor
from twinmill.data.importers.ros_messages import (
    COMMANDS,
    CORNERS,
    DEFINITIONS,
    ESTIMATES,
    JOINTS,
    MANY,
    ODOMETRY,
    POSES,
    STAND_IN,
    STEERED,
    TAGS,
    TF,
    Row,
    joints_as_they_stand,
    joints_beside_wheels,
    roles_of,
    tag_rows,
    transform_row,
    transforms_of,
)
from twinmill.data.importers.series import (
    CommandSeries,
    PoseSeries,
    velocities_of_steering,
    with_z_up,
)
from twinmill.data.importers.stamps import repeats
from twinmill.data.log import LogError
from twinmill.data.other_files import refuse_other_file
from twinmill.data.unpacking import UnpackError, bound_bag_readers
from twinmill.extras import needing
from twinmill.terminal import progress_bar

WIDTH = 4  # wheels; velocity commands have a zero in the last place
LONGEST_PROFILE = 256  # bytes of a file that are looked at for it
LONGEST_REASON = 200  # letters of what the library says
LOOKED_AT = 5000  # messages of tf, to see which frames there are; of more, counts are estimates
STEP_BACK_S = 1.0  # messages are never exchanged by that much: a clock was set
CLOCK_FROM_ZERO_S = 60.0  # the least stamp of a clock that began at 0, which is no missing stamp
FULL_DUTIES = (1.0, 100.0, 255.0)
SIDES = {2: "left, right", 4: "front left, front right, rear left, rear right"}
OF_BASE = re.compile(r"base(_link|_footprint)?$")
OF_TRACKER = re.compile(
    r"mocap|motion_?capture|vicon|optitrack|natnet|vrpn|qualisys|ground_?truth", re.IGNORECASE
)
OF_ODOMETRY = re.compile(r"odom", re.IGNORECASE)
OF_GOAL = re.compile(r"(^|_)(goal|target|setpoint|waypoint|desired)(_|$)", re.IGNORECASE)
MESSAGE_NAMES = ("pose", "transform", "twist", "drive")  # that tables leave out of topics' names
OF_CAMERA = re.compile(r"camera|optical|(^|_)cam(_|$)")  # frames whose z is ahead, not up


Role = tuple[str, str]  # a topic, and what it is to be: pose or command
VALUES: dict[str, dict[str, Callable[[Any], Row]]] = {
    "pose": POSES,
    "command": {kind: value_of for kind, (_, value_of) in COMMANDS.items()},
}


@dataclass(frozen=True)
class Topic:
    """One topic of a bag, a frame of tf as `/tf:frame`, or a tag as `/tag_detections:3`.

    Attributes:
        name, kind: its name and the type of its messages.
        count: how many there are, `about` if that was not counted to the end; of a fixed frame
            those of the frame that carries it.
        role: `pose`, `command` or empty.
        fixed: whether it is a frame that never moves in its parent.
    """

    name: str
    kind: str
    count: int
    role: str
    fixed: bool = False
    about: bool = False

    @property
    def robot(self) -> str:
        """The word that tells the robot: the last but one of the name; empty if there is none."""
        words = _words(self.name.partition(":")[2] or self.name)
        return words[-2] if len(words) > 1 else ""


@dataclass(frozen=True)
class BagOptions:
    """How to read a bag.

    Attributes:
        robot_id: of the only robot.
        robots: robot_id by a word in the topics; others have the last number in their topics.
        receive: take the times of receipt, not those in the headers.
        wheelbase_m: turns steering angles into turns of the body.
        up: the axis that the poses call up.
        full_duty: the number that stands for full duty; None: the least of FULL_DUTIES that does.
    """

    robot_id: int | None = None
    robots: dict[str, int] = field(default_factory=dict)
    receive: bool = False
    wheelbase_m: float | None = None
    full_duty: float | None = None
    up: str | None = None


def list_topics(path: Path) -> list[Topic]:
    """Topics of a bag, with their types and counts.

    Raises:
        LogError: it is no bag, broken, or empty.
    """
    with open_bag(path) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        counts = {name: topic.msgcount for name, topic in reader.topics.items()}
        many = [c for c in reader.connections if c.msgtype in MANY]
        parts: Counter[tuple[str, str]] = Counter()
        frames = Frames()
        for connection, at_ns, raw in islice(reader.messages(many), LOOKED_AT if many else 0):
            kind, static = connection.msgtype, _is_static(connection.topic)
            message = reader.deserialize(raw, kind)
            if kind == TF:
                _put(frames, message, fixed=static, received_ns=at_ns, wanted={})
            if static:
                continue
            for part in _parts(kind, message):
                parts[f"{connection.topic}:{part}", kind] += 1
    if not sum(counts.values()):
        raise LogError(f"{path}: has no messages; check that the recorder was subscribed.")
    topics = [
        Topic(name, kind, counts[name], next(iter(roles_of(kind)), ""))
        for name, kind in kinds.items()
    ]
    held = sum(counts[c.topic] for c in many)
    scale, about = max(1.0, held / LOOKED_AT), held > LOOKED_AT
    moving = [
        Topic(name, kind, round(scale * count), "pose", about=about)
        for (name, kind), count in parts.items()
    ]
    return sorted([*topics, *moving, *_carried(frames, moving)], key=lambda t: t.name)


def _is_static(topic: str) -> bool:
    """True if it is the topic of frames that never move in their parents."""
    return topic.rpartition("/")[2] == "tf_static"


def _carried(frames: Frames, moving: list[Topic]) -> Iterator[Topic]:
    """Frames fixed to others that move, as frames of the topic of these."""
    by_frame = {t.name.partition(":")[2]: t for t in moving if t.kind == TF}
    for frame in frames.fixed - by_frame.keys():
        if carrier := by_frame.get(frames.carrier(frame)):
            name = f"{carrier.name.partition(':')[0]}:{frame}"
            yield replace(carrier, name=name, fixed=True)


def _parts(kind: str, message: object) -> Iterator[str]:
    """Frames or tags in a message."""
    if kind == TF:
        yield from (child for child, _, _ in transforms_of(message))
    else:
        yield from (number for number, _ in tag_rows(message))


def guess_pairs(topics: list[Topic]) -> list[tuple[str, str]]:
    """Pose and command topic of each robot: of one name; the one with most messages, or stamped.

    What a tracker measured comes before what the robot estimates, and odometry last, by `_Origin`.
    Where nothing is a command, what odometry measured stands in, beside its own poses if there are
    no others. Poses without either have an empty name as their command.
    """
    pairs = []
    all_commands = [t for t in topics if t.role == "command"]
    if not all_commands:
        poses = [t for t in topics if t.role == "pose"]
        all_commands = [t for t in poses if t.kind == ODOMETRY]
        apart = (_Origin.GOAL, _Origin.ODOMETRY)
        topics = [t for t in poses if _origin(t) not in apart] or poses
        if not all_commands:
            robots = sorted({t.robot for t in poses})
            own = ([t for t in poses if t.robot == robot] for robot in robots)
            return [(max(of_one, key=_likely).name, "") for of_one in own]
    robots = sorted({t.robot for t in all_commands})
    for robot in robots:
        commands = [t for t in all_commands if t.robot == robot]
        poses = [
            t
            for t in topics
            if t.role == "pose"
            and (
                robot in (t.robot, *_words(t.name))
                or len(robots) == 1
                or _is_tag_of(t, commands[0].name)
            )
        ]
        if poses:
            best = max(poses, key=lambda t: _likely(t, robot))
            told = max(commands, key=lambda t: (t.count, t.kind.endswith("Stamped")))
            pairs.append((best.name, told.name))
    return pairs


def _is_tag_of(topic: Topic, command: str) -> bool:
    """True if a tag has the number of a robot."""
    of_tag = topic.kind in TAGS or bool(re.search(r":tag.*:\d+$", topic.name))
    return of_tag and _told(topic.name.rpartition(":")[2], "", {}) == _told("", command, {})


class _Origin(IntEnum):
    """Where poses come from, by how well they judge a robot."""

    GOAL = 0
    FRAME = 1
    ODOMETRY = 2
    ESTIMATE = 3
    MEASURED = 4
    TRACKER = 5


def _origin(topic: Topic) -> _Origin:
    """By name and type: goals are PoseStamped, too, and trackers may send odometry."""
    if OF_TRACKER.search(topic.name):
        return _Origin.TRACKER
    if topic.kind in MANY:
        return _Origin.FRAME
    if OF_GOAL.search(topic.name.rpartition("/")[2]):
        return _Origin.GOAL
    if topic.kind == ODOMETRY or OF_ODOMETRY.search(topic.name):
        return _Origin.ODOMETRY
    return _Origin.ESTIMATE if topic.kind in ESTIMATES else _Origin.MEASURED


def _likely(topic: Topic, robot: str | None = None) -> tuple[bool, _Origin, bool, bool, bool, int]:
    """Poses of no other number first, then by origin, those in the robot's own namespace.

    Then frames of a base before wheels, then the most messages. Of fixed frames only the base
    itself counts: sensors are often called after what carries them.

    Args:
        topic: one of poses.
        robot: word that tells the robot; None: any.
    """
    origin = _origin(topic)
    numbers = [_told(name, "", {}) for name in (topic.name, robot or "")]
    own = origin == _Origin.TRACKER or None in numbers or numbers[0] == numbers[1]
    base = OF_BASE.search(topic.name) if topic.fixed else "base" in topic.name
    return own, origin, topic.robot == robot, bool(base), not topic.fixed, topic.count


def numbering(pairs: list[tuple[str, str]]) -> dict[str, Any]:
    """Options that number the robots whose topics have no number."""
    open_pairs = [pair for pair in pairs if _told(*pair, {}) is None]
    if open_pairs and len(pairs) == 1:
        return {"robot_id": 1}
    taken = {_told(*pair, {}) for pair in pairs}
    free = (k for k in range(1, 100) if k not in taken)
    names = {_name_in(command or pose): next(free) for pose, command in open_pairs}
    return {"robot": names} if names else {}


def _words(name: str) -> list[str]:
    return [word for word in re.split("[/:]", name) if word]


def _name_in(command: str) -> str:
    words = _words(command)
    return words[-2] if len(words) > 1 else words[-1]


def _told(pose: str, command: str, robots: dict[str, int]) -> int | None:
    """Number of a robot by a name in its topics, or the last digits in them."""
    named = [robots[word] for word in _words(command) + _words(pose) if word in robots]
    digits = re.findall(r"\d+", command) or re.findall(r"\d+", pose)
    number = named[0] if named else int(digits[-1]) if digits else 100
    return number if number < 100 else None


def read_bag(
    path: Path, poses: list[str], commands: list[str], options: BagOptions
) -> tuple[list[PoseSeries], list[CommandSeries]]:
    """Series of each robot.

    Args:
        path: file or folder of the bag.
        poses: topics, one for each robot; a frame of tf is `/tf:frame`.
        commands: topics, in the same order of robots; or none at all.
        options: how to read it.

    Raises:
        LogError: unreadable, a topic that is not there or holds nothing that is known.
    """
    if not poses or (commands and len(poses) != len(commands)):
        likely = ", ".join(" with ".join(filter(None, p)) for p in guess_pairs(list_topics(path)))
        raise LogError(
            f"{option('pose')} and {option('command')}: give one of each for each robot, in the "
            f"same order{f'; here that may be {likely}' if likely else ''}."
        )
    pairs = list(zip(poses, commands or [""] * len(poses), strict=True))
    numbers = [_number(pair, options, len(pairs)) for pair in pairs]
    roles = [*((topic, "pose") for topic in poses), *((topic, "command") for topic in commands)]
    rows = _rows(path, roles, options)
    _check_options(options, {given.kind for (_, role), given in rows.items() if role == "command"})
    for (pose, command), number in zip(pairs, numbers, strict=True):
        if command and {_told(pose, "", {}), _told("", command, {})} - {None, number}:
            rows[pose, "pose"].notes.append(f"{pose} and {command} are taken for robot {number}.")
    pose_series = [
        _poses(n, rows[topic, "pose"], options) for n, topic in zip(numbers, poses, strict=True)
    ]
    command_series = [
        _commands(n, rows[topic, "command"], options)
        for n, (_, topic) in zip(numbers, pairs, strict=True)
        if topic
    ]
    return pose_series, command_series


def _check_options(options: BagOptions, kinds: set[str]) -> None:
    """Raises LogError where a number is given that the commands, by their kinds, do not need."""
    if options.wheelbase_m is not None and not kinds & {*STEERED}:
        raise LogError(
            f"{option('wheelbase_m')}: no command is a steering angle; leave the option out."
        )
    if options.full_duty is not None and all(COMMANDS[kind][0] != "duty" for kind in kinds):
        raise LogError(f"{option('full_duty')}: no command is a duty; leave the option out.")


def _number(pair: tuple[str, str], options: BagOptions, robots: int) -> int:
    if options.robot_id is not None and robots == 1:
        return options.robot_id
    number = _told(*pair, options.robots)
    if number is None:
        topic = pair[1] or pair[0]
        remedy = option("robot_id", 1) if robots == 1 else option("robot", {_name_in(topic): 1})
        raise LogError(
            f"{topic}: has no number in 0..99 that tells the robot; number it, for example with "
            f"{remedy}."
        )
    return number


@contextmanager
def open_bag(path: Path):
    """The bag, open for reading; what goes wrong inside is one sentence."""
    with needing("ros"):  # slow to import
        from apsw import Error as SqliteError
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag1 import ReaderError as Error1
        from rosbags.rosbag2 import ReaderError as Error2
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    for kind, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, kind))
    bound_bag_readers()
    try:
        with TemporaryDirectory() as folder:
            storage = _storage(path)
            for file in sorted(storage.glob("*.[dm]*[3p]")) if storage.is_dir() else [storage]:
                refuse_other_file(file, "a ROS bag")
            check_chunks(storage)
            if is_cut(storage):
                write_whole(storage, Path(folder) / "whole.mcap")
                storage = Path(folder) / "whole.mcap"
            if storage.is_dir() and storage.suffix == ".bag":  # the library takes it for rosbag1
                link = Path(folder) / "bag"
                link.symlink_to(storage.resolve())
                storage = link
            bag = AnyReader([storage], default_typestore=store)
            bag.readers = list(map(_Known, bag.readers))
            with bag as reader:
                yield reader
    except LogError:
        raise
    except UnpackError as error:
        raise LogError(f"{path}: is refused: {error}.") from error
    except (  # whatever the library says of bytes that make no sense
        *(AnyReaderError, Error1, Error2, SerdeError, SqliteError, OSError, LookupError),
        *(AssertionError, AttributeError, ValueError, MemoryError, OverflowError, RuntimeError),
        struct.error,
    ) as error:
        reason = " ".join(str(error).split())[:LONGEST_REASON] or type(error).__name__
        raise LogError(
            f"{path}: cannot be read as a ROS bag ({reason}); {_remedy(path)}."
        ) from error


class _Known:
    """A reader of the library without topics whose types it cannot parse, as services' events."""

    def __init__(self, reader: Any):
        self._reader = reader

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def __enter__(self) -> "_Known":
        self._reader.__enter__()
        return self

    def __exit__(self, *error: object) -> object:
        return self._reader.__exit__(*error)

    @property
    def connections(self) -> list:
        """Those that can be read."""
        return [c for c in self._reader.connections if _is_known(c)]


def _is_known(connection: Any) -> bool:
    from rosbags.typesys import TypesysError, get_types_from_msg

    if connection.msgdef.format.name != "MSG":
        return True
    try:
        get_types_from_msg(connection.msgdef.data, connection.msgtype)
    except TypesysError:
        return False
    return True


def _storage(path: Path) -> Path:
    """The file in a folder whose metadata were not written, since the recorder was stopped hard."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return path
    files = [f for f in sorted(path.iterdir()) if f.suffix in (".mcap", ".db3")]
    if len(files) == 1:
        return files[0]
    raise LogError(
        f"{path}: is a folder without metadata.yaml and with {len(files)} files .mcap or .db3; "
        "name one of them, or write it with `ros2 bag reindex`."
    )


def _remedy(path: Path) -> str:
    """Advice for a bag that cannot be read."""
    mend = {
        ".bag": f"if it was cut off, mend it with `rosbag reindex {path.name}`",
        ".mcap": f"if it was cut off, mend it with `mcap recover {path.name} -o whole.mcap`",
        ".db3": f"if it was cut off, mend it with `sqlite3 {path.name} .recover`",
    }
    if path.is_dir():
        return "if it was cut off, mend it with `ros2 bag reindex`, or name the file in it"
    if path.exists() and path.suffix in mend:
        profile = _profile(path)
        if profile not in (None, "ros2"):
            return (
                f"its profile is '{profile}', so its messages are not of ROS 2: convert it, or, if "
                "Twinmill exported it, take the log that it was made from"
            )
        return mend[path.suffix]
    return "name the .bag or .mcap file, or the folder with metadata.yaml"


def _profile(path: Path) -> str | None:
    """Profile in an MCAP file's header; None if it is no such file or is cut off there."""
    with path.open("rb") as stream:
        begin = stream.read(LONGEST_PROFILE)
    head = struct.Struct("<8sBQI")  # https://mcap.dev/spec: magic, then the record `Header`
    if len(begin) < head.size:
        return None
    magic, record, _, length = head.unpack_from(begin)
    name = begin[head.size : head.size + length]
    if magic != b"\x89MCAP0\r\n" or record != 1 or len(name) != length:
        return None
    return name.decode(errors="replace")


@dataclass
class _Messages:
    """Messages of one topic, as they come; `values` are the rows one after the other."""

    kind: str
    header_ns: array = field(default_factory=lambda: array("q"))
    received_ns: array = field(default_factory=lambda: array("q"))
    values: array = field(default_factory=lambda: array("d"))
    widths: set[int] = field(default_factory=set)
    root: str = ""  # of the tree, for a frame of tf
    lost: int = 0  # the bag says that it has more
    left_out: list[str] = field(default_factory=list)  # joints that are no wheels
    unordered: list[str] = field(default_factory=list)  # wheels whose names tell no order

    def add(self, stamp: object, received_ns: int, value: Row) -> None:
        self.header_ns.append(stamp.sec * 10**9 + stamp.nanosec if stamp else 0)
        self.received_ns.append(received_ns)
        self.values.extend(value)
        self.widths.add(len(value))

    def __len__(self) -> int:
        return len(self.header_ns)


@dataclass(frozen=True)
class _Rows:
    """Rows of one topic, ready to be taken for poses or commands.

    Attributes:
        topic, kind: its name and type.
        utime_us: (N,) as they came.
        value: (N, W); (N, 0) where the messages have different numbers of values.
        widths: how many values they have.
        notes: remarks.
        of_camera: whether poses are in a camera's frame, z ahead.
    """

    topic: str
    kind: str
    utime_us: np.ndarray
    value: np.ndarray
    widths: list[int]
    notes: list[str]
    of_camera: bool = False

    @classmethod
    def of(cls, topic: str, role: str, messages: _Messages, receive: bool) -> "_Rows":
        """Those that are kept, on the clock that is taken."""
        stamps_ns, kept, notes = _stamps(topic, role, messages, receive)
        if messages.lost:
            notes.append(
                f"{topic}: {messages.lost} of {len(messages) + messages.lost} messages "
                "cannot be read: the bag is damaged."
            )
        if messages.left_out:
            notes.append(
                f"{topic}: joints that are called wheels are taken, not "
                f"{', '.join(messages.left_out)}."
            )
        if sides := SIDES.get(len(messages.unordered)):
            notes.append(
                f"{topic}: {', '.join(messages.unordered)} are taken for {sides}, as they stand: "
                "their names do not tell; see what `twinmill robot wheels` or `diagnose` says."
            )
        if messages.root:
            notes.append(f"{topic}: its place in the frame {messages.root} is taken.")
        if messages.kind == ODOMETRY and role == "command":
            notes.append(f"{topic}: {STAND_IN}.")
        elif messages.kind == ODOMETRY or _words(messages.root)[-1:] == ["odom"]:
            notes.append(
                f"{topic}: is odometry; if it counts the robot's own wheels, slip and wrong wheels "
                "do not show in it: then take poses of a camera or of motion capture."
            )
        value = np.empty((len(messages), 0))
        if len(messages.widths) == 1:
            value = np.frombuffer(messages.values).reshape(len(messages), -1)
        widths = sorted(messages.widths)
        camera = messages.kind in TAGS or bool(OF_CAMERA.search(messages.root.lower()))
        utime_us = stamps_ns[kept] // 1000
        return cls(
            topic=topic,
            kind=messages.kind,
            utime_us=utime_us,
            value=value[kept],
            widths=widths,
            notes=notes,
            of_camera=camera,
        )

    def ordered(self) -> tuple[np.ndarray, list[str]]:
        """Rows in order of time, the last of each stamp; remarks."""
        rows = np.argsort(self.utime_us, kind="stable")
        last = np.append(np.diff(self.utime_us[rows]) > 0, True)
        if last.all():
            return rows, self.notes
        note = repeats(self.topic, np.count_nonzero(~last), len(last), "message")
        return rows[last], [*self.notes, note]


def _rows(path: Path, topics: list[Role], options: BagOptions) -> dict[Role, _Rows]:
    """By topic and what it is to be; what is to be said of the bag stands with the first."""
    found = _read(path, topics)
    rows = {key: _Rows.of(*key, messages, options.receive) for key, messages in found.items()}
    next(iter(rows.values())).notes[:0] = _of_bag(path)
    return rows


def _of_bag(path: Path) -> list[str]:
    """Remarks on a bag whose recorder was stopped hard."""
    storage = _storage(path)
    notes = []
    if storage != path:
        notes.append(f"{path.name}: has no metadata.yaml; its only file is read as it is.")
    if is_cut(storage):
        notes.append(f"{storage.name}: was cut off; what is before the break is read.")
    return notes


def _read(path: Path, topics: list[Role]) -> dict[Role, _Messages]:
    """Messages of each topic that is wanted, and of each frame of tf."""
    found: dict[Role, _Messages] = {}
    wanted: dict[str, dict[str, _Messages]] = {}  # frames, by the topic of tf
    whole: dict[str, list[tuple[_Messages, Callable[[Any], Row]]]] = {}  # topics that are one thing
    frames, with_frames = Frames(), any(":" in topic for topic, _ in topics)
    with open_bag(path) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        names = [_in_bag(topic.partition(":")[0], role, kinds) for topic, role in topics]
        if missing := [name for name in names if name not in kinds]:
            raise LogError(
                f"{path.name}: has no topic {missing[0]}; it has {', '.join(sorted(kinds))}."
            )
        for (topic, role), name in zip(topics, names, strict=True):
            kind = kinds[name]
            if kind in MANY and topic == name:
                what = "frames" if kind == TF else "tags"
                raise LogError(
                    f"{path.name}: {name} holds many {what}; name one as {name}:"
                    f"{what[:-1].upper()} (`twinmill import` of the bag alone lists them)."
                )
            if kind == CORNERS:
                raise LogError(
                    f"{path.name}: {name} holds corners of tags without poses; record /tf, too, "
                    "and name the tag there, as in /tf:tag36h11:3."
                )
            if not roles_of(kind) and kind not in MANY:
                raise LogError(f"{path.name}: {topic} holds {kind}, which is not read here.")
            if kind not in VALUES[role] and (kind not in MANY or role == "command"):
                raise LogError(f"--{role}: {topic} holds {kind}, which is no {role}.")
            found[topic, role] = _Messages(kind)
            if kind == TF:
                wanted.setdefault(name, {})[topic.partition(":")[2]] = found[topic, role]
            elif kind not in TAGS:
                whole.setdefault(name, []).append((found[topic, role], VALUES[role][kind]))
        chosen = [
            c for c in reader.connections if c.topic in names or (with_frames and c.msgtype == TF)
        ]
        count = sum({c.topic: reader.topics[c.topic].msgcount for c in chosen}.values())
        for connection, received_ns, raw in _shown(path, count, reader.messages(chosen)):
            message, name = reader.deserialize(raw, connection.msgtype), connection.topic
            if connection.msgtype == TF:
                fixed, of_topic = _is_static(name), wanted.get(name, {})
                _put(frames, message, fixed=fixed, received_ns=received_ns, wanted=of_topic)
                continue
            kind = connection.msgtype
            if kind in TAGS:
                for number, row in tag_rows(message):
                    own = found.get((f"{name}:{number}", "pose"))
                    if own is not None:
                        own.add(message.header.stamp, received_ns, row)
                continue
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            for own, value_of in whole[name]:
                if kind == JOINTS and not own:
                    own.left_out = joints_beside_wheels(message)
                    own.unordered = joints_as_they_stand(message)
                own.add(stamp, received_ns, value_of(message))
        for name, of_topic in whole.items():
            for own, _ in of_topic:
                own.lost = reader.topics[name].msgcount - len(own)
    for (topic, _), messages in found.items():
        if messages:
            continue
        if _is_static(topic.partition(":")[0]):
            raise LogError(
                f"{path.name}: {topic} does not move; where the frame that it is fixed to moves on "
                f"/tf, name it as /tf:{topic.partition(':')[2]}."
            )
        raise LogError(f"{path.name}: {topic} holds nothing; choose another.")
    return found


def _in_bag(name: str, role: str, kinds: dict[str, str]) -> str:
    """A topic's whole name, where it was told without its end, as tables of several topics do."""
    if name in kinds:
        return name
    ends = (f"{name.rstrip('/')}/{word}" for word in MESSAGE_NAMES)
    whole = [end for end in ends if kinds.get(end) in VALUES[role]]
    return whole[0] if len(whole) == 1 else name


def _shown(path: Path, count: int, messages: Iterator) -> Iterator:
    """The messages, with progress and time left on stderr if that is a terminal."""
    with progress_bar(counted=False) as progress:
        yield from progress.track(messages, total=count, description=path.name)


def _put(
    frames: Frames,
    message: object,
    *,
    fixed: bool,
    received_ns: int,
    wanted: dict[str, _Messages],
) -> None:
    """Adds a message of tf to the tree, and the places of the frames that are wanted of its topic.

    A wanted frame that is fixed moves whenever the one that carries it does.
    """
    for frame, parent, transform in transforms_of(message):
        row = transform_row(transform.transform)
        frames.put(frame, parent, row, fixed=fixed)
        for child, messages in wanted.items():
            if frames.carrier(child) != frame:
                continue
            root, row = frames.place(child)
            if root != messages.root:  # what came before the tree was whole is of another frame
                messages.root = root
                for rows in (messages.header_ns, messages.received_ns, messages.values):
                    del rows[:]
            messages.add(transform.header.stamp, received_ns, row)


def _stamps(
    topic: str, role: str, messages: _Messages, receive: bool
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """(N,) ns, (N,) bool which to keep, remarks.

    A command without a stamp is one: ros2_control takes it when it comes. A pose is left out.

    Raises:
        LogError: the clock of the headers was set while it recorded.
    """
    header, received = (
        np.array(rows, np.int64) for rows in (messages.header_ns, messages.received_ns)
    )
    stamped = header > 0
    everything = np.full(len(header), True)
    heard, before = _heard(topic, received)
    if not stamped.any():
        note = f"{topic}: has no header stamps; the times of receipt are taken."
        return received, heard, [note, *before]
    late_ms = float(np.median((received - header)[stamped])) * 1e-6
    taken = "times of receipt" if receive else "header stamps"
    notes = [
        f"{topic}: the {taken} are taken; messages were received {late_ms:.1f} ms after their "
        "header stamps (median)."
    ]
    if receive:
        return received, heard, [*notes, *before]
    kept = everything
    if not stamped.all() and header[stamped].min() > CLOCK_FROM_ZERO_S * 1e9:
        bare = f"{topic}: {counted(np.count_nonzero(~stamped), 'message')} without a stamp"
        if role == "command":
            header = np.where(stamped, header, received - round(late_ms * 1e6))
            notes.append(f"{bare}, taken for sent {late_ms:.1f} ms before receipt, as the others.")
        else:
            kept = stamped
            notes.append(f"{bare}, left out.")
    steps_s = np.diff(header[kept]) * 1e-9
    back = steps_s < 0
    if back.any() and -steps_s.min() > STEP_BACK_S:
        raise LogError(
            f"{topic}: the header stamps go back by {-steps_s.min():.3f} s at message "
            f"{int(steps_s.argmin()) + 2}: a clock was set while it recorded; take the times of "
            f"receipt with {option('receive_stamps', True)}."
        )
    if back.any():
        notes.append(
            f"{topic}: {counted(np.count_nonzero(back), 'message')} earlier than the one before; "
            "sorted."
        )
    return header, kept, notes


def _heard(topic: str, received: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """(N,) bool, times of receipt that are some; a remark on those before a simulated clock began.

    A recorder with `use_sim_time` takes 0 for what it hears before the first /clock. One message at
    0, and the next as soon after as others follow each other, is a clock that began at 0.
    """
    heard = received > 0
    gaps = np.diff(np.sort(received[heard]))
    begins = np.count_nonzero(~heard) == 1 and len(gaps) and received[heard].min() <= gaps.max()
    if heard.all() or not heard.any() or begins:
        return np.full(len(received), True), []
    early = counted(np.count_nonzero(~heard), "message")
    return heard, [f"{topic}: {early} received at time 0, before the clock began; left out."]


def _poses(robot_id: int, given: _Rows, options: BagOptions) -> PoseSeries:
    if given.of_camera and options.up:
        raise LogError(
            f"{option('up', options.up)}: {given.topic} is seen by a camera, and laid on the floor "
            "that its "
            "poses are on; leave the option out."
        )
    utime_us, evened = at_even_beat(given.utime_us, given.topic)
    given = replace(given, utime_us=utime_us, notes=given.notes + evened)
    rows, notes = given.ordered()
    value = given.value[rows]
    norm = np.linalg.norm(value[:, 3:], axis=1)
    valid = np.isfinite(value).all(axis=1) & (np.abs(norm - 1) < 0.05)
    value[~valid] = np.nan
    value[valid, 3:] /= norm[valid, None]
    if given.of_camera and valid.any():
        value[valid, :3], value[valid, 3:], note = on_floor(value[valid, :3], value[valid, 3:])
        notes = [*notes, f"{given.topic}: {note}."]
    position_m, quaternion = with_z_up(value[:, :3], value[:, 3:], options.up or "z")
    return PoseSeries(robot_id, given.utime_us[rows], position_m, quaternion, valid, notes)


def _commands(robot_id: int, given: _Rows, options: BagOptions) -> CommandSeries:
    topic, kind = given.topic, given.kind
    if kind == JOINTS and given.widths == [0]:
        raise LogError(
            f"{option('command')}: {topic} has positions of joints and no velocities; record what "
            "the wheels "
            "are told, or let the driver publish velocities."
        )
    if len(given.widths) > 1 or given.widths[0] not in (2, 3, WIDTH):
        raise LogError(
            f"{option('command')}: {topic} has {' or '.join(map(str, given.widths))} numbers a "
            "message, but "
            "a robot here has two to four wheels, and each message tells all; choose another topic."
        )
    rows, notes = given.ordered()
    value = given.value[rows]
    if not np.isfinite(value).all():
        raise LogError(
            f"{option('command')}: {topic} holds numbers that are not finite; correct the program "
            "that "
            "recorded them."
        )
    command_kind = COMMANDS[kind][0]
    if kind in STEERED:
        value = velocities_of_steering(topic, *value.T, options.wheelbase_m)
    elif value.shape[1] == 2:  # left, right
        value = value[:, [0, 1, 0, 1]]
    elif value.shape[1] == 3:
        value = np.column_stack([value, np.zeros(len(value))])
    if command_kind == "duty":
        value, more = _percent(topic, value, options.full_duty)
        notes = notes + more
    unknown = np.full((len(rows), 2), np.nan)
    return CommandSeries(
        robot_id=robot_id,
        utime_us=given.utime_us[rows],
        kind=command_kind,
        value=value,
        repeat=command_kind == "duty",
        inputs=unknown,
        detected=np.zeros((len(rows), 2), int),
        mode=turbopi.telemetry_t.MODE_SCRIPT,
        warnings=notes,
    )


def _percent(topic: str, value: np.ndarray, full: float | None) -> tuple[np.ndarray, list[str]]:
    """Duties in percent, and what was taken for full duty."""
    top = float(np.abs(value).max())
    given, notes = full is not None, []
    if full is None:
        full = next((f for f in FULL_DUTIES if top <= f), FULL_DUTIES[-1]) if top else 100.0
    if not full > 0 or top > full:
        raise LogError(
            f"{option('command')}: {topic}: duties go to {top:g}, beyond {full:g} for full duty; "
            "say which "
            f"number is full duty with {option('full_duty')}."
        )
    if full != 100 and not given:
        notes = [
            f"{topic}: duties go to {top:g}: {full:g} is taken for full duty; else give "
            f"{option('full_duty')}."
        ]
    return value * (100 / full), notes
