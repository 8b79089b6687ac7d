# SPDX-License-Identifier: Apache-2.0
"""Two runs of one robot: sentences, and the page with both on one axis of time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
import twinmill_native as native
from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.arguments import option
from twinmill.charts.arrays import measured_speed
from twinmill.data.track import Track
from twinmill.estimation.opened import Opened
from twinmill.predict.regimes import HORIZON
from twinmill.predict.windows import HORIZONS_S
from twinmill.report import show
from twinmill.report.canvas import MEASURED, PREDICTED, draw, each_of
from twinmill.report.html import Figure, Section
from twinmill.report.tables import Cell, Table, Tone, number
from twinmill.runs.changes import MOSTLY, Change
from twinmill.runs.compare import Named, RunComparison
from twinmill.runs.difference import follows_charge
from twinmill.runs.rate import runs_for
from twinmill.runs.reference import CHARGE_STD

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = {"1": (100.0, "%"), "s": (1000.0, "ms")}  # unit: factor, as a person reads it
HINT = (
    "Point at the curves, or use the arrow keys, to move the cursor through both runs; the wheel "
    "zooms, a double click shows all."
)


def verdict(result: RunComparison) -> list[str]:
    """Changes of the robot, a sentence each."""
    first, second = (o.measurement.log_name for o in (result.first, result.second))
    if not result.changed:
        return [
            f"Nothing changed from {first} to {second}: the largest difference has "
            f"{number(result.alarm.score)} standard errors, and an alarm takes more than "
            f"{number(result.alarm.above)}."
        ]
    return [_told(named, second) for named in result.changes]


def _told(named: Named, log: str) -> str:
    change = named.change
    begin = "all the time" if named.onset.from_start else _since(named)
    same = [f"the {label(r)} ({sized(r)})" for r in named.rivals]
    rest = f" As well explained by: {', '.join(same)}." if same else ""
    return (
        f"Changed in {log}: {change.kind.what} {sized(change)} ({interval(change)}), {begin}.{rest}"
    )


def _since(named: Named) -> str:
    at = named.onset
    return f"since {at.at_s:.0f} s after its start (95 %: {at.low_s:.0f} to {at.high_s:.0f} s)"


def label(change: Change) -> str:
    """Its name without article and verb: `front left wheel`."""
    return change.kind.what.removeprefix("the ").removesuffix(" is").removesuffix(" are")


def sized(change: Change) -> str:
    """As a person says it: `3.1 % weaker`."""
    factor, unit = SHOWN[change.kind.unit]
    way = change.kind.less if change.value < 0 else change.kind.more
    return f"{number(factor * abs(change.value), 2)} {unit} {way}"


def interval(change: Change) -> str:
    """Interval of 95 %, without the sign that the words have."""
    factor, unit = SHOWN[change.kind.unit]
    sign = -1 if change.value < 0 else 1
    low, high = sorted(sign * factor * end for end in change.interval)
    return f"95 %: {number(low, 2)} to {number(high, 2)} {unit}"


def apart(result: RunComparison) -> list[str]:
    """Differences that are no alarm."""
    said = []
    if result.remounted:
        said.append(f"The marker was mounted anew: {_moved(result)}.")
    late_s, reach_s = result.size_of("late_s")
    if "late_s" not in result.tested_keys and abs(late_s) > reach_s:
        said.append(
            f"The offset of the clocks of commands and poses differs by {1000 * late_s:+.0f} ms (± "
            f"{number(1000 * reach_s, 2)}); a delay of the robot cannot be told from that."
        )
    if follows_charge(result.first.model):
        said.append(_charge(*result.volts))
    if result.alarm.first_is_odd:
        said.append(
            f"{result.first.measurement.log_name} is itself the least like all other runs: compare "
            "with another first run."
        )
    return said


def _moved(result: RunComparison) -> str:
    """How the marker sits elsewhere; a robot that holds one heading has no angle of it."""
    parts = []
    for key, factor, words in (
        ("marker.x_m", 1000.0, "mm forward"),
        ("marker.y_m", 1000.0, "mm to the left"),
        ("marker.bias_rad", float(np.degrees(1)), "° turned to the left"),
    ):
        value, reach = result.size_of(key)
        parts.append(f"{factor * value:+.1f} {words} (± {number(factor * reach, 2)})")
    return ", ".join(parts)


def _charge(first_V: float, second_V: float) -> str:
    if np.isfinite([first_V, second_V]).all():
        return (
            f"The battery had {first_V:.2f} V and then {second_V:.2f} V; how speeds follow the "
            "voltage is fitted and taken out."
        )
    share = 100 * CHARGE_STD * np.sqrt(2)
    return (
        f"The battery's voltage is not recorded; some {share:.0f} % of all wheels together are "
        "laid to its charge."
    )


def calibration(result: RunComparison) -> str:
    """How often such an alarm is false."""
    found = result.alarm
    wanted, needed = f"{100 * found.rate:g} %", runs_for(found.rate)
    chance = number(found.p_errors, 2)
    if not found.calibrated:
        return (
            f"By the standard errors alone, so large a difference has a chance of {chance} without "
            "a change. That is not calibrated on this robot: what else varies between its days is "
            f"not known. Give healthy runs with {option('healthy')}; {needed}, the first one "
            "included, "
            f"promise false alarms in {wanted} of comparisons."
        )
    count = len(found.healthy)
    rank = f"{sum(h >= found.score for h in found.healthy)} of {count} healthy runs are as unlike"
    if count < needed:
        return (
            f"{rank}. With {count} healthy runs, the first one included, false alarms can be "
            f"promised in no less than one of {count + 1} comparisons; {needed} promise {wanted}. "
            f"Until then the standard errors must say so, too (chance {chance})."
        )
    return f"{rank}: calibrated on this robot, with false alarms in {wanted} of comparisons."


def power(result: RunComparison) -> str:
    """How large a change must be to be seen."""
    changes = result.alarm.tested.changes()
    single = [c for c in changes if c.kind.key.startswith("wheel.")]
    sides = [c for c in changes if c.kind.key in ("wheels.left", "wheels.right")]
    own = single or sides or [c for c in changes if c.kind.unit == "1"]
    least = max(own, key=lambda c: c.std)
    percent = number(100 * result.alarm.shown(least, MOSTLY), 2)
    return (
        f"Nine of ten such pairs of runs would show a change of the {label(least)} by {percent} %, "
        f"and of each other {'wheel' if single else 'side' if sides else 'speed'} by no more."
    )


def terminal(result: RunComparison) -> RenderableType:
    """Text that `twinmill robot compare` prints."""
    tone = "bold red" if result.changed else "bold green"
    return Group(
        *(Text(line, tone) for line in verdict(result)),
        Text(),
        *(Text(line) for line in [*apart(result), calibration(result), power(result)]),
        Text(),
        show.table(numbers(result)),
        *show.warned(list(result.left_out)),
    )


def numbers(result: RunComparison) -> Table:
    """Each kind of change by itself."""
    named = {n.change.kind.key for n in result.changes}
    rows = []
    for change in result.alarm.tested.changes():
        factor, unit = SHOWN[change.kind.unit]
        low, high = change.interval
        tone: Tone = "bad" if change.kind.key in named else ""
        half, most = (result.alarm.shown(change, share) for share in (0.5, MOSTLY))
        rows.append(
            [
                Cell(label(change), tone),
                Cell(f"{factor * change.value:+.2f} {unit}", tone),
                Cell(f"{factor * low:+.2f} to {factor * high:+.2f}"),
                Cell(f"{abs(change.score):.1f}", tone),
                Cell(f"{factor * half:.2f} {unit}", "dim"),
                Cell(f"{factor * most:.2f} {unit}", "dim"),
            ]
        )
    columns = ["", "difference", "95 %", "standard errors", "alarm from", "9 of 10 from"]
    return Table("Each by itself, were it all that changed", columns, rows)


def section(result: RunComparison) -> Section:
    """The page: what changed, both runs over one time, and all differences."""
    first, second = (o.measurement for o in (result.first, result.second))
    tone: Tone = "bad" if result.changed else "good"
    return Section(
        f"{second.log_name} against {first.log_name}",
        [
            ("largest difference, standard errors", number(result.alarm.score), tone),
            ("an alarm takes more than", number(result.alarm.above), ""),
        ],
        "\n".join(verdict(result)),
        figures=[intervals(result)],
        tables=[numbers(result)],
        notes=[*apart(result), calibration(result), power(result)],
        charts=partial(_charts, result),
        warnings=[*result.left_out, *first.warnings, *second.warnings],
    )


def intervals(result: RunComparison) -> Figure:
    """All differences with their intervals, and from where on each is an alarm."""
    changes = result.alarm.tested.changes()
    named = {n.change.kind.key for n in result.changes}
    units = [u for u in SHOWN if any(c.kind.unit == u for c in changes)]
    counts = [sum(c.kind.unit == u for c in changes) for u in units]

    def paint(panels: Axes | np.ndarray) -> None:
        for axes, unit in zip(each_of(panels), units, strict=True):
            own = [c for c in changes if c.kind.unit == unit][::-1]
            factor, words = SHOWN[unit]
            for row, change in enumerate(own):
                reach = factor * result.alarm.shown(change, 0.5)
                color = PREDICTED if change.kind.key in named else MEASURED
                axes.barh(row, 2 * reach, left=-reach, color="#efefef", height=0.8)
                ends = [factor * end for end in change.interval]
                axes.plot(ends, [row, row], color=color)
                axes.plot(factor * change.value, row, "o", color=color, ms=4)
            names = [label(c) for c in own]
            axes.set_yticks(range(len(own)), names)
            axes.axvline(0, color="#888888", lw=0.8)
            axes.set_xlabel(f"difference ({words})")

    svg = draw(
        0.24 * len(changes) + 0.7 * len(units),
        paint,
        nrows=len(units),
        height_ratios=[c + 0.5 for c in counts],
    )
    return Figure(
        svg,
        "What differs",
        "Each by itself with its 95 % interval. Grey: no alarm. Red: told as changed.",
    )


# -- both runs on one axis of time -------------------------------------------------------------


def _charts(result: RunComparison) -> str:
    """A piece of HTML with all its data, drawn by a script in it."""
    runs = (result.first, result.second)
    starts = [start_s(o.track) for o in runs]
    speeds = [
        measured_speed(o.track)["speed"] - [s, 0, 0, 0] for o, s in zip(runs, starts, strict=True)
    ]
    errors = [_errors(o, result, k) - [starts[k], 0, 0, 0] for k, o in enumerate(runs)]
    horizon = HORIZONS_S[HORIZON]
    panels = [
        *_panels(speeds, ("forward", "left", "turn"), ("m/s", "m/s", "rad/s"), (1, 1, 1)),
        *_panels(
            errors,
            tuple(f"{c}, {horizon:g} s ahead, off" for c in ("forward", "left", "heading")),
            ("mm", "mm", "°"),
            (1000, 1000, float(np.degrees(1))),
        ),
    ]
    data = {
        "names": [o.measurement.log_name for o in runs],
        "panels": panels,
        "marks": np.round(_marks(result) - starts[1], 2).tolist(),
        "since": [
            round(n.onset.at_s + float(result.second.trajectory.start_s[0]) - starts[1], 2)
            for n in result.changes
            if not n.onset.from_start
        ],
    }
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    script = files("twinmill.report").joinpath("runs.js").read_text()
    return (
        f'<div id="runs" tabindex="0"></div><p class="note">{HINT} Both begin when the robot is '
        "first told to move. Lower curves: what the first run's numbers predict wrongly, with each "
        "run's own marker and clock. Shaded: where the change shows; these stretches hold half of "
        f"what tells it.</p><script>const RUNS={text};\n{script}</script>"
    )


def start_s(track: Track) -> float:
    """When the robot is first told to move, by the capture's clock as far as it is known."""
    moving = np.flatnonzero(np.abs(track.command).max(axis=1) > 0)
    return float(track.command_t_s[moving[0]]) if moving.size else float(track.pose_t_s[0])


def _panels(
    series: list[np.ndarray],
    titles: Sequence[str],
    units: Sequence[str],
    factors: Sequence[float],
) -> list[dict[str, Any]]:
    found = []
    for k, (title, unit, factor) in enumerate(zip(titles, units, factors, strict=True), 1):
        curves = [{"t": _rounded(s[:, 0], 2), "v": _rounded(factor * s[:, k], 3)} for s in series]
        found.append({"title": title, "unit": unit, "curves": curves})
    return found


def _rounded(values: np.ndarray, digits: int) -> list[float | None]:
    return [None if not np.isfinite(v) else round(float(v), digits) for v in values]


def _errors(opened: Opened, result: RunComparison, run: int) -> np.ndarray:
    """(W, 4) t_s, and what the first run's numbers predict wrongly of a run: m, m, rad."""
    data = result.whole.fit.trajectories[run]
    errors = data.errors(_model(result, run, changed=False))[:, HORIZON]
    return np.column_stack([data.start_s, np.where(data.keep[:, None], errors, np.nan)])


def _model(result: RunComparison, run: int, changed: bool) -> native.Model:
    """The fit's model of a run, with the first run's numbers or with what is told as changed."""
    whole, model = result.whole, result.whole.fit.models[run].copy()
    if run == 0:
        return model
    first = whole.fit.models[0]
    sizes = np.zeros(len(result.tested_keys))
    if changed:
        sizes = sum((n.change.value * n.change.kind.direction for n in result.changes), sizes)
    for q in whole.quantities:
        if q.key in result.tested_keys:
            size = float(sizes[result.tested_keys.index(q.key)])
            before = first.get(q.name)
            model.set(q.name, before * (1 + size) if q.paired and q.unit == "1" else before + size)
    return model


def _marks(result: RunComparison) -> np.ndarray:
    """(M, 2) s: the shortest stretches of the second run that hold half of the evidence."""
    if not result.changed:
        return np.zeros((0, 2))
    data = result.whole.fit.trajectories[1]
    without, with_it = (
        data.errors(_model(result, 1, changed=c))[:, HORIZON] for c in (False, True)
    )
    square = (np.nan_to_num((with_it - without) / data.floor[HORIZON]) ** 2).sum(axis=1)
    begin_s = float(data.start_s[0]) + min(n.onset.at_s for n in result.changes)
    square *= data.keep & (data.start_s >= begin_s)
    order = np.argsort(-square)
    count = int(np.searchsorted(np.cumsum(square[order]), square.sum() / 2)) + 1
    at_s = np.sort(data.start_s[order[:count]])
    apart = np.flatnonzero(np.diff(at_s) > 1.5 * data.every_s)
    firsts, lasts = at_s[[0, *(apart + 1)]], at_s[[*apart, len(at_s) - 1]]
    return np.column_stack([firsts, lasts + HORIZONS_S[HORIZON]])
