# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot characterise` at a terminal, driving a twin, and cut short in every way.

Usage: characterise_session.py FOLDER, in a network of its own, with TWIN_RUN set. Prints what
happened as JSON.
"""

import json
import os
import pty
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import lcm
import turbopi

from twinmill.robots import tell
from twinmill.robots.fleet import URL, Fleet
from twinmill.robots.key import load

SCRIPT = (
    "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,0,0,0,0\n0.4,50,50,50,50\n1.2,-50,-50,-50,-50\n2,0,0,0,0\n"
)
CODE = "import sys; from twinmill_cli.main import main; sys.argv[0] = 'twinmill'; main()"
TWINMILL = [sys.executable, "-c", CODE]
LONG = "t_s,speed_input,turn_input\n0,20,0\n60,0,0\n"


@contextmanager
def twin(folder: Path, *options: str):
    """A twin of four robots that wait."""
    command = [os.environ["TWIN_RUN"], "--plant", "planar", "--n", "4", "--wait"]
    command += [
        "--script-dir",
        str(folder / "robot"),
        "--key",
        str(folder / "operator.key"),
        *options,
    ]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        try:
            time.sleep(0.5)
            yield process
        finally:
            process.terminate()


def characterise(folder: Path, name: str, script: str, act=lambda: None) -> dict:
    """Runs the command at a terminal of its own; does `act` once the robot plays.

    A script that does not lie in the folder is one on the robot.
    """
    log = folder / f"{name}.lcmlog"
    command = [*TWINMILL, "characterise", "--robot", "3", "--json"]
    here = folder / script
    command += ["--script", str(here) if here.exists() else script]
    command += ["--out", str(log), "--countdown-s", "1"]
    command += ["--key", str(folder / "operator.key"), "--arm"]
    keyboard, terminal = pty.openpty()
    with subprocess.Popen(
        command, stdin=terminal, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        fleet = Fleet(URL)
        fleet.listen(20, lambda: 3 in fleet.robots and fleet.robots[3].mode == "script")
        fleet.listen(0.3)  # until the command has heard of it, too, and logged it
        act_s = time.time()
        act(keyboard, process)
        said, complaint = process.communicate(timeout=60)
    fleet.listen(0.5)
    result = {
        "code": process.returncode,
        "complaint": complaint,
        "mode_after": fleet.robots[3].mode,
        "log": log.exists(),
        "ended": json.loads(said)["ended"] if said else "",
    }
    if log.exists():
        result |= what_was_logged(log, act_s)
    return result


def say_poses(lost: threading.Event) -> None:
    """A motion capture that loses the robot, and goes on saying so."""
    bus, pose = lcm.LCM(URL), turbopi.pose_t()
    while True:
        pose.seq, pose.robot_id, pose.valid = pose.seq + 1, 3, not lost.is_set()
        bus.publish("R03_POSE", pose.encode())
        time.sleep(0.05)


def stop_as_another(folder: Path) -> None:
    """`swarm stop` of somebody else; the script's length is known to the robot alone."""
    tell.stop(Fleet(URL, key=load(folder / "operator.key")), {3})


def fill_disk(_, process: subprocess.Popen) -> None:
    """No file of the command's may grow: its newest events are in memory, and lost."""
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (6000, 6000))


def what_was_logged(log: Path, act_s: float) -> dict:
    events = [(e.timestamp, e.channel, e.data) for e in lcm.EventLog(str(log), "r")]
    telemetry = [turbopi.telemetry_t.decode(d) for _, c, d in events if c == "R03_TELEMETRY"]
    played = [t for t in telemetry if t.mode == t.MODE_SCRIPT]
    return {
        "channels": sorted({channel for _, channel, _ in events}),
        "in_order": [e[0] for e in events] == sorted(e[0] for e in events),
        "duties": [[t.utime_us - played[0].utime_us, *t.wheel_duty_pct] for t in played],
        "drove_after_act_s": played[-1].utime_us / 1e6 - act_s,
    }


def main(folder: Path) -> dict:
    (folder / "steps.csv").write_text(SCRIPT)
    (folder / "long.csv").write_text(LONG)
    (folder / "robot").mkdir()
    for script in ("steps.csv", "long.csv", "on_the_robot.csv"):
        text = (folder / script).read_text() if (folder / script).exists() else LONG
        (folder / "robot" / script).write_text(text)
    result = {}
    with twin(folder):
        result["played"] = characterise(folder, "played", "steps.csv", lambda *_: None)
        result["key"] = characterise(
            folder, "key", "long.csv", lambda keyboard, _: os.write(keyboard, b" ")
        )
        result["ctrl_c"] = characterise(
            folder, "ctrl_c", "long.csv", lambda _, process: process.send_signal(signal.SIGINT)
        )
        result["stopped_by_another"] = characterise(
            folder, "stopped_by_another", "on_the_robot.csv", lambda *_: stop_as_another(folder)
        )
        result["full_disk"] = characterise(folder, "full_disk", "long.csv", fill_disk)

    with twin(folder, "--pose-rate-hz", "0.1"):
        lost = threading.Event()
        camera = threading.Thread(target=say_poses, args=(lost,), daemon=True)
        camera.start()
        result["lost_poses"] = characterise(folder, "lost_poses", "long.csv", lambda *_: lost.set())

    with twin(folder) as process:

        def freeze(*_):
            process.send_signal(signal.SIGSTOP)
            time.sleep(2)
            process.send_signal(signal.SIGCONT)

        result["lost_telemetry"] = characterise(folder, "lost_telemetry", "long.csv", freeze)
        (folder / "fast.csv").write_text(SCRIPT.replace("50", "70"))
        result["too_fast"] = characterise_fails(folder, "fast.csv")
        result["held_by_another"] = held_by_another(folder)
    return result


def held_by_another(folder: Path) -> dict:
    """`swarm start` of somebody else holds the robot, before and after."""
    command = [*TWINMILL, "swarm", "start", "--robots", "3", "--arm"]
    command += ["--behavior", "milling"]
    fleet = Fleet(URL)
    with subprocess.Popen(
        [*command, "--key", str(folder / "operator.key")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            fleet.listen(20, lambda: 3 in fleet.robots and fleet.robots[3].mode == "running")
            result = characterise_fails(folder, "steps.csv")
            fleet.listen(0.5)
            return {**result, "mode_after": fleet.robots[3].mode}
        finally:
            process.send_signal(signal.SIGINT)


def characterise_fails(folder: Path, script: str) -> dict:
    log = folder / "none.lcmlog"
    command = [*TWINMILL, "characterise", "--robot", "3"]
    command += ["--key", str(folder / "operator.key")]
    done = subprocess.run(
        [*command, "--script", str(folder / script), "--out", str(log)],
        capture_output=True,
        text=True,
    )
    return {"code": done.returncode, "complaint": done.stderr, "log": log.exists()}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
