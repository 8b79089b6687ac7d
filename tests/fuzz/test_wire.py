# SPDX-License-Identifier: Apache-2.0
"""Whatever listens on a network survives any packet, and does what it did.

Seeds are packets that LCM's own library (1.3.1, 1.5.3) reads or refuses. What else may come is made
up while the test runs, in a network of its own, and kept nowhere.

Seconds and seed come from TWINMILL_FUZZ_S and TWINMILL_FUZZ_SEED: to search for an hour, 3600.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from network import run_session_at

SECONDS = float(os.environ.get("TWINMILL_FUZZ_S", "10"))
SEED = os.environ.get("TWINMILL_FUZZ_SEED", "1")

CORPUS = Path(__file__).with_name("corpus")
CHANNEL_WITHOUT_END = re.compile(rb"LC02.{4}[^\0]{0,63}\Z|LC02.{4}[^\0]{64}", re.DOTALL)
# The header of a message that is its only fragment: count, size, offset 0, fragment 0 of 1.
FRAGMENT = re.compile(rb"LC03(?!.{8}\0{7}\x01)", re.DOTALL)


@pytest.mark.parametrize("kind", ["command", "wire"])
def test_corpora_hold_only_packets_that_are_whole_or_refused_everywhere(kind):
    for path in sorted((CORPUS / kind).iterdir()):
        data = path.read_bytes()
        assert not FRAGMENT.search(data), path
        assert not CHANNEL_WITHOUT_END.search(data), path


def test_pictures_of_the_corpus_end_no_decoder_of_others():
    """Pillow's and OpenCV's, in a process of their own: they read them, or say that they cannot."""
    script, pictures = Path(__file__).with_name("decode_pictures.py"), CORPUS / "mjpg"
    command = [sys.executable, script, *sorted(pictures.iterdir())]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


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
