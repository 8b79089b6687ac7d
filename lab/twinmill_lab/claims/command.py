# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab claims`: does this program do what was published?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import Out
from twinmill_cli.output import AsJson, deliver, telling

if working():  # not for --help
    import hashlib
    import shlex

    import numpy as np
    from rich.console import Group
    from rich.text import Text

    from twinmill.data.steady_table import read_steady_tables
    from twinmill.files import check_report, plain
    from twinmill.model.model_file import ModelFile, write_whole
    from twinmill.report import Provenance, Section, show, write_report
    from twinmill.report.tables import Cell, Table, number
    from twinmill.terminal import progress_bar
    from twinmill.version import __version__
    from twinmill_lab.claims.actuation import actuation
    from twinmill_lab.claims.bodies import bodies, layers
    from twinmill_lab.claims.claims import CLAIMS, ODD_TURNS
    from twinmill_lab.claims.last_figure import last_figure, requests
    from twinmill_lab.claims.paper import Answer, answers
    from twinmill_lab.claims.prediction import prediction_in_mujoco
    from twinmill_lab.claims.process import process
    from twinmill_lab.claims.rows import Claim, Row
    from twinmill_lab.claims.swarms import run_kept

    CHECKED = {**CLAIMS, "process": process}

NOTE = (
    "Claims of Vega et al. 2024 (arXiv 2410.16444). The reference is an independent C program of "
    "their equations. Kinds of robot: point sees another's centre and has no body; disc sees any "
    "part of 0.1 m and bodies push apart; robot sees centres, misses 4 %, imagines 10 %, and votes "
    "over 10 frames. Shares and means agree within 3.5 standard deviations of both samples, radii "
    "within 5 %, as the reference's own change by 9 % with its time step."
)

ACTUATION = "actuation"
MOST_TURN = 4  # the ring's turn input is 0.5, and 2 is the most


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("claims")(_claims)


def _claims(
    *,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help="One of them; a wrong name lists all."),
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=20, help="Runs of each cell.")] = 200,
    odd_turn: Annotated[
        list[float] | None,
        typer.Option(
            "--odd-turn", help="Turn rate of the bull's-eye's odd robot, over that of the ring."
        ),
    ] = None,
    mujoco_seeds: Annotated[
        int,
        typer.Option(
            "--mujoco-seeds",
            min=0,
            help="Runs of each of 56 cells in MuJoCo, of three kinds; kept in DIR/mujoco.",
        ),
    ] = 0,
    actuation_table: Annotated[
        Path | None,
        typer.Option("--actuation", metavar="TABLE", help="Measured steady speeds of robots."),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> int:
    """Check published claims about these swarms, with a figure of each.

    Exit code 1 if a number differs and it is not known why. DIR also gets
    claims.json and every figure as SVG. Stopped in MuJoCo, the same command goes
    on where it was.

    Example: twinmill lab claims --out claims
    """
    names = only or [*CHECKED, ACTUATION]
    if unknown := [name for name in names if name not in (*CHECKED, ACTUATION)]:
        raise ValueError(f"--only {unknown[0]}: must be one of {', '.join(CHECKED)}, {ACTUATION}.")
    if strange := [turn for turn in odd_turn or [] if not abs(turn) <= MOST_TURN]:
        raise ValueError(f"--odd-turn {strange[0]:g}: must be from -{MOST_TURN} to {MOST_TURN}.")
    sheets = read_steady_tables(actuation_table) if actuation_table else []
    if any(sheet.of_wheels for sheet in sheets):
        raise ValueError(
            f"--actuation {actuation_table}: is a bench test of wheels, and the claim is on how "
            "robots move; give a table of measured speeds and turns."
        )
    if mujoco_seeds and not out:
        raise ValueError("--mujoco-seeds needs --out DIR, where its runs are kept.")
    if out:
        check_report(out)
    found = []
    with telling("checking claims") as progress:
        for name in names:
            if name == ACTUATION:
                continue
            progress(name)
            more = {"turns": tuple(odd_turn or ODD_TURNS)} if name == "bullseye" else {}
            found.append(CHECKED[name](seeds, **more))
    if actuation_table or ACTUATION in names:
        found.append(actuation(sheets))
    if mujoco_seeds:
        found += _in_mujoco(mujoco_seeds, out / "mujoco")
    more = [f"--mujoco-seeds {mujoco_seeds}"] if mujoco_seeds else []
    more += [f"--actuation {shlex.quote(str(actuation_table))}"] if actuation_table else []
    source = Provenance(
        " ".join([_command_line(only, seeds, odd_turn), *more]),
        f"twinmill {__version__}",
        hashlib.sha256(ModelFile.load("paper.toml").text.encode()).hexdigest(),
    )
    agree = all(claim.agrees for claim in found)
    data = {
        "agree": agree,
        "seeds": seeds,
        "claims": [claim.to_json() for claim in found],
        "paper": [
            {"shows": a.part.shows, "agree": a.agree, "of": a.of, "differs": a.differs}
            for a in answers(found)
        ],
        **source.to_json(),
    }
    lines = [_line(claim) for claim in found]
    lines += [show.table(_table(claim, off)) for claim in found if (off := _differing(claim))]
    if out:
        lines.append(f"Report: {_write(out, source, found, data)}")
    deliver(data, Group(*lines), as_json)
    return 0 if agree else 1


def _in_mujoco(seeds: int, folder: Path) -> list[Claim]:
    """Runs what is missing, with progress, and draws what is there."""
    with progress_bar() as progress:
        labs = progress.add_task("laboratories in MuJoCo", total=None)
        predicted = prediction_in_mujoco(
            folder / "laboratories", lambda n, of: progress.update(labs, completed=n, total=of)
        )
        for what, asked in (
            ("the last figure's swarms", requests(seeds)),
            ("worlds in MuJoCo", [request for _, request in layers(seeds)]),
        ):
            task = progress.add_task(what, total=None)
            run_kept(
                asked, folder, lambda n, of, task=task: progress.update(task, completed=n, total=of)
            )
    return [predicted, last_figure(seeds, folder), bodies(seeds, folder)]


def _command_line(only: list[str] | None, seeds: int, odd_turn: list[float] | None) -> str:
    words = ["twinmill lab claims", *(f"--only {name}" for name in only or [])]
    words += [f"--seeds {seeds}", *(f"--odd-turn {turn:g}" for turn in odd_turn or [])]
    return " ".join(words)


def _differing(claim: Claim) -> list[Row]:
    return [row for row in claim.rows if row.agrees is False]


def _line(claim: Claim) -> Text:
    mark = (f"{claim.outcome:12}", {True: "green", False: "red", None: ""}[claim.seen])
    numbers = "" if claim.agrees else "bold red"
    return Text.assemble(
        mark, f" {claim.title}. {claim.finding} ", (f"{_numbers(claim)}.", numbers)
    )


def _numbers(claim: Claim) -> str:
    good, of = claim.count
    if not of:
        return "No number has a reference"
    known = "" if good == of or not claim.agrees else ", and why the others do not is known"
    return f"{good} of {of} numbers agree with the reference{known}"


def _write(out: Path, source: Provenance, found: list[Claim], data: dict) -> Path:
    counts = np.sum([claim.count for claim in found], axis=0)
    title = "Published claims, run again: {} of {} numbers agree".format(*counts)
    report = write_report(out, title, source, [_paper(found), *_sections(found)], note=NOTE)
    write_whole(out / "claims.json", json.dumps(plain(data), indent=1, allow_nan=False) + "\n")
    for claim in found:
        for k, figure in enumerate(claim.figures, 1):
            write_whole(out / f"{claim.name}_{k}.svg", figure.svg)
    return report


def _paper(found: list[Claim]) -> Section:
    """Parts of the paper, and which claim checks each."""
    told = answers(found)
    rows = [
        [
            Cell(answer.part.shows),
            _agreement(answer),
            Cell(answer.found),
            Cell("; ".join(answer.differs) or "-", "warn" if answer.differs else "dim"),
            Cell(answer.part.open or "-", "dim"),
        ]
        for answer in told
    ]
    columns = [
        "the paper shows",
        "numbers agree",
        "here",
        "what differs, and why",
        "not in the text",
    ]
    return Section(
        title="The paper, part by part",
        score=[],
        verdict="Beside the paper, in its order; what was measured stands in the sections below.",
        tables=[Table("Parts", columns, rows, words=(0, 2, 3, 4))],
    )


def _agreement(answer: Answer) -> Cell:
    if not answer.of:
        return Cell("-", "dim")
    tone = "good" if answer.agree == answer.of else "warn"
    return Cell(f"{answer.agree} of {answer.of}", tone)


def _sections(found: list[Claim]) -> list[Section]:
    return [
        Section(
            title=claim.title,
            score=[
                (
                    _numbers(claim),
                    claim.outcome,
                    {True: "good", False: "warn", None: ""}[claim.seen],
                )
            ],
            verdict=claim.finding,
            facts=[("claim", claim.sentence)],
            transcript=claim.transcript,
            figures=claim.figures,
            tables=[_table(claim, claim.rows)],
        )
        for claim in found
    ]


def _table(claim: Claim, shown: list[Row]) -> Table:
    rows = [
        [
            Cell(row.what),
            Cell(_number(row, row.value)),
            Cell(f"{_number(row, row.low)} to {_number(row, row.high)}", "dim"),
            Cell(_reference(row)),
            _verdict(row),
            Cell("; ".join(filter(None, (row.rule, row.known))), "dim"),
        ]
        for row in shown
    ]
    columns = ["number", "ours", "95 % interval", "reference", "", "by"]
    return Table(
        "Numbers" if len(shown) == len(claim.rows) else f"{claim.title}: what differs",
        columns,
        rows,
        words=(0, 4, 5),
    )


def _verdict(row: Row) -> Cell:
    if row.agrees is None:
        return Cell("no reference", "dim")
    if row.agrees:
        return Cell("agrees", "good")
    return Cell("differs", "warn" if row.known else "bad")


def _number(row: Row, value: float) -> str:
    if row.unit == "%":
        return f"{100 * value:.1f} %"
    return f"{number(value)}{' ' + row.unit if row.unit else ''}"


def _reference(row: Row) -> str:
    if row.reference is None:
        return "-"
    low, high = row.reference
    if low == high:
        return _number(row, low)
    return f"{_number(row, low)} to {_number(row, high)}"
