# SPDX-License-Identifier: Apache-2.0
"""Renderings of results for a person at the terminal."""

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table as RichTable
from rich.text import Text

from twinmill.fitting.add import AddResult
from twinmill.fitting.compare import Comparison
from twinmill.fitting.fit import FitResult
from twinmill.report import comparisons, detections, tables
from twinmill.report.tables import Cell, Table, number, tone
from twinmill.terminal import Fitting, whole

Commands = Sequence[tuple[str, str]]  # what for, and the line to type
STYLES = {"": "", "good": "bold green", "warn": "yellow", "bad": "bold red", "dim": "dim"}
BAR = 10  # characters
WARNINGS = 3  # in the terminal; --json has all


def comparison(result: Comparison) -> RenderableType:
    """Text that `twinmill compare` prints: facts, score, tables, warnings, next step."""
    return Group(
        _facts(comparisons.facts(result)),
        Text(),
        score_line("score", result),
        Text(),
        *(table(t) for t in tables.robots(result)),
        *(table(t) for t in comparisons.robot_tables(result)),
        *warned(result.warnings),
        _next(result),
    )


def fit(result: FitResult, not_written: str = "") -> RenderableType:
    """Text that `twinmill fit` prints: score before and after, estimates, the new file.

    Args:
        result: of the fit.
        not_written: said in place of the new file where there is none.
    """
    return Group(
        _facts(comparisons.facts(result.after)),
        Text(),
        _change("score", result.before.score, result.after.score),
        score_line("", result.after, number_too=False),
        Text(),
        table(tables.parameters(result.parameters, result.held)),
        *(table(t) for t in tables.robots(result.after, result.before)),
        *warned([*result.notes, *result.after.warnings]),
        _written(result.path, not_written),
        _next(result.after, fitted=True),
    )


def added(result: AddResult, not_written: str = "") -> RenderableType:
    """Text that `twinmill twin add` prints: scores fitted and held out, the effect's estimates.

    Args:
        result: of the addition.
        not_written: as of `fit`.
    """
    if not (both := result.of_motion):
        return _added_to_camera(result, not_written)
    before, after = both
    own = result.added
    rest = len(result.parameters) - len(own)
    return Group(
        _facts(comparisons.facts(after)),
        Text(),
        _change("score", before.score, after.score),
        _change(
            "held out",
            result.heldout_refit.score,
            result.heldout_after.score,
            "without and with the effect, all parameters refitted",
        ),
        *warned(result.notes),
        score_line("", after, number_too=False),
        Text(),
        table(tables.parameters(own)),
        Text(f"  and {rest} more refitted (the JSON has all).", "dim"),
        *(table(t) for t in tables.robots(after, before)),
        *(table(t) for t in tables.held_out(result)),
        *warned(after.warnings),
        _written(result.path, not_written),
        _next(after, fitted=True),
    )


def _added_to_camera(result: AddResult, not_written: str) -> RenderableType:
    return Group(
        _change("detections", result.before.score, result.after.score),
        _change(
            "held out",
            result.heldout_refit.score,
            result.heldout_after.score,
            "without and with the effect, the camera's other parameters refitted",
        ),
        *warned(result.notes),
        Text(),
        table(tables.parameters(result.parameters)),
        *(table(t) for t in detections.confusion_tables(result.of_detections)),
        _written(result.path, not_written),
    )


def effect(entry: dict[str, Any]) -> RenderableType:
    """One card of the catalogue."""
    labels = ("equation", "stage", "leaves out", "measure by", "reference")
    keys = ("equation", "stage", "leaves_out", "measure", "reference")
    facts = [(label, entry[key]) for label, key in zip(labels, keys, strict=True)]
    lines = _facts([*facts[:2], ("robots", robots(entry)), *facts[2:]])
    return Group(
        Text.assemble((entry["name"], "bold"), f": {entry['summary']}"),
        Text(),
        lines,
        Text(),
        table(tables.effect_parameters(entry)),
        *([table(tables.effect_texts(entry))] if entry.get("texts") else []),
    )


def robots(entry: dict[str, Any]) -> str:
    """Kinds of robots that an effect is defined for."""
    *others, last = entry["drives"]
    return f"commanded by {' or '.join([', '.join(others), last] if others else [last])}"


def table(data: Table) -> RenderableType:
    """A table for the terminal: cells in their tone, bars as blocks where there is room."""
    return Fitting(_made(data, bars=True), data.lists, Fitting(_made(data, bars=False), data.lists))


def _made(data: Table, bars: bool) -> RichTable:
    """The table itself, words left-aligned."""
    made = RichTable(
        title=data.title,
        title_justify="left",
        title_style="bold",
        caption=data.note or None,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for i, column in enumerate(data.columns):
        words = i in data.words
        made.add_column(column, justify="left" if words else "right", no_wrap=not words or i == 0)
    for row in data.rows:
        made.add_row(*(_cell(cell, bars) for cell in row))
    return made


def score_line(label: str, result: Comparison, number_too: bool = True) -> Text:
    """Score in colour, with its meaning."""
    line = Text(f"{label:<10}" if label else "")
    if number_too:
        line.append(number(result.score), STYLES[tone(result.score)]).append("  ")
    return line.append(result.verdict)


def _cell(cell: Cell, bars: bool) -> Text:
    if cell.bar is None or not bars:
        return Text(cell.text, STYLES[cell.tone])
    filled = max(0, min(BAR, round(BAR * cell.bar)))
    return Text.assemble(
        ("█" * filled, STYLES[cell.tone]),
        ("·" * (BAR - filled), "dim"),
        " ",
        (f"{cell.text:>6}", STYLES[cell.tone]),
    )


def _facts(pairs: list[tuple[str, str]]) -> RenderableType:
    grid = RichTable.grid(padding=(0, 1))
    grid.add_column(style="dim", min_width=10)
    grid.add_column()
    for label, text in pairs:
        grid.add_row(label, Text(text))
    return grid


def _change(label: str, before: float, after: float, note: str = "") -> Text:
    return Text.assemble(
        f"{label:<10}",
        (number(before), STYLES[tone(before)]),
        " → ",
        (number(after), STYLES[tone(after)]),
        (f"  {note}", "dim"),
    )


def warned(warnings: list[str]) -> list[RenderableType]:
    """Warnings, line by line; of many the first."""
    lines: list[RenderableType] = [Text(f"! {text}", "yellow") for text in warnings[:WARNINGS]]
    if len(warnings) > WARNINGS:
        lines.append(Text(f"! and {len(warnings) - WARNINGS} more (the JSON has all).", "yellow"))
    return lines


def typed_next(commands: Commands) -> list[Text]:
    """Lines to type next, each with its purpose."""
    return [part for why, command in commands for part in (Text(f"{why}:"), whole(command))]


def _written(path: object, not_written: str) -> Text:
    return Text(not_written or f"Written: {path}")


def _next(result: Comparison, fitted: bool = False) -> RenderableType:
    return Padding(Text(f"Next: {comparisons.advice(result, fitted)}"), (1, 0, 0, 0))
