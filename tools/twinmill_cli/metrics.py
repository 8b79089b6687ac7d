# SPDX-License-Identifier: Apache-2.0
"""`twinmill metrics`: what the swarm in a log or on the bus does, real or simulated."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL, FOREVER_S, URL
from twinmill_cli.lazy import working
from twinmill_cli.options import DurationS, LcmUrl, Model, Out
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    import numpy as np
    import twinmill_native as native

    from twinmill.data.log import read_log
    from twinmill.report import Figure, Section, write_report
    from twinmill.report.canvas import MEASURED, PREDICTED, draw, plain_ticks
    from twinmill.swarm.classes import COLORS, WORDS
    from twinmill.swarm.live_metrics import Question
    from twinmill.swarm.metrics import SwarmSeries, swarm_metrics
    from twinmill_cli.frame import command_line, open_model, provenance
    from twinmill_cli.metrics_screen import follow

LAST_S = 10.0
NOTE = (
    "The class comes from the mean of the last 10 s: milling is circliness below 0.2, turning "
    "together, bodies apart; below 1 is an uneven ring; above, one cluster or separated groups."
)
PANELS = {
    "circliness": "circliness",
    "radius_m": "radius (m)",
    "rotation": "rotation",
    "diffusion": "diffusion",
    "groups": "groups",
    "contacts": "contacts",
}


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("metrics")(_metrics)


def _metrics(
    *,
    log: Annotated[Path | None, typer.Argument(metavar="LOG", show_default=False)] = None,
    live: Annotated[
        bool, typer.Option("--live", help="The robots on the bus instead of a log.")
    ] = False,
    lcm_url: LcmUrl = URL,
    channel_prefix: Annotated[
        str | None,
        typer.Option("--channel-prefix", help="Only this swarm of the bus, as TWIN_; else all."),
    ] = None,
    duration_s: DurationS = FOREVER_S,
    model: Model = DEFAULT_MODEL,
    odd: Annotated[
        str | None,
        typer.Option("--odd", help="Robots that are not of the ring, as 5 or R05,R06."),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> SwarmSeries | int:
    """Tell what the swarm in a log or on the bus does: metrics over time, and its class.

    With --live the same of the last 10 s of the bus, robots and twins (channels
    TWIN_...), once a second until Ctrl-C; --json then prints an object a line.

    View range and body size are the model's. Velocities are fitted to the poses;
    twin_run says the same of its own run, from the poses that it publishes.

    Example: twinmill metrics run.lcmlog --out report

    Example: twinmill metrics --live
    """
    if live == (log is not None):
        raise ValueError("give either a LOG or --live.")
    if live and out:
        raise ValueError("--out: a report is of a log; record the bus with lcm-logger.")
    model_file = open_model(model, out)
    scale = tuple(model_file.model.get(n) for n in ("sensor.range_m", "robot.body_radius_m"))
    not_of_ring = ["--odd", odd] if odd else []
    if live:
        question = Question(channel_prefix, *scale, robot_ids(odd))
        swarm = ["--channel-prefix", channel_prefix] if channel_prefix else []
        verb = shlex.join(["metrics", "--live", *swarm, *not_of_ring])
        source = provenance(command_line(verb, [], model), model_file)
        return follow(lcm_url, duration_s, question, source=source.to_json(), as_json=as_json)
    verb = shlex.join(["metrics", *not_of_ring])
    source = provenance(command_line(verb, [log], model), model_file)
    with busy(f"reading {log}"):
        series = swarm_metrics(read_log(log), *scale, robot_ids(odd))
    section = _section(series)
    report = write_report(out, section.title, source, [section], note=NOTE) if out else None
    data = {**series.to_json(), **source.to_json(), "report": str(report) if report else None}
    text = section.verdict + (f"\nReport: {report}" if report else "")
    deliver(data, text, as_json)
    return series


def robot_ids(text: str | None) -> list[int] | None:
    """Numbers from `5` or `R05,R06`; None stays.

    Raises:
        ValueError: it is neither.
    """
    if text is None:
        return None
    words = text.split(",")
    if not all(re.fullmatch(r"R?\d{1,2}", word) for word in words):
        raise ValueError(f"--odd '{text}': write robots as 5 or R05,R06.")
    return [int(word.lstrip("R")) for word in words]


def _section(series: SwarmSeries) -> Section:
    mean = dict(zip(native.METRICS, series.mean.tolist(), strict=True))
    odd = f", odd robots at {mean['odd_ratio']:.2f} of its radius" if series.odd else ""
    verdict = (
        f"{series.final}: {WORDS[series.final]}. Last 10 s: circliness {mean['circliness']:.3f}, "
        f"radius {mean['radius_m']:.3f} m, rotation {mean['rotation']:+.2f}, diffusion "
        f"{mean['diffusion']:.2f}, groups {mean['groups']:.1f}, contacts {mean['contacts']:.1f}"
        f"{odd}."
    )
    return Section(
        title="What the swarm does",
        score=[("class of the last 10 s", series.final, "")],
        verdict=verdict,
        facts=[
            ("robots", ", ".join(map(str, series.robots))),
            ("odd", ", ".join(map(str, series.odd)) or "none"),
            ("time with all poses", f"{series.t_s[-1] - series.t_s[0]:.1f} s"),
        ],
        figures=[_over_time(series), _paths(series)],
    )


def _over_time(series: SwarmSeries) -> Figure:
    colors = [COLORS[name] for name in series.classes]

    def paint(panels) -> None:
        strip, *rest = panels
        strip.scatter(series.t_s, np.zeros(len(colors)), c=colors, marker="s", s=40, lw=0)
        strip.set(ylim=(-1, 1), yticks=[])
        strip.grid(False)
        for axes, (name, label) in zip(rest, PANELS.items(), strict=True):
            axes.plot(
                series.t_s, series.values[:, native.METRICS.index(name)], color=MEASURED, lw=1
            )
            axes.set_ylabel(label)
        rest[0].set(yscale="log", ylim=(0.02, None))
        plain_ticks(rest[0].yaxis)
        for level in (0.2, 1):
            rest[0].axhline(level, color=PREDICTED, lw=0.8)
        rest[3].axhline(1, color=PREDICTED, lw=0.8)
        rest[-1].set_xlabel("time (s)")

    present = [name for name in COLORS if name in series.classes]
    return Figure(
        draw(
            1.4 * len(PANELS),
            paint,
            nrows=len(PANELS) + 1,
            sharex=True,
            height_ratios=[0.25, *[1] * len(PANELS)],
        ),
        "Over time",
        "The strip on top is the class of the 10 s before: "
        + ", ".join(f"{name} ({_color_word(name)})" for name in present)
        + ". Red lines: circliness 0.2 and 1, and diffusion 1, above which nobody can reach "
        "another's view.",
    )


def _color_word(name: str) -> str:
    return {
        "milling": "green",
        "ellipsoidal": "yellow",
        "cluster": "red",
        "separated": "blue",
        "jammed": "grey",
        "undefined": "pale",
    }[name]


def _paths(series: SwarmSeries) -> Figure:
    last = series.t_s > series.t_s[-1] - LAST_S

    def paint(axes) -> None:
        for k, robot in enumerate(series.robots):
            path = series.pose[last, k]
            odd = robot in series.odd
            axes.plot(path[:, 0], path[:, 1], lw=1.2, color=PREDICTED if odd else MEASURED)
            end = {"xytext": (5, 5), "textcoords": "offset points"}
            axes.annotate(str(robot), path[-1, :2], fontsize=8, **end)
            axes.plot(*path[-1, :2], "o", ms=4, color=PREDICTED if odd else MEASURED)
        axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")

    return Figure(
        draw(4.5, paint),
        "Where they went",
        "Paths of the last 10 s; dots are the ends."
        + (" Odd robots are red." if series.odd else ""),
    )
