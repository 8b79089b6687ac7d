# SPDX-License-Identifier: Apache-2.0
"""With the Python packages of `make demo` alone the loop works, and the rest says what it needs."""

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from twinmill.programs import find_program
from twinmill_cli import main as cli

ROOT = Path(__file__).resolve().parents[2]
RECORDING = ROOT / "examples" / "make_recording.py"
# A program that has no other packages: `python -c` of it, with the command's words.
WITHOUT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
from twinmill_cli.main import main
main()
"""


def name_of(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement.strip())[0].lower().replace("_", "-")


def installed_with(names: list[str]) -> set[str]:
    """Distributions that these need, themselves included, without extras."""
    found: set[str] = set()
    while names:
        name = name_of(names.pop())
        try:
            needed = metadata.requires(name) or []
        except metadata.PackageNotFoundError:  # for another system
            continue
        if name not in found:
            found.add(name)
            names += [r for r in needed if "extra ==" not in r]
    return found


@pytest.fixture(scope="module")
def program() -> str:
    """The command line program as `make demo` leaves it."""
    listed = (ROOT / "scripts/demo-packages.txt").read_text().splitlines()
    there = installed_with([name for name in listed if name[0] != "#"]) | {"twinmill"}
    absent = {
        module
        for module, owners in metadata.packages_distributions().items()
        if not {name_of(owner) for owner in owners} & there
    }
    assert {"pyarrow", "nicegui", "pandas"} <= absent
    assert not {"numpy", "scipy", "matplotlib", "twinmill_cli", "twinmill_native"} & absent
    return WITHOUT.format(absent=absent)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two CSV files of a robot, and the log of a swarm."""
    folder = tmp_path_factory.mktemp("demo")
    run = {"cwd": folder, "check": True, "capture_output": True}
    subprocess.run([sys.executable, str(RECORDING)], **run)
    swarm = ["--plant", "planar", "--n", "4", "--duration-s", "15", "--log", "swarm.lcmlog"]
    subprocess.run([str(find_program("twin_run")), *swarm], **run)
    return folder


def told(program: str, folder: Path, line: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", program, *line.split()], cwd=folder, capture_output=True, text=True
    )


@pytest.mark.parametrize("line", [
    "import --poses poses.csv --commands commands.csv -o run.lcmlog",
    "compare run.lcmlog --model turbopi.toml",
    "metrics swarm.lcmlog",
    "plot swarm.lcmlog",
])  # fmt: skip
def test_what_is_quick_works(program, folder, line):
    done = told(program, folder, line)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["fit", "add", "diagnose", "explain", "next", "effects", "set"])
def test_the_rest_of_the_loop_has_what_it_imports(program, name):
    """Those take long: their modules are imported alone."""
    module = {n: m for n, m, _ in cli.COMMANDS}[name]
    alone = program.replace(
        "from twinmill_cli.main import main\nmain()", f"import twinmill_cli.{module}"
    )
    subprocess.run([sys.executable, "-c", alone], check=True)


@pytest.mark.parametrize("line", [
    "open swarm.lcmlog",
    "phase sweep",
    "export swarm.lcmlog --to parquet",
    "next swarm.lcmlog --for milling -o other.csv",
])  # fmt: skip
def test_others_name_the_package_and_the_way_to_it(program, folder, line):
    done = told(program, folder, line)
    assert done.returncode == 1
    assert re.fullmatch(
        r"twinmill: the Python package of '\w+' is not installed; `make build` does that.\n",
        done.stderr,
    )
