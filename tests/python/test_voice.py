# SPDX-License-Identifier: Apache-2.0
"""Words of a command that moves robots keep nobody waiting, and are missed when they fail."""

import io
import json
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from contextlib import suppress

import pytest

from twinmill.defaults import URL
from twinmill.robots import tell
from twinmill.robots.fleet import Fleet
from twinmill.terminal import PlainConsole
from twinmill_cli import swarm_signals
from twinmill_cli.swarm_signals import ENDING, HARMLESS, OF_FAULTS, commanding, ended_by_signals
from twinmill_cli.voice import Voice

BLOCKED_S = 0.3
WRITTEN = 1_000_000  # bytes: far more than a pipe holds


class SilentBus:
    """Nobody speaks; what is said is counted."""

    def __init__(self, _=""):
        self.said, self.closed = 0, False

    def close(self):
        self.closed = True

    def subscribe(self, *_):
        pass

    def publish(self, *_):
        self.said += 1

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False


@pytest.fixture
def voice():
    voice = Voice()
    yield voice
    voice.end(0)


def wait_until_idle(voice):
    end_s = time.monotonic() + 10
    while not voice.is_idle and time.monotonic() < end_s:
        time.sleep(0.01)


def test_a_reader_that_is_gone_silences_no_other_sentence(monkeypatch, capfd):
    """Rich leaves its program where a pipe breaks: that would be the writer's thread alone."""
    reads, writes = os.pipe()
    os.close(reads)
    voice = Voice()
    with os.fdopen(writes, "w", closefd=False) as pipe:
        voice.tell(lambda: PlainConsole(file=pipe).print("a table"))
        voice.say("robots stand")
        wait_until_idle(voice)
        voice.end(0)
        with pytest.raises(BrokenPipeError):
            voice.check()
        with pytest.raises(BrokenPipeError):
            pipe.close()
    os.close(writes)
    assert "robots stand" in capfd.readouterr().err


@pytest.mark.parametrize(("number", "where"), [(0, "here"), (1, "inside its container")])
def test_the_number_of_a_program_is_told_with_where_it_is_that(monkeypatch, number, where):
    """Outside a container `kill 1` is for another program."""
    pids = [os.readlink("/proc/self/ns/pid"), "pid:[1]"]
    monkeypatch.setattr(swarm_signals, "MACHINE_PIDS", pids[number])
    monkeypatch.setattr(swarm_signals, "key_reaches", lambda: False)
    assert f"or {where} `kill {os.getpid()}`" in swarm_signals.what_ends(URL, None)


def test_a_command_leaves_the_bus_however_it_ends():
    for error in (None, ValueError("refused"), KeyboardInterrupt()):
        fleet = Fleet("", connect=SilentBus)
        joined = commanding("status", lambda fleet=fleet: fleet, as_json=False)
        with suppress(ValueError, KeyboardInterrupt), joined:
            assert not fleet.bus.closed
            if error:
                raise error
        assert fleet.bus.closed


def test_who_gives_words_never_waits_until_they_are_written(voice):
    """As at a halted terminal: the writer blocks in a pipe until somebody reads it."""
    reads, writes = os.pipe()
    begin_s = time.monotonic()
    voice.tell(lambda: os.write(writes, bytes(WRITTEN)))
    voice.say("another word")
    assert time.monotonic() - begin_s < BLOCKED_S and not voice.is_idle
    time.sleep(BLOCKED_S)
    assert not voice.is_idle
    left = WRITTEN
    while left:
        left -= len(os.read(reads, left))
    wait_until_idle(voice)
    assert voice.is_idle
    os.close(reads)
    os.close(writes)
    voice.check()


def test_words_that_fail_are_noticed_and_those_behind_them_are_told(voice):
    told = []

    def full():
        raise OSError(28, "No space left on device")

    voice.tell(full)
    voice.tell(lambda: told.append("all stand"))
    wait_until_idle(voice)
    assert told == ["all stand"]
    with pytest.raises(OSError, match="No space left"):
        voice.check()


@pytest.fixture
def streams(monkeypatch):
    """Stands for stdout and stderr: gives both ends of two pipes, by what kind of file they are."""
    opened = []

    def make(*kinds):
        ends = []
        for kind in kinds:
            pair = os.pipe() if kind == "pipe" else (-1, os.open(kind, os.O_WRONLY))
            ends.append(pair)
        opened.extend(ends)
        monkeypatch.setattr("twinmill_cli.voice.STREAMS", [writes for _, writes in ends])
        return [reads for reads, _ in ends]

    yield make
    for _, writes in opened:
        os.close(writes)


def test_robots_are_held_until_both_streams_have_lost_their_reader(streams, voice):
    """As an ssh without a terminal that breaks: no signal comes, and nothing is read at its end."""
    stdout, stderr = streams("pipe", "pipe")
    voice.check_listener()
    os.close(stdout)  # as of `| head -1`: who watches stderr is told
    voice.check_listener()
    os.close(stderr)
    with pytest.raises(OSError, match="nobody reads"):
        voice.check_listener()


@pytest.mark.parametrize("kind", [os.devnull, "/proc/self/comm"])
def test_what_needs_no_reader_has_lost_none(streams, voice, kind):
    """A job of a script, `>/dev/null 2>&1 &`, or one that writes into a file."""
    streams(kind, kind)
    voice.check_listener()
    (pipe, _) = streams("pipe", kind)
    os.close(pipe)
    voice.check_listener()


def test_a_table_that_cannot_be_drawn_is_noticed(voice):
    """It had gone on as a picture of the moment at which its thread ended."""

    class Broken:
        def __rich_console__(self, *_):
            raise KeyError("broken")

    voice._console = PlainConsole(file=io.StringIO(), force_terminal=True)
    voice.show(Broken)
    wait_until_idle(voice)
    with pytest.raises(ValueError, match="broken"):
        voice.check()


def test_signals_end_waiting_and_no_stop():
    """A second Ctrl-C, too, leaves the stop to be said to its end."""
    fleet, rang = Fleet("", connect=SilentBus, key=bytes(32)), []

    def ring():
        rang.append(os.kill(os.getpid(), signal.SIGINT))

    with ended_by_signals(fleet, lambda: None):
        ring()
        with pytest.raises(KeyboardInterrupt):
            fleet.listen(5)
        said = fleet.bus.said
        begin_s = time.monotonic()
        given = tell.stop(fleet, {1}, timeout_s=0.5, waiting=lambda _: ring())
    assert time.monotonic() - begin_s >= 0.5 and len(rang) == 2
    assert fleet.bus.said > said + 5 and not given[0].stands
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


# Gives each signal to a process that has changed nothing, and prints by which it ends or halts.
FATES = """
import json, os, signal, time
signals, fated = sorted(signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}), []
for number in signals:
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)  # a group without a parent outside it cannot be halted (POSIX)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        os._exit(0)
    status = os.waitpid(child, os.WUNTRACED)[1]
    if os.WIFSTOPPED(status):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    fated += [number] if status else []
print(json.dumps(fated))
"""


def test_every_signal_that_ends_or_halts_a_program_stops_its_robots_first():
    """By the kernel's word. Python ignores two of them; a stop of who writes is ignored, too."""
    command = ["bash", "-c", 'ulimit -c 0; exec "$@"', "bash", sys.executable, "-c", FATES]
    fated = {*json.loads(subprocess.check_output(command))}
    known = {signal.SIGPIPE, signal.SIGXFSZ, signal.SIGTTOU}
    assert {*ENDING} | OF_FAULTS == fated - known and not HARMLESS & (fated - known)


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGSTKFLT, signal.SIGRTMAX])
def test_a_signal_that_nobody_expects_ends_waiting(number):
    fleet = Fleet("", connect=SilentBus, key=bytes(32))
    with ended_by_signals(fleet, lambda: None) as asked:
        signal.pthread_kill(threading.get_ident(), number)
        with pytest.raises(KeyboardInterrupt):
            fleet.listen(5)
        signal.pthread_kill(threading.get_ident(), number)  # comes too late to end anything
    assert asked == [number, number]


def test_a_name_that_is_looked_up_for_long_keeps_no_stop_waiting(monkeypatch):
    monkeypatch.setattr("socket.gethostbyname", lambda _: time.sleep(2))
    fleet = Fleet("", connect=SilentBus)
    begin_s = time.monotonic()
    tell.stop(fleet, {1}, timeout_s=0.5, hosts=tell.Hosts(["robot03.local"]))
    assert time.monotonic() - begin_s < 1.5 and fleet.bus.said > 5


@pytest.mark.parametrize(
    ("words", "out", "err"),
    [
        ("Voice(); os.close(9)", "", "twinmill: NOT ALL STAND.\n"),
        ("Voice(); os.dup2(9, 2)", "twinmill: NOT ALL STAND.\n", ""),
        ("Voice(as_json=True); os.dup2(9, 2)", "", ""),
    ],
)
def test_what_stderr_would_lose_is_said_on_stdout_unless_an_object_is_there(words, out, err):
    """As `2>/dev/null`, which a script has for other words."""
    make, before = words.split("; ")
    code = (
        "import os\nfrom twinmill_cli.voice import Voice\n"
        f"os.dup2(os.open(os.devnull, os.O_WRONLY), 9)\n{before}\n"
        f"voice = {make}\nvoice.say('NOT ALL STAND.')\nvoice.end(0)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.stdout, ended.stderr) == (out, err)


TOLD_LAST = (
    "from twinmill_cli.voice import Voice; voice = Voice(); voice.say('All stand.'); voice.end(7)"
)


def test_a_terminal_that_is_halted_does_not_keep_a_command_from_its_end():
    """By Ctrl-S, whose effect termios(3) has; nobody presses Ctrl-Q, and the last word is read."""
    keyboard, far = pty.openpty()
    os.write(keyboard, b"\x13")
    assert not select.select([], [far], [], 0.1)[1]
    command = ["setsid", "--ctty", sys.executable, "-c", TOLD_LAST]
    ended = subprocess.run(command, stdin=far, stdout=far, stderr=far, timeout=20)
    os.close(far)
    assert ended.returncode == 0 and b"All stand." in os.read(keyboard, 1000)
    os.close(keyboard)


def test_a_reader_that_reads_nothing_does_not_keep_a_command_from_its_end():
    """A full pipe, which no program can empty but its reader; the exit code tells all the same."""
    reads, writes = os.pipe()
    os.set_blocking(writes, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writes, bytes(4096))
    os.set_blocking(writes, True)
    ended = subprocess.run([sys.executable, "-c", TOLD_LAST], stderr=writes, timeout=20)
    assert ended.returncode == 7
    os.close(reads)
    os.close(writes)


WHAT_ENDS = (
    "from twinmill_cli.swarm_signals import what_ends; "
    "print(what_ends('udpm://239.255.76.67:7668?ttl=1', 'TWIN_'), flush=True)"
)


def _asked_at_a_terminal(change) -> str:
    """Words on stopping robots, at a terminal of its own that was changed before."""
    keyboard, far = pty.openpty()
    change(far)
    command = ["setsid", "--ctty", sys.executable, "-c", WHAT_ENDS]
    ended = subprocess.run(command, stdin=far, stdout=subprocess.PIPE, text=True)
    os.close(far)
    os.close(keyboard)
    return ended.stdout


def _take_keys(far) -> None:
    modes = termios.tcgetattr(far)
    modes[3] &= ~termios.ISIG
    termios.tcsetattr(far, termios.TCSANOW, modes)


def test_ctrl_c_is_named_only_where_it_comes_to_the_program():
    """By setsid(2) there is no terminal; by ISIG, of termios(3), its keys end nothing."""
    assert _asked_at_a_terminal(lambda _: None).startswith("Ctrl-C stops them")
    ended = subprocess.run(
        [sys.executable, "-c", WHAT_ENDS], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    for said in (_asked_at_a_terminal(_take_keys), ended.stdout):
        assert "No Ctrl-C reaches this command" in said and "`kill " in said
        url = "--lcm-url 'udpm://239.255.76.67:7668?ttl=1' --channel-prefix TWIN_"
        assert f"`twinmill swarm stop {url}`" in said
