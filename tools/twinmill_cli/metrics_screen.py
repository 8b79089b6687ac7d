# SPDX-License-Identifier: Apache-2.0
"""`twinmill metrics --live`: what the swarms on the bus do now, as a screen or lines of JSON."""

from __future__ import annotations

import json
from contextlib import nullcontext

from twinmill_cli.lazy import working

if working():  # not for --help
    import twinmill_native as native
    from rich.console import Group, RenderableType
    from rich.live import Live
    from rich.table import Table
    from rich.text import Text

    from twinmill.files import plain
    from twinmill.swarm.classes import COLORS, WORDS
    from twinmill.swarm.live_metrics import Look, Question, look_around
    from twinmill.swarm.metrics import WINDOW_S, SwarmSeries

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


def follow(url: str, duration_s: float, question: Question, source: dict, as_json: bool) -> int:
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
            for now_us, looks, note in look_around(url, duration_s, question):
                anybody |= bool(looks)
                if live:
                    live.update(screen(looks, note), refresh=True)
                    continue
                swarms = [look.to_json() for look in looks]
                data = {"utime_us": now_us, "swarms": swarms, "note": note or None, **source}
                print(json.dumps(plain(data), allow_nan=False), flush=True)
        except KeyboardInterrupt:
            pass  # the way to end it
    if live and not live.console.is_terminal:
        live.console.line()
    return 0 if anybody else 1


def screen(looks: list[Look], note: str) -> RenderableType:
    """A column for each swarm, or the sentence that there is none."""
    if not looks:
        return Text(note, "yellow")
    names = [name for name in ROWS if name != "odd_ratio" or any(_has_odd(k) for k in looks)]
    table = Table(box=None, padding=(0, 2, 0, 0))
    table.add_column("")
    columns = []
    for look in looks:
        table.add_column(f"{look.prefix}R..", justify="right")
        table.add_column(look.source, justify="right", style="dim")
        columns.append(_column(look.series, names))
    labels = ["mean over the last", "class", *(ROWS[name][0] for name in names), "robots"]
    for label, *cells in zip(labels, *columns, strict=True):
        table.add_row(label, *(cell for pair in cells for cell in pair))
    return Group(table, *(Text(line, style) for line, style in _remarks(looks)))


def _column(series: SwarmSeries | None, names: list[str]) -> list[tuple[str | Text, str]]:
    """Cells of one swarm from above: mean, and newest value."""
    if series is None:
        return [("-", "")] * (len(names) + 3)
    last_s = min(series.t_s[-1] - series.t_s[0], WINDOW_S)
    cells = [(f"{last_s:.0f} s", "now"), (Text(series.final, COLORS[series.final]), "")]
    for name in names:
        k, form = native.METRICS.index(name), ROWS[name][1]
        cells.append((format(series.mean[k], form), format(series.values[-1, k], form)))
    return [*cells, (str(len(series.robots)), "")]


def _has_odd(look: Look) -> bool:
    return look.series is not None and bool(look.series.odd)


def _remarks(looks: list[Look]) -> list[tuple[str, str]]:
    """Sentences below the table, and their style."""
    lines = []
    for look in looks:
        name = f"{look.prefix}R.."
        if look.series:
            odd = ", ".join(f"R{i:02d}" for i in look.series.odd)
            words = WORDS[look.series.final] + (f"; odd: {odd}" if odd else "")
            lines.append((f"{name} {words}", "dim"))
        if look.note:
            lines.append((f"{name} {look.note}", "yellow"))
        if look.lost:
            lost = ", ".join(f"R{i:02d}" for i in look.lost)
            lines.append((f"{name} without poses, so left out: {lost}", "yellow"))
    return lines
