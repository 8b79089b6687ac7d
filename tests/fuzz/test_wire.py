# SPDX-License-Identifier: Apache-2.0
"""Whatever listens on a network survives any packet, and does what it did.

Seconds and seed come from TWINMILL_FUZZ_S and TWINMILL_FUZZ_SEED: to search for an hour, 3600.
"""

import os

import pytest
from network import run_session_at

SECONDS = float(os.environ.get("TWINMILL_FUZZ_S", "10"))
SEED = os.environ.get("TWINMILL_FUZZ_SEED", "1")


def test_programs_survive_any_packet(tmp_path):
    if not os.environ.get("TURBOPI"):
        pytest.skip("TURBOPI does not name the program")
    found = run_session_at(
        os.path.join(os.path.dirname(__file__), "wire_session.py"),
        tmp_path,
        SECONDS,
        SEED,
        timeout_s=SECONDS + 120,
    )
    assert found["ended"] == [], f"the last packets are in {tmp_path}"
    assert found["packets"] > 100 * SECONDS
    # The program's own child drives: a new one would say that the old one died.
    assert found["same_process"] and found["moved"] == []
    assert found["drives"] and found["robot_stands"] and found["twin_stands"] == [True, True]
    assert found["status_code"] == 0
