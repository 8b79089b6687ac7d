# SPDX-License-Identifier: Apache-2.0
"""Page about a swarm: its class, its metrics over time, its paths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import twinmill_native as native

from twinmill.report import Figure, Section
from twinmill.report.canvas import MEASURED, PREDICTED, draw, plain_ticks
from twinmill.report.log_figures import paint_bodies
from twinmill.swarm.classes import COLORS, WORDS
from twinmill.swarm.metrics import SwarmSeries

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LAST_S = 10.0
NOTE = (
    "The class comes from the mean of the last 10 s: milling is circliness below 0.2, turning "
    "together, bodies apart; below 1 is an uneven ring; above, one cluster or separated groups."
)
PANELS = {
    "circliness": "circliness",
    "radius_m": "radius (m)",
    "rotation": "rotation",
    "diffusion": "diffusion",
    "groups": "groups",
    "contacts": "contacts",
}


def section(series: SwarmSeries) -> Section:
    """The page of a swarm's metrics: its class, how they went, where the robots went."""
    mean = dict(zip(native.METRICS, series.mean.tolist(), strict=True))
    odd = f", odd robots at {mean['odd_ratio']:.2f} of its radius" if series.odd else ""
    verdict = (
        f"{series.final}: {WORDS[series.final]}. Last 10 s: circliness {mean['circliness']:.3f}, "
        f"radius {mean['radius_m']:.3f} m, rotation {mean['rotation']:+.2f}, diffusion "
        f"{mean['diffusion']:.2f}, groups {mean['groups']:.1f}, contacts {mean['contacts']:.1f}"
        f"{odd}."
    )
    return Section(
        title="What the swarm does",
        score=[("class of the last 10 s", series.final, "")],
        verdict=verdict,
        facts=[
            ("robots", ", ".join(map(str, series.robots))),
            ("odd", ", ".join(map(str, series.odd)) or "none"),
            *_bits(series),
            *(
                [("bodies", ", ".join(body.name for body in series.bodies))]
                if series.bodies
                else []
            ),
            ("time with all poses", f"{series.t_s[-1] - series.t_s[0]:.1f} s"),
        ],
        figures=[_over_time(series), _paths(series)],
    )


def _bits(series: SwarmSeries) -> list[tuple[str, str]]:
    """Which bits the cameras told, mean over the robots."""
    shares = np.mean(list(series.bits.values()), axis=0) if series.bits else []
    words = [f"bit {k + 1} in {100 * share:.0f} %" for k, share in enumerate(shares)]
    return [("seen, last 10 s", f"{', '.join(words)} of the frames")] if words else []


def _over_time(series: SwarmSeries) -> Figure:
    colors = [COLORS[name] for name in series.classes]

    def paint(panels: np.ndarray) -> None:
        strip, *rest = panels
        strip.scatter(series.t_s, np.zeros(len(colors)), c=colors, marker="s", s=40, lw=0)
        strip.set(ylim=(-1, 1), yticks=[])
        strip.grid(False)
        for axes, (name, label) in zip(rest, PANELS.items(), strict=True):
            axes.plot(
                series.t_s, series.values[:, native.METRICS.index(name)], color=MEASURED, lw=1
            )
            axes.set_ylabel(label)
        shown = series.values[:, native.METRICS.index(next(iter(PANELS)))]
        if (shown > 0).any():  # of robots that stand none is
            rest[0].set(yscale="log", ylim=(0.02, None))
            plain_ticks(rest[0].yaxis)
        for level in (0.2, 1):
            rest[0].axhline(level, color=PREDICTED, lw=0.8)
        rest[3].axhline(1, color=PREDICTED, lw=0.8)
        rest[-1].set_xlabel("time (s)")

    present = [name for name in COLORS if name in series.classes]
    return Figure(
        draw(
            1.4 * len(PANELS),
            paint,
            nrows=len(PANELS) + 1,
            sharex=True,
            height_ratios=[0.25, *[1] * len(PANELS)],
        ),
        "Over time",
        "The strip on top is the class of the 10 s before: "
        + ", ".join(f"{name} ({_color_word(name)})" for name in present)
        + ". Red lines: circliness 0.2 and 1, and diffusion 1, above which nobody can reach "
        "another's view.",
    )


def _color_word(name: str) -> str:
    return {
        "milling": "green",
        "ellipsoidal": "yellow",
        "cluster": "red",
        "separated": "blue",
        "jammed": "grey",
        "undefined": "pale",
    }[name]


def _paths(series: SwarmSeries) -> Figure:
    last = series.t_s > series.t_s[-1] - LAST_S

    def paint(axes: Axes) -> None:
        paint_bodies(axes, series.bodies)
        for k, robot in enumerate(series.robots):
            path = series.pose[last, k]
            odd = robot in series.odd
            axes.plot(path[:, 0], path[:, 1], lw=1.2, color=PREDICTED if odd else MEASURED)
            axes.annotate(
                str(robot), path[-1, :2], xytext=(5, 5), textcoords="offset points", fontsize=8
            )
            axes.plot(*path[-1, :2], "o", ms=4, color=PREDICTED if odd else MEASURED)
        axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")

    return Figure(
        draw(4.5, paint),
        "Where they went",
        "Paths of the last 10 s; dots are the ends."
        + (" Odd robots are red." if series.odd else ""),
    )
