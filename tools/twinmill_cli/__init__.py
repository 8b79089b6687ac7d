# SPDX-License-Identifier: Apache-2.0
"""Command lines: logs, import, calibration, the swarm."""

import os
import sys

from twinmill_cli import own_path

if own_path.is_program():
    own_path.put_first()

from twinmill_cli import early

early.begin()  # until a command begins, or the end of this module
if own_path.is_program():
    sys.excepthook = early.tell_failure  # until main() begins

import gc  # noqa: E402

# The threads of OpenBLAS wait in loops: on matrices as narrow as ours, two take twice the processor
# time of one and are no sooner done. It reads this when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

gc.disable()  # nothing of what is imported is garbage, and to look for it takes long
from twinmill_cli import ending, lazy, spelling  # noqa: E402, F401 what all need, Typer above all

gc.freeze()
gc.enable()
if not own_path.is_program():
    early.end()
