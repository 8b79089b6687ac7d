# SPDX-License-Identifier: Apache-2.0
"""The file that a session survives in: a reload, a stopped server, a machine switched off."""

import json
import os
import secrets
from pathlib import Path
from typing import Any

from twinmill.files import replacing


def state_path(name: str, key: str) -> Path:
    """Where a session is kept unless the user says: by the name of its log and its key."""
    home = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share")
    return home / "twinmill" / "workbench" / f"{name}-{key[:12]}.json"


class StateFile:
    """One JSON file, whole or not at all, for its owner alone.

    Args:
        path: of the file; its folder is made.

    Raises:
        ValueError: it holds something else, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._data = json.loads(path.read_text()) if path.exists() else {}
        except OSError as error:
            raise ValueError(
                f"{path}: cannot be used ({error.strerror}); name another file with --state."
            ) from error
        except ValueError as error:
            raise ValueError(
                f"{path}: holds no session of the workbench; name another file with --state, or "
                "remove it."
            ) from error
        if not isinstance(self._data, dict):
            raise ValueError(f"{path}: holds no session of the workbench; remove it.")
        self._data.setdefault("token", secrets.token_urlsafe(16))
        self.write(json.dumps(self._data))

    @property
    def token(self) -> str:
        """Secret of the session's address; the same after the server was stopped."""
        return self._data["token"]

    def read(self, key: str, default: Any) -> Any:
        """One entry as it was when the file was opened."""
        return self._data.get(key, default)

    def write(self, text: str) -> None:
        """All entries anew, from a JSON object.

        Raises:
            ValueError: it cannot be written.
        """
        with replacing(self.path, force=True, mode=0o600) as temporary:
            temporary.write_text(json.dumps({"token": self.token, **json.loads(text)}))
