# SPDX-License-Identifier: Apache-2.0
"""Outputs: checked before the long work, whole or not at all, and values that JSON can hold."""

import fcntl
import math
import os
import tempfile
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from twinmill.arguments import option


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


def check_new_file(path: Path, force: bool | None, inputs: Iterable[Path | None] = ()) -> None:
    """Raises ValueError if a file could not be written here; tried before the long work.

    Args:
        path: of the file.
        force: see `check_absent`.
        inputs: what is read, and so is never replaced; None where nothing was given.
    """
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file in it.")
    if path.exists() and not path.is_file():
        raise ValueError(f"{path}: is a device, not a file; choose another name.")
    _check_no_input(path, inputs)
    check_absent(path, force)
    _check_folder(path, path.parent)


def check_absent(path: Path, force: bool | None) -> None:
    """Raises ValueError if there is something by this name that is not to be replaced.

    Args:
        path: of a file or a folder.
        force: replace what is there; None: the command has no such option.
    """
    if path.exists() and not force:
        raise ValueError(_taken(path, force))


def _taken(path: Path, force: bool | None) -> str:
    remedy = "." if force is None else f", or replace it with {option('force', True)}."
    return f"{path}: exists; choose another name{remedy}"


def put_in_place(made: Path, out: Path, force: bool | None) -> None:
    """Gives a file or a folder that is whole its name, which is taken first.

    So of two commands that write the same the second finds the name taken, whenever it was asked.

    Args:
        made: the file or folder, on the same disk.
        out: its name from now on; no folder may be there.
        force: see `check_absent`.

    Raises:
        ValueError: something has come to be there meanwhile.
    """
    try:
        if made.is_dir():
            out.mkdir()
        elif not force:
            os.close(os.open(out, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        raise ValueError(_taken(out, force)) from None
    os.replace(made, out)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keeps a folder for one command at a time; a killed one frees it.

    Args:
        folder: one that is there.

    Raises:
        ValueError: another command has it.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        _lock(handle, folder)
        yield
    finally:
        os.close(handle)


def _lock(handle: int, folder: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ValueError(
            f"{folder}: another command writes in it; wait for its end, or choose another folder."
        ) from error
    except OSError:  # a disk on a network that keeps no locks
        return


@contextmanager
def replacing(
    out: Path, force: bool | None, mode: int = 0o644, *, inputs: Iterable[Path | None] = ()
) -> Iterator[Path]:
    """A temporary file beside `out` that takes its place if the block succeeds.

    Args:
        out: the file.
        force: see `check_absent`.
        mode: its permissions.
        inputs: see `check_new_file`.

    Raises:
        ValueError: a file cannot be written there.
    """
    check_new_file(out, force, inputs)
    handle, name = tempfile.mkstemp(prefix=f".{out.name}.", dir=out.parent)
    os.close(handle)
    try:
        with _said_of(out):
            yield Path(name)
            os.chmod(name, mode)
            put_in_place(Path(name), out, force)
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def replacing_folder(
    out: Path,
    force: bool | None,
    *,
    inputs: Iterable[Path | None] = (),
    holds: Collection[str] = (),
) -> Iterator[Path]:
    """The path of a new folder that takes the place of `out` if the block succeeds.

    Args:
        out: the folder.
        force: see `check_absent`.
        inputs: see `check_new_file`.
        holds: patterns of names; a folder in which there is anything else is not replaced.

    Raises:
        ValueError: it exists, has an input or other things in it, or a folder cannot be made there.
    """
    _check_no_input(out, inputs)
    check_absent(out, force and out.is_dir())
    check_holds(out, holds)
    with folder_beside(out) as folder:
        yield folder / out.name
        if force and out.is_dir():
            check_holds(out, holds)
            out.rename(folder / "before")
        put_in_place(folder / out.name, out, force)


def check_holds(folder: Path, patterns: Collection[str]) -> None:
    """Raises ValueError if there is a folder with anything in it that has no such name."""
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        if not any(path.match(pattern) for pattern in patterns):
            raise ValueError(
                f"{folder}: holds {path.name}, which this command does not write, and is left as "
                "it is; choose another folder."
            )


@contextmanager
def folder_beside(out: Path) -> Iterator[Path]:
    """A temporary folder beside `out`; what is missing above is made, and stays if `out` does.

    Raises:
        ValueError: a folder cannot be made or written there.
    """
    check_new_folder(out)
    with (
        _said_of(out),
        made_folder(out.parent),
        tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out.parent) as folder,
    ):
        yield Path(folder)


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """The folder is there, and those above it; those that were missing go if they stay empty."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in missing:
            with suppress(OSError):  # it holds what was made
                path.rmdir()


REPORT = '<meta name="generator" content="twinmill">'  # in every report


def check_report(folder: Path) -> None:
    """Raises ValueError if no report can be written here, or another page would be lost."""
    check_new_folder(folder)
    page = folder / "index.html"
    if page.exists() and REPORT not in page.read_text(errors="replace"):
        raise ValueError(f"{page}: exists and is no report of twinmill; choose another folder.")


def check_new_folder(path: Path) -> None:
    """Raises ValueError if a folder, and what is missing above it, could not be made here."""
    existing = path
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    _check_folder(path, existing)


def _check_no_input(out: Path, inputs: Iterable[Path | None]) -> None:
    """Raises ValueError if this is an input, by whatever name, holds one, or is a part of one."""
    for given in inputs:
        if given is None or not (out.exists() and given.exists()):
            continue
        place, read = out.resolve(), given.resolve()
        if out.samefile(given) or place in read.parents or read in place.parents:
            which = "" if given == out else f" (as {given})"
            raise ValueError(
                f"{out}: is read by this command{which}, and what is read is never replaced; "
                "choose another name."
            )


def _check_folder(path: Path, folder: Path) -> None:
    if not folder.is_dir():
        what = f"{folder} is a file" if folder.exists() else f"there is no folder {folder}"
        raise ValueError(f"{path}: cannot be written: {what}; make the folder, or name another.")
    with _said_of(path):
        handle, name = tempfile.mkstemp(prefix=".twinmill.", dir=folder)
        os.close(handle)
        os.unlink(name)


@contextmanager
def _said_of(path: Path) -> Iterator[None]:
    """Turns an error of the system on writing a path into a sentence."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else error  # Arrow's words are others
        raise ValueError(f"{path}: cannot be written ({reason}); choose another place.") from error
