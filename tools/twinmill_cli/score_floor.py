# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab score`: what came of a sealed prediction."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from twinmill.version import __version__
from twinmill_cli.lazy import working
from twinmill_cli.options import Out
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import hashlib

    from twinmill.files import check_report
    from twinmill.report import Provenance, write_report
    from twinmill.report.floor_score import NOTE, section, sentences
    from twinmill.swarm.forecast.plan import read_outcomes, read_plan
    from twinmill.swarm.forecast.score import Score, score


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("score-floor")(_score_floor)


def _score_floor(
    folder: Annotated[
        Path,
        typer.Argument(metavar="PLAN", show_default=False, help="Folder that `lab predict` wrote."),
    ],
    outcomes: Annotated[
        Path,
        typer.Argument(show_default=False, help="CSV: run, and class or log (a path beside it)."),
    ],
    *,
    sha256: Annotated[
        str | None,
        typer.Option("--sha256", metavar="HEX", help="Hash as published; default: as in plan.md."),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> Score:
    """Score a preregistered prediction by the outcomes of the runs, against simpler ones.

    Scores are proper: the log score in nats and Brier's. Their intervals come
    from the scatter of the cells.

    Example: twinmill lab score plan plan/outcomes.csv --out score
    """
    if out:
        check_report(out)
    plan, digest = read_plan(folder, sha256)
    cell, seen, missing = read_outcomes(outcomes, plan)
    found = score(plan.expected, cell, seen, axes=plan.names, seed=plan.seed)
    told = sentences(found, missing)
    source = Provenance(
        shlex.join(["twinmill", "lab", "score", str(folder), str(outcomes), "--sha256", digest]),
        f"twinmill {__version__}",
        hashlib.sha256(plan.request.model_text.encode()).hexdigest(),
    )
    page = section(found, plan, cell=cell, seen=seen, missing=missing)
    report = write_report(out, page.title, source, [page], note=NOTE) if out else None
    data = {
        "sha256": digest,
        "runs": found.runs,
        "missing": missing,
        "log_score": found.log_score.to_json(),
        "brier": found.brier.to_json(),
        "expected_log_score": found.expected.to_json(),
        "p_value": found.p_value,
        "baselines": [rival.to_json() for rival in found.rivals],
        "hits": found.hits,
        "misses": found.misses,
        "sentences": told,
        **source.to_json(),
        "report": str(report) if report else None,
    }
    deliver(data, "\n".join([*told, *([f"Report: {report}"] if report else [])]), as_json)
    return found
