# SPDX-License-Identifier: Apache-2.0
"""Keeps what is heard on a bus as an LCM log."""

import time
from pathlib import Path
from types import TracebackType

import lcm


class Recorder:
    """A log that stands under its name only once it is closed: written beside it, then renamed."""

    def __init__(self, path: Path):
        """Opens the log.

        Args:
            path: replaced if it exists.
        """
        self._path = path
        self._partial = path.with_name(path.name + ".partial")
        self._log = lcm.EventLog(str(self._partial), "w", overwrite=True)
        self.events = 0

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: TracebackType | None) -> None:
        """What was heard is kept, unless a ValueError says that nothing was begun."""
        self._log.close()
        if kind is None or not issubclass(kind, ValueError):
            self._partial.rename(self._path)
        else:
            self._partial.unlink()

    def add(self, channel: str, data: bytes) -> None:
        """Keeps one message, stamped by this machine's clock."""
        self._log.write_event(time.time_ns() // 1000, channel, data)
        self.events += 1
