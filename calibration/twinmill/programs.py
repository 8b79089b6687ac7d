# SPDX-License-Identifier: Apache-2.0
"""Where the programs, the models and the libraries of this installation are, and its cores."""

import ctypes
import os
import shutil
from pathlib import Path

_PACKAGE = Path(__file__).parent
_BUILT = _PACKAGE.parents[1] / "build" / "bin"  # where this file runs from the project's folder


def find_program(name: str) -> Path:
    """A program such as `twin_run`: of this package, just built, or on the path.

    Raises:
        ValueError: there is none.
    """
    import sysconfig  # slow to import

    scripts = Path(sysconfig.get_path("scripts"))  # start the programs by asking here
    folders = [Path(f) for f in os.environ.get("PATH", "").split(os.pathsep)]
    others = os.pathsep.join(str(f) for f in folders if f != scripts)
    on_path = shutil.which(name, path=others)
    for place in (_PACKAGE / "bin" / name, _BUILT / name, *([Path(on_path)] if on_path else [])):
        if place.is_file():
            return place
    raise ValueError(
        f"{name}: neither in this package, nor built in {_BUILT}, nor on the path; build it with "
        "`make build`, or install twinmill as a wheel."
    )


def available_cores() -> int:
    """Processor cores that this process may use; all where the system does not say."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def use_own_models() -> None:
    """Lets the native module and the programs look among the models of this package, if it has any.

    A package that runs from the project's folder has none: there they are found without help.
    """
    models = _PACKAGE / "models"
    if models.is_dir():
        os.environ.setdefault("TWINMILL_MODELS", str(models))


def use_own_libraries() -> None:
    """Loads this package's GLib where the system has none: the package lcm takes it for granted."""
    try:
        ctypes.CDLL("libglib-2.0.so.0")
    except OSError:
        for library in (_PACKAGE.parent / "twinmill.libs").glob("libglib-2.0.so*"):
            ctypes.CDLL(str(library))
