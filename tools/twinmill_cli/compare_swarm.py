# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm compare`: does a recorded swarm behave as the twin's swarms do?"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL, least_seeds
from twinmill_cli.lazy import working
from twinmill_cli.options import Model, Out
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    from twinmill.data.log import read_log
    from twinmill.report import swarm_comparison as present
    from twinmill.report import write_report
    from twinmill.swarm.compare import SwarmComparison, compare_swarm
    from twinmill.swarm.metrics import swarm_metrics
    from twinmill.terminal import progress_bar
    from twinmill_cli.frame import command_line, open_model, provenance
    from twinmill_cli.metrics import robot_ids


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("compare-swarm")(_compare_swarm)


def _compare_swarm(
    log: Annotated[Path, typer.Argument(metavar="LOG", show_default=False)],
    *,
    model: Model = DEFAULT_MODEL,
    seeds: Annotated[
        int, typer.Option("--seeds", min=least_seeds(), help="Runs of the twin.")
    ] = 50,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0)] = 1,
    odd: Annotated[
        str | None, typer.Option("--odd", help="Robots that are not of the ring, as 5 or R05,R06.")
    ] = None,
    behavior: Annotated[
        str | None,
        typer.Option("--behavior", help="Behaviour of all robots; default: as in the log."),
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> SwarmComparison:
    """Tell whether a recorded swarm behaves as the twin's swarms do, and since when not.

    Paths of a swarm are chaotic, so metrics over time are compared: the floor's
    run is ranked among runs of the twin that start from the same poses.

    Example: twinmill swarm compare floor.lcmlog --model fitted.toml --out report
    """
    model_file = open_model(model, out)
    runs = ["--seeds", str(seeds), "--first-seed", str(first_seed)]
    runs += ["--odd", odd] if odd else []
    runs += ["--behavior", behavior] if behavior else []
    verb = shlex.join(["swarm", "compare", *runs])
    source = provenance(command_line(verb, [log], model), model_file)
    scale = (
        model_file.model.get("sensor.range_m"),
        model_file.model.get("robot.body_radius_m"),
    )
    with busy(f"reading {log}"):
        recorded = read_log(log)
        series = swarm_metrics(recorded, *scale, robot_ids(odd))
    with progress_bar() as progress:
        task = progress.add_task("twin runs", total=seeds)
        result = compare_swarm(
            *(recorded, series, model_file.model),
            seeds=range(first_seed, first_seed + seeds),
            behavior=behavior,
            tell=lambda: progress.advance(task),
        )
    section = present.section(result)
    report = write_report(out, section.title, source, [section], note=present.NOTE) if out else None
    data = {**result.to_json(), **source.to_json(), "report": str(report) if report else None}
    lines = [result.verdict, *([f"Next: {section.next_step}"] if section.next_step else [])]
    lines += [f"Report: {report}"] if report else []
    deliver(data, "\n".join(lines), as_json)
    return result
