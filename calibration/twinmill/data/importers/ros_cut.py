# SPDX-License-Identifier: Apache-2.0
"""MCAP files that were cut off, since the recorder was stopped hard: what is before the break.

Names of records and their layout: mcap.dev, specification.
"""

import io
import struct
from collections.abc import Iterator
from pathlib import Path

from twinmill.data.log import LogError

MAGIC = b"\x89MCAP0\r\n"  # first and last in a whole file
CHUNK = 6  # opcode
TIMES_SIZES = 28  # bytes of a chunk before the name of its compression


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
        LogError: there are none.
    """
    from mcap.records import Channel, Message, Schema
    from mcap.writer import Writer

    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    with out.open("wb") as target:
        writer = Writer(target)
        writer.start(profile="ros2", library="twinmill")
        for r in _records(path):
            if isinstance(r, Schema) and r.id not in schemas:
                schemas[r.id] = writer.register_schema(r.name, r.encoding, r.data)
            elif isinstance(r, Channel) and r.id not in channels:
                channels[r.id] = writer.register_channel(
                    r.topic, r.message_encoding, schemas.get(r.schema_id, 0), dict(r.metadata)
                )
            elif isinstance(r, Message) and r.channel_id in channels:
                channel = channels[r.channel_id]
                writer.add_message(channel, r.log_time, r.data, r.publish_time, r.sequence)
        writer.finish()
    if not channels:
        raise LogError(
            f"{path}: cannot be read as a ROS bag (it was cut off before its first messages were "
            f"whole); try `mcap recover {path.name} -o whole.mcap`, or record it again."
        )


def _records(path: Path) -> Iterator[object]:
    """All records before the break, those of an uncompressed chunk that is cut, too."""
    with path.open("rb") as stream:
        yield from _until_break(stream, skip_magic=False)
        inside = _cut_chunk(stream, path.stat().st_size)
    yield from _until_break(io.BytesIO(inside), skip_magic=True)


def _until_break(stream: io.BufferedIOBase, skip_magic: bool) -> Iterator[object]:
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader

    try:
        yield from StreamReader(stream, skip_magic=skip_magic).records
    except (McapError, struct.error):
        return


def _cut_chunk(stream: io.BufferedIOBase, size: int) -> bytes:
    """The records in the chunk within which the file ends; empty if it ends elsewhere."""
    stream.seek(len(MAGIC))
    while len(head := stream.read(9)) == 9:
        kind, length = struct.unpack("<BQ", head)
        if stream.tell() + length > size:
            body = stream.read() if kind == CHUNK else b""
            return _unpacked(body) if len(body) > TIMES_SIZES + 4 else b""
        stream.seek(length, io.SEEK_CUR)
    return b""


def _unpacked(chunk: bytes) -> bytes:
    """As many records of a chunk as its bytes hold; none of a compressed one, which has no end."""
    begin = TIMES_SIZES + 4
    (length,) = struct.unpack_from("<I", chunk, TIMES_SIZES)
    return b"" if length else chunk[begin + 8 :]
