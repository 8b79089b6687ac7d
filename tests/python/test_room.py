# SPDX-License-Identifier: Apache-2.0
"""A start that could not be told is refused before a wheel turns; the kernel says what is full."""

import os
import resource
import subprocess
import sys

import pytest

PROGRAM = "from twinmill_cli.room import refuse_full; refuse_full()"


def refused(stdout, **options) -> str:
    """Last words of a program whose stdout goes there; empty where it has room."""
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, **options)
    return done.stderr.splitlines()[-1] if done.returncode else ""


def test_a_device_that_is_full_is_named():
    with open("/dev/full", "w") as full:
        assert "nothing was started: standard output: no space is left there" in refused(full)


def test_a_file_that_may_not_grow_is_named(tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    with open(tmp_path / "log", "w") as log:
        said = refused(log, preexec_fn=limit)
    assert f"standard output ({tmp_path / 'log'}): no file may become so large" in said


def test_room_is_taken_and_what_stands_in_a_file_stays(tmp_path):
    log = tmp_path / "log"
    log.write_text("of yesterday\n")
    with open(log, "a") as appended:
        assert refused(appended) == ""
    assert log.read_text() == "of yesterday\n"


@pytest.mark.parametrize("stdout", [subprocess.DEVNULL, subprocess.PIPE])
def test_what_is_no_file_needs_no_room(stdout):
    assert refused(stdout) == ""


def test_a_disk_with_too_little_room_is_named(tmp_path):
    """A disk of eight kilobytes, mounted for this test alone."""
    script = (
        'mount -t tmpfs -o size=8k none "$1" && "$2" -c "$3" > "$1/log"; cd /; umount "$1"; exit 0'
    )
    command = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
    command += ["sh", "-c", script, "sh", str(tmp_path), sys.executable, PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True)
    if "unshare: " in done.stderr or "mount: " in done.stderr:
        pytest.skip(f"nothing can be mounted here: {done.stderr.strip()}")
    assert f"standard output ({tmp_path / 'log'}): no space is left there" in done.stderr
