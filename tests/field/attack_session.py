# SPDX-License-Identifier: Apache-2.0
"""Attacks from elsewhere on the network: replays, forgeries, floods, a robot's twin brother.

Usage: attack_session.py FOLDER, in a network of its own, with TURBOPI set. Prints what happened as
JSON. The attacker hears everything, says anything, and has no key.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import turbopi
from keyring import operator_key, robot_options
from robot_process import LEFT, ZERO, Robot

from twinmill.data.bus import UdpBus
from twinmill.robots import tell
from twinmill.robots.fleet import URL, Fleet
from twinmill.robots.key import TAG_BYTES, of_robot, sign

ID = 3
SIGNED, PLAIN = "SWARM_SIGNED", "SWARM_COMMAND"
WATCH_S = 0.7  # after an attack: would the wheels have turned, they had by now


class Ear(UdpBus):
    """Writes down what it hears, as an attacker would."""

    def __init__(self):
        super().__init__(URL)
        self.heard: dict[str, list[bytes]] = {}
        self.subscribe(".*", lambda channel, data: self.heard.setdefault(channel, []).append(data))

    def listen(self, duration_s: float) -> None:
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0:
            self.handle_timeout(int(1000 * left_s) + 1)


@contextmanager
def overhearing():
    """An attacker's ear in a thread of its own."""
    ear, over = Ear(), threading.Event()

    def run():
        while not over.is_set():
            ear.listen(0.05)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield ear
    finally:
        over.set()
        thread.join()


def moves(robot: Robot, attack) -> bool:
    """Did the wheels turn at any time since the attack began?"""
    begin_s = time.monotonic()
    attack()
    time.sleep(WATCH_S)
    return any(t > begin_s and duties != ZERO for t, duties in robot.rows())


def repeated(bus: UdpBus, channel: str, *messages: bytes):
    """Says some messages again and again."""

    def say():
        for _ in range(10):
            for message in messages:
                bus.publish(channel, message)
            time.sleep(0.01)

    return say


def by_nobody(verb: int) -> bytes:
    command = tell.make_command(verb)
    command.robot_id = ID
    return command.encode()


def changed(message: bytes, **fields) -> bytes:
    """A signed command with other fields and the old signature."""
    command = turbopi.signed_command_t.decode(message)
    for name, value in fields.items():
        setattr(command, name, value)
    return command.encode()


def recorded_start(robot: Robot, key: bytes) -> dict[str, list[bytes]]:
    """All that goes over the air while the operator arms, starts and stops a robot."""
    with overhearing() as ear:
        fleet = Fleet(URL, key=key)
        tell.find(fleet, {ID})
        tell.arm(fleet, {ID})
        tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False)
        assert robot.wait_for(LEFT)
        tell.stop(fleet, {ID})
    return ear.heard


def starts_of_strangers(robot: Robot, heard: dict, key: bytes) -> dict:
    """Each way to start a robot that is armed, without the key."""
    attacker, recorded = UdpBus(URL), heard[SIGNED]
    tell.arm(fleet := Fleet(URL, key=key), {ID})
    fleet.listen(0.2)
    link = fleet.robots[ID].link
    now = {"session": link.session, "made_us": fleet.robots[ID].session_us,
           "counter": link.counter + 10**6}  # fmt: skip
    wrong_key = [sign(os.urandom(32), changed(m, **now)) for m in recorded]
    other_robots_key = [sign(of_robot(key, ID + 1), changed(m, **now)) for m in recorded]
    return {
        "unsigned": moves(robot, repeated(attacker, PLAIN, by_nobody(1))),
        "replayed": moves(robot, repeated(attacker, SIGNED, *recorded)),
        "changed": moves(robot, repeated(attacker, SIGNED, *[changed(m, **now) for m in recorded])),
        "signed_with_another_key": moves(robot, repeated(attacker, SIGNED, *wrong_key)),
        "signed_with_another_robots_key": moves(
            robot, repeated(attacker, SIGNED, *other_robots_key)
        ),
    }


def kept_back(robot: Robot, key: bytes) -> bool:
    """An armed robot's start that never came is let through after the stop, and after 3 s."""
    fleet = Fleet(URL, key=key)
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})
    kept: list[bytes] = []
    publish, fleet.bus.publish = fleet.bus.publish, lambda _, data: kept.append(data)
    order = tell.Order(tell.make_command(1))
    tell._say_signed(fleet, order, ID)
    arming = tell.Order(tell.make_command(tell.SIGNED_VERBS.VERB_ARM))
    tell._say_signed(fleet, arming, ID)
    fleet.bus.publish = publish
    tell.stop(fleet, {ID})
    after_stop = moves(robot, repeated(UdpBus(URL), SIGNED, *reversed(kept)))
    tell.arm(fleet, {ID})
    time.sleep(3.1)
    return after_stop or moves(robot, repeated(UdpBus(URL), SIGNED, *kept))


def flood_of_starts(robot: Robot, key: bytes) -> dict:
    """The rightful operator's other program says start every 10 ms; somebody says stop."""
    fleet, over = Fleet(URL, key=key), threading.Event()
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})

    def starts():
        other = Fleet(URL, key=key)
        tell.find(other, {ID})
        while not over.is_set():
            tell._say_signed(other, tell.Order(tell.make_command(1)), ID)
            other.listen(0.01)

    thread = threading.Thread(target=starts)
    thread.start()
    drove = robot.wait_for(LEFT)
    (answer,) = tell.stop(Fleet(URL, key=key), {ID})
    stopped_s = time.monotonic()
    time.sleep(2)
    over.set()
    thread.join()
    return {
        "drove": drove,
        "stands": answer.stands,
        "moved_after": any(t > stopped_s and d != ZERO for t, d in robot.rows()),
    }


def flood_of_nonsense(robot: Robot, key: bytes) -> dict:
    """A stop must get through while a stranger shouts unsigned starts as fast as he can."""
    fleet, over = Fleet(URL, key=key), threading.Event()
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})
    tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False, link_timeout_ms=0)

    def shouts():
        attacker = UdpBus(URL)
        while not over.is_set():
            for _ in range(20):
                attacker.publish(PLAIN, by_nobody(1))
            time.sleep(0.005)

    thread = threading.Thread(target=shouts)
    thread.start()
    time.sleep(0.5)
    begin_s = time.monotonic()
    (answer,) = tell.stop(fleet, {ID})
    over.set()
    thread.join()
    return {"stands": answer.stands, "took_s": time.monotonic() - begin_s}


def forged_stands(robot: Robot, heard: dict, key: bytes) -> dict:
    """The robot hears no stop; the attacker answers in its place, with all that he ever heard."""
    fleet = Fleet(URL, key=key)
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})
    tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False, link_timeout_ms=0)
    attacker, over = UdpBus(URL), threading.Event()
    said: list = []
    stopping = Fleet(URL, key=key)
    stopping.bus.publish = lambda _, data: said.append(turbopi.swarm_command_t.decode(data))
    stopping.bus.tell = lambda *_: None

    def answers():
        while not over.is_set():
            for command in said[-1:]:
                plain, signed = turbopi.ack_t(), turbopi.signed_ack_t()
                plain.robot_id, plain.seq, plain.accepted = ID, command.seq, 1
                signed.robot_id, signed.seq, signed.accepted, signed.stands = ID, command.seq, 1, 1
                signed.command_utime_us = command.utime_us
                signed.session_us = 10**12
                signed.tag = os.urandom(TAG_BYTES)
                attacker.publish("R03_ACK", plain.encode())
                attacker.publish("R03_SIGNED_ACK", signed.encode())
            for channel in ("R03_SIGNED_ACK", "R03_LINK"):
                for data in heard[channel][-20:]:
                    attacker.publish(channel, data)
            time.sleep(0.02)

    thread = threading.Thread(target=answers)
    thread.start()
    (answer,) = tell.stop(stopping, {ID}, timeout_s=2)
    over.set()
    thread.join()
    result = {"drives": robot.duties() == LEFT, "stands": answer.stands, "signed": answer.signed}
    tell.stop(fleet, {ID})
    return result


def restarted(program: list[str], folder: Path, heard: dict, key: bytes) -> dict:
    """A start that was recorded before the robot's program was started again."""
    (folder / "again").mkdir()
    options = ["--lcm-url", URL, *robot_options(folder, ID)]
    (folder / f"run{ID}" / "stopped").unlink(missing_ok=True)
    with Robot(program, folder / "again", *options) as robot:
        fleet = Fleet(URL, key=key)
        tell.find(fleet, {ID})
        return {
            "armed": fleet.robots[ID].is_armed,
            "moves": moves(robot, repeated(UdpBus(URL), SIGNED, *heard[SIGNED])),
        }


def latched_without_a_folder(program: list[str], folder: Path, key: bytes) -> dict:
    """By hand there is no /run/turbopi: a stop must hold though its driver is killed."""
    (folder / "latched").mkdir()
    options = ["--lcm-url", URL, *robot_options(folder, ID), "--set", "run_dir=/nowhere"]
    options += ["--start", "--set", "restart_ms=100"]
    with Robot(program, folder / "latched", *options) as robot:
        drove = robot.wait_for(LEFT)
        fleet = Fleet(URL, key=key)
        (answer,) = tell.stop(fleet, {ID})
        stopped_s, driver = time.monotonic(), robot.children()[0]
        os.kill(driver, signal.SIGKILL)
        fleet.listen(10, lambda: robot.children() not in ([], [driver]))
        fleet.listen(WATCH_S)
        moved = any(t > stopped_s and duties != ZERO for t, duties in robot.rows())
        return {"drove": drove, "stands": answer.stands, "moved_after": moved}


COMMAND = "import sys; from twinmill_cli.main import main; sys.argv[0] = 'twinmill'; main()"


def unknown_mode(robot: Robot, key_file: Path, key: bytes) -> dict:
    """Telemetry of a robot that nobody has, in a mode that there is not, while another drives."""
    fleet, over = Fleet(URL, key=key), threading.Event()
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})
    tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False, link_timeout_ms=0)
    telemetry = turbopi.telemetry_t()
    telemetry.robot_id, telemetry.mode = ID + 2, 77

    def says():
        attacker = UdpBus(URL)
        while not over.is_set():
            telemetry.utime_us = time.time_ns() // 1000  # else it is old news, and has no mode
            attacker.publish(f"R{ID + 2:02d}_TELEMETRY", telemetry.encode())
            time.sleep(0.03)

    thread = threading.Thread(target=says)
    thread.start()
    drove, said = robot.wait_for(LEFT), ""
    for words in (["status", "--once"], ["stop", "--robots", f"{ID},{ID + 2}"]):
        command = [sys.executable, "-c", COMMAND, "swarm", *words, "--key", str(key_file)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        said += done.stdout + done.stderr
    over.set()
    thread.join()
    return {"drove": drove, "stands": robot.duties() == ZERO, "said": said}


def start_that_cannot_be_told(robot: Robot, key_file: Path, key: bytes) -> dict:
    """The operator's disk is full below the words of his command: no robot starts."""
    command = ["swarm", "start", "--untethered", "--arm", "--key", str(key_file)]
    begin_s = time.monotonic()
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, *command],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
    drove = any(t > begin_s and duties != ZERO for t, duties in robot.rows())
    return {"code": done.returncode, "drove": drove, "stands": robot.duties() == ZERO}


def double(program: list[str], folder: Path, key: bytes) -> dict:
    """Two robots of one number."""
    robots = []
    for name in ("one", "other"):
        (folder / name).mkdir()
        options = ["--lcm-url", URL, *robot_options(folder, ID)]
        robots.append(Robot(program, folder / name, *options))
    with robots[0], robots[1]:
        fleet = Fleet(URL, key=key)
        fleet.listen(8, lambda: ID in fleet.robots and fleet.robots[ID].is_double)
        robot = fleet.robots[ID]
        fleet.listen(8, lambda: robot.telemetry.status_flags & robot.telemetry.STATUS_DOUBLE)
        (answer,) = tell.stop(fleet, {ID})
        flags = robot.telemetry.status_flags
        return {
            "heard_here": robot.senders.are_double,
            "said_by_robot": bool(flags & robot.telemetry.STATUS_DOUBLE),
            "answer": answer.is_double,
            "alarms": robot.alarms,
        }


def lost_operator(robot: Robot, key: bytes) -> dict:
    """An operator's machine that dies after the start."""
    fleet = Fleet(URL, key=key)
    tell.find(fleet, {ID})
    tell.arm(fleet, {ID})
    tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False, link_timeout_ms=800)
    fleet.listen(2)
    held = robot.duties() == LEFT
    fleet.held.clear()
    lost_s = time.monotonic()
    fleet.listen(5, lambda: robot.duties() == ZERO)
    stopped_s = next(t for t, duties in reversed(robot.rows()) if duties == LEFT)
    fleet.listen(0.5)
    return {
        "held": held,
        "took_s": stopped_s - lost_s,
        "alarms": fleet.robots[ID].alarms,
        "untethered": fleet.robots[ID].is_tethered,
    }


def main(folder: Path) -> dict:
    program = shlex.split(os.environ["TURBOPI"])
    key_file, key = operator_key(folder)
    options = ["--lcm-url", URL, *robot_options(folder, ID)]
    (folder / "robot").mkdir()
    result = {}
    with Robot(program, folder / "robot", *options) as robot:
        heard = recorded_start(robot, key)
        result["starts"] = starts_of_strangers(robot, heard, key)
        result["kept_back"] = kept_back(robot, key)
        result["flood_of_starts"] = flood_of_starts(robot, key)
        result["flood_of_nonsense"] = flood_of_nonsense(robot, key)
        result["forged_stands"] = forged_stands(robot, heard, key)
        result["lost_operator"] = lost_operator(robot, key)
        result["unknown_mode"] = unknown_mode(robot, key_file, key)
        result["start_that_cannot_be_told"] = start_that_cannot_be_told(robot, key_file, key)
    result["latched"] = latched_without_a_folder(program, folder, key)
    result["restarted"] = restarted(program, folder, heard, key)
    result["double"] = double(program, folder, key)
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
