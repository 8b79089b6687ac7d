# SPDX-License-Identifier: Apache-2.0
"""A robot on a machine of its own, whose networks come and go while it drives.

Usage: link_session.py FOLDER, in a network of its own, with TURBOPI set: this is the operator's
machine. The robot's is another network namespace; cables join them. Prints what happened as JSON.
"""

import json
import os
import shlex
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from keyring import operator_key, robot_options
from robot_process import LEFT, Robot, wait_until

from twinmill.robots import tell
from twinmill.robots.fleet import URL, Fleet

ID = 3


def run(command: str) -> None:
    subprocess.run(command.split(), check=True)


class Machine:
    """Another network namespace, as long as a process lives in it."""

    def __init__(self):
        self._process = subprocess.Popen(["unshare", "--net", "sleep", "600"])
        here = os.readlink("/proc/self/ns/net")
        path = f"/proc/{self._process.pid}/ns/net"
        assert wait_until(lambda: os.readlink(path) != here)
        self.enter = ["nsenter", f"--net={path}"]
        self._path = path
        self.run("ip link set lo up")

    def run(self, command: str) -> None:
        subprocess.run([*self.enter, *command.split()], check=True)

    def cable(self, name: str, number: int) -> None:
        """A network between the operator (10.0.number.1) and this machine (10.0.number.2)."""
        run(f"ip link add op-{name} type veth peer name {name} netns {self._path}")
        run(f"ip addr add 10.0.{number}.1/24 dev op-{name}")
        run(f"ip link set op-{name} up")
        self.run(f"ip addr add 10.0.{number}.2/24 dev {name}")
        self.run(f"ip link set {name} up")
        self.run(f"ip route add 224.0.0.0/4 dev {name} metric {number}")

    def deafen(self, name: str, number: int) -> None:
        """It speaks on that network, and takes nothing from there: by rp_filter of ip-sysctl."""
        self.run(f"sysctl -qw net.ipv4.conf.{name}.rp_filter=1")
        self.run(f"ip route del 10.0.{number}.0/24 dev {name}")

    def cut(self, name: str) -> None:
        run(f"ip link del op-{name}")

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


@contextmanager
def robot_on(machine: Machine, folder: Path, name: str):
    """Its program, on that machine."""
    (folder / name).mkdir()
    program = [*machine.enter, *shlex.split(os.environ["TURBOPI"])]
    options = ["--lcm-url", URL, *robot_options(folder, ID)]
    with Robot(program, folder / name, *options) as robot:
        yield robot


def drive(robot: Robot, key: bytes) -> Fleet:
    """Arms and starts it, to drive on by itself."""
    fleet = Fleet(URL, key=key)
    fleet.listen(10, lambda: ID in fleet.robots and fleet.robots[ID].link)
    tell.arm(fleet, {ID})
    tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False, link_timeout_ms=0)
    assert robot.wait_for(LEFT)
    return fleet


def stop_by_multicast(robot: Robot, key: bytes) -> bool:
    """Nothing is said to the robot's address alone."""
    fleet = Fleet(URL, key=key)
    fleet.bus.tell = lambda *_: None
    (answer,) = tell.stop(fleet, {ID})
    return answer.stands and robot.duties() == (0, 0, 0, 0)


def wifi_made_anew(machine: Machine, robot: Robot, key: bytes) -> bool:
    drive(robot, key)
    machine.cut("wlan0")
    time.sleep(0.5)
    machine.cable("wlan0", 1)
    time.sleep(0.5)
    return stop_by_multicast(robot, key)


def moved_to_wifi(machine: Machine, robot: Robot, key: bytes) -> bool:
    """It was switched on at a cable, which is pulled once the wireless network is there."""
    drive(robot, key)
    machine.cable("wlan0", 1)
    machine.cut("eth0")
    time.sleep(0.5)
    return stop_by_multicast(robot, key)


def on_the_second_network(machine: Machine, robot: Robot, key: bytes) -> bool:
    """The operator is on the network that is not the robot's way out."""
    machine.cable("eth0", 2)
    machine.cable("wlan0", 9)
    fleet = drive(robot, key)
    heard_by = fleet.robots[ID].senders.hosts
    fleet.bus._names = {i: name for i, name in socket.if_nameindex() if name == "op-wlan0"}
    fleet.bus._renew = lambda: None
    fleet.bus.tell = lambda *_: None
    tell.stop(fleet, {ID}, timeout_s=2)
    return heard_by == ["10.0.2.2"] and robot.duties() == (0, 0, 0, 0)


def by_unicast(robot: Robot, key: bytes) -> dict:
    """A network that carries no multicast towards the robot."""
    fleet = drive(robot, key)
    fleet.bus.publish = lambda *_: None
    command = tell.make_command(1)
    tell.arm(fleet, {ID}, timeout_s=0.5)  # goes nowhere
    (answer,) = tell.stop(fleet, {ID})
    time.sleep(0.2)
    for _ in range(20):
        fleet.send(command, "10.0.1.2")
        time.sleep(0.01)
    time.sleep(0.5)
    never_heard = Fleet(URL, key=key)
    (by_name,) = tell.stop(never_heard, {ID}, hosts=tell.Hosts(["10.0.1.2"]))
    return {
        "stands": answer.stands,
        "started": robot.duties() == LEFT,
        "by_name": by_name.stands,
    }


def main(folder: Path) -> dict:
    _, key = operator_key(folder)
    result = {}
    machine = Machine()
    try:
        machine.cable("wlan0", 1)
        with robot_on(machine, folder, "anew") as robot:
            result["wifi_made_anew"] = wifi_made_anew(machine, robot, key)
            result["by_unicast"] = by_unicast(robot, key)
        machine.cut("wlan0")
        # Switched on without any network.
        with robot_on(machine, folder, "moved") as robot:
            time.sleep(1)
            machine.cable("eth0", 2)
            result["moved_to_wifi"] = moved_to_wifi(machine, robot, key)
        machine.cut("wlan0")
        with robot_on(machine, folder, "second") as robot:
            result["on_the_second_network"] = on_the_second_network(machine, robot, key)
    finally:
        machine.end()
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
