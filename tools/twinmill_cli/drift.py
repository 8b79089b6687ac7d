# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot drift`: a robot's numbers over its calibrations."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import ALARM_RATE
from twinmill_cli.lazy import working
from twinmill_cli.options import Out
from twinmill_cli.output import AsJson

if working():  # not for --help
    from twinmill.files import check_report
    from twinmill.provenance import Provenance
    from twinmill.report import drift as present
    from twinmill.runs.drift import Drift, drift
    from twinmill.runs.history import read_history
    from twinmill.version import __version__
    from twinmill_cli.frame import finish_changed


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("drift")(_drift)


def _drift(
    history: Annotated[
        Path,
        typer.Argument(
            metavar="HISTORY", show_default=False, help="File that `fit --history` wrote."
        ),
    ],
    *,
    alarm_rate: Annotated[
        float,
        typer.Option(
            "--alarm-rate",
            min=0.001,
            max=0.5,
            help="Largest share of false alarms on an unchanged robot.",
        ),
    ] = ALARM_RATE,
    as_json: AsJson = False,
    out: Out = None,
) -> Drift:
    """Plot a robot's parameters over its calibrations, and test which have drifted.

    The band is where the next calibration of an unchanged robot lies, by those
    before it. Exit codes: 0 all are in their bands, 3 one is not.

    Example: twinmill robot drift robot.jsonl --out report
    """
    if out:
        check_report(out)
    words = [] if alarm_rate == ALARM_RATE else ["--alarm-rate", f"{alarm_rate:g}"]
    command = shlex.join(["twinmill", "robot", "drift", str(history), *words])
    result = drift(read_history(history), alarm_rate)
    source = Provenance(command, f"twinmill {__version__}", "")
    finish_changed(result, present, source, changed=bool(result.left), as_json=as_json, out=out)
    return result
