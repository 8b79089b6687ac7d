# SPDX-License-Identifier: Apache-2.0
"""One look for all figures, and SVG text that is the same for the same data."""

import io
import re
from collections.abc import Callable

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import LogLocator

# Colours of Okabe and Ito (2008), told apart by colour-blind readers.
MEASURED, PREDICTED, BEFORE, FLOOR = "#3c3c3c", "#d55e00", "#0072b2", "#009e73"
WIDTH_IN = 5.0  # a phone's width at the size the text is made for
STYLE = {
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


class Picture(Canvas):
    """A figure that a notebook shows without pyplot."""

    def _repr_svg_(self) -> str:
        return _svg_of(self)


class Svg(str):
    """An SVG element, with the figure that it was made from.

    Attributes:
        picture: to be shown, changed or saved otherwise.
    """

    picture: Picture


def draw(height_in: float, paint: Callable[..., None], **grid) -> Svg:
    """Paints axes laid out by `grid` (as for subplots) and gives the SVG element."""
    with matplotlib.rc_context(STYLE):
        picture = Picture(figsize=(WIDTH_IN, height_in), layout="constrained")
        paint(picture.subplots(**grid))
        svg = Svg(_svg_of(picture))
    svg.picture = picture
    return svg


def _svg_of(picture: Picture) -> str:
    with matplotlib.rc_context(STYLE):
        text = io.StringIO()
        picture.savefig(
            text,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*">', "<g>", svg)  # names of groups repeat from figure to figure
    svg = re.sub(
        r'(<svg[^>]*?) width="[^"]*pt"', r"\1", re.sub(r'(<svg[^>]*?) height="[^"]*pt"', r"\1", svg)
    )
    return svg


def plain_ticks(axis) -> None:
    """Numbers without exponents on a logarithmic axis."""
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
