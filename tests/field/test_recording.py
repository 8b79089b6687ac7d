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


NAMED = "Two robots say that they are number 3 (10.0.1.2, 10.0.2.2): what 10.0.2.2 says is "


@pytest.mark.parametrize("name", ["count", "again", "once more", "armed", "looked at", "stopped"])
def test_a_robot_that_stands_beside_its_recording_is_not_started(session, name):
    """Who of the two was heard first had decided whether it drove for a second."""
    row = session[name]
    assert session["stood"] and row["code"] == 1 and not row["object"].get("ok")
    said = everything_said(row)
    assert NAMED in said and "may be a recording that is played there" in said
    for untrue in ("Started at", "drives already", "held by", "robot flash", "All stand"):
        assert untrue not in said, said


def test_a_recording_that_begins_in_a_count_calls_the_start_off(session):
    told = session["count"]["object"]
    assert told["called_off"] and told["start_utime_us"] is None
    assert told["sentence"].startswith("Called off: R03 was heard as two robots of one number.")
