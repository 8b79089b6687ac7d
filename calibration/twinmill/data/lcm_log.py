# SPDX-License-Identifier: Apache-2.0
"""LCM log files: their events, the fixed-size messages in them as numpy arrays, and a writer.

Own reader of the container: LCM's drops a good event before a broken one, writes on stderr itself
and does not say where the file breaks.
"""

import errno
import os
import re
from array import array
from collections.abc import Iterator, MutableSequence, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import lcm
import numpy as np
import turbopi
import twinmill_native as native

FEW_BROKEN = 0.02  # of a channel: damage; more are messages of another type
SHORT = 10  # messages of which a single one is damage, though it is a larger share

# Fixed-size types of the LCM language, as they are on the wire.
NUMBERS = {
    "int8_t": "i1",
    "byte": "u1",
    "boolean": "i1",
    "int16_t": ">i2",
    "int32_t": ">i4",
    "int64_t": ">i8",
    "float": ">f4",
    "double": ">f8",
}
FIELD = re.compile(r"^\s*(\w+)\s+(\w+)(?:\[(\d+)\])?;", re.MULTILINE)


class LogError(ValueError):
    """A measurement cannot be used; the message is one sentence: what, value, why, what to do.

    It is a ValueError: who catches those catches it, too.
    """


class Payloads(Sequence[bytes]):
    """Payloads one behind the other: as many objects would take twice the room."""

    def __init__(self, joined: bytes, ends: np.ndarray) -> None:
        """Args: ends (K,) int, of each in `joined`."""
        self._joined, self._ends = joined, ends

    def __len__(self) -> int:
        return len(self._ends)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]  # of Sequence, of int and slice
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = range(len(self))[k]
        return self._joined[self._ends[k - 1] if k else 0 : self._ends[k]]

    def of_size(self, size: int) -> bytes:
        """Those of one size, one behind the other."""
        alike = np.diff(self._ends, prepend=0) == size
        return self._joined if alike.all() else b"".join(p for p in self if len(p) == size)


@dataclass
class Events:
    """Events in file order.

    Attributes:
        by_channel: payloads.
        stamps_us: when each was logged, us since the Unix epoch, recorder's clock.
        warnings: what was wrong with the container.
    """

    by_channel: dict[str, Sequence[bytes]] = field(default_factory=dict)
    stamps_us: dict[str, MutableSequence[int]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def split_events(data: bytes, name: str) -> Events:
    """Cuts the bytes of a log file into events.

    Args:
        data: the whole file.
        name: of the file, for messages.

    Raises:
        LogError: if the file holds no complete event.
    """
    events = Events()
    channels, gaps = native.events_of(data)
    for position, following, after_an_event in gaps:
        if following < 0:
            events.warnings.append(
                f"{name}: breaks off inside an event at byte {position} of {len(data)}; "
                "read up to there."
            )
        elif after_an_event:
            events.warnings.append(
                f"{name}: bytes {position} to {following} are no event; skipped."
            )
    for channel_bytes, stamps_us, joined, ends in channels:
        channel, payloads = channel_bytes.decode("utf-8", "replace"), Payloads(joined, ends)
        before = events.by_channel.get(channel)  # of another name that is no text
        events.by_channel[channel] = [*before, *payloads] if before else payloads
        events.stamps_us.setdefault(channel, array("q")).extend(array("q", stamps_us.tobytes()))
    if not events.by_channel:
        raise LogError(
            f"{name}: holds no complete LCM event in {len(data)} bytes, so it is no LCM "
            "log; record one with lcm-logger, or make one with `twinmill import`."
        )
    return events


@cache
def layout_of(message: type) -> np.dtype:
    """A type of fixed size as numpy reads it: LCM's fingerprint `hash`, then the fields.

    Args:
        message: class generated from lcm_types/<name>.lcm, which lies beside it.
    """
    text = Path(turbopi.__file__).with_name(f"{message.__name__}.lcm").read_text()
    fields = [
        (name, NUMBERS[kind], int(count)) if count else (name, NUMBERS[kind])
        for kind, name, count in FIELD.findall(text.partition("{")[2])
    ]
    return np.dtype([("hash", ">u8"), *fields])


def decode(
    payloads: Sequence[bytes], message: type, channel: str, warnings: list[str] | None = None
) -> np.ndarray:
    """Messages of one fixed-size type as a structured array, fields as in the .lcm file.

    Args:
        payloads: (K,) encoded messages.
        message: class generated from the .lcm file, of fixed size.
        channel: for the message of the error.
        warnings: gets a sentence where a few messages are broken; they are left out.

    Raises:
        LogError: if more payloads are of another type.
    """
    layout, fingerprint = layout_of(message), message._get_packed_fingerprint()
    size = layout.itemsize
    whole = (
        payloads.of_size(size)
        if isinstance(payloads, Payloads)
        else b"".join(p for p in payloads if len(p) == size)
    )
    messages = np.frombuffer(whole, layout)
    known = messages["hash"] == np.frombuffer(fingerprint, layout["hash"])
    if not known.all():
        messages = messages[known]
    if len(messages) < len(payloads):
        if warnings is None or not few_broken(len(payloads) - len(messages), len(payloads)):
            (strange, *_) = (p for p in payloads if len(p) != size or p[:8] != fingerprint)
            raise LogError(
                f"{channel}: a message is not of type turbopi.{message.__name__} (fingerprint "
                f"{strange[:8].hex()}, expected {fingerprint.hex()}): the log was made with other "
                "message types; convert it with the programs that wrote it."
            )
        warnings.append(broken(channel, len(payloads) - len(messages), len(payloads)))
    return messages


def few_broken(count: int, of: int) -> bool:
    """True if so many unreadable messages are damage, and not messages of another type."""
    return count <= most_broken(of)


def most_broken(of: int) -> int:
    """How many of so many messages may be damaged."""
    return max(int(FEW_BROKEN * of), int(of >= SHORT))


def broken(channel: str, count: int, of: int) -> str:
    """The sentence on them."""
    return f"{channel}: {count} of {of} messages are damaged; left out."


@contextmanager
def log_file(path: Path) -> Iterator[lcm.EventLog]:
    """A new log for write_event(utime_us, channel, data), whole at the end of the block.

    LCM closes a log without a word where its last events do not fit on the disk.

    Args:
        path: replaced if it exists.

    Raises:
        OSError: it could not be written; what there is of it stays.
    """
    log = lcm.EventLog(str(path), "w", overwrite=True)
    try:
        yield log
        size_bytes = log.tell()
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        log.close()
    if path.stat().st_size != size_bytes:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
