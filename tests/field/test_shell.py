# SPDX-License-Identifier: Apache-2.0
"""People use a shell: the wheels stand, and words and exit code say so."""

import os
from dataclasses import dataclass
from pathlib import Path

import pytest
from network import run_session_at

ALL = os.environ.get("FAULTS") == "all"
pytestmark = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)
LIMIT_S, SLACK_S = 0.5, 0.5  # promised; for a machine that is busy with other tests
NEVER = None  # no wheel turned
NO_KEY = "No Ctrl-C reaches this command: `twinmill swarm stop`, or "
BY_KEY = "Ctrl-C stops them; they stop by themselves"
BY_SIGINT = -2  # a shell that dies so has ended its script: nothing of that follows


@dataclass(frozen=True)
class Case:
    """Facts that hold for one way of stopping.

    Attributes:
        said: parts of what is told, in this order.
        code: the script's exit code; negative: it died by that signal.
        limit_s: within which the wheels stand; NEVER: they never turned.
        is_brief: part of `make check`.
    """

    said: tuple[str, ...]
    code: int
    limit_s: float | None = LIMIT_S
    is_brief: bool = False


CASES = {
    "ctrl_c_in_a_loop": Case((BY_KEY, "All stand."), BY_SIGINT, is_brief=True),
    "ctrl_c_in_the_countdown_of_a_loop": Case(
        ("All stand; the start was ended before",), BY_SIGINT, NEVER
    ),
    "ctrl_backslash": Case((BY_KEY, "All stand."), BY_SIGINT),
    "background_of_a_script": Case((BY_KEY, "All stand."), BY_SIGINT),
    "background_of_a_terminal": Case((NO_KEY, "All stand."), 0, is_brief=True),
    "stderr_thrown_away_and_a_robot_unplugged": Case(
        (NO_KEY, "NOT ALL STAND: R02: no stop was confirmed."), 1
    ),
    "stop_whose_stdout_is_thrown_away": Case(
        ("NOT ALL STAND: R09: no stop was confirmed.",), 1, NEVER, is_brief=True
    ),
    "cron": Case((NO_KEY, "All stand."), 0),
    "timeout_in_a_script": Case((NO_KEY, "All stand."), 124),
    "nohup_and_the_terminal_closed": Case((BY_KEY, "All stand."), -1),
    "pipe_into_tee": Case((BY_KEY, "All stand."), BY_SIGINT),
    "all_into_tee": Case((BY_KEY, "twinmill: All stand."), BY_SIGINT, is_brief=True),
    "all_into_tee_and_a_robot_hangs": Case(
        (BY_KEY, "waiting up to 10 s for R02", "twinmill: NOT ALL STAND: R02: no stop was"), 1
    ),
    "nap": Case((BY_KEY, "All stand."), BY_SIGINT),
    "quota": Case(
        ("nothing was started: standard output (/", "log.txt): no file may become so large"),
        1,
        NEVER,
    ),
    "one_of_two_is_heard": Case(
        (
            "1 robot was heard: R01. If you have more, name all of them, as --robots 1,2,3",
            "All stand. 1 robot was heard",
        ),
        0,
    ),
}
RUN = [name for name, case in CASES.items() if ALL or case.is_brief]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see shell_session.py."""
    script = Path(__file__).with_name("shell_session.py")
    return run_session_at(script, tmp_path_factory.mktemp("shell"), *RUN, timeout_s=30 * len(RUN))


@pytest.mark.parametrize("name", RUN)
def test_wheels_stand_and_the_shell_is_told_the_truth(session, name):
    case, row = CASES[name], session[name]
    said, at = " ".join(" ".join(row["said"]).split()), 0
    for part in case.said:
        assert part in said[at:], said
        at = said.index(part, at)
    assert row["code"] == case.code and "went on" not in row["said"], said
    if case.limit_s is NEVER:
        assert row["after_s"] is None
    else:
        assert row["after_s"] < case.limit_s + SLACK_S


def test_no_other_robot_starts_after_a_ctrl_c_in_a_loop(session):
    assert not session["ctrl_c_in_a_loop"]["second_moved"]


def test_what_ctrl_c_does_not_reach_goes_on(session):
    """It had said that Ctrl-C stops the robots; what it names now does."""
    assert session["background_of_a_terminal"]["drove"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_a_start_that_slept_for_a_second_holds_its_robots_again(session):
    assert session["nap"]["drove"]
