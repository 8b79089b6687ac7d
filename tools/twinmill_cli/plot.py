# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm plot`: a log at one glance."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    import matplotlib
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

    from twinmill.data.log import LogError
    from twinmill.data.multi_log import MultiLog, read_multi_log
    from twinmill.files import replacing
    from twinmill.foreign_text import plain_line
    from twinmill.report import Figure, Provenance, Section, render_page
    from twinmill.report.canvas import STYLE, draw
    from twinmill.report.log_figures import Drawing
    from twinmill.version import __version__

    Panel = tuple[Callable[[Axes], None], float, str, str]

SUFFIXES = (".png", ".svg", ".html")
WIDTH_IN, DPI = 8.0, 150


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("plot")(_plot)


def _plot(
    log: Annotated[Path, typer.Argument(metavar="LOG", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", show_default=False, help="A .png, .svg or .html; default: LOG.png."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Draw paths, speeds, bits and wheel commands of all robots in a log.

    Speeds come from the poses. Twins on channels TWIN_... are dashed.

    Example: twinmill swarm plot run.lcmlog -o run.html
    """
    out = out or Path(f"{log.stem}.png")
    if out.suffix not in SUFFIXES:
        raise ValueError(f"{out}: must end in {', '.join(SUFFIXES)}: the end says what is drawn.")
    with busy(f"drawing {log}"), replacing(out, force, inputs=[log]) as temporary:
        multi_log = read_multi_log(log)
        panels = _panels(multi_log, log)
        command = shlex.join(["twinmill", "swarm", "plot", str(log), "-o", str(out)])
        source = Provenance(command, f"twinmill {__version__}", "")
        if out.suffix == ".html":
            temporary.write_text(_page(log, multi_log, panels, source))
        else:
            _sheet(log, panels, temporary, out.suffix[1:])
    data = {
        "out": str(out),
        "robots": [recorded.name for recorded in multi_log.robots],
        "warnings": multi_log.warnings,
        "log_sha256": multi_log.sha256,
        **source.to_json(),
    }
    deliver(data, "\n".join([str(out), *(f"! {w}" for w in multi_log.warnings)]), as_json)
    return data


def _panels(multi_log: MultiLog, log: Path) -> list[Panel]:
    """(painter, height_in, title, caption) of all that the log can show."""
    drawing = Drawing(multi_log.robots, multi_log.bodies)
    rows = len(drawing.driven)
    panels: list[Panel] = []
    if drawing.tracked:
        panels += [
            (drawing.paths, 4.6, "Paths", "Seen from above; dots are the ends, lines the front."),
            (drawing.speed, 1.6, "Speed", "Forward, from the poses."),
            (drawing.turn, 1.4, "Turn", "Counter-clockwise is positive, from the poses."),
        ]
    if drawing.telling:
        height_in = 0.5 + 0.18 * drawing.bit_rows
        words = "Green: the robot sees a neighbour, or what that bit of several looks for."
        panels.append((drawing.bits, height_in, "Bits", words))
    if drawing.driven:
        words = "A row per wheel: front-left, front-right, rear-left, rear-right."
        panels.append((drawing.commands, 0.8 + 0.36 * rows, "Commands", words))
    if not panels:
        raise LogError(f"{log.name}: has neither poses nor commands; there is nothing to draw.")
    return panels


def _sheet(log: Path, panels: list[Panel], path: Path, kind: str) -> None:
    """All panels below each other in one picture."""
    heights = [height_in for _, height_in, _, _ in panels]
    with matplotlib.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH_IN, sum(heights)), layout="constrained", dpi=DPI)
        title = plain_line(log.name)
        canvas.suptitle(title, x=0.01, ha="left", size=10, weight="bold", parse_math=False)
        rows = canvas.subplots(nrows=len(panels), height_ratios=heights, squeeze=False)[:, 0]
        for axes, (paint, *_) in zip(rows, panels, strict=True):
            paint(axes)
        metadata = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}
        canvas.savefig(path, format=kind, metadata=metadata[kind])


def _page(log: Path, multi_log: MultiLog, panels: list[Panel], source: Provenance) -> str:
    figures = [
        Figure(draw(height_in + 0.2, paint), title, caption)
        for paint, height_in, title, caption in panels
    ]
    section = Section(
        title=log.name,
        score=[],
        verdict=f"{', '.join(recorded.name for recorded in multi_log.robots)}.",
        figures=figures,
        warnings=multi_log.warnings,
    )
    return render_page(log.name, source, [section], "")
