# SPDX-License-Identifier: Apache-2.0
"""The charts with all their data as a piece of HTML that opens without a server."""

import base64
import html
import json
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.charts.arrays import RobotView, measured_path
from twinmill.charts.packed import pack_log, pack_prediction, pack_robot
from twinmill.charts.stage import STATIC, stage_html
from twinmill.foreign_text import printable
from twinmill.predict.detections import Detections
from twinmill.predict.regimes import Regime

MODULES = ("look", "packed", "floor", "series", "stage", "embedded")  # each uses those before it
STEPS = 2**13  # to a metre, a second, a radian, a per cent: finer than is seen, coarser than noise
LEVEL = 9  # of zlib
HINT = (
    "Drag over the curves to move the cursor; Ctrl and the wheel zoom; a drag with shift moves the "
    "stretch; a double click shows all. A click on a robot picks it. After a click into the charts "
    "space plays, arrows step, + and \N{MINUS SIGN} zoom."
)


@dataclass(frozen=True)
class Shown:
    """One robot of a report.

    Attributes:
        view: of the robot.
        name: in the list of robots.
        model: whose predictions are shown.
        regimes: where it fails.
        beside: label and model that is drawn beside, or None.
        detections: of its camera, or None.
    """

    view: RobotView
    name: str
    model: native.Model
    regimes: Sequence[Regime]
    beside: tuple[str, native.Model] | None = None
    detections: Detections | None = None


def embedded(robots: Sequence[Shown], first: int, span_s: tuple[float, float]) -> str:
    """HTML of the charts.

    Args:
        robots: of all logs.
        first: place of the robot that is shown first.
        span_s: stretch of time that is shown first.
    """
    logs = list(dict.fromkeys(_log(r) for r in robots))
    blocks = {
        f"log{k}": _log_bytes([r for r in robots if _log(r) == log]) for k, log in enumerate(logs)
    }
    for k, robot in enumerate(robots):
        measurement = robot.view.measurement
        own = pack_robot(robot.view, measurement.track, measurement.frames, robot.model)
        blocks[f"robot{k}"] = own
        blocks[f"prediction{k}"] = pack_prediction(
            robot.view, robot.model, robot.beside, robot.detections
        )
    options = {
        "robots": [_facts(r, logs.index(_log(r))) for r in robots],
        "first": first,
        "view": {"t": span_s[0], "span": span_s},
    }
    names = "".join(f"<option>{html.escape(printable(r.name))}</option>" for r in robots)
    choices = f'<select id="robot" aria-label="Robot">{names}</select>'
    choices += '<select id="where" aria-label="Where it fails"></select>'
    data = "".join(
        f'<script type="text/plain" id="{key}">{slim(b)}</script>\n' for key, b in blocks.items()
    )
    return (
        f"<style>{(STATIC / 'charts.css').read_text()}</style>\n{stage_html(choices)}"
        f'<p class="hint">{HINT}</p>\n{data}{_script(options)}'
    )


def slim(packed: bytes) -> str:
    """Output of `pack`, with numbers rounded to 1/STEPS, deflated, as text.

    The four bytes of all numbers stand apart, first bytes first: so they deflate to half.
    """
    body = 4 + int.from_bytes(packed[:4], "little")
    numbers = np.round(np.frombuffer(packed, "<f4", offset=body) * STEPS) / STEPS
    apart = numbers.astype("<f4").view(np.uint8).reshape(-1, 4).T
    return base64.b64encode(zlib.compress(packed[:body] + apart.tobytes(), LEVEL)).decode()


def _log(robot: Shown) -> tuple[str, str]:
    return robot.view.measurement.log_sha256, robot.view.measurement.log_name


def _log_bytes(robots: Sequence[Shown]) -> bytes:
    """Poses of all robots of one log, packed for the page."""
    tracks = {r.view.track.robot_id: r.view.track for r in robots}
    paths = {n: measured_path(t.pose_t_s, t.pose, t.segment >= 0) for n, t in tracks.items()}
    headings = {n: t.has_heading for n, t in tracks.items()}
    radius_m = robots[0].model.get("robot.body_radius_m")
    return pack_log(robots[0].view.measurement.log_name, paths, headings, radius_m)


def _facts(robot: Shown, log: int) -> dict[str, Any]:
    """Facts of one robot: label, place of its log, and its moments by what it was doing."""
    moments = robot.view.moments(robot.model) if robot.regimes else {}
    where = []
    for regime in robot.regimes:
        times, worst = moments[regime.group, regime.regime]
        name = f"{regime.group}: {regime.regime}"
        words = f"{name} · {regime.ratio:#.3g} ({100 * regime.share:.0f} %)"
        where.append([name, words, np.round(times, 2).tolist(), round(worst, 2)])
    return {"label": robot.view.measurement.label, "log": log, "where": where}


def _script(options: dict[str, Any]) -> str:
    """The modules, named by an import map, and the call that starts them."""
    imports = {name: f"data:text/javascript;base64,{_module(name)}" for name in MODULES}
    told = json.dumps(options, separators=(",", ":")).replace("<", "\\u003c")
    return (
        f'<script type="importmap">{json.dumps({"imports": imports})}</script>\n'
        f'<script type="module">import {{ start }} from "embedded"; start({told});</script>\n'
    )


def _module(name: str) -> str:
    text = (STATIC / f"{name}.js").read_text()
    named = re.sub(r'from "\./(\w+)\.js"', r'from "\1"', text)
    return base64.b64encode(named.encode()).decode()
