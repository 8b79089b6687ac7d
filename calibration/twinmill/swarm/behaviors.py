# SPDX-License-Identifier: Apache-2.0
"""Files of tables of the user's own: lines `name = "100,-0.5,100,0.5"` of TOML."""

import itertools
import os
import tomllib
from pathlib import Path

from twinmill.arguments import option

NAME = "behaviors.toml"
TABLE_SIZES = (4, 8, 16, 32)  # speed and turn of 2, 4, 8 or 16 rows


def find_file() -> Path | None:
    """Where twin_run looks: in the working directory, else in the user's configuration."""
    config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return next(filter(Path.is_file, (Path(NAME), config / "twinmill" / NAME)), None)


def parse_table(text: str) -> tuple[str, list[int]]:
    """`name=unseen_speed,unseen_turn,seen_speed,seen_turn` in inputs, or so for 4, 8 or 16 rows.

    Raises:
        ValueError: in one sentence.
    """
    name, _, rest = text.partition("=")
    try:
        values = list(map(float, rest.split(",")))
        within = [abs(v) <= 100 for v in values[::2]] + [abs(v) <= 2 for v in values[1::2]]
        if not name or not all(within) or len(values) not in TABLE_SIZES:
            raise ValueError
    except ValueError:
        raise ValueError(
            f"{option('table', text)}: write name=speed,turn,speed,turn, for nothing seen and for "
            "seen, "
            "as in spin=0,-1.5,100,0.5 (speed -100 to 100, turn -2 to 2), or 4, 8 or 16 such pairs."
        ) from None
    scales = itertools.cycle((1, 1000))
    return name, [round(value * scale) for value, scale in zip(values, scales, strict=False)]


def read_tables(path: Path) -> dict[str, str]:
    """All tables of a file, by name.

    Raises:
        ValueError: it is no TOML, or holds something else.
    """
    try:
        tables = tomllib.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: cannot be read as TOML ({error}).") from error
    for name, table in tables.items():
        if not isinstance(table, str):
            raise ValueError(f"{path}: '{name}' must be \"speed,turn,speed,turn\" in quotes.")
    return tables


def find_table(name: str) -> str:
    """The table of a behaviour of one's own; empty if there is none of that name.

    Raises:
        ValueError: as read_tables().
    """
    path = find_file()
    return read_tables(path).get(name, "") if path else ""
