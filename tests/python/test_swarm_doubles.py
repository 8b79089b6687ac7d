# SPDX-License-Identifier: Apache-2.0
"""Two robots of one number, one may be a recording: who is heard first decides nothing."""

import time
from dataclasses import replace

import pytest
import turbopi

from twinmill.robots import key as keys
from twinmill.robots import tell
from twinmill.robots.fleet import FRESH_US, TELEMETRY, Fleet
from twinmill_cli import swarm_door
from twinmill_cli.swarm_double import doubles
from twinmill_cli.swarm_end import addressed, beside_all, driving
from twinmill_cli.swarm_verdict import of_start, of_status, of_stop

KEY, SESSION = bytes(range(32)), 7
ROBOT, PLAYER = ("198.51.100.1", 7667), ("198.51.100.2", 7667)  # RFC 5737: nobody has these
SLOWEST_S = 0.1  # LONGEST_WAIT_US of firmware/app/loop.c: a robot that stands speaks that often
RECORDED_S = 60.0  # so long ago


class Bus:
    """A robot that stands and signs so, and what a player says beside it from some time on."""

    def __init__(self, player_s: float):
        begin_s = time.monotonic()
        self.sender, self.said = None, []
        self._next = {ROBOT: begin_s, PLAYER: begin_s + player_s}

    def subscribe(self, _, handler):
        self._hear = handler

    def handle_timeout(self, timeout_ms: int) -> bool:
        self.sender, at_s = min(self._next.items(), key=lambda item: item[1])
        wait_s = at_s - time.monotonic()
        time.sleep(max(0.0, min(wait_s, timeout_ms / 1e3)))
        if wait_s > timeout_ms / 1e3:
            return False
        self._next[self.sender] = at_s + SLOWEST_S
        self.speak()
        return True

    def speak(self) -> None:
        is_robot = self.sender == ROBOT
        said = turbopi.telemetry_t()
        said.mode = TELEMETRY.MODE_STOPPED if is_robot else TELEMETRY.MODE_TABLE
        said.utime_us = round(1e6 * (time.time() - (0 if is_robot else RECORDED_S)))
        self._hear("R01_TELEMETRY", said.encode())
        if is_robot:
            self._hear("R01_LINK", link(time.monotonic()))

    def publish(self, *said):
        self.said.append(said)


def link(session_s: float, mode: int = TELEMETRY.MODE_STOPPED) -> bytes:
    said = turbopi.link_t()
    said.session, said.session_us, said.mode, said.stands = SESSION, round(1e6 * session_s), mode, 1
    said.utime_us = time.time_ns() // 1000 - round(1e6 * (time.monotonic() - session_s))
    said.tag = bytes(keys.TAG_BYTES)
    return keys.sign(keys.of_robot(KEY, 1), said.encode())


def hold(made_s: float) -> bytes:
    command, sealed = turbopi.swarm_command_t(), turbopi.signed_command_t()
    command.verb = sealed.VERB_HOLD
    sealed.robot_id, sealed.session, sealed.made_us = 1, SESSION, round(1e6 * made_s)
    sealed.command = command.encode()
    sealed.command_size = len(sealed.command)
    sealed.tag = bytes(keys.TAG_BYTES)
    return keys.sign(keys.of_robot(KEY, 1), sealed.encode())


def fleet_beside(player_s: float) -> Fleet:
    fleet = Fleet("", connect=lambda _: Bus(player_s), key=KEY)
    tell.find(fleet, {1})
    return fleet


def test_nobody_is_told_anything_before_two_robots_of_a_number_would_be_heard():
    """One message of the robot had been enough to arm it."""
    fleet = fleet_beside(SLOWEST_S)
    assert not fleet.robots[1].is_double
    with pytest.raises(ValueError, match="Two robots say that they are number 1"):
        swarm_door.refuse_doubles(fleet, {1})
    assert not fleet.bus.said


@pytest.mark.parametrize("partial", [False, True])
def test_a_double_that_shows_up_in_the_count_calls_the_start_off(monkeypatch, partial):
    monkeypatch.setattr(tell, "stop", lambda *_, **__: [])
    fleet = fleet_beside(1.0)
    swarm_door.refuse_doubles(fleet, {1})
    begin_s = time.monotonic()
    begun = tell.start(fleet, {1}, "", ahead_s=2.0, partial=partial)
    assert begun.called_off and "two robots" in begun.dropouts.words[1]
    assert time.monotonic() - begin_s < 2.0 - tell.CALL_OFF_S


def test_what_a_robot_signs_now_rules_over_what_is_said_unsigned():
    """It stood, and its recording made "R01 drives already" of it."""
    fleet = fleet_beside(SLOWEST_S)
    fleet.listen(1.0, lambda: fleet.robots[1].says_that_it_drives)
    known = fleet.robots[1]
    assert known.says_that_it_drives and not known.drives_by_any_word
    known.link = None  # of another key: nobody knows more
    assert known.drives_by_any_word


def test_a_hold_that_was_fresh_by_a_recording_alone_is_none():
    fleet, now_s = Fleet("", connect=lambda _: Bus(0.0), key=KEY), time.monotonic()
    fleet.bus._hear("R01_LINK", link(now_s - RECORDED_S))
    known = fleet.robots[1]
    fleet.bus._hear("SWARM_SIGNED", hold(now_s - RECORDED_S))
    assert known.hold_s > 0
    fleet.bus._hear("R01_LINK", link(now_s))
    assert FRESH_US < 1e6 * RECORDED_S and not known.hears_operator
    assert not known.hears_other_operator
    fleet.bus._hear("SWARM_SIGNED", hold(now_s))
    fleet.bus._hear("R01_LINK", link(now_s + 0.1))
    assert known.hears_operator and known.hears_other_operator


@pytest.mark.parametrize("behind_s", [0.0, 3600.0])
def test_the_older_of_two_sources_may_be_a_recording_whatever_the_clock_here_is(
    monkeypatch, behind_s
):
    now = time.time
    monkeypatch.setattr("twinmill.robots.fleet.time.time", lambda: now() - behind_s)
    fleet = fleet_beside(SLOWEST_S)
    fleet.listen(1.0)
    said = doubles(fleet, {1})
    assert f"what {PLAYER[0]} says is 60 s older, and may be a recording" in said
    assert "flash" not in said and ROBOT[0] not in said.split(":")[1]


def test_no_outcome_with_two_robots_of_a_number_in_it_is_a_good_one():
    """A start had said "Started at", with ok true, beside a robot that was double."""
    fleet = fleet_beside(SLOWEST_S)
    alone = of_status([fleet.robots[1]])
    fleet.listen(1.0, lambda: fleet.robots[1].is_double)
    answer = tell.Answer(1, True, True, "", "running", False, False, [], link_timeout_s=2.0)
    for is_double in (False, True):
        begun = of_start(tell.Start(0, [replace(answer, is_double=is_double)], {1: SESSION}))
        assert begun.ok != is_double
    assert "R01: two robots have this number" in begun.sentence
    assert alone.ok and not of_status([fleet.robots[1]]).ok


def test_a_good_outcome_beside_two_robots_of_a_number_is_none_whoever_was_asked():
    """A stop of another robot named them, with ok true and exit code 0."""
    fleet = fleet_beside(SLOWEST_S)
    stands = tell.Answer(3, True, True, "", "stopped", True, False, [])
    stopped = of_stop([stands], is_of_some=True)
    assert beside_all(fleet, stopped) == stopped and stopped.ok
    fleet.listen(1.0, lambda: fleet.robots[1].is_double)
    told = beside_all(fleet, stopped)
    assert told.code == 1 and not told.ends_well
    assert told.sentence.startswith("R03 stands. Two robots say that they are number 1")


def step(fleet, sender, mode=TELEMETRY.MODE_STOPPED, ago_s=0.0) -> None:
    said = turbopi.telemetry_t()
    said.mode, said.utime_us = mode, round(1e6 * (time.time() - ago_s))
    fleet.bus.sender = sender
    fleet.bus._hear("R01_TELEMETRY", said.encode())


@pytest.mark.parametrize(("ago_s", "drives"), [(0.0, ["R01"]), (RECORDED_S, [])])
@pytest.mark.parametrize("last", [ROBOT, PLAYER])
def test_of_two_robots_of_a_number_it_is_said_that_one_drives_whichever_spoke_last(
    last, ago_s, drives
):
    """The other one stands, and what it says is as new; a recording says nothing of now."""
    fleet = Fleet("", connect=lambda _: Bus(60.0), key=KEY)
    for sender in (last, *(ROBOT, PLAYER) * 2, last):
        if sender == PLAYER:
            step(fleet, sender, TELEMETRY.MODE_TABLE, ago_s)
        else:
            step(fleet, sender)
    assert fleet.robots[1].is_double and driving(fleet, {3}) == drives


def test_a_recording_that_begins_anew_is_a_robots_double_as_soon_as_its_end_is_over():
    """Each round is older than the end of the one before, and comes from a socket of its own."""
    fleet, round_s = Fleet("", connect=lambda _: Bus(60.0), key=KEY), 5.0
    step(fleet, (PLAYER[0], 40000), ago_s=RECORDED_S)
    begin_s = time.monotonic()
    while not fleet.robots[1].is_double:
        step(fleet, ROBOT)
        step(fleet, (PLAYER[0], 40001), ago_s=RECORDED_S + round_s)
        time.sleep(SLOWEST_S)
    assert time.monotonic() - begin_s < tell.FIND_S  # all are listened to for so long


@pytest.mark.parametrize("machine", [ROBOT[0], PLAYER[0]])
def test_what_waited_in_a_queue_is_no_second_robot(machine):
    """A program's words of before it was started anew, beside those of the one after it."""
    fleet = Fleet("", connect=lambda _: Bus(60.0), key=KEY)
    for _ in range(3):
        step(fleet, (machine, 40000), ago_s=25.0)
        step(fleet, ROBOT)
    assert fleet.robots[1].is_double == (machine != ROBOT[0])
    for _ in range(3):
        step(fleet, (ROBOT[0], 40001))
        step(fleet, ROBOT)
    assert fleet.robots[1].is_double  # both are new: two programs of one machine


@pytest.fixture
def beside_a_twin():
    """Fleet that hears the robot, and gives functions by which both say what they are."""
    fleet = Fleet("", connect=lambda _: Bus(0.0), key=KEY)

    def speak(sender, *numbers, source=""):
        fleet.bus.sender = sender
        for number in numbers:
            said = turbopi.telemetry_t()
            said.utime_us = time.time_ns() // 1000
            fleet.bus._hear(f"R{number:02d}_TELEMETRY", said.encode())
            if source:
                run = turbopi.run_t()
                run.source = source
                fleet.bus._hear(f"R{number:02d}_RUN", run.encode())

    return fleet, speak


@pytest.mark.parametrize("order", [("robot", "twin"), ("twin", "robot")])
def test_a_number_that_a_robot_and_a_twin_have_is_both_whoever_spoke_last(beside_a_twin, order):
    """It was said that R01 is a twin, no robot, while the robot stood on the floor."""
    fleet, speak = beside_a_twin
    senders = {"robot": ROBOT, "twin": PLAYER}
    for source in order * 2:
        speak(senders[source], 1, source=source)
    known = fleet.robots[1]
    assert known.is_double and not known.is_twin and known.source == "robot, twin"
    assert known.to_json()["source"] == "robot, twin" and addressed(fleet, {1}) == {}
    said = doubles(fleet, {1})
    assert said.startswith("A robot and a twin say that they are number 1 (")
    assert f"{PLAYER[0]} says that it is a twin: end it, or give it" in said
    assert "lcm_url of its own" in said and "flash" not in said


def test_a_twin_is_no_robot_only_where_all_that_speak_as_it_said_so(beside_a_twin):
    fleet, speak = beside_a_twin
    speak(PLAYER, 0, source="twin")
    assert fleet.robots[0].is_twin and addressed(fleet, {0}) == {"addressed": {"twins": [0]}}
    speak(ROBOT, 0)  # a robot says what it is every 5 s, and has not done so yet
    assert not fleet.robots[0].is_twin and addressed(fleet, {0}) == {}


def test_a_twin_that_has_not_said_so_yet_is_known_by_speaking_as_several(beside_a_twin):
    """A stop listens for a second, and each says only every 5 s what it is."""
    fleet, speak = beside_a_twin
    for _ in range(2):
        speak(PLAYER, 0, 1, 2)
        speak(ROBOT, 1)
    said = doubles(fleet, {1})
    assert f"one program on {PLAYER[0]} speaks as several robots" in said
    assert "lcm_url of its own" in said and "flash" not in said


def test_of_two_programs_of_which_nothing_is_known_both_remedies_are_told(beside_a_twin):
    fleet, speak = beside_a_twin
    for sender in (ROBOT, PLAYER) * 2:
        speak(sender, 1)
    said = doubles(fleet, {1})
    assert "flash HOST=ID`; if one is a twin, end it, or give it" in said
    for sender in (ROBOT, PLAYER):
        speak(sender, 1, source="robot")
    assert doubles(fleet, {1}).endswith("flash HOST=ID`.")


def telemetry(flags=0) -> bytes:
    said = turbopi.telemetry_t()
    said.utime_us, said.status_flags = time.time_ns() // 1000, flags
    return said.encode()


@pytest.mark.parametrize("lost", ["none", "the robot's", "the relay's"])
def test_one_robot_on_two_ways_is_no_second_one(lost):
    """A relay repeated all that it said, and "a twin or a recording" was told as the cause."""
    fleet = Fleet("", connect=lambda _: Bus(0.0), key=KEY)

    def hear(sender, data):
        fleet.bus.sender = sender
        fleet.bus._hear("R01_TELEMETRY", data)

    for k in range(9):
        data = telemetry(TELEMETRY.STATUS_DOUBLE)  # it hears itself, as repeated
        for sender, name in ((ROBOT, "the robot's"), (PLAYER, "the relay's")):
            if name != lost or k % 2 == 0:
                hear(sender, data)
    known, ways = fleet.robots[1], f"({ROBOT[0]}, {PLAYER[0]})"
    assert not known.is_double and doubles(fleet, {1}) == ""
    assert known.alarms == [f"heard on two ways, as over a relay {ways}"]
    for _ in range(2):
        hear(("198.51.100.3", 7667), telemetry())
        hear(ROBOT, telemetry())
    assert known.is_double and "Two robots say that they are number 1" in doubles(fleet, {1})


def test_a_cause_that_leaves_others_open_is_told_with_these(beside_a_twin):
    """Here the operator worked on the robot itself, which was to be ended."""
    fleet, speak = beside_a_twin
    for _ in range(2):
        speak(("127.0.0.1", 7667), 1)
        speak(PLAYER, 1)
    said = doubles(fleet, {1})
    assert "127.0.0.1 is this computer: if a twin or a recording speaks here, end it" in said
    assert said.endswith("if the robot itself does, it is the other one.")


class Repeated(Bus):
    """A robot and a relay, which begins with what was said before anybody listened here."""

    LATE = 3  # of so many words

    def __init__(self):
        super().__init__(SLOWEST_S / 2)
        self._words = [telemetry() for _ in range(self.LATE)]

    def speak(self):
        if self.sender == ROBOT:
            self._words.append(telemetry())
            self._hear("R01_LINK", link(time.monotonic()))
        self._hear("R01_TELEMETRY", self._words[-1 if self.sender == ROBOT else -self.LATE])


def test_a_relay_that_is_late_is_no_second_robot_to_who_has_just_begun_to_listen():
    """All that it said at first was new here, and a start was refused."""
    fleet = Fleet("", connect=lambda _: Repeated(), key=KEY)
    tell.find(fleet, {1})
    fleet.listen(2 * SLOWEST_S, lambda: fleet.robots[1].is_double)
    assert fleet.robots[1].is_double
    swarm_door.refuse_doubles(fleet, {1})
    assert not fleet.robots[1].is_double
