# SPDX-License-Identifier: Apache-2.0
"""A picture of each claim: ours with intervals, the reference as diamonds."""

import numpy as np
from matplotlib.axes import Axes

from twinmill.report import Figure
from twinmill.report.canvas import BEFORE, FLOOR, MEASURED, PREDICTED, draw, legend_above
from twinmill.report.phase_figures import map_figure, paint_paths
from twinmill.swarm.phase import phase_of
from twinmill_lab.claims.rows import Row
from twinmill_lab.claims.swarms import ROUND, Runs

COLORS = (FLOOR, BEFORE, PREDICTED, "#cc79a7", "#e69f00", MEASURED, "#56b4e9", "#8c6d31", "#999999")
LAST_S = 8.0
LEGEND = "Dots are ours with 95 % intervals, hollow diamonds the reference."


def shares(rows: list[Row]) -> Figure:
    """One line for each share."""
    shown = [row for row in rows if row.unit == "%"]

    def paint(axes: Axes) -> None:
        for y, row in enumerate(reversed(shown)):
            axes.plot([100 * row.low, 100 * row.high], [y, y], color=FLOOR, lw=3, alpha=0.5)
            axes.plot(100 * row.value, y, "o", ms=5, color=FLOOR)
            axes.plot(100 * row.reference[0], y, "D", ms=9, mfc="none", mec=MEASURED)
        axes.set(yticks=range(len(shown)), xlim=(-4, 104), ylim=(-0.6, len(shown) - 0.4))
        axes.set_yticklabels([row.what.partition(": ")[2] for row in reversed(shown)])
        axes.set_xlabel("runs that mill (%)")

    return Figure(draw(0.34 * len(shown) + 0.7, paint), "How many runs mill", LEGEND)


def paths(runs_of: dict[str, Runs], odd: int = 0) -> Figure:
    """The end of one run of each."""
    seconds = next(iter(runs_of.values())).request.duration_s

    def paint(panels) -> None:
        for axes, (name, runs) in zip(np.ravel(panels), runs_of.items(), strict=True):
            trace = runs.trace(runs.request.duration_s)[-int(LAST_S * 10) :]
            paint_paths(axes, trace, FLOOR, odd)
            axes.set_title(name, fontsize=8)

    columns = max(2, len(runs_of))
    return Figure(
        draw(5.0 / columns + 0.3, paint, ncols=len(runs_of), squeeze=False),
        "What it looks like",
        f"The last {LAST_S:.0f} of {seconds:g} s of one run; dots are the robots at the end"
        f"{', the odd one hollow' if odd else ''}, the bar is 1 m.",
    )


def delta_and_scatter(diffused: Runs, strewn: Runs) -> Figure:
    """Two clouds that one axis parts and the other does not."""

    def paint(axes: Axes) -> None:
        for runs, name, color in ((strewn, "strewn", MEASURED), (diffused, "diffusing", FLOOR)):
            at = runs["scatter_m2"][0], runs["diffusion"][0]
            axes.plot(*at, "o", ms=4, alpha=0.6, mew=0, color=color, label=name)
        axes.axhline(1, color=PREDICTED, lw=0.9)
        axes.set(xlabel="scatter (m²)", ylabel="delta", ylim=(0, 1.15), xlim=(0, None))
        legend_above(axes, 2)

    return Figure(
        draw(3.1, paint),
        "What delta tells and scatter does not",
        "Each dot is one swarm of eight at its end. Strewn robots stand at random in a square of "
        "the same mean scatter. Red line: delta 1.",
    )


def odd_ratios(ratios: dict[tuple[float, str, int], np.ndarray]) -> Figure:
    """Where the odd robot is, over all seeds."""
    turns = list(dict.fromkeys(turn for turn, _, _ in ratios))
    kinds = list(dict.fromkeys(kind for _, kind, _ in ratios))

    def paint(panels) -> None:
        for axes, turn in zip(np.ravel(panels), turns, strict=True):
            for k, kind in enumerate(kinds):
                for n in (6, 7, 8):
                    values = np.minimum(ratios[turn, kind, n], 2.0)
                    x = n + 0.26 * (k - (len(kinds) - 1) / 2)
                    axes.plot(
                        np.full(values.size, x),
                        values,
                        "o",
                        ms=3,
                        mew=0,
                        alpha=0.2,
                        color=COLORS[k],
                    )
                    axes.plot([x - 0.1, x + 0.1], [np.median(values)] * 2, color=COLORS[k], lw=2)
            axes.axhline(1, color=PREDICTED, lw=0.8)
            axes.set(xticks=[6, 7, 8], xlabel="robots", ylim=(0, 2.05), xlim=(5.5, 8.5))
            axes.set_title(f"{turn:+g} times the turn rate", fontsize=8.5)
        first = np.ravel(panels)[0]
        first.set_ylabel("odd robot's distance / ring's radius")
        for k, kind in enumerate(kinds):
            first.plot([], [], "o", ms=5, color=COLORS[k], label=kind)
        first.legend(loc="upper left", fontsize=8)

    return Figure(
        draw(3.4, paint, ncols=len(turns), sharey=True, squeeze=False),
        "Where the odd robot orbits",
        "A dot for each run, a bar at the median; 0 is the middle of the mill, 1 (red) its ring. "
        "Beyond 2 is drawn at 2.",
    )


def curves(rows: list[Row], label: str, what: str) -> Figure:
    """Shares along one quantity, one curve a kind."""
    kinds = list(dict.fromkeys(row.by["kind"] for row in rows))

    def paint(axes: Axes) -> None:
        for color, kind in zip(COLORS, kinds, strict=False):
            of = [row for row in rows if row.by["kind"] == kind]
            at = np.array([row.by["at"] for row in of])
            low, high = np.array([[row.low, row.high] for row in of]).T
            axes.fill_between(at, low, high, color=color, alpha=0.2, lw=0)
            axes.plot(at, [row.value for row in of], "o-", ms=3.5, color=color, label=kind)
            known = [row for row in of if row.reference and row.reference[0] == row.reference[1]]
            points = [(row.by["at"], row.reference[0]) for row in known]
            axes.plot(*np.array(points).reshape(-1, 2).T, "D", ms=8, mfc="none", mec=color)
        axes.set(xlabel=label, ylabel=what, ylim=(-0.03, 1.05))
        legend_above(axes, 3)

    return Figure(draw(3.4 if len(kinds) < 4 else 4.2, paint), what.capitalize(), LEGEND)


def cuts(rows: list[Row]) -> Figure:
    """Shares by what is varied: a panel for each quantity."""
    labels = list(dict.fromkeys(row.by["kind"] for row in rows))

    def paint(panels) -> None:
        for axes, label in zip(np.ravel(panels), labels, strict=False):
            of = [row for row in rows if row.by["kind"] == label]
            _beside_references(axes, of, dict(fmt="o-", ms=3.5), dict(ms=8))
            axes.set_title(label, fontsize=8)
            axes.set(ylim=(-0.06, 1.08))
        for axes in np.ravel(panels)[len(labels) :]:
            axes.set_axis_off()

    lines = -(-len(labels) // 2)
    return Figure(draw(1.5 * lines + 0.3, paint, nrows=lines, ncols=2), "Share that mills", LEGEND)


def _beside_references(axes: Axes, rows: list[Row], ours: dict, reference: dict) -> None:
    """Values with their intervals over `at`, and open diamonds where a number was published."""
    at = np.array([row.by["at"] for row in rows])
    ends = np.array([[row.value - row.low, row.high - row.value] for row in rows]).T
    axes.errorbar(at, [row.value for row in rows], ends, color=FLOOR, **ours)
    known = [row for row in rows if row.reference]
    axes.plot(
        [row.by["at"] for row in known],
        [row.reference[0] for row in known],
        "D",
        mfc="none",
        mec=MEASURED,
        **reference,
    )


def maps(runs_of: dict[str, Runs]) -> list[Figure]:
    """The phase diagram of each kind of robot."""
    made = []
    for kind, runs in runs_of.items():
        figure = map_figure(phase_of(runs.request, runs.table, "milling"), {}, [], [])
        made.append(Figure(figure.svg, f"Speed and turn rate, {kind}", figure.caption))
    return made


def spread(rows: list[Row], slope: float) -> Figure:
    """Circliness over the spread of robots, and theory."""

    def paint(axes: Axes) -> None:
        ours, reference = dict(fmt="o", ms=4, label="ours"), dict(ms=9, label="reference")
        _beside_references(axes, rows, ours, reference)
        line = np.array([0, 0.2])
        axes.plot(line, slope * line, color=MEASURED, lw=1, label=f"{slope:.2f} times the spread")
        axes.axhline(ROUND, color=PREDICTED, lw=0.9)
        axes.set(xlabel="spread of robots (std of theta_a)", ylabel="circliness", xlim=(0, None))
        axes.set(ylim=(0, 1.1))
        legend_above(axes, 3)

    return Figure(
        draw(3.2, paint),
        "Circliness and spread",
        "To 0.04 the mean of locked rings, beyond it the median of all runs. Red line: circliness "
        f"{ROUND:g}, above which nobody calls it a mill.",
    )
