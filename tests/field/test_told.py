# SPDX-License-Identifier: Apache-2.0
"""The operator is told how the wheels turn: faults on his side, each with sentence and code.

`make check` runs those that need the least time; with FAULTS=all, as in `make check-long`, all are
run, and the table for firmware/README.md is written.
"""

import os
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from network import run_session_at

ALL = os.environ.get("FAULTS") == "all"
pytestmark = pytest.mark.skipif(
    not os.environ.get("TURBOPI"), reason="TURBOPI does not name the program"
)
LIMIT_S, SLACK_S = 0.5, 0.5  # promised; for a machine that is busy with other tests
LINK_LOST_S = 2.0  # link_timeout_ms
BEGUN_S = 0.5  # in which all have to begin; else all are told to stop
NEVER = None  # no wheel turned


@dataclass(frozen=True)
class Fault:
    """One row: the fault, and what is true of it.

    Attributes:
        words: for the table.
        said: parts of what the tool says, in this order.
        code: its exit code.
        limit_s: within which the wheels stand; NEVER: they never turned.
        is_brief: part of `make check`.
    """

    words: str
    said: tuple[str, ...]
    code: int
    limit_s: float | None = LIMIT_S
    is_brief: bool = False


FAULTS = {
    "ctrl_c": Fault("Ctrl-C", ("Started at", "All stand."), 130),
    "ctrl_v_and_ctrl_c": Fault("Ctrl-V, then Ctrl-C", ("All stand.",), 130, is_brief=True),
    "paste_and_ctrl_c": Fault("5000 lines are pasted, then Ctrl-C", ("All stand.",), 130),
    "ctrl_c_at_the_first_move": Fault(
        "Ctrl-C as the first wheel turns",
        ("All stand",),
        130,
        is_brief=True,
    ),
    "ctrl_c_and_one_is_gone": Fault(
        "R02's program is killed, and Ctrl-C, and again while it waits for R02 (R01)",
        (
            "stop is said all the time; waiting up to 10 s for R02 to sign",
            "NOT ALL STAND: R02: no stop was confirmed.",
            "Ended by a signal after",
        ),
        1,
    ),
    "ctrl_c_five_times": Fault("Ctrl-C, five times", ("All stand.",), 130),
    "terminal_halted_and_ctrl_c": Fault("Ctrl-S for 2.5 s, then Ctrl-C", ("All stand.",), 130),
    "terminal_halted_and_killed": Fault(
        "Ctrl-S for 2.5 s, then SIGTERM", ("All stand.",), 0, is_brief=True
    ),
    "terminal_halted_in_the_countdown_and_stopped": Fault(
        "Ctrl-S in the countdown, then `swarm stop` from elsewhere, and no Ctrl-Q",
        ("Called off: R01, R02 were stopped by another command.", "All stand."),
        1,
        NEVER,
        is_brief=True,
    ),
    "terminal_halted_at_the_start": Fault(
        "Ctrl-S before the start, then SIGINT", ("All stand",), 130, is_brief=True
    ),
    "untethered_at_a_halted_terminal": Fault(
        "the same with --untethered, whose words cannot be told", ("All stand",), 130
    ),
    "hung_up": Fault("terminal closed", (), 1),
    "ctrl_z": Fault("Ctrl-Z", ("All stand.",), 130),
    "killed": Fault(
        "tool killed (SIGKILL); robots whose file says `link_timeout_ms = 0`",
        ("they stop by themselves 2 s after they have lost this command.",),
        137,
        LINK_LOST_S,
    ),
    "away_until_its_link_is_lost": Fault(
        "R03's network is away for 3 s, and Ctrl-C meanwhile",
        ("All stand; R03 stood before: it had lost its link to this command.",),
        1,
        LINK_LOST_S,
    ),
    "slept": Fault(
        "laptop sleeps for 3 s", ("All stand: R01, R02: they had lost their link",), 1, LINK_LOST_S
    ),
    "output_full": Fault(
        "disk below the tool's output full",
        ("nothing was started: standard output: no space is left",),
        1,
        NEVER,
        is_brief=True,
    ),
    "signalled_in_real_time": Fault(
        "SIGRTMIN", ("Started at", "All stand. Stopped by SIGRTMIN"), 0
    ),
    "signalled_as_by_a_fault": Fault("`kill -SEGV`", ("Started at", "All stand."), 0),
    "run_dir_lost": Fault(
        "the robots' run_dir is gone while they are held; then Ctrl-C",
        ("All stand.", "R01 stands, but forgets this stop if started anew: run_dir"),
        130,
    ),
    "log_deleted": Fault(
        "the folder of the tool's output is deleted while it holds; then Ctrl-C",
        ("All stand.", "was deleted meanwhile, and what was told there is lost."),
        1,
    ),
    "stop_of_a_host_without_a_name": Fault(
        '`swarm stop --host ""` (from its first packet)',
        ("'--host': is empty", "So all robots are told to stop.", "All stand."),
        2,
    ),
    "start_with_a_key_made_now": Fault(
        "`swarm start` in a home folder without a key",
        ("a new operator's key was made", "not heard to sign with this operator's key"),
        1,
        NEVER,
    ),
    "stopped_by_another": Fault(
        "`swarm stop` from elsewhere", ("All stand: R01, R02: stopped by another command.",), 1
    ),
    "untethered_and_one_is_deaf": Fault(
        "R03 hears nothing from then on that it has accepted an untethered start; then Ctrl-C in "
        "the countdown; R03's program is ended",
        (
            "waiting up to 10 s for R03 to sign that it stands",
            "R03 drives, and has not confirmed the stop.",
            "NOT ALL STAND: R03: no stop was confirmed. SWITCH OFF BY HAND what still drives. "
            "R03 drives.",
        ),
        1,
    ),
    "taken_over": Fault(
        "another operator starts R01 while it is held; then Ctrl-C of the first",
        (
            "R01 was taken over by another operator or terminal",
            "start at",
            "All stand; R01 was taken over",
        ),
        1,
        is_brief=True,
    ),
    "taken_over_by_one_who_is_killed": Fault(
        "another operator starts R01 and is killed (R01); then Ctrl-C of the first",
        (
            "R01 was taken over by another operator or terminal",
            "start at",
            "then it had lost its link to that command.",
            "All stand; R01 stood before: taken over by another operator or terminal",
        ),
        1,
        LINK_LOST_S,
    ),
    "selected_by_another": Fault(
        "another operator selects a behaviour for R01; then Ctrl-C",
        ("R01 drives: another operator or terminal said select milling", "All stand."),
        130,
    ),
    "stopped_and_armed_by_another": Fault(
        "another operator stops R01 and arms it; then Ctrl-C (R02)",
        (
            "R01 stands: stopped by another command.",
            "All stand; R01 stood before: stopped by another command.",
        ),
        130,
    ),
    "key_changed_while_held": Fault(
        "R02's key is changed while it is held, and its program reloaded; then Ctrl-C (R01)",
        (
            "R02 is not heard to sign with this operator's key any more",
            "NOT ALL STAND: R02: no stop was confirmed.",
            "R02: is not heard to sign with this operator's key any more",
        ),
        1,
    ),
    "other_operator_of_another_key": Fault(
        "an operator with another key starts robots that are held; then Ctrl-C of the first",
        ("nothing was started: R01, R02 are not heard to sign with this operator's key",),
        1,
    ),
    "stopped_in_the_countdown": Fault(
        "`swarm stop` from elsewhere in the countdown of `swarm start --in-s 4`",
        ("Called off: R01, R02 were stopped by another command.", "All stand."),
        1,
        NEVER,
        is_brief=True,
    ),
    "restarted_in_the_countdown": Fault(
        "one robot's driver dies in the countdown",
        ("Called off: R02 was started anew, and has forgotten it.", "All stand."),
        1,
        NEVER,
        is_brief=True,
    ),
    "gone_in_the_countdown": Fault(
        "one robot's program ends in the countdown",
        ("Called off: R02 was not heard any more.", "NOT ALL STAND: R02: no stop was confirmed."),
        1,
        NEVER,
    ),
    "gone_in_the_countdown_partial": Fault(
        "the same with --partial; then Ctrl-C (R01)",
        ("but not all: R02 was not heard to start", "NOT ALL STAND: R02: no stop was confirmed."),
        1,
    ),
    "one_refuses_partial": Fault(
        "R02 is not armed, and `swarm start --partial`; then Ctrl-C (R01)",
        (
            "R02 refused it (was stopped: arm it first (`twinmill swarm arm`)), and stands.",
            "All stand; not all had started.",
        ),
        1,
        is_brief=True,
    ),
    "camera_lost_before": Fault(
        "R02's camera is lost before the start (R01, from its first move)",
        ("Called off: R02 was not driving when the others had begun (camera lost).", "All stand."),
        1,
        BEGUN_S,
    ),
    "camera_frozen_before": Fault(
        "no picture comes of R02's camera from before the start on (R01, from its first move)",
        (
            "Called off: R02 was not driving when the others had begun (no new picture from the "
            "camera).",
            "All stand.",
        ),
        1,
        BEGUN_S,
    ),
    "camera_frozen_before_partial": Fault(
        "the same with --partial; then Ctrl-C (R01)",
        (
            "R02 with a fault (no new picture from the camera), and will drive once it is over.",
            "All stand; not all had started.",
        ),
        1,
    ),
    "gone_at_the_instant": Fault(
        "R02 hangs 0.3 s before the instant (R01, from its first move)",
        ("Called off: R02 was not heard since the instant of the start", "NOT ALL STAND: R02"),
        1,
        BEGUN_S,
    ),
    "another_starts_in_the_countdown": Fault(
        "another operator starts the same robots in the countdown; then Ctrl-C of the second",
        (
            "Called off: R01, R02 were taken over by another operator or terminal (start at",
            "R01, R02: left to that start.",
        ),
        1,
        is_brief=True,
    ),
    "another_starts_while_it_sleeps": Fault(
        "the same while the first's laptop sleeps; then Ctrl-C of the second",
        (
            "Called off: R01, R02 were taken over by another operator or terminal",
            "R01, R02: left to that start.",
        ),
        1,
        is_brief=True,
    ),
    "another_starts_while_it_sleeps_through_its_instant": Fault(
        "the same, and the first wakes after its instant",
        (
            "Called off: R01, R02 were taken over by another operator or terminal",
            "R01, R02: left to that start.",
        ),
        1,
    ),
    "ctrl_c_in_the_countdown": Fault(
        "Ctrl-C in the countdown",
        ("All stand; the start was ended before", "all had confirmed it."),
        130,
        NEVER,
    ),
    "ctrl_c_without_end": Fault(
        "Ctrl-C every 2 ms until the tool has ended",
        ("Started at", "All stand."),
        130,
        is_brief=True,
    ),
    "laptop_a_day_ahead": Fault(
        "a laptop whose clock is a day ahead starts and arms; then another, and Ctrl-C",
        (
            "nothing was started: this computer's clock is 86400.00 s ahead of those of R01, R02",
            "Started at",
            "All stand.",
        ),
        130,
    ),
    "stop_ended_by_ctrl_c": Fault(
        "Ctrl-C of a `swarm stop` that waits for R09 (from its first packet)",
        (
            "NOT ALL STAND: R09: no stop was confirmed.",
            "Ended by a signal after",
            "R01, R02 confirmed it.",
        ),
        1,
    ),
    "stop_ended_by_sigterm": Fault(
        "the same by SIGTERM",
        (
            "NOT ALL STAND: R09: no stop was confirmed.",
            "Ended by a signal after",
            "R01, R02 confirmed it.",
        ),
        1,
        is_brief=True,
    ),
    "ctrl_c_while_it_looks": Fault(
        "Ctrl-C of a `swarm start` that looks who is there",
        ("Ended by a signal: nothing was said to any robot.",),
        130,
        NEVER,
    ),
    "stop_without_a_network": Fault(
        "`swarm stop` on a computer without a network",
        ("nothing leaves this computer", "NOTHING LEFT THIS COMPUTER", "Network is unreachable"),
        1,
        NEVER,
    ),
    "start_with_a_key_that_others_may_read": Fault(
        "`swarm start` with a key file of mode 644",
        ("others may read it (mode 644): `chmod 600", "Nothing was said to any robot."),
        1,
        NEVER,
    ),
    "stop_with_a_key_that_others_may_read": Fault(
        "`swarm stop` with a key file of mode 644 (from its first packet)",
        (
            "NOT ALL STAND: R01, R02: no stop was confirmed.",
            "No robot's signature could be checked: ",
            "others may read it (mode 644): `chmod 600",
        ),
        1,
    ),
    "stop_mistyped": Fault(
        '`swarm stop --robots "1;2"` (from its first packet)',
        ("1;2: must be numbers in 0..99", "So all robots are told to stop.", "All stand."),
        2,
    ),
    "stop_of_an_empty_list": Fault(
        '`swarm stop --robots ""` (from its first packet)',
        ("an empty list: must be numbers", "So all robots are told to stop.", "All stand."),
        2,
    ),
    "stop_beside_a_request_for_help": Fault(
        "`swarm stop -h robot03` (from its first packet)",
        ("No such option: -h. So all robots are told to stop.", "All stand."),
        2,
        is_brief=True,
    ),
    "stop_where_python_has_handlers_of_its_own": Fault(
        "`PYTHONFAULTHANDLER=1 twinmill swarm stop` (from its first packet)",
        ("All stand. 2 robots were heard: R01, R02",),
        0,
    ),
    "untethered_where_python_has_handlers_of_its_own": Fault(
        "the same of `swarm start --untethered`; then `swarm stop` (from its first packet)",
        ("Started at", "They drive on by themselves."),
        0,
        is_brief=True,
    ),
    "stop_of_a_list_that_is_missing": Fault(
        "`swarm stop --robots --key FILE` (from its first packet)",
        (
            "unexpected extra argument",
            "So all robots are told to stop.",
            "All stand. 2 robots were heard: R01, R02",
        ),
        2,
    ),
    "key_mistyped": Fault(
        "`swarm start --key FILE` where there is no such file",
        ("there is no key here", "Nothing was said to any robot."),
        1,
        NEVER,
    ),
    "url_mistyped": Fault(
        "`swarm start --lcm-url udp://239.255.76.67:7667`",
        ("'--lcm-url': udp://239.255.76.67:7667: begins with none of",),
        2,
        NEVER,
    ),
    "robots_mistyped": Fault(
        '`swarm start --robots "1;2"`', ("'--robots': 1;2: must be numbers in 0..99",), 2, NEVER
    ),
    "one_is_missing": Fault(
        "`swarm start --robots 1,9` where there is no R09",
        ("R09: not heard in 1 s, so nothing was started",),
        1,
        NEVER,
    ),
    "killed_with_a_long_link": Fault(
        "tool killed under --link-timeout-s 600; then `swarm status`, `swarm stop` (from its first "
        "packet)",
        ("no operator heard (600 s)", "no operator heard (600 s)", "All stand."),
        0,
    ),
    "driver_dies": Fault(
        "one robot's driver dies; then Ctrl-C",
        ("R01 stands: its program was started anew.", "All stand; R01 stood before: its program"),
        1,
        is_brief=True,
    ),
    "robot_falls_silent": Fault(
        "one robot's program ends; then Ctrl-C",
        ("R02 is not heard any more", "NOT ALL STAND: R02: no stop was confirmed."),
        1,
    ),
    "script_ends": Fault(
        "the script ends that the held robot's own file names (from its last row)",
        ("R01 stands: its script is over", "All stand: R01: its script is over"),
        0,
        is_brief=True,
    ),
    "script_ends_beside_another": Fault(
        "the same beside a robot that drives on; then Ctrl-C",
        ("R01 stands: its script is over", "All stand; R01 stood before: its script is over"),
        130,
    ),
    "camera_lost": Fault(
        "one robot's camera is lost and comes back; then Ctrl-C",
        ("R01 has a fault: camera lost", "R01 drives.", "All stand."),
        130,
    ),
    "behaviour_unknown": Fault(
        "no robot knows the behaviour",
        ("Called off: R01, R02 refused", "All stand."),
        1,
        NEVER,
    ),
    "behaviour_unknown_partial": Fault(
        "the same with --partial", ("NOBODY STARTED: R01, R02 refused",), 1, NEVER, is_brief=True
    ),
    "two_of_one_number": Fault(
        "`swarm stop` where two robots have one number",
        ("NOT ALL STAND: R01: two robots have this number, one may drive.",),
        1,
        NEVER,
    ),
    "never_heard": Fault(
        "`swarm stop` to a robot that is not there",
        (
            "NOT ALL STAND: R09: no stop was confirmed.",
            "R09: was not heard by this command.",
            "--host",
        ),
        1,
        NEVER,
        is_brief=True,
    ),
    "stop_without_a_key": Fault(
        "`swarm stop` on a machine without a key (from its first packet)",
        ("there is no key here", "NOT ALL STAND: R01, R02: no stop was confirmed."),
        1,
    ),
    "stop_without_standard_files": Fault(
        "`swarm stop` without standard input, output and error (from its first packet)",
        (),
        0,
        is_brief=True,
    ),
    "stop_with_few_descriptors": Fault(
        "`swarm stop` under `ulimit -n 5` (from its first packet)",
        ("All stand. 2 robots were heard: R01, R02",),
        0,
        is_brief=True,
    ),
    "start_without_standard_files": Fault(
        "`swarm start` without standard input, output and error (`>&- 2>&-`)", (), 1, NEVER
    ),
    "start_of_an_object_that_nobody_gets": Fault(
        "`swarm start --json >&-`",
        ("standard output: closed (>&-), so nobody gets what is printed",),
        1,
        NEVER,
        is_brief=True,
    ),
    "stop_of_an_object_that_nobody_gets": Fault(
        "`swarm stop --json >&-` (from its first packet)",
        ("All stand.", "standard output: closed (>&-), so nobody gets what is printed"),
        1,
    ),
    "nobody_reads_on": Fault(
        "`swarm start | true`: nobody reads its table (from the first move)",
        ("Started at", "All stand.", "standard output: nobody reads it any more."),
        1,
        is_brief=True,
    ),
    "stop_output_full": Fault(
        "disk below the output of `swarm stop` full (from its first packet)",
        ("All stand.", "no space is left there; make room. What was done is done"),
        1,
        is_brief=True,
    ),
    "selected_in_the_countdown": Fault(
        "`swarm select diffusing` in the countdown of another to `start --behavior milling`",
        (
            "R01, R02 may not play diffusing: where another operator counts down",
            "R01, R02 will not play diffusing (a start that they wait for plays milling)",
        ),
        1,
        NEVER,
    ),
    "start_of_robots_that_never_turn": Fault(
        "`swarm start` of a robot with `duty_cap_pct = 0`",
        (
            "Called off: R04 was not able to drive (no wheel turns: duty_cap_pct is 0 in",
            "All stand.",
        ),
        1,
        NEVER,
    ),
    "start_not_in_utf_8": Fault(
        "`swarm start --behavior` with a word that is not in UTF-8",
        ("is not in UTF-8; type it anew",),
        2,
        NEVER,
    ),
    "stop_not_in_utf_8": Fault(
        "`swarm stop --robots` with such a word (from its first packet)",
        ("must be numbers in 0..99", "So all robots are told to stop.", "All stand."),
        2,
    ),
    "late_network": Fault(
        "all that robots say comes 0.2 s late, by clocks that are right; Ctrl-C",
        ("The network is late, as answers show", "Started at", "All stand."),
        130,
    ),
    "stop_of_a_host_that_is_not_there": Fault(
        "`swarm stop --host` with a wrong address (from its first packet)",
        (
            "NOT ALL STAND: Nothing was heard from 10.0.1.77",
            "Robots answer by multicast alone",
            "SWITCH OFF BY HAND",
        ),
        1,
    ),
    "stop_of_another_robot": Fault(
        "`swarm stop --robots 1` while R02 drives, too (R01; from its first packet)",
        ("R01 stands. R02 drives, and was not asked.",),
        0,
    ),
    "untethered_and_one_hangs": Fault(
        "R02 hangs in the countdown of `swarm start --untethered --partial`, and goes on later",
        ("Started at", "R02 was not heard to start in time, told to stop", "NOT ALL STAND: R02"),
        1,
        NEVER,
    ),
    "untethered_and_one_is_unheard": Fault(
        "R03's network is gone before the instant of `swarm start --untethered --partial`, and "
        "comes back after it (from a second stop)",
        (
            "Started at",
            "R03 was not heard to start in time, told to stop",
            "NOT ALL STAND: R03: no stop was confirmed. SWITCH OFF BY HAND",
        ),
        1,
    ),
    "markup_in_names": Fault(
        "a stranger says names with unfinished markup and escape sequences; Ctrl-C",
        ("Started at", "All stand."),
        130,
        is_brief=True,
    ),
    "flood_of_other_packets": Fault(
        "packets of others without end, and `swarm stop --timeout-s 2` to who is not there",
        ("NOT ALL STAND: R09: no stop was confirmed.",),
        1,
        NEVER,
    ),
}
RUN = [name for name, fault in FAULTS.items() if ALL or fault.is_brief]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Record of the session: see told_session.py."""
    script = Path(__file__).with_name("told_session.py")
    folder = tmp_path_factory.mktemp("told")
    rows = run_session_at(script, folder, *RUN, timeout_s=30 * len(RUN))
    if ALL:
        write_table(Path(os.environ["BUILD"]) / "operator_faults.md", rows)
    return rows


def write_table(path: Path, rows: dict) -> None:
    """As it stands in firmware/README.md."""
    text = "| fault | said | exit code | wheels stand after |\n|---|---|---|---|\n"
    for name, row in rows.items():
        said = "; ".join(f'"{part.rstrip(".")}"' for part in FAULTS[name].said) or "nothing"
        after = "never turned" if row["after_s"] is None else f"{row['after_s']:.2f} s"
        text += f"| {FAULTS[name].words} | {said} | {row['code']} | {after} |\n"
    path.write_text(text)


@pytest.mark.parametrize("name", RUN)
def test_wheels_stand_and_the_truth_is_told_with_its_code(session, name):
    fault, row = FAULTS[name], session[name]
    said = " ".join(" ".join(row["said"]).split())
    at = 0
    for part in fault.said:
        assert part in said[at:], said
        at = said.index(part, at)
    assert row["code"] == fault.code, said
    if fault.limit_s is NEVER:
        assert row["after_s"] is None
    else:
        assert row["after_s"] < fault.limit_s + SLACK_S


def test_a_halted_terminal_keeps_no_robot_without_its_operator(session):
    """They drive on for longer than without one, and stand before the terminal goes on."""
    halted = session["terminal_halted_and_killed"]
    assert halted["drove"] and halted["stood_before_ctrl_q"]


def test_who_refused_a_partial_start_is_known_to_stand(session):
    """It was old news by what it had said before the instant."""
    row = session["one_refuses_partial"]
    told = [row["refused"][name] for name in ("accepted", "mode", "stands", "is_old_news")]
    assert row["other_stood"] and told == [False, "stopped", True, False]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_who_is_said_to_drive_drives(session):
    """And who was to begin with it does not."""
    row = session["untethered_and_one_is_deaf"]
    assert row["drove"] and row["other_stood"]


def test_one_robot_that_drops_out_does_not_end_the_others(session):
    assert session["driver_dies"]["drove"]


def test_who_takes_over_is_told_that_somebody_drove(session):
    """By whom the robot was held is said before it is started; then that the first stopped it."""
    code, said = session["taken_over"]["second"]
    assert said.index("R01 drives already, held by another operator or terminal") < said.index(
        "Started at"
    )
    assert code == 1 and "All stand: R01: stopped by another command." in said


def test_a_count_that_another_stopped_ends_with_it(session):
    """The stop itself is over after that; the instant was later."""
    row = session["stopped_in_the_countdown"]
    assert row["ended_s"] < row["ahead_s"] - 1 and not row["ok"] and row["instant"] is None


def test_of_two_countdowns_the_last_is_the_one_that_starts(session):
    """The first starts nobody and stops nobody; the second has said whom it takes over."""
    row = session["another_starts_in_the_countdown"]
    code, said = row["second"]
    assert row["stood"] and row["drove"] and code == 130 and "All stand." in said
    told = said.index("Started at")
    assert re.search(
        "for a start and begins? by [a-z]+, held by another operator or terminal", said[:told]
    )


@pytest.mark.parametrize("name", [name for name in RUN if "while_it_sleeps" in name])
def test_who_wakes_leaves_robots_to_who_started_them_meanwhile(session, name):
    """The first stopped the second's robots: they had been without its word for long."""
    code, said = session[name]["second"]
    assert session[name]["drove"] and code == 130 and "All stand." in said


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_a_partial_start_goes_on_without_who_is_gone(session):
    assert session["gone_in_the_countdown_partial"]["drove"]
    late_ones = ("gone_at_the_instant", "camera_lost_before", "camera_frozen_before")
    for late in (*late_ones, "camera_frozen_before_partial"):
        assert session[late]["other_stood"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_who_is_not_heard_to_start_may_drive(session):
    """So nobody may say that it did not start."""
    assert session["untethered_and_one_is_unheard"]["drove"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_a_wrong_clock_of_one_laptop_locks_no_other_out(session):
    assert session["laptop_a_day_ahead"]["early_code"] == 1


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_who_is_taken_over_holds_the_others_alone(session):
    assert session["taken_over_by_one_who_is_killed"]["drove"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_another_key_stops_nobody(session):
    row = session["other_operator_of_another_key"]
    code, said = row["first"]
    assert row["drove"] and code == 130 and "All stand." in said


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_who_looks_is_told_that_nobody_holds_the_robots(session):
    """Looking is no failure, whatever is seen."""
    assert session["killed_with_a_long_link"]["status_code"] == 0


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_nobody_is_told_anything_where_one_is_missing(session):
    """So there is nothing that would have to be taken back."""
    assert session["one_is_missing"]["commands"] == 0


def test_names_of_strangers_are_shown_as_they_are(session):
    row = session["markup_in_names"]
    assert row["status_code"] == 0 and not row["got_through"]
    assert "[/red] [bold" in row["status"] and "Traceback" not in row["status"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_a_stop_makes_no_key(session):
    assert not session["stop_without_a_key"]["made_a_key"]


@pytest.mark.skipif(not ALL, reason="part of make check-long")
def test_a_mistyped_key_is_not_made(session):
    assert not session["key_mistyped"]["made_a_key"]
