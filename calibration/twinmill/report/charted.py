# SPDX-License-Identifier: Apache-2.0
"""The charts of a report: all robots of a comparison, first the worst stretch of the one shown."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import twinmill_native as native

from twinmill.charts.arrays import RobotView
from twinmill.charts.embedded import Shown, embedded
from twinmill.fitting.compare import Comparison, RobotComparison
from twinmill.predict.detections import all_detections
from twinmill.predict.regimes import HORIZON
from twinmill.predict.steady_errors import SteadyComparison
from twinmill.report.tables import number

STRETCH_S = 20.0  # that can be looked at without getting lost


def charts(
    result: Comparison, beside: Sequence[tuple[str, native.Model] | None] = ()
) -> Callable[[], str] | None:
    """HTML of the charts, made when it is asked for; None where no robot has a log.

    Args:
        result: its models' predictions are shown.
        beside: another model of each robot of the result with its label, or None; or nothing.
    """
    own = [(k, r) for k, r in enumerate(result.robots) if isinstance(r, RobotComparison)]
    robots = [robot for _, robot in own]
    others = [beside[k] if beside else None for k, _ in own]
    return partial(_drawn, result.shown, robots, others) if robots else None


def _drawn(
    begin: RobotComparison | SteadyComparison,
    robots: list[RobotComparison],
    others: list[tuple[str, native.Model] | None],
) -> str:
    detections = {b.label: b for b in all_detections([r.modelled for r in robots])}
    shown = []
    for robot, other in zip(robots, others, strict=True):
        modelled = robot.modelled
        view = RobotView(modelled.measurement, robot.floor, modelled.clock_free)
        name = f"{modelled.measurement.label} · {number(robot.score)}"
        seen = detections.get(modelled.measurement.label)
        shown.append(Shown(view, name, modelled.model, robot.where, other, seen))
    first = robots.index(begin) if begin in robots else 0
    return embedded(shown, first, _stretch(robots[first]))


def _stretch(robot: RobotComparison) -> tuple[float, float]:
    """The 20 s in which predictions miss most."""
    track, starts = robot.measurement.track, robot.windows.starts
    square = np.nansum((robot.errors / robot.floor.rms)[:, HORIZON] ** 2, axis=1)
    total = np.concatenate([[0], np.cumsum(square)])
    t_s = track.pose_t_s[starts]
    begins = np.flatnonzero(t_s <= max(t_s[0], t_s[-1] - STRETCH_S))
    finish = np.searchsorted(t_s, t_s[begins] + STRETCH_S)
    from_s = float(t_s[begins[np.argmax(total[finish] - total[begins])]])
    return from_s, min(from_s + STRETCH_S, float(t_s[-1]))
