# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm metrics --live`: the swarms on the bus now, as a screen or lines of JSON."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

from twinmill_cli.lazy import working
from twinmill_cli.output import print_object

if working():  # not for --help
    import twinmill_native as native
    from rich.console import Group, RenderableType
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

    from twinmill.swarm.classes import COLORS, WORDS
    from twinmill.swarm.live_metrics import Question, SwarmSnapshot, look_around
    from twinmill.swarm.metrics import WINDOW_S, SwarmSeries
    from twinmill.terminal import Fitting

ROWS = {  # name: what people read, format
    "circliness": ("circliness", ".3f"),
    "rotation": ("rotation", "+.2f"),
    "radius_m": ("radius (m)", ".3f"),
    "scatter_m2": ("scatter (m2)", ".3f"),
    "diffusion": ("diffusion (delta)", ".2f"),
    "groups": ("groups", ".1f"),
    "contacts": ("contacts", ".1f"),
    "odd_ratio": ("odd over radius", ".2f"),
}


def follow(
    url: str, duration_s: float, question: Question, *, source: dict[str, Any], as_json: bool
) -> int:
    """Shows what is heard until Ctrl-C, or for some time.

    Returns:
        1 if nobody was heard, else 0.

    Raises:
        ValueError: there is no such bus.
    """
    anybody = False
    # Without a terminal this prints the last screen, once.
    with (
        nullcontext() if as_json else Live(Text(f"Listening on {url}"), auto_refresh=False) as live
    ):
        try:
            for now_us, snapshots, note in look_around(url, duration_s, question):
                anybody |= bool(snapshots)
                if live:
                    live.update(screen(snapshots, note), refresh=True)
                    continue
                swarms = [snapshot.to_json() for snapshot in snapshots]
                data = {"utime_us": now_us, "swarms": swarms, "note": note or None, **source}
                print_object(data)
        except KeyboardInterrupt:
            pass  # the way to end it
    if live and not live.console.is_terminal:
        live.console.line()
    return 0 if anybody else 1


def screen(snapshots: list[SwarmSnapshot], note: str) -> RenderableType:
    """A column for each swarm, or the sentence that there is none."""
    if not snapshots:
        return Text(note, "yellow")
    names = [name for name in ROWS if name != "odd_ratio" or any(_has_odd(k) for k in snapshots)]
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("")
    columns = []
    for snapshot in snapshots:
        table.add_column(f"{snapshot.prefix}R..", justify="right")
        table.add_column(snapshot.source, justify="right", style="dim")
        columns.append(_column(snapshot.series, names))
    labels = ["mean over the last", "class", *(ROWS[name][0] for name in names), "robots"]
    for label, *cells in zip(labels, *columns, strict=True):
        table.add_row(label, *(cell for pair in cells for cell in pair))
    return Group(Fitting(table), *(Text(line, style) for line, style in _remarks(snapshots)))


def _column(series: SwarmSeries | None, names: list[str]) -> list[tuple[str | Text, str]]:
    """Cells of one swarm from above: mean, and newest value."""
    if series is None:
        return [("-", "")] * (len(names) + 3)
    last_s = min(series.t_s[-1] - series.t_s[0], WINDOW_S)
    cells: list[tuple[str | Text, str]] = [
        (f"{last_s:.0f} s", "now"),
        (Text(series.final, COLORS[series.final]), ""),
    ]
    for name in names:
        k, form = native.METRICS.index(name), ROWS[name][1]
        cells.append((format(series.mean[k], form), format(series.values[-1, k], form)))
    return [*cells, (str(len(series.robots)), "")]


def _has_odd(snapshot: SwarmSnapshot) -> bool:
    return snapshot.series is not None and bool(snapshot.series.odd)


def _remarks(snapshots: list[SwarmSnapshot]) -> list[tuple[str, str]]:
    """Sentences below the table, and their style."""
    lines = []
    for snapshot in snapshots:
        name = f"{snapshot.prefix}R.."
        if snapshot.series:
            odd = ", ".join(f"R{i:02d}" for i in snapshot.series.odd)
            words = WORDS[snapshot.series.final] + (f"; odd: {odd}" if odd else "")
            lines.append((f"{name} {words}", "dim"))
        if snapshot.note:
            lines.append((f"{name} {snapshot.note}", "yellow"))
        if snapshot.lost:
            lost = ", ".join(f"R{i:02d}" for i in snapshot.lost)
            lines.append((f"{name} without poses, so left out: {lost}", "yellow"))
    return lines
