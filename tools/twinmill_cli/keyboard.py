# SPDX-License-Identifier: Apache-2.0
"""Any key, without Enter."""

import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def any_key() -> Iterator[Callable[[], bool]]:
    """Gives a function that tells if a key was pressed since; never, where no keyboard is.

    The terminal is left as it was found.
    """
    if not sys.stdin.isatty():
        yield lambda: False
        return
    fd = sys.stdin.fileno()
    before = termios.tcgetattr(fd)
    tty.setcbreak(fd)
    try:
        yield lambda: bool(select.select([fd], [], [], 0)[0])
    finally:
        termios.tcflush(fd, termios.TCIFLUSH)
        termios.tcsetattr(fd, termios.TCSANOW, before)
