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
PLAIN, STAMPED = "Twist", "TwistStamped"
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
    """A node that hears it drive the script to its end, and twice until Ctrl-C."""
    whole, stopped, stamped = (
        _heard(folder, *how) for how in ((PLAIN, 0), (PLAIN, 1.5), (STAMPED, 1.5))
    )
    begin_s = whole[0][0]
    at = [next(s - begin_s for s, _, *told in whole if tuple(told) == row) for row in ROWS]
    return {
        "rows, from the first on": all(abs(s - k) < LATE_S for k, s in enumerate(at)),
        "stands at the end": all(not any(told) for _, _, *told in whole[-3:]),
        "stands after Ctrl-C": _stands(stopped),
        "as TwistStamped": _stands(stamped) and all(0 <= late < LATE_S for _, late, *_ in stamped),
    }


def _stands(heard: list[list[float]]) -> bool:
    """True if it drove the second row and then stood."""
    return tuple(heard[-10][2:]) == ROWS[1] and not any(heard[-1][2:])


def _heard(folder: Path, kind: str, stop_s: float) -> list[list[float]]:
    """Time in s, lateness against its stamp, and velocities of each message that arrives.

    From a process in a network without a way out.
    """
    command = [*_alone(), "sh", "-c", NETWORK, "sh", sys.executable, "-m", "interop.ros_node"]
    command += [str(folder), kind, str(stop_s)]
    home = {"ROS_LOG_DIR": str(folder / "log")}
    subprocess.run(command, env=os.environ | home, check=True, timeout=120)
    return json.loads((folder / HEARD).read_text())


def _alone() -> list[str]:
    """Begins a command in a network namespace of its own."""
    return ["unshare", "--net", *([] if os.geteuid() == 0 else ["--map-root-user"])]


def _listen(folder: Path, kind: str, stop_s: float) -> None:
    """Hears the node to its end; after `stop_s`, if that is not 0, it gets a Ctrl-C."""
    import rclpy
    from geometry_msgs import msg

    rclpy.init()
    ear, heard = rclpy.create_node("ear"), []

    def hear(message) -> None:
        late_s, twist = 0.0, message
        if kind == STAMPED:
            stamp, twist = message.header.stamp, message.twist
            late_s = time.time() - stamp.sec - 1e-9 * stamp.nanosec
        told = twist.linear.x, twist.linear.y, twist.angular.z
        heard.append([time.monotonic(), late_s, *told])

    ear.create_subscription(getattr(msg, kind), TOPIC, hear, 100)
    words = [sys.executable, str(folder / NODE), "--ros-args", "-r", f"cmd_vel:=/{TOPIC}"]
    words += ["-p", "stamped:=true"] if kind == STAMPED else []
    with subprocess.Popen(words) as node:
        while node.poll() is None:
            rclpy.spin_once(ear, timeout_sec=0.01)
            if stop_s and heard and time.monotonic() - heard[0][0] > stop_s:
                node.send_signal(signal.SIGINT)
                stop_s = 0
    rclpy.shutdown()
    (folder / HEARD).write_text(json.dumps(heard))


if __name__ == "__main__":
    _listen(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
