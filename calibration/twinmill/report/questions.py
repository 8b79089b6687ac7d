# SPDX-License-Identifier: Apache-2.0
"""The curve that answers a question."""

from matplotlib.axes import Axes

from twinmill.report.canvas import FLOOR, MEASURED, draw
from twinmill.report.html import Figure
from twinmill.swarm.questions import Curve


def curve_figure(curve: Curve, goal: str, sentence: str, at_least: float) -> Figure:
    """The share along the quantity with its band, and what is wanted."""

    def paint(axes: Axes) -> None:
        values = curve.axis.values
        axes.fill_between(values, curve.low, curve.high, color=FLOOR, alpha=0.25, lw=0)
        axes.plot(values, curve.probability, "o-", ms=4, color=FLOOR)
        axes.axhline(at_least, color=MEASURED, lw=0.8, ls="--")
        axes.set(ylim=(0, 1.03), xlabel=curve.axis.label, ylabel=f"share that ends '{goal}'")

    label = curve.axis.label
    dashed = f" Dashed: {100 * at_least:.0f} %."
    return Figure(draw(2.8, paint), label[:1].upper() + label[1:], f"{sentence}{dashed}".strip())
