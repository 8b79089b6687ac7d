# SPDX-License-Identifier: Apache-2.0
"""Packages that only some tasks need: their extras, and the sentence where one is missing."""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from twinmill.version import __version__

# Modules that are imported here, by the extra of pyproject.toml that brings them; where several do,
# the task that is most often meant.
EXTRAS = {
    "camera": ("cv2", "PIL", "starlette", "uvicorn"),
    "discover": ("ribs",),
    "export": ("foxglove_schemas_protobuf", "google", "mcap_protobuf"),
    "optitrack": ("natnet",),
    "ros": ("apsw", "lz4", "mcap", "rosbags", "yaml"),
    "sweep": ("dask", "distributed", "pyarrow"),
    "watch": ("rerun",),
    "workbench": ("fastapi", "nicegui"),
}
LAB = "twinmill_lab"  # the package of blind tests and published claims


def missing(module: str, extra: str | None = None) -> str:
    """Says that the package of a module is not installed, and the command that installs it.

    Args:
        module: that was not found, as `cv2.aruco`.
        extra: that brings it; looked up unless given.
    """
    package = module.partition(".")[0]
    if package == LAB:
        wheel = installing(f"{LAB}-{__version__}-py3-none-any.whl")
        return (
            "blind tests and published claims are a package of their own, which is not installed; "
            f"its file comes beside Twinmill's: {wheel}"
        )
    extra = extra or next((name for name, of in EXTRAS.items() if package in of), None)
    return f"the Python package of '{package}' is not installed; install it with: {command(extra)}"


def command(extra: str | None) -> str:
    """Command line that installs an extra, or without one all that everybody gets, here."""
    return installing(f"'twinmill[{extra}]'" if extra else "twinmill")


def installing(wanted: str) -> str:
    """Command line that installs a package into this environment."""
    pip = shutil.which("pip")
    own = pip and Path(pip).parent == Path(sys.executable).parent
    return f"{'pip' if own else f'{sys.executable} -m pip'} install {wanted}"


class MissingExtra(ModuleNotFoundError):
    """A package is not installed; says which extra brings it."""


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Says in one sentence which extra an import below it lacks.

    Raises:
        MissingExtra: with that sentence.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtra(missing(error.name or "", extra), name=error.name) from None
