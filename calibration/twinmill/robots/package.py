# SPDX-License-Identifier: Apache-2.0
"""The Debian package of the robot's program: built for arm64 here, or one that is there."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SYSROOT, BUILD = ROOT / ".deps" / "sysroot-arm64", ROOT / "build" / "arm64"
# Programs, and the Debian packages that have them.
NEEDED = {
    "aarch64-linux-gnu-gcc": "gcc-aarch64-linux-gnu",
    "cmake": "cmake",
    "dpkg-deb": "dpkg",
    "mmdebstrap": "mmdebstrap",
    "ninja": "ninja-build",
}


@dataclass(frozen=True)
class Package:
    """A package file and what it says of itself."""

    path: Path
    architecture: str
    version: str
    installed_kb: int

    @property
    def needed_kb(self) -> int:
        """Free space that installing takes: uploaded, kept, unpacked, and something to spare."""
        return self.installed_kb + 3 * (self.path.stat().st_size // 1024 + 1) + 1024


def read_package(path: Path) -> Package:
    """Reads what a package says.

    Raises:
        ValueError: it is none, or not of the robot's program.
    """
    if not path.is_file():
        raise ValueError(f"--package {path}: no such file.")
    fields = {}
    for name in ("Package", "Architecture", "Version", "Installed-Size"):
        done = subprocess.run(
            ["dpkg-deb", "--field", str(path), name], capture_output=True, text=True
        )
        if done.returncode != 0:
            raise ValueError(f"--package {path}: is no Debian package.")
        fields[name] = done.stdout.strip()
    if fields["Package"] != "turbopi":
        raise ValueError(f"--package {path}: is '{fields['Package']}', not turbopi.")
    size_kb = int(fields["Installed-Size"] or 0)
    return Package(path, fields["Architecture"], fields["Version"], size_kb)


def build_package(say: Callable[[str], None]) -> Package:
    """Builds for arm64; only what changed since the last time.

    Args:
        say: told what is being done.

    Raises:
        ValueError: a tool is missing, or a step failed, with its last words.
    """
    missing = [package for program, package in NEEDED.items() if not shutil.which(program)]
    if missing:
        raise ValueError(
            f"the package cannot be built: install {' '.join(missing)}, or give --package FILE."
        )
    if not SYSROOT.is_dir():
        say("fetching the robot's headers and libraries, once")
        _run([str(ROOT / "scripts/make_sysroot"), str(SYSROOT)])
    say("building for arm64")
    options = [
        f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'cmake' / 'aarch64.cmake'}",
        f"-DTWINMILL_SYSROOT={SYSROOT}",
        "-DTWINMILL_BUILD_TWIN=OFF",
        "-DTWINMILL_BUILD_TESTS=OFF",
        "-DCMAKE_BUILD_TYPE=Release",
    ]
    _run(["cmake", "-S", str(ROOT), "-B", str(BUILD), "-G", "Ninja", *options])
    _run(["cmake", "--build", str(BUILD)])
    for old in BUILD.glob("turbopi_*.deb"):
        old.unlink()
    _run(["cpack", "--config", "CPackConfig.cmake"])
    return read_package(next(BUILD.glob("turbopi_*_arm64.deb")))


def _run(command: list[str]) -> None:
    folder = BUILD if command[0] == "cpack" else ROOT
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        last = " ".join((done.stderr or done.stdout).strip().splitlines()[-3:])
        raise ValueError(f"the package cannot be built: {Path(command[0]).name} failed: {last}")
