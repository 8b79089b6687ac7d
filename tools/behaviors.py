# SPDX-License-Identifier: Apache-2.0
"""Files of tables of the user's own: lines `name = "100,-0.5,100,0.5"` of TOML."""

import os
import tomllib
from pathlib import Path

NAME = "behaviors.toml"


def find_table(name: str) -> str:
    """The table of a behaviour of one's own; empty if there is none of that name.

    Looked up where twin_run looks: in the working directory, else in the user's configuration.

    Raises:
        ValueError: a file is no TOML.
    """
    config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    for path in (Path(NAME), config / "twinmill" / NAME):
        if not path.is_file():
            continue
        try:
            return str(tomllib.loads(path.read_text()).get(name, ""))
        except tomllib.TOMLDecodeError as error:
            raise ValueError(f"{path}: is no TOML ({error}).") from error
    return ""
