# SPDX-License-Identifier: Apache-2.0
"""Three robots' programs and a twin under an operator whose network loses half of all packets.

Usage: swarm_session.py FOLDER, in a network of its own, with TURBOPI and TWIN_RUN set. Prints what
happened as JSON.
"""

import json
import os
import shlex
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from keyring import operator_key, robot_options
from lossy import DeafBus, LossyBus
from robot_process import ZERO, Robot, full_pipe

from twinmill.robots import tell
from twinmill.robots.fleet import URL, Fleet

IDS = {1, 2, 3}
KEY = b""  # the operator's, from main()
STOP = "import sys; from twinmill_cli.main import run; sys.exit(run(sys.argv[1:]))"
ROUNDS = 2
AHEAD_S = 1.0
WAIT_S = 20.0
PROTOCOL = {  # verb, behaviour, start after now in us, age of the command in us
    "select_unknown": (2, "dance", 0, 0),
    "script_with_folder": (3, "../s.csv", 0, 0),
    "start_late": (1, "", -3_000_000, 0),
    "start_far_ahead": (1, "", 700_000_000, 0),
    "verb_unknown": (9, "", 0, 0),
    "stop_however_old": (0, "", 0, 3_600_000_000),
}


def first_move_s(robot: Robot, since_s: float) -> float:
    """When its wheels first turned after a time; waits for them."""
    until_s = time.monotonic() + WAIT_S
    while time.monotonic() < until_s:
        for t_s, duties in robot.rows():
            if t_s > since_s and duties != ZERO:
                return t_s
        time.sleep(0.02)
    raise TimeoutError(f"no wheel turned for {WAIT_S:g} s")


def lossy_round(robots: dict, seed: int) -> dict:
    """One start and one stop."""
    fleet = Fleet(URL, connect=lambda url: LossyBus(url, seed), key=KEY)
    found = tell.find(fleet, set())
    armed = tell.arm(fleet, found)
    begin_s = time.monotonic()
    begun = tell.start(fleet, found, "milling", ahead_s=AHEAD_S, partial=False)
    instant_s = begun.utime_us / 1e6 - (time.time() - time.monotonic())
    late_s = [first_move_s(robot, begin_s) - instant_s for robot in robots.values()]
    stop_s = time.monotonic()
    stopped = tell.stop(fleet, set())
    return {
        "found": sorted(found),
        "armed": [a.accepted and a.signed for a in armed],
        "start_accepted": [a.accepted for a in begun.answers],
        "late_s": late_s,
        "stop_accepted": [a.accepted and a.signed and a.stands for a in stopped],
        "stop_took_s": time.monotonic() - stop_s,
        "duties_after_stop": [robot.duties() for robot in robots.values()],
        "lost": fleet.bus.lost,
    }


def deaf_round(robots: dict) -> dict:
    """The operator never hears robot 2's acknowledgements."""
    deaf = {"R02_ACK", "R02_SIGNED_ACK"}
    tell.arm(Fleet(URL, key=KEY), IDS)
    fleet = Fleet(URL, connect=lambda url: DeafBus(url, deaf), key=KEY)
    fleet.listen(0.5)
    begin_s = time.monotonic()
    begun = tell.start(fleet, IDS, "", ahead_s=AHEAD_S, partial=False)
    time.sleep(0.5)
    moved = {duties for r in robots.values() for t, duties in r.rows() if t > begin_s} - {ZERO}
    return {
        "called_off": begun.called_off,
        "accepted": [a.accepted for a in begun.answers],
        "moved": bool(moved),
    }


def one_robot_round(robots: dict) -> list:
    """Robot 1 alone is told to start, with another behaviour."""
    fleet = Fleet(URL, key=KEY)
    tell.arm(fleet, IDS)
    tell.start(fleet, {1}, "diffusing_v2", ahead_s=0.5, partial=False)
    duties = [robot.duties() for robot in robots.values()]
    tell.stop(fleet, set())
    return duties


def own_table_round() -> dict:
    """Robots 1 and 2 know a table of the user's own by name; robot 3 does not."""
    fleet = Fleet(URL, key=KEY)
    tell.arm(fleet, IDS)
    refused = tell.start(fleet, IDS, "ahead", ahead_s=0.5, partial=False)
    tell.arm(fleet, IDS)
    begun = tell.start(fleet, {1, 2}, "ahead", ahead_s=0.5, partial=False)
    fleet.listen(0.3)
    return {
        "refused": {a.robot_id: a.reason for a in refused.answers if not a.accepted},
        "called_off": refused.called_off,
        "accepted": [a.accepted for a in begun.answers],
        "stopped": [a.mode for a in tell.stop(fleet, set())],
    }


def answers_to_bad_commands(prefix: str, robot_id: int) -> dict:
    """Robot's answer to each command of PROTOCOL after one that it obeyed."""
    fleet = Fleet(URL, prefix, key=KEY)
    fleet.listen(0.5)
    given = {}
    tell.arm(fleet, {robot_id})
    first = tell.make_command(2, "milling")
    tell.tell(fleet, first, {robot_id}, until_s=time.monotonic() + 5)
    for name, (verb, behavior, ahead_us, age_us) in PROTOCOL.items():
        command = tell.make_command(verb, behavior)
        command.start_utime_us = command.utime_us + ahead_us if ahead_us else 0
        command.utime_us -= age_us
        (answer,) = tell.tell(fleet, command, {robot_id}, until_s=time.monotonic() + 5)
        given[name] = [answer.accepted, answer.reason]
    return given


def behaviors(fleet: Fleet) -> list:
    """Behaviour that each robot says it has; None before it says so."""
    return [r.run and r.run.behavior for r in fleet.robots.values()]


def unheard_round(robots: dict) -> list:
    """`twinmill swarm stop` whose key is no key and whose messages nobody reads."""
    fleet = Fleet(URL, key=KEY)
    tell.arm(fleet, IDS)
    tell.start(fleet, IDS, "diffusing_v2", ahead_s=0.5, partial=False, link_timeout_ms=0)
    moved = [robot.duties() for robot in robots.values()]
    read_end, write_end = full_pipe()
    command = [sys.executable, "-c", STOP, "swarm", "stop", "--key", "/dev/null"]
    with subprocess.Popen(command, stdout=write_end, stderr=write_end) as process:
        stood = [robot.wait_for(ZERO, 30) for robot in robots.values()]
        process.kill()
    os.close(read_end)
    os.close(write_end)
    return [moved, stood]


def twin_round() -> dict:
    """A twin of two, which know the table, is commanded as robots are."""
    result = {"twin_answers": answers_to_bad_commands("TWIN_", 1)}
    fleet = Fleet(URL, "TWIN_", key=KEY)
    tell.arm(fleet, tell.find(fleet, set()))
    begun = tell.start(fleet, tell.find(fleet, set()), "ahead", ahead_s=0.5, partial=False)
    result["twin_modes"] = [a.mode for a in begun.answers]
    fleet.listen(6, lambda: behaviors(fleet) == ["ahead"] * 2)
    result["twin_behaviors"] = behaviors(fleet)
    result["twin_stopped"] = [a.mode for a in tell.stop(fleet, set())]
    return result


def main(folder: Path) -> dict:
    global KEY
    key_file, KEY = operator_key(folder)
    turbopi, result = shlex.split(os.environ["TURBOPI"]), {}
    tables = folder / "behaviors.toml"
    tables.write_text('ahead = "0,0.5,100,0"\n')
    with ExitStack() as stack:
        robots = {}
        for robot_id in sorted(IDS):
            (folder / str(robot_id)).mkdir()
            options = ["--lcm-url", URL, *robot_options(folder, robot_id)]
            options += ["--set", f"behaviors={tables}"] if robot_id < 3 else []
            robots[robot_id] = stack.enter_context(Robot(turbopi, folder / str(robot_id), *options))
        time.sleep(1)
        result["rounds"] = [lossy_round(robots, seed) for seed in range(ROUNDS)]
        result["deaf"] = deaf_round(robots)
        result["one_robot"] = one_robot_round(robots)
        result["own_table"] = own_table_round()
        result["unheard"] = unheard_round(robots)
        result["robot_answers"] = answers_to_bad_commands("", 1)
    twin = f"{os.environ['TWIN_RUN']} --plant planar --n 2 --wait --channel-prefix TWIN_"
    twin += f" --behaviors {tables} --key {key_file}"
    with subprocess.Popen(shlex.split(twin), stdout=subprocess.DEVNULL) as process:
        try:
            time.sleep(1)
            result |= twin_round()
        finally:
            process.terminate()
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
