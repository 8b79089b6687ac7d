# SPDX-License-Identifier: Apache-2.0
"""Leaving at once, after Ctrl-C as a shell expects it: by the signal itself."""

import _signal  # the part of `signal` that takes no time to import
import os
from typing import NoReturn

STOPPED = 130  # exit code after Ctrl-C, as a shell has it


def exit_now(code: int) -> NoReturn:
    """Ends this program without the interpreter's own end: nothing more is written.

    130 is left by SIGINT itself. A shell's loop ends with a command that died so, and goes on after
    one that exits, be it with 130 (M. Cracauer, "Proper handling of SIGINT/SIGQUIT").
    """
    if code == STOPPED:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
        _signal.pthread_sigmask(_signal.SIG_UNBLOCK, [_signal.SIGINT])
        os.kill(os.getpid(), _signal.SIGINT)
    os._exit(code)
