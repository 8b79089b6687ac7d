# SPDX-License-Identifier: Apache-2.0
"""Command lines: logs, import, calibration, the swarm."""

import os
import signal
import threading

# The threads of OpenBLAS wait in loops: on matrices as narrow as ours, two take twice the processor
# time of one and are no sooner done. It reads this when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _read_quietly() -> None:
    """Reads the large module that all need; Ctrl-C meanwhile ends it without a traceback."""
    heard = signal.getsignal(signal.SIGINT)
    if (
        heard is signal.default_int_handler
        and threading.current_thread() is threading.main_thread()
    ):
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        import typer  # noqa: F401

        signal.signal(signal.SIGINT, heard)


_read_quietly()
