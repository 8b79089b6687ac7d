# SPDX-License-Identifier: Apache-2.0
"""A comparison with a steady-state table as tables and as a figure, all its robots together."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from twinmill.counted import counted
from twinmill.predict.steady_errors import SteadyComparison
from twinmill.report.canvas import MEASURED, draw, each_of, legend_above
from twinmill.report.html import Figure
from twinmill.report.tables import Cell, Table, number, tone

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STANDING = " Standing side: rim speed predicted where a side was seen to stand still."
BY_VENDOR = (
    "Inputs as the vendor writes them (90° is forward, turn positive clockwise); rates are "
    "positive counter-clockwise."
)
HEADS = {  # of inputs and values, by column
    "speed_input": "speed",
    "direction_deg": "direction\n°",
    "turn_input": "turn",
    "speed_mps": "m/s",
    "turn_radps": "rad/s",
    **{f"{wheel}_pct": f"{wheel}\n%" for wheel in ("fl", "fr", "rl", "rr")},
    **{f"w{k}_radps": f"wheel {k}\nrad/s" for k in (1, 2, 3, 4)},
}
WORST = 15  # inputs shown

# Okabe and Ito (2008), one colour a robot.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def facts(robots: list[SteadyComparison], model_name: str) -> list[tuple[str, str]]:
    """Robots and model of a comparison of steady speeds: label and text."""
    sheet = robots[0].measurement
    numbers = ", ".join(str(r.measurement.robot_id) for r in robots)
    runs = sum(int(r.measurement.runs.sum()) for r in robots)
    inputs = sum(len(r.errors) for r in robots)
    kind = robots[0].floor.kind
    return [
        ("table", f"{sheet.log_name}, robot{'s' * (len(robots) > 1)} {numbers}"),
        ("holds", f"{counted(runs, 'run')} at {counted(inputs, 'steady input')}"),
        ("model", model_name),
        ("scatter", "; ".join(_scatter(robots[0], c) for c in _measured(robots))),
        (
            "noise floor",
            "scatter of repeated runs"
            + (", with that of robots of one kind" if kind == "spread" else ""),
        ),
    ]


def _scatter(robot: SteadyComparison, channel: int) -> str:
    spread = robot.measurement.spread[channel]
    between = f", between robots {100 * spread.robots:.1f} %" if np.isfinite(spread.robots) else ""
    name, _ = robot.modelled.channels[channel]
    return f"{name}: runs of one robot {100 * spread.runs:.1f} %{between}"


def _measured(robots: list[SteadyComparison]) -> list[int]:
    """Columns of their tables that have values."""
    known = np.isfinite(np.concatenate([r.measurement.value for r in robots]))
    return np.flatnonzero(known.any(axis=0)).tolist()


def kinds(robots: list[SteadyComparison]) -> list[list[SteadyComparison]]:
    """Those of drives, and those of wheels on a bench, if there are such."""
    parts = ([r for r in robots if r.measurement.of_wheels is of] for of in (False, True))
    return [part for part in parts if part]


def tables(robots: list[SteadyComparison]) -> list[Table]:
    """Errors by channel and by input, of robots of one kind of table."""
    return [errors(robots), cells(robots)]


def errors(robots: list[SteadyComparison]) -> Table:
    """Errors by channel, over all robots."""
    rows = []
    for c, (channel, unit) in enumerate(robots[0].modelled.channels):
        found = np.concatenate([r.errors[:, c] for r in robots])
        floor = np.concatenate([r.modelled.floor()[:, c] for r in robots])
        known = np.isfinite(found)
        if not known.any():
            continue
        ratio = float(np.sqrt(np.mean((found[known] / floor[known]) ** 2)))
        rows.append(
            [
                Cell(channel),
                Cell(unit),
                Cell(str(int(known.sum()))),
                Cell(number(float(np.sqrt(np.mean(found[known] ** 2))))),
                Cell(number(float(np.sqrt(np.mean(floor[known] ** 2)))), "dim"),
                Cell(number(ratio), tone(max(ratio, 1.0))),
            ]
        )
    return Table(
        "Prediction errors",
        ["channel", "unit", "values", "error", "noise floor", "ratio"],
        rows,
        "RMS of median over runs less prediction; ratio: RMS of the ratios of all values."
        + ("" if robots[0].measurement.of_wheels else STANDING),
        (0, 1),
    )


def cells(robots: list[SteadyComparison]) -> Table:
    """Measured and predicted by input, mean over robots, the worst first."""
    sheet, shown = robots[0].measurement, _measured(robots)
    entries = sorted(_by_input(robots), key=lambda e: -e[-1])
    rows = []
    for inputs, measured, predicted, spread, still, ratio in entries[:WORST]:
        row = [Cell(f"{v:g}") for v in inputs]
        for c in shown:
            row += [
                Cell(number(measured[c])),
                Cell(number(predicted[c]), "" if np.isfinite(measured[c]) else "dim"),
                Cell("-" if np.isnan(spread[c]) else f"{100 * spread[c]:.0f} %", "dim"),
            ]
        rows.append(
            [
                *row,
                Cell("a side stood still" if still else ""),
                Cell(number(ratio), tone(max(ratio, 1.0))),
            ]
        )
    rest = len(entries) - len(rows)
    return Table(
        "By input",
        [
            *(HEADS[name] for name in sheet.input_names),
            *(h for c in shown for h in (HEADS[sheet.columns[c]], "model", "robots")),
            "seen",
            "ratio",
        ],
        rows,
        ("Duties of the wheels." if sheet.of_wheels else BY_VENDOR)
        + " Robots: scatter between them. Worst first"
        + (f"; {rest} more in the JSON." if rest else "."),
        (len(sheet.input_names) + 3 * len(shown),),
    )


Entry = tuple[tuple[float, ...], np.ndarray, np.ndarray, np.ndarray, bool, float]


def _by_input(robots: list[SteadyComparison]) -> list[Entry]:
    """Input; measured, predicted and spread by column; whether a side stood still; RMS ratio."""
    groups: dict[tuple[float, ...], list[tuple[SteadyComparison, int]]] = defaultdict(list)
    for robot in robots:
        for u, inputs in enumerate(robot.measurement.inputs):
            groups[tuple(inputs)].append((robot, u))
    entries = []
    for inputs, members in groups.items():
        ratios = np.array([r.ratios[u] for r, u in members])
        if not np.isfinite(ratios).any():
            continue
        sheets = [(r.measurement, u) for r, u in members]
        entries.append(
            (
                inputs,
                _mean(np.array([s.value[u] for s, u in sheets])),
                np.mean([r.predicted[u] for r, u in members], axis=0),
                _mean(np.array([s.cell_spread[u] for s, u in sheets])),
                any(s.still[u] for s, u in sheets),
                float(np.sqrt(np.nanmean(ratios**2))),
            )
        )
    return entries


def _mean(values: np.ndarray) -> np.ndarray:
    """Over rows, NaN left out; NaN where there is nothing else."""
    count = np.isfinite(values).sum(axis=0)
    return np.nansum(values, axis=0) / np.where(count, count, np.nan)


def values(robots: list[SteadyComparison]) -> Figure:
    """Each input once per robot: what the model says, across, and what was measured, up."""
    shown = _measured(robots)

    def paint(panels: Axes | np.ndarray) -> None:
        every = each_of(panels)
        for axes, c in zip(every, shown, strict=True):
            name, unit = robots[0].modelled.channels[c]
            for k, robot in enumerate(robots):
                sheet = robot.measurement
                axes.errorbar(
                    robot.predicted[:, c],
                    sheet.value[:, c],
                    sheet.floor[:, c],
                    fmt="o",
                    ms=3,
                    lw=0.7,
                    alpha=0.7,
                    color=COLOURS[k % len(COLOURS)],
                    label=f"robot {sheet.robot_id}",
                )
            known = np.concatenate(
                [np.r_[r.predicted[:, c], r.measurement.value[:, c]] for r in robots]
            )
            ends = [np.nanmin(known), np.nanmax(known)]
            axes.plot(ends, ends, color=MEASURED, lw=1, ls="--")
            axes.set(xlabel=f"predicted {name}, {unit}", ylabel=f"measured {name}, {unit}")
        legend_above(every[0], len(robots))

    return Figure(
        draw(3.2 * len(shown), paint, nrows=len(shown)),
        "Steady speeds",
        "Each dot is one robot at one input; a right model has all dots on the dashed line, within "
        "their bars. Dots of a level row were measured alike but predicted differently.",
    )
