# SPDX-License-Identifier: Apache-2.0
"""Commands over a real multicast bus, in a network namespace of its own that may be broken.

Usage: bus_session.py FOLDER PROGRAM..., as root of the namespace. Prints what happened as JSON.
"""

import itertools
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import turbopi
from robot_process import LEFT, ZERO, Robot

from twinmill.robots import tell
from twinmill.robots.fleet import Fleet
from twinmill.robots.key import load_or_make, name, of_robot

ID = 3
URL = "udpm://239.255.76.67:7667?ttl=0"


def network(up: bool):
    """Joins or cuts the only way that multicast has."""
    commands = (
        ["ip link set lo up", "ip route add 224.0.0.0/4 dev lo"] if up else ["ip link set lo down"]
    )
    for command in commands:
        subprocess.run(command.split(), check=True)


def heard_again(fleet: Fleet) -> bool:
    """Ten messages from now on."""

    def newest() -> int:
        telemetry = fleet.robots[ID].telemetry if ID in fleet.robots else None
        return telemetry.seq if telemetry else 0

    seq = newest()
    fleet.listen(10, lambda: newest() > seq + 10)
    return newest() > seq + 10


def armed(fleet: Fleet, listener: Fleet | None = None) -> list:
    """Sends the robot an arm that is signed with the fleet's key; its answers.

    One with an old key hears no new session: a listener does, and the signature alone is wrong.
    """
    fleet.listen(5, lambda: fleet.robots[ID].link if ID in fleet.robots else None)
    if listener:
        listener.listen(0.2)
        fleet.robots[ID].link = listener.robots[ID].link
        fleet.robots[ID].link_s = listener.robots[ID].link_s
    (answer,) = tell.arm(fleet, {ID}, timeout_s=5)
    return [answer.accepted, answer.signed, answer.reason]


def main(folder: Path, program: list[str]) -> dict:
    network(up=True)
    result = {}
    key = load_or_make(folder / "operator.key")
    own_key = folder / "key"
    own_key.touch(mode=0o600)
    own_key.write_text(of_robot(key, ID).hex())
    options = ("--set", f"robot_id={ID}", "--set", f"key_file={own_key}", "--set", "run_dir=")
    with Robot(program, folder, "--lcm-url", URL, *options) as robot:
        fleet = Fleet(URL, key=key)
        heard_again(fleet)
        result["stands_before_start"] = robot.duties() == ZERO
        begun = tell.start(fleet, {ID}, "", ahead_s=1.0, partial=False, link_timeout_ms=0)
        robot.wait_for(LEFT)
        moved_s = min(t for t, duties in robot.rows() if duties == LEFT)
        result["start_delay_s"] = moved_s + (time.time() - time.monotonic()) - begun.utime_us / 1e6
        dance = tell.make_command(turbopi.swarm_command_t.VERB_SELECT, "dance")
        (refused,) = tell.tell(fleet, dance, {ID}, until_s=time.monotonic() + 5)

        network(up=False)
        cut_s = time.monotonic()
        time.sleep(2)
        rows = [row for row in robot.rows() if row[0] > cut_s]
        result["longest_gap_without_network_s"] = max(
            b[0] - a[0] for a, b in itertools.pairwise(rows)
        )
        result["moved_without_network"] = {duties for _, duties in rows} == {LEFT}

        network(up=True)
        result["heard_again"] = heard_again(fleet)
        (stopped,) = tell.stop(fleet, {ID})
        result["stopped"] = stopped.stands and robot.wait_for(ZERO)
        answers = (*begun.answers, refused, stopped)
        other = Fleet(URL, key=load_or_make(folder / "other.key"))
        own_key.write_text(of_robot(load_or_make(folder / "other.key"), ID).hex())
        robot.process.send_signal(signal.SIGHUP)
        result["key_name"] = name(of_robot(load_or_make(folder / "other.key"), ID))
        result["armed"] = {"new key": armed(other), "old key": armed(fleet, other)}
        result["answers"] = [[a.accepted, a.signed, a.reason] for a in answers]
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), sys.argv[2:])))
