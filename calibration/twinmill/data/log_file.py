# SPDX-License-Identifier: Apache-2.0
"""Writes an LCM log, and notices if the disk did not take all of it."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import lcm


@contextmanager
def log_file(path: Path) -> Iterator[lcm.EventLog]:
    """A log for write_event(utime_us, channel, data), whole at the end of the block.

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
