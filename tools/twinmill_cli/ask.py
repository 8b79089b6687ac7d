# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm ask`: how many robots, how fast, how good their sensors, how alike."""

from __future__ import annotations

import shlex
from typing import Annotated, Any

import typer

from twinmill.defaults import Question
from twinmill_cli.lazy import working
from twinmill_cli.options import Out
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import hashlib

    from rich.console import Group

    from twinmill.files import check_report
    from twinmill.model.model_file import ModelFile
    from twinmill.report import Provenance, Section, write_report
    from twinmill.report.questions import curve_figure
    from twinmill.swarm.classes import check_goal, goal_of
    from twinmill.swarm.questions import Curve, axes_for, curve_of
    from twinmill.swarm.sweep import make_request

NOTE = "Each point is many simulated runs from random starts; the band is the 95 % interval."


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("ask")(_ask)


def _ask(
    question: Annotated[Question, typer.Argument(show_default=False)],
    *,
    behavior: Annotated[
        str, typer.Option("--behavior", help="Behaviour of the swarm.")
    ] = "milling",
    model: Annotated[
        str, typer.Option("--model", "-m", metavar="M", help="Model of the robots.")
    ] = "paper.toml",
    n: Annotated[
        int | None, typer.Option("--n", help="Robots, where they are not asked for.")
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=10, help="Runs of each value.")] = 100,
    duration_s: Annotated[
        float, typer.Option("--duration-s", min=1, help="Length of a run.")
    ] = 120,
    goal: Annotated[
        str | None, typer.Option("--goal", help="Class that is wanted; default: the behaviour's.")
    ] = None,
    at_least: Annotated[
        float, typer.Option("--at-least", min=0.01, max=1, help="Share of runs that is enough.")
    ] = 0.9,
    target_radius_m: Annotated[
        float | None,
        typer.Option(
            "--target-radius-m", help="Radius of what a camera sees; 0: the other robot's centre."
        ),
    ] = None,
    start: Annotated[str, typer.Option("--start", help="Where the robots start.")] = "square",
    as_json: AsJson = False,
    out: Out = None,
) -> list[Curve]:
    """Answer a design question (how many robots, how fast) by simulation.

    Example: twinmill swarm ask how-many --behavior milling --model turbopi.toml --out answer
    """
    if out:
        check_report(out)
    drive = ModelFile.load(model).model.drive
    rest: dict[str, Any] = {
        "n": None if question is Question.HOW_MANY else n,
        "seeds": seeds,
        "start": start,
    }
    rest |= {"duration_s": duration_s, "target_radius_m": target_radius_m}
    requests = [make_request(behavior, model, [axis], **rest) for axis in axes_for(question, drive)]
    wanted = check_goal(goal) if goal else goal_of(requests[0])
    curves = [curve_of(request, wanted) for request in requests]
    sentences = [curve.sentence(wanted, at_least) for curve in curves]
    words = ["twinmill", "swarm", "ask", question, "--behavior", behavior, "--model", model]
    words += ["--seeds", str(seeds), "--duration-s", f"{duration_s:g}", "--goal", wanted]
    words += ["--n", str(n)] if n else []
    words += [] if target_radius_m is None else ["--target-radius-m", f"{target_radius_m:g}"]
    words += ["--start", start, "--at-least", f"{at_least:g}"]
    source = Provenance(
        shlex.join(words),
        f"twinmill {requests[0].version}",
        hashlib.sha256(requests[0].model_text.encode()).hexdigest(),
    )
    section = Section(
        title=f"{question.replace('-', ' ').capitalize()}? {behavior}",
        score=[],
        verdict=_capital(sentences[0])
        if len(sentences) == 1
        else f"What each of these {len(sentences)} allows stands under its figure.",
        facts=[("model", model), ("runs", f"{seeds} of {duration_s:g} s at each value")],
        figures=[
            curve_figure(curve, wanted, _capital(sentence) if len(curves) > 1 else "", at_least)
            for curve, sentence in zip(curves, sentences, strict=True)
        ],
    )
    report = write_report(out, section.title, source, [section], note=NOTE) if out else None
    data = {
        "question": str(question),
        "goal": wanted,
        "curves": [
            {**curve.to_json(), "sentence": sentence}
            for curve, sentence in zip(curves, sentences, strict=True)
        ],
        **source.to_json(),
        "report": str(report) if report else None,
    }
    deliver(data, Group(*sentences, *([f"Report: {report}"] if report else [])), as_json)
    return curves


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
