# SPDX-License-Identifier: Apache-2.0
"""A clock that is behind, a late network and a tool that was halted look alike one way.

The truth is how the network and the robot here were made.
"""

import json
import time
from collections import deque
from dataclasses import replace

import pytest
import turbopi

from twinmill.robots import hold, tell
from twinmill.robots import key as keys
from twinmill.robots.fleet import SIGNED_S, Fleet
from twinmill.robots.hold import Held
from twinmill_cli import swarm, swarm_door
from twinmill_cli.swarm_door import check_clocks
from twinmill_cli.swarm_end import clocks, times
from twinmill_cli.swarm_verdict import Verdict, of_end, of_start, of_status, of_stop

KEY, SESSION, STEP_S = bytes(range(32)), 7, 0.03
STOPPED, DRIVES = turbopi.telemetry_t.MODE_STOPPED, turbopi.telemetry_t.MODE_TABLE
NEAR_S = 0.06  # a robot answers in its next step, and this machine may be busy


class Air:
    """A robot behind a network: what is said on either side is heard a while later."""

    def __init__(
        self, delay_s: float, ahead_s: float, *, answers: bool = True, mode: int = STOPPED
    ):
        self.mode = mode
        self.delay_s, self.ahead_s, self.answers = delay_s, ahead_s, answers
        self.begin_s = self.next_s = time.monotonic()
        self.on_its_way: deque = deque()

    def subscribe(self, _, handler):
        self.hear = handler

    def _stamps(self, message, at_s: float):
        message.robot_id = 1
        message.utime_us = round(1e6 * (time.time() - time.monotonic() + at_s + self.ahead_s))
        if hasattr(message, "session"):
            message.session, message.session_us = SESSION, round(1e6 * (at_s - self.begin_s + 5))
            message.tag = bytes(keys.TAG_BYTES)
        return message

    def _say(self, channel: str, message, at_s: float) -> None:
        data = self._stamps(message, at_s).encode()
        signed = keys.sign(keys.of_robot(KEY, 1), data) if hasattr(message, "session") else data
        self.on_its_way.append((at_s + self.delay_s, channel, signed))

    def publish(self, _, data):
        command = turbopi.swarm_command_t.decode(data)
        ack = turbopi.signed_ack_t()
        ack.seq, ack.verb, ack.command_utime_us = command.seq, command.verb, command.utime_us
        if self.answers:
            self._say("R01_SIGNED_ACK", ack, time.monotonic() + self.delay_s)

    def handle_timeout(self, timeout_ms):
        end_s = time.monotonic() + timeout_ms / 1e3
        while True:
            while self.next_s <= time.monotonic():
                telemetry, link = turbopi.telemetry_t(), turbopi.link_t()
                telemetry.mode = link.mode = self.mode
                link.stands, link.armed, link.link_timeout_ms = self.mode == STOPPED, True, 2000
                self._say("R01_TELEMETRY", telemetry, self.next_s)
                self._say("R01_LINK", link, self.next_s)
                self.next_s += STEP_S
            due = [said for said in self.on_its_way if said[0] <= time.monotonic()]
            if due:
                self.on_its_way.remove(due[0])
                self.hear(*due[0][1:])
                return True
            if time.monotonic() >= end_s:
                return False
            time.sleep(0.001)


def fleet_behind(**air) -> Fleet:
    fleet = Fleet("", connect=lambda _: Air(**air), key=KEY)
    fleet.listen(air["delay_s"] + 0.2)
    return fleet


def test_a_late_network_is_no_clock_that_is_behind():
    """A robot was said to be 0.90 s behind: set this computer's clock, it said."""
    fleet = fleet_behind(delay_s=0.3, ahead_s=0.0)
    assert "the network is late, or a clock is behind" in clocks(fleet, {1})
    tell.ask_clocks(fleet, {1})
    robot = fleet.robots[1]
    assert robot.clock_s == 0 and robot.late_s == pytest.approx(0.3, abs=NEAR_S)
    assert clocks(fleet, {1}).startswith("The network is late")
    with pytest.raises(ValueError, match=r"nothing was started: The network is late.*--in-s 2"):
        check_clocks(fleet, {1}, 0.5, may_differ=False)


def test_a_network_too_late_to_see_a_start_begin_is_refused_before_a_wheel_turns():
    """Robots drove for 1.4 s before their start was called off."""
    fleet = fleet_behind(delay_s=0.7, ahead_s=0.0)
    with pytest.raises(ValueError, match=r"nothing was started: .*0\.5 s after the instant"):
        check_clocks(fleet, {1}, 10.0, may_differ=False)
    check_clocks(fleet, {1}, 10.0, may_differ=True)


@pytest.mark.parametrize("ahead_s", [-2.0, 2.0])
@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_clock_is_told_by_as_much_as_no_delay_explains(delay_s, ahead_s):
    fleet = fleet_behind(delay_s=delay_s, ahead_s=ahead_s)
    tell.ask_clocks(fleet, {1})
    told_s = abs(fleet.robots[1].clock_s)
    assert abs(ahead_s) - delay_s - NEAR_S <= told_s <= abs(ahead_s) + 0.01
    assert "R01's clock is" in clocks(fleet, {1})
    assert ("behind" if ahead_s < 0 else "ahead of") in clocks(fleet, {1})


def test_where_nothing_is_answered_both_are_said_to_be_possible(monkeypatch):
    monkeypatch.setattr(tell, "ASK_S", 0.2)
    fleet = fleet_behind(delay_s=0.0, ahead_s=-1.5, answers=False)
    tell.ask_clocks(fleet, {1})
    assert clocks(fleet, {1}) == (
        f"What is said comes late, {fleet.robots[1].late_s:.2f} s from R01: the network is late, "
        "or a clock is behind (NTP)."
    )


@pytest.mark.parametrize("mode", [STOPPED, turbopi.telemetry_t.MODE_TABLE])
@pytest.mark.parametrize("ahead_s", [-15.0, 15.0])
def test_a_recording_tells_nothing_of_now(monkeypatch, ahead_s, mode):
    """Its robots drove out of range, or were off, and were said to stand, or to be held.

    Who plays it cannot answer what nobody had asked then; by its clock it may lie in the future.
    """
    monkeypatch.setattr(tell, "ASK_S", 0.2)
    fleet = fleet_behind(delay_s=0.0, ahead_s=ahead_s, answers=False, mode=mode)
    tell.ask_clocks(fleet, {1})
    told, verdict = fleet.robots[1].to_json(), of_status([fleet.robots[1]])
    assert not told["stands"] and told["held"] is None
    assert not verdict.ok and verdict.sentence.startswith("Heard: R01. NOBODY KNOWS WHAT R01 DOES")
    old = "by what it signed 15 s ago" if ahead_s < 0 else "nobody knows when it said that"
    assert old in verdict.sentence and old in told["alarms"][0]


@pytest.mark.parametrize("ahead_s", [-3600.0, 0.0, 3600.0])
@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_wrong_clock_makes_no_recording_of_a_robot_that_answers(delay_s, ahead_s):
    """A computer without a battery for its clock begins where it was switched off."""
    fleet = fleet_behind(delay_s=delay_s, ahead_s=ahead_s)
    tell.ask_clocks(fleet, {1})
    fleet.listen(2 * delay_s)
    told, verdict = fleet.robots[1].to_json(), of_status([fleet.robots[1]])
    assert told["stands"] and told["alarms"] == [] and verdict.ok
    assert 0 <= told["signed_ago_s"] < 2 * delay_s + STEP_S + NEAR_S


def test_what_a_robot_of_another_key_said_long_ago_is_told_as_that():
    """Nobody can check that, and a recording of it is as old."""
    fleet = Fleet("", connect=lambda _: Air(0.0, -15.0))
    fleet.listen(0.2)
    verdict = of_status([fleet.robots[1]])
    assert not verdict.ok and "by what it said 15 s ago, or its clock is behind" in verdict.sentence


def test_a_tool_that_was_halted_tells_neither():
    """Messages that had waited here for 7 s were said to be 2.28 s late by the clock."""
    fleet = fleet_behind(delay_s=0.0, ahead_s=0.0)
    time.sleep(1.0)
    for _ in range(4):  # of some sixty that wait
        assert fleet._take_in(0)
        assert fleet.robots[1].age_s < NEAR_S and clocks(fleet, {1}) == ""


class Recording(Air):
    """Played here of a robot that was held and drove 27 s ago; nobody hears what is said."""

    def __init__(self):
        super().__init__(0.0, -27.0, answers=False, mode=DRIVES)

    def publish(self, *_):
        pass

    def _say(self, channel: str, message, at_s: float) -> None:
        super()._say(channel, message, at_s)
        sealed, command = turbopi.signed_command_t(), turbopi.swarm_command_t()
        sealed.robot_id, sealed.session, command.verb = 1, SESSION, sealed.VERB_HOLD
        sealed.made_us = round(1e6 * (at_s - self.begin_s + 5))
        sealed.command, sealed.tag = command.encode(), bytes(keys.TAG_BYTES)
        sealed.command_size = len(sealed.command)
        data = keys.sign(keys.of_robot(KEY, 1), sealed.encode())
        self.on_its_way.append((at_s + self.delay_s, "SWARM_SIGNED", data))


@pytest.mark.parametrize(
    ("words", "begins"),
    [
        (["start", "--partial"], "NOBODY WAS HEARD TO START"),
        (["start", "--partial", "--untethered"], "NOBODY WAS HEARD TO START"),
        (["arm"], "Not all are known to be armed: R01 was not heard to obey (no answer"),
        (["select", "milling"], "Not all are known to have done so: R01 was not heard to obey"),
    ],
)
def test_no_command_believes_a_recording(monkeypatch, key_file, twinmill, words, begins):
    """A robot that was off was said to drive, held by another, and in the end to stand."""
    monkeypatch.setattr(tell, "ASK_S", 0.2)
    monkeypatch.setattr(
        swarm_door, "Fleet", lambda *_, **__: Fleet("", connect=lambda _: Recording(), key=KEY)
    )
    monkeypatch.setattr(swarm.tell, "STOP_S", 0.5)
    monkeypatch.setattr(swarm.tell.stop, "__defaults__", (0.5,))
    code, out, err = twinmill("swarm", *words, "--json", "--key", key_file)
    told = json.loads(out)
    assert code == 1 and not told["ok"] and told["sentence"].startswith(begins)
    assert err.count("NOBODY KNOWS WHAT R01 DOES NOW") == 1 and "drives already" not in err
    for untrue in ("Started at", "All stand", "They drive on", "stopped by another", "comes late"):
        assert untrue not in told["sentence"] + err
    if words[0] == "start":
        assert told["drove_before"] == [] and told["start_utime_us"] is None
        assert "0 robots were heard, and by old news alone R01." in told["sentence"]
    (robot,) = told["robots"]
    assert robot["is_old_news"] and robot["mode"] == "" and robot["clock_ahead_s"] is None


def test_a_hold_of_half_an_hour_makes_no_old_news_of_who_is_there():
    """Two clocks that nobody sets part meanwhile, so answers bound their difference no longer."""
    fleet = fleet_behind(delay_s=0.0, ahead_s=-10.0)
    tell.ask_clocks(fleet, {1})
    robot = fleet.robots[1]
    long_ago_s = time.monotonic() - 3600
    robot.answered = replace(robot.answered, heard_s=long_ago_s)
    assert robot.is_old_news and robot.mode == ""
    tell.ask_once(fleet, {1})
    fleet.listen(0.2)
    assert not robot.is_old_news and robot.mode == "stopped"


def test_who_held_a_robot_is_told_that_old_news_alone_is_heard_of_it(monkeypatch):
    """A recording of a stop that is played: its robot drives on, out of hearing."""
    monkeypatch.setattr(hold, "SETTLE_S", 0.0)
    fleet = fleet_behind(delay_s=0.0, ahead_s=0.0, mode=DRIVES)
    tell.ask_clocks(fleet, {1})
    given = tell.answers(fleet, tell.make_command(tell.VERBS.VERB_START), {1})
    held = Held(fleet, tell.Start(0, given, {1: SESSION}))
    fleet.listen(0.1)
    assert held.news() == []
    old = Air(0.0, -27.0, answers=False)
    old.begin_s += 27.0  # of the same session, by words of before
    old.hear, fleet.bus = fleet.bus.hear, old
    fleet.listen(SIGNED_S + 0.2)
    said = [*held.news(), *held.news()]
    assert said == [f"R01 {hold.OLD_NEWS.words}."] and not held.is_over
    ended = of_end(Verdict(True, ""), held.ends(), of_stop(tell.stop(fleet, {1}, 0.4)))
    assert not ended.ok and ended.sentence.startswith("NOT ALL STAND: R01")
    assert "no answer, and what is heard of it is old news" in ended.sentence
    assert clocks(fleet, {1}) == "" and times(fleet, {1}).startswith("NOBODY KNOWS WHAT R01 DOES")


class Obedient(Air):
    """A robot that does what it is told once that has come to it, and says so.

    Args:
        delay_s: each way.
        signs_after_s: signed packets are lost for so long, as behind others in a full queue.
    """

    def __init__(self, delay_s: float, *, mode: int = DRIVES, signs_after_s: float = 0.0):
        super().__init__(delay_s, 0.0, mode=mode)
        self.signs_from_s = time.monotonic() + signs_after_s
        self.stood_s = self.instant_s = float("inf")
        self.on_its_way_there: deque = deque()

    def _say(self, channel: str, message, at_s: float) -> None:
        if not hasattr(message, "session") or time.monotonic() >= self.signs_from_s:
            super()._say(channel, message, at_s)

    def publish(self, channel, data):
        is_plain = channel == "SWARM_COMMAND"
        packet = data if is_plain else turbopi.signed_command_t.decode(data).command
        command = turbopi.swarm_command_t.decode(packet)
        if command.verb != turbopi.signed_command_t.VERB_HOLD:
            self.on_its_way_there.append((time.monotonic() + self.delay_s, command))

    def handle_timeout(self, timeout_ms):
        now_s = time.monotonic()
        while self.on_its_way_there and self.on_its_way_there[0][0] <= now_s:
            self._obey(self.on_its_way_there.popleft()[1], now_s)
        if now_s >= self.instant_s:
            self.mode = DRIVES
        return super().handle_timeout(min(timeout_ms, 10))

    def _obey(self, command, now_s: float) -> None:
        is_stop = command.verb == turbopi.swarm_command_t.VERB_STOP
        if is_stop:
            self.mode, self.instant_s = STOPPED, float("inf")
        elif command.verb == turbopi.swarm_command_t.VERB_START:
            self.instant_s = command.start_utime_us / 1e6 - time.time() + time.monotonic()
        plain, signed = turbopi.ack_t(), turbopi.signed_ack_t()
        plain.seq = signed.seq = command.seq
        plain.accepted, signed.accepted, signed.stands = True, True, is_stop
        signed.verb, signed.command_utime_us = command.verb, command.utime_us
        self._say("R01_ACK", plain, now_s)
        self._say("R01_SIGNED_ACK", signed, now_s)


def fleet_with(robot: Obedient, key: bytes | None = KEY) -> Fleet:
    fleet = Fleet("", connect=lambda _: robot, key=key)
    fleet.listen(robot.delay_s + 0.2)
    return fleet


def test_who_signed_in_answer_to_a_stop_that_it_stands_is_no_old_news():
    """Its words come too late to tell of now, and "All stand." stood beside "NOBODY KNOWS"."""
    fleet = fleet_with(Obedient(delay_s=1.2))
    given = tell.stop(fleet, {1})
    (told,), verdict = given, of_stop(given)
    assert fleet.robots[1].is_old_news
    assert verdict.ok and verdict.sentence.startswith("All stand. That was signed by R01 up to ")
    assert verdict.sentence.endswith(" s ago: packets are late or lost, or it was halted.")
    assert "NOBODY KNOWS" not in times(fleet, {1}, verdict.standing)
    assert (told.mode, told.stands, told.is_old_news, told.alarms) == ("stopped", True, False, [])
    assert 1.2 <= told.stood_ago_s < 2 * 1.2 + NEAR_S + STEP_S


@pytest.mark.parametrize("robots", [set(), {1}])
@pytest.mark.parametrize("signs_after_s", [3.0, 60.0])
def test_a_stop_is_said_until_a_signature_comes_or_its_time_is_over(robots, signs_after_s):
    """A full queue takes a robot's unsigned answer, and loses the signed one right behind it."""
    fleet, begin_s = fleet_with(Obedient(0.0, signs_after_s=signs_after_s)), time.monotonic()
    given = tell.stop(fleet, robots, 4.0)
    passed_s, verdict = time.monotonic() - begin_s, of_stop(given)
    comes = signs_after_s < 4.0
    assert verdict.ok == comes and (2.5 < passed_s < 4.0 if comes else passed_s >= 4.0)
    says = "All stand." if comes else "NOT ALL STAND: R01: no stop was confirmed."
    assert verdict.sentence.startswith(says)
    assert ("by its word, which nobody can check, it stands" in verdict.sentence) != comes


class SwitchedOn(Obedient):
    """One whose battery is switched on after a while: it heard nothing before, and said nothing."""

    def __init__(self, after_s: float):
        super().__init__(0.0, mode=STOPPED)
        self.next_s += after_s

    def publish(self, channel, data):
        if time.monotonic() > self.next_s - STEP_S:
            super().publish(channel, data)


def test_a_robot_that_is_switched_on_while_a_stop_waits_for_it_is_not_late():
    """It had confirmed in half a second, and its packets were said to be late."""
    fleet = Fleet("", connect=lambda _: SwitchedOn(3.0), key=KEY)
    (told,) = given = tell.stop(fleet, {1}, 10.0)
    assert of_stop(given).sentence == "All stand."
    assert told.stood_ago_s < 0.5 and told.signs_standing


class Rekeyed(Obedient):
    """One that gets another operator's key after it was heard to sign."""

    def __init__(self, delay_s: float):
        super().__init__(delay_s)
        self.key = KEY

    def _say(self, channel: str, message, at_s: float) -> None:
        data = self._stamps(message, at_s).encode()
        is_signed = hasattr(message, "session")
        signed = keys.sign(keys.of_robot(self.key, 1), data) if is_signed else data
        self.on_its_way.append((at_s + self.delay_s, channel, signed))


def test_a_robot_of_a_new_key_is_told_to_sign_no_more_and_its_new_words_are_no_old_news(
    monkeypatch,
):
    """A recording, a late network and a clock that is behind were told, and none was so."""
    monkeypatch.setattr(hold, "SETTLE_S", 0.0)
    fleet = fleet_with(Rekeyed(delay_s=0.0))
    given = tell.answers(fleet, tell.make_command(tell.VERBS.VERB_START), {1})
    held = Held(fleet, tell.Start(0, given, {1: SESSION}))
    fleet.bus.key = bytes(32)
    fleet.listen(SIGNED_S + 0.2)
    said, why = (
        [*held.news(), *held.news()],
        "is not heard to sign with this operator's key any more",
    )
    assert said == [f"R01 {why}: nobody knows whether it stands."]
    (told,) = given = tell.stop(fleet, {1}, 0.4)
    verdict = of_stop(given)
    ended = of_end(Verdict(True, ""), held.ends(), verdict).more(times(fleet, {1}))
    assert not ended.ok and f"R01: {why}, for lost packets or another key" in ended.sentence
    assert f"NOBODY KNOWS WHAT R01 DOES NOW: R01 {why}." in ended.sentence
    for untrue in ("recording", "network is late", "clock", "old news", "has not come"):
        assert untrue not in ended.sentence
    assert told.signs_no_more and not told.is_old_news and told.is_silent and told.mode == ""
    assert told.alarms == [f"SIGNS NO MORE: {why}"]


def test_a_start_is_called_off_with_why_a_robot_of_a_new_key_drops_out():
    fleet = fleet_with(Rekeyed(delay_s=0.0))
    command = tell.make_command(tell.VERBS.VERB_START)
    tell.tell(fleet, command, {1}, until_s=time.monotonic() + 1.0)
    fleet.bus.key = bytes(32)
    fleet.listen(SIGNED_S + 0.2)
    words = tell.find_dropouts(fleet, {1}, command.seq, only_stopped=False).words
    assert words == {1: "not heard to sign with this operator's key any more"}


def test_a_stop_where_no_signature_can_be_checked_asks_for_none():
    fleet, begin_s = fleet_with(Obedient(0.0), key=None), time.monotonic()
    verdict = of_stop(tell.stop(fleet, {1}, 10.0))
    assert not verdict.ok and time.monotonic() - begin_s < 5.0


@pytest.mark.parametrize("partial", [True, False])
def test_what_was_said_before_an_instant_tells_nothing_of_who_began_at_it(partial):
    """For a while after it a late network brings how robots stood before, and they drive."""
    listened_s = tell.BEGUN_S + tell.OTHERS_S  # from the instant on
    delay_s = (listened_s + SIGNED_S / 2) / 2  # later, and an answer is not yet old news
    robot = Obedient(delay_s, mode=STOPPED)
    fleet = fleet_with(robot)
    begun = tell.start(fleet, {1}, "", ahead_s=3.0, partial=partial)
    (told,), verdict = begun.answers, of_start(begun)
    assert told.accepted and begun.called_off == (not partial)
    if partial:
        assert robot.mode == DRIVES and not told.stands and not told.signs_standing
        assert told.mode == "" and told.is_old_news
        assert verdict.sentence.startswith("NOBODY WAS HEARD TO DRIVE")
    else:
        assert robot.mode == STOPPED and told.stands and told.mode == "stopped"
        assert "R01 was not heard since the instant of the start" in verdict.sentence
        assert "All were told to stop: All stand." in verdict.sentence
        assert times(fleet, {1}, verdict.standing).count("NOBODY KNOWS") == 0
