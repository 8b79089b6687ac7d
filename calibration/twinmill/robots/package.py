# SPDX-License-Identifier: Apache-2.0
"""The Debian package of the robot's program: built for arm64 here, or one that is there."""

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from twinmill.arguments import option

ROOT = Path(__file__).resolve().parents[3]
# Debian's releases, and so Raspberry Pi OS's, that a package is built for.
RELEASES = {"12": "bookworm", "13": "trixie"}
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
    """A package file and what it says of itself.

    Attributes:
        release: of Debian, as "12"; empty if it does not say.
    """

    path: Path
    architecture: str
    version: str
    release: str
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
        raise ValueError(f"{option('package', str(path))}: no such file.")
    fields = {}
    for name in ("Package", "Architecture", "Version", "Installed-Size"):
        done = subprocess.run(
            ["dpkg-deb", "--field", str(path), name], capture_output=True, text=True
        )
        if done.returncode != 0:
            raise ValueError(f"{option('package', str(path))}: is no Debian package.")
        fields[name] = done.stdout.strip()
    if fields["Package"] != "turbopi":
        raise ValueError(f"{option('package', str(path))}: is '{fields['Package']}', not turbopi.")
    size_kb = int(fields["Installed-Size"] or 0)
    release = re.search(r"~deb(\d+)$", fields["Version"])
    version = fields["Version"]
    return Package(path, fields["Architecture"], version, release[1] if release else "", size_kb)


class Packages:
    """The package for each robot: one that the user named, or one built for the robot's release."""

    def __init__(self, given: Package | None):
        self.given = given
        self._built: dict[str, Package] = {}
        self._lock = Lock()

    def for_release(self, release: str, progress: Callable[[str], None]) -> Package:
        """Returns the package; builds it if nobody did so far.

        Args:
            release: of the robot's Debian, as "12".
            progress: told what is being done.

        Raises:
            ValueError: there is none for this release, or it cannot be built.
        """
        if self.given and self.given.release in ("", release):
            return self.given
        if self.given or release not in RELEASES:
            known = {self.given.release: ""} if self.given else RELEASES
            raise ValueError(
                f"it runs Debian {release or 'of no number'}, the package is for "
                f"{' or '.join(f'{key} {name}'.strip() for key, name in known.items())}: "
                "put Raspberry Pi OS (64 bit) of that release on its card."
            )
        with self._lock:
            if release not in self._built:
                self._built[release] = build_package(RELEASES[release], progress)
            return self._built[release]


def build_package(suite: str, progress: Callable[[str], None]) -> Package:
    """Builds for arm64; only what changed since the last time.

    Args:
        suite: Debian's name of the release.
        progress: told what is being done.

    Raises:
        ValueError: a tool is missing, or a step failed, with its last words.
    """
    missing = [package for program, package in NEEDED.items() if not shutil.which(program)]
    if missing:
        raise ValueError(
            f"the package cannot be built: install {' '.join(missing)}, or give "
            f"{option('package')} FILE."
        )
    sysroot, build = ROOT / ".deps" / f"sysroot-{suite}", ROOT / "build" / f"arm64-{suite}"
    if not sysroot.is_dir():
        progress("fetching the robot's headers and libraries, once")
        _run([str(ROOT / "scripts/make_sysroot"), str(sysroot), suite])
    progress(f"building for arm64, {suite}")
    options = [
        f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'cmake' / 'aarch64.cmake'}",
        f"-DTWINMILL_SYSROOT={sysroot}",
        "-DTWINMILL_BUILD_TWIN=OFF",
        "-DTWINMILL_BUILD_TESTS=OFF",
        "-DCMAKE_BUILD_TYPE=Release",
    ]
    _run(["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", *options])
    _run(["cmake", "--build", str(build)])
    for old in build.glob("turbopi_*.deb"):
        old.unlink()
    _run(["cpack", "--config", str(build / "CPackConfig.cmake"), "-B", str(build)])
    return read_package(next(build.glob("turbopi_*_arm64.deb")))


def _run(command: list[str]) -> None:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        last = " ".join((done.stderr or done.stdout).strip().splitlines()[-3:])
        raise ValueError(f"the package cannot be built: {Path(command[0]).name} failed: {last}")
