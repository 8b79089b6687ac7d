# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C reaches a command that holds robots whatever was typed before it, by the kernel's word."""

import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time

import pytest

from twinmill.defaults import URL
from twinmill_cli import swarm_signals

HOLD = """
import os, signal, sys, time
from twinmill.robots.fleet import Fleet
from twinmill_cli.ctrl_c import kept_free
from twinmill.defaults import URL
from twinmill_cli.swarm_signals import WhatEnds, ended_by_signals

class Bus:
    def subscribe(self, *_): pass
    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False

fleet = Fleet("", connect=lambda _: Bus())
if "before" in sys.argv:  # keys are typed
    print("up", flush=True)
    sys.stdin.readline()
if "behind" in sys.argv and not os.fork():  # another has the terminal
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    os.tcsetpgrp(0, os.getpgrp())
    time.sleep(10)
    os._exit(0)
while "behind" in sys.argv and os.tcgetpgrp(0) == os.getpgrp():
    time.sleep(0.01)
ends = WhatEnds(URL, None, lambda words: print("news:", words, flush=True))
try:
    with ended_by_signals(fleet, ends.look), kept_free(fleet):
        print("holds:", ends(), flush=True)
        fleet.listen(5)
    print("nothing came")
except KeyboardInterrupt:
    print("ended by Ctrl-C")
"""
CTRL_V, CTRL_C = b"\x16", b"\x03"
TERMINAL_HAS = 4096  # N_TTY_BUF_SIZE of Linux's drivers/tty/n_tty.c
PASTE = b"a line\n" * (2 * TERMINAL_HAS // 7)


class Terminal:
    """That program at a terminal of its own.

    Args:
        words: of its command line.
    """

    def __init__(self, *words: str):
        self.keyboard, self.far = pty.openpty()
        os.set_blocking(self.keyboard, False)
        self.before = termios.tcgetattr(self.far)
        self.said = b""
        command = ["setsid", "--ctty", sys.executable, "-c", HOLD, *words]
        self.process = subprocess.Popen(command, stdin=self.far, stdout=self.far, stderr=self.far)

    def wait_for(self, words: bytes) -> None:
        while words not in self.said:
            assert self._hear(20), self.said

    def _hear(self, timeout_s: float) -> bool:
        if not select.select([self.keyboard], [], [], timeout_s)[0]:
            return False
        self.said += os.read(self.keyboard, 65536)
        return True

    def type(self, keys: bytes) -> None:
        while keys:
            if select.select([], [self.keyboard], [], 0.1)[1]:
                keys = keys[os.write(self.keyboard, keys[:100]) :]
            self._hear(0)

    def end(self) -> bytes:
        self.process.wait(20)
        while self._hear(0.1):
            pass
        return self.said


@pytest.fixture
def terminal(request):
    opened = Terminal(*getattr(request, "param", ()))
    yield opened
    opened.process.kill()
    opened.process.wait()
    os.close(opened.keyboard)
    os.close(opened.far)


@pytest.mark.parametrize(
    "keys", [b"", CTRL_V, PASTE, PASTE + CTRL_V], ids=["alone", "ctrl_v", "paste", "paste_ctrl_v"]
)
def test_ctrl_c_comes_whatever_was_typed_while_robots_are_held(terminal, keys):
    """By termios(3) Ctrl-V quotes the next key; a terminal that is full of lines takes none."""
    terminal.wait_for(b"holds")
    terminal.type(keys)
    terminal.type(CTRL_C)
    assert b"ended by Ctrl-C" in terminal.end()
    assert termios.tcgetattr(terminal.far) == terminal.before


@pytest.mark.parametrize("terminal", [("before",)], indirect=True)
def test_a_key_that_was_quoted_before_robots_are_held_swallows_none(terminal):
    terminal.wait_for(b"up")
    terminal.type(b"\n" + CTRL_V)
    terminal.wait_for(b"holds")
    terminal.type(CTRL_C)
    assert b"ended by Ctrl-C" in terminal.end()
    assert termios.tcgetattr(terminal.far) == terminal.before


def test_what_stops_the_robots_is_said_anew_once_ctrl_c_does_no_more(terminal):
    """As `stty -F TTY -isig` from elsewhere has it: "Ctrl-C stops them" stayed on the screen."""
    terminal.wait_for(b"holds: Ctrl-C stops them")
    attributes = termios.tcgetattr(terminal.far)
    for isig, words in ((0, b"No Ctrl-C reaches this command: "), (termios.ISIG, b"Ctrl-C stops")):
        attributes[3] = attributes[3] & ~termios.ISIG | isig
        termios.tcsetattr(terminal.far, termios.TCSANOW, attributes)
        terminal.wait_for(b"news: " + words)
    terminal.type(CTRL_C)
    assert b"ended by Ctrl-C" in terminal.end()


def test_a_terminal_that_is_handed_on_and_back_is_no_news(monkeypatch):
    """A shell does so around each of its commands; whoever takes it for long is told of once."""
    now, is_ours, said = [0.0], True, []
    monkeypatch.setattr(swarm_signals, "key_reaches", lambda: is_ours)
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    ends = swarm_signals.WhatEnds(URL, None, said.append)
    ends.look()
    assert ends("calls that off") == "Ctrl-C calls that off" and not said
    for is_ours in [True] * 9 + [False, True] * 9 + [False] * 9:  # noqa: B007 (key_reaches)
        now[0] += swarm_signals.LASTS_S / 2
        ends.look()
    (told,) = said
    assert told.startswith("No Ctrl-C reaches this command") and told.endswith("calls that off.")


@pytest.mark.parametrize("terminal", [("behind",)], indirect=True)
def test_a_terminal_that_another_program_reads_is_left_alone(terminal):
    """As behind `&`: its keys are the shell's."""
    terminal.wait_for(b"holds")
    terminal.process.send_signal(signal.SIGSTOP)  # it has looked
    assert termios.tcgetattr(terminal.far) == terminal.before
