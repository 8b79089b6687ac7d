# SPDX-License-Identifier: Apache-2.0
"""The decision in instructions of the robot's own processor family, against a copy.

An emulator's time says nothing about a robot's; the number of instructions does not depend on the
machine. The emulator runs one instruction at a time and writes a line for each; the difference
between two decisions and one leaves out everything else.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import scene
from ratio import Ratio, single, skipped

ROOT = Path(__file__).resolve().parents[1]
COMPILER, EMULATOR = "aarch64-linux-gnu-gcc", "qemu-aarch64-static"
# As the build's own: CMake's Release, and cmake/TwinmillTargets.cmake.
FLAGS = ("-std=c11", "-O3", "-DNDEBUG", "-ffp-contract=off", "-D_GNU_SOURCE", "-static")


def measure() -> Iterator[Ratio]:
    """Instructions of memcpy and of the decision, on three scenes."""
    missing = [tool for tool in (COMPILER, EMULATOR) if shutil.which(tool) is None]
    if missing:
        yield skipped("decision : memcpy, arm64", f"no {' and no '.join(missing)}")
        return
    with tempfile.TemporaryDirectory() as folder:
        try:
            program = _compile(Path(folder))
        except subprocess.CalledProcessError as error:
            said = error.stderr.strip().splitlines()
            yield skipped(
                "decision : memcpy, arm64", f"{COMPILER}: {said[0] if said else 'failed'}"
            )
            return
        scenes = {
            "one robot": scene.floor(1, robot_radius_px=40),
            "no robot": scene.floor(1),
            "random": scene.noise(1),
        }
        for label, picture in scenes.items():
            frame = Path(folder) / "frame.yuyv"
            frame.write_bytes(picture.tobytes())
            copy, decide = (_instructions(program, frame, what) for what in ("copy", "decide"))
            yield single(f"decision : memcpy, arm64, {label}", decide, copy, "ins")


def _compile(folder: Path) -> Path:
    core = ROOT / "firmware/core"
    sources = [*core.glob("*.c"), ROOT / "benchmarks/decision.c", ROOT / "benchmarks/count.c"]
    program = folder / "count"
    command = [COMPILER, *FLAGS, f"-I{core / 'include'}", "-o", program, *sources]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return program


def _instructions(program: Path, frame: Path, what: str) -> int:
    once, twice = (_executed(program, frame, what, count) for count in (1, 2))
    return twice - once


def _executed(program: Path, frame: Path, what: str, count: int) -> int:
    emulator = [EMULATOR, "-singlestep", "-d", "exec,nochain", program, frame, what, str(count)]
    with subprocess.Popen(emulator, stderr=subprocess.PIPE) as process:
        lines = sum(line.startswith(b"Trace") for line in process.stderr)
    if process.returncode != 0:
        raise ValueError(f"{EMULATOR} ended with {process.returncode}.")
    return lines
