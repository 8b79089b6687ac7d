# SPDX-License-Identifier: Apache-2.0
"""The node for ROS 2 that drives a script, heard by another one in a network of their own."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from interop.cells import NotInstalled, Told, writes
from interop.robot import TEXT
from interop.rosbag import ROS2

NODE, TOPIC, HEARD = "drive.py", "r03/cmd_vel", "heard.json"
SCRIPT = "t_s,vx_mps,vy_mps,omega_radps\n0,0.1,0,0\n1,0.2,-0.1,0\n2,0,0,1.5\n3,0,0,0\n"
ROWS = [(0.1, 0, 0), (0.2, -0.1, 0), (0, 0, 1.5)]
NETWORK = 'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"'
LATE_S = 0.15  # three of its periods: a loaded machine


def _write(folder: Path) -> None:
    """By `twinmill robot characterise --script-as publisher`."""
    from twinmill_cli.main import run

    if not shutil.which("unshare") or subprocess.run([*_alone(), "true"], check=False).returncode:
        raise NotInstalled("no network of its own here, as `unshare --net` makes it")
    (folder / "m.toml").write_text(TEXT)
    (folder / "s.csv").write_text(SCRIPT)
    words = ["characterise", "--robot", "3", "--script", str(folder / "s.csv")]
    words += ["--model", str(folder / "m.toml"), "--script-as", "publisher"]
    assert run([*words, "--out", str(folder / NODE)]) == 0


@writes("ROS 2 node", "ROS 2 Jazzy, `rclpy`", *ROS2, ours=_write)
def rclpy(folder: Path) -> Told:
    """A node that hears it drive the script to its end, and once more until Ctrl-C."""
    whole, stopped = (_heard(folder, stop_s) for stop_s in (0, 1.5))
    begin_s = whole[0][0]
    at = [next(s - begin_s for s, *told in whole if tuple(told) == row) for row in ROWS]
    return {
        "rows, from the first on": all(abs(s - k) < LATE_S for k, s in enumerate(at)),
        "stands at the end": all(not any(told) for _, *told in whole[-3:]),
        "stands after Ctrl-C": tuple(stopped[-10][1:]) == ROWS[1] and not any(stopped[-1][1:]),
    }


def _heard(folder: Path, stop_s: float) -> list[list[float]]:
    """Times in s and velocities that arrive, from a process in a network without a way out."""
    command = [*_alone(), "sh", "-c", NETWORK, "sh", sys.executable, "-m", "interop.ros_node"]
    command += [str(folder), str(stop_s)]
    home = {"ROS_LOG_DIR": str(folder / "log")}
    subprocess.run(command, env=os.environ | home, check=True, timeout=120)
    return json.loads((folder / HEARD).read_text())


def _alone() -> list[str]:
    """Begins a command in a network namespace of its own."""
    return ["unshare", "--net", *([] if os.geteuid() == 0 else ["--map-root-user"])]


def _listen(folder: Path, stop_s: float) -> None:
    """Hears the node to its end; after `stop_s`, if that is not 0, it gets a Ctrl-C."""
    import rclpy
    from geometry_msgs.msg import Twist

    rclpy.init()
    ear, heard = rclpy.create_node("ear"), []

    def hear(twist: Twist) -> None:
        heard.append([time.monotonic(), twist.linear.x, twist.linear.y, twist.angular.z])

    ear.create_subscription(Twist, TOPIC, hear, 100)
    words = [sys.executable, str(folder / NODE), "--ros-args", "-r", f"cmd_vel:=/{TOPIC}"]
    with subprocess.Popen(words) as node:
        while node.poll() is None:
            rclpy.spin_once(ear, timeout_sec=0.01)
            if stop_s and heard and time.monotonic() - heard[0][0] > stop_s:
                node.send_signal(signal.SIGINT)
                stop_s = 0
    rclpy.shutdown()
    (folder / HEARD).write_text(json.dumps(heard))


if __name__ == "__main__":
    _listen(Path(sys.argv[1]), float(sys.argv[2]))
