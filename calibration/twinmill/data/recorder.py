# SPDX-License-Identifier: Apache-2.0
"""Keeps what is heard on a bus as an LCM log."""

import errno
import os
import tempfile
import time
from bisect import bisect_right
from pathlib import Path
from types import TracebackType

import lcm

from twinmill.files import put_in_place


class Recorder:
    """A log that stands under its name only once it is closed: written beside it, then renamed.

    What a killed recording leaves, `<name>.<letters>.partial`, can be read.

    Attributes:
        failed: why no more are, such as "No space left on device"; empty if all are.
    """

    def __init__(self, path: Path, force: bool):
        """Opens the log.

        Args:
            path: of the log.
            force: replace one that has come to be there.
        """
        self._path, self._force = path, force
        handle, name = tempfile.mkstemp(".partial", f"{path.name}.", path.parent)
        os.fchmod(handle, 0o644)
        os.close(handle)
        self._partial = Path(name)
        self._log = lcm.EventLog(str(self._partial), "w", overwrite=True)
        self._ends_bytes = [0]  # of whole events
        self.failed = ""

    @property
    def events(self) -> int:
        """Number of events of the log that are in the file."""
        return len(self._ends_bytes) - 1

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: TracebackType | None) -> None:
        """Keeps the recording, unless a ValueError says that nothing was begun."""
        self._log.close()
        if kind is None or not issubclass(kind, ValueError):
            self._keep_whole_events()
            put_in_place(self._partial, self._path, self._force)
        else:
            self._partial.unlink()

    def add(self, channel: str, data: bytes) -> None:
        """Keeps one message, stamped by this machine's clock.

        Never raises: who records what a robot says has to go on and stop it.
        """
        if self.failed:
            return
        try:
            self._log.write_event(time.time_ns() // 1000, channel, data)
        except OSError as error:
            self.failed = error.strerror
            return
        self._ends_bytes.append(self._log.tell())

    def _keep_whole_events(self) -> None:
        # The newest were in memory, and LCM closes a log without a word where they do not fit.
        kept = bisect_right(self._ends_bytes, self._partial.stat().st_size)
        if kept < len(self._ends_bytes):
            self.failed = self.failed or os.strerror(errno.ENOSPC)
        del self._ends_bytes[kept:]
        os.truncate(self._partial, self._ends_bytes[-1])
