# SPDX-License-Identifier: Apache-2.0
"""The file of a session: for one workbench at a time, or the last to write would win."""

import json
import subprocess
import sys

import pytest

from twinmill.workbench.state_file import StateFile

HOLDS = """
import sys
from pathlib import Path
from twinmill.workbench.state_file import StateFile
state = StateFile(Path(sys.argv[1]))
state.write('{"models": 3}')
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another program that has the file open, and the file."""
    path = tmp_path / "state.json"
    command = [sys.executable, "-c", HOLDS, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        assert program.stdout.readline() == b"held\n"
        yield program, path
        program.kill()


def test_a_second_workbench_is_refused_and_changes_nothing(holder):
    _, path = holder
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"another workbench .*state"):
        StateFile(path)
    assert path.read_bytes() == before


def test_after_one_that_was_killed_the_session_goes_on(holder):
    program, path = holder
    program.kill()
    program.wait()
    state = StateFile(path)
    assert state.read("models", 0) == 3
    assert json.loads(path.read_text())["models"] == 3
    state.close()
    StateFile(path).close()


@pytest.mark.parametrize(
    "kept",
    [b'{"a": 1}', b'{"token": "of another program"}', b"{}", b"[1]", b"text", b"\xed\xa1\xda"],
)
def test_what_is_no_session_of_ours_is_not_replaced(tmp_path, kept):
    """Any object of JSON had been taken for a session, and replaced by one."""
    path = tmp_path / "state.json"
    path.write_bytes(kept)
    with pytest.raises(ValueError, match=rf"{path}: holds no session .* name another file"):
        StateFile(path)
    assert path.read_bytes() == kept
