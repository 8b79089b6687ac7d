# SPDX-License-Identifier: Apache-2.0
"""A robot's numbers over its calibrations: sentences, the page, and the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from twinmill.report import show
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw, each_of
from twinmill.report.html import Figure, Section
from twinmill.report.tables import Cell, Table, Tone, number
from twinmill.runs.drift import FEWEST_BEFORE, Drift, Series
from twinmill.runs.history import Calibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NOTE = (
    "The band of a number is where the next calibration of an unchanged robot lies, by those "
    "before it; all numbers together leave theirs by chance at the rate of false alarms."
)
SPARK = "▁▂▃▄▅▆▇█"


def verdict(result: Drift) -> list[str]:
    """Which numbers left their band, a sentence each."""
    count = len(result.calibrations)
    if left := result.left:
        return [_told(s, result) for s in left]
    if count <= FEWEST_BEFORE:
        return [
            f"{count} calibrations make no band yet; a band begins with calibration "
            f"{FEWEST_BEFORE + 1}, and is narrow from some six on."
        ]
    return [f"All numbers are in their bands, in the last of {count} calibrations."]


def _told(s: Series, result: Drift) -> str:
    name, unit = s.last.name, "" if s.last.unit == "1" else f" {s.last.unit}"
    before = s.values[:-1].mean()
    now = f"{number(s.values[-1])}{unit}"
    said = f"{name} ({s.last.words})" if s.last.words != name else name
    if s.outside[-1]:
        band = f"{number(s.low[-1])} to {number(s.high[-1])}{unit}"
        share = f", {100 * (s.values[-1] / before - 1):+.1f} %" if before else ""
        return f"{said} left its band: {now}{share} from its mean before; the band is {band}."
    (first, last) = (_when(result.calibrations[s.days[k]], s.days[k]) for k in (0, -1))
    way = "rises" if s.values[-1] > s.values[0] else "falls"
    return (
        f"{said} {way} steadily: {number(s.values[0])}{unit} {first}, {now} {last} "
        f"(chance in a random order {number(s.trend_p, 2)})."
    )


def _when(one: Calibration, place: int) -> str:
    return f"on {one.date:%Y-%m-%d}" if one.date else f"in calibration {place + 1}"


def terminal(result: Drift) -> RenderableType:
    """Text that `twinmill robot drift` prints."""
    tone = "bold red" if result.left else "bold green"
    return Group(
        *(Text(line, tone) for line in verdict(result)), Text(), show.table(numbers(result))
    )


def numbers(result: Drift) -> Table:
    """Each number: its course, the last value, and its band."""
    rows = []
    for s in result.series:
        tone: Tone = "bad" if s.left else ""
        band = "-" if np.isnan(s.low[-1]) else f"{number(s.low[-1])} to {number(s.high[-1])}"
        rows.append(
            [
                Cell(s.last.name, tone),
                Cell(_spark(s.values)),
                Cell(number(s.values[-1]), tone),
                Cell(f"± {number(1.96 * s.stds[-1], 2)}", "dim"),
                Cell(band),
                Cell("" if s.last.unit == "1" else s.last.unit, "dim"),
                Cell(_state(s), tone or ("dim" if s.natural else "")),
            ]
        )
    dates = [c.date for c in result.calibrations]
    span = f"{dates[0]:%Y-%m-%d} to {dates[-1]:%Y-%m-%d}" if all(dates) else "as appended"
    return Table(
        f"{len(result.calibrations)} calibrations, {span}",
        ["number", "course", "last", "95 %", "band", "", ""],
        rows,
        words=(0, 1, 5, 6),
    )


def _state(s: Series) -> str:
    if s.natural:
        return "no alarm: mounting or clock"
    if s.outside[-1]:
        return "left its band"
    return "drifts" if s.drifts else ""


def _spark(values: np.ndarray) -> str:
    """The last twenty values as blocks."""
    shown = values[-20:]
    low, reach = shown.min(), np.ptp(shown) or 1.0
    return "".join(SPARK[int(7.999 * (v - low) / reach)] for v in shown)


def section(result: Drift) -> Section:
    """The page: verdict, a picture of each number over the days, and the table."""
    return Section(
        f"Robot {result.calibrations[-1].robot_id} over {len(result.calibrations)} calibrations",
        [("numbers out of band", str(len(result.left)), "bad" if result.left else "good")],
        "\n".join(verdict(result)),
        facts=[
            ("false alarms", f"{100 * result.rate:g} % of calibrations, all numbers together"),
            *(
                (
                    f"{c.date:%Y-%m-%d %H:%M}" if c.date else "date unknown",
                    f"{_logs(c.logs)}: {c.model}",
                )
                for c in result.calibrations
            ),
        ],
        figures=[courses(result)],
        tables=[numbers(result)],
        notes=[NOTE],
    )


def _logs(logs: Sequence[tuple[str, str]]) -> str:
    return ", ".join(path for path, _ in logs)


def courses(result: Drift) -> Figure:
    """Each number with its intervals over the days, and its band."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
    from matplotlib.ticker import MaxNLocator

    dates = [c.date for c in result.calibrations]
    dated = all(dates)
    places = np.array(
        [date.replace(tzinfo=None) if date and dated else k for k, date in enumerate(dates, 1)]
    )

    def paint(panels: Axes | np.ndarray) -> None:
        every = each_of(panels)
        for axes, s in zip(every, result.series, strict=True):
            at = places[s.days]
            axes.fill_between(at, s.low, s.high, color=FLOOR, alpha=0.18, lw=0)
            reach = 1.96 * s.stds
            axes.errorbar(at, s.values, reach, fmt="o", ms=3.5, lw=1, color=MEASURED)
            out = s.outside if not s.natural else np.zeros(len(at), bool)
            axes.plot(at[out], s.values[out], "o", ms=6, color=PREDICTED)
            _limits(axes, s, reach)
            unit = "" if s.last.unit == "1" else f" ({s.last.unit})"
            axes.set_title(f"{s.last.name}{unit}", loc="left")
        if not dated:
            every[-1].set_xlabel("calibration, as appended")
            every[-1].xaxis.set_major_locator(MaxNLocator(6, integer=True))
            return
        locator = AutoDateLocator(maxticks=6)
        every[-1].xaxis.set_major_locator(locator)
        every[-1].xaxis.set_major_formatter(ConciseDateFormatter(locator))

    count = len(result.series)
    return Figure(
        draw(0.95 * count + 0.4, paint, nrows=count, sharex=True),
        "Over the days",
        "Points with 95 % intervals; green: the band, by the calibrations before. Red: out of it.",
    )


def _limits(axes: Axes, s: Series, reach: np.ndarray) -> None:
    """A band of few calibrations is so wide that it would hide the points."""
    low, high = float((s.values - reach).min()), float((s.values + reach).max())
    margin = 0.6 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
