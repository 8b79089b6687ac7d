# SPDX-License-Identifier: Apache-2.0
"""Requests of `make build` and `make check` to a Debian, with an apt that plays the test's."""

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LISTED = (ROOT / "scripts/apt-packages.txt").read_text(encoding="utf-8")


def names(part: str) -> set[str]:
    """First names of the packages below the heading of a part."""
    text = LISTED.partition(f"# -- make {part}")[2].partition("\n")[2].partition("# --")[0]
    return set(re.findall(r"^\w[\w.+-]*", text, flags=re.MULTILINE))


@pytest.fixture
def setup(tmp_path):
    """Runs the script where some packages are not installed, and the release has some of these."""

    def run(part: str, lacking: set[str], known: set[str]) -> subprocess.CompletedProcess:
        there = (names("demo") | names("build") | names("check")) - lacking
        programs = {
            "dpkg-query": "".join(f"echo 'installed {name}'\n" for name in there),
            "apt-cache": f"case ' {' '.join(known)} ' in\n"
            '*" $2 "*) echo "  Candidate: 1.0" ;; *) echo "  Candidate: (none)" ;; esac\n',
            "apt-get": 'case " $* " in *" install "*) exit 1 ;; esac\n',
            "id": "echo 0\n",
        }
        for name, text in programs.items():
            (tmp_path / name).write_text(f"#!/bin/sh\n{text}")
            (tmp_path / name).chmod(0o755)
        scripts = tmp_path / "project" / "scripts"
        scripts.mkdir(parents=True)
        for name in ("setup", "apt-packages.txt"):
            (scripts / name).write_bytes((ROOT / "scripts" / name).read_bytes())
        (scripts / "setup").chmod(0o755)
        path = f"{tmp_path}:{os.environ['PATH']}"
        return subprocess.run(
            [scripts / "setup", part],
            capture_output=True,
            text=True,
            env={**os.environ, "PATH": path},
        )

    return run


def test_packages_of_tests_never_stand_between_a_user_and_a_build(setup):
    """All of them are lacking, and a package of the build, which alone is named."""
    done = setup("build", names("check") | {"libeigen3-dev"}, set())
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "no package libeigen3-dev, which 'make build' needs" in line
    assert {"clang", "chromium", "libgtest-dev", "libsdformat12-12"} <= names("check")


def test_of_the_names_that_releases_have_the_one_that_is_there_is_taken(setup):
    """And a test's package that none has is left out; this apt installs nothing, which ends it."""
    lacking = {"libclang-rt-14-dev", "libsdformat12-12", "g++"}
    done = setup("check", lacking, {"g++", "libclang-rt-dev"})
    assert done.returncode == 1
    assert "no package libsdformat12-12: the tests that need it are skipped" in done.stdout
    assert "could not install g++ libclang-rt-dev: " in done.stderr
