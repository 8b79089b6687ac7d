# SPDX-License-Identifier: Apache-2.0
"""Exit codes of a program whose last words nobody takes, where Python writes them at its end.

Programs of their own, with Python's own buffers: PYTHONUNBUFFERED would hide what is left in them.
"""

import os
import subprocess
import sys

import pytest

PLAIN = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
TWINMILL = [sys.executable, "-c", "from twinmill_cli.main import main; main()"]
EFFECTS = ["twin", "effects"]  # prints and ends
REFUSED = ["twin", "effects", "--no-such-option"]


def end(words, stdout):
    """Exit code and stderr."""
    done = subprocess.run(
        [*TWINMILL, *words],
        stdout=stdout,
        stderr=subprocess.PIPE,
        env=PLAIN,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stderr


def test_a_full_disk_is_told_with_1_and_not_by_python():
    with open("/dev/full", "w") as full:
        code, told = end(EFFECTS, full)
    assert code == 1
    assert "standard output: no space is left there" in told
    assert "Exception ignored" not in told


def test_a_reader_that_is_gone_is_told_with_1_and_not_by_python():
    reads, writes = os.pipe()
    os.close(reads)
    code, told = end(EFFECTS, writes)
    os.close(writes)
    assert code == 1
    assert "Exception ignored" not in told


@pytest.mark.parametrize("json", [[], ["--json"]])
def test_a_command_line_that_is_refused_has_its_own_code(json):
    with open("/dev/full", "w") as full:
        code, told = end([*REFUSED, *json], full)
    assert code == 2
    assert "Exception ignored" not in told
