# SPDX-License-Identifier: Apache-2.0
"""The phase diagram to play with: a slider for each axis beyond two, counts under the finger."""

import json
from importlib.resources import files

from twinmill.report import Figure
from twinmill.swarm.classes import COLORS
from twinmill.swarm.phase import Phase


def slider_figure(phase: Phase) -> Figure:
    """A map drawn by a script in the page itself: nothing is fetched."""
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
        f'<div id="phase"></div><script>const PHASE={text};\n{script}</script>',
        "Move through all axes",
        "Choose what goes along and up; the sliders set the rest. Point at a cell for its counts.",
    )
