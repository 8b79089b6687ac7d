# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm phase`: a sweep as a phase diagram, with experiments on it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import repeated
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    import hashlib

    from twinmill.counted import counted
    from twinmill.files import check_report
    from twinmill.numbers_typed import typed_float
    from twinmill.report import Provenance, Section, write_report
    from twinmill.report.phase_figures import (
        map_figure,
        probability_figure,
        slider_figure,
        thumbnail_figure,
    )
    from twinmill.report.tables import Cell, Table, Tone, number
    from twinmill.swarm.axes import ALIASES
    from twinmill.swarm.classes import check_goal, goal_of
    from twinmill.swarm.experiments import Experiment, agreement, next_cells, read_experiments
    from twinmill.swarm.phase import CLASSES, Phase, phase_of
    from twinmill.swarm.store import read_sweep

NOTE = (
    "Each run is simulated from its own random start, with robots drawn from the model's spread; "
    "its class comes from the last 10 s."
)


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("phase")(_phase)


def _phase(
    folder: Annotated[
        Path, typer.Argument(metavar="SWEEP", show_default=False, help="Folder of twin_sweep.")
    ],
    *,
    goal: Annotated[
        str | None, typer.Option("--goal", help="Class that is wanted; default: the behaviour's.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", help="name=value of an axis beyond the first two, for the pictures."),
    ] = None,
    experiments: Annotated[
        Path | None,
        typer.Option("--experiments", help="CSV: a column for each axis, and class."),
    ] = None,
    rival: Annotated[
        Path | None,
        typer.Option("--rival", metavar="SWEEP", help="Next runs: where this sweep differs most."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of the report; default: SWEEP/phase."),
    ] = None,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Draw the phase diagram of a sweep, and where to experiment next.

    Example: twinmill swarm phase sweep --experiments floor.csv
    """
    request, table = read_sweep(folder)
    phase = phase_of(request, table, check_goal(goal) if goal else goal_of(request))
    other = None
    if rival:
        rival_request, rival_table = read_sweep(rival)
        other = phase_of(rival_request, rival_table, phase.goal)
    place = _place(at or [], phase)
    runs = read_experiments(experiments, phase) if experiments else []
    worth = next_cells(phase, other, {run.cell for run in runs if run.cell is not None})
    match = agreement(runs) if runs else None
    target = out or folder / "phase"
    check_report(target)
    words = ["twinmill", "swarm", "phase", str(folder), "--goal", phase.goal]
    words += repeated("--at", at or [])
    words += ["--experiments", str(experiments)] if experiments else []
    words += ["--rival", str(rival)] if rival else []
    source = Provenance(
        shlex.join(words),
        f"twinmill {request.version}",
        hashlib.sha256(request.model_text.encode()).hexdigest(),
    )
    with busy("drawing"):
        section = _section(phase, place, runs, match, worth=worth, has_rival=bool(rival))
        report = write_report(target, section.title, source, [section], note=NOTE)
    data = {
        "goal": phase.goal,
        "axes": {axis.name: list(axis.values) for axis in phase.axes},
        "seeds": phase.seeds,
        "cells": phase.to_json(),
        "agreement": match,
        "next": worth,
        **source.to_json(),
        "report": str(report),
    }
    step = f"Next: {section.next_step}" if section.next_step else ""
    lines = [section.verdict, step, f"Report: {report}"]
    deliver(data, "\n".join(filter(None, lines)), as_json)
    return data


def _place(texts: list[str], phase: Phase) -> dict[str, float]:
    place = {}
    for text in texts:
        name, _, value = text.partition("=")
        name = ALIASES.get(name, name)
        known = [axis.name for axis in phase.axes[2:]]
        if not known:
            raise ValueError(
                f"--at '{text}': this sweep has no axis beyond the two of the pictures."
            )
        try:
            if name not in known:
                raise ValueError
            place[name] = typed_float(value)
        except ValueError:
            raise ValueError(
                f"--at '{text}': write name=value with an axis beyond the first two: "
                f"{', '.join(known)}."
            ) from None
    return place


def _section(
    phase: Phase,
    place: dict[str, float],
    runs: list[Experiment],
    match: dict[str, Any] | None,
    *,
    worth: list[dict[str, Any]],
    has_rival: bool,
) -> Section:
    best = int((phase.hits / phase.seeds).argmax())
    low, high = phase.intervals()[best]
    share = phase.hits[best] / phase.seeds
    score: list[tuple[str, str, Tone]] = [(f"best '{phase.goal}'", f"{100 * share:.0f} %", "")]
    verdict = (
        f"'{phase.goal}' is most probable at {phase.where(best)}: {100 * share:.0f} % of "
        f"{phase.seeds} runs (95 % interval {100 * low:.0f} to {100 * high:.0f} %)"
    )
    others = int((phase.hits == phase.hits[best]).sum()) - 1
    verdict += f", as in {counted(others, 'other cell')}." if others else "."
    tables = [_next_table(phase, worth, has_rival)] if worth else []
    if match:
        score.append(("experiments as predicted", f"{match['agree']} of {match['of']}", ""))
        verdict += _agreement(match)
        tables.insert(0, _run_table(phase, runs))
    figures = [map_figure(phase, place, runs, worth), probability_figure(phase, place)]
    figures += [thumbnail_figure(phase, place), slider_figure(phase)]
    first = f"run {phase.where(worth[0]['cell'])}: " if worth else ""
    why = "there the two models disagree most." if has_rival else "there it is least sure."
    return Section(
        title=f"Phase diagram of {phase.request.behavior}",
        score=score,
        verdict=verdict,
        facts=[
            ("model", phase.request.model_name),
            ("runs", f"{phase.seeds} of {phase.request.duration_s:g} s in each cell"),
            ("start", phase.request.start),
        ],
        figures=figures,
        tables=tables,
        next_step=first + why if worth else "",
    )


def _agreement(match: dict[str, Any]) -> str:
    """How many experiments ended as predicted, and how many cannot tell, in words."""
    told = ""
    if match["of"]:
        told = (
            f" {match['agree']} of {match['of']} experiments ended as the diagram says (95 % "
            f"interval {100 * match['low']:.0f} to {100 * match['high']:.0f} %)."
        )
    if outside := match["outside"]:
        told += f" Outside the diagram, where no cell tells: {outside}."
    return told


def _run_table(phase: Phase, runs: list[Experiment]) -> Table:
    rows = [
        [
            *(Cell(f"{value:g}") for value in run.point),
            Cell(run.observed),
            Cell(run.predicted or "outside the diagram"),
            Cell(
                number(run.probability, 2),
                "" if run.cell is None else "good" if run.predicted == run.observed else "bad",
            ),
            Cell(run.note),
        ]
        for run in runs
    ]
    names = [axis.name for axis in phase.axes]
    first = len(names)
    return Table(
        "Experiments",
        [*names, "seen", "predicted", "probability of what was seen", "note"],
        rows,
        words=(first, first + 1, first + 3),
    )


def _next_table(phase: Phase, worth: list[dict[str, Any]], has_rival: bool) -> Table:
    names = [axis.name for axis in phase.axes if len(axis.values) > 1]
    rows = [
        [
            Cell(str(rank)),
            *(Cell(f"{item[name]:g}") for name in names),
            Cell(
                ", ".join(
                    f"{CLASSES[k]} {100 * share:.0f} %"
                    for k, share in enumerate(phase.share[item["cell"]])
                    if share > 0
                )
            ),
            Cell(number(item["worth_bit"], 2)),
        ]
        for rank, item in enumerate(worth, 1)
    ]
    note = (
        "Bits that one run is expected to tell of which model is right."
        if has_rival
        else "Entropy of the class: 0 is certain."
    )
    return Table(
        "Worth the next experiments",
        ["", *names, "this model says", "bit"],
        rows,
        note,
        words=(1 + len(names),),
    )
