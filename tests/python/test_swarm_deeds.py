# SPDX-License-Identifier: Apache-2.0
"""Last words of a command to robots follow from what it did, whatever fails, and where."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest
import turbopi

from twinmill.robots import tell
from twinmill.robots.fleet import Fleet, Robot
from twinmill_cli import done, swarm, swarm_door, swarm_stop
from twinmill_cli.output import unstopped
from twinmill_cli.swarm_signals import counting_signals
from twinmill_cli.voice import Voice

KEY = bytes(range(32))
UNTRUE = ("Nothing was said", "NOTHING WAS STOPPED", "nothing was started", "nothing was said")
PROGRAM = [sys.executable, "-m", "twinmill_cli.main"]


class Bus:
    """A network of which nothing comes."""

    def subscribe(self, *_):
        pass

    def publish(self, *_):
        pass

    def close(self):
        pass

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False


@pytest.fixture
def fleet(monkeypatch):
    """One robot, which obeys whatever it is told."""
    fleet = Fleet("", connect=lambda _: Bus(), key=KEY)
    link, telemetry = turbopi.link_t(), turbopi.telemetry_t()
    telemetry.utime_us = link.utime_us = time.time_ns() // 1000
    now_s = time.monotonic()
    known = Robot(1, telemetry=telemetry, heard_s=now_s + 60, link=link, link_s=now_s + 60)
    fleet.robots = {1: known}
    standing = tell.Answer(1, True, True, "", "stopped", True, False, [])

    def start(fleet, robots, *_, **__):
        fleet.addressed |= robots
        driving = tell.Answer(1, True, True, "", "running", False, False, [], link_timeout_s=0)
        return tell.Start(0, [driving], {1: 0}, link_timeout_ms=0)

    monkeypatch.setattr(tell, "start", start)
    monkeypatch.setattr(tell, "stop", lambda *_, **__: [standing])
    for module in (swarm_door, swarm_stop):
        monkeypatch.setattr(module, "Fleet", lambda *_, **__: fleet)
    return fleet


def fail(*_, **__):
    raise TypeError("injected")


def one_object(out: str) -> dict:
    """Object that is printed with --json; fails where that is two objects, or none."""
    (line,) = out.splitlines()
    return json.loads(line)


@pytest.mark.parametrize("where", ["tell.stop", "driving", "of_stop", "beside_all", "finish"])
@pytest.mark.parametrize("json_words", [[], ["--json"]], ids=["text", "json"])
def test_a_stop_that_fails_after_it_was_said_never_says_that_nothing_was_stopped(
    monkeypatch, fleet, key_file, twinmill, where, json_words
):
    """A handler that could not be put back had made "NOTHING WAS STOPPED" of "All stand."."""
    monkeypatch.setattr(f"twinmill_cli.swarm_stop.{where}", fail)
    code, out, err = twinmill("swarm", "stop", "--robots", "1", "--key", key_file, *json_words)
    assert code == 1 and "injected" in err and not any(words in out + err for words in UNTRUE)
    known = "R01 stands." if where == "finish" else "who obeyed it is not known: SWITCH OFF BY HAND"
    assert known in err
    if json_words:
        told = one_object(out)
        assert not told["ok"] and known in told["sentence"]


@pytest.mark.parametrize("where", [(Voice, "end"), (Voice, "check")], ids=["end", "check"])
def test_a_stop_that_fails_once_it_was_told_stays_as_it_was_told(
    monkeypatch, fleet, key_file, twinmill, where
):
    end = Voice.end

    def fail_once_told(voice, *given):
        end(voice, *given) if given else None
        fail()

    monkeypatch.setattr(*where, fail_once_told)
    code, out, err = twinmill("swarm", "stop", "--robots", "1", "--key", key_file, "--json")
    assert one_object(out)["ok"] and code == 0
    assert "injected" in err and done.STAYS_TRUE in err
    assert not any(words in err for words in UNTRUE)


@pytest.mark.parametrize(
    ("where", "known"),
    [
        ("of_start", "All stand"),  # nobody knew how it began, so it was stopped
        ("finish", "All stand."),  # nobody could be told, so it was stopped
        ("of_end", "may drive: `twinmill swarm stop` stops them"),
        ("refuse_deleted", done.STAYS_TRUE),
        ("Fleet.close", done.STAYS_TRUE),
    ],
)
def test_a_start_that_fails_says_what_became_of_the_robots(
    monkeypatch, fleet, key_file, twinmill, where, known
):
    """The last sentence had been "Nothing was said to any robot", and all drove."""
    monkeypatch.setattr(f"twinmill_cli.swarm.{where}", fail)
    if where == "of_end":  # as the stop is judged that another failure brings
        monkeypatch.setattr(swarm, "of_start", fail)
    words = ["start", "--untethered", "--robots", "1", "--key", key_file, "--json"]
    code, out, err = twinmill("swarm", *words)
    told = one_object(out)
    assert "injected" in err and not any(words in out + err for words in UNTRUE)
    assert known in (err if where != "of_start" else told["sentence"])
    assert told["ok"] == (code == 0) == (known == done.STAYS_TRUE)


@pytest.mark.parametrize("verb", [["arm"], ["select", "milling"]], ids=lambda v: v[0])
def test_what_else_fails_after_robots_were_told_says_so(
    monkeypatch, fleet, key_file, twinmill, verb
):
    def tell_and_fail(fleet, _, robots, **__):
        fleet.addressed |= robots
        fail()

    monkeypatch.setattr(tell, "tell", tell_and_fail)
    code, out, err = twinmill("swarm", *verb, "--robots", "1", "--key", key_file, "--json")
    assert code == 1 and not one_object(out)["ok"] and "Robots were told" in err
    assert not any(words in out + err for words in UNTRUE)


def test_before_anybody_was_told_anything_a_failure_says_that(
    monkeypatch, fleet, key_file, twinmill
):
    monkeypatch.setattr(swarm_stop, "_say_first", fail)
    _, _, err = twinmill("swarm", "stop", "--key", key_file)
    assert "NOTHING WAS STOPPED: switch off by hand" in err
    monkeypatch.setattr(tell, "find", fail)
    _, _, err = twinmill("swarm", "start", "--key", key_file)
    assert "Nothing was said to any robot." in err


@pytest.mark.parametrize("name", ["PYTHONFAULTHANDLER", "PYTHONDEVMODE"])
def test_a_stop_ends_as_ever_where_python_has_handlers_that_are_not_its_own(tmp_path, name):
    """Python gives none of them back (signal.getsignal), and takes none."""
    words = ["--lcm-url", "memq://", "--timeout-s", "0.5", "--json"]
    environment = {**os.environ, name: "1", "XDG_CONFIG_HOME": str(tmp_path)}
    ended = subprocess.run(
        [*PROGRAM, "swarm", "stop", *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    told = one_object(ended.stdout)
    assert ended.returncode == 1 and "No robot was heard" in told["sentence"]
    assert not any(words in ended.stdout + ended.stderr for words in UNTRUE)
    assert "signal handler must be" not in ended.stderr


def test_handlers_are_put_back_where_they_can_be(monkeypatch):
    """One that is not Python's comes as None (signal.signal), and SIG_DFL stands for it."""
    real, given = signal.signal, {}

    def set_handler(number, handler):
        given[number] = handler
        before = real(number, handler)
        return None if before is signal.SIG_DFL else before

    was = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(signal, "signal", set_handler)
    try:
        with counting_signals() as asked:
            os.kill(os.getpid(), signal.SIGABRT)
        with unstopped():
            pass
    finally:
        monkeypatch.undo()
    assert asked == [signal.SIGABRT]
    assert given[signal.SIGABRT] is signal.SIG_DFL and signal.getsignal(signal.SIGINT) is was


def test_a_signal_that_the_starter_had_blocked_asks_for_the_end_as_well():
    """A blocked signal stays pending (sigprocmask(2)), and robots would drive on."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    try:
        with counting_signals() as asked:
            os.kill(os.getpid(), signal.SIGUSR1)
        assert asked == [signal.SIGUSR1]
        assert signal.SIGUSR1 in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# A program at a terminal of its own, whose stdout and stderr lead to a reader that ends as it does.
AT_TERMINAL = """
import os, signal, sys
reads, writes = os.pipe()
for stream in (1, 2)[: int(sys.argv[1])]:
    os.dup2(writes, stream)
os.close(writes)
from twinmill_cli.voice import Voice
from twinmill_cli.output import say
voice, late = Voice(), sys.argv[2] == "late"
if sys.argv[2] == "plain":
    os.close(reads)
    say("All stand.")
    sys.exit()
if not late:
    os.close(reads)
voice.say_outcome("All stand.")
while not voice.is_idle:
    pass
if late:
    os.close(reads)
voice.end(0)
voice.check(signals=[signal.SIGINT])
"""


def at_terminal(*words: str) -> tuple[int, str]:
    """Exit code of that program, and what its terminal shows."""
    screen, far = pty.openpty()
    program = ["setsid", "--ctty", sys.executable, "-c", AT_TERMINAL, *words]
    ended = subprocess.Popen(program, stdin=far, stdout=far, stderr=far)
    os.close(far)
    shown = b""
    with suppress(OSError):  # the program has ended
        while got := os.read(screen, 4096):
            shown += got
    os.close(screen)
    return ended.wait(20), shown.decode()


@pytest.mark.parametrize("when", ["early", "late", "plain"])
def test_what_became_of_robots_is_said_at_the_terminal_where_ctrl_c_ended_the_reader_too(when):
    """As by `2>&1 | tee log`: it was told nowhere, and the code was 1 whatever became of them."""
    assert at_terminal("2", when) == (0, "twinmill: All stand.\r\n")


def test_without_a_terminal_the_code_alone_tells():
    program = [sys.executable, "-c", AT_TERMINAL, "2", "early"]
    assert subprocess.run(program, start_new_session=True, timeout=20).returncode == 0
