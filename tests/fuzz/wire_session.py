# SPDX-License-Identifier: Apache-2.0
"""Any packet on the real wire, to the running programs: robot, twin and the operator's tools.

Usage: wire_session.py FOLDER SECONDS SEED, in a network of its own, with TURBOPI and TWIN_RUN set.
Packets are those of corpus/wire, changed at random as libFuzzer would, from the seed. The last ones
before a program ended are kept in FOLDER. Prints what happened as JSON.
"""

import json
import os
import random
import shlex
import socket
import subprocess
import sys
import time
from collections import deque
from pathlib import Path

from keyring import operator_key, robot_options
from robot_process import ZERO, Robot

from twinmill.robots import tell
from twinmill.robots.fleet import URL, Fleet

ID = 3
GROUP = ("239.255.76.67", 7667)
CORPUS = Path(__file__).with_name("corpus") / "wire"
NUMBERS = (0, 1, 2, 3, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)
BATCH = 50  # packets, after which the programs are looked at
STATUS = """
import sys
from twinmill_cli.main import run
sys.exit(run(["swarm", "status", "--once", "--key", sys.argv[1]]))
"""
KEPT = 500  # of the last packets, where a program has ended


def change(packet: bytes, rng: random.Random, seeds: list[bytes]) -> bytes:
    """One to eight changes: bits, numbers, cuts, repeats, and pieces of others."""
    data = bytearray(packet)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(data) + 1)
        how = rng.randrange(6)
        if how == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif how == 1:
            number = rng.choice(NUMBERS).to_bytes(4, "big")[-rng.choice((1, 2, 4)) :]
            data[at : at + len(number)] = number
        elif how == 2:
            del data[at:]
        elif how == 3:
            data[at:at] = data[at : at + rng.randrange(64)] * rng.choice((1, 2, 30))
        elif how == 4:
            other = rng.choice(seeds)
            data[at:at] = other[rng.randrange(len(other) + 1) :]
        else:
            data[at:at] = rng.randbytes(rng.choice((1, 8, 300)))
    return bytes(data[:60_000])


def shout(programs: dict, fleet: Fleet, seconds: float, seed: int) -> tuple[int, deque]:
    """Sends packets until the time is over or a program has ended."""
    rng, mouth = random.Random(seed), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    seeds = [path.read_bytes() for path in sorted(CORPUS.iterdir())]
    last: deque[bytes] = deque(maxlen=KEPT)
    end_s, count = time.monotonic() + seconds, 0
    while time.monotonic() < end_s and all(p.poll() is None for p in programs.values()):
        for _ in range(BATCH):
            last.append(change(rng.choice(seeds), rng, seeds))
            mouth.sendto(last[-1], GROUP)
        count += BATCH
        fleet.listen(0.005)
    return count, last


def main(folder: Path, seconds: float, seed: int) -> dict:
    key_file, key = operator_key(folder)
    options = ["--lcm-url", URL, *robot_options(folder, ID)]
    twin = f"{os.environ['TWIN_RUN']} --plant planar --n 2 --wait --channel-prefix TWIN_"
    twin += f" --key {key_file}"
    watched = {}
    with (
        Robot(shlex.split(os.environ["TURBOPI"]), folder, *options) as robot,
        subprocess.Popen(shlex.split(twin), stdout=subprocess.DEVNULL) as watched["twin_run"],
    ):
        watched["turbopi"] = robot.process
        fleet, twins = Fleet(URL, key=key), Fleet(URL, "TWIN_", key=key)
        tell.find(fleet, {ID})
        tell.arm(fleet, {ID})
        children = robot.children()
        count, last = shout(watched, fleet, seconds, seed)
        ended = [name for name, process in watched.items() if process.poll() is not None]
        for i, packet in enumerate(last if ended else ()):
            (folder / f"packet_{i:03d}").write_bytes(packet)
        moved = {duties for _, duties in robot.rows()} - {ZERO}
        same_process = robot.children() == children
        # Still what they were: they obey.
        status = subprocess.run(
            [sys.executable, "-c", STATUS, str(key_file)], stdout=subprocess.DEVNULL, timeout=60
        )
        # Who has not listened for long takes what was said then for the robot's time now.
        fleet = Fleet(URL, key=key)
        tell.find(fleet, {ID})
        tell.arm(fleet, {ID})
        drives = tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False).answers[0].accepted
        robot_stands = tell.stop(fleet, {ID})[0].stands
        twins.listen(0.5)
        twin_stands = [a.stands for a in tell.stop(twins, {0, 1})]
        watched["twin_run"].terminate()
    return {
        "packets": count,
        "ended": ended,
        "moved": sorted(moved),
        "same_process": same_process,
        "drives": drives,
        "robot_stands": robot_stands,
        "twin_stands": twin_stands,
        "status_code": status.returncode,
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]))))
