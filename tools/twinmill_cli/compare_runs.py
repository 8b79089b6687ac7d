# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot compare`: did anything change between two runs of one robot?"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import ALARM_RATE, DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Model, Out
from twinmill_cli.output import AsJson, say, telling

if working():  # not for --help
    from threadpoolctl import threadpool_limits

    from twinmill.data.measurement import Measurement, load_measurements
    from twinmill.report import runs as present
    from twinmill.runs.compare import RunComparison, compare_runs, of_robot, right_before
    from twinmill.runs.history import healthy_logs
    from twinmill_cli.frame import command_line, finish_changed, open_model, provenance


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("compare-runs")(_compare_runs)


def _compare_runs(
    first: Annotated[Path, typer.Argument(metavar="A", show_default=False, help="A healthy run.")],
    second: Annotated[
        Path, typer.Argument(metavar="B", show_default=False, help="A later run of that robot.")
    ],
    *,
    model: Model = DEFAULT_MODEL,
    healthy: Annotated[
        list[Path] | None,
        typer.Option(
            "--healthy",
            metavar="LOG",
            show_default=False,
            help="Another healthy run, or a history that `fit --history` wrote; may be repeated.",
        ),
    ] = None,
    robot: Annotated[
        int | None,
        typer.Option(
            "--robot",
            min=0,
            max=99,
            show_default=False,
            help="Its number, where logs have several.",
        ),
    ] = None,
    alarm_rate: Annotated[
        float,
        typer.Option(
            "--alarm-rate", min=0.001, max=0.5, help="Of comparisons without a change, at most."
        ),
    ] = ALARM_RATE,
    as_json: AsJson = False,
    out: Out = None,
) -> RunComparison:
    """Tell whether anything changed between two runs of one robot: what, how much, since when.

    What varies from day to day is told apart and is no alarm: how the marker is
    mounted, the battery's charge, the clocks' offset. With --healthy the alarm is
    calibrated on this robot.

    Exit codes: 0 nothing changed, 3 something did.

    Example: twinmill robot compare monday.lcmlog friday.lcmlog --model fitted.toml
    """
    given = healthy or []
    words = [w for path in given for w in ("--healthy", str(path))]
    words += [] if robot is None else ["--robot", str(robot)]
    words += [] if alarm_rate == ALARM_RATE else ["--alarm-rate", f"{alarm_rate:g}"]
    verb = shlex.join(["robot", "compare", *words])
    model_file = open_model(model, out)
    source = provenance(command_line(verb, [first, second], model), model_file)
    others, missing = healthy_logs(given)
    for sentence in missing:
        say(sentence)

    def run(path: Path) -> Measurement:
        return of_robot(load_measurements([path], model_file.model), path.name, robot)

    with telling("comparing runs") as tell, threadpool_limits(1, "blas"):
        before = run(first)
        with right_before(first.name):
            after = run(second)
        known = (before.log_sha256, after.log_sha256)
        more = [m for m in map(run, others) if m.log_sha256 not in known]
        result = compare_runs(
            *(before, after, model_file), healthy=more, rate=alarm_rate, tell=tell
        )
    finish_changed(result, present, source, changed=result.changed, as_json=as_json, out=out)
    return result
