# SPDX-License-Identifier: Apache-2.0
"""A number may be several robots', as by a cloned card: what is last known is known of each."""

import time

import pytest
import turbopi

from twinmill.robots import key as keys
from twinmill.robots import tell
from twinmill.robots.fleet import GONE_S, ROBOTS_MAX, TELEMETRY, Fleet
from twinmill_cli.swarm_double import doubles
from twinmill_cli.swarm_end import beside_all
from twinmill_cli.swarm_verdict import of_stop

KEY, STOPPED, DRIVES = bytes(range(32)), TELEMETRY.MODE_STOPPED, TELEMETRY.MODE_TABLE
ROBOT, CLONE, OTHER = ("198.51.100.1", 7667), ("198.51.100.2", 7667), ("198.51.100.3", 7667)
FIRST, SECOND = 7, 8  # sessions


class Bus:
    """A network on which all is said by hand."""

    sender = None

    def subscribe(self, _, handler):
        self.hear = handler


@pytest.fixture
def air(clock):
    """Fleet, a function by which somebody speaks as a robot, and one that stops R01."""
    fleet = Fleet("", connect=lambda _: Bus(), key=KEY)
    begin_s = time.monotonic()

    def hear(sender, kind, message, number=1) -> None:
        fleet.bus.sender = sender
        message.utime_us = time.time_ns() // 1000
        if hasattr(message, "session"):
            message.session_us = round(1e6 * (time.monotonic() - begin_s)) + 1
            message.tag = bytes(keys.TAG_BYTES)
        data = message.encode()
        if hasattr(message, "session"):
            data = keys.sign(keys.of_robot(KEY, number), data)
        fleet.bus.hear(f"R{number:02d}_{kind}", data)

    def speak(sender, session=None, mode=STOPPED, flags=TELEMETRY.STATUS_TELLS_START, number=1):
        for kind, message in (("TELEMETRY", turbopi.telemetry_t()), ("LINK", turbopi.link_t())):
            message.mode, message.status_flags = mode, flags
            if kind == "LINK":
                message.session, message.stands, message.armed = session or 0, mode == STOPPED, 1
            if kind == "TELEMETRY" or session:
                hear(sender, kind, message, number)
                clock(0.01)

    def stop(sender, session):
        """Robots are told to stop, one has done so, and what is said of that."""
        command, ack = tell.make_command(tell.VERBS.VERB_STOP), turbopi.signed_ack_t()
        fleet.said[command.seq] = time.monotonic()
        ack.session, ack.seq, ack.verb = session, command.seq, command.verb
        ack.accepted = ack.stands = 1
        ack.command_utime_us = command.utime_us
        hear(sender, "SIGNED_ACK", ack)
        speak(sender, session)
        return beside_all(fleet, of_stop(tell.answers(fleet, command, {1})))

    return fleet, speak, stop


@pytest.mark.parametrize(
    ("mode", "flags", "words"),
    [
        (DRIVES, 0, "drove when it was last heard, at "),
        (STOPPED, TELEMETRY.STATUS_AWAITS_START, "waited for a start when it was last heard, at "),
    ],
)
@pytest.mark.parametrize("is_signed", [True, False])
def test_a_clone_that_drove_and_fell_silent_may_drive_on(air, clock, mode, flags, words, is_signed):
    """Two seconds later it was forgotten, and "All stand." was said while it drove."""
    fleet, speak, stop = air
    speak(ROBOT, FIRST)
    speak(CLONE, SECOND if is_signed else None, mode, flags)
    clock(60.0)
    speak(ROBOT, FIRST)
    told = stop(ROBOT, FIRST)
    assert not told.ok and not told.ends_well and not told.standing
    assert told.sentence.startswith("NOT ALL STAND: R01: two robots have this number, one may")
    assert f"R01 (one at {CLONE[0]}) {words}" in told.sentence
    assert f"number 1 ({ROBOT[0]}, {CLONE[0]})" in doubles(fleet, {1})
    assert f"(one at {CLONE[0]}) {words}" in fleet.robots[1].to_json()["may_drive"]


def test_a_stop_is_said_to_the_end_where_one_of_a_number_may_drive(air, clock):
    fleet, speak, stop = air
    speak(CLONE, SECOND, DRIVES)
    clock(GONE_S + 1)
    stop(ROBOT, FIRST)
    (seq,) = fleet.said
    known = fleet.robots[1]
    assert known.confirms(seq) and not tell._has_done(fleet, known, seq)
    speak(CLONE, SECOND)
    assert tell._has_done(fleet, known, seq)


def test_a_clone_that_stood_when_it_fell_silent_drives_no_more(air, clock):
    _, speak, stop = air
    for mode in (DRIVES, STOPPED):
        speak(CLONE, SECOND, mode)
    clock(60.0)
    told = stop(ROBOT, FIRST)
    assert told.ok and told.sentence == "All stand."


@pytest.mark.parametrize(
    ("sender", "session", "is_anew"),
    [
        ((ROBOT[0], 40000), SECOND, True),
        ((ROBOT[0], 40000), None, False),  # what signs nothing may be anybody
        (OTHER, SECOND, False),
    ],
)
def test_a_program_that_was_started_anew_is_one_robot_where_its_machine_shows_that(
    air, clock, sender, session, is_anew
):
    fleet, speak, _ = air
    speak(ROBOT, FIRST, DRIVES)
    clock(GONE_S + 1)
    speak(sender, session)
    assert fleet.robots[1].is_double != is_anew


@pytest.mark.parametrize("is_signed", [True, False])
def test_robots_that_exchanged_their_numbers_are_each_one(air, clock, is_signed):
    """Both stood, started anew, and it was said that two have one number, and one may drive on."""
    fleet, speak, stop = air
    speak(ROBOT, FIRST, DRIVES)
    speak(CLONE, SECOND, DRIVES, number=2)
    clock(GONE_S + 1)
    speak((ROBOT[0], 40000), 17 if is_signed else None, number=2)
    clock(GONE_S + 1)
    speak((CLONE[0], 40000), 18)
    assert bool(fleet.robots[1].lost) != is_signed and not fleet.robots[2].lost
    told = stop((CLONE[0], 40000), 18)
    assert told.ok == is_signed
    assert is_signed or "Two robots said that they are number 1" in told.sentence


def test_two_programs_of_one_machine_are_two_robots_where_both_go_on(air, clock):
    fleet, speak, _ = air
    speak(ROBOT, FIRST, DRIVES)
    speak((ROBOT[0], 40000), SECOND)
    speak(ROBOT, FIRST, DRIVES)
    clock(60.0)
    speak((ROBOT[0], 40000), SECOND)
    assert [s.link.session for s in fleet.robots[1].lost] == [FIRST]


def test_a_robot_that_changed_its_address_is_no_second_one(air, clock):
    fleet, speak, stop = air
    speak(ROBOT, FIRST, DRIVES)
    clock(60.0)
    assert stop(OTHER, FIRST).ok and not fleet.robots[1].lost


def test_a_relay_that_ended_is_no_second_robot(air, clock):
    """Two addresses that sign nothing are known as one by the same bytes from both."""
    fleet, speak, _ = air
    for order in ((CLONE, ROBOT), (ROBOT, CLONE)):  # the relay's copy may come first
        said = turbopi.telemetry_t()
        said.mode, said.utime_us = DRIVES, time.time_ns() // 1000
        for fleet.bus.sender in order:
            fleet.bus.hear("R01_TELEMETRY", said.encode())
        clock(0.01)
    clock(60.0)
    speak(ROBOT)
    assert not fleet.robots[1].lost


def test_who_pretends_to_be_many_is_remembered_as_so_many_as_there_can_be(air):
    fleet, speak, _ = air
    speak(CLONE, SECOND)
    for port in range(2 * ROBOTS_MAX):
        speak((OTHER[0], port))
    known = fleet.robots[1].speakers
    assert len(known) == ROBOTS_MAX + 1 and SECOND in known
