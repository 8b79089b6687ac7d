# SPDX-License-Identifier: Apache-2.0
"""Who drops out of a start that he has accepted: by what he signs, or by silence."""

import time

import pytest
import turbopi

from twinmill.robots import key as keys
from twinmill.robots import tell
from twinmill.robots.countdown import STOPPED, find_dropouts
from twinmill.robots.fleet import GONE_S, TELEMETRY, Fleet, Heard, Robot
from twinmill_cli.swarm_verdict import of_start

KEY, SESSION, SEQ, OWN = bytes(range(32)), 7, 5, 1000
VERBS, ARM = turbopi.swarm_command_t, turbopi.signed_command_t.VERB_ARM


class Bus:
    """A network of which nothing comes, and that keeps what is signed."""

    def __init__(self):
        self.counters = []

    def subscribe(self, *_):
        pass

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False

    def publish(self, _, data):
        self.counters.append(turbopi.signed_command_t.decode(data).counter)


def link(**fields):
    """One of a moment after the start was accepted, which speaks for it."""
    said = turbopi.link_t()
    usual = {"session": SESSION, "session_us": 2_000_000, "armed": True, "counter": OWN}
    usual["utime_us"] = time.time_ns() // 1000
    for name, value in (usual | fields).items():
        setattr(said, name, value)
    return said


@pytest.fixture
def accepted():
    """A fleet of one robot that has accepted a start from here."""
    fleet = Fleet("", connect=lambda _: Bus(), key=KEY)
    now_s, robot = time.monotonic(), Robot(1)
    robot.link, robot.link_s, robot.heard_s, robot.telemetry = link(), now_s, now_s, TELEMETRY()
    ack = turbopi.signed_ack_t()
    ack.session, ack.session_us, ack.accepted, ack.verb = SESSION, 1_000_000, True, VERBS.VERB_START
    robot.signed_acks = {SEQ: ack}
    fleet.robots, fleet.said, fleet.counter = {1: robot}, {SEQ: 0.0}, OWN
    return fleet, robot


def dropouts(fleet, **options):
    return find_dropouts(fleet, {1}, SEQ, **({"only_stopped": False} | options))


def test_who_signs_that_the_start_is_what_it_was_told_last_stays(accepted):
    fleet, _ = accepted
    assert not dropouts(fleet)


@pytest.mark.parametrize(
    ("says", "words"),
    [
        ({"session": SESSION + 1, "session_us": 0}, "started anew"),
        ({"armed": False}, STOPPED),
        ({"status_flags": TELEMETRY.STATUS_LINK_LOST}, "without word from this command"),
        ({"counter": OWN + 1}, "another operator or terminal whose words"),
    ],
)
def test_who_signs_something_else_since_drops_out(accepted, says, words):
    fleet, robot = accepted
    robot.link = link(**says)
    out = dropouts(fleet)
    assert words in out.words[1] and not out.taken
    assert bool(dropouts(fleet, only_stopped=True)) == (words == STOPPED)


def signed(verb, session_us, *, accepted=True):
    """An answer to another command."""
    ack = turbopi.signed_ack_t()
    ack.session, ack.session_us, ack.accepted, ack.verb = SESSION, session_us, accepted, verb
    return ack


@pytest.mark.parametrize(
    ("stop_us", "arm_us", "is_stop"),
    [
        (900_000, 800_000, True),  # between --arm and the start
        (900_000, None, True),
        (900_000, 950_000, False),  # armed since: it refuses for a reason of its own
        (1_100_000, 800_000, False),
        (None, 800_000, False),
    ],
)
def test_who_refuses_since_another_has_stopped_it_is_told_so(accepted, stop_us, arm_us, is_stop):
    """It was told to give --arm, which it had given."""
    fleet, robot = accepted
    robot.signed_acks[SEQ].accepted = False
    if stop_us:
        robot.signed_acks[77] = signed(VERBS.VERB_STOP, stop_us)
    if arm_us:
        robot.signed_acks[78] = signed(ARM, arm_us)
    assert dropouts(fleet).words == ({1: STOPPED} if is_stop else {})
    fleet.said[77] = 0.0
    assert not dropouts(fleet)


def test_a_stop_of_somebody_else_is_told_with_where_it_came_from(accepted):
    fleet, _ = accepted
    fleet.bus.sender = ("10.0.0.2", 40000)
    stop, own, arm, odd = (tell.make_command(v) for v in (VERBS.VERB_STOP,) * 2 + (ARM, 0))
    fleet.said[own.seq] = 0.0
    stop.robot_id, odd.robot_id = 3, 10**6
    for command in (own, arm, odd):
        fleet._on_message("SWARM_COMMAND", command.encode())
    fleet._on_message("SWARM_COMMAND", b"half a message")
    assert fleet.stop_heard({1, 3}) == ""
    fleet._on_message("SWARM_COMMAND", stop.encode())
    assert fleet.stop_heard({1, 3}).startswith("10.0.0.2 at ") and not fleet.stop_heard({1})
    stop.robot_id, fleet.bus.sender = tell.ALL, ("10.0.0.9", 40000)
    fleet._on_message("SWARM_COMMAND", stop.encode())
    assert fleet.stop_heard({1}).startswith("10.0.0.9 at ")


@pytest.mark.parametrize(
    ("reason", "flags", "timeout_ms", "says"),
    [
        ("no wheel turns: duty_cap_pct is 0 in its file", 0, 2000, "not able to drive (no wheel"),
        ("", TELEMETRY.STATUS_DRY_RUN, 2000, "not able to drive (dry run"),
        ("", 0, 0, "about to drive on for ever without this command"),
        ("", 0, 1500, "about to drive on for 1.5 s without this command"),
        ("", 0, 2000, ""),
    ],
)
def test_what_would_make_a_start_fail_and_is_known_before_calls_it_off(
    accepted, reason, flags, timeout_ms, says
):
    """The others drove on untethered, behind a script that took exit code 1 for "or none"."""
    fleet, robot = accepted
    robot.signed_acks[SEQ].reason = reason
    robot.link = link(status_flags=flags, link_timeout_ms=timeout_ms)
    out = dropouts(fleet, link_timeout_ms=2000)
    assert bool(out) == bool(says) and says in out.words.get(1, "") and not out.taken
    assert not dropouts(fleet, only_stopped=True, link_timeout_ms=2000)


def test_what_was_signed_before_the_start_speaks_against_nothing(accepted):
    """A link that came before the answer: armed and started since."""
    fleet, robot = accepted
    robot.link = link(session_us=900_000, armed=False, counter=OWN - 1)
    assert not dropouts(fleet)


@pytest.mark.parametrize(
    ("silent", "says"),
    [
        ("heard_s", "not heard any more"),
        ("link_s", "not heard to sign with this operator's key any more"),
    ],
)
def test_who_is_not_heard_any_more_drops_out(accepted, silent, says):
    fleet, robot = accepted
    setattr(robot, silent, time.monotonic() - GONE_S - 1.5)
    assert dropouts(fleet).words[1] == says


@pytest.mark.parametrize(
    ("verb", "is_taken"), [(VERBS.VERB_START, True), (VERBS.VERB_SELECT, False)]
)
def test_the_start_of_another_operator_takes_a_robot_and_no_other_command_does(
    accepted, verb, is_taken
):
    fleet, robot = accepted
    robot.link = link(counter=OWN + 9)
    robot.commands = {OWN + 9: Heard(6, verb, SESSION, OWN + 9, "start milling at 12:00:01")}
    assert (dropouts(fleet).taken == {1}) == is_taken == bool(dropouts(fleet))


def test_a_command_is_above_what_was_said_before_though_no_link_has_come_since(accepted):
    """A robot obeys a counter once; after a laptop that was a day ahead all of them are ahead."""
    fleet, robot = accepted
    robot.link = link(counter=2 * time.time_ns() // 1000)
    for verb in (ARM, VERBS.VERB_SELECT):
        tell.tell(fleet, tell.make_command(verb), {1}, until_s=time.monotonic() + 0.05)
    arm, select = sorted(set(fleet.bus.counters))
    assert robot.link.counter < arm < select
    assert fleet.bus.counters == sorted(fleet.bus.counters)


class SetBack:
    """Robots that accept a start; then their clocks are set back, and its instant is far ahead."""

    def __init__(self, *robots: int, drive: tuple[int, ...] = ()):
        self.robots, self.drive, self.waiting = robots, drive, []
        self.session_us, self.start_us = 1_000_000, None

    def subscribe(self, _, handler):
        self.hear = handler

    def _say(self, robot_id: int, kind: str, message, **fields) -> None:
        self.session_us += 1
        usual = {"robot_id": robot_id, "utime_us": time.time_ns() // 1000}
        if kind != "TELEMETRY":
            usual |= {"session": SESSION, "session_us": self.session_us}
            message.tag = bytes(keys.TAG_BYTES)
        for name, value in (usual | fields).items():
            setattr(message, name, value)
        data = message.encode()
        signed = data if kind == "TELEMETRY" else keys.sign(keys.of_robot(KEY, robot_id), data)
        self.waiting.append((f"R{robot_id:02d}_{kind}", signed))

    def publish(self, channel, data):
        is_signed = channel == "SWARM_SIGNED"
        sealed = turbopi.signed_command_t.decode(data) if is_signed else None
        command = VERBS.decode(sealed.command if is_signed else data)
        if command.verb == turbopi.signed_command_t.VERB_HOLD:
            return
        self.start_us = command.start_utime_us if command.verb == VERBS.VERB_START else None
        answer = {"seq": command.seq, "verb": command.verb, "accepted": True, "stands": True}
        for i in [command.robot_id] if is_signed else self.robots:
            acked = {**answer, "command_utime_us": command.utime_us}
            self._say(i, "SIGNED_ACK", turbopi.signed_ack_t(), **acked)

    def handle_timeout(self, timeout_ms):
        if not self.waiting:
            time.sleep(timeout_ms / 1e3)
            for i in self.robots:
                is_past = self.start_us is not None and 1e6 * time.time() > self.start_us
                mode = TELEMETRY.MODE_TABLE if is_past and i in self.drive else 0
                self._say(i, "TELEMETRY", TELEMETRY(), mode=mode)
                link = {"armed": True, "mode": mode, "stands": not mode}
                self._say(i, "LINK", turbopi.link_t(), **link, link_timeout_ms=2000)
            return False
        self.hear(*self.waiting.pop(0))
        return True


@pytest.mark.parametrize(
    ("drive", "words", "remedy"),
    [
        ((), "R01, R02 were not driving when the instant of the start was past", "(--arm)."),
        ((1,), "R02 was not driving when the others had begun", "(--arm); --partial starts some."),
    ],
)
def test_a_start_whose_instant_is_past_says_whether_others_had_begun(drive, words, remedy):
    """Nobody had, and "when the others had begun" was said; no part of nobody could be started."""
    fleet = Fleet("", connect=lambda _: SetBack(1, 2, drive=drive), key=KEY)
    fleet.listen(0.2)
    begun = tell.start(fleet, {1, 2}, "", ahead_s=0.6, partial=False)
    verdict = of_start(begun)
    assert verdict.sentence.startswith(f"Called off: {words}. All were told to stop: ")
    assert verdict.sentence.endswith(remedy) and verdict.code == 1
    assert begun.begun_utime_us is None and not fleet.held


def heard_start(**fields):
    return Heard(6, VERBS.VERB_START, SESSION, OWN + 9, "start milling at 12:00:01", **fields)


@pytest.mark.parametrize("answers", [True, False])
def test_a_robot_of_another_operator_is_his_though_it_never_answered_here(accepted, answers):
    fleet, robot = accepted
    robot.link, robot.commands = link(counter=OWN + 9), {OWN + 9: heard_start()}
    if not answers:
        robot.signed_acks = {}
    assert dropouts(fleet).taken == {1}


@pytest.mark.parametrize(("stop_us", "is_taken"), [(1_500_000, True), (2_500_000, False)])
def test_the_last_of_a_stop_and_a_start_of_another_counts(accepted, stop_us, is_taken):
    """He stopped it, armed it, and started it: what he said first did not make it nobody's."""
    fleet, robot = accepted
    robot.link = link(counter=OWN + 9, session_us=3_000_000, armed=is_taken)
    robot.commands = {OWN + 9: heard_start()}
    robot.signed_acks[6] = signed(VERBS.VERB_START, 2_000_000)
    robot.signed_acks[77] = signed(VERBS.VERB_STOP, stop_us)
    out = dropouts(fleet)
    assert bool(out.taken) == is_taken and (out.words[1] == STOPPED) != is_taken


def test_a_robot_that_another_holds_is_his_though_his_start_was_not_heard(accepted):
    """Words to a program that sleeps for long are dropped where its buffer is full."""
    fleet, robot = accepted
    robot.link = link(counter=OWN + 9)
    assert not dropouts(fleet).taken
    robot.other_hold_s = time.monotonic()
    assert dropouts(fleet).taken == {1}


@pytest.mark.parametrize(("own_ms", "is_taken"), [(2000, True), (0, False), (None, False)])
def test_a_robot_that_another_let_drive_by_itself_is_his_though_that_was_not_heard(
    accepted, own_ms, is_taken
):
    """Nobody says then that he is there; only a start changes for how long it needs nobody."""
    fleet, robot = accepted
    robot.link = link(counter=OWN + 9, link_timeout_ms=0)
    assert bool(dropouts(fleet, link_timeout_ms=own_ms).taken) == is_taken
    robot.link = link(counter=OWN, link_timeout_ms=0)
    assert not dropouts(fleet, link_timeout_ms=own_ms).taken


def test_nothing_is_judged_before_all_is_heard_that_was_said_in_a_sleep(monkeypatch):
    """Half of it told of robots that had lost this operator, and not of who has them since."""
    fleet = Fleet("", connect=lambda _: Bus(), key=KEY)
    waiting, judged = list(range(500)), []

    def handle_timeout(timeout_ms):
        time.sleep(1e-4 if waiting else timeout_ms / 1e3)  # a signature is checked
        return bool(waiting and waiting.pop())

    monkeypatch.setattr(fleet.bus, "handle_timeout", handle_timeout, raising=False)
    passed_s = time.clock_gettime(time.CLOCK_BOOTTIME)
    fleet._looked_s = passed_s - GONE_S - 1
    fleet.listen(-1.0, lambda: judged.append(len(waiting)))
    fleet.listen(0.01, lambda: judged.append(len(waiting)))
    assert judged and not any(judged)


def test_a_start_that_others_drive_by_is_not_said_to_be_begun(monkeypatch):
    """They drove, and by the start of another operator who came while this one slept."""
    fleet = Fleet("", connect=lambda _: SetBack(1, 2, drive=(1, 2)), key=KEY)
    fleet.listen(0.2)
    wait, said = tell._not_begun, []

    def take_over(*given):
        for robot in fleet.robots.values():
            robot.commands[fleet.counter + 1] = Heard(
                6, VERBS.VERB_START, SESSION, fleet.counter + 1, "start at 12:00:01"
            )
            robot.signed_acks[6] = signed(VERBS.VERB_START, robot.link.session_us)
        return wait(*given)

    monkeypatch.setattr(tell, "_not_begun", take_over)
    monkeypatch.setattr(tell, "stop", lambda *given: said.append(given))
    begun = tell.start(fleet, {1, 2}, "", ahead_s=0.6, partial=False)
    assert begun.called_off and begun.dropouts.taken == {1, 2} and not said
    words = (
        "Called off: R01, R02 were taken over by another operator or terminal (start at 12:00:01)."
    )
    assert of_start(begun).sentence.startswith(words) and not fleet.held


class Unheard(SetBack):
    """R02 obeys, and nothing that it says comes any more: a buffer is full, its radio is gone."""

    def __init__(self, *robots: int, **options):
        super().__init__(*robots, **options)
        self.is_gone, self.stops = False, 0

    def publish(self, channel, data):
        self.is_gone, start_us = True, self.start_us
        super().publish(channel, data)
        if channel == "SWARM_COMMAND":  # of which R01 hears nothing
            self.stops, self.start_us = self.stops + 1, start_us

    def _say(self, robot_id, kind, message, **fields):
        if not (self.is_gone and robot_id == 2):
            super()._say(robot_id, kind, message, **fields)


def test_who_may_drive_by_itself_unheard_is_told_to_stop_and_not_said_to_stand(monkeypatch):
    """It was said not to have started; it drove on for ever, and nobody was told."""
    fleet = Fleet("", connect=lambda _: Unheard(1, 2, drive=(1,)), key=KEY)
    fleet.listen(0.2)
    stop, stopped = tell.stop, []
    monkeypatch.setattr(tell, "stop", lambda f, r: stopped.append(r) or stop(f, r, timeout_s=0.3))
    begun = tell.start(fleet, {1, 2}, "", ahead_s=1.0, partial=True, link_timeout_ms=0)
    sentence = of_start(begun).sentence
    assert stopped == [{2}] and fleet.bus.stops
    assert "R02 was not heard to start in time, told to stop" in sentence
    assert "NOT ALL STAND: R02: no stop was confirmed. SWITCH OFF BY HAND" in sentence


class Late(SetBack):
    """R02's signed answers are slower than what it says unsigned, and than a start can wait."""

    def __init__(self, *robots: int):
        super().__init__(*robots)
        self.late_s, self.due = 0.5, []

    def _say(self, robot_id, kind, message, **fields):
        super()._say(robot_id, kind, message, **fields)
        if (robot_id, kind) == (2, "SIGNED_ACK"):
            self.due.append((time.monotonic() + self.late_s, self.waiting.pop()))
            unsigned = turbopi.ack_t()
            unsigned.seq, unsigned.accepted = message.seq, True
            self.waiting.append(("R02_ACK", unsigned.encode()))

    def handle_timeout(self, timeout_ms):
        while self.due and self.due[0][0] < time.monotonic():
            self.waiting.append(self.due.pop(0)[1])
        return super().handle_timeout(timeout_ms)


@pytest.mark.parametrize(
    ("is_lost", "words"),
    [(False, "(answered too late, after 0.5"), (True, "(answered, and its signed answer has not")],
)
def test_a_robot_that_signs_late_has_no_other_key(is_lost, words):
    """It was told to be flashed, in the sentence by which it had signed that it stands."""
    fleet = Fleet("", connect=lambda _: Late(1, 2), key=KEY)
    fleet.listen(0.2)
    fleet.bus.late_s = 60.0 if is_lost else 0.5
    stopping = tell.stop if not is_lost else lambda *_: []
    begun = tell.start(fleet, {1, 2}, "", ahead_s=0.6, partial=False, stopping=stopping)
    sentence = of_start(begun).sentence
    assert begun.called_off and f"R02 did not acknowledge in time {words}" in sentence
    assert "key" not in sentence and ("--in-s 2 leaves time for it" in sentence) != is_lost
