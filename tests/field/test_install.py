# SPDX-License-Identifier: Apache-2.0
"""robot.sh with Debian's own apt and dpkg, in roots of their own, without a network.

A robot must be left as it was by an installation that fails: whatever dpkg and apt say of it before
and after is the same.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from twinmill.robots.remote import ROBOT_SCRIPT

# The vendor's image is Debian 11.
SUITES = ("bullseye", "bookworm")
ROOTS = Path(__file__).resolve().parents[2] / ".deps/roots"
# Not installed there, and to be had.
LIBRARY = "libgpiod2"
REQUIRED = ("mmdebstrap", "unshare", "chroot", "dpkg-deb")


def cut_lists(root: Path) -> None:
    """Leaves in apt's lists what is installed, and LIBRARY: all of Debian takes it seconds."""
    status = (root / "var/lib/dpkg/status").read_text().splitlines()
    kept = {f"Package: {LIBRARY}", *(line for line in status if line.startswith("Package: "))}
    for path in (root / "var/lib/apt/lists").glob("*_Packages"):
        entries = [e for e in path.read_text().split("\n\n") if e.partition("\n")[0] in kept]
        path.write_text("".join(f"{entry}\n\n" for entry in entries))


def debootstrap(suite: str) -> Path:
    """A root with apt that knows few packages, kept for the next run."""
    root = ROOTS / f"{suite}.few"
    if not root.is_dir():
        part = ROOTS / f"{suite}.part"
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        made = subprocess.run(
            [
                "mmdebstrap",
                "--quiet",
                "--variant=apt",
                "--mode=root",
                "--skip=cleanup/apt/lists",
                suite,
                part,
            ],
            capture_output=True,
            text=True,
        )
        if made.returncode != 0:
            pytest.skip(f"{suite} cannot be fetched: {made.stderr.strip().splitlines()[-1]}")
        cut_lists(part)
        part.rename(root)
    return root


class Robot:
    """A copy of a root, in which commands run without a network."""

    def __init__(self, folder: Path, suite: str):
        self.root = folder / suite
        subprocess.run(["cp", "-a", debootstrap(suite), self.root], check=True)

    def run(self, *command: str, text: bytes | None = None) -> subprocess.CompletedProcess:
        inside = 'mount -t proc proc "$1/proc"; root=$1; shift; exec chroot "$root" "$@"'
        return subprocess.run(
            ["unshare", "--mount", "--net", "--pid", "--fork", "--kill-child",
             "sh", "-c", inside, "sh", self.root, *command],
            input=text, capture_output=True, timeout=300,
        )  # fmt: skip

    def step(self, *words: str) -> subprocess.CompletedProcess:
        """A step of robot.sh, as ssh runs it."""
        return self.run("sh", "-s", "--", *words, text=ROBOT_SCRIPT.read_bytes())

    def install(self, package: Path) -> str:
        """Installs. Returns what it complains of."""
        shutil.copy(package, self.root / "tmp/turbopi.XYZ")
        return self.step("install", "/tmp/turbopi.XYZ").stderr.decode()

    def probe(self) -> dict[str, str]:
        lines = self.step("probe").stdout.decode().splitlines()
        return dict(line.split("=", 1) for line in lines)

    def packages(self) -> str:
        """Packages that dpkg knows, half-installed ones among them."""
        return self.run(
            "dpkg-query", "-W", "-f", "${Package} ${Version} ${Status}\n"
        ).stdout.decode()

    def apt_is_sound(self) -> bool:
        return (
            self.run("apt-get", "check").returncode == 0 and not self.run("dpkg", "--audit").stdout
        )


def make_package(
    folder: Path, version: str, depends: str = "", postinst: str = "exit 0", name: str = "turbopi"
) -> Path:
    staged = folder / f"{name}-{version}"
    (staged / "usr/bin").mkdir(parents=True)
    (staged / "DEBIAN").mkdir()
    (staged / "usr/bin" / name).write_text("#!/bin/sh\n")
    (staged / "DEBIAN/postinst").write_text(f"#!/bin/sh\n{postinst}\n")
    (staged / "DEBIAN/postinst").chmod(0o755)
    (staged / "DEBIAN/control").write_text(
        f"Package: {name}\nVersion: {version}\nArchitecture: all\n"
        "Maintainer: nobody <nobody@example.invalid>\nDescription: test\n"
        + (f"Depends: {depends}\n" if depends else "")
    )
    path = folder / f"{name}_{version}.deb"
    subprocess.run(["dpkg-deb", "--build", "-Znone", staged, path], check=True, capture_output=True)
    return path


@pytest.fixture
def make(tmp_path):
    """Makes robots."""
    missing = [name for name in REQUIRED if not shutil.which(name)]
    if missing:
        pytest.skip(f"not here: {', '.join(missing)}")
    if os.geteuid() != 0:
        pytest.skip("only root may change into another root")
    return lambda suite: Robot(tmp_path, suite)


@pytest.mark.parametrize("suite", SUITES)
def test_unmet_dependency_is_named_and_nothing_is_changed(make, tmp_path, suite):
    robot = make(suite)
    before = robot.packages()
    # Newer than any of the two has.
    said = robot.install(make_package(tmp_path, "1", "libc6 (>= 2.40)"))
    has = {"bullseye": "2.31", "bookworm": "2.36"}[suite]
    assert "failed: not installable: needs libc6 (>= 2.40) but 2." in said and has in said
    assert robot.packages() == before and robot.apt_is_sound()
    assert robot.probe()["installed"] == ""


def test_missing_lists_without_a_network_are_named(make, tmp_path):
    robot = make("bookworm")
    shutil.rmtree(robot.root / "var/lib/apt/lists")
    before = robot.packages()
    said = robot.install(make_package(tmp_path, "1", LIBRARY))
    assert f"needs {LIBRARY} but it is not installable" in said
    assert "connect it to the internet once" in said
    assert robot.packages() == before and robot.apt_is_sound()


def test_dependency_that_cannot_be_fetched_changes_nothing(make, tmp_path):
    robot = make("bookworm")
    before = robot.packages()
    said = robot.install(make_package(tmp_path, "1", LIBRARY))
    assert "failed: not installed: " in said and "Failed to fetch" in said
    assert robot.packages() == before and robot.apt_is_sound()


def test_package_that_fails_half_way_is_taken_out_again(make, tmp_path):
    robot = make("bookworm")
    before = robot.packages()
    said = robot.install(make_package(tmp_path, "1", postinst="echo no >&2; exit 3"))
    assert "exit status 3" in said and "Nothing is left of it" in said
    assert robot.packages() == before and robot.apt_is_sound()
    assert robot.probe()["installed"] == ""


def test_package_before_comes_back_if_the_new_one_fails(make, tmp_path):
    robot = make("bookworm")
    assert robot.install(make_package(tmp_path, "1")) == ""
    before = robot.packages()
    said = robot.install(make_package(tmp_path, "2", postinst="exit 3"))
    assert "The package before was put back." in said
    assert robot.packages() == before and robot.apt_is_sound()
    assert robot.probe()["installed"] == "1"


def test_same_version_is_installed_again_and_the_one_before_is_kept(make, tmp_path):
    robot = make("bookworm")
    assert robot.install(make_package(tmp_path, "1")) == ""
    (tmp_path / "again").mkdir()
    again = make_package(tmp_path / "again", "1", postinst="touch /again")
    assert robot.install(again) == "" and (robot.root / "again").exists()
    assert robot.probe()["previous"] == "1"
    assert robot.step("rollback").returncode == 0


def test_unfinished_work_of_dpkg_is_named_before_anything_is_done(make, tmp_path):
    robot = make("bookworm")
    other = make_package(tmp_path, "1", postinst="exit 1", name="other")
    shutil.copy(other, robot.root / "tmp")
    robot.run("dpkg", "--install", f"/tmp/{other.name}")
    before = robot.packages()
    said = robot.install(make_package(tmp_path, "1"))
    assert "failed: apt broken" in said and "other" in said
    assert robot.packages() == before


def test_half_installed_package_is_not_called_installed(make, tmp_path):
    robot = make("bookworm")
    broken = make_package(tmp_path, "1", postinst="exit 1")
    shutil.copy(broken, robot.root / "tmp")
    robot.run("dpkg", "--install", f"/tmp/{broken.name}")
    assert robot.probe()["installed"] == ""
