# SPDX-License-Identifier: Apache-2.0
"""The page on what matters for a swarm."""

from dataclasses import replace

import numpy as np
import twinmill_native as native
from matplotlib.axes import Axes

from twinmill.report import Figure, Section
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw
from twinmill.report.phase_figures import TRACE_EVERY_S, TRACE_S, maps_figure, paint_paths
from twinmill.report.tables import Cell, Table, Tone, number
from twinmill.swarm.matters.sensitivity import (
    MATTERS,
    METRICS,
    NOTHING,
    UNSURE,
    FactorResult,
    Sensitivity,
)
from twinmill.swarm.matters.sentences import headline, label, next_step, sentence
from twinmill.swarm.phase import Phase

NOTE = (
    "Each change is made alone, and the same random starts and robots are run before and after it. "
    "It matters if the share of runs that reach the goal changes by the margin or more, and no "
    "chance does that (5 % for all changes together); it does not if the 95 % interval of the "
    "change is within the margin."
)
TONES: dict[str, Tone] = {MATTERS: "bad", UNSURE: "warn", NOTHING: "good"}
COLORS = {MATTERS: PREDICTED, UNSURE: "#8a5a00", NOTHING: FLOOR}
KINDS = {
    "effect": "effect of the model, left out",
    "parameter": "number of the model, at the ends of its interval",
    "hidden": "effect that no log excludes",
    "one_robot": "one robot apart from the others",
    "robots": "differences of robots",
}
COLUMNS = [
    "",
    "change",
    "share\n%",
    "95 % of\nchange",
    "runs",
    "circliness",
    "radius\nm",
    "to form\ns",
]
BARS = 16  # of the figure
TOLD = 12  # sentences
PAIRS = 3  # of runs shown before and after


def section(found: Sensitivity, maps: dict[str, Phase]) -> Section:
    """Everything on one page.

    Args:
        found: the answers.
        maps: phase diagrams, of the model as it is first; may be none.
    """
    share, low, high = found.before
    request = found.request
    counts = {v: len(found.of(v)) for v in (MATTERS, UNSURE, NOTHING)}
    return Section(
        title=f"What matters for {request.behavior}",
        score=[
            (f"of runs end '{found.goal}'", f"{100 * share:.0f} %", ""),
            *((verdict, str(count), TONES[verdict]) for verdict, count in counts.items()),
        ],
        verdict=headline(found),
        facts=[
            ("model", request.model_name),
            (
                "runs",
                f"up to {request.seeds} of {request.duration_s:g} s before and after each change, "
                "fewer where the answer was clear before",
            ),
            ("robots", str(len(request.species(request.n)[0]))),
            ("margin", f"{100 * found.margin:g} points"),
            ("interval", f"{100 * low:.0f} to {100 * high:.0f} % of runs end '{found.goal}'"),
            ("circliness, radius, time to form", _medians(found)),
            *((result.verdict, sentence(result)) for result in found.ranked[:TOLD]),
        ],
        figures=[share_figure(found), *_turned_figure(found), *_maps_figure(maps)],
        tables=_tables(found),
        next_step=next_step(found),
    )


def _medians(found: Sensitivity) -> str:
    m = found.medians
    return (
        f"{number(m['circliness'], 2)}, {number(m['radius_m'], 2)} m, {number(m['settled_s'], 2)} "
        "s (medians; radius and time of runs that get there)"
    )


def share_figure(found: Sensitivity) -> Figure:
    """The share before and after each change, what moves it most first."""
    shown = found.ranked[:BARS]

    def paint(axes: Axes) -> None:
        for y, result in enumerate(reversed(shown)):
            d, color = result.worst.share, COLORS[result.verdict]
            span = [100 * (d.before + d.low), 100 * (d.before + d.high)]
            axes.plot(np.clip(span, 0, 100), [y, y], color=color, lw=4, alpha=0.3)
            axes.plot(100 * d.after, y, "o", ms=5, color=color)
        share = 100 * found.before[0]
        axes.axvline(share, color=MEASURED, lw=1)
        margin = 100 * found.margin
        axes.axvspan(share - margin, share + margin, color=MEASURED, alpha=0.06, lw=0)
        axes.set(xlim=(-2, 102), ylim=(-0.6, len(shown) - 0.4), yticks=range(len(shown)))
        axes.set_yticklabels([label(result) for result in reversed(shown)], fontsize=7.5)
        axes.set_xlabel(f"runs that end '{found.goal}' (%)")

    return Figure(
        draw(0.27 * len(shown) + 0.8, paint),
        "What moves the share",
        "Line: the model as it is, and around it the margin. Dots: after the change that moves the "
        "share most, with the 95 % interval of the change. Red matters, brown is open, green does "
        "not matter.",
    )


def _turned_figure(found: Sensitivity) -> list[Figure]:
    """One run before and after each of the changes that matter most."""
    unsure = ((j, j.worst.turned) for j in found.of(MATTERS, UNSURE))
    picked = [(j, seed) for j, seed in unsure if seed is not None][:PAIRS]
    if not picked:
        return []

    def paint(panels: np.ndarray) -> None:
        for pair, (result, seed) in zip(panels.T, picked, strict=True):
            outcome = result.worst
            for axes, text in zip(
                pair, (found.request.model_text, outcome.change.text), strict=True
            ):
                cell = replace(found.request, model_text=text).cell(())
                length_s = found.request.duration_s
                trace = native.trace_world(cell, seed, length_s, TRACE_EVERY_S)
                paint_paths(axes, trace[-int(TRACE_S / TRACE_EVERY_S) :], FLOOR)
            pair[0].set_title(f"{label(result)}\nbefore", fontsize=7.5)
            pair[1].set_title("after", fontsize=7.5)

    return [
        Figure(
            draw(3.9, paint, nrows=2, ncols=len(picked), squeeze=False),
            "One run before and after",
            f"The last {TRACE_S:.0f} s of a run with the same seed, that the change turns; dots "
            "are the robots at the end, the bar is 1 m.",
        )
    ]


def _maps_figure(maps: dict[str, Phase]) -> list[Figure]:
    if not maps:
        return []
    phase = next(iter(maps.values()))
    return [
        maps_figure(
            maps,
            "Phase diagram before and after",
            f"The most frequent class of {phase.seeds} runs in each cell, and its share in "
            "percent. Hatched: no class has more than half of the runs beyond doubt (95 %). The "
            "first is of the model as it is, the others after one change each.",
        )
    ]


def _tables(found: Sensitivity) -> list[Table]:
    made = []
    for kind, title in KINDS.items():
        rows = [_row(result) for result in found.ranked if result.factor.kind == kind]
        if rows:
            made.append(Table(title.capitalize(), COLUMNS, rows, words=(0, 1)))
    if found.left:
        rows = [[Cell(name), Cell(why)] for name, why in found.left]
        made.append(Table("Not tried", ["", "why"], rows, words=(0, 1)))
    return made


def _row(result: FactorResult) -> list[Cell]:
    """The change that moves the share most; medians that do not move beyond doubt are pale."""
    worst = result.worst
    share = worst.share
    cells = []
    for name in METRICS:
        d = worst.metrics[name]
        tone: Tone = "" if d.low > 0 or d.high < 0 else "dim"
        words = f"{number(d.before, 2)} to {number(d.after, 2)}"
        cells.append(Cell("-" if np.isnan([d.before, d.after]).all() else words, tone))
    return [
        Cell(result.verdict, TONES[result.verdict]),
        Cell(label(result)),
        Cell(f"{100 * share.before:.0f} to {100 * share.after:.0f}"),
        Cell(f"{100 * share.low:+.0f} to {100 * share.high:+.0f}", "dim"),
        Cell(str(worst.seeds)),
        *cells,
    ]
