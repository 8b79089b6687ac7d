# SPDX-License-Identifier: Apache-2.0
"""`twinmill ask`: how many robots, how fast, how good their sensors, how alike."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.options import Out
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import hashlib
    import tempfile

    from matplotlib.axes import Axes
    from rich.console import Group

    from twinmill.files import check_new_folder
    from twinmill.model.model_file import ModelFile
    from twinmill.report import Figure, Provenance, Section, write_report
    from twinmill.report.canvas import FLOOR, MEASURED, draw
    from twinmill.swarm.axes import Axis
    from twinmill.swarm.classes import check_goal, goal_of, interval, reached
    from twinmill.swarm.request import Request
    from twinmill.swarm.store import read_sweep
    from twinmill.swarm.sweep import make_request, sweep


class Question(StrEnum):
    """What is asked."""

    HOW_MANY = "how-many"
    HOW_FAST = "how-fast"
    HOW_GOOD = "how-good"
    HOW_ALIKE = "how-alike"


SENSOR_AXES = [
    "range_m=0.3:1.7:8",
    "cone_deg=10:100:10",
    "miss_rate=0:0.9:10",
    "false_rate=0:0.45:10",
    "delay_s=0:0.15:7",
]
NOTE = "Each point is many simulated runs from random starts; the band is the 95 % interval."


@dataclass(frozen=True)
class Curve:
    """The probability of the goal along one quantity, with 95 % intervals (Wilson 1927)."""

    axis: Axis
    probability: list[float]
    low: list[float]
    high: list[float]
    seeds: int

    def sentence(self, goal: str, at_least: float) -> str:
        """Which values serve, and which serves best."""
        values = self.axis.values
        best = max(range(len(values)), key=lambda k: (self.low[k], -k))
        tell = (
            f"best at {values[best]:g} ({100 * self.probability[best]:.0f} %, interval "
            f"{100 * self.low[best]:.0f} to {100 * self.high[best]:.0f} %)"
        )
        good = [k for k in range(len(values)) if self.probability[k] >= at_least]
        wanted = f"'{goal}' in at least {100 * at_least:.0f} % of runs"
        if not good:
            return f"{self.axis.label}: no value tried gives {wanted}; {tell}."
        runs = _spans(good)
        spans = " and ".join(
            f"{values[a]:g}" if a == b else f"{values[a]:g} to {values[b]:g}" for a, b in runs
        )
        outside = [k for k in (runs[-1][1] + 1, runs[0][0] - 1) if 0 <= k < len(values)]
        edge = "".join(
            f"; at {values[k]:g} it is {100 * self.probability[k]:.0f} %" for k in outside
        )
        return f"{self.axis.label}: {spans} gives {wanted}, {tell}{edge}."

    def to_json(self) -> dict:
        """Plain numbers."""
        return {
            "axis": self.axis.name,
            "label": self.axis.label,
            "values": list(self.axis.values),
            "probability": self.probability,
            "low": self.low,
            "high": self.high,
        }


def _spans(places: list[int]) -> list[tuple[int, int]]:
    """Runs of neighbours."""
    spans = [(places[0], places[0])]
    for k in places[1:]:
        if k == spans[-1][1] + 1:
            spans[-1] = (spans[-1][0], k)
        else:
            spans.append((k, k))
    return spans


def axes_for(question: Question, drive: str) -> list[str]:
    """What is varied to answer."""
    if question is Question.HOW_MANY:
        return ["n=3:14:12"]
    if question is Question.HOW_FAST:
        return ["v_mps=0.05:0.5:10"] if drive == "twist" else ["base.forward_gain=0.2:2:10"]
    return SENSOR_AXES if question is Question.HOW_GOOD else ["theta_a=0:0.2:11"]


def curve_of(request: Request, goal: str) -> Curve:
    """Simulates along the request's only axis."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as folder:
        sweep(request, Path(folder) / "sweep")
        _, table = read_sweep(Path(folder) / "sweep")
    hits = reached(table, goal).reshape(-1, request.seeds).sum(axis=1)
    bounds = [interval(hit, request.seeds) for hit in hits]
    return Curve(
        request.axes[0],
        (hits / request.seeds).tolist(),
        [low for low, _ in bounds],
        [high for _, high in bounds],
        request.seeds,
    )


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("ask")(_ask)


def _ask(
    question: Annotated[Question, typer.Argument(show_default=False)],
    behavior: Annotated[str, typer.Option("--behavior")] = "milling",
    model: Annotated[str, typer.Option("--model", "-m", metavar="M")] = "paper.toml",
    n: Annotated[
        int | None, typer.Option("--n", help="Robots, where they are not asked for.")
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=10, help="Runs of each value.")] = 100,
    duration_s: Annotated[float, typer.Option("--duration-s", min=1)] = 120,
    goal: Annotated[
        str | None, typer.Option("--goal", help="Class that is wanted; default: the behaviour's.")
    ] = None,
    at_least: Annotated[
        float, typer.Option("--at-least", min=0.01, max=1, help="Share of runs that is enough.")
    ] = 0.9,
    target_radius_m: Annotated[float | None, typer.Option("--target-radius-m")] = None,
    start: Annotated[str, typer.Option("--start")] = "square",
    as_json: AsJson = False,
    out: Out = None,
) -> list[Curve]:
    """Answer a design question with a curve and a sentence.

    Example: twinmill ask how-many --behavior milling --model turbopi.toml --out answer
    """
    if out:
        check_new_folder(out)
    drive = ModelFile.load(model).model.drive
    rest = {"n": None if question is Question.HOW_MANY else n, "seeds": seeds, "start": start}
    rest |= {"duration_s": duration_s, "target_radius_m": target_radius_m}
    requests = [make_request(behavior, model, [axis], **rest) for axis in axes_for(question, drive)]
    wanted = check_goal(goal) if goal else goal_of(requests[0])
    curves = [curve_of(request, wanted) for request in requests]
    sentences = [curve.sentence(wanted, at_least) for curve in curves]
    words = ["twinmill", "ask", question, "--behavior", behavior, "--model", model]
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
            _figure(curve, wanted, _capital(sentence) if len(curves) > 1 else "", at_least)
            for curve, sentence in zip(curves, sentences, strict=True)
        ],
    )
    report = write_report(out, section.title, source, [section], NOTE) if out else None
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


def _figure(curve: Curve, goal: str, sentence: str, at_least: float) -> Figure:
    def paint(axes: Axes) -> None:
        values = curve.axis.values
        axes.fill_between(values, curve.low, curve.high, color=FLOOR, alpha=0.25, lw=0)
        axes.plot(values, curve.probability, "o-", ms=4, color=FLOOR)
        axes.axhline(at_least, color=MEASURED, lw=0.8, ls="--")
        axes.set(ylim=(0, 1.03), xlabel=curve.axis.label, ylabel=f"share that ends '{goal}'")

    dashed = f" Dashed: {100 * at_least:.0f} %."
    return Figure(draw(2.8, paint), _capital(curve.axis.label), sentence + dashed)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
