# SPDX-License-Identifier: Apache-2.0
"""twin/app on a live bus: LCM's own logger and player, in a network of their own."""

import os
import shutil
import subprocess
import sys
from contextlib import contextmanager

import lcm
import pytest
import turbopi

TWIN_RUN = os.environ.get("TWIN_RUN", "")
# A network without any other machine, in which multicast stays on the loopback device.
PRIVATE_NETWORK = (
    "ip link set lo up && ip link set lo multicast on && "
    'ip route add 224.0.0.0/4 dev lo && exec "$@"'
)
# Debian's tools: the wrappers of the same name in a Python environment outlive a signal.
PATH = os.pathsep.join([os.defpath, "/usr/sbin", "/sbin"])
OPERATOR = """
import sys, time
from pathlib import Path
from twinmill.robots import tell
from twinmill.robots.fleet import Fleet
from twinmill.robots.key import load_or_make

fleet = Fleet(sys.argv[1], key=load_or_make(Path(sys.argv[2])))
Path(sys.argv[3]).touch()
fleet.listen(30, lambda: len(fleet.here()) == 4)
tell.tell(fleet, tell.make_command(2, "diffusing"), {0, 1, 2, 3}, until_s=time.monotonic() + 5)
"""
# Waits for a logger that takes messages, and until its socket holds none: port 7667 of the network.
SUBSCRIBED = "until grep -q :1DF3 /proc/net/udp; do sleep 0.05; done"
TAKEN = "while grep :1DF3 /proc/net/udp | grep -qv ' ........:00000000 '; do sleep 0.05; done"
SETTLE_S = 0.5  # for what a logger took from its socket to reach its file


def in_private_network(*command):
    unshare = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--net", "--map-root-user"]
    return subprocess.run(
        [*unshare, "sh", "-c", PRIVATE_NETWORK, "sh", *command],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PATH": PATH},
    )


@pytest.fixture(scope="module", autouse=True)
def needs():
    if not TWIN_RUN:
        pytest.skip("TWIN_RUN does not name the program")
    programs = ("lcm-logger", "lcm-logplayer", "ip", "unshare")
    missing = [name for name in programs if not shutil.which(name, path=PATH)]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    tried = in_private_network("true")
    if tried.returncode:
        pytest.skip(f"no network namespaces here: {tried.stderr.strip()}")


@contextmanager
def logging_to(log):
    """Commands for the shell of one private network, while lcm-logger writes there."""
    lines = [f"lcm-logger --quiet {log} & logger=$!", SUBSCRIBED]
    yield lines
    lines += [TAKEN, f"sleep {SETTLE_S}", "kill -TERM $logger", "wait $logger || true"]


def events(log):
    """(channel, bytes) of a log in its order, without what LCM says to itself before it listens."""
    said = [(e.channel, e.data) for e in lcm.EventLog(str(log), "r")]
    return [event for event in said if event[0] != "LCM_SELF_TEST"]


def said_in_order(some, all_of_them):
    """True if some events are among others in the same order: a busy machine's socket overflows."""
    left = iter(all_of_them)
    return all(event in left for event in some)


def in_one_network(lines):
    script = "set -e\n" + "\n".join(lines)
    done = in_private_network("sh", "-c", script)
    assert done.returncode == 0, done.stderr


def test_lcm_logger_hears_what_twin_run_logs_and_lcm_logplayer_says_it_again(tmp_path):
    own, heard, again = (tmp_path / name for name in ("own", "heard", "again"))
    bus = "udpm://239.255.76.67:7667?ttl=0"
    with logging_to(heard) as first:
        first.append(
            f"{TWIN_RUN} --plant planar --model turbopi.toml --n 3 --duration-s 2 "
            f"--log {own} --lcm-url '{bus}'"
        )
    with logging_to(again) as second:
        # Slowly: a socket holds some 300 messages, and a busy machine lets the logger wait.
        second.append(f"lcm-logplayer --speed=0.5 {heard}")
    in_one_network([*first, *second])
    said = events(own)
    # 3 robots: telemetry, link, pose, run, truth
    assert len({channel for channel, _ in said}) == 15
    first, second = events(heard), events(again)
    assert said_in_order(first, said) and said_in_order(second, first)
    assert {channel for channel, _ in second} == {channel for channel, _ in said}


def test_malformed_command_does_not_end_twin_run(tmp_path):
    command = turbopi.swarm_command_t()
    command.robot_id, command.behavior = -1, "orbit"
    whole = command.encode()
    at = len(whole) - len("orbit\0") - 4  # the text's length, big-endian
    bad = tmp_path / "bad"
    log = lcm.EventLog(str(bad), "w")
    for i, length in enumerate((0, -1, 5, 7, 2**31 - 1)):
        data = whole[:at] + length.to_bytes(4, "big", signed=True) + whole[at + 4 :]
        log.write_event(i * 10_000, "SWARM_COMMAND", data)
    log.write_event(100_000, "SWARM_COMMAND", whole[:20])
    log.close()
    bus = "udpm://239.255.76.67:7667?ttl=0"
    in_one_network(
        [
            f"{TWIN_RUN} --plant planar --n 2 --duration-s 2 --lcm-url '{bus}' & twin=$!",
            SUBSCRIBED,
            f"lcm-logplayer {bad}",
            "wait $twin",
        ]
    )


def test_selected_behaviour_reaches_the_robots_own_program(tmp_path):
    """Robots 0 and 1 are driven by the program, 2 and 3 by the built-in firmware."""
    own, key, ready = (tmp_path / name for name in ("own", "key", "ready"))
    bus = "udpm://239.255.76.67:7667?ttl=0"
    operator = tmp_path / "run_operator.py"
    operator.write_text(OPERATOR)
    in_one_network(
        [
            f"{sys.executable} {operator} '{bus}' {key} {ready} & operator=$!",
            f"until [ -e {ready} ]; do sleep 0.05; done",
            f"{TWIN_RUN} --plant planar --sensor camera --n 4 --hil 2 --spread-m 0.8 --key {key} "
            f"--duration-s 8 --log {own} --lcm-url '{bus}'",
            "wait $operator",
        ]
    )
    acks, rows = {}, {}
    for channel, data in events(own):
        if channel[3:] == "_ACK":
            acks.setdefault(channel[:3], turbopi.ack_t.decode(data))
        elif channel.endswith("_TELEMETRY") and channel[:3] in acks:
            said = turbopi.telemetry_t.decode(data)
            duties = tuple(said.wheel_duty_pct)
            rows.setdefault(said.robot_id >= 2, {}).setdefault(said.detected, set()).add(duties)
    assert sorted(acks) == ["R00", "R01", "R02", "R03"] and all(a.accepted for a in acks.values())
    program, built_in = rows[False], rows[True]
    assert set(program) & set(built_in), "no bit that both kinds saw"
    for bit, duties in program.items():
        assert len(duties) == 1  # of the first frame on
        assert bit not in built_in or duties == built_in[bit]
    # Milling would turn on the way: 37 and 100 %.
    assert all(37 not in map(abs, row) for duties in program.values() for row in duties)
