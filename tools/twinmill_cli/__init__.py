# SPDX-License-Identifier: Apache-2.0
"""Command lines: logs, import, calibration, the swarm."""

import _signal  # the part of `signal` that takes no time to import

HEARD = _signal.getsignal(_signal.SIGINT)
if HEARD is _signal.default_int_handler:
    try:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)  # ends what follows without a traceback
    except ValueError:  # not in the main thread
        HEARD = None

import gc  # noqa: E402
import os  # noqa: E402

# The threads of OpenBLAS wait in loops: on matrices as narrow as ours, two take twice the processor
# time of one and are no sooner done. It reads this when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

gc.disable()  # nothing of what is imported is garbage, and to look for it takes long
import twinmill_cli.lazy  # noqa: E402, F401 what all need, Typer above all

gc.freeze()
gc.enable()
if HEARD is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, HEARD)
