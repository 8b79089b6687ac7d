# SPDX-License-Identifier: Apache-2.0
"""A recording of robots is played while the robot itself drives on, out of hearing, or stands.

Usage: recording_session.py FOLDER, in a network of its own, with TURBOPI set. R03 is recorded as
its operator holds and stops it; then it drives by itself, and its network goes away. That recording
is played here. Once the robot is back, and stopped, it is played on another computer; first from
the middle of a count to a start on. Prints, as JSON, what the tool says, and how the wheels turned.
"""

import json
import pickle
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from keyring import operator_key
from link_session import ID, Machine, drive, robot_on
from robot_process import ZERO

from twinmill.data.bus import UdpBus
from twinmill.robots import tell
from twinmill.robots.fleet import SIGNED_S, URL, Fleet

COMMAND = "import sys; from twinmill_cli.main import main; sys.argv[0] = 'twinmill'; main()"
DRIVES_S = 3.0  # recorded
COMMANDS = {
    "partial": ("start", "--arm", "--partial", "--json"),
    "all": ("start", "--arm", "--json"),
    "arm": ("arm", "--json"),
    "status": ("status", "--json"),
}
BESIDE = {
    "again": ("start", "--arm", "--json"),
    "once more": ("start", "--arm", "--json", "--robots", str(ID)),
    "armed": ("arm", "--json", "--robots", str(ID)),
    "looked at": ("status", "--json"),
    "stopped": ("stop", "--json", "--timeout-s", "3"),
}
COUNT_S = 4.0  # to the start in which the recording begins


@contextmanager
def beside(work):
    """A function that is called in a thread, again and again."""
    over = threading.Event()

    def run():
        while not over.is_set():
            work(over)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def recorded(key: bytes) -> list:
    """All that is said as R03 is held, drives and is stopped, and when."""
    said, bus, fleet = [], UdpBus(URL), Fleet(URL, key=key)
    bus.subscribe(".*", lambda channel, data: said.append((time.monotonic(), channel, data)))
    with beside(lambda _: bus.handle_timeout(50)):
        fleet.listen(10, lambda: ID in fleet.robots and fleet.robots[ID].link)
        tell.arm(fleet, {ID})
        assert not tell.start(fleet, {ID}, "", ahead_s=0.5, partial=False).called_off
        fleet.listen(DRIVES_S)
        (answer,) = tell.stop(fleet, {ID})
        assert answer.stands
    bus.close()
    fleet.close()
    return [row for row in said if row[1].startswith("R") or row[1] == "SWARM_SIGNED"]


def play(said: list, over: threading.Event) -> None:
    """As lcm-logplayer does."""
    bus, begin_s = UdpBus(URL), time.monotonic() - said[0][0]
    for at_s, channel, data in said:
        if over.wait(max(0.0, begin_s + at_s - time.monotonic())):
            break
        bus.publish(channel, data)
    bus.close()


def command_of(key_file: Path, words: tuple[str, ...]) -> list[str]:
    return [sys.executable, "-c", COMMAND, "swarm", *words, "--key", str(key_file)]


def told(key_file: Path, words: tuple[str, ...]) -> dict:
    done = subprocess.run(command_of(key_file, words), capture_output=True, text=True, timeout=60)
    return {"code": done.returncode, "object": json.loads(done.stdout or "{}"), "err": done.stderr}


def told_beside(folder: Path, key_file: Path, said: list) -> dict:
    """All that is told while another computer than the robot's and this plays it."""
    recording = folder / "recording"
    recording.write_bytes(pickle.dumps(said))
    player = Machine()
    player.cable("wlan1", 2)
    play_there = [*player.enter, sys.executable, __file__, "--play", str(recording)]
    words = ("start", "--arm", "--json", "--in-s", str(COUNT_S))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    playing = None
    try:
        counting = subprocess.Popen(command_of(key_file, words), **pipes)
        first = next(line for line in counting.stderr if "to start at" in line)
        playing = subprocess.Popen(play_there)
        out, err = counting.communicate(timeout=60)
        row = {"code": counting.returncode, "object": json.loads(out), "err": first + err}
        found = {"count": row}
        return found | {name: told(key_file, words) for name, words in BESIDE.items()}
    finally:
        if playing:
            playing.kill()
            playing.wait()
        player.end()


def main(folder: Path) -> dict:
    key_file, key = operator_key(folder)
    machine = Machine()
    machine.cable("wlan0", 1)
    try:
        with robot_on(machine, folder, "robot") as robot:
            said = recorded(key)
            drive(robot, key).close()
            begin_s = time.monotonic()
            machine.cut("wlan0")
            time.sleep(SIGNED_S + 1)
            with beside(lambda over: play(said, over)):
                time.sleep(1.0)
                found = {name: told(key_file, words) for name, words in COMMANDS.items()}
            stood = [d for t, d in robot.rows() if t > begin_s and d == ZERO]
            found["drove_on"] = not stood and robot.duties() != ZERO
            machine.cable("wlan0", 1)
            time.sleep(1)
            tell.stop(Fleet(URL, key=key), {ID})
            begin_s = time.monotonic()
            found |= told_beside(folder, key_file, said)
            found["stood"] = all(d == ZERO for t, d in robot.rows() if t > begin_s)
    finally:
        machine.end()
    return found


def play_for_ever(recording: str) -> None:
    said = pickle.loads(Path(recording).read_bytes())
    while True:
        play(said, threading.Event())


if __name__ == "__main__":
    if sys.argv[1] == "--play":
        play_for_ever(sys.argv[2])
    print(json.dumps(main(Path(sys.argv[1]))))
