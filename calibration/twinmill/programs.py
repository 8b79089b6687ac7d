# SPDX-License-Identifier: Apache-2.0
"""Where the programs of this installation are."""

import shutil
import sysconfig
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]  # of the project, where this file runs from there


def find_program(name: str) -> Path:
    """A program such as `twin_run`: installed with this package, on the path, or just built.

    Raises:
        ValueError: there is none.
    """
    installed = Path(sysconfig.get_path("scripts")) / name
    built = SOURCE / "build" / "bin" / name
    on_path = shutil.which(name)
    for place in (installed, *([Path(on_path)] if on_path else []), built):
        if place.is_file():
            return place
    raise ValueError(
        f"{name}: not found beside this Python, on the path or in {built.parent}; build it with "
        "`make build`, or install the package twinmill as a wheel."
    )
