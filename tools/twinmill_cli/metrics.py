# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm metrics`: what the swarm in a log or on the bus does, real or simulated."""

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
    from twinmill.data.log import read_log
    from twinmill.report import swarm_metrics as present
    from twinmill.report import write_report
    from twinmill.swarm.live_metrics import Question
    from twinmill.swarm.metrics import SwarmSeries, swarm_metrics
    from twinmill_cli.frame import command_line, open_model, provenance
    from twinmill_cli.metrics_screen import follow


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
    """Metrics of the swarm in a log or on the bus over time, and the class of its behaviour.

    With --live the same of the last 10 s of the bus, robots and twins (channels
    TWIN_...), once a second until Ctrl-C; --json then prints an object a line.

    View range and body size are the model's. Velocities are fitted to the poses;
    twin_run says the same of its own run, from the poses that it publishes.

    Example: twinmill swarm metrics run.lcmlog --out report

    Example: twinmill swarm metrics --live
    """
    if live == (log is not None):
        raise ValueError("give either a LOG or --live.")
    if live and out:
        raise ValueError("--out: a report is of a log; record the bus with lcm-logger.")
    model_file = open_model(model, out)
    range_m, radius_m = map(model_file.model.get, ("sensor.range_m", "robot.body_radius_m"))
    not_of_ring = ["--odd", odd] if odd else []
    if log is None:
        question = Question(channel_prefix, range_m, radius_m, robot_ids(odd))
        swarm = ["--channel-prefix", channel_prefix] if channel_prefix else []
        verb = shlex.join(["metrics", "--live", *swarm, *not_of_ring])
        source = provenance(command_line(verb, [], model), model_file)
        return follow(lcm_url, duration_s, question, source=source.to_json(), as_json=as_json)
    verb = shlex.join(["metrics", *not_of_ring])
    source = provenance(command_line(verb, [log], model), model_file)
    with busy(f"reading {log}"):
        series = swarm_metrics(read_log(log), range_m, radius_m, robot_ids(odd))
    section = present.section(series)
    report = write_report(out, section.title, source, [section], note=present.NOTE) if out else None
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
    if not all(re.fullmatch(r"R?[0-9]{1,2}", word) for word in words):
        raise ValueError(f"--odd '{text}': write robots as 5 or R05,R06.")
    return [int(word.lstrip("R")) for word in words]
