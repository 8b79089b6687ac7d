# SPDX-License-Identifier: Apache-2.0
"""Did anything change between two runs of one robot: by name, by how much, from when on?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinmill.chance import f_above, t_quantile
from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.fitting.opening import Opened, open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.runs.changes import SHARE_95, Change, Judged, kinds_of, rivals
from twinmill.runs.difference import Difference, difference
from twinmill.runs.onset import Onset, onset
from twinmill.runs.rate import USUAL_RATE, promised, rank_p, runs_for
from twinmill.runs.reference import Day, charge_matters, day_of, judged, mean_V


@dataclass(frozen=True)
class Named:
    """A change that is told.

    Attributes:
        change: what, and by how much.
        rivals: what explains the differences as well.
        onset: from when on.
    """

    change: Change
    rivals: tuple[Change, ...]
    onset: Onset


@dataclass(frozen=True)
class RunComparison:
    """Two runs of one robot.

    Attributes:
        first, second: the runs.
        whole: all differences of the second run from the first, the marker's included.
        tested: what may be an alarm of the second run, against the healthy runs.
        healthy: scores of the healthy runs, the first run's first: each against all others.
        left_out: sentences on healthy runs that could not be used.
        rate: of false alarms that is asked for.
        score: of the second run.
        changes: what changed, largest first; empty if nothing did.
    """

    first: Opened
    second: Opened
    whole: Difference
    tested: Judged
    healthy: tuple[float, ...]
    left_out: tuple[str, ...]
    rate: float
    score: float
    changes: tuple[Named, ...]

    @property
    def changed(self) -> bool:
        """Whether there is an alarm."""
        return bool(self.changes)

    @cached_property
    def p_errors(self) -> float:
        """Chance of such a score by the standard errors alone."""
        return self.tested.chance(self.score)

    @property
    def calibrated(self) -> bool:
        """Whether there are healthy runs beside the first one."""
        return len(self.healthy) > 1

    @property
    def p_rank(self) -> float | None:
        """Its rank among the healthy runs; None where the first one is the only one."""
        return rank_p(self.score, self.healthy) if self.calibrated else None

    @property
    def promised(self) -> float | None:
        """Rate of false alarms that the healthy runs promise; None where there is but one."""
        return promised(self.rate, len(self.healthy)) if self.calibrated else None

    @property
    def first_is_odd(self) -> bool:
        """Whether the first run is less like all others than any of them."""
        first, *others = self.healthy
        return self.calibrated and first > max([self.score, *others])

    @property
    def remounted(self) -> bool:
        """Whether the marker sits elsewhere, at the same rate of false alarms."""
        marker = self.whole.only([k for k in self.whole.keys if k.startswith("marker.")])
        size = len(marker.values)
        square = marker.values @ np.linalg.pinv(marker.covariance) @ marker.values
        return f_above(square / size, size, self.tested.free) <= self.rate

    @property
    def volts(self) -> tuple[float, float]:
        """Mean of the battery in each run; NaN where it was not recorded."""
        first, second = (o.measurement.track.battery_V for o in (self.first, self.second))
        return mean_V(first), mean_V(second)

    def size_of(self, key: str) -> tuple[float, float]:
        """A difference and half of its 95 % interval."""
        own = self.whole.only([key])
        reach = t_quantile(SHARE_95, self.tested.free) * np.sqrt(own.covariance[0, 0])
        return float(own.values[0]), float(reach)

    @property
    def least_shown(self) -> float:
        """Score from which on there is an alarm."""
        if len(self.healthy) >= runs_for(self.rate):
            above = int(self.rate * (len(self.healthy) + 1) + 1e-9)
            return sorted(self.healthy)[-above]
        by_errors = float(np.quantile(self.tested.by_errors, 1 - self.rate))
        return max([by_errors, *(self.healthy if self.calibrated else ())])


def compare_runs(
    first: Measurement,
    second: Measurement,
    model_file: ModelFile,
    *,
    healthy: Sequence[Measurement] = (),
    rate: float = USUAL_RATE,
    tell: Callable[[str], None] = lambda _: None,
) -> RunComparison:
    """Compares two runs of one robot.

    With healthy runs the alarm is calibrated on this robot: its score is ranked among theirs.
    Where they are too few for the rate, the standard errors must say so, too.

    Args:
        first, second: the runs; the first one is what the second one and the healthy ones are
            compared with.
        model_file: of the robot.
        healthy: more runs of it, on other days, in which nothing was wrong.
        rate: of false alarms.
        tell: is told what is being done.

    Raises:
        LogError: one of the two cannot be judged.
    """
    tell(first.label)
    opened = _opened(first, model_file)
    pairs, left_out = [], []
    for run in healthy:
        tell(run.label)
        try:
            pairs.append(difference(opened, _opened(run, model_file)))
        except LogError as error:
            left_out.append(f"Healthy run left out: {error}")
    tell(second.label)
    other = _opened(second, model_file)
    whole = difference(opened, other)
    keys = _may_alarm(whole, opened.one_clock and other.one_clock)
    kinds, charged = kinds_of(opened.model, keys), charge_matters(opened)
    told = [pair.only(keys) for pair in (whole, *pairs)]
    days = [*(day_of(pair, 1) for pair in told), day_of(told[0], 0)]
    against = [judged(d, _without(days, k), kinds, charged) for k, d in enumerate(days)]
    scores = [a.score for a in against]
    result = RunComparison(
        first=opened,
        second=other,
        whole=whole,
        tested=against[0],
        healthy=(scores[-1], *scores[1:-1]),
        left_out=tuple(left_out),
        rate=rate,
        score=scores[0],
        changes=(),
    )
    return replace(result, changes=_named(result, told[0]))


def of_robot(
    measurements: Sequence[Measurement | SteadyTable], name: str, robot: int | None
) -> Measurement:
    """The run of one robot in a log.

    Args:
        measurements: of all its robots.
        name: of the log.
        robot: its number; None: the log has one robot.

    Raises:
        LogError: there is no such robot, or no number and several robots.
    """
    runs = [m for m in measurements if isinstance(m, Measurement)]
    if not runs:
        raise LogError(f"{name}: is a table, and no run; give a log with commands and poses.")
    ids = [m.track.robot_id for m in runs]
    known = ", ".join(map(str, ids))
    if robot is None and len(runs) > 1:
        raise LogError(f"{name}: has robots {known}; say which one with --robot.")
    chosen = [m for m in runs if robot in (None, m.track.robot_id)]
    if not chosen:
        raise LogError(f"{name}: has no robot {robot}, but {known}.")
    return chosen[0]


def _opened(run: Measurement, model_file: ModelFile) -> Opened:
    (opened,) = open_measurements([run], model_file)
    if opened.data is None:
        raise LogError(f"{run.label}: cannot be compared: {opened.floor.reason}.")
    return opened


def _may_alarm(whole: Difference, one_clock: bool) -> list[str]:
    """Keys of differences that no new mounting of the marker and no other clock explains."""
    told = [k for k in whole.keys if not k.startswith("marker.")]
    return [k for k in told if k != "late_s" or one_clock]


def _without(days: Sequence[Day], k: int) -> list[Day]:
    return [*days[:k], *days[k + 1 :]]


def _named(result: RunComparison, own: Difference) -> tuple[Named, ...]:
    """What changed: the largest, then beside it what still is larger than healthy runs allow."""
    tested, found, others = result.tested, [], []
    while len(found) < len(tested.values):
        changes = tested.changes(found)
        best = max(changes, key=lambda c: abs(c.score))
        if abs(best.score) <= result.least_shown:
            break
        found.append(best.kind)
        others.append(tuple(rivals(best, changes)))
    sizes = [tested.sized(kind, [k for k in found if k is not kind]) for kind in found]
    return tuple(
        Named(c, rest, onset(c, [s for s in sizes if s is not c], own, result.rate))
        for c, rest in zip(sizes, others, strict=True)
    )
