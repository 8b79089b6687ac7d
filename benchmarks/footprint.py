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

FILE_BYTES, MEMORY_KB = 100_000, 4096
FRAME_KB = 2 * scene.WIDTH_PX * scene.HEIGHT_PX / 1024
ARM64_STRIP = "aarch64-linux-gnu-strip"


def measure(build: Path, arm64_program: Path | None) -> Iterator[Ratio]:
    """The stripped files of each machine, and the running program's memory by three measures."""
    # Where its hash comes in versions for many processors.
    yield _file("native", build / "bin/turbopi", "strip")
    # Where the emulated robot was tested, its packages were built.
    arm64 = [arm64_program] if arm64_program else sorted(build.glob("arm64-*/bin/turbopi"))
    for program in arm64:
        yield _file(program.parents[1].name, program, ARM64_STRIP, at_most=1)
    if not arm64:
        yield skipped("stripped, arm64 : 100 kB", "not built: give --arm64-program")
    yield from _memory(build / "bin/turbopi")


def _file(name: str, program: Path, strip: str, **goal: float) -> Ratio:
    with tempfile.TemporaryDirectory() as folder:
        stripped = Path(folder) / "turbopi"
        if shutil.which(strip) is None:
            return skipped(f"stripped, {name} : 100 kB", f"no {strip}")
        subprocess.run([strip, "-o", stripped, program], check=True)
        size = stripped.stat().st_size
    return single(f"stripped, {name} : 100 kB", size, FILE_BYTES, "B", **goal)


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
