#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# LCM 1.5.3, the wheel of PyPI: lcm-logger goes on when the process that was started is told to end.
#
# Guess: `lcm-logger run.lcmlog & kill -TERM $!` ends the recording, as with Debian's program of that name.
# Seen: the command is a Python program that starts the real one as a child and passes no signal on. SIGTERM ends
#   the parent at once; the child, whose number nobody was told, goes on writing, so that a script which records
#   run after run leaves one logger more each time. Only a signal to the whole process group, or Ctrl-C, ends it.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet lcm==1.5.3
cd "$work"
"$work/venv/bin/python" - <<'PY'
import os
import signal
import subprocess
import time
from pathlib import Path

log = Path("run.lcmlog")
wrapper = subprocess.Popen(
    [Path("venv/bin/lcm-logger").resolve(), "--lcm-url=memq://", log],
    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
)


def of_group():
    """Names of the processes of the logger's group that have not ended."""
    names = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, rest = stat.read_text().split("(", 1)[1].rsplit(")", 1)
        except OSError:
            continue
        if int(rest.split()[2]) == wrapper.pid and rest.split()[0] != "Z":
            names.append(name)
    return sorted(names)


deadline = time.monotonic() + 30
while not log.exists() or len(of_group()) < 2:
    assert time.monotonic() < deadline, of_group()
    time.sleep(0.1)
print("recording:", of_group())
wrapper.terminate()
print("SIGTERM: the command ends with", wrapper.wait(10))
time.sleep(2)
left = of_group()
print("two seconds later:", left)
os.killpg(wrapper.pid, signal.SIGTERM)
assert wrapper.returncode == -signal.SIGTERM and left == ["lcm-logger"], (wrapper.returncode, left)
PY
