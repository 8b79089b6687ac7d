# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm stop` where nobody answers: a person sees at once what it waits for."""

import os
import signal
import time

from twinmill_cli import swarm


def test_a_stop_that_nobody_hears_says_at_once_what_it_waits_for(monkeypatch, tmp_path, twinmill):
    monkeypatch.setenv("HOME", str(tmp_path))
    begin_s, said_s = time.monotonic(), []
    words = swarm._waiting_words

    def timed(*given):
        said_s.append(time.monotonic() - begin_s)
        return words(*given)

    monkeypatch.setattr(swarm, "_waiting_words", timed)
    url = "udpm://239.255.76.67:7999?ttl=0"
    code, out, _ = twinmill("swarm", "stop", "--lcm-url", url, "--timeout-s", "2")
    assert code == 1 and len(said_s) == 1 and said_s[0] < 1.5
    assert "No robot was heard" in out and "--host" in out


def test_a_stop_outlives_the_terminal_that_it_came_from(monkeypatch, tmp_path, twinmill):
    """As where ssh breaks off while robots out of reach have not yet signed."""
    monkeypatch.setenv("HOME", str(tmp_path))
    ended = []
    monkeypatch.setattr(swarm, "_waiting_words", lambda *_: os.kill(os.getpid(), signal.SIGHUP))
    before = signal.signal(signal.SIGHUP, lambda *_: ended.append("hung up"))
    try:
        code, out, _ = twinmill("swarm", "stop", "--lcm-url", "memq://", "--timeout-s", "2")
        assert code == 1 and "No robot was heard" in out and not ended
        os.kill(os.getpid(), signal.SIGHUP)
        assert ended == ["hung up"]
    finally:
        signal.signal(signal.SIGHUP, before)


def test_who_never_commanded_a_robot_gets_no_key_by_stopping_or_looking(
    monkeypatch, tmp_path, twinmill
):
    """A new key is no robot's: it would say nothing but that none signs with it."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    url = "udpm://239.255.76.67:7999?ttl=0"
    for words in (["stop", "--timeout-s", "0.5"], ["status", "--once"]):
        code, _, err = twinmill("swarm", *words, "--lcm-url", url)
        assert code == 1 and "there is no key here" in err
    assert not list(tmp_path.rglob("*.key"))


def test_a_word_that_nobody_reads_keeps_no_stop_waiting():
    """A pipe that is full, as of a pager, takes nothing more."""
    reads, writes = os.pipe()
    os.set_blocking(writes, False)
    full = 0
    while full < 2**20:
        try:
            full += os.write(writes, b"x" * 4096)
        except BlockingIOError:
            break
    os.set_blocking(writes, True)
    kept = os.dup(2)
    os.dup2(writes, 2)
    try:
        with swarm.saying_nothing() as say:
            say("stop is said")
    finally:
        os.dup2(kept, 2)
    for handle in (reads, writes, kept):
        os.close(handle)
