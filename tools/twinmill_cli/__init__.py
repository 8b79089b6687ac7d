# SPDX-License-Identifier: Apache-2.0
"""Command lines: logs, import, calibration, the swarm."""

import os

# The threads of OpenBLAS wait in loops: on matrices as narrow as ours, two take twice the processor
# time of one and are no sooner done. It reads this when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
