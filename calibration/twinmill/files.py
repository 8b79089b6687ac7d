# SPDX-License-Identifier: Apache-2.0
"""Outputs: checked before the long work, whole or not at all, and values that JSON can hold."""

import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def plain(value: Any) -> Any:
    """A value of which JSON can hold all: numpy's numbers as Python's, NaN as null."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def check_new_file(path: Path, force: bool) -> None:
    """Raises ValueError if a file could not be written here; tried before the long work."""
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file in it.")
    if path.exists() and not path.is_file():
        raise ValueError(f"{path}: is a device, not a file; choose another name.")
    if path.exists() and not force:
        raise ValueError(f"{path}: exists; choose another name, or replace it with --force.")
    _check_folder(path, path.parent)


@contextmanager
def replacing(out: Path, force: bool, mode: int = 0o644) -> Iterator[Path]:
    """A temporary file beside `out` that takes its place if the block succeeds.

    Raises:
        ValueError: a file cannot be written there.
    """
    check_new_file(out, force)
    handle, name = tempfile.mkstemp(prefix=f".{out.name}.", dir=out.parent)
    os.close(handle)
    try:
        yield Path(name)
        os.chmod(name, mode)
        os.replace(name, out)
    except OSError as error:
        raise ValueError(
            f"{out}: cannot be written ({error.strerror}); choose another place."
        ) from error
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def replacing_folder(out: Path, force: bool) -> Iterator[Path]:
    """The path of a new folder that takes the place of `out` if the block succeeds.

    Raises:
        ValueError: it exists, or a folder cannot be made there.
    """
    if out.exists() and not (force and out.is_dir()):
        raise ValueError(f"{out}: exists; choose another name, or replace it with --force.")
    check_new_folder(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out.parent) as folder:
        yield Path(folder) / out.name
        if out.exists():
            shutil.rmtree(out)
        (Path(folder) / out.name).rename(out)


def check_new_folder(path: Path) -> None:
    """Raises ValueError if a folder could not be made or written here."""
    existing = path
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    _check_folder(path, existing)


def _check_folder(path: Path, folder: Path) -> None:
    try:
        handle, name = tempfile.mkstemp(prefix=".twinmill.", dir=folder)
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be written ({error.strerror}); choose another place."
        ) from error
    os.close(handle)
    os.unlink(name)
