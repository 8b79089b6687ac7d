# SPDX-License-Identifier: Apache-2.0
"""Figure of a steady-state table: measured against predicted."""

import numpy as np

from twinmill.report.canvas import MEASURED, draw, legend_above
from twinmill.report.html import Figure
from twinmill.steady.compare import SteadyComparison

# Okabe and Ito (2008), one colour a robot.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def steady_values(robots: list[SteadyComparison]) -> Figure:
    """Each input once per robot: what the model says, across, and what was measured, up."""

    def paint(panels) -> None:
        for c, (axes, unit) in enumerate(zip(panels, ("m/s", "rad/s"), strict=True)):
            for k, robot in enumerate(robots):
                sheet = robot.scene.measurement
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
                [np.r_[r.predicted[:, c], r.scene.measurement.value[:, c]] for r in robots]
            )
            ends = [np.nanmin(known), np.nanmax(known)]
            axes.plot(ends, ends, color=MEASURED, lw=1, ls="--")
            axes.set(xlabel=f"predicted {unit}", ylabel=f"measured {unit}")
        legend_above(panels[0], len(robots))

    return Figure(
        draw(6.4, paint, nrows=2),
        "Steady speed and turn rate",
        "Each dot is one robot at one input; a right model has all dots on the dashed line, within "
        "their bars. Dots of a level row were measured alike but predicted differently.",
    )
