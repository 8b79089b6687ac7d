# SPDX-License-Identifier: Apache-2.0
"""Strangers do not move my robots, and nobody says for them that they stand."""

import os

import pytest
from network import run_session

pytestmark = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)
LINK_TIMEOUT_S, SLACK_S = 0.8, 0.6  # the machine may be busy with other tests


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see attack_session.py."""
    return run_session("attack_session.py", tmp_path_factory.mktemp("attack"))


@pytest.mark.parametrize(
    "how",
    [
        "unsigned",
        "replayed",
        "changed",
        "signed_with_another_key",
        "signed_with_another_robots_key",
    ],
)
def test_stranger_starts_no_robot(session, how):
    assert session["starts"][how] is False


def test_commands_that_were_kept_back_are_void_after_a_stop_and_after_3_s(session):
    assert session["kept_back"] is False


def test_start_of_an_earlier_run_of_the_program_is_refused(session):
    assert session["restarted"] == {"armed": True, "moves": False}


def test_stop_holds_though_the_driver_dies_where_nothing_can_be_written(session):
    assert session["latched"] == {"drove": True, "stands": True, "moved_after": False}


def test_mode_that_there_is_not_keeps_no_tool_from_its_work(session):
    found = session["unknown_mode"]
    assert found["drove"] and found["stands"]
    assert "unknown mode 77" in found["said"] and "Traceback" not in found["said"]


def test_robots_stop_if_the_command_that_started_them_fails(session):
    assert session["start_that_cannot_be_told"] == {"code": 1, "drove": False, "stands": True}


def test_one_stop_beats_a_flood_of_starts(session):
    assert session["flood_of_starts"] == {"drove": True, "stands": True, "moved_after": False}


def test_stop_gets_through_a_flood_of_nonsense(session):
    assert session["flood_of_nonsense"]["stands"]


def test_all_stand_cannot_be_forged(session):
    assert session["forged_stands"] == {"drives": True, "stands": False, "signed": False}


def test_robot_that_has_lost_its_operator_stops(session):
    lost = session["lost_operator"]
    assert lost["held"] and "lost its operator" in lost["alarms"]
    assert 0 < lost["took_s"] < LINK_TIMEOUT_S + SLACK_S


def test_two_robots_of_one_number_are_said_by_all(session):
    said = session["double"]
    assert said["heard_here"] and said["said_by_robot"] and said["answer"]
    assert any("TWO ROBOTS" in alarm for alarm in said["alarms"])
