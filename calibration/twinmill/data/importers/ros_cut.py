# SPDX-License-Identifier: Apache-2.0
"""MCAP files that were cut off, since the recorder was stopped hard: what is before the break."""

import struct
from pathlib import Path

from twinmill.data.log import LogError

MAGIC = b"\x89MCAP0\r\n"  # first and last in a whole file (mcap.dev, specification)


def is_cut(path: Path) -> bool:
    """Whether an MCAP file begins as one and does not end as one."""
    if path.suffix != ".mcap" or not path.is_file():
        return False
    with path.open("rb") as stream:
        begins = stream.read(len(MAGIC)) == MAGIC
        stream.seek(max(0, path.stat().st_size - len(MAGIC)))
        return begins and stream.read() != MAGIC


def write_whole(path: Path, out: Path) -> None:
    """Copies the messages before the break to a whole file.

    Raises:
        LogError: not even the first chunk of messages is whole.
    """
    from mcap.exceptions import McapError
    from mcap.reader import NonSeekingReader
    from mcap.writer import Writer

    with path.open("rb") as stream, out.open("wb") as target:
        writer = Writer(target)
        writer.start(profile="ros2", library="twinmill")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        try:
            for schema, channel, message in NonSeekingReader(stream).iter_messages(
                log_time_order=False
            ):
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(
                        schema.name, schema.encoding, schema.data
                    )
                if channel.id not in channels:
                    channels[channel.id] = writer.register_channel(
                        channel.topic,
                        channel.message_encoding,
                        schemas[schema.id],
                        dict(channel.metadata),
                    )
                writer.add_message(
                    channels[channel.id],
                    message.log_time,
                    message.data,
                    message.publish_time,
                    message.sequence,
                )
        except (McapError, struct.error):  # the break
            pass
        writer.finish()
    if not channels:
        raise LogError(
            f"{path}: cannot be read as a ROS bag (it was cut off within its first chunk of "
            f"messages); try `mcap recover {path.name} -o whole.mcap`."
        )
