# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C before a command has begun, as in the second that imports take: one sentence.

An exception in the midst of imports would be a traceback, or be swallowed by a library.
"""

import _signal  # the part of `signal` that takes no time to import
import os
import sys
from contextlib import suppress
from typing import Any, NoReturn

PROGRAMS = ("twinmill", "twin_run", "twin_sweep")
STOPPED = 130  # as a shell has it


def _leave(*_: Any) -> NoReturn:
    name = os.path.basename(sys.argv[0])
    words = f"{name}: Stopped before it began: nothing was done, and nothing was sent.\n"
    os.write(2, words.encode(errors="replace"))
    os._exit(STOPPED)


def begin() -> None:
    """From now on Ctrl-C leaves, unless something else was made of it."""
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        with suppress(ValueError):  # not in the main thread
            _signal.signal(_signal.SIGINT, _leave)


def end() -> None:
    """From now on Ctrl-C is a KeyboardInterrupt again."""
    if _signal.getsignal(_signal.SIGINT) is _leave:
        _signal.signal(_signal.SIGINT, _signal.default_int_handler)


def is_program() -> bool:
    """This is one of our programs, which has not begun; else who imports us goes on."""
    return os.path.basename(sys.argv[0] if sys.argv else "") in PROGRAMS
