# SPDX-License-Identifier: Apache-2.0
"""A log for other programs: MCAP for Foxglove, a ROS bag, or one table per message type."""

import os
from dataclasses import dataclass
from pathlib import Path

import twinmill_native as native

from twinmill.defaults import LogFormat
from twinmill.export.recording import Recording, read_recording
from twinmill.export.rosbag2_file import left_out, write_rosbag2
from twinmill.export.script import BAG_FILES
from twinmill.extras import needing
from twinmill.files import check_absent, folder_beside, put_in_place, replacing, replacing_folder
from twinmill.model.outlines import Body
from twinmill.version import __version__


@dataclass(frozen=True)
class ExportedLog:
    """Files written for a log.

    Attributes:
        out: the file or the folder.
        files: all that were written.
        channels: messages of the log by channel.
        written: messages by topic of a bag or an MCAP file, rows by table.
        warnings: sentences on what is odd in the log, or was left out.
        provenance: command, version, log_sha256 and t0_utime_us, as the files carry them.
    """

    out: Path
    files: list[Path]
    channels: dict[str, int]
    written: dict[str, int]
    warnings: list[str]
    provenance: dict

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "out": str(self.out),
            "files": [str(file) for file in self.files],
            "messages": sum(self.written.values()),
            "log_messages": sum(self.channels.values()),
            "channels": self.channels,
            "written": self.written,
            "warnings": self.warnings,
            **self.provenance,
        }


def default_name(log: Path, to: LogFormat) -> Path:
    """Where a log is written to if nothing is said: its name, in this folder."""
    return Path(f"{log.stem}.mcap" if to is LogFormat.MCAP else f"{log.stem}_{to}")


def export_log(
    log: Path,
    to: LogFormat,
    out: Path,
    *,
    model: native.Model,
    command: str,
    force: bool,
    data: bytes | None = None,
) -> ExportedLog:
    """Writes a log for other programs, whole or not at all.

    Args:
        log: the file; one that breaks off is read up to there.
        to: what is written.
        out: a new file (mcap) or folder (the others).
        model: says how large the robots are and how far they see.
        command: recorded in the files.
        force: replace what is there.
        data: what the log holds, if it is in no file.

    Raises:
        LogError: the log cannot be read.
        ValueError: `out` is there, or cannot be written.
    """
    recording = read_recording(log, data)
    provenance = {
        "command": command,
        "version": f"twinmill {__version__}",
        "log_sha256": recording.sha256,
        "t0_utime_us": recording.t0_utime_us,
    }
    files, warnings = [out], list(recording.warnings)
    if to is LogFormat.MCAP:
        with needing("export"):
            from twinmill.export.mcap_file import write_mcap
        with replacing(out, force, inputs=[log]) as temporary:
            written = write_mcap(recording, temporary, provenance, Body.of(model))
    elif to is LogFormat.ROSBAG2:
        with replacing_folder(out, force, inputs=[log], holds=BAG_FILES) as temporary:
            written = write_rosbag2(recording, temporary)
        if strange := left_out(recording):
            warnings.append(f"ROS has no messages for {', '.join(strange)}: left out.")
    else:
        written = _write_tables(recording, provenance, out, to, force=force)
        files = [out / f"{name}.{to}" for name in written]
    counts = {channel.name: len(channel.messages) for channel in recording.channels}
    return ExportedLog(out, files, counts, dict(written), warnings, provenance)


def _write_tables(
    recording: Recording, provenance: dict, folder: Path, to: LogFormat, *, force: bool
) -> dict[str, int]:
    """One file per table: all are there in the end, or none is new. Returns rows by table."""
    with needing("export"):
        from twinmill.export.tables import tables_of, write_csv, write_parquet
    tables = tables_of(recording, provenance)
    write = write_csv if to is LogFormat.CSV else write_parquet
    check_absent(folder, force)
    files = [folder / f"{name}.{to}" for name in tables]
    with folder_beside(folder) as temporary:
        whole = temporary / folder.name
        whole.mkdir()
        for table, file in zip(tables.values(), files, strict=True):
            write(table, whole / file.name)
        if force and folder.is_dir():
            for file in files:
                os.replace(whole / file.name, file)
        else:
            put_in_place(whole, folder, force)
    return {name: table.num_rows for name, table in tables.items()}
