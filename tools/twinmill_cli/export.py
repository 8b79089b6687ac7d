# SPDX-License-Identifier: Apache-2.0
"""`twinmill export`: a log for other programs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill.counted import counted
from twinmill.defaults import DEFAULT_MODEL, LogFormat
from twinmill_cli.lazy import working
from twinmill_cli.options import Model
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    from twinmill.export.log_files import ExportedLog, default_name, export_log
    from twinmill_cli.frame import open_model

BY_TOPIC = (LogFormat.MCAP, LogFormat.ROSBAG2)


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("export")(_export)


def _export(
    log: Annotated[Path, typer.Argument(metavar="LOG", show_default=False)],
    to: Annotated[LogFormat, typer.Option("--to", show_default=False, help="What to write.")],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            show_default=False,
            help="File (mcap) or folder (the others); default: LOG's name, here.",
        ),
    ] = None,
    model: Model = DEFAULT_MODEL,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Write a log as MCAP for Foxglove, as a ROS bag, or as tables, CSV or Parquet.

    MCAP holds all channels with all fields, and robots, views and paths to look
    at in Foxglove's 3D panel; the model says how large they are and how far they
    see. Tables are one file per message type; `twinmill import` reads pose.csv,
    telemetry.csv and drive.csv. A rosbag2 folder holds ROS's own messages (poses,
    /tf, velocities, wheels) for RViz and PlotJuggler. A log that breaks off is
    read up to there.

    Example: twinmill export run.lcmlog --to mcap
    """
    command = shlex.join(["twinmill", "export", str(log), "--to", to, "--model", model])
    robots = open_model(model, None).model
    with busy(f"exporting {log}"):
        done = export_log(
            *(log, to, out or default_name(log, to)), model=robots, command=command, force=force
        )
    words = ("message", "topic") if to in BY_TOPIC else ("row", "table")
    deliver(done.to_json(), _text(done, *words), as_json)
    return done.to_json()


def _text(done: ExportedLog, what: str, where: str) -> str:
    count, files = sum(done.written.values()), ", ".join(map(str, done.files))
    told = [f"{counted(count, what)} in {counted(len(done.written), where)}: {files}"]
    return "\n".join([*told, *(f"! {warning}" for warning in done.warnings)])
