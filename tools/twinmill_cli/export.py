# SPDX-License-Identifier: Apache-2.0
"""`twinmill export`: a log for other programs."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Model
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    from importlib.metadata import version

    import pyarrow as pa

    from twinmill.export.mcap_file import write_mcap
    from twinmill.export.recording import Recording, read_recording
    from twinmill.export.rosbag2_file import left_out, write_rosbag2
    from twinmill.export.tables import tables_of, write_csv, write_parquet
    from twinmill.files import folder_beside, replacing, replacing_folder
    from twinmill.model.outlines import Body
    from twinmill_cli.frame import open_model


class Format(StrEnum):
    """What can be written."""

    MCAP = "mcap"
    CSV = "csv"
    PARQUET = "parquet"
    ROSBAG2 = "rosbag2"


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("export")(_export)


def _export(
    log: Annotated[Path, typer.Argument(metavar="LOG", show_default=False)],
    to: Annotated[Format, typer.Option("--to", show_default=False, help="What to write.")],
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
) -> dict:
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
    body = Body.of(open_model(model, None).model)
    out = out or Path(f"{log.stem}.mcap" if to is Format.MCAP else f"{log.stem}_{to}")
    with busy(f"exporting {log}"):
        recording = read_recording(log)
        provenance = {
            "command": command,
            "version": f"twinmill {version('twinmill')}",
            "log_sha256": recording.sha256,
            "t0_utime_us": recording.t0_utime_us,
        }
        if to is Format.MCAP:
            with replacing(out, force) as temporary:
                write_mcap(recording, temporary, provenance, body)
            files = [out]
        elif to is Format.ROSBAG2:
            with replacing_folder(out, force) as temporary:
                write_rosbag2(recording, temporary)
            files = [out]
        else:
            writer = write_csv if to is Format.CSV else write_parquet
            files = _write_tables(tables_of(recording, provenance), out, to, writer, force=force)
    warnings = list(recording.warnings)
    if to is Format.ROSBAG2 and (strange := left_out(recording)):
        warnings.append(f"ROS has no messages for {', '.join(strange)}: left out.")
    counts = {channel.name: len(channel.messages) for channel in recording.channels}
    data = {
        "out": str(out),
        "files": [str(file) for file in files],
        "messages": sum(counts.values()),
        "channels": counts,
        "warnings": warnings,
        **provenance,
    }
    deliver(data, _text(recording, files, warnings), as_json)
    return data


def _write_tables(
    tables: dict[str, pa.Table],
    folder: Path,
    suffix: str,
    write: Callable[[pa.Table, Path], None],
    *,
    force: bool,
) -> list[Path]:
    """One file per table: all are there in the end, or none is new."""
    if folder.exists() and not force:
        raise ValueError(f"{folder}: exists; choose another name, or replace it with --force.")
    files = [folder / f"{name}.{suffix}" for name in tables]
    with folder_beside(folder) as temporary:
        for table, file in zip(tables.values(), files, strict=True):
            write(table, temporary / file.name)
        folder.mkdir(exist_ok=True)
        for file in files:
            os.replace(temporary / file.name, file)
    return files


def _text(recording: Recording, files: list[Path], warnings: list[str]) -> str:
    count = sum(len(channel.messages) for channel in recording.channels)
    return "\n".join(
        [
            f"{count} messages of {len(recording.channels)} channels: {', '.join(map(str, files))}",
            *(f"! {warning}" for warning in warnings),
        ]
    )
