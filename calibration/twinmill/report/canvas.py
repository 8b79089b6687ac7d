# SPDX-License-Identifier: Apache-2.0
"""One look for all figures, and SVG text that is the same for the same data.

Matplotlib is imported where something is drawn: it takes a third of a second, and most commands
that could draw print numbers alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.typing import RcKeyType

    from twinmill.report.picture import Picture

# Colours of Okabe and Ito (2008), told apart by colour-blind readers.
MEASURED, PREDICTED, BEFORE, FLOOR = "#3c3c3c", "#d55e00", "#0072b2", "#009e73"
WIDTH_IN = 5.0  # a phone's width at the size the text is made for
STYLE: dict[RcKeyType, Any] = {
    "svg.hashsalt": "twinmill",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.axisbelow": True,
    "axes.titlesize": 9,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.4,
    "axes.edgecolor": "#888888",
    "path.simplify_threshold": 0.3,
}


class Svg(str):
    """An SVG element, with the figure that it was made from.

    Attributes:
        picture: to be shown, changed or saved otherwise.
    """

    picture: Picture


def draw(height_in: float, paint: Callable[..., None], **grid: Any) -> Svg:
    """Paints axes laid out by `grid` (as for subplots) and gives the SVG element.

    Args:
        height_in: of the figure, in inches.
        paint: is given the axes, or an array of them where there are several.
        grid: as `Figure.subplots` has it.
    """
    from twinmill.report.picture import Picture

    picture = Picture.of(STYLE, (WIDTH_IN, height_in), lambda p: paint(p.subplots(**grid)))
    svg = Svg(picture.svg)
    svg.picture = picture
    return svg


def each_of(panels: Axes | np.ndarray) -> list[Axes]:
    """Axes that a painter is given, row by row, however many they are."""
    return list(np.ravel(np.asarray(panels, object)))


def plain_ticks(axis: Axis) -> None:
    """Numbers without exponents on a logarithmic axis."""
    from matplotlib.ticker import LogLocator

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def legend_above(axes: Axes, columns: int) -> None:
    """A legend over the plot, where it hides nothing."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=columns,
        borderaxespad=0.2,
        columnspacing=1.2,
        handlelength=1.6,
    )
