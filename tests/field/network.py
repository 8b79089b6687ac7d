# SPDX-License-Identifier: Apache-2.0
"""Runs a session, a script of this folder, in a network of its own, and reads what it prints."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

NETWORK = (
    "ip link set lo up && ip link set lo multicast on && "
    'ip route add 224.0.0.0/4 dev lo && exec "$@"'
)


def run_session(script: str, *arguments) -> dict:
    """Findings of a session of this folder, as it printed them; skips where networks cannot be."""
    return run_session_at(Path(__file__).with_name(script), *arguments)


def run_session_at(script: Path, *arguments, timeout_s: float = 200) -> dict:
    """Findings of a session that lies anywhere."""
    command = ["unshare", "--net", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
    command += ["sh", "-c", NETWORK, "sh", sys.executable, script]
    try:
        done = subprocess.run(
            [*map(str, command), *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=timeout_s,
        )
    except FileNotFoundError as error:
        pytest.skip(f"not installed: {error.filename}")
    if "unshare: " in done.stderr:
        pytest.skip(f"no network namespace here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def run_twin_session(script: str, *arguments) -> dict:
    """Findings of a session that starts the twin; skips where it is not named."""
    if not os.environ.get("TWIN_RUN"):
        pytest.skip("TWIN_RUN does not name the program")
    return run_session(script, *arguments)
