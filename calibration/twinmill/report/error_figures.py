# SPDX-License-Identifier: Apache-2.0
"""Figures of errors: how they grow, when they come, and what each step took away."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from twinmill.fitting.compare import GOOD, MISSING, RobotComparison
from twinmill.predict.regimes import Regime
from twinmill.predict.steady_errors import SteadyComparison
from twinmill.predict.windows import CHANNELS, HORIZONS_S, rms
from twinmill.report.canvas import (
    BEFORE,
    FLOOR,
    PREDICTED,
    draw,
    each_of,
    legend_above,
    plain_ticks,
)
from twinmill.report.html import Figure
from twinmill.report.tables import SHOWN, WORST, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TONES = {"good": "#009e73", "warn": "#e69f00", "bad": "#d55e00"}


def error_growth(models: Sequence[tuple[str, RobotComparison]]) -> Figure:
    """Error against horizon in each channel that was recorded and moves, over the floor's band."""
    colours = [PREDICTED] if len(models) == 1 else [BEFORE, PREDICTED]
    floors = models[-1][1].floor.rms
    shown_channels = [
        (c, *named) for c, named in enumerate(CHANNELS) if np.isfinite(floors[:, c]).any()
    ]

    def paint(panels: Axes | np.ndarray) -> None:
        every = each_of(panels)
        for (c, channel, unit), axes in zip(shown_channels, every, strict=True):
            factor, shown = SHOWN[unit]
            floor = floors[:, c] * factor
            found = [rms(robot.errors)[:, c] * factor for _, robot in models]
            shown_errors = np.array([floor, *found])
            low = 0.6 * np.nanmin(np.where(shown_errors > 0, shown_errors, np.nan))
            axes.fill_between(
                HORIZONS_S, low, floor, color=FLOOR, alpha=0.25, lw=0, label="noise floor"
            )
            for (label, _), colour, marker, error in zip(
                models, colours, "so", found, strict=False
            ):
                axes.plot(HORIZONS_S, error, marker=marker, ms=4, color=colour, label=label)
            axes.set(
                xscale="log", yscale="log", ylabel=f"{channel} error ({shown})", ylim=(low, None)
            )
            plain_ticks(axes.xaxis)
            plain_ticks(axes.yaxis)
        legend_above(every[0], 3)
        every[-1].set_xlabel("horizon (s)")

    return Figure(
        draw(2.0 * len(shown_channels), paint, nrows=len(shown_channels), sharex=True),
        "Errors over the horizon",
        "RMS errors grow with the horizon. Inside the green band an error cannot be distinguished "
        "from noise: its edge is the noise floor, one standard deviation of what noise alone "
        "causes, and a line along it is as good as this log can show. The scale is logarithmic.",
    )


def regimes(
    robot: RobotComparison | SteadyComparison, of: str = "Predictions half a second ahead"
) -> Figure:
    """Error over floor by what the robot was doing."""
    shown, labels = [], []
    groups: dict[str, list[Regime]] = {}
    for regime in robot.where:
        groups.setdefault(regime.group, []).append(regime)
    for group, members in groups.items():
        shown += members[:WORST]
        labels += [f"{group}: {r.regime}" for r in members[:WORST]]

    def paint(axes: Axes) -> None:
        at = np.arange(len(shown))
        ratios = np.array([r.ratio for r in shown])
        colours = [
            TONES["good"] if x <= GOOD else TONES["warn"] if x <= MISSING else TONES["bad"]
            for x in ratios
        ]
        low = min(0.5, 0.8 * ratios.min())
        axes.barh(at, ratios - low, left=low, color=colours, height=0.7)
        for y, regime in zip(at, shown, strict=True):
            axes.annotate(
                f"{number(regime.ratio)}  ({100 * regime.share:.0f} %)",
                (regime.ratio, y),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        axes.axvline(1, color="#3c3c3c", lw=1, ls="--")
        axes.set(
            xscale="log",
            xlim=(low, 2.2 * max(ratios.max(), 1)),
            ylim=(len(shown) - 0.4, -0.6),
            xlabel="error over noise floor (share of all error)",
        )
        axes.set_yticks(at, labels)
        axes.grid(False, axis="y")
        plain_ticks(axes.xaxis)

    return Figure(
        draw(0.9 + 0.24 * max(len(shown), 3), paint),
        "When it fails",
        f"{of}, sorted by what the robot was doing. A bar that ends "
        "at the dashed line (1) is as good as the noise allows; a long bar is a place to look.",
    )


HELD_OUT = (
    "on parts of the data that were not fitted to, without robots that differ from the others"
)


def waterfall(scores: list[tuple[str, float]], judged: str = HELD_OUT) -> Figure:
    """Fall of the score by each step, on a scale of factors.

    Args:
        scores: name of each step, and the score after it.
        judged: on which data, in words.
    """
    values = np.array([score for _, score in scores])

    def paint(axes: Axes) -> None:
        at = np.arange(len(scores))
        low = min(0.9, 0.9 * values.min())
        axes.barh(at, values - low, left=low, color="#d9d9d9", height=0.62)
        fell, rose = np.minimum(values[1:], values[:-1]), np.maximum(values[1:], values[:-1])
        colours = [FLOOR if better else PREDICTED for better in values[1:] < values[:-1]]
        axes.barh(at[1:], rose - fell, left=fell, color=colours, height=0.62)
        edge = [values[0], *rose]
        for y, (_, score) in enumerate(scores):
            axes.annotate(
                number(score),
                (edge[y], y),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontweight="bold",
            )
        axes.axvline(1, color="#3c3c3c", lw=1, ls="--")
        axes.set(
            xscale="log",
            xlim=(low, 1.6 * values.max()),
            ylim=(len(scores) - 0.4, -0.6),
            xlabel="score: error over noise floor",
        )
        axes.set_yticks(at, [label for label, _ in scores])
        axes.grid(False, axis="y")
        plain_ticks(axes.xaxis)

    return Figure(
        draw(0.9 + 0.36 * max(len(scores), 3), paint),
        "What each step gained",
        f"The score after each step, {judged}. Green is what the step took away (red: added); the "
        "dashed line at 1 is as good as this log can tell.",
    )
