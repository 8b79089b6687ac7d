# SPDX-License-Identifier: Apache-2.0
"""twin/app on a live bus: LCM's own logger and player, in a network of their own."""

import os
import shutil
import subprocess
from contextlib import contextmanager

import lcm
import pytest

TWIN_RUN = os.environ.get("TWIN_RUN", "")
# A network without any other machine, in which multicast stays on the loopback device.
PRIVATE_NETWORK = (
    "ip link set lo up && ip link set lo multicast on && "
    'ip route add 224.0.0.0/4 dev lo && exec "$@"'
)
# Debian's tools: the wrappers of the same name in a Python environment outlive a signal.
PATH = os.pathsep.join([os.defpath, "/usr/sbin", "/sbin"])
SETTLE_S = 0.5  # for a logger to subscribe, and to take what is under way


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
    lines = [f"lcm-logger --quiet {log} & logger=$!", f"sleep {SETTLE_S}"]
    yield lines
    lines += [f"sleep {SETTLE_S}", "kill -TERM $logger", "wait $logger || true"]


def events(log):
    """(channel, bytes) of a log in its order, without what LCM says to itself before it listens."""
    said = [(e.channel, e.data) for e in lcm.EventLog(str(log), "r")]
    return [event for event in said if event[0] != "LCM_SELF_TEST"]


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
        second.append(f"lcm-logplayer --speed=4 {heard}")
    in_one_network([*first, *second])
    said = events(own)
    assert len({channel for channel, _ in said}) == 12  # 3 robots: telemetry, pose, run, truth
    assert events(heard) == said
    assert events(again) == said
