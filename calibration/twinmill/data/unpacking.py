# SPDX-License-Identifier: Apache-2.0
"""How much of a file's contents is taken into memory: what is packed, and lines without an end.

A small file can hold what unpacks to gigabytes. It is refused before, by what it says of itself, or
as soon as it has more.
"""

import bz2
import io
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from twinmill.data.log import LogError

FREE_BYTES = 16 << 20  # a piece may become that in any case: recorders pack 0.75 to 4 MB at a time
# Beyond: recordings of robots pack to a 2nd to a 50th, and zlib at best to a 1032nd.
MOST_RATIO = 200
LINE_BYTES = 1 << 20  # a row of 100 bodies with 100 numbers each has 200 kB


class UnpackError(ValueError):
    """A piece that would become too much, as the end of a sentence on its file."""


def limit_of(packed: int) -> int:
    """Bytes that so many packed ones may become."""
    return max(FREE_BYTES, MOST_RATIO * packed)


def check_size(packed: int, unpacked: int) -> None:
    """Raises UnpackError if so many packed bytes say that they are too many."""
    if unpacked > limit_of(packed):
        raise UnpackError(
            f"{packed} bytes of it unpack to {unpacked} or more, over {MOST_RATIO} times as many "
            f"and over {FREE_BYTES >> 20} MB; if that is right, write it without compression"
        )


def unpack(make: Callable[[], Any], data: bytes) -> bytes:
    """All that packed bytes hold, one stream after the other, as long as it is not too much.

    Args:
        make: a decompressor, as bz2.BZ2Decompressor.
        data: the packed bytes.

    Raises:
        UnpackError: it is too much.
        ValueError: they are damaged.
        EOFError: they end before their stream does.
    """
    limit, pieces, count, rest = limit_of(len(data)), [], 0, data
    while rest:
        stream, packed = make(), rest
        while not stream.eof:
            try:
                piece = stream.decompress(packed, limit + 1 - count)
            except Exception as error:  # each kind has a class of its own
                raise ValueError(f"packed data are damaged: {error}") from error
            pieces.append(piece)
            count += len(piece)
            check_size(len(data), count)
            if not piece and not packed:
                raise EOFError("packed data end before their end")
            packed = b""
        rest = stream.unused_data
    return b"".join(pieces)


class Gunzip:
    """zlib's gzip stream with the manners of the other decompressors."""

    def __init__(self) -> None:
        self._stream = zlib.decompressobj(wbits=31)

    @property
    def eof(self) -> bool:
        """The stream has come to its end."""
        return self._stream.eof

    @property
    def unused_data(self) -> bytes:
        """Bytes that follow the compressed stream."""
        return self._stream.unused_data

    def decompress(self, data: bytes, max_length: int) -> bytes:
        """At most so many bytes; what is not unpacked of data is kept."""
        return self._stream.decompress(self._stream.unconsumed_tail + data, max_length)


class BoundedText(io.RawIOBase):
    """Bytes of a text file, or a packed one, whose lines have an end.

    Args:
        path: of the file, for errors.
        binary: its bytes, unpacked.
        packed_size: of the file, if it is packed.
    """

    def __init__(self, path: Path, binary: Any, packed_size: int | None) -> None:
        self._path, self._binary, self._packed_size = path, binary, packed_size
        self._count = self._line = 0

    def readable(self) -> bool:
        """As io asks."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Some bytes.

        Raises:
            LogError: they have become too many, or the line that they are in.
        """
        data = self._binary.read(len(buffer))
        buffer[: len(data)] = data
        self._count += len(data)
        end = max(data.rfind(b"\n"), data.rfind(b"\r"))
        self._line = self._line + len(data) if end < 0 else len(data) - end - 1
        if self._line > LINE_BYTES:
            raise LogError(
                f"{self._path}: has a line of more than {LINE_BYTES} bytes, so it is no table of "
                "measurements; check that it is the right file."
            )
        if self._packed_size is not None:
            try:
                check_size(self._packed_size, self._count)
            except UnpackError as error:
                raise LogError(f"{self._path}: is refused: {error}.") from error
        return len(data)


def decompressors() -> dict[str, Callable[[], Any]]:
    """Makers of the decompressors of bags, by the names that these have for them."""
    from lz4.frame import LZ4FrameDecompressor
    from rosbags.rosbag2.storage_mcap import zstd

    return {
        "bz2": bz2.BZ2Decompressor,
        "lz4": LZ4FrameDecompressor,
        "zstd": zstd.ZstdDecompressor,
    }


def bound_bag_readers() -> None:
    """Makes the library that reads ROS bags unpack no more than is allowed, in this process.

    It unpacks what a file holds, and compares only afterwards with what the file said.
    """
    from rosbags.rosbag1 import reader as bag1
    from rosbags.rosbag2 import reader as bag2
    from rosbags.rosbag2 import storage_mcap

    make = decompressors()
    for kind in ("bz2", "lz4"):
        bag1.decompressors[kind] = partial(unpack, make[kind])
    for kind in ("lz4", "zstd"):
        storage_mcap.DECOMPRESSORS[kind] = partial(_unpack_sized, make[kind])
    bag2.zstd = _BoundedZstd(storage_mcap.zstd)


def _unpack_sized(make: Callable[[], Any], data: bytes, size: int) -> bytes:
    """A chunk that says how large it is."""
    check_size(len(data), size)
    return unpack(make, data)


class _BoundedZstd:
    """Part of zstd that the reader of bags of version 2 uses: single messages and whole files."""

    def __init__(self, zstd: Any) -> None:
        self._zstd = zstd

    def decompress(self, data: bytes) -> bytes:
        """One message."""
        return unpack(self._zstd.ZstdDecompressor, data)

    def open(self, file: Any, mode: str) -> Any:
        """A whole file, which goes to disk piece by piece."""
        packed = file.seek(0, io.SEEK_END)
        file.seek(0)
        return _BoundedFile(self._zstd.open(file, mode), packed)


class _BoundedFile:
    """An unpacked file that ends in an error where it becomes too much."""

    def __init__(self, file: Any, packed_size: int) -> None:
        self._file, self._packed_size, self._count = file, packed_size, 0

    def __enter__(self) -> "_BoundedFile":
        self._file.__enter__()
        return self

    def __exit__(self, *error: object) -> object:
        return self._file.__exit__(*error)

    def read(self, size: int = -1) -> bytes:
        """The next bytes."""
        data = self._file.read(size)
        self._count += len(data)
        check_size(self._packed_size, self._count)
        return data
