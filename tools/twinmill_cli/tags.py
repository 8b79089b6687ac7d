# SPDX-License-Identifier: Apache-2.0
"""`twinmill track tags`: sheets to print for a ceiling camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import parse_numbers
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    from twinmill.files import replacing
    from twinmill.track.boards import Board
    from twinmill.track.detect import FLOOR, ROBOTS
    from twinmill.track.sheets import PAPERS_M, board_sheet, floor_sheet, robot_sheet, write_sheets


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("tags", no_args_is_help=True)(_tags)


def _tags(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="PDF", show_default=False, help="The sheets.")
    ],
    *,
    robots: Annotated[
        str, typer.Option("--robots", metavar="IDS", help="Numbers, as 1-8,12.")
    ] = "1-8",
    size_m: Annotated[
        float, typer.Option("--size", metavar="M", help="Side of the black square.")
    ] = 0.10,
    paper: Annotated[str, typer.Option("--paper", help="a4, a3 or letter.")] = "a4",
    floor: Annotated[bool, typer.Option("--floor", help="Four tags for the floor, too.")] = False,
    board: Annotated[bool, typer.Option("--board", help="The board for the lens, too.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace PDF if it exists.")] = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Print tags for robots, to scale, for `twinmill track`.

    A sheet has the robot's number, a line that goes to its front, and a ruler
    of 100 mm to check the print by.

    Example: twinmill track tags --out tags.pdf --robots 1-8 --floor --board
    """
    if paper not in PAPERS_M:
        raise ValueError(f"--paper {paper}: must be one of {', '.join(PAPERS_M)}.")
    if not 0.01 <= size_m <= 1:
        raise ValueError(f"--size {size_m:g}: must be in 0.01..1 m.")
    numbers = parse_numbers("--robots", robots, ROBOTS)
    sheets = [robot_sheet(number, size_m, paper) for number in numbers]
    if floor:
        sheets += [floor_sheet(number, size_m, paper) for number in FLOOR]
    if board:
        sheets.append(board_sheet(Board(), paper))
    with busy(f"drawing {out}"), replacing(out, force) as temporary:
        pages = write_sheets(temporary, sheets)
    data = {"out": str(out), "pages": pages, "robots": numbers, "size_m": size_m}
    words = f"{out}: {pages} sheets. Print at 100 %, and measure the ruler on one of them."
    deliver(data, words, as_json)
    return data
