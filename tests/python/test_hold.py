# SPDX-License-Identifier: Apache-2.0
"""Verdicts on held robots follow their signed words, which all else may contradict."""

import io
import time

import pytest
import turbopi
from rich.console import Console

from twinmill.robots import hold
from twinmill.robots.fleet import TELEMETRY, Fleet, Heard, Robot
from twinmill.robots.hold import DOUBLE, Held
from twinmill.robots.tell import SIGNED_VERBS, VERBS, Answer, Start, answers
from twinmill_cli.swarm_end import of_stops
from twinmill_cli.swarm_screen import answer_table

SESSION, OWN = 7, 100  # and the counter of the start
STOPPED, TABLE, SCRIPT, FAULT = 0, 1, 2, 3


class Nowhere:
    """A bus that is not listened to."""

    def subscribe(self, *_):
        pass


@pytest.fixture
def held(monkeypatch):
    """One robot that was started, and a function that has it say how it is."""
    monkeypatch.setattr(hold, "SETTLE_S", 0.0)
    fleet = Fleet("", connect=lambda _: Nowhere())
    robot = fleet.robots[3] = Robot(3, heard_s=time.monotonic())
    answer = Answer(3, True, True, "", "running", False, False, [])

    def say(mode, said_mode=None, *, stands=True, session=SESSION, flags=0, counter=OWN):
        link, telemetry = turbopi.link_t(), turbopi.telemetry_t()
        link.counter = counter
        link.mode, link.stands, link.session, link.status_flags = mode, stands, session, flags
        link.utime_us = time.time_ns() // 1000
        telemetry.status_flags = flags & TELEMETRY.STATUS_DOUBLE
        telemetry.mode = mode if said_mode is None else said_mode
        robot.link, robot.telemetry, robot.link_s = link, telemetry, time.monotonic()

    say(TABLE, stands=False)
    fleet.counter, fleet.held = OWN, {3}
    robots = Held(fleet, Start(0, [answer], {3: SESSION}))

    def words(*arguments, **options) -> str:
        say(*arguments, **options)
        said = [*robots.news(), *robots.news()]
        return said[0] if said else ""

    yield robots, robot, words


def test_driving_is_no_news(held):
    robots, _, words = held
    assert words(TABLE, stands=False) == "" and not robots.is_over


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ({"flags": TELEMETRY.STATUS_LINK_LOST}, "lost its link"),
        ({"flags": TELEMETRY.STATUS_LATCHED}, "stopped by another command"),
        ({"session": SESSION + 1}, "started anew"),
        ({}, "button"),
    ],
)
def test_a_robot_that_stands_is_said_to_with_what_it_signs(held, says, reason):
    robots, _, words = held
    words(TABLE, stands=False)
    assert reason in words(STOPPED, **says) and robots.is_over


@pytest.mark.parametrize(("plays", "says"), [("diffusing", "said select"), ("milling", "")])
def test_a_selection_that_a_start_overrides_is_not_told(held, plays, says):
    """Said in the countdown, and obeyed: at its instant the start selected its own."""
    _, robot, words = held
    words_said = "select diffusing at 11:01:31"
    robot.commands[OWN + 1] = Heard(
        77, VERBS.VERB_SELECT, SESSION, OWN + 1, words_said, "diffusing"
    )
    robot.run = turbopi.run_t()
    robot.run.behavior = plays
    told = words(TABLE, stands=False, counter=OWN + 1)
    assert says in told and bool(told) == bool(says)


def test_a_script_that_is_over_is_told_apart_from_a_table(held):
    _, _, words = held
    words(SCRIPT, stands=False)
    assert "its script is over" in words(STOPPED)


@pytest.mark.parametrize(
    "says",
    [
        {"stands": False},
        {"flags": TELEMETRY.STATUS_STOP_UNCONFIRMED},
        {"said_mode": FAULT},
    ],
)
def test_nothing_is_over_while_anything_contradicts_it(held, says):
    robots, _, words = held
    words(TABLE, stands=False)
    assert "not that its motor board took zero" in words(STOPPED, **says)
    assert not robots.is_over


def test_a_start_that_was_accepted_and_has_not_begun_is_held(held):
    robots, _, words = held
    assert "is not heard to drive yet" in words(STOPPED) and not robots.is_over


def test_a_fault_has_its_alarm(held):
    robots, _, words = held
    assert "camera lost" in words(FAULT, flags=TELEMETRY.STATUS_CAMERA_LOST)
    assert not robots.is_over


def test_two_of_one_number_are_said_once(held):
    _, robot, words = held
    for host in ("10.0.0.1", "10.0.0.2", "10.0.0.1"):
        robot.senders.add((host, 1))
    assert "two robots" in words(TABLE) and words(STOPPED, session=SESSION + 1) == ""


def test_silence_is_said(held, monkeypatch):
    robots, robot, words = held
    monkeypatch.setattr(hold, "SILENT_S", -1.0)
    robot.heard_s = 0.0
    assert "not heard any more" in words(TABLE) and not robots.is_over


@pytest.mark.parametrize(
    ("then", "reason", "is_meant"),
    [
        ({"flags": TELEMETRY.STATUS_LINK_LOST | TELEMETRY.STATUS_LATCHED}, hold.LINK_LOST, False),
        ({"flags": TELEMETRY.STATUS_LATCHED}, hold.DRIVES, True),
        ({"session": SESSION + 1, "flags": TELEMETRY.STATUS_LATCHED}, hold.RESTARTED, False),
    ],
)
def test_by_what_a_robot_stood_is_asked_after_the_stop_that_reached_it_too_late(
    held, then, reason, is_meant
):
    """A network that is away until the link is lost, and back before the stop gives up."""
    robots, _, words = held
    words(TABLE, stands=False)
    robots.settle()
    assert robots.ends()["R03"] is hold.DRIVES
    words(STOPPED, **then)
    robots._told[3] = hold.DRIVES  # nothing of it was told yet
    assert robots.ends()["R03"] is reason and reason.is_meant == is_meant


def test_who_stands_as_the_stop_is_said_stood_by_itself(held):
    """Be it that nothing was told of it yet."""
    robots, _, words = held
    words(TABLE, stands=False)
    words(STOPPED)
    robots._told[3] = hold.DRIVES
    assert robots.ends()["R03"] is hold.DRIVES
    robots.settle()
    assert robots.ends()["R03"] is hold.BY_BUTTON


def test_a_robot_with_another_key_is_heard_and_not_believed(held, monkeypatch):
    robots, robot, words = held
    monkeypatch.setattr(hold, "SILENT_S", -1.0)
    robot.heard_s = time.monotonic()
    assert "is not heard to sign with this operator's key" in words(TABLE) and not robots.is_over


def test_a_camera_that_stutters_is_no_flood_of_words(held, monkeypatch):
    _, _, words = held
    monkeypatch.setattr(hold, "SETTLE_S", 0.3)
    flicker = [words(FAULT if k % 2 else TABLE, stands=False) for k in range(20)]
    assert flicker == [""] * 20


def hear(robot, verb, words, *, counter=OWN + 1, session=SESSION):
    robot.commands[counter] = Heard(9, verb, session, counter, words)


def test_a_start_of_another_operator_takes_a_robot_over(held):
    robots, robot, words = held
    hear(robot, VERBS.VERB_START, "start milling at 12:00:01")
    said = words(TABLE, stands=False, counter=OWN + 1)
    assert "taken over by another operator or terminal (start milling at 12:00:01)" in said
    assert robots._fleet.held == set() and not robots.is_over
    (state,) = robots.states.values()
    assert not state.is_meant


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ({"flags": TELEMETRY.STATUS_LINK_LOST}, "then it had lost its link to that command"),
        ({"flags": TELEMETRY.STATUS_LATCHED}, "then stopped by another command"),
    ],
)
def test_what_became_of_a_robot_that_was_taken_over_is_not_laid_to_the_first(held, says, reason):
    robots, robot, words = held
    hear(robot, VERBS.VERB_START, "start at 12:00:01")
    words(TABLE, stands=False, counter=OWN + 1)
    said = words(STOPPED, counter=OWN + 1, **says)
    assert "taken over" in said and reason in said and robots.is_over


@pytest.mark.parametrize("verb", [VERBS.VERB_SELECT, SIGNED_VERBS.VERB_ARM])
@pytest.mark.parametrize("is_heard", [True, False])
def test_an_arm_lets_a_robot_forget_a_stop_and_is_no_press_of_its_button(held, verb, is_heard):
    """link_t signs neither the stop nor a button any more (firmware/core/command.c)."""
    robots, robot, words = held
    words(TABLE, stands=False)
    if is_heard:
        hear(robot, verb, "arm at 12:00:01")
    said = words(STOPPED, counter=OWN + 1)
    heard = "another operator or terminal said arm at 12:00:01"
    unheard = "it obeyed another operator or terminal whose words were not heard here"
    assert (heard if is_heard else unheard) in said and "button" not in said
    assert robots.is_over


def test_an_arm_changes_nothing_of_why_a_robot_was_told_to_stand(held):
    robots, robot, words = held
    words(TABLE, stands=False)
    words(STOPPED, flags=TELEMETRY.STATUS_LATCHED)
    hear(robot, SIGNED_VERBS.VERB_ARM, "arm at 12:00:01")
    assert words(STOPPED, counter=OWN + 1) == "" and robots.ends()["R03"] is hold.BY_COMMAND


def test_nor_of_one_that_another_operator_had_taken_over(held):
    robots, robot, words = held
    hear(robot, VERBS.VERB_START, "start at 12:00:01")
    words(TABLE, stands=False, counter=OWN + 1)
    stopped = words(STOPPED, counter=OWN + 1, flags=TELEMETRY.STATUS_LATCHED)
    hear(robot, SIGNED_VERBS.VERB_ARM, "arm at 12:00:09", counter=OWN + 2)
    assert "then stopped by another command" in stopped
    assert words(STOPPED, counter=OWN + 2) == "" and robots.is_over


@pytest.mark.parametrize("before", [{"flags": TELEMETRY.STATUS_LATCHED}, {"session": SESSION + 1}])
def test_who_waits_for_another_operators_start_is_not_over(held, before):
    """A start counts down: nobody pressed a button, and the robot does not stand for good."""
    robots, robot, words = held
    words(TABLE, stands=False)
    words(STOPPED, **before)
    session = before.get("session", SESSION)
    hear(robot, VERBS.VERB_START, "start at 12:00:01", session=session)
    said = words(STOPPED, counter=OWN + 1, session=session)
    assert (
        "was taken over by another operator or terminal (start at 12:00:01), and is not held"
        in said
    )
    assert not robots.is_over
    assert words(TABLE, stands=False, counter=OWN + 1, session=session) == ""
    assert "then its button was pressed" in words(STOPPED, counter=OWN + 1, session=session)


def test_one_in_a_fault_is_told_to_be_anothers_as_soon_as_it_is(held):
    """It stood without its camera, and was named at the end alone."""
    robots, robot, words = held
    hear(robot, VERBS.VERB_START, "start at 12:00:01")
    said = words(FAULT, counter=OWN + 1, flags=TELEMETRY.STATUS_CAMERA_LOST)
    assert "taken over by another operator or terminal (start at 12:00:01)" in said
    assert robots._fleet.held == set() and not robots.is_over


def test_one_that_was_started_anew_by_another_operator_has_no_autostart(held):
    _, robot, words = held
    hear(robot, VERBS.VERB_START, "start at 12:00:01", session=SESSION + 1)
    assert "taken over" in words(TABLE, stands=False, session=SESSION + 1, counter=OWN + 1)


@pytest.mark.parametrize("verb", [VERBS.VERB_SELECT, SIGNED_VERBS.VERB_ARM])
def test_what_takes_nothing_over_leaves_the_robot_held(held, verb):
    robots, robot, words = held
    hear(robot, verb, "select milling at 12:00:01")
    said = words(TABLE, stands=False, counter=OWN + 1)
    assert "drives: another operator or terminal said select milling at 12:00:01" in said
    assert robots._fleet.held == {3} and robots.states["R03"].is_meant


def test_a_command_that_a_robot_has_not_obeyed_takes_nothing_over(held):
    _, robot, words = held
    hear(robot, VERBS.VERB_START, "start at 12:00:01")
    assert words(TABLE, stands=False) == ""


def test_who_waits_for_another_start_does_not_stand(held):
    """It was armed, and told so by somebody who was not heard: it begins by itself."""
    robots, _, words = held
    words(TABLE, stands=False)
    waits = {"flags": TELEMETRY.STATUS_AWAITS_START, "counter": OWN + 2}
    assert "waits for another start, unheard here" in words(STOPPED, **waits)
    assert not robots.is_over


def test_of_two_robots_of_one_number_nothing_is_told_that_one_of_them_did(held):
    """The other's session made a program of it that was started anew, and stood before."""
    robots, robot, words = held
    words(TABLE, stands=False)
    double = {"flags": TELEMETRY.STATUS_DOUBLE, "session": SESSION + 1}
    assert "two robots of one number" in words(STOPPED, **double)
    robots.settle()
    assert robots.ends() == {}
    robot.telemetry.status_flags = 0  # one was switched off: the other is all that is known
    assert robots.ends() == {"R03": DOUBLE}
    assert "anew" not in words(STOPPED, session=SESSION + 1)
    assert "anew" not in words(TABLE, stands=False, session=SESSION + 1)


def test_a_command_that_was_not_heard_shows_in_what_the_robot_has_obeyed(held):
    _, _, words = held
    assert "whose words were not heard" in words(TABLE, stands=False, counter=OWN + 1)


@pytest.mark.parametrize(
    ("silent_s", "double", "stands"), [(0.1, False, True), (10.0, False, False), (0.1, True, False)]
)
def test_only_who_is_heard_and_is_one_is_said_to_stand(silent_s, double, stands):
    """Ten seconds ago tells nothing of now, of two one may drive, and anybody says telemetry."""
    fleet = Fleet("", connect=lambda _: Nowhere())
    robot = fleet.robots[3] = Robot(3, telemetry=turbopi.telemetry_t())
    robot.telemetry.mode = STOPPED
    robot.telemetry.status_flags = TELEMETRY.STATUS_DOUBLE if double else 0
    robot.heard_s = time.monotonic() - silent_s
    command = turbopi.swarm_command_t()
    command.verb = VERBS.VERB_START
    (unsigned,) = answers(fleet, command, {3})
    assert not unsigned.stands and not robot.to_json()["stands"]
    robot.link, robot.link_s = turbopi.link_t(), robot.heard_s
    robot.link.stands, robot.link.utime_us = True, round(1e6 * (time.time() - silent_s))
    (answer,) = answers(fleet, command, {3})
    assert answer.stands == robot.to_json()["stands"] == stands
    assert answer.last_heard_s == pytest.approx(silent_s, abs=0.5)
    Console(width=100, file=(said := io.StringIO())).print(answer_table([answer]))
    assert ("not heard for 10 s" in said.getvalue()) == (silent_s > 1)


@pytest.mark.parametrize(("flags", "is_told"), [(TELEMETRY.STATUS_LATCHED, True), (0, False)])
def test_from_where_a_stop_came_is_told_where_it_ended_a_hold(held, flags, is_told):
    """A log that was played had the stop in it: "stopped by another command", and nobody's name."""
    robots, _, words = held
    words(TABLE, stands=False)
    words(STOPPED, flags=flags)
    fleet, stop = robots._fleet, turbopi.swarm_command_t()
    stop.verb, stop.robot_id = VERBS.VERB_STOP, -1
    assert of_stops(fleet, robots.states) == ""
    fleet.bus.sender = ("10.0.0.9", 40000)
    fleet._on_message("SWARM_COMMAND", stop.encode())
    told = of_stops(fleet, robots.states)
    assert told.startswith("A stop came from 10.0.0.9 at ") if is_told else told == ""
