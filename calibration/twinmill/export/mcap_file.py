# SPDX-License-Identifier: Apache-2.0
"""A log as an MCAP file for Foxglove: all channels with all fields, and robots to look at."""

from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap_protobuf.writer import Writer

from twinmill.export.foxglove_scene import COLORS, RobotScene
from twinmill.export.recording import Recording
from twinmill.model.outlines import Body

FIELD = descriptor_pb2.FieldDescriptorProto
KINDS = {int: FIELD.TYPE_INT64, float: FIELD.TYPE_DOUBLE, str: FIELD.TYPE_STRING}
OTHER = "#cc79a7"  # colour of robots with another channel prefix


def write_mcap(recording: Recording, path: Path, provenance: dict, body: Body) -> Counter[str]:
    """Writes a log in the order in which it was recorded.

    Each channel keeps its name and fields; log time is the recorder's stamp, publish time the
    sender's. Besides: the robots' frames on /tf (foxglove.FrameTransform), and bodies, views and
    paths on /scene (foxglove.SceneUpdate).

    Args:
        recording: what to write.
        path: replaced.
        provenance: words by name, kept as metadata `twinmill`.
        body: of all robots.

    Returns:
        Messages written, by topic.
    """
    robots: dict[str, RobotScene] = {}
    written: Counter[str] = Counter()
    for channel in recording.channels:
        if channel.type_name in ("pose", "telemetry"):
            color = COLORS.get(channel.prefix, OTHER)
            robots.setdefault(channel.robot, RobotScene(channel.robot, color, body))
    events = sorted(
        (
            (stamp_us, k, message)
            for k, channel in enumerate(recording.channels)
            for stamp_us, message in zip(channel.stamps_us, channel.messages, strict=True)
        ),
        key=lambda event: event[:2],
    )
    with open(path, "wb") as stream, Writer(stream) as writer:
        writer.add_metadata("twinmill", {k: str(v) for k, v in provenance.items()})
        for stamp_us, k, message in events:
            channel = recording.channels[k]
            robot, kind = robots.get(channel.robot), channel.type_name
            drawn = ()
            if kind == "pose":
                drawn = robot.on_pose(message, stamp_us)
            elif kind == "telemetry":
                drawn = robot.on_telemetry(message, stamp_us)
            for topic, picture in drawn:
                writer.write_message(topic, picture, 1000 * stamp_us, 1000 * stamp_us)
                written[topic] += 1
            sent = _to_protobuf(message)
            writer.write_message(channel.name, sent, 1000 * stamp_us, 1000 * message.utime_us)
            written[channel.name] += 1
    return written


def _to_protobuf(message: Any) -> Any:
    """Our message as Protocol Buffers, which Foxglove reads with NaN: int64 and double."""
    fields = {name: getattr(message, name) for name in message.__slots__}
    return _protobuf_type(type(message))(**fields)


@cache
def _protobuf_type(kind: type) -> type:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"turbopi/{kind.__name__}.proto", package="turbopi", syntax="proto3"
    )
    described, neutral = file.message_type.add(name=kind.__name__), kind()
    for number, name in enumerate(kind.__slots__, start=1):
        value = getattr(neutral, name)
        is_array = isinstance(value, list)
        described.field.add(
            name=name,
            number=number,
            type=KINDS[type(value[0] if is_array else value)],
            label=FIELD.LABEL_REPEATED if is_array else FIELD.LABEL_OPTIONAL,
        )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"turbopi.{kind.__name__}"))
