# SPDX-License-Identifier: Apache-2.0
"""Files that hold a log of joints: MCAP with messages of ROS 2, npz, and CSV of our columns."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from twinmill.data.lcm_log import LogError
from twinmill.extras import needing
from twinmill.joints.log import JointLog

TIME, POSITION, VELOCITY, COMMAND = "t_s", "qpos.", "qvel.", "ctrl."  # how columns of files begin
STATES, COMMANDS = "/joint_states", "/joint_commands"  # topics
STATE_KIND, COMMAND_KIND = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray"
METADATA = "twinmill.joints"  # in MCAP, with what messages do not hold
SUFFIXES = (".mcap", ".npz")  # that are written
NS = 1_000_000_000


def read_joint_log(path: Path) -> JointLog:
    """A log in a file: MCAP as `write_joint_log` makes it, npz with the fields of `JointLog`, CSV.

    A CSV has `t_s`, one column `qpos.NAME` for each joint and one `ctrl.NAME` for each actuator;
    `qvel.NAME` if there are velocities.

    Raises:
        LogError: it cannot be read, or columns are missing.
    """
    path = Path(path)
    if path.suffix == ".mcap":
        return _of_mcap(path)
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as held:
                return _of_arrays({key: held[key] for key in held.files}, path.name)
        return _of_table(pd.read_csv(path), path.name)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise LogError(
            f"{path}: cannot be read as a log of joints ({error}); give npz with t_s, ctrl and "
            "qpos, or CSV with columns t_s, qpos.NAME and ctrl.NAME; "
            "`twinmill import joints` makes one of other files."
        ) from error


def _of_arrays(held: dict[str, np.ndarray], name: str) -> JointLog:
    for needed in ("t_s", "ctrl", "qpos"):
        if needed not in held:
            raise LogError(f"{name}: has no array '{needed}'; it needs t_s, ctrl and qpos.")
    more: dict[str, Any] = {
        key: tuple(map(str, np.atleast_1d(held[key])))
        for key in ("joints", "actuators")
        if key in held
    }
    if "begins" in held:
        more["begins"] = tuple(map(int, held["begins"]))
    return JointLog(held["t_s"], held["ctrl"], held["qpos"], held.get("qvel"), name=name, **more)


def _of_table(table: pd.DataFrame, name: str) -> JointLog:
    if TIME not in table:
        raise LogError(
            f"{name}: has no column '{TIME}'; its first are {_first(table)}. "
            "`twinmill import joints` takes other names."
        )
    own = {
        begin: [str(c) for c in table.columns if str(c).startswith(begin)]
        for begin in (POSITION, COMMAND, VELOCITY)
    }
    for begin in (POSITION, COMMAND):
        if not own[begin]:
            raise LogError(
                f"{name}: has no column '{begin}NAME'; its first are {_first(table)}. "
                "`twinmill import joints` takes other names."
            )
    joints = [c.removeprefix(POSITION) for c in own[POSITION]]
    speeds = [VELOCITY + joint for joint in joints]
    return JointLog(
        table[TIME].to_numpy(float),
        table[own[COMMAND]].to_numpy(float),
        table[own[POSITION]].to_numpy(float),
        table[speeds].to_numpy(float) if set(speeds) <= set(table.columns) else None,
        joints,
        [c.removeprefix(COMMAND) for c in own[COMMAND]],
        name=name,
    )


def _first(table: pd.DataFrame) -> str:
    return ", ".join(map(str, table.columns[:6]))


def write_joint_log(log: JointLog, path: Path, told: Mapping[str, str], suffix: str) -> None:
    """Writes a log whose columns have names.

    Args:
        log: to be written.
        path: replaced.
        told: words by name, kept in MCAP as metadata: how it was made.
        suffix: one of SUFFIXES: the format.
    """
    if suffix == ".mcap":
        _write_mcap(log, path, told)
    else:
        log.saved(path)


def _write_mcap(log: JointLog, path: Path, told: Mapping[str, str]) -> None:
    """JointState and Float64MultiArray at each stamp, as ROS 2 has them."""
    with needing("ros"):  # slow to import
        from mcap.writer import Writer
        from rosbags.typesys import Stores, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds, names = store.types, list(log.joints or ())
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    nothing = np.zeros(0)
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="twinmill")
        channels = {}
        for topic, kind in ((STATES, STATE_KIND), (COMMANDS, COMMAND_KIND)):
            text, _ = store.generate_msgdef(kind, ros_version=2)
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        kept = {"actuators": list(log.actuators or ()), "begins": list(log.begins)}
        writer.add_metadata(METADATA, {**told, **{k: json.dumps(v) for k, v in kept.items()}})
        for k, t_s in enumerate(log.t_s - min(float(log.t_s[0]), 0.0)):
            at_ns = round(float(t_s) * NS)
            stamp = kinds["builtin_interfaces/msg/Time"](sec=at_ns // NS, nanosec=at_ns % NS)
            state = kinds[STATE_KIND](
                header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
                name=names,
                position=log.qpos[k],
                velocity=nothing if log.qvel is None else log.qvel[k],
                effort=nothing,
            )
            command = kinds[COMMAND_KIND](layout=layout, data=log.ctrl[k])
            for topic, kind, message in (
                (STATES, STATE_KIND, state),
                (COMMANDS, COMMAND_KIND, command),
            ):
                data = bytes(store.serialize_cdr(message, kind))
                writer.add_message(channels[topic], at_ns, data, at_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def _of_mcap(path: Path) -> JointLog:
    with needing("ros"):  # slow to import
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore
    store = get_typestore(Stores.ROS2_HUMBLE)
    rows: dict[str, list[Any]] = {STATES: [], COMMANDS: []}
    stamps_ns = []
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            kept = [m.metadata for m in reader.iter_metadata() if m.name == METADATA]
            for schema, channel, message in reader.iter_messages([*rows]) if kept else ():
                kind = schema.name if schema else ""
                rows[channel.topic].append(store.deserialize_cdr(message.data, kind))
                stamps_ns += [message.log_time] * (channel.topic == STATES)
    except (McapError, SerdeError, OSError, ValueError, KeyError) as error:
        raise LogError(f"{path}: cannot be read as MCAP ({error}); make it anew.") from error
    if not kept:
        raise LogError(
            f"{path}: is an MCAP file that `twinmill import joints` did not make; import it first."
        )
    states = rows[STATES]
    has_speed = all(len(m.velocity) for m in states)
    return JointLog(
        np.array(stamps_ns) / NS,
        np.array([m.data for m in rows[COMMANDS]]),
        np.array([m.position for m in states]),
        np.array([m.velocity for m in states]) if has_speed else None,
        tuple(states[0].name) if states else (),
        tuple(json.loads(kept[0]["actuators"])),
        name=path.name,
        begins=tuple(json.loads(kept[0]["begins"])),
    )
