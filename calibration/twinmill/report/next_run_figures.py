# SPDX-License-Identifier: Apache-2.0
"""Figures of a planned run: its commands, its path, and the power for each effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Rectangle

from twinmill.experiment.design import ENOUGH_CHI2, Plan
from twinmill.experiment.power import percent
from twinmill.report import Figure
from twinmill.report.canvas import BEFORE, FLOOR, MEASURED, PREDICTED, draw, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WHEELS = ("front left", "front right", "rear left", "rear right")
VELOCITIES = ("forward (m/s)", "left (m/s)", "turn (rad/s)")
EVERY_S = 0.05  # points of a drawn line
LEAST_CHI2 = 0.1  # a margin that is less is drawn as this


def commands(plan: Plan) -> Figure:
    """Commands over time, of each wheel or of the body."""
    t_s = np.append(plan.rows.t_s, plan.rows.end_s)
    told = np.vstack([plan.rows.command, plan.rows.command[-1:]])
    duties = plan.rows.kind == "duty"
    names = WHEELS if duties else VELOCITIES
    told = told * (100 if duties else 1)

    def paint(panels: np.ndarray) -> None:
        for column, axes in enumerate(panels):
            axes.fill_between(t_s, told[:, column], step="post", color=BEFORE, alpha=0.3, lw=0)
            axes.step(t_s, told[:, column], where="post", color=BEFORE, lw=1)
            axes.set_ylabel(names[column])
            if duties:
                axes.set(ylim=(-108, 108), yticks=(-100, 0, 100))
        panels[-1].set_xlabel("time (s)")

    return Figure(
        draw(4.6, paint, nrows=len(names), sharex=True),
        "The script",
        "Duty of each wheel in percent, over time. Positive drives the robot forward."
        if duties
        else "Commanded velocities over time.",
    )


def floor(plan: Plan) -> Figure:
    """The predicted path on the floor, with and without each effect in question."""
    thin = max(1, round(EVERY_S / float(np.median(np.diff(plan.pose_t_s)))))
    along_m, across_m = plan.limits.floor_m

    def paint(axes: Axes) -> None:
        corner = (-along_m / 2, -across_m / 2)
        axes.add_patch(Rectangle(corner, along_m, across_m, fill=False, ec=MEASURED, lw=1.5))
        for k, path in enumerate(plan.paths[1:]):
            label = "with one of the effects" if k == 0 else None
            axes.plot(*path[::thin, :2].T, color=PREDICTED, lw=0.7, alpha=0.6, label=label)
        axes.plot(*plan.paths[0, ::thin, :2].T, color=BEFORE, label="model as given")
        axes.plot(0, 0, "o", color=MEASURED, ms=5, label="start")
        axes.annotate("", (0.15, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": MEASURED})
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
        axes.set(xlim=(-0.53 * along_m, 0.53 * along_m), ylim=(-0.53 * across_m, 0.53 * across_m))
        legend_above(axes, 3)

    return Figure(
        draw(min(6.5, 0.9 + 4.6 * across_m / along_m), paint),
        "Predicted path",
        "Seen from above: path of the robot's centre, in the frame of its start. Put the robot "
        "in the middle of the arena, its camera along the arrow.",
    )


def margins(plan: Plan) -> Figure:
    """Part of each effect's signature that is its own, before and after the run."""
    names = [c.effect for c in plan.chances]
    before = np.maximum([c.margin_before for c in plan.chances], LEAST_CHI2)
    after = np.maximum([c.margin for c in plan.chances], LEAST_CHI2)

    def paint(axes: Axes) -> None:
        at = np.arange(len(names))
        low = LEAST_CHI2 / 2
        axes.barh(at - 0.2, before - low, left=low, height=0.36, color="#bdbdbd", label="before")
        axes.barh(at + 0.2, after - low, left=low, height=0.36, color=FLOOR, label="with this run")
        for y, chance, margin in zip(at, plan.chances, after, strict=True):
            axes.annotate(
                percent(chance.power),
                (margin, y + 0.2),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        axes.axvline(ENOUGH_CHI2, color=MEASURED, lw=1, ls="--")
        axes.set(
            xscale="log",
            xlim=(low, 6 * max(after.max(), ENOUGH_CHI2)),
            ylim=(len(names) - 0.4, -0.6),
            xlabel="chi2 that no rival can reproduce",
        )
        axes.set_yticks(at, names)
        axes.grid(False, axis="y")
        legend_above(axes, 2)

    return Figure(
        draw(1.1 + 0.42 * max(len(names), 2), paint),
        "What the run identifies",
        "Part of each effect's signature that neither another effect nor a refit of the base can "
        "reproduce, in the logs so far and with this run. Right of the dashed line is enough to "
        "name the effect; the numbers are its power: the probability that it is named if missing.",
    )
