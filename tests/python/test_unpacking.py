# SPDX-License-Identifier: Apache-2.0
"""Unpacked size of a small file is bounded by its size, and lines have an end.

Files are a little above the limit: packed by the writers of each format, of zeros.
"""

import bz2
import gzip
import struct

import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from twinmill.data.importers.ros_bag import list_topics
from twinmill.data.log import LogError
from twinmill.data.measurement_table import read_header, read_table
from twinmill.data.unpacking import (
    FREE_BYTES,
    LINE_BYTES,
    MOST_RATIO,
    Gunzip,
    UnpackError,
    unpack,
)
from twinmill.swarm.forecast.plan import Plan

ABOVE, BELOW = FREE_BYTES + 1, FREE_BYTES - 10_000
STORE = get_typestore(Stores.ROS2_HUMBLE)
KIND = "tf2_msgs/msg/TFMessage"  # whose messages are looked at to list them; of zeros it is empty
DEFINITION = STORE.generate_msgdef(KIND, ros_version=2)[0]


def mcap(path, kind, size, says=None, cut=False):
    """A bag of one chunk with one message; it may say that it holds less, or be cut off."""
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=2 * FREE_BYTES, compression=kind, enable_crcs=False)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(KIND, "ros2msg", DEFINITION.encode())
        writer.add_message(writer.register_channel("/zeros", "cdr", schema), 1, bytes(size), 1)
        writer.finish()
    data = bytearray(path.read_bytes())
    if says is not None:  # in the chunk and in its index
        name = b"\x04\0\0\0zstd" if kind is CompressionType.ZSTD else b"\x03\0\0\0lz4"
        begin = data.index(name)
        old = bytes(data[begin - 12 : begin - 4])
        for at in (begin - 12, data.rindex(old)):
            data[at : at + 8] = struct.pack("<Q", says)
    path.write_bytes(data[:-8] if cut else data)
    return path


@pytest.mark.parametrize("cut", [False, True], ids=["whole", "cut off"])
@pytest.mark.parametrize("says", [None, 1000], ids=["true", "false"])
@pytest.mark.parametrize("kind", [CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_of_a_bag_that_unpacks_to_too_much_is_refused(tmp_path, kind, says, cut):
    bag = mcap(tmp_path / "a.mcap", kind, ABOVE, says, cut)
    with pytest.raises(LogError, match=r"a\.mcap: is refused: \d+ bytes of it unpack to"):
        list_topics(bag)


def test_a_chunk_just_below_the_limit_is_read(tmp_path):
    """It is unpacked, and what is in it is looked at: zeros are no message of this length."""
    bag = mcap(tmp_path / "a.mcap", CompressionType.ZSTD, BELOW)
    with pytest.raises(LogError, match="message size mismatch"):
        list_topics(bag)


def test_chunks_are_counted_together(tmp_path):
    """Those of one time are in memory at once."""
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapWriter(stream, chunk_size=1, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(KIND, "ros2msg", DEFINITION.encode())
        channel = writer.register_channel("/zeros", "cdr", schema)
        for _ in range(3):
            writer.add_message(channel, 1, bytes(FREE_BYTES // 3), 1)
        writer.finish()
    with pytest.raises(LogError, match="is refused"):
        list_topics(tmp_path / "a.mcap")


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_messages_and_files_of_a_bag_are_bounded_too(tmp_path, mode):
    writer = Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        writer.write(writer.add_connection("/zeros", KIND, typestore=STORE), 1, bytes(ABOVE))
    with pytest.raises(LogError, match="is refused"):
        list_topics(tmp_path / "bag")


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress], ids=["gzip", "bzip2"])
def test_streams_end_at_the_limit_and_what_follows_is_read(pack):
    make = {gzip.compress: Gunzip, bz2.compress: bz2.BZ2Decompressor}[pack]
    assert unpack(make, pack(b"one") + pack(b"two")) == b"onetwo"
    with pytest.raises(UnpackError, match="unpack to"):
        unpack(make, pack(bytes(ABOVE)))
    with pytest.raises(EOFError):
        unpack(make, pack(b"one")[:-4])


def test_a_packed_table_that_becomes_too_much_is_refused(tmp_path):
    path, row = tmp_path / "a.csv.gz", b"0," + b"0" * 10_000 + b"\n"
    path.write_bytes(gzip.compress(b"t_s,x_m\n" + row * (ABOVE // len(row) + 1)))
    assert MOST_RATIO * path.stat().st_size < FREE_BYTES
    with pytest.raises(LogError, match=r"a\.csv\.gz: is refused: \d+ bytes of it unpack to"):
        read_table(path, frozenset({"t_s", "x_m"}))


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
def test_a_line_without_an_end_is_refused(tmp_path, name):
    text = b"1" * (LINE_BYTES + (1 << 17))  # and what is read at once
    path = tmp_path / name
    path.write_bytes(gzip.compress(text) if name.endswith(".gz") else text)
    with pytest.raises(LogError, match=f"{name}: has a line of more than {LINE_BYTES} bytes"):
        read_header(path)


def test_a_long_line_is_read(tmp_path):
    names = [f"column_{i:04d}" for i in range(10_000)]
    path = tmp_path / "a.csv"
    path.write_text(",".join(names) + "\n" + ",".join("0" for _ in names) + "\n")
    assert len(read_header(path)) == 10_000


def test_a_sealed_file_that_becomes_too_much_is_none():
    with pytest.raises(ValueError, match="is no file of sealed probabilities"):
        Plan.from_bytes(gzip.compress(b'{"a": "' + bytes(ABOVE)))


def test_a_bag_of_version_1_is_bounded_too(tmp_path):
    writer = Writer1(tmp_path / "a.bag")
    writer.set_compression(Writer1.CompressionFormat.BZ2)
    with writer:
        writer.write(writer.add_connection("/zeros", KIND, typestore=STORE), 1, bytes(ABOVE))
    with pytest.raises(LogError, match="is refused"):
        list_topics(tmp_path / "a.bag")
