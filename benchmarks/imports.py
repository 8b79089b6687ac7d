# SPDX-License-Identifier: Apache-2.0
"""Time and memory of large imports, of several states of the library side by side.

    git worktree add /tmp/before COMMIT
    .venv/bin/python benchmarks/imports.py --before /tmp/before --rows 5000000 --bag-mb 1000

The inputs are made in a temporary folder and go with it. A state uses the native module that was
built in its folder, or else the one that is installed. Each import is a process of
its own; what is told is its processor time and the most memory that it had, of Python's start, too.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parents[1]
RATE_HZ = 100
COMMANDS_HZ = 20
IMAGE_BYTES = 60_000  # of a camera beside the topics that are read, as bags have it

RUN = """
import json, resource, sys
from pathlib import Path
# An editable installation finds its own tree before PYTHONPATH.
sys.meta_path[:] = [f for f in sys.meta_path if not type(f).__module__.startswith("_editable")]
import twinmill
assert str(Path(twinmill.__file__).resolve()).startswith(sys.argv[2]), twinmill.__file__
from twinmill.data.importers.import_log import ImportOptions, import_log
words = json.loads(sys.argv[1])
paths = {k: Path(v) for k, v in words["paths"].items()}
options = ImportOptions(robot_id=1, force=True, **words["options"])
import_log(paths.pop("poses", None), paths.pop("commands", None), paths.pop("out"), **paths,
           options=options)
own = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps([own.ru_utime + own.ru_stime, own.ru_maxrss / 1024]))
"""


def drive(count: int) -> np.ndarray:
    """(count, 4) times (s), positions and headings of a robot that drives as `told` has it."""
    t_s = np.arange(count) / RATE_HZ
    speed_mps, _ = told(t_s)
    heading_rad = np.sin(t_s / 3)
    way_m = speed_mps * np.exp(1j * heading_rad) / RATE_HZ
    place_m = np.cumsum(way_m) - way_m
    return np.column_stack([t_s, place_m.real, place_m.imag, heading_rad])


def told(t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed (m/s) and turn rate (rad/s) of the commands."""
    return 0.2 + 0.1 * np.sin(t_s), np.cos(t_s / 3) / 3


def write_table(folder: Path, rows: int) -> dict:
    """Poses and commands as tables; arguments of the import."""
    poses, commands = folder / "poses.csv", folder / "commands.csv"
    with poses.open("w") as stream:
        stream.write("t_s,x_m,y_m,theta_rad\n")
        np.savetxt(stream, drive(rows), fmt="%.5f", delimiter=",")
    count = rows * COMMANDS_HZ // RATE_HZ
    t_s = np.arange(count) / COMMANDS_HZ
    with commands.open("w") as stream:
        stream.write("t_s,vx_mps,vy_mps,omega_radps\n")
        speed_mps, turn_radps = told(t_s)
        table = np.column_stack([t_s, speed_mps, 0 * t_s, turn_radps])
        np.savetxt(stream, table, fmt="%.4f", delimiter=",")
    paths = {"poses": poses, "commands": commands, "out": folder / "table.lcmlog"}
    return {"paths": paths, "options": {}}


def write_bag(folder: Path, megabytes: int) -> dict:
    """A bag of poses and commands beside pictures, which take most of it."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = store.types
    path = folder / "bag"
    pictures = megabytes * 1_000_000 // IMAGE_BYTES
    header, point, turn, stamp, vector, pose_of, told_of, picture = (
        kind[name]
        for name in (
            *("std_msgs/msg/Header", "geometry_msgs/msg/Point", "geometry_msgs/msg/Quaternion"),
            *("builtin_interfaces/msg/Time", "geometry_msgs/msg/Vector3"),
            *("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TwistStamped"),
            "sensor_msgs/msg/CompressedImage",
        )
    )
    body, twist = kind["geometry_msgs/msg/Pose"], kind["geometry_msgs/msg/Twist"]
    pixels = np.random.default_rng(1).integers(0, 255, IMAGE_BYTES, np.uint8)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        at = {
            topic: bag.add_connection(topic, of.__msgtype__, typestore=store)
            for topic, of in (("/pose", pose_of), ("/told", told_of), ("/camera", picture))
        }

        def put(topic: str, t_s: float, *content) -> None:
            of = {"/pose": pose_of, "/told": told_of, "/camera": picture}[topic]
            ns = int(1.7e18 + t_s * 1e9)
            head = header(stamp(ns // 10**9, ns % 10**9), "map")
            message = of(head, *content)
            bag.write(at[topic], ns, store.serialize_cdr(message, of.__msgtype__))

        poses = drive(5 * pictures)  # at 100 Hz, commands and pictures at 20 Hz
        for k in range(pictures):
            for t_s, x_m, y_m, theta_rad in poses[5 * k : 5 * k + 5]:
                half = np.sin(theta_rad / 2), np.cos(theta_rad / 2)
                orientation = turn(0.0, 0.0, *map(float, half))
                put("/pose", t_s, body(point(float(x_m), float(y_m), 0.0), orientation))
            t_s = k / COMMANDS_HZ
            speed_mps, turn_radps = map(float, told(t_s))
            put("/told", t_s, twist(vector(speed_mps, 0.0, 0.0), vector(0.0, 0.0, turn_radps)))
            put("/camera", t_s, "jpeg", pixels)
    paths = {"bag": path, "out": folder / "bag.lcmlog"}
    return {"paths": paths, "options": {"pose_topics": ("/pose",), "command_topics": ("/told",)}}


def measured(tree: Path, words: dict) -> tuple[float, float]:
    """Processor time (s) and peak memory (MB) of an import by the library in a tree."""
    path = os.pathsep.join(str(tree / part) for part in ("calibration", "tools", "build/python"))
    done = subprocess.run(
        [sys.executable, "-c", RUN, json.dumps(words, default=str), str(tree.resolve())],
        env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{tree}: the import failed: {done.stderr.splitlines()[-1]}")
    seconds, megabytes = json.loads(done.stdout.splitlines()[-1])
    return seconds, megabytes


def main() -> None:
    """Prints a line for each input and state."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--before", type=Path, help="a checkout of an older state")
    parser.add_argument("--rows", type=int, default=500_000, help="of the table of poses")
    parser.add_argument("--bag-mb", type=int, default=0, help="size of a bag; 0: none")
    given = parser.parse_args()
    trees = {"before": given.before, "now": HERE} if given.before else {"now": HERE}
    inputs = [(f"table, {given.rows} rows", write_table, given.rows)] if given.rows else []
    inputs += [(f"bag, {given.bag_mb} MB", write_bag, given.bag_mb)] if given.bag_mb else []
    for name, write, size in inputs:
        with tempfile.TemporaryDirectory() as folder:
            words = write(Path(folder), size)
            for tree, path in trees.items():
                seconds, megabytes = measured(path, words)
                print(f"{name:24} {tree:8} {seconds:8.1f} s {megabytes:8.0f} MB", flush=True)


if __name__ == "__main__":
    main()
