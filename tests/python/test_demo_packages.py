# SPDX-License-Identifier: Apache-2.0
"""Without extras, as after `make demo`, the loop works, and the rest says which extra it needs."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from twinmill.extras import EXTRAS
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
LIBRARY = """
import twinmill as tm
log = tm.load("swarm.lcmlog")
assert log.commands().size and log.metrics().size and tm.Model.load("turbopi.toml").table().size
try:
    log.export("out", to="parquet")
except ImportError as error:
    print(error)
"""
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
BUILDS = {"nanobind", "scikit-build-core"}  # beside what a wheel needs
MOST = 10  # packages that everybody gets


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
    there = installed_with(list(PROJECT["dependencies"])) | {"twinmill"}
    absent = {
        module
        for module, owners in metadata.packages_distributions().items()
        if not {name_of(owner) for owner in owners} & there
    }
    assert {"pyarrow", "nicegui", "rosbags"} <= absent
    assert not {"numpy", "scipy", "rich", "matplotlib", "twinmill_cli", "twinmill_native"} & absent
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


@pytest.mark.parametrize(("line", "extra"), [
    ("open swarm.lcmlog", "workbench"),
    ("phase sweep", "sweep"),
    ("next swarm.lcmlog --for milling -o other.csv", "sweep"),
    ("export swarm.lcmlog --to parquet", "export"),
    ("export swarm.lcmlog --to mcap", "export"),
    ("export swarm.lcmlog --to rosbag2", "ros"),
    ("export-model turbopi.toml --to ros2_control", "ros"),
    ("import --bag no.bag", "ros"),
    ("discover --out found", "discover"),
    ("tags --out tags.pdf", "camera"),
    ("optitrack --server 127.0.0.1", "optitrack"),
    ("watch swarm.lcmlog --save shown.rrd", "watch"),
])  # fmt: skip
def test_a_task_whose_extra_is_missing_names_it_in_one_sentence(program, folder, line, extra):
    done = told(program, folder, line)
    assert done.returncode == 1
    assert re.fullmatch(
        r"twinmill: the Python package of '\w+' is not installed; install it with: (\S+ -m )?pip "
        rf"install 'twinmill\[{extra}\]'\n",
        done.stderr,
    ), done.stderr


@pytest.mark.parametrize("name", ["challenge", "claims"])
def test_what_only_an_article_needs_is_no_part_of_the_wheel_and_says_what_to_install(folder, name):
    done = told(WITHOUT.format(absent={"twinmill_lab"}), folder, f"lab {name}")
    assert done.returncode == 1
    assert re.fullmatch(r"twinmill: .* pip install twinmill_lab-\S+-any\.whl\n", done.stderr)
    of_wheel = SETTINGS["tool"]["scikit-build"]["wheel"]["packages"]
    assert of_wheel == ["calibration/twinmill", "tools/twinmill_cli"]


def test_a_sweep_without_its_extra_names_it(program, folder):
    sweep = program.replace("twinmill_cli.main", "twinmill_cli.twin_sweep")
    done = told(sweep, folder, "--x v_mps=0.1,0.2 --out sweep")
    assert done.returncode == 1 and "install 'twinmill[sweep]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_library_works_without_extras_and_names_the_missing_one(program, folder):
    alone = program.replace("from twinmill_cli.main import main\nmain()", LIBRARY)
    done = subprocess.run([sys.executable, "-c", alone], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "pip install 'twinmill[export]'" in done.stdout


def test_everybody_gets_few_packages_and_each_extra_what_its_modules_import():
    """The demo's list is that of everybody, and what builds; each import is in one or the other."""
    listed = (ROOT / "scripts/demo-packages.txt").read_text().splitlines()
    everybodys = {name_of(line) for line in PROJECT["dependencies"]}
    assert {name for name in listed if name[0] != "#"} == everybodys | BUILDS
    assert len(everybodys) <= MOST
    owners, extras = metadata.packages_distributions(), PROJECT["optional-dependencies"]
    for extra, modules in EXTRAS.items():
        brought = installed_with(list(extras[extra])) | set(map(name_of, extras[extra]))
        for module in modules:
            if module in owners:  # the viewer is not
                assert {name_of(owner) for owner in owners[module]} & brought, module
    ours = {"twinmill", "twinmill_cli", "twinmill_native", "turbopi"}
    others = {module for modules in EXTRAS.values() for module in modules}
    here = installed_with([*everybodys])
    for module in imported() - ours - others - sys.stdlib_module_names:
        assert {name_of(owner) for owner in owners[module]} & here, module
    assert name_of(extras["all"][0]) == "twinmill"
    assert set(re.findall(r"\w+", extras["all"][0])[1:]) == set(extras) - {"all"}


def imported() -> set[str]:
    """Packages that the library and the commands import."""
    found = set()
    for file in [*ROOT.glob("calibration/**/*.py"), *ROOT.glob("tools/**/*.py")]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").partition(".")[0])
    return found
