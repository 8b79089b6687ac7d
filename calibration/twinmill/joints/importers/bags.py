# SPDX-License-Identifier: Apache-2.0
"""Positions and commands of joints from ROS bags: JointState, and arrays of numbers.

An array has no stamp but that of its receipt. Positions have one in their header, which jitters
less: it is moved by the median time from it to the receipt, so that both are by the recorder's
clock, as late as each other.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.ros_bag import open_bag
from twinmill.data.lcm_log import LogError
from twinmill.joints.files import COMMAND, NS, POSITION, VELOCITY
from twinmill.joints.importers.signals import Recording, Signal

STATE = "sensor_msgs/msg/JointState"
ARRAYS = tuple(f"std_msgs/msg/{kind}MultiArray" for kind in ("Float64", "Float32"))
FIELDS = ("position", "velocity", "effort")  # of a JointState
USUAL = "joint_states"  # what a topic of states ends in, by ROS's convention
SLOW_CLOCK_S = 1.0  # between header and receipt, from which they are clocks of their own


def is_bag(path: Path) -> bool:
    """True for a folder, and for files that end as bags do."""
    return path.is_dir() or path.suffix in (".mcap", ".db3", ".bag")


def read_bag(path: Path, state: str = "", command: str = "") -> list[Recording]:
    """The one run of a bag.

    Args:
        path: file or folder.
        state: topic of positions; empty for the only one that it may be.
        command: topic of commands, likewise.

    Raises:
        LogError: it cannot be read, or a topic is missing or is one of several.
    """
    with open_bag(path) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        state, command = _topics(path.name, kinds, state, command)
        wanted = [c for c in reader.connections if c.topic in (state, command)]
        rows: dict[str, list[tuple[int, Any]]] = {state: [], command: []}
        for connection, at_ns, raw in reader.messages(wanted):
            rows[connection.topic].append((at_ns, reader.deserialize(raw, connection.msgtype)))
    for topic in (state, command):
        if not rows[topic]:
            raise LogError(f"{path.name}: {topic} has no messages; record it.")
    zero_ns = min(rows[topic][0][0] for topic in (state, command))
    stamps_s, notes = _by_header(rows[state], zero_ns, state)
    received_s = (np.array([at for at, _ in rows[command]], dtype=np.int64) - zero_ns) / NS
    signals = _states(state, rows[state], stamps_s, (POSITION, VELOCITY))
    if kinds[command] == STATE:
        received_s, more = _by_header(rows[command], zero_ns, command)
        signals += _states(command, rows[command], received_s, (COMMAND,) * 3)
        notes += more
    else:
        signals += _array(command, [m for _, m in rows[command]], received_s)
    return [Recording(path.name, signals, tuple(notes))]


def _topics(name: str, kinds: dict[str, str], state: str, command: str) -> tuple[str, str]:
    """Topics of positions and of commands.

    Raises:
        LogError: one is not there, or it may be one of several.
    """
    states = [topic for topic, kind in kinds.items() if kind == STATE]
    own = [topic for topic in states if topic.endswith(USUAL)]
    state = _one(kinds, "state", state, name=name, likely=own if len(own) == 1 else states)
    others = [topic for topic, kind in kinds.items() if kind in (STATE, *ARRAYS) and topic != state]
    return state, _one(kinds, "command", command, name=name, likely=others)


def _one(
    kinds: dict[str, str], argument: str, asked: str, *, name: str, likely: Sequence[str]
) -> str:
    """The topic that was asked for, or else the only one that it may be."""
    wanted = STATE if argument == "state" else f"{ARRAYS[0]} or {STATE}"
    if asked and asked not in kinds:
        raise LogError(f"{name}: has no topic {asked}; it has {', '.join(sorted(kinds))}.")
    if asked and kinds[asked] not in (STATE, *(ARRAYS if argument == "command" else ())):
        raise LogError(f"{name}: {asked} is a {kinds[asked]}, and {wanted} is read here.")
    if asked or len(likely) == 1:
        return asked or likely[0]
    if not likely:
        raise LogError(
            f"{name}: has no topic of {wanted} that may be the {argument}; it has "
            f"{', '.join(sorted(kinds)) or 'none'}."
        )
    raise LogError(
        f"{name}: {', '.join(sorted(likely))} may each be the {argument}; say which with "
        f"{option(argument, likely[0])}."
    )


def _by_header(
    rows: list[tuple[int, Any]], zero_ns: int, topic: str
) -> tuple[np.ndarray, list[str]]:
    """Stamps in s by the recorder's clock, and what is told about them."""
    received = np.array([at for at, _ in rows], dtype=np.int64)
    sent = np.array([m.header.stamp.sec * NS + m.header.stamp.nanosec for _, m in rows],
                    dtype=np.int64)  # fmt: skip
    if not sent.all():
        return (received - zero_ns) / NS, [f"{topic} has no stamps; the times of receipt are used."]
    late = np.median(received - sent)
    notes = []
    if abs(late) > SLOW_CLOCK_S * NS:
        notes.append(
            f"{topic} was received {late / NS:.6g} s after its stamps: another clock made these; "
            "the difference was taken out."
        )
    return (sent - zero_ns + late) / NS, notes


def _states(
    topic: str, rows: list[tuple[int, Any]], t_s: np.ndarray, kinds: Sequence[str]
) -> list[Signal]:
    """Signals of fields of JointStates, each joint at the messages that hold it."""
    found: dict[tuple[str, str], tuple[list[int], list[float]]] = {}
    for k, (_, message) in enumerate(rows):
        for field, _ in zip(FIELDS, kinds, strict=False):
            values = getattr(message, field)
            if len(values) == len(message.name):
                for name, value in zip(message.name, values, strict=True):
                    at, own = found.setdefault((field, name), ([], []))
                    at.append(k)
                    own.append(float(value))
    return [
        Signal(
            f"{topic} {name} {field}",
            kind := kinds[FIELDS.index(field)],
            name,
            t_s[at],
            np.array(own),
            field if kind == COMMAND else "",
        )
        for (field, name), (at, own) in found.items()
    ]


def _array(topic: str, messages: list[Any], t_s: np.ndarray) -> list[Signal]:
    """Signals of an array's places.

    Raises:
        LogError: messages are of several lengths.
    """
    lengths = sorted({len(m.data) for m in messages})
    if len(lengths) != 1:
        raise LogError(
            f"{topic}: has messages of {', '.join(map(str, lengths))} numbers; record one "
            "controller's alone."
        )
    table = np.array([m.data for m in messages], float)
    return [Signal(f"{topic}[{k}]", COMMAND, "", t_s, column) for k, column in enumerate(table.T)]
