# SPDX-License-Identifier: Apache-2.0
"""The stage as HTML: floor and series, and a bar with play, scrubber and what is chosen."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"


def stage_html(choices: str = "") -> str:
    """The element that charts/static/stage.js takes over; `choices` stand first in its bar."""
    return f"""
<div id="stage"><div class="sheet"><canvas id="floor"></canvas><div class="key">
<span style="color:#3c3c3c99"><i></i>measured</span>
<span style="color:#d55e00"><i></i>predicted</span>
<span style="color:#009e73"><i></i>95 % band of a right model</span>
<button id="beside" title="Draw the model alone"></button></div></div>
<div class="sheet"><canvas id="series"></canvas></div>
<div class="sheet" id="transport">{choices}
<button id="play" title="Play or pause (space)" aria-label="Play or pause"></button>
<button id="rate" title="Speed of playing"></button>
<input id="scrubber" type="range" min="0" max="10" step="0.01" value="0" aria-label="Time">
<span id="clock">0.00 s</span><button id="marks" title="Forget these marks"></button>
<span class="soft">predict</span>
<button data-ahead="0.5" title="Predictions of half a second">0.5 s</button>
<button data-ahead="2" title="Predictions of two seconds">2 s</button></div></div>
"""
