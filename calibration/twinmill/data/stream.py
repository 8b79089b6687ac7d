# SPDX-License-Identifier: Apache-2.0
"""Messages in short batches, from a log or from the bus."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path

from twinmill.arguments import option
from twinmill.data.bus import Senders, open_bus
from twinmill.data.lcm_log import Events, split_events
from twinmill.data.log import read_bytes

BATCH_S = 0.1
CHANNELS = ".*R[0-9][0-9]+_(TELEMETRY|POSE|DRIVE|RUN)"

Message = tuple[int, str, bytes]  # when it was logged or heard (us), channel, payload


class Batch(Events):
    """Events of a tenth of a second."""

    @classmethod
    def of(cls, messages: list[Message]) -> "Batch":
        """Messages (time in us, channel, payload) by channel, their order kept."""
        payloads: dict[str, list[bytes]] = {}
        batch = cls(by_channel=payloads)
        for stamp_us, channel, payload in messages:
            payloads.setdefault(channel, []).append(payload)
            batch.stamps_us.setdefault(channel, []).append(stamp_us)
        return batch


def from_log(path: Path, warnings: list[str]) -> list[tuple[int, Batch]]:
    """(end of the batch in us, batch) of a whole log; adds sentences to `warnings`.

    Raises:
        LogError: it cannot be read, or is no LCM log.
    """
    events = split_events(read_bytes(path), path.name)
    warnings += events.warnings
    messages = sorted(
        (
            (stamp_us, channel, payload)
            for channel, payloads in events.by_channel.items()
            for stamp_us, payload in zip(events.stamps_us[channel], payloads, strict=True)
        ),
        key=lambda message: message[:2],
    )
    step_us = round(1e6 * BATCH_S)
    groups = groupby(messages, key=lambda message: message[0] // step_us)
    return [((number + 1) * step_us, Batch.of(list(group))) for number, group in groups]


def from_bus(
    url: str, duration_s: float, say: Callable[[str], None] = lambda sentence: None
) -> Iterator[tuple[int, Batch]]:
    """Batches heard on the bus from now on, for some time or until Ctrl-C.

    Args:
        url: of the bus.
        duration_s: how long.
        say: told in a sentence, once, that two robots have one number.

    Raises:
        ValueError: there is no such bus.
    """
    heard: list[Message] = []
    senders: dict[str, Senders] = {}
    doubles: set[str] = set()

    def hear(channel: str, payload: bytes) -> None:
        heard.append((time.time_ns() // 1000, channel, payload))
        if channel.endswith("_TELEMETRY"):
            who = senders.setdefault(channel, Senders())
            who.add(getattr(bus, "sender", None))
            if who.are_double and channel not in doubles:
                doubles.add(channel)
                hosts = ", ".join(who.hosts)
                say(f"two robots speak on {channel} ({hosts}): what is shown is of both.")

    try:
        bus = open_bus(url)
        bus.subscribe(CHANNELS, hear)
    except RuntimeError as error:
        raise ValueError(f"{option('lcm_url', url)}: cannot be joined: {error}") from error
    end_s = time.monotonic() + duration_s
    while (left_s := end_s - time.monotonic()) > 0:
        batch_end_s = time.monotonic() + min(BATCH_S, left_s)
        try:
            while (wait_s := batch_end_s - time.monotonic()) > 0:
                bus.handle_timeout(max(1, int(1000 * wait_s)))
        except OSError:  # a log that LCM played is over
            end_s = 0.0
        yield time.time_ns() // 1000, Batch.of(heard)
        heard.clear()


class Window:
    """The last seconds of all channels."""

    def __init__(self, length_s: float):
        self._length_us = round(1e6 * length_s)
        self._messages: deque[Message] = deque()

    def add(self, now_us: int, batch: Batch) -> None:
        """Takes a batch in, and drops what is too old."""
        for channel, payloads in batch.by_channel.items():
            stamps_us = batch.stamps_us[channel]
            self._messages.extend(
                (stamp_us, channel, payload)
                for stamp_us, payload in zip(stamps_us, payloads, strict=True)
            )
        while self._messages and self._messages[0][0] < now_us - self._length_us:
            self._messages.popleft()

    def events(self) -> Batch:
        """All messages received and not yet dropped, by channel."""
        return Batch.of(list(self._messages))
