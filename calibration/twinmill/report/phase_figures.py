# SPDX-License-Identifier: Apache-2.0
"""Pictures of a phase diagram: map, probability, what the swarm does, and a map to play with."""

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
import twinmill_native as native
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from scipy.interpolate import CubicSpline

from twinmill.data.world_bodies import WorldBody
from twinmill.report import Figure
from twinmill.report.canvas import WIDTH_IN, Svg, draw
from twinmill.report.log_figures import paint_bodies
from twinmill.swarm.axes import Axis
from twinmill.swarm.classes import COLORS, WORDS, interval
from twinmill.swarm.experiments import Experiment
from twinmill.swarm.phase import CLASSES, Phase
from twinmill.swarm.request import Request

TRACE_S, TRACE_EVERY_S = 8.0, 0.1
BETWEEN = 5  # pieces that a step of a trace is drawn in
MOST_NUMBERS = 150  # cells beyond which numbers in them cannot be read
DARK = "#222222"
MAPS_ACROSS = 2


def _edges(values: tuple[float, ...]) -> np.ndarray:
    """Borders half way between values."""
    v = np.array(values)
    if len(v) == 1:
        return np.array([v[0] - 0.5, v[0] + 0.5])
    inner = (v[1:] + v[:-1]) / 2
    return np.concatenate([[2 * v[0] - inner[0]], inner, [2 * v[-1] - inner[-1]]])


def _sorted(axis: Axis) -> tuple[tuple[float, ...], list[int]]:
    """Values in ascending order, and their places in the sweep."""
    order = sorted(range(len(axis.values)), key=axis.values.__getitem__)
    return tuple(axis.values[k] for k in order), order


def _grid(phase: Phase, at: dict[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells by row and column, and the borders of columns and rows."""
    x, x_order = _sorted(phase.axes[0])
    cells = phase.slice(at)[:, x_order]
    if len(phase.axes) == 1:
        return cells, _edges(x), np.array([0.0, 1.0])
    y, y_order = _sorted(phase.axes[1])
    return cells[y_order], _edges(x), _edges(y)


def _label(axes: Axes, phase: Phase) -> None:
    axes.set_xlabel(phase.axes[0].label)
    if len(phase.axes) > 1:
        axes.set_ylabel(phase.axes[1].label)
    else:
        axes.set_yticks([])
    axes.grid(False)


def _pale(color: str, share: float) -> tuple[float, ...]:
    """Towards white, as far as other classes come up too."""
    return tuple(1 - share * (1 - channel) for channel in to_rgb(color))


def _height(rows: int, columns: int) -> float:
    return float(np.clip(WIDTH_IN * 0.8 * rows / columns, 1.2, 4.2)) + 1.1


def slice_words(phase: Phase, at: dict[str, float]) -> str:
    """Where the picture cuts through the axes that it cannot show."""
    cell = phase.points[phase.slice(at).flat[0]]
    held = [f"{axis.label} {cell[k]:g}" for k, axis in enumerate(phase.axes) if k >= 2]
    return f" Cut at {', '.join(held)}." if held else ""


def map_figure(
    phase: Phase, at: dict[str, float], runs: list[Experiment], worth: list[dict[str, Any]]
) -> Figure:
    """The class of each cell, as the paper draws it."""
    cells, x, y = _grid(phase, at)

    def paint(axes: Axes) -> None:
        _paint_cells(axes, phase, (cells, x, y))
        _mark(axes, phase, cells, runs, worth=worth)
        _label(axes, phase)
        seen = {CLASSES.index(run.observed) for run in runs if run.observed in CLASSES}
        shown = sorted(seen | set(phase.mode[cells.flat].tolist()))
        axes.legend(
            handles=[Patch(color=COLORS[CLASSES[k]], label=CLASSES[k]) for k in shown],
            loc="lower left",
            bbox_to_anchor=(0, 1),
            ncols=4,
            columnspacing=1.2,
            handlelength=1.2,
        )

    marks = " Circles are experiments, in the colour of what was seen." if runs else ""
    marks += " Numbers in diamonds: where the next experiment tells most." if worth else ""
    return Figure(
        draw(_height(*cells.shape), paint),
        "Phase diagram",
        f"The most frequent class of {phase.seeds} runs in each cell, and its share in percent: "
        "the paler, the less sure. Hatched: no class has more than half of the runs beyond doubt "
        f"(95 %).{marks}{slice_words(phase, at)}",
    )


def maps_figure(phases: dict[str, Phase], title: str, caption: str) -> Figure:
    """Maps of the same cells side by side, under their names."""
    first = next(iter(phases.values()))
    cells, x, y = _grid(first, {})
    rows = -(-len(phases) // MAPS_ACROSS)

    def paint(panels: np.ndarray) -> None:
        for axes in panels.flat[len(phases) :]:
            axes.set_axis_off()
        for axes, (name, phase) in zip(panels.flat, phases.items(), strict=False):
            _paint_cells(axes, phase, (cells, x, y))
            _label(axes, phase)
            axes.set_title(name, fontsize=8)
        shown = sorted({k for phase in phases.values() for k in phase.mode[cells.flat].tolist()})
        panels.flat[0].figure.legend(
            handles=[Patch(color=COLORS[CLASSES[k]], label=CLASSES[k]) for k in shown],
            loc="outside upper left",
            ncols=5,
            columnspacing=1.2,
            handlelength=1.2,
        )

    height = 2.3 * rows + 0.4
    return Figure(draw(height, paint, nrows=rows, ncols=MAPS_ACROSS, squeeze=False), title, caption)


def _paint_cells(axes: Axes, phase: Phase, grid: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Classes and their shares."""
    cells, x, y = grid
    for r, row in enumerate(cells):
        for c, cell in enumerate(row):
            _paint_cell(axes, phase, cell, (x[c], y[r]), size=(x[c + 1] - x[c], y[r + 1] - y[r]))
            if cells.size <= MOST_NUMBERS:
                axes.text(
                    (x[c] + x[c + 1]) / 2,
                    (y[r] + y[r + 1]) / 2,
                    f"{100 * phase.share[cell].max():.0f}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color=DARK,
                )
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))


def _paint_cell(
    axes: Axes, phase: Phase, cell: int, corner: tuple[float, float], *, size: tuple[float, float]
) -> None:
    k = phase.mode[cell]
    share = phase.share[cell, k]
    unsure = interval(phase.counts[cell, k], phase.seeds)[0] < 0.5
    axes.add_patch(
        Rectangle(
            corner,
            *size,
            facecolor=_pale(COLORS[CLASSES[k]], share),
            edgecolor="#888888" if unsure else "white",
            hatch="////" if unsure else None,
            lw=0.4,
        )
    )


def _mark(
    axes: Axes,
    phase: Phase,
    cells: np.ndarray,
    runs: list[Experiment],
    *,
    worth: list[dict[str, Any]],
) -> None:
    shown = set(cells.flat)

    def place(point: Sequence[float]) -> tuple[float, float]:
        return point[0], point[1] if len(point) > 1 else 0.5

    for run in runs:
        if run.cell in shown:
            axes.plot(
                *place(run.point),
                "o",
                ms=9,
                mfc=COLORS.get(run.observed, COLORS["separated"]),
                mec="black",
                mew=1.6,
                zorder=5,
                clip_on=False,
            )
    for rank, item in enumerate(worth, 1):
        if item["cell"] in shown:
            at = place(phase.points[item["cell"]])
            axes.plot(*at, "D", ms=12, mfc="white", mec="black", mew=0.8, zorder=6)
            axes.text(*at, str(rank), ha="center", va="center", fontsize=7.5, zorder=7)


def probability_figure(phase: Phase, at: dict[str, float]) -> Figure:
    """How probable the goal is: a map of two axes, a curve of one."""
    cells, x, y = _grid(phase, at)
    probability, bounds = phase.hits / phase.seeds, phase.intervals()

    def paint_map(axes: Axes) -> None:
        mesh = axes.pcolormesh(x, y, probability[cells], vmin=0, vmax=1, cmap="viridis")
        if min(cells.shape) > 1:
            middle = [(e[1:] + e[:-1]) / 2 for e in (x, y)]
            lines = axes.contour(
                *middle, probability[cells], levels=[0.5, 0.9], colors="black", linewidths=1
            )
            lines.set_path_effects([withStroke(linewidth=3, foreground="white")])  # on any colour
        axes.figure.colorbar(mesh, label=f"probability of '{phase.goal}'")
        _label(axes, phase)

    def paint_curve(axes: Axes) -> None:
        values, _ = _sorted(phase.axes[0])
        line = cells[0]
        axes.fill_between(values, *bounds[line].T, alpha=0.25, lw=0, color=COLORS["milling"])
        axes.plot(values, probability[line], "o-", ms=4, color=COLORS["milling"])
        axes.set(ylim=(0, 1.02), ylabel=f"probability of '{phase.goal}'")
        axes.set_xlabel(phase.axes[0].label)

    flat = len(phase.axes) == 1
    widest = float(np.max(bounds[:, 1] - bounds[:, 0]) / 2)
    return Figure(
        draw(2.8 if flat else _height(*cells.shape), paint_curve if flat else paint_map),
        f"How probable '{phase.goal}' is",
        f"Share of {phase.seeds} runs; 95 % intervals reach at most {100 * widest:.0f} points to "
        f"either side.{'' if flat else ' White lines: 50 and 90 %.'}{slice_words(phase, at)}",
    )


def thumbnail_figure(phase: Phase, at: dict[str, float]) -> Figure:
    """The last seconds of a typical run of each class on the map."""
    cells = phase.slice(at)
    picks = [
        (k, cells.flat[int(np.argmax(phase.share[cells.flat, k]))])
        for k in sorted(set(phase.mode[cells.flat].tolist()))
    ]

    def paint(panels: np.ndarray) -> None:
        for axes, (k, cell) in zip(np.ravel(panels), picks, strict=True):
            paint_paths(axes, _typical(phase, cell, k), COLORS[CLASSES[k]])
            paint_world(axes, phase.request)
            where = phase.where(cell, 2).replace(", ", "\n")
            axes.set_title(f"{CLASSES[k]}\n{where}", fontsize=7)

    return Figure(
        draw(5.4 / max(2, len(picks)) + 0.7, paint, ncols=len(picks), squeeze=False),
        "What the swarm looks like",
        f"The last {TRACE_S:.0f} s of one run in the cell where each class is most frequent; dots "
        "are the robots at the end, the bar is 1 m. "
        + ("Dotted: where bodies moved. " if phase.request.world_text else "")
        + " ".join(f"{CLASSES[k].capitalize()}: {WORDS[CLASSES[k]]}." for k, _ in picks),
    )


def _typical(phase: Phase, cell: int, k: int) -> np.ndarray:
    """(T, n, 3) end of the first run of this cell that ended in class k."""
    request = phase.request
    rows = slice(cell * phase.seeds, (cell + 1) * phase.seeds)
    ended = phase.table["class"].to_pylist()[rows]
    seed = phase.table["seed"].to_pylist()[rows][ended.index(CLASSES[k])]
    swarm = request.cell(request.points[cell])
    trace = native.trace_world(swarm, seed, request.duration_s, TRACE_EVERY_S, request.plant)
    return trace[-int(TRACE_S / TRACE_EVERY_S) :]


def _curve(path: np.ndarray) -> np.ndarray:
    """A (T, 2) path with points between: straight lines would draw a small circle as a polygon."""
    steps = np.arange(len(path))
    if len(path) < 3:
        return path
    return CubicSpline(steps, path)(np.linspace(0, steps[-1], BETWEEN * steps[-1] + 1))


def paint_world(axes: Axes, request: Request) -> None:
    """Bodies of a sweep's world over the last seconds of a run, as far as the axes show them."""
    t_s = request.duration_s + np.arange(-TRACE_S, TRACE_EVERY_S / 2, TRACE_EVERY_S)
    t_s = np.maximum(t_s, 0)
    traces = request.bodies.trace(t_s.tolist()) if request.bodies else []
    bodies = [
        WorldBody(name, colour, solid, t_s, ends[:, :2], ends[:, 2:], radius_m)
        for name, colour, solid, radius_m, ends in traces
    ]
    paint_bodies(axes, bodies)


def paint_paths(axes: Axes, trace: np.ndarray, color: str, odd: int = 0) -> None:
    """Paths of a (T, n, 3) trace, dots at their ends, hollow for the last `odd`; a bar of 1 m."""
    robots = trace.shape[1]
    for k, robot in enumerate(trace.transpose(1, 0, 2)):
        fill = "white" if k >= robots - odd else DARK
        axes.plot(*_curve(robot[:, :2]).T, color=color, lw=1)
        axes.plot(robot[-1, 0], robot[-1, 1], "o", ms=3.5, color=DARK, mfc=fill)
    middle = (trace[..., :2].min(axis=(0, 1)) + trace[..., :2].max(axis=(0, 1))) / 2
    half = max(0.8, 1.08 * float(np.abs(trace[..., :2] - middle).max()))
    axes.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        aspect="equal",
        xticks=[],
        yticks=[],
    )
    low = middle - 0.93 * half
    axes.plot([low[0], low[0] + 1], [low[1], low[1]], color=DARK, lw=2)
    for spine in axes.spines.values():
        spine.set_visible(True)


def around(points: np.ndarray) -> dict[str, tuple[float, float]]:
    """Limits of a square with all (T, n, 2) points in it."""
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    half = 0.54 * float((high - low).max())
    (x, y) = (low + high) / 2
    return {"xlim": (x - half, x + half), "ylim": (y - half, y + half)}


def slider_figure(phase: Phase) -> Figure:
    """A map of all axes, drawn by a script in the page itself: nothing is fetched."""
    data = {
        "axes": [{"label": axis.label, "values": axis.values} for axis in phase.axes],
        "counts": phase.counts.tolist(),
        "hits": phase.hits.tolist(),
        "seeds": phase.seeds,
        "goal": phase.goal,
        "classes": list(COLORS.items()),
    }
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    script = files("twinmill.report").joinpath("slider.js").read_text()
    return Figure(
        Svg(f'<div id="phase"></div><script>const PHASE={text};\n{script}</script>'),
        "Move through all axes",
        "Choose what goes along and up; the sliders set the rest. Point at a cell for its counts.",
    )
