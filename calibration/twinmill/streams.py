# SPDX-License-Identifier: Apache-2.0
"""Standard streams: which of them failed, and which lead nowhere."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress

STDOUT_NAME, STDERR_NAME = "standard output", "standard error"
STDOUT, STDERR = 1, 2  # their handles
NULL = os.makedev(1, 3)  # device of /dev/null, from Linux's admin-guide/devices.txt
closed_at_first: set[int] = set()  # those that this program began without (`>&-`)


@contextmanager
def naming(stream: str) -> Iterator[None]:
    """Has an OSError raised meanwhile name a stream, unless it names a file already."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or file_of(stream)
        raise


def leads_nowhere(handle: int) -> bool:
    """An open file, as STDERR, is closed, or is /dev/null: nobody reads what it gets."""
    try:
        file = os.fstat(handle)
    except OSError:
        return True
    return stat.S_ISCHR(file.st_mode) and file.st_rdev == NULL


def open_nowhere() -> int:
    """Handle of /dev/null, or where that cannot be opened of memory that nobody reads.

    Raises:
        OSError: no file more can be opened.
    """
    with suppress(OSError):
        return os.open(os.devnull, os.O_RDWR)
    return os.memfd_create("nowhere")


def refuse_closed(handle: int, stream: str) -> None:
    """Raises OSError if this program began without a stream: what is written there is lost."""
    if handle in closed_at_first:
        raise OSError(errno.EBADF, "closed (>&-), so nobody gets what is printed", stream)


def file_of(stream: str) -> str:
    """A standard stream with the file that it was sent to, if any, as a user can find it."""
    handle = {STDOUT_NAME: STDOUT, STDERR_NAME: STDERR}[stream]
    try:
        file = os.fstat(handle)
        if not stat.S_ISREG(file.st_mode) or not file.st_nlink:
            return stream
        return f"{stream} ({os.readlink(f'/proc/self/fd/{handle}')})"
    except OSError:
        return stream
