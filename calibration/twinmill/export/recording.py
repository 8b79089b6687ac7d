# SPDX-License-Identifier: Apache-2.0
"""All messages of a log, of whatever type in lcm_types/, as they were sent."""

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import turbopi

from twinmill.data.lcm_log import broken, few_broken, split_events
from twinmill.data.log import LogError, read_bytes

# Those of the package that are sent by themselves, by what a message starts with.
TYPES = {
    kind._get_packed_fingerprint(): kind
    for name, kind in sorted(vars(turbopi).items())
    if name.endswith("_t") and isinstance(kind, type) and "utime_us" in kind.__slots__
}
OF_ROBOT = re.compile(r"(?P<prefix>.*?)(?P<robot>R\d{2,4})_[A-Z]+")


@dataclass(frozen=True)
class Channel:
    """One channel: K messages in file order, and when each was logged (us since the Unix epoch)."""

    name: str
    messages: list[Any]
    stamps_us: list[int]

    @property
    def type_name(self) -> str:
        """As the .lcm file, without `_t`."""
        return type(self.messages[0]).__name__.removesuffix("_t")

    @property
    def prefix(self) -> str:
        """Text before R<nn>, as TWIN_; empty for channels of no robot."""
        match = OF_ROBOT.fullmatch(self.name)
        return match["prefix"] if match else ""

    @property
    def robot(self) -> str:
        """R<nn> with the prefix; empty for channels of no robot."""
        match = OF_ROBOT.fullmatch(self.name)
        return match["prefix"] + match["robot"] if match else ""


@dataclass(frozen=True)
class Recording:
    """A log file: channels by name, and sentences on what was left out."""

    path: Path
    sha256: str
    channels: list[Channel]
    warnings: list[str]

    @property
    def t0_utime_us(self) -> int:
        """Earliest stamp of all messages: time 0 of exported tables."""
        return min(m.utime_us for channel in self.channels for m in channel.messages)


def read_recording(path: Path, data: bytes | None = None) -> Recording:
    """Reads a log up to where it breaks off.

    Args:
        path: of the file, or name of the log.
        data: what the log holds; by default what its file holds.

    Raises:
        LogError: it cannot be read, is no LCM log, or holds no message of ours.
    """
    data = read_bytes(path) if data is None else data
    events = split_events(data, path.name)
    channels, warnings, strange = [], list(events.warnings), []
    for name, payloads in sorted(events.by_channel.items()):
        ((fingerprint, _),) = Counter(payload[:8] for payload in payloads).most_common(1)
        kind = TYPES.get(fingerprint)
        stamps_us = events.stamps_us[name]
        if kind is None:
            strange.append(f"{name} ({len(payloads)})")
            continue
        channels.append(_decoded(kind, payloads, name, stamps_us=stamps_us, warnings=warnings))
    if strange:
        warnings.append(f"messages of other programs were left out: {', '.join(strange)}.")
    if not channels:
        raise LogError(
            f"{path.name}: holds no message of the types in lcm_types/, only {', '.join(strange)}; "
            "export it with the programs that wrote it."
        )
    return Recording(path, hashlib.sha256(data).hexdigest(), channels, warnings)


def _decoded(
    kind: type,
    payloads: Sequence[bytes],
    channel: str,
    *,
    stamps_us: Sequence[int],
    warnings: list[str],
) -> Channel:
    """The channel without a few messages that are broken, on which there is then a sentence."""
    messages, kept_us, failed = [], [], []
    for payload, stamp_us in zip(payloads, stamps_us, strict=True):
        try:
            messages.append(kind.decode(payload))
        except Exception as error:  # the generated decoder raises what its steps happen to raise
            failed.append(error)
            continue
        kept_us.append(stamp_us)
    if not few_broken(len(failed), len(payloads)):
        raise LogError(
            f"{channel}: a message is not of type turbopi.{kind.__name__} as others are "
            f"({failed[0]}): two programs speak on this channel, or the log is damaged."
        ) from failed[0]
    if failed:
        warnings.append(broken(channel, len(failed), len(payloads)))
    return Channel(channel, messages, kept_us)
