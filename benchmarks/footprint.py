# SPDX-License-Identifier: Apache-2.0
"""Size of the robot's program in a file and in memory, against what was allowed for it."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import scene
from ratio import Ratio, single, skipped
from robot import Robot

FILE_KB, MEMORY_KB = 100, 4096
FRAME_KB = 2 * scene.WIDTH_PX * scene.HEIGHT_PX / 1024
ARM64_STRIP = "aarch64-linux-gnu-strip"


def measure(build: Path, arm64_program: Path | None) -> Iterator[Ratio]:
    """The stripped file for both machines, and the running program's memory by three measures."""
    # Where its hash comes in versions for many processors.
    yield _file("native", build / "bin/turbopi", "strip")
    if arm64_program is None:
        yield skipped("stripped, arm64 : 100 KB", "no --arm64-program given")
    else:
        yield _file("arm64", arm64_program, ARM64_STRIP, at_most=1)
    yield from _memory(build / "bin/turbopi")


def _file(name: str, program: Path, strip: str, **goal: float) -> Ratio:
    with tempfile.TemporaryDirectory() as folder:
        stripped = Path(folder) / "turbopi"
        if shutil.which(strip) is None:
            return skipped(f"stripped, {name} : 100 KB", f"no {strip}")
        subprocess.run([strip, "-o", stripped, program], check=True)
        size_kb = stripped.stat().st_size / 1024
    return single(f"stripped, {name} : 100 KB", size_kb, FILE_KB, "KB", **goal)


def _memory(program: Path) -> Iterator[Ratio]:
    with (
        tempfile.TemporaryDirectory() as folder,
        Robot(program, Path(folder), "udpm://239.255.76.67:7667?ttl=0") as robot,
    ):
        for i in range(60):
            robot.show(scene.floor(1, robot_radius_px=40 * (i % 2)))
            time.sleep(1 / 30)
        driver = _rollup_kb(robot.driver())
        each = [_rollup_kb(pid) for pid in robot.pids()]
    # The stand-in for the camera keeps one frame in the program's own memory.
    counts = {
        "driving one, resident": driver["Rss"] - FRAME_KB,
        "all four, shared in parts": sum(one["Pss"] for one in each) - FRAME_KB,
        "all four, own data": sum(one["Anonymous"] for one in each) - FRAME_KB,
    }
    for name, size_kb in counts.items():
        yield single(f"{name} : 4 MB", size_kb, MEMORY_KB, "KB", at_most=1)


def _rollup_kb(pid: int) -> dict[str, float]:
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]
    return {line.split(":")[0]: float(line.split()[1]) for line in lines}
