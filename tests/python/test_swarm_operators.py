# SPDX-License-Identifier: Apache-2.0
"""Before a command is said: who is missing, who drives already, and whom an operator holds."""

import json
import os
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import turbopi
import typer

from twinmill.robots import key as keys
from twinmill.robots import tell
from twinmill.robots.countdown import Dropouts
from twinmill.robots.fleet import GONE_S, MODES, TELEMETRY, Fleet, Robot, Step
from twinmill.terminal import PlainConsole
from twinmill_cli import characterise, swarm, swarm_door, swarm_stop
from twinmill_cli.swarm_end import driving
from twinmill_cli.swarm_screen import status_table
from twinmill_cli.swarm_verdict import of_busy, of_countdown, of_start, of_stop
from twinmill_cli.voice import Voice

KEY, SESSION, DRIVING = bytes(range(32)), 7, TELEMETRY.MODE_TABLE
VERBS = turbopi.signed_command_t
VERBS_START = turbopi.swarm_command_t.VERB_START


class Bus:
    """A network of which nothing comes, and that keeps what is said."""

    def __init__(self):
        self.said = []

    def subscribe(self, _, handler):
        self.hear = handler

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False

    def publish(self, channel, _):
        self.said.append(channel)


def fleet_of(*robots: Robot) -> Fleet:
    fleet = Fleet("", connect=lambda _: Bus(), key=KEY)
    fleet.robots = {robot.robot_id: robot for robot in robots}
    return fleet


def robot(robot_id: int, mode: int = TELEMETRY.MODE_STOPPED, link_timeout_ms: int = 2000) -> Robot:
    """One that has just said all that it is."""
    link, telemetry = turbopi.link_t(), turbopi.telemetry_t()
    link.session, link.mode, link.armed, link.link_timeout_ms = SESSION, mode, 1, link_timeout_ms
    telemetry.mode = mode
    telemetry.utime_us = link.utime_us = time.time_ns() // 1000
    now_s = time.monotonic()
    return Robot(robot_id, telemetry=telemetry, heard_s=now_s + 60, link=link, link_s=now_s)


def hold(fleet: Fleet, robot_id: int, *, key=KEY, session=SESSION, made_us=0) -> None:
    """Somebody else says that he is there."""
    command, sealed = turbopi.swarm_command_t(), turbopi.signed_command_t()
    command.verb = VERBS.VERB_HOLD
    sealed.robot_id, sealed.session, sealed.made_us = robot_id, session, made_us
    sealed.command = command.encode()
    sealed.command_size = len(sealed.command)
    sealed.tag = bytes(keys.TAG_BYTES)
    fleet.bus.hear("SWARM_SIGNED", keys.sign(keys.of_robot(key, robot_id), sealed.encode()))


def test_a_command_is_told_with_the_time_at_which_it_was_said():
    """A laptop that wakes up hears late what another operator or terminal said while it slept."""
    fleet = fleet_of(robot(1))
    command, sealed = turbopi.swarm_command_t(), turbopi.signed_command_t()
    command.verb, command.utime_us = VERBS_START, round((time.time() - 3600) * 1e6)
    sealed.robot_id, sealed.session, sealed.counter = 1, SESSION, 5
    sealed.command = command.encode()
    sealed.command_size = len(sealed.command)
    sealed.tag = bytes(keys.TAG_BYTES)
    fleet.bus.hear("SWARM_SIGNED", keys.sign(keys.of_robot(KEY, 1), sealed.encode()))
    said = time.strftime("%H:%M:%S", time.localtime(command.utime_us / 1e6))
    assert fleet.robots[1].commands[5].words == f"start at {said}"


@pytest.mark.parametrize(
    ("mode", "timeout_ms", "says"),
    [
        (DRIVING, 0, (0.0, False, None)),
        (DRIVING, 2000, (2.0, True, False)),
        (TELEMETRY.MODE_STOPPED, 0, (None, None, None)),
    ],
)
def test_status_tells_of_a_link_only_where_a_robot_drives(mode, timeout_ms, says):
    """A standing robot's status holds for its next start: 0.0 was taken for untethered."""
    data = robot(1, mode, timeout_ms).to_json()
    assert (data["link_timeout_s"], data["tethered"], data["held"]) == says


def test_a_start_says_what_the_robot_has_signed_since_and_not_what_it_said_before():
    """It may have driven before, for another operator with another time."""
    fleet, command = fleet_of(known := robot(1, DRIVING, 0)), tell.make_command(VERBS_START)
    ack = turbopi.signed_ack_t()
    ack.session, ack.session_us, ack.accepted, ack.verb = SESSION, 500, True, VERBS_START
    ack.command_utime_us, known.signed_acks[command.seq] = command.utime_us, ack
    known.link.session_us = 400
    (before,) = tell.answers(fleet, command, {1})
    known.link.session_us, known.link.link_timeout_ms = 600, 2000
    (since,) = tell.answers(fleet, command, {1})
    assert (before.link_timeout_s, before.untethered) == (None, None)
    assert (since.link_timeout_s, since.untethered) == (2.0, False)


@pytest.mark.parametrize("accepted", [False, True])
def test_what_a_robot_said_before_the_instant_holds_behind_it_if_it_refused(accepted):
    """One that accepted may have begun since; it was told of both that nobody knows."""
    fleet, command = fleet_of(known := robot(1)), tell.make_command(VERBS_START)
    known.link.stands, known.heard_s = 1, time.monotonic()
    command.start_utime_us = known.telemetry.utime_us + 1
    ack = turbopi.signed_ack_t()
    ack.session, ack.accepted, ack.verb = SESSION, accepted, VERBS_START
    ack.command_utime_us, known.signed_acks[command.seq] = command.utime_us, ack
    (told,) = tell.answers(fleet, command, {1})
    assert (told.mode, told.stands) == (("", False) if accepted else ("stopped", True))


def test_a_robot_that_fell_silent_in_the_countdown_is_not_told_to_stand(monkeypatch):
    """It was told as it had been when it accepted, eleven seconds after its last packet."""
    fleet = fleet_of(known := robot(1))

    def accept(_, command, *__, **___):
        ack = turbopi.signed_ack_t()
        ack.session, ack.accepted, ack.verb = SESSION, True, command.verb
        ack.command_utime_us, known.signed_acks[command.seq] = command.utime_us, ack
        known.heard_s -= 60

    monkeypatch.setattr(Fleet, "send_signed", accept)
    monkeypatch.setattr(tell, "stop", lambda *_, **__: [])
    begun = tell.start(fleet, {1}, "", ahead_s=0.4, partial=False)
    (told,) = begun.answers
    assert begun.called_off and told.accepted
    assert not told.stands and told.last_heard_s > 50


def test_no_start_leaves_it_to_a_robots_file_how_long_it_needs_no_operator(monkeypatch):
    """Its `link_timeout_ms` may be 0: it would drive on once the link is lost, unasked."""
    fleet, sent = fleet_of(robot(1)), []

    def send(_, command, *__, link_timeout_ms=-1):
        if command.verb == VERBS_START:
            sent.append(link_timeout_ms)

    monkeypatch.setattr(Fleet, "send_signed", send)
    monkeypatch.setattr(tell, "stop", lambda *_, **__: [])
    for options in ({}, {"link_timeout_ms": 0}):
        tell.start(fleet, {1}, "", ahead_s=0.4, partial=False, **options)
    assert set(sent) == {0, 2000} and sent[0] == 2000


@pytest.mark.parametrize("words", [["start"], ["arm"], ["select", "milling"], ["status", "--once"]])
def test_where_this_computer_has_no_network_no_robot_is_asked_for(
    monkeypatch, key_file, twinmill, words
):
    """They were asked whether they are switched on."""
    fleet = fleet_of()
    fleet.bus.fault = "wlan0: not connected"
    for module in (swarm, swarm_door):
        monkeypatch.setattr(module, "Fleet", lambda *_, **__: fleet)
    code, _, err = twinmill("swarm", *words, "--key", key_file)
    assert code == 1 and "this computer has no network (wlan0: not connected)" in err
    assert "switched on" not in err


@pytest.mark.parametrize("words", [["start"], ["status", "--once"]])
def test_that_nothing_leaves_a_computer_by_its_ttl_is_named_where_nobody_is_heard(
    monkeypatch, key_file, twinmill, words
):
    """It is 0 in LCM's and a robot's defaults, and all else was asked about."""
    for module in (swarm, swarm_door):
        monkeypatch.setattr(module, "Fleet", lambda *_, **__: fleet_of())
    code, _, err = twinmill("swarm", *words, "--key", key_file)
    assert code == 1 and "what is said with ttl=0 leaves no computer" in err


@pytest.mark.parametrize("ttl", [0, 1])
def test_a_robot_that_hears_nothing_from_here_is_named_with_the_ttl_as_cause(ttl):
    fleet = fleet_of(robot(1))
    fleet.bus.ttl = ttl
    given = tell.answers(fleet, tell.make_command(VERBS_START), {1})
    cause = "R01: no answer; by ttl=0 in lcm_url nothing left this computer."
    assert (cause in of_stop(given).sentence) == (ttl == 0)


@pytest.mark.parametrize("arm", [[], ["--arm"]])
def test_a_robot_that_is_missing_is_refused_before_anybody_is_told(
    monkeypatch, key_file, twinmill, arm
):
    """Nobody was told to start: so there is no stop that a missing robot would have to confirm."""
    fleet = fleet_of(robot(1))
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    words = ["start", "--robots", "1,9", *arm, "--key", key_file]
    code, _, err = twinmill("swarm", *words)
    assert code == 1 and "R09: not heard" in err
    assert fleet.bus.said == []


@pytest.mark.parametrize(
    ("words", "not_done"), [(["start", "--arm"], "started"), (["arm"], "armed")]
)
def test_a_stop_that_came_while_it_looked_is_not_undone_by_arm(
    monkeypatch, key_file, twinmill, words, not_done
):
    """Who had said it was told that all stand, and a second later they drove or might."""
    fleet = fleet_of(robot(1))
    fleet.bus.sender = ("10.0.0.2", 40000)
    fleet.bus.hear("SWARM_COMMAND", tell.make_command(turbopi.swarm_command_t.VERB_STOP).encode())
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    code, _, err = twinmill("swarm", *words, "--robots", "1", "--key", key_file)
    assert code == 1 and f"nothing was {not_done}: a stop came from 10.0.0.2 at " in err
    assert "ask there" in err and fleet.bus.said == []


def test_robots_of_another_key_are_left_to_their_operator(monkeypatch, key_file, twinmill):
    """A start that none can obey would end in a stop, which all do."""
    strange = robot(1, DRIVING)
    strange.link = None
    fleet = fleet_of(strange)
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    code, _, err = twinmill("swarm", "start", "--robots", "1", "--key", key_file)
    assert code == 1 and "nothing was started: R01 is not heard to sign" in err
    assert fleet.bus.said == []


@pytest.mark.parametrize("untethered", [[], ["--untethered"]])
@pytest.mark.parametrize("is_over_ssh", [False, True])
def test_a_hold_over_ssh_says_that_a_broken_network_does_not_end_it(
    monkeypatch, key_file, twinmill, is_over_ssh, untethered
):
    """With ServerAliveInterval the client had ended, and robots drove on."""
    fleet = fleet_of(robot(1))
    fleet.robots[1].link_s += 60
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    if is_over_ssh:
        monkeypatch.setenv("SSH_CONNECTION", "10.9.0.2 40000 10.9.0.1 22")  # as of ssh(1)
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    monkeypatch.setattr(tell, "start", lambda *_, **__: tell.Start(0, [], {}, called_off=True))
    _, _, err = twinmill("swarm", "start", "--robots", "1", "--key", key_file, *untethered)
    assert "to start at" in err and ("ClientAliveInterval" in err) == (
        is_over_ssh and not untethered
    )


def test_who_drives_already_is_said_with_who_holds_it():
    held, alone, free = robot(1, DRIVING), robot(2, DRIVING), robot(3, DRIVING, 0)
    fleet = fleet_of(held, alone, free)
    hold(fleet, 1)
    said = of_busy([held, alone, free])
    assert "R01 drives already, held by another operator or terminal" in said
    assert "R02 drives already, and no operator is heard who holds it" in said
    assert "R03 drives already, untethered" in said


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (TELEMETRY.STATUS_FRAME_STALE, ["no new picture from the camera"]),
        (TELEMETRY.STATUS_CAMERA_LOST | TELEMETRY.STATUS_FRAME_STALE, ["camera lost"]),
        (0, ["a part does not answer"]),  # by firmware/README.md the mode alone tells that
    ],
)
def test_whoever_is_in_a_fault_says_why(flags, says):
    """A start was called off, and a partial one went on, without a word on the camera."""
    known = robot(1, TELEMETRY.MODE_FAULT)
    known.telemetry.status_flags = flags
    assert known.alarms == says and known.to_json()["alarms"] == says


@pytest.mark.parametrize("begins", [False, True])
def test_who_drives_while_stop_is_said_is_named_at_once_and_at_the_end(begins):
    """One that is deaf began by itself while its answer was waited for, and was not named."""
    fleet, told = fleet_of(robot(1) if begins else robot(1, DRIVING), robot(2)), []

    def begin(_):
        fleet.robots[1] = robot(1, DRIVING)

    given = tell.stop(fleet, {1, 2}, 1.0, waiting=begin, driving=told.append)
    assert told == [{1}]
    said = of_stop(given).sentence
    assert "R01 drives." in said and "R02 drives" not in said


@pytest.mark.parametrize("verb", ["status", "arm", "select"])
def test_it_is_said_whom_a_command_was_for(monkeypatch, key_file, twinmill, verb):
    """Twins had stopped, "All stand." was said, and a real robot of the same number drove."""
    twin, fleet, command = robot(1), fleet_of(), tell.make_command(VERBS_START)
    twin.runs = {"twin": {None}}
    bus = {"lcm_url": "udpm://239.255.76.67:7668?ttl=1", "channel_prefix": "TWIN_"}
    words = ["--robots", "1"] if verb != "status" else []
    words += ["milling"] if verb == "select" else []

    def said(run: list[str]) -> dict:
        fleet.robots = {1: twin}
        twin.link.utime_us, twin.link_s = time.time_ns() // 1000, time.monotonic()
        return json.loads(twinmill("swarm", verb, *words, "--json", "--key", key_file, *run)[1])

    def join(url, prefix="", **_):
        fleet.url, fleet._prefix = url, prefix
        return fleet

    monkeypatch.setattr(swarm.tell, "tell", lambda *_, **__: tell.answers(fleet, command, {1}))
    monkeypatch.setattr(swarm.tell, "arm", lambda *_: tell.answers(fleet, command, {1}))
    monkeypatch.setattr(swarm, "Fleet", join)
    monkeypatch.setattr(swarm_door, "Fleet", join)
    told = said(["--lcm-url", bus["lcm_url"], "--channel-prefix", "TWIN_"])
    assert told["addressed"] == {**bus, "twins": [1]}
    first = (
        "Only robots with --lcm-url 'udpm://239.255.76.67:7668?ttl=1' --channel-prefix TWIN_ are"
    )
    assert told["sentence"].startswith(first) and "R01 is a twin, no robot." in told["sentence"]
    twin.runs = {"robot": {None}}
    told = said([])
    assert "addressed" not in told and "Only robots" not in told["sentence"]


@pytest.mark.parametrize(
    ("hosts", "words"),
    [
        (("127.0.0.1", "10.9.0.2"), "127.0.0.1 is this computer: if a twin or a recording speaks"),
        (("198.51.100.1", "198.51.100.2"), "give one another number"),  # RFC 5737: nobody has these
    ],
)
def test_a_twin_on_this_computer_is_not_to_be_flashed(hosts, words):
    double = robot(1)
    for host in (*hosts, *hosts):
        double.senders.add((host, 7667))
    with pytest.raises(ValueError, match=words):
        swarm_door.refuse_doubles(fleet_of(double), {1})


@pytest.mark.parametrize("verb", ["status", "stop"])
def test_who_looks_or_stops_is_told_that_this_computer_is_one_of_the_two(
    monkeypatch, key_file, twinmill, verb
):
    """Only a start said so; a recording that is played here makes two of each robot, too."""
    double = robot(1)
    for host in ("127.0.0.1", "10.9.0.2") * 2:
        double.senders.add((host, 7667))
    fleet = fleet_of(double)
    fleet.send, fleet.hear = lambda *_: None, lambda: ""
    monkeypatch.setattr(swarm, "Fleet", lambda *_, **__: fleet)
    monkeypatch.setattr(swarm, "RUN_PERIOD_S", 1.0)
    monkeypatch.setattr(swarm_stop, "_say_first", lambda *_: fleet)
    options = {"status": ["--once"], "stop": ["--timeout-s", "0.5"]}[verb]
    for more in ([], ["--json"]):
        _, out, _ = twinmill("swarm", verb, *options, "--key", key_file, *more)
        said = json.loads(out)["sentence"] if more else " ".join(out.split())
        assert said.count("127.0.0.1 is this computer: if a twin or a recording speaks") == 1


def test_both_ends_of_a_start_name_a_clock_that_is_off(monkeypatch):
    """The start had named the 30 s of a clock that was set in its countdown; its end did not."""
    ahead, said = robot(1, DRIVING), []
    ahead.telemetry.utime_us = round((time.time() + 30) * 1e6)
    ahead.recent.append(Step(time.monotonic() + 60, time.time(), ahead.telemetry))
    answer = tell.Answer(1, True, True, "", "running", False, False, [])
    stood = replace(answer, mode="stopped", stands=True)
    monkeypatch.setattr(tell, "start", lambda *_, **__: tell.Start(0, [answer], {1: SESSION}))
    monkeypatch.setattr(tell, "stop", lambda *_, **__: [stood])
    monkeypatch.setattr(swarm, "_hold", _interrupted)
    monkeypatch.setattr(swarm, "finish", lambda *given, **_: said.append(given[2].sentence))
    voice = Voice()
    kept = {
        "data": {"drove_before": []},
        "as_json": True,
        "heard": lambda _: "",
        "ends": str,
        "signals": [],
    }
    options = {"ahead_s": 0.1, "partial": False, "link_timeout_ms": 2000}
    fleet = fleet_of(ahead)
    fleet.addressed = {1}
    ended = swarm._drive(fleet, {1}, "", voice, **kept, **options)
    voice.end(1, [])
    for sentence in (*said, ended.sentence):
        assert "R01's clock is 30.00 s ahead of this computer's" in sentence
    assert len(said) == 1 and ended.sentence.startswith("All stand.")


def _interrupted(*_):
    raise KeyboardInterrupt


def test_how_to_call_a_start_off_is_said_while_that_can_be_done(monkeypatch, capfd):
    """In a file or a pipe it stood below the start alone, when there was nothing to call off."""
    said = []

    def begin(*_, **__):
        voice.wait(time.sleep)
        said.append(capfd.readouterr().err)
        raise KeyboardInterrupt

    monkeypatch.setattr(tell, "start", begin)
    monkeypatch.setattr(swarm, "finish", lambda *_, **__: None)
    voice = Voice(as_json=True)

    def ends(becomes: str = "stops them") -> str:
        return f"`kill 77` {becomes}"

    kept = {
        "data": {"drove_before": []},
        "as_json": True,
        "heard": lambda _: "",
        "ends": ends,
        "signals": [],
    }
    options = {"ahead_s": 5.0, "partial": False, "link_timeout_ms": 2000}
    swarm._drive(fleet_of(robot(1)), {1}, "", voice, **kept, **options)
    voice.end(1, [])
    assert "R01: to start at " in said[0] and "`kill 77` calls that off." in said[0]


def test_a_script_with_a_wrong_column_is_mended_in_its_file(tmp_path, key_file, twinmill):
    """It was to be mended by an option that this command has not."""
    script = tmp_path / "steps.csv"
    script.write_text("t_s,fl_pct,fr_pct,rl,rr_pct\n0,30,30,30,30\n1,0,0,0,0\n")
    words = ["--robot", "1", "--script", script, "--out", tmp_path / "o.lcmlog", "--key", key_file]
    code, _, err = twinmill("characterise", *words)
    assert code == 1 and "column rl_pct is missing (nearest is 'rl')" in err
    assert "rename it in the file." in err and "--rename" not in err
    script.write_text(script.read_text().replace("rl,", "rl_pct,"))
    _, duties = characterise.read_script(script)
    assert duties[0].tolist() == [30, 30, 30, 30]


@pytest.mark.parametrize("verb", ["start", "arm", "select"])
def test_a_stop_behind_another_verb_says_that_nothing_was_stopped(twinmill, verb):
    words = ["milling"] if verb == "select" else []
    code, _, err = twinmill("swarm", verb, *words, "stop")
    assert code == 2 and "NOTHING WAS STOPPED; was `twinmill swarm stop` meant?" in err


def test_a_home_folder_that_no_shell_has_put_in_is_named():
    """`--key=~/.config/swarm.key` names a folder `~` in the working directory."""
    with pytest.raises(ValueError, match=r"was .*key.*/swarm\.key.* meant\?"):
        keys.load(Path("~/.config/swarm.key"))


def test_a_key_that_can_be_read_once_alone_is_told_with_what_to_do(tmp_path):
    """`--key <(cat FILE)` "is no file", and nobody knew what that meant."""
    os.mkfifo(tmp_path / "key", 0o600)
    with pytest.raises(ValueError, match=r"a folder or a pipe.*name the file of a key itself"):
        keys.load(tmp_path / "key")


def test_what_a_terminal_does_not_show_of_a_list_is_named():
    """A list with Windows' ends of lines had "1 : must be numbers" told of it."""
    with pytest.raises(typer.BadParameter, match=r"^'1\\r': must be numbers"):
        swarm_door.parse_robots("1\r")


def drives_by_its_word(robot_id: int) -> Robot:
    """A robot of another lab, with that lab's key."""
    other = robot(robot_id, DRIVING)
    other.link, now_s = None, time.monotonic()
    other.recent.append(Step(now_s + 60, time.time(), other.telemetry))
    return other


@pytest.mark.parametrize("verb", ["arm", "select", "start"])
def test_who_drives_by_a_word_that_nobody_can_check_is_told_first(
    monkeypatch, key_file, twinmill, verb
):
    """A start said that it drives without having confirmed it, as if the start had moved it."""
    fleet = fleet_of(robot(1), drives_by_its_word(2))
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    monkeypatch.setattr(swarm.tell, "arm", lambda *_: [])
    monkeypatch.setattr(swarm.tell, "tell", lambda *_, **__: [])
    more = {"arm": [], "select": ["milling"], "start": ["--partial"]}[verb]
    _, out, err = twinmill("swarm", verb, *more, "--robots", "1,2", "--json", "--key", key_file)
    assert "R02 drives already, by its word, which nobody can check" in err
    assert "takes over" not in err and "may not play" not in err
    assert json.loads(out)["drove_before"] == [2]
    assert verb != "start" or "twinmill: R01: to start at" in err


def test_who_refuses_all_of_another_key_ends_its_sentence_before_it_says_who_drives(
    monkeypatch, key_file, twinmill
):
    fleet = fleet_of(drives_by_its_word(1), drives_by_its_word(2))
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    _, _, err = twinmill("swarm", "start", "--robots", "1,2", "--key", key_file)
    assert "brings robots theirs. R01, R02 drive already, by their word, which nobody" in err


def test_a_start_is_not_said_to_have_moved_who_was_told_nothing():
    """Robots of another key get no start from here."""
    fleet, before = fleet_of(drives_by_its_word(2)), robot(1, DRIVING)
    fleet.robots[1] = before
    given = tell.answers(fleet, tell.make_command(VERBS_START), {1, 2})
    untold = frozenset({2})
    begun = tell.Start(0, given, {}, untold=untold)
    said = of_start(begun, drove_before=[1, 2]).sentence
    assert "R02 was told nothing by this start, and drives by somebody else's word" in said
    assert "R01 drove before, and has not confirmed it" in said
    alone = tell.Start(0, given[1:], {}, untold=untold)
    assert of_start(alone).sentence.startswith("NOBODY STARTED") and alone.begun_utime_us is None


@pytest.mark.parametrize("past_instant", [False, True])
def test_a_countdown_that_is_ended_leaves_another_labs_robot_alone(monkeypatch, past_instant):
    """Ctrl-C before any wheel had turned stopped it. Later all that may drive are stopped."""
    fleet, stopped, told = fleet_of(robot(1), drives_by_its_word(2)), [], []
    fleet.addressed = {1}

    def interrupted(*_, **options):
        time.sleep(2 * options["ahead_s"] * past_instant)
        raise KeyboardInterrupt

    monkeypatch.setattr(tell, "start", interrupted)
    monkeypatch.setattr(tell, "stop", lambda _, robots, *__, **___: stopped.append(robots) or [])
    monkeypatch.setattr(swarm, "finish", lambda *given, **_: told.append(given))
    data, voice = {"drove_before": [2]}, Voice()
    options = {"ahead_s": 0.1, "partial": True, "link_timeout_ms": 2000}
    kept = {"data": data, "as_json": True, "heard": lambda _: "", "ends": str, "signals": []}
    ended = swarm._drive(fleet, {1, 2}, "", voice, **kept, **options)
    voice.end(1, [])
    assert stopped == [{1, 2} if past_instant else {1}]
    assert data["left_alone"] == ([] if past_instant else [2])
    left = "R02 was told nothing by this start and is left alone. R02 drives already, by its word"
    assert (left in ended.sentence) != past_instant


def test_a_start_that_is_called_off_tells_nobody_to_stop_who_was_told_nothing(monkeypatch):
    fleet, stopped = fleet_of(robot(1), drives_by_its_word(2)), []
    monkeypatch.setattr(Fleet, "send_signed", lambda *_, **__: None)
    monkeypatch.setattr(tell, "stop", lambda _, robots, *__, **___: stopped.append(robots) or [])
    begun = tell.start(fleet, {1, 2}, "", ahead_s=0.4, partial=False)
    assert begun.called_off and stopped == [{1}] and begun.untold == {2}
    assert "R02 was told nothing by this start and is left alone" in of_start(begun).sentence


@pytest.mark.parametrize(("taken", "untold"), [({1}, set()), (set(), {2}), ({1}, {2})])
def test_whom_a_called_off_start_leaves_alone_stands_in_its_object(monkeypatch, taken, untold):
    """Its sentence left them to another operator, and `left_alone` was empty."""
    fleet, told = fleet_of(robot(1), robot(2)), []
    given = tell.answers(fleet, tell.make_command(VERBS_START), {1, 2})
    out = Dropouts(dict.fromkeys(taken, "taken over"), frozenset(taken))
    begun = tell.Start(0, given, {}, called_off=True, dropouts=out, untold=frozenset(untold))
    monkeypatch.setattr(tell, "start", lambda *_, **__: begun)
    monkeypatch.setattr(swarm, "finish", lambda *given, **_: told.append(given))
    data, voice = {"drove_before": []}, Voice()
    options = {"ahead_s": 0.1, "partial": True, "link_timeout_ms": 2000}
    kept = {"data": data, "as_json": True, "heard": lambda _: "", "ends": str, "signals": []}
    ended = swarm._drive(fleet, {1, 2}, "", voice, **kept, **options)
    voice.end(1, [])
    assert data["left_alone"] == sorted(taken | untold)
    assert ("R01: left to that start." in ended.sentence) == bool(taken)
    assert ("R02 was told nothing by this start and is left alone" in ended.sentence) == bool(
        untold
    )
    assert replace(begun, called_off=False).left_alone == set()


def telemetry(mode: int) -> bytes:
    said = turbopi.telemetry_t()
    said.mode, said.utime_us = mode, time.time_ns() // 1000
    return said.encode()


@pytest.mark.parametrize(
    ("before_s", "modes", "drives"),
    [
        (0.0, [DRIVING], ["R02"]),
        (0.0, [DRIVING, TELEMETRY.MODE_STOPPED], []),  # a stop of somebody else reaches it
        (0.0, [TELEMETRY.MODE_STOPPED, DRIVING, TELEMETRY.MODE_STOPPED], []),  # a late packet
        (GONE_S + 0.1, [DRIVING], []),  # other words of it are heard since
    ],
)
def test_who_drives_besides_is_told_by_what_is_heard_now(before_s, modes, drives):
    """Not by a packet from before a stop that comes after one from behind it."""
    fleet = fleet_of()
    for mode in modes[: max(1, len(modes) - 1)]:
        fleet.bus.hear("R02_TELEMETRY", telemetry(mode))
    fleet.robots[2].recent[-1] = (
        fleet.robots[2].recent[-1]._replace(heard_s=time.monotonic() - before_s)
    )
    coming = modes[1:][-1:]

    def handle_timeout(_):
        time.sleep(0.01)
        for mode in coming or (modes if not before_s else []):
            fleet.bus.hear("R02_TELEMETRY", telemetry(mode))
        return False

    fleet.bus.handle_timeout = handle_timeout
    assert driving(fleet, {1}) == drives


def test_arming_shows_for_whom_it_waits(monkeypatch, key_file, twinmill):
    """One of three robots was switched off: five seconds without a word."""
    shown = []

    @contextmanager
    def telling(words):
        shown.append(words)
        yield

    monkeypatch.setattr(swarm, "telling", telling)
    monkeypatch.setattr(swarm.tell, "arm", lambda *_: [])
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet_of(robot(1)))
    twinmill("swarm", "arm", "--robots", "1,3", "--key", key_file)
    assert shown == ["arming R01, R03, up to 5 s until each has answered"]


def test_who_selects_in_anothers_countdown_is_told_first_that_it_may_not_be_played(
    monkeypatch, key_file, twinmill
):
    """It was told last, in the robots' answers, once all had chosen."""
    fleet = fleet_of(waiting := robot(1), robot(2))
    hold(fleet, 1)
    told = []
    monkeypatch.setattr(swarm, "say", told.append)
    monkeypatch.setattr(swarm.tell, "tell", lambda *_, **__: told.append("chosen") or [])
    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, **__: fleet)
    twinmill("swarm", "select", "diffusing", "--robots", "1,2", "--key", key_file)
    sentence, chosen = told
    assert sentence.startswith("R01 may not play diffusing: ") and chosen == "chosen"
    waiting.link.mode = DRIVING
    assert "may not play" not in of_countdown([waiting], "diffusing")


def test_a_robot_whose_fault_keeps_it_standing_is_not_said_to_drive():
    """It was started without its camera, and no wheel has turned."""
    held = robot(1, DRIVING)
    held.telemetry.mode = MODES.index("fault")
    hold(fleet_of(held), 1)
    said = of_busy([held])
    assert "R01 stands still in a fault" in said and "held by another operator or terminal" in said
    assert "drives already" not in said


@pytest.mark.parametrize("verb", ["status", "arm", "select"])
@pytest.mark.parametrize(
    ("timeout_ms", "is_held", "who"),
    [
        (0, False, "untethered"),
        (2000, True, "held by another operator or terminal"),
        (2000, False, "and no operator is heard who holds them"),
    ],
)
def test_who_waits_for_a_start_is_named_to_whoever_asks(
    monkeypatch, key_file, twinmill, verb, timeout_ms, is_held, who
):
    """Its operator was killed in the count: "All are armed.", and wheels turned 5 s later."""
    fleet = fleet_of()

    def look(*_, **__):
        fleet.robots = {i: waits(i, timeout_ms) for i in (1, 2)}
        for known in fleet.robots.values() if is_held else ():
            known.hold_s = known.other_hold_s = time.monotonic() + 60
        return fleet

    def obeyed(*_, **__):
        look()
        answer = tell.Answer(1, True, True, "", "stopped", False, False, [])
        return [answer, replace(answer, robot_id=2)]

    for module in (swarm, swarm_door):
        monkeypatch.setattr(module, "Fleet", look)
    monkeypatch.setattr(swarm.tell, "tell", obeyed)
    monkeypatch.setattr(swarm.tell, "arm", obeyed)
    monkeypatch.setattr(swarm, "RUN_PERIOD_S", 1.0)
    words = {"status": ["--once"], "arm": [], "select": ["diffusing"]}[verb]
    says = f"R01, R02 stand still, wait for a start and begin by themselves, {who}."
    for more in ([], ["--json"]):
        _, out, _ = twinmill("swarm", verb, *words, "--key", key_file, *more)
        assert says in (json.loads(out)["sentence"] if more else " ".join(out.split()))
    told = look().robots[1].to_json()
    assert (told["awaits_start"], told["stands"], told["tethered"]) == (True, False, timeout_ms > 0)
    assert told["alarms"] == ["waits for a start and begins by itself"]


def waits(robot_id: int, link_timeout_ms: int) -> Robot:
    """One that has obeyed a start whose instant is to come."""
    known = robot(robot_id, link_timeout_ms=link_timeout_ms)
    known.link.stands, known.link.status_flags = 1, TELEMETRY.STATUS_AWAITS_START
    return known


def test_who_waits_for_another_start_has_confirmed_no_stop():
    """It had, and was armed and told to start again before the stop had ended."""
    known, command = waits(1, 0), tell.make_command(tell.VERBS.VERB_STOP)
    ack = turbopi.signed_ack_t()
    ack.session, ack.session_us, ack.accepted, ack.stands = SESSION, 500, True, True
    known.signed_acks[command.seq], known.link.session_us = ack, 600
    assert not known.confirms(command.seq)
    known.link.status_flags = 0
    assert known.confirms(command.seq)


def test_who_drives_until_its_next_start_is_told_to_drive():
    """Until its instant a start changes nothing."""
    known = waits(1, 0)
    known.link.mode = known.telemetry.mode = DRIVING
    assert of_busy([known]) == "R01 drives already, untethered" and not known.alarms


@pytest.mark.parametrize(
    ("armed", "counter", "may"), [(True, 5, True), (False, 5, False), (True, 0, False)]
)
def test_one_that_was_stopped_or_started_anew_and_told_nothing_since_awaits_no_start(
    armed, counter, may
):
    """Its operator held it and counted nothing."""
    held = robot(1)
    held.link.armed, held.link.counter = armed, counter
    hold(fleet_of(held), 1)
    counting = " that may be counting down to a start" if may else ""
    assert of_busy([held]) == f"R01 stands still, held by another operator or terminal{counting}"


@pytest.mark.parametrize(
    "says", [{"key": bytes(32)}, {"session": SESSION + 1}, {"made_us": -10_000_000}]
)
def test_only_a_hold_of_just_now_with_the_operators_key_counts(says):
    held = robot(1, DRIVING)
    fleet = fleet_of(held)
    hold(fleet, 1, **says)
    assert held.is_held is False
    hold(fleet, 1)
    assert held.is_held is True


def test_status_says_that_nobody_is_heard_who_holds_a_robot(capsys):
    """As after `kill -9` of a tool that told robots to wait for it ten minutes."""
    alone = robot(1, DRIVING, 600_000)
    fleet = fleet_of(alone)
    PlainConsole(width=200).print(status_table([alone]))
    assert "no operator heard (600 s)" in capsys.readouterr().out
    assert alone.to_json()["held"] is False and alone.to_json()["link_timeout_s"] == 600
    hold(fleet, 1)
    PlainConsole(width=200).print(status_table([alone]))
    assert " held" in capsys.readouterr().out and alone.to_json()["held"] is True


def test_a_clock_that_is_odd_is_told_by_status_and_at_both_ends_of_a_start(
    monkeypatch, key_file, twinmill
):
    """The live table alone had shown the 30 s."""
    ahead, right = robot(1), robot(2)
    for known, s in ((ahead, 30.0), (right, 0.0)):
        known.telemetry.utime_us = round((time.time() + s) * 1e6)
        known.recent.append(Step(time.monotonic(), time.time(), known.telemetry))
    fleet = fleet_of(ahead, right)
    monkeypatch.setattr(swarm, "Fleet", lambda *_, **__: fleet)
    monkeypatch.setattr(swarm, "RUN_PERIOD_S", 1.0)
    said = "R01's clock is 30.00 s ahead of this computer's, with which R02 agrees: set its (NTP)."
    code, out, _ = twinmill("swarm", "status", "--once", "--key", key_file)
    assert code == 0 and said in " ".join(out.split())
    for known in (ahead, right):  # both still sign
        known.link.utime_us, known.link_s = time.time_ns() // 1000, time.monotonic()
    code, out, _ = twinmill("swarm", "status", "--once", "--key", key_file, "--json")
    told = json.loads(out)
    assert code == 0 and told["ok"] and told["verb"] == "status"
    assert told["sentence"] == f"Heard: R01, R02. {said}"
    assert swarm.clocks(fleet, {1, 2}) == said and swarm.clocks(fleet, {2}) == ""
    answer, _ = tell.answers(fleet, tell.make_command(VERBS_START), {1, 2})
    assert answer.to_json()["clock_ahead_s"] == pytest.approx(30, abs=0.01)


def test_a_script_that_is_not_here_is_said_before_what_else_is_missing(
    monkeypatch, tmp_path, key_file, twinmill
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(characterise, "Fleet", lambda *_, **__: fleet_of(robot(1)))
    words = ["--robot", "1", "--out", "run.lcmlog", "--key", key_file]
    code, _, err = twinmill("characterise", "--script", "missing.csv", *words)
    assert code == 1 and "missing.csv: no such script here" in err and "no pose" in err
    (tmp_path / "there.csv").write_text("t_s,speed_input,turn_input\n0,0,0\n1,0,0\n")
    code, _, err = twinmill("characterise", "--script", "there.csv", *words, "--force")
    assert code == 1 and "no such script" not in err and "no pose" in err
