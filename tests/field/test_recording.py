# SPDX-License-Identifier: Apache-2.0
"""A recording that is played tells nothing of now: its robot drives on, out of hearing."""

import os

import pytest
from network import run_session

pytestmark = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see recording_session.py."""
    if os.geteuid() != 0:
        pytest.skip("only root may join two network namespaces")
    return run_session("recording_session.py", tmp_path_factory.mktemp("recording"))


def everything_said(row: dict) -> str:
    return f"{row['object'].get('sentence', '')} {row['err']}"


@pytest.mark.parametrize("name", ["partial", "all", "arm", "status"])
def test_nothing_is_told_of_a_robot_that_drives_out_of_hearing(session, name):
    row = session[name]
    assert session["drove_on"] and row["code"] == 1
    said = everything_said(row)
    assert "NOBODY KNOWS WHAT R03 DOES NOW" in said and "a recording that is played" in said
    for untrue in ("Started at", "stand", "held by", "drives already", "takes over", "stopped by"):
        assert untrue not in said.replace("NOT ALL STAND", ""), said


def test_a_partial_start_that_reached_nobody_says_so(session):
    """It said that it had started, that another held the robot, and in the end that all stand."""
    told = session["partial"]["object"]
    assert told["sentence"].startswith("NOBODY WAS HEARD TO START")
    assert told["drove_before"] == [] and told["start_utime_us"] is None
    (robot,) = told["robots"]
    assert (robot["accepted"], robot["mode"], robot["stands"]) == (None, "", False)
