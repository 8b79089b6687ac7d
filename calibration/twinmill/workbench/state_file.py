# SPDX-License-Identifier: Apache-2.0
"""The file that a session survives in: a reload, a stopped server, a machine switched off."""

import fcntl
import json
import os
from pathlib import Path
from typing import Any, TextIO

from twinmill.arguments import option
from twinmill.files import replacing

MARK = {"session_of": "twinmill open"}  # in every file that we wrote


def state_path(name: str, key: str) -> Path:
    """Where a session is kept unless the user says: by the name of its log and its key."""
    home = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share")
    return home / "twinmill" / "workbench" / f"{name}-{key[:12]}.json"


class StateFile:
    """One JSON file, whole or not at all, for its owner alone and for one workbench at a time.

    Args:
        path: of the file; its folder is made.

    Raises:
        ValueError: it holds something else, cannot be written, or is in use.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._lock = _locked(path)
            kept = path.read_bytes() if path.exists() else None
        except OSError as error:
            raise ValueError(
                f"{path}: cannot be used ({error.strerror}); name another file with "
                f"{option('state')}."
            ) from error
        self._data = {} if kept is None else _session(path, kept)
        self.write(json.dumps(self._data))

    def close(self) -> None:
        """Another workbench may take it."""
        self._lock.close()

    def read(self, key: str, default: Any) -> Any:
        """One entry as it was when the file was opened."""
        return self._data.get(key, default)

    def write(self, text: str) -> None:
        """All entries anew, from a JSON object.

        Raises:
            ValueError: it cannot be written.
        """
        with replacing(self.path, force=True, mode=0o600) as temporary:
            temporary.write_text(json.dumps({**MARK, **json.loads(text)}))


def _session(path: Path, kept: bytes) -> dict[str, Any]:
    """Session in the file, which will be replaced: so it has to be ours."""
    try:
        data = json.loads(kept)
    except ValueError:  # of letters that are none, too
        data = None
    if not isinstance(data, dict) or not MARK.items() <= data.items():
        raise ValueError(
            f"{path}: holds no session of the workbench, and is left as it is; name another file "
            f"with {option('state')}."
        )
    return data


def _locked(path: Path) -> TextIO:
    """A file beside it that holds the lock until it is closed, at the latest with the program."""
    lock = path.with_name(f".{path.name}.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise ValueError(
            f"{path}: another workbench has this session open; go on in its page, end it with "
            f"Ctrl-C, or name another file with {option('state')}."
        ) from error
    return lock
