# SPDX-License-Identifier: Apache-2.0
"""Options that several subcommands share, and lists of robots as they are written there."""

import re
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class ScriptForm(StrEnum):
    """In which a script is written for robots that listen to velocities."""

    BAG = "bag"
    PUBLISHER = "publisher"


ScriptAs = Annotated[
    ScriptForm | None,
    typer.Option(
        "--script-as",
        help="For robots on ROS: a bag with /cmd_vel, or a Python program that publishes it.",
    ),
]


def effects_beginning(incomplete: str) -> list[str]:
    """Names in the catalogue, for the shell's completion."""
    from twinmill.model.parameters import catalogue  # not for --help

    return [name for name in catalogue() if name.startswith(incomplete)]


Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG", show_default=False, help="LCM logs with commands and poses of a robot."
    ),
]
Model = Annotated[
    str,
    typer.Option(
        "--model", "-m", metavar="M", help="Model file, here or among the installed models."
    ),
]
Own = Annotated[
    list[Path] | None,
    typer.Option(
        "--own",
        metavar="LOG",
        show_default=False,
        help="Log that the model was fitted to (once for each): what it misses there, too, is not "
        "reported as new.",
    ),
]
Start = Annotated[str, typer.Option("--start", help="square, disc or facing-out.")]
SpreadM = Annotated[
    float, typer.Option("--spread-m", min=0.01, help="Side of the square, diameter of the disc")
]
World = Annotated[
    Path | None,
    typer.Option(
        "--world",
        metavar="FILE",
        show_default=False,
        help="Obstacles, walls, goals and evaders, as twin_run has them.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Write an HTML report, DIR/index.html, with its pictures in it.",
    ),
]
NewModel = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="M2",
        show_default=False,
        help="The new model file (.toml; .xml of an MJCF).",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace M2 if it exists.")]
Hold = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        show_default=False,
        help="A quantity, or an effect or table as a whole, that keeps its value; may be repeated.",
    ),
]
KeyFile = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="The operator's key, which must be there. Default: twinmill/swarm.key in ~/.config, "
        "made at first use.",
    ),
]
Arm = Annotated[
    bool, typer.Option("--arm", help="Arm robots first that were stopped: else they refuse.")
]
LcmUrl = Annotated[str, typer.Option("--lcm-url", help="The bus that the robots are on.")]
Prefix = Annotated[
    str, typer.Option("--channel-prefix", help="Prefix given to twin_run, to address a twin alone.")
]
SshConfig = Annotated[
    Path | None,
    typer.Option("--ssh-config", metavar="FILE", help="Instead of ~/.ssh/config: ssh -F."),
]
DurationS = Annotated[
    float,
    typer.Option(
        "--duration-s",
        min=0.1,
        show_default=False,
        help="How long to listen to the bus; else until Ctrl-C.",
    ),
]


def parse_numbers(option: str, text: str, allowed: range) -> list[int]:
    """Numbers of a text like 1-8,12, in ascending order.

    Raises:
        ValueError: it is no such text, or has a number that is not allowed.
    """
    numbers: set[int] = set()
    for part in text.split(","):
        found = re.fullmatch(r" *([0-9]{1,4}) *(?:- *([0-9]{1,4}) *)?", part)
        if not found or (found[2] and int(found[2]) < int(found[1])):
            raise ValueError(f"{option} {text}: must be numbers and ranges, as 1-8,12.")
        numbers |= set(range(int(found[1]), int(found[2] or found[1]) + 1))
    if wrong := sorted(numbers - set(allowed)):
        raise ValueError(
            f"{option} {text}: {wrong[0]} is not in {allowed.start}..{allowed.stop - 1}."
        )
    return sorted(numbers)


def repeated(flag: str, values: Iterable[str | Path]) -> list[str]:
    """Words of a command line that give an option once for each of these."""
    return [word for value in values for word in (flag, str(value))]
