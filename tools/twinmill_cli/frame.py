# SPDX-License-Identifier: Apache-2.0
"""Steps that commands on logs and a model share: open the model, read the logs, report."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from twinmill.data.measurement import Measurements, load_measurements
from twinmill.files import check_report
from twinmill.model.model_file import ModelFile
from twinmill.provenance import Provenance
from twinmill.version import __version__
from twinmill_cli.exit_now import STOPPED
from twinmill_cli.options import repeated
from twinmill_cli.output import CHANGED, deliver, say, telling

if TYPE_CHECKING:  # slow to import, and JSON needs none of it
    from types import ModuleType

    from rich.console import RenderableType

    from twinmill.report import Section


def command_line(verb: str, logs: list[Path], model: str, output: Path | None = None) -> str:
    """The command line that does this again, without what only changes where and how it is told."""
    words = ["twinmill", *shlex.split(verb), *map(str, logs), "--model", model]
    return shlex.join(words + (["-o", str(output)] if output else []))


def option(name: str) -> str:
    """Option of the command line for a text of an effect."""
    return f"--{name.replace('_', '-')}"


def of_robot(robot: int | None) -> list[str]:
    """As words of a command."""
    return [] if robot is None else ["--robot", str(robot)]


def open_model(model: str, out: Path | None) -> ModelFile:
    """Reads the model, once it is clear that the report's folder can be written."""
    if out:
        check_report(out)
    return ModelFile.load(model)


def is_mjcf(model: str) -> bool:
    """True of a model in MuJoCo's own format, which is of joints."""
    return Path(model).suffix.lower() in (".xml", ".mjcf")


def with_own(verb: str, own: list[Path]) -> str:
    """Words of a command with the logs that its model was made with."""
    return shlex.join([*shlex.split(verb), *repeated("--own", own)])


def refuse_report(verb: str, robots: str, out: Path | None) -> None:
    """Raises ValueError if a report is wanted where there is none: of these robots."""
    if out is not None:
        raise ValueError(f"{verb}: there is no report of {robots}; leave --out away.")


def provenance(command: str, model: ModelFile) -> Provenance:
    """Provenance that every output carries."""
    return Provenance(command, f"twinmill {__version__}", model.hash)


def load(logs: list[Path], model_file: ModelFile) -> Measurements:
    """Reads logs and says on stderr what is wrong with them.

    Raises:
        LogError: nothing is left to judge, or nothing could be read.
    """
    measurements = load_measurements(logs, model_file.model)
    mild = [str(finding) for finding in measurements.findings if not finding.fatal]
    for sentence in [*measurements.excluded, *mild]:
        say(sentence)
    return measurements


@dataclass(frozen=True)
class Given:
    """Logs and model that a command judges, as they were typed and as they were read.

    Attributes:
        logs: files.
        model: file or name.
        model_file: the model.
        measurements: of the logs.
    """

    logs: list[Path]
    model: str
    model_file: ModelFile
    measurements: Measurements


def read(logs: list[Path], model: str, model_file: ModelFile) -> Given:
    """Reads logs as `load`, and tells so while it lasts."""
    with telling(f"reading {', '.join(log.name for log in logs)}"):
        return Given(logs, model, model_file, load(logs, model_file))


def told(measurements: Measurements) -> dict[str, Any]:
    """Provenance as JSON output carries it."""
    return {"input": [finding.to_json() for finding in measurements.findings]}


def finish(
    data: dict[str, Any],
    text: RenderableType | None,
    source: Provenance,
    *,
    section: Callable[[], Section],
    as_json: bool,
    out: Path | None,
    scored: bool = True,
) -> None:
    """Report, then JSON or text; the section's pictures are drawn for a report alone.

    Of JSON no text need be made. A report with a score tells what that means (`scored`).

    What was found is told though the report cannot be written, or Ctrl-C stops its drawing; of work
    that was stopped before (`stopped` in data) none is drawn.

    Raises:
        ValueError: the report cannot be written.
        Exit: Ctrl-C stopped the work, or the report.
    """
    report, failed, done = None, None, not data.get("stopped")
    if out and done:
        try:
            drawn = section()
            report = _written(out, drawn, source, scored)
        except KeyboardInterrupt:
            done = False
        except (OSError, ValueError) as error:
            failed = error
    data = data if done else {**data, "stopped": True}
    deliver({**data, **source.to_json(), "report": str(report) if report else None}, text, as_json)
    if report and not as_json:
        typer.echo(f"Report: {report}")
    if failed:
        raise ValueError(f"what is told above stands, but there is no report: {failed}")
    if not done:
        if out:
            say("stopped; no report was drawn.")
        raise typer.Exit(STOPPED)


def finish_changed(
    result: Any,
    present: ModuleType,
    source: Provenance,
    *,
    changed: bool,
    as_json: bool,
    out: Path | None,
) -> None:
    """Tells whether a robot changed: as `finish`, and by the exit code.

    Args:
        result: what was found.
        present: module of the report that shows it: `verdict`, `terminal` and `section`.
        source: of the report.
        changed: whether there is an alarm.
        as_json: as of `finish`.
        out: likewise.

    Raises:
        ValueError, Exit: as `finish`.
        Exit: something changed.
    """
    finish(
        {"sentence": " ".join(present.verdict(result)), **result.to_json()},
        None if as_json else present.terminal(result),
        source,
        section=partial(present.section, result),
        as_json=as_json,
        out=out,
        scored=False,
    )
    if changed:
        raise typer.Exit(CHANGED)


def _written(out: Path, drawn: Section, source: Provenance, scored: bool) -> Path:
    from twinmill.report.html import SCORE_NOTE, write_report  # slow to import

    return write_report(out, drawn.title, source, [drawn], note=SCORE_NOTE if scored else "")
