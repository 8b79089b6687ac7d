# SPDX-License-Identifier: Apache-2.0
"""Commands over a real multicast bus, in a network namespace of its own that may be broken.

Usage: bus_session.py FOLDER PROGRAM..., as root of the namespace. Prints what happened as JSON.
"""

import itertools
import json
import subprocess
import sys
import time
from pathlib import Path

import lcm
import turbopi
from robot_process import LEFT, ZERO, Robot, wait_until

URL = "udpm://239.255.76.67:7667?ttl=0"


def network(up: bool):
    """Joins or cuts the only way that multicast has."""
    commands = (
        ["ip link set lo up", "ip route add 224.0.0.0/4 dev lo"] if up else ["ip link set lo down"]
    )
    for command in commands:
        subprocess.run(command.split(), check=True)


class Operator:
    """Sends commands until they are acknowledged, and listens."""

    def __init__(self):
        self.acks, self.heard = {}, 0
        self._connect()

    def _connect(self):
        self.bus = lcm.LCM(URL)
        self.bus.subscribe("R03_ACK", self._on_ack)
        self.bus.subscribe("R03_TELEMETRY", self._on_telemetry)

    def _on_ack(self, _, data):
        ack = turbopi.ack_t.decode(data)
        self.acks[ack.seq] = ack

    def _on_telemetry(self, *_):
        self.heard += 1

    def listen(self, duration_s):
        end_s = time.monotonic() + duration_s
        while time.monotonic() < end_s:
            self.bus.handle_timeout(20)

    def tell(self, seq, verb, behavior="", start_utime_us=0):
        command = turbopi.swarm_command_t()
        command.utime_us = int(time.time() * 1e6)
        command.seq, command.verb, command.behavior = seq, verb, behavior
        command.robot_id, command.start_utime_us = -1, start_utime_us
        for _ in range(100):
            self.bus.publish("SWARM_COMMAND", command.encode())
            self.listen(0.05)
            if seq in self.acks:
                return


def main(folder: Path, program: list[str]) -> dict:
    network(up=True)
    result = {}
    command = turbopi.swarm_command_t
    with Robot(program, folder, "--lcm-url", URL, "--set", "robot_id=3") as robot:
        operator = Operator()
        wait_until(lambda: operator.listen(0.1) or operator.heard > 10)
        result["stands_before_start"] = robot.duties() == ZERO
        start_s = time.time() + 1.0
        operator.tell(1, command.VERB_START, start_utime_us=int(start_s * 1e6))
        robot.wait_for(LEFT)
        moved_s = min(t for t, duties in robot.rows() if duties == LEFT)
        result["start_delay_s"] = moved_s + (time.time() - time.monotonic()) - start_s
        operator.tell(2, command.VERB_SELECT, "dance")

        network(up=False)
        cut_s = time.monotonic()
        time.sleep(2)
        rows = [row for row in robot.rows() if row[0] > cut_s]
        result["longest_gap_without_network_s"] = max(
            b[0] - a[0] for a, b in itertools.pairwise(rows)
        )
        result["moved_without_network"] = {duties for _, duties in rows} == {LEFT}

        network(up=True)
        operator.heard = 0
        wait_until(lambda: operator.listen(0.1) or operator.heard > 10)
        result["heard_again"] = operator.heard > 10
        operator.tell(3, command.VERB_STOP)
        result["stopped"] = robot.wait_for(ZERO)
        result["acks"] = [
            [seq, ack.accepted, ack.reason] for seq, ack in sorted(operator.acks.items())
        ]
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:])))
