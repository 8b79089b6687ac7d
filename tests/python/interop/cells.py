# SPDX-License-Identifier: Apache-2.0
"""Runner of one other program on one file, and the table of the results.

The other program's side of a cell runs in a Python of its own that has its packages alone, so its
module imports at the top nothing but the standard library and this module.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BEGIN, END = "<!-- interop:begin -->", "<!-- interop:end -->"
HEAD = f"| format | Twinmill | other program | version | run | carried | ignored |\n{'|---' * 7}|"
Told = dict[str, bool]  # what was looked at, and whether it came through


class NotInstalled(Exception):
    """A package of Debian that a cell needs is not there."""


@dataclass(frozen=True)
class Cell:
    """One format between Twinmill and one other program, in one direction.

    Attributes:
        format: what the file is.
        direction: what Twinmill does with it, `writes` or `reads`.
        program: the other one.
        packages: that it needs, its own first: `name==version` of PyPI, `name@version` of npm,
            `name` of Debian.
        theirs: its side; given a folder. Tells what came through if it reads.
        ours: Twinmill's side, likewise.
        why_not: it cannot be run, for this reason.
    """

    format: str
    direction: str
    program: str
    packages: tuple[str, ...] = ()
    theirs: Callable[[Path], Told | None] | None = None
    ours: Callable[[Path], Told | None] | None = None
    why_not: str = ""

    @property
    def pinned(self) -> bool:
        """The other program's version stands here."""
        return any(mark in self.packages[0] for mark in ("==", "@"))

    @property
    def quick(self) -> bool:
        """Nothing is fetched or compiled for it."""
        return not any(mark in name for name in self.packages for mark in ("==", "@", "-dev"))

    def run(self, folder: Path) -> Told:
        """Both sides, the writing one first.

        Raises:
            NotInstalled: a package of Debian is missing.
            subprocess.CalledProcessError: the other side failed; its error is on stderr.
        """
        version_of(self)
        if self.direction == "writes":
            self.ours(folder)
            return self._theirs_apart(folder)
        self._theirs_apart(folder)
        return self.ours(folder)

    def _theirs_apart(self, folder: Path) -> Told | None:
        pinned = [name for name in self.packages if "==" in name]
        python = _python_with(pinned) if pinned else sys.executable
        names = [self.theirs.__module__, self.theirs.__name__, str(folder)]
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
        if of_npm := [name for name in self.packages if "@" in name]:
            environment["NODE_PATH"] = str(_installed_by_npm(of_npm))
        subprocess.run(
            [python, "-m", "interop.apart", *names], env=environment, cwd=folder, check=True
        )
        return json.loads((folder / "told.json").read_text())


def writes(format: str, program: str, *packages: str, ours: Callable) -> Callable:
    """Marks a function that reads with another program what `ours` wrote into a folder."""
    return lambda theirs: _marked(Cell(format, "writes", program, packages, theirs, ours))


def reads(format: str, program: str, *packages: str, ours: Callable) -> Callable:
    """Marks a function that writes into a folder, with another program, what `ours` reads."""
    return lambda theirs: _marked(Cell(format, "reads", program, packages, theirs, ours))


def _marked(cell: Cell) -> Callable:
    cell.theirs.cell = cell
    return cell.theirs


def cells_of(module) -> list[Cell]:
    """Those of a format's module, in the order that they stand in; `NOT_RUN` comes last."""
    marked = [thing.cell for thing in vars(module).values() if hasattr(thing, "cell")]
    return [*marked, *getattr(module, "NOT_RUN", ())]


def version_of(cell: Cell) -> str:
    """The other program's.

    Raises:
        NotInstalled: a package of Debian is missing.
    """
    versions = [_version(name) for name in cell.packages]
    return versions[0] if versions else ""


def _version(package: str) -> str:
    for mark in ("==", "@"):
        name, _, version = package.rpartition(mark)
        if name:
            return version
    return _debian(package)


def _debian(package: str) -> str:
    command = ["dpkg-query", "--show", "--showformat", "${Version}", package]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode or not done.stdout:
        raise NotInstalled(f"{package} is not installed (Debian: apt install {package})")
    return re.sub(r"^\d+:|[+~-].*$", "", done.stdout)


def packages_at(*names: str) -> Path:
    """Folder of packages of PyPI, for a program in them."""
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return _python_with(list(names)).parents[1] / "lib" / version / "site-packages"


def _python_with(pinned: list[str]) -> Path:
    """A Python that has these packages of PyPI and what they need."""
    folder = ROOT / ".deps/interop" / "_".join(pinned)
    python, done = folder / "bin/python", folder / "installed"
    if not done.exists():
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
        pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
        subprocess.run([*pip, "--no-compile", *pinned], check=True)
        done.touch()
    return python


def _installed_by_npm(names: list[str]) -> Path:
    """Folder of these packages of npm and what they need, where Node looks for modules."""
    if not shutil.which("npm"):
        raise NotInstalled("npm is not installed (Debian: apt install npm)")
    folder = ROOT / ".deps/interop" / "_".join(names).replace("/", "+")
    if not (folder / "node_modules").exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = ["npm", "install", "--silent", "--no-audit", "--no-fund", *names]
        subprocess.run(command, cwd=folder, check=True)
    return folder / "node_modules"


def row(cell: Cell, told: Told, date: str) -> str:
    """A line of the table."""
    names = [cell.format, cell.direction, cell.program]
    if cell.why_not:
        return "| " + " | ".join([*names, "", "", f"not run, because {cell.why_not}", ""]) + " |"
    sides = ["; ".join(what for what in told if bool(told[what]) is came) for came in (True, False)]
    return "| " + " | ".join([*names, version_of(cell), date, *sides]) + " |"


def rows_of(page: str) -> list[str]:
    """Lines of the table in a page, without its head."""
    table = page.split(BEGIN)[1].split(END)[0]
    return table.strip().splitlines()[2:]


def lasting(line: str, *, pinned: bool) -> str:
    """A line of the table without its day, and without a version that Debian chooses."""
    parts = line.split("|")
    return "|".join([*parts[: 5 if pinned else 4], *parts[6:]])
