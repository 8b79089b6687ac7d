# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm`: real robots' programs obey and answer, though half of all packets are lost."""

import os

import pytest
import typer
from network import run_session

from twinmill.robots.tell import make_command
from twinmill_cli.swarm_door import parse_robots

needs_programs = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)
FRAME_S = 1 / 30
SLACK_S = 0.5  # the machine may be busy with other tests
STILL, FORWARD = [0, 0, 0, 0], [100, 100, 100, 100]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see swarm_session.py."""
    return run_session("swarm_session.py", tmp_path_factory.mktemp("swarm"))


@needs_programs
def test_half_of_the_packets_were_really_lost(session):
    assert all(r["lost"] > 20 for r in session["rounds"])


@needs_programs
def test_all_robots_start_at_one_instant_under_loss(session):
    for r in session["rounds"]:
        assert r["armed"] == [True] * 3
        assert r["found"] == [1, 2, 3] and r["start_accepted"] == [True] * 3
        assert all(0 <= late_s < FRAME_S + SLACK_S for late_s in r["late_s"])


@needs_programs
def test_all_robots_stop_under_loss(session):
    for r in session["rounds"]:
        assert r["stop_accepted"] == [True] * 3
        assert r["duties_after_stop"] == [STILL] * 3


@needs_programs
def test_nobody_starts_when_one_does_not_acknowledge(session):
    assert session["deaf"] == {"called_off": True, "accepted": [True, None, True], "moved": False}


@needs_programs
def test_one_robot_can_be_told_alone(session):
    # diffusing_v2 drives straight on at what it sees.
    assert session["one_robot"] == [FORWARD, STILL, STILL]


@needs_programs
def test_a_stop_is_said_though_nobody_reads_what_the_command_says(session):
    moved, stood = session["unheard"]
    assert STILL not in moved and stood == [True] * 3


@needs_programs
def test_tables_of_ones_own_are_started_by_name_where_they_are_known(session):
    own = session["own_table"]
    assert own["refused"] == {"3": "no behaviour 'ahead'"} and own["called_off"]
    assert own["accepted"] == [True, True] and own["stopped"] == ["stopped"] * 3
    assert session["twin_behaviors"] == ["ahead"] * 2


@needs_programs
def test_bad_commands_are_refused_with_a_reason_and_stop_never_is(session):
    answers = session["robot_answers"]
    assert {name for name, (accepted, _) in answers.items() if accepted} == {"stop_however_old"}
    assert "'dance'" in answers["select_unknown"][1]
    assert "clocks" in answers["start_late"][1] and "clocks" in answers["start_far_ahead"][1]


@needs_programs
def test_twin_answers_as_the_robot_does(session):
    assert session["twin_answers"] == session["robot_answers"]
    assert session["twin_modes"] == ["running"] * 2
    assert session["twin_stopped"] == ["stopped"] * 2


def test_numbers_of_commands_cannot_be_guessed():
    numbers = [make_command(0).seq for _ in range(1000)]
    assert len(set(numbers)) == 1000 and min(numbers) >= 0
    # Of 1000 numbers below 2^31, none is in the lower or the upper half: once in 2^999.
    assert min(numbers) < 2**30 < max(numbers)


@pytest.mark.parametrize("text", ["a", "", "1,,2", "100", "-1", "1.5"])
def test_robots_that_cannot_be_are_refused(text):
    with pytest.raises(typer.BadParameter, match=r"0\.\.99"):
        parse_robots(text)


def test_robots_are_numbers_with_commas():
    assert parse_robots("3,1,99") == {1, 3, 99} and parse_robots(None) == set()
