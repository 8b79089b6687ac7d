# SPDX-License-Identifier: Apache-2.0
"""Recordings for the viewer Rerun: the version that wrote them, and an older one."""

import os
import subprocess
import sys
from pathlib import Path

from interop import drive
from interop.cells import Told, packages_at, writes

FILE = "drive.rrd"
OWN, OLDER = "rerun-sdk==0.41.0", "rerun-sdk==0.34.1"


def _write(folder: Path) -> None:
    """By `twinmill swarm watch --save`, which needs Rerun's library beside ours."""
    environment = os.environ | {"PYTHONPATH": str(packages_at(OWN))}
    command = [Path(sys.executable).with_name("twinmill"), "watch", str(drive.write_log(folder))]
    subprocess.run(
        [*command, "--save", folder / FILE], env=environment, check=True, capture_output=True
    )


def _told(folder: Path, package: str) -> Told:
    """Facts that `rerun rrd` prints of the file."""
    (program,) = (p for p in packages_at(package).glob("**/rerun_cli/rerun"))

    def run(*words: str) -> subprocess.CompletedProcess:
        command = [program, "rrd", *words, folder / FILE]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    shown = run("print").stdout
    return {
        "verified": run("verify").returncode == 0,
        "paths of the robot": f"R{drive.ROBOT:02d}" in shown,
    }


@writes("Rerun", "Rerun", OWN, ours=_write)
def own(folder: Path) -> Told:
    """The version that wrote it."""
    return _told(folder, OWN)


@writes("Rerun", "Rerun, older", OLDER, ours=_write)
def older(folder: Path) -> Told:
    """One that someone has installed since spring."""
    return _told(folder, OLDER)
