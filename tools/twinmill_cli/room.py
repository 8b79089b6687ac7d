# SPDX-License-Identifier: Apache-2.0
"""Room for what is to be told of robots, taken before a wheel turns."""

from __future__ import annotations

import ctypes
import errno
import os
import resource
import stat

from twinmill.streams import STDERR, STDERR_NAME, STDOUT, STDOUT_NAME, closed_at_first, file_of
from twinmill_cli.ending import NO_ROOM

# Bytes of a start's table, its object and its sentences: some 200 for each of a hundred robots,
# told at both ends.
TOLD_MAX = 1 << 16
STREAMS = {STDOUT: STDOUT_NAME, STDERR: STDERR_NAME}
KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE of fallocate(2)


def refuse_full() -> dict[int, str]:
    """Raises ValueError if a standard stream's file cannot take what a start tells.

    A start that cannot be told would be ended, and its robots have moved by then. Gives the names
    of files that are there, by the handles of their streams, for `refuse_deleted`.
    """
    for handle, name in STREAMS.items():
        if handle in closed_at_first:
            continue
        try:
            _take_room(handle)
        except OSError as error:
            if error.errno in NO_ROOM:
                raise ValueError(
                    f"nothing was started: {file_of(name)}: {NO_ROOM[error.errno]}, then do it "
                    "again."
                ) from error
    return {h: file_of(n) for h, n in STREAMS.items() if h not in closed_at_first and _links(h)}


def refuse_deleted(files: dict[int, str]) -> None:
    """Raises OSError if a file was deleted, as with its folder: what was told there is lost.

    Args:
        files: those that were there.
    """
    for handle, name in files.items():
        if not _links(handle):
            why = "was deleted meanwhile, and what was told there is lost"
            raise OSError(errno.ENOENT, why, name)


def _links(handle: int) -> int:
    """Names that an open file has."""
    return os.fstat(handle).st_nlink


def _take_room(handle: int) -> None:
    """Raises OSError if a file has none; its size stays, as others may write there, too."""
    file = os.fstat(handle)
    os.write(handle, b"")  # a device that is always full refuses even that
    if not stat.S_ISREG(file.st_mode):
        return
    most = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if most != resource.RLIM_INFINITY and file.st_size + TOLD_MAX > most:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    libc = ctypes.CDLL(None, use_errno=True)
    at, length = ctypes.c_int64(file.st_size), ctypes.c_int64(TOLD_MAX)
    if libc.fallocate(handle, KEEP_SIZE, at, length):
        error = ctypes.get_errno()  # some file systems cannot, as those of networks
        raise OSError(error, os.strerror(error))
