# SPDX-License-Identifier: Apache-2.0
"""MCAP files that were cut off, since the recorder was stopped hard: what is before the break.

Names of records and their layout: mcap.dev, specification.
"""

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from twinmill.data.log import LogError
from twinmill.data.unpacking import UnpackError, check_size, decompressors, unpack

MAGIC = b"\x89MCAP0\r\n"  # first and last in a whole file
HEAD = struct.Struct("<BQ")  # opcode and length of a record
CHUNK = 6  # opcode
TIMES_SIZES = 28  # bytes of a chunk before the name of its compression


def is_cut(path: Path) -> bool:
    """True if an MCAP file begins as one and does not end as one."""
    if path.suffix != ".mcap" or not path.is_file():
        return False
    with path.open("rb") as stream:
        begins = stream.read(len(MAGIC)) == MAGIC
        stream.seek(max(0, path.stat().st_size - len(MAGIC)))
        return begins and stream.read() != MAGIC


def check_chunks(path: Path) -> None:
    """Looks, before any is unpacked, how large the chunks of an MCAP file say that they are.

    Raises:
        UnpackError: one of them, or all together, is more than so small a file may hold: those of
            one time are in memory at once.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    for file in files:
        if file.suffix != ".mcap" or not file.is_file():
            continue
        total, size = 0, file.stat().st_size
        with file.open("rb") as stream:
            stream.seek(len(MAGIC))
            while len(head := stream.read(HEAD.size)) == HEAD.size:
                kind, length = HEAD.unpack(head)
                at = stream.tell()
                if kind == CHUNK and len(sizes := stream.read(24)) == 24:
                    (unpacked,) = struct.unpack_from("<Q", sizes, 16)
                    check_size(length, unpacked)
                    total += unpacked
                if length > size:
                    break
                stream.seek(at + length)
        check_size(size, total)


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
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    try:
        for record in StreamReader(stream, skip_magic=skip_magic, emit_chunks=True).records:
            if isinstance(record, Chunk):
                inside = io.BytesIO(unpack_chunk(record))
                yield from _until_break(inside, skip_magic=True)
            else:
                yield record
    except UnpackError:
        raise
    except (McapError, struct.error, EOFError, ValueError):
        return


def unpack_chunk(chunk: Any) -> bytes:
    """The records of a chunk; what is packed in another way than MCAP's has none.

    Raises:
        UnpackError: it is too much.
    """
    if not chunk.compression:
        return chunk.data
    make = decompressors().get(chunk.compression)
    return unpack(make, chunk.data) if make else b""


def _cut_chunk(stream: io.BufferedIOBase, size: int) -> bytes:
    """The records in the chunk within which the file ends; empty if it ends elsewhere."""
    stream.seek(len(MAGIC))
    while len(head := stream.read(HEAD.size)) == HEAD.size:
        kind, length = HEAD.unpack(head)
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
