# SPDX-License-Identifier: Apache-2.0
"""Robots that fell silent: nothing is said of them as of now, and what they may do by now is."""

import time

import pytest
import turbopi

from twinmill.robots import tell
from twinmill.robots.fleet import GONE_S, TELEMETRY, Fleet, Heard, Robot
from twinmill.terminal import PlainConsole
from twinmill_cli.swarm_end import beside_all
from twinmill_cli.swarm_screen import status_table
from twinmill_cli.swarm_verdict import BY_HAND, Verdict, of_busy

SESSION, COUNTER = 7, 5
WAITS, TABLE = TELEMETRY.STATUS_AWAITS_START, TELEMETRY.MODE_TABLE
STOOD = Verdict(True, "All stand.", ends_well=True)


class Bus:
    """A network of which nothing comes."""

    def subscribe(self, *_):
        pass

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False


def robot(*, mode=TELEMETRY.MODE_STOPPED, flags=0, timeout_ms=0, counter=COUNTER) -> Robot:
    """R03, which has just said and signed all that it is."""
    link, telemetry = turbopi.link_t(), turbopi.telemetry_t()
    link.session, link.counter, link.armed, link.link_timeout_ms = SESSION, counter, 1, timeout_ms
    link.mode = telemetry.mode = mode
    link.stands = not mode
    link.status_flags = telemetry.status_flags = flags
    telemetry.utime_us = link.utime_us = time.time_ns() // 1000
    now_s = time.monotonic()
    return Robot(3, telemetry=telemetry, heard_s=now_s, link=link, link_s=now_s)


def fleet_of(known: Robot) -> Fleet:
    fleet = Fleet("", connect=lambda _: Bus())
    fleet.robots = {3: known}
    return fleet


def start(ahead_s: float, counter: int = COUNTER) -> Heard:
    instant_us = round(1e6 * (time.time() + ahead_s))
    return Heard(
        9, turbopi.swarm_command_t.VERB_START, SESSION, counter, "start", start_utime_us=instant_us
    )


def time_of_day(ahead_s: float = 0.0) -> str:
    return time.strftime("%H:%M:%S", time.localtime(time.time() + ahead_s))


@pytest.mark.parametrize(
    ("says", "property_"),
    [
        ({"mode": TABLE}, "drives"),
        ({"mode": TABLE}, "mode"),
        ({"mode": TABLE, "timeout_ms": 500}, "is_tethered"),
        ({"flags": WAITS}, "awaits_start"),
        ({}, "is_armed"),
    ],
)
def test_what_a_robot_does_is_not_known_once_it_is_silent(clock, says, property_):
    known = robot(**says)
    assert getattr(known, property_)
    clock(GONE_S + 0.1)
    assert not getattr(known, property_)


@pytest.mark.parametrize("is_instant_known", [True, False])
def test_who_fell_silent_in_a_count_is_not_said_to_stand(clock, is_instant_known):
    """It drove for seconds, and "All stand. R03 stands still, waits for a start" was told."""
    known = robot(flags=WAITS)
    if is_instant_known:
        known.commands[COUNTER] = start(5.0)
    fleet, heard, instant = fleet_of(known), time_of_day(), time_of_day(5.0)
    told = beside_all(fleet, STOOD).sentence
    assert "R03 stands still, waits for a start and begins by itself, untethered." in told
    clock(2.0)
    told = beside_all(fleet, STOOD).sentence
    assert "stands still" not in told and told.endswith(BY_HAND)
    soon = f"R03 waited for a start at {instant} when it was last heard, at {heard}, and may begin"
    assert (soon in told) == is_instant_known
    clock(4.0)
    told = beside_all(fleet, STOOD).sentence
    assert told.startswith("All that were told to stop stand. R03 ") and told.endswith(BY_HAND)
    since = f"R03 may drive since {instant}: it waited for that start when it was last heard, at"
    unknown = f"R03 waited for a start when it was last heard, at {heard}, and may drive by now."
    assert (since if is_instant_known else unknown) in told


def test_who_drove_when_it_was_last_heard_may_drive_on_though_it_was_not_asked(clock):
    """Another operator's robot lost its network, and "All stand." was said of one that was told."""
    fleet, heard = fleet_of(robot(mode=TABLE)), time_of_day()
    assert beside_all(fleet, STOOD) == STOOD  # who drives and was not asked is told by others
    clock(8.6)
    told = beside_all(fleet, STOOD)
    assert told.sentence == (
        f"All that were told to stop stand. R03 drove when it was last heard, at {heard}, and may "
        f"drive on. {BY_HAND}"
    )
    both = of_busy([fleet.robots[3], fleet.robots[3]])
    assert both == f"R03, R03 drove when they were last heard, at {heard}, and may drive on"
    assert "SWITCH OFF" not in beside_all(fleet, Verdict(True, "Started at 12:00:00.")).sentence
    said = fleet.robots[3].to_json()
    assert (said["mode"], said["stands"]) == (None, False) and "may drive on" in said["may_drive"]


def test_who_stood_when_it_was_last_heard_or_confirmed_that_may_not_drive(clock):
    still, fleet = robot(), fleet_of(robot(mode=TABLE))
    clock(60.0)
    assert not still.may_drive
    stands = Verdict(True, "All stand.", standing=frozenset({"R03"}))
    assert beside_all(fleet, stands) == stands


def test_the_table_says_what_a_silent_robot_did(clock, capsys):
    """It said "running" beside "silent 8.6 s"."""
    known = robot(mode=TABLE)
    clock(8.6)
    PlainConsole(width=200).print(status_table([known]))
    row = capsys.readouterr().out.splitlines()[1]
    assert "was running" in row and "may drive on" in row and "armed" not in row


def test_a_robot_is_not_said_to_be_untethered_by_a_link_from_before_its_start(clock):
    """Telemetry told of the start, the link of a tenth of a second before of none."""
    known = robot(timeout_ms=0)
    known.telemetry.status_flags = WAITS
    says = "R03 stands still, waits for a start and begins by itself"
    assert of_busy([known]) == f"{says}, and has not signed yet for whom"
    known.link = robot(flags=WAITS, timeout_ms=2000).link
    assert of_busy([known]) == f"{says}, and no operator is heard who holds it"


def test_a_robot_that_was_given_up_is_not_said_to_be_held_from_here(clock):
    """Another operator had taken it over, and had not been heard yet to hold it."""
    known = robot(flags=WAITS, timeout_ms=2000)
    fleet, says = fleet_of(known), "R03 stands still, waits for a start and begins by itself"
    fleet.held, known.hold_s = {3}, time.monotonic()
    assert f"{says}, held from here." in beside_all(fleet, STOOD).sentence
    fleet.held = set()
    told = beside_all(fleet, STOOD).sentence
    assert f"{says}, and nobody else is heard yet who holds it." in told
    taken = known.commands[COUNTER + 1] = start(5.0, COUNTER + 1)
    known.signed_acks[taken.seq] = ack = turbopi.signed_ack_t()
    ack.session, ack.accepted = SESSION, 1
    assert f"{says}, and has not signed yet for whom." in beside_all(fleet, STOOD).sentence
    known.other_hold_s = time.monotonic()
    assert f"{says}, held by another operator or terminal." in beside_all(fleet, STOOD).sentence


def test_for_whom_a_robot_waits_is_listened_for(monkeypatch):
    known, listened = robot(timeout_ms=2000), []
    known.telemetry.status_flags = WAITS

    def listen(_, duration_s, enough):
        listened.append(enough())
        known.link, known.hold_s = robot(flags=WAITS, timeout_ms=2000).link, time.monotonic()
        assert enough()

    monkeypatch.setattr(Fleet, "listen", listen)
    assert tell.find_busy(fleet_of(known), {3}) == [known] and listened == [False, True]


def test_what_a_robots_version_cannot_say_is_not_known(clock):
    """One with older firmware had "stands": true told of it in the count to its start."""
    waits, told = robot(), "R03 stands still, and may wait for a start and begin by itself: its"
    said = waits.to_json()
    assert (said["awaits_start"], said["stands"]) == (None, None)
    assert f"{told} version cannot say." in beside_all(fleet_of(waits), STOOD).sentence
    for changed in (
        robot(flags=TELEMETRY.STATUS_TELLS_START),  # it would say so
        robot(counter=0),  # it was told nothing since it began
        disarmed(),  # it was told to stop last
    ):
        said = changed.to_json()
        assert (said["awaits_start"], said["stands"]) == (False, True)
        assert beside_all(fleet_of(changed), STOOD) == STOOD
    drives = robot(mode=TABLE)
    assert drives.to_json()["awaits_start"] is False and not drives.hides_start


def disarmed() -> Robot:
    known = robot()
    known.link.armed = 0
    return known


@pytest.mark.parametrize("tells", [True, False])
def test_one_that_is_armed_since_its_stop_and_cannot_say_that_it_waits_has_not_confirmed(tells):
    known, stop = robot(flags=TELEMETRY.STATUS_TELLS_START * tells), turbopi.signed_ack_t()
    stop.session, stop.accepted, stop.stands, stop.session_us = SESSION, 1, 1, -1
    known.signed_acks[9] = stop
    assert known.confirms(9) == tells
