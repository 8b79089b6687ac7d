# SPDX-License-Identifier: Apache-2.0
"""Files of tables of the user's own: lines `name = "100,-0.5,100,0.5"` of TOML."""

import os
import tomllib
from pathlib import Path

NAME = "behaviors.toml"


def find_file() -> Path | None:
    """Where twin_run looks: in the working directory, else in the user's configuration."""
    config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return next(filter(Path.is_file, (Path(NAME), config / "twinmill" / NAME)), None)


def parse_table(text: str) -> tuple[str, list[int]]:
    """`name=unseen_speed,unseen_turn,seen_speed,seen_turn` in the robot's inputs.

    Raises:
        ValueError: in one sentence.
    """
    name, _, rest = text.partition("=")
    try:
        unseen_speed, unseen_turn, seen_speed, seen_turn = map(float, rest.split(","))
        within = [abs(v) <= 100 for v in (unseen_speed, seen_speed)]
        within += [abs(v) <= 2 for v in (unseen_turn, seen_turn)]
        if not name or not all(within):
            raise ValueError
    except ValueError:
        raise ValueError(
            f"--table '{text}': write name=speed,turn,speed,turn, for nothing seen and for seen, "
            "as in spin=0,-1.5,100,0.5 (speed -100 to 100, turn -2 to 2)."
        ) from None
    milli = [round(unseen_turn * 1000), round(seen_turn * 1000)]
    return name, [round(unseen_speed), milli[0], round(seen_speed), milli[1]]


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
