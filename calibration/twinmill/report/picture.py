# SPDX-License-Identifier: Apache-2.0
"""A matplotlib figure whose SVG text is the same for the same data."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType


class Picture(Figure):
    """A figure that a notebook shows without pyplot.

    Attributes:
        look: settings of matplotlib, when it is drawn.
    """

    look: Mapping[RcKeyType, Any]

    @classmethod
    def of(
        cls,
        look: Mapping[RcKeyType, Any],
        size_in: tuple[float, float],
        paint: Callable[[Picture], None],
    ) -> Picture:
        """Painted in a look."""
        with matplotlib.rc_context(dict(look)):
            picture = cls(figsize=size_in, layout="constrained")
            picture.look = look
            paint(picture)
        return picture

    @property
    def svg(self) -> str:
        """The SVG element."""
        with matplotlib.rc_context(dict(self.look)):
            text = io.StringIO()
            self.savefig(
                text,
                format="svg",
                metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
            )
        svg = text.getvalue()
        svg = svg[svg.index("<svg") :]
        svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
        svg = re.sub(r'<g id="[^"]*">', "<g>", svg)  # names of groups repeat in other figures
        svg = re.sub(r'(<svg[^>]*?) height="[^"]*pt"', r"\1", svg)
        return re.sub(r'(<svg[^>]*?) width="[^"]*pt"', r"\1", svg)

    def _repr_svg_(self) -> str:
        return self.svg
