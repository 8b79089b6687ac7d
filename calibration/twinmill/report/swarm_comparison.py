# SPDX-License-Identifier: Apache-2.0
"""A recorded swarm against the twin's, for reports and notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from twinmill.defaults import FALSE_ALARMS
from twinmill.report import Figure, Section
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw, plain_ticks
from twinmill.swarm.compare import BLOCK_S, COMPARED, SwarmComparison, plain

if TYPE_CHECKING:
    pass

NOTE = (
    "The twin runs from the recorded start with many seeds. The chance that a true model is called "
    f"wrong is {100 * FALSE_ALARMS:.0f} %, both tests together."
)
LOOK = (
    "what only a swarm shows is collisions, hidden robots, or one that sees or drives otherwise: "
    "add `collision` or `occlusion` to the model or give one robot values of its own, and compare "
    "again."
)


def section(result: SwarmComparison) -> Section:
    """The page of a comparison: verdict, tests, and metrics over time with the twin's band."""
    j = result.test
    return Section(
        title="The swarm on the floor and the twin's",
        score=[
            ("p, whole run", f"{j.p_value:.3f}", "bad" if j.p_value <= FALSE_ALARMS / 2 else ""),
            ("p, worst moment", f"{j.p_band:.3f}", "bad" if j.p_band <= FALSE_ALARMS / 2 else ""),
        ],
        verdict=result.verdict,
        facts=[
            ("robots", ", ".join(map(str, result.robots))),
            ("runs of the twin", str(len(result.twins))),
            ("time compared", f"{len(result.t_s) * BLOCK_S:.0f} s in means over {BLOCK_S:g} s"),
        ],
        figures=[bands(result)],
        next_step=LOOK if j.differs else "",
    )


def bands(result: SwarmComparison) -> Figure:
    """Metrics over time: the recorded run among the twin's runs."""
    j, names = result.test, result.names
    low, high = plain(j.low, names), plain(j.high, names)

    def paint(panels: np.ndarray) -> None:
        for k, (axes, name) in enumerate(zip(panels, names, strict=True)):
            axes.plot(result.t_s, result.twins[:, :, k].T, color=FLOOR, lw=0.4, alpha=0.35)
            axes.fill_between(result.t_s, low[:, k], high[:, k], color=FLOOR, alpha=0.15, lw=0)
            axes.plot(result.t_s, result.floor[:, k], color=MEASURED, lw=1.8)
            axes.set_ylabel(name)
            shown = np.concatenate([result.twins[:, :, k].ravel(), result.floor[:, k]])
            if COMPARED[name][0] and (shown > 0).any():
                above = shown[shown > 0]
                axes.set(yscale="log", ylim=(above.min() / 1.3, above.max() * 1.3))
                plain_ticks(axes.yaxis)
            else:
                margin = 0.1 * (np.ptp(shown) or 1)
                axes.set_ylim(shown.min() - margin, shown.max() + margin)
            if j.left and j.left[1] == k and j.p_band <= FALSE_ALARMS / 2:
                axes.axvline(result.t_s[j.left[0]], color=PREDICTED, lw=1.2)
        panels[-1].set_xlabel("time since the swarm began to move (s)")

    return Figure(
        draw(1.15 * len(names) + 0.4, paint, nrows=len(names), sharex=True),
        "Over time",
        "Dark: the floor. Green: each run of the twin, and the band that one run in forty leaves "
        "anywhere. Red: where the floor first leaves it.",
    )
