# SPDX-License-Identifier: Apache-2.0
"""Did anything change between two runs of one robot: by name, by how much, from when on?"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twinmill.arguments import option
from twinmill.chance import f_above, t_quantile
from twinmill.data.log import LogError
from twinmill.data.measurement import BadInputError, Measurement, of_one_robot
from twinmill.data.steady_table import SteadyTable
from twinmill.defaults import ALARM_RATE
from twinmill.estimation.opened import Opened
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.runs.alarm import Alarm, alarm
from twinmill.runs.changes import MOSTLY, SHARE_95, Change, Judged, kinds_of
from twinmill.runs.difference import Difference, difference, mean_V
from twinmill.runs.onset import Onset, onset
from twinmill.runs.reference import day_of, steadier


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

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return {
            **self.change.to_json(),
            "rivals": [r.to_json() for r in self.rivals],
            "onset": self.onset.to_json(),
        }


@dataclass(frozen=True)
class RunComparison:
    """Two runs of one robot.

    Attributes:
        first, second: the runs.
        whole: all differences of the second run from the first, the marker's included.
        settled: likewise, of the second run since what changed within it.
        tested_keys: of the differences that may be an alarm.
        alarm: of these, with the healthy runs.
        changes: what changed, the surest first; empty if nothing did.
        left_out: sentences on healthy runs that could not be used.
    """

    first: Opened
    second: Opened
    whole: Difference
    settled: Difference
    tested_keys: tuple[str, ...]
    alarm: Alarm
    changes: tuple[Named, ...]
    left_out: tuple[str, ...] = ()

    @property
    def changed(self) -> bool:
        """True if there is an alarm."""
        return bool(self.changes)

    @property
    def remounted(self) -> bool:
        """True if the marker sits elsewhere, at the rate of false alarms that alarms have."""
        marker = self.settled.only([k for k in self.whole.keys if k.startswith("marker.")])
        size = len(marker.values)
        square = marker.values @ np.linalg.pinv(marker.covariance) @ marker.values
        return f_above(square / size, size, self.alarm.tested.free) <= self.alarm.rate

    @property
    def volts(self) -> tuple[float, float]:
        """Mean of the battery in each run; NaN where it was not recorded."""
        return mean_V(self.first), mean_V(self.second)

    def size_of(self, key: str) -> tuple[float, float]:
        """A difference and half of its 95 % interval."""
        own = self.settled.only([key])
        reach = t_quantile(SHARE_95, self.alarm.tested.free) * np.sqrt(own.covariance[0, 0])
        return float(own.values[0]), float(reach)

    def to_json(self) -> dict[str, Any]:
        """The interface's object."""
        marker = [k for k in self.whole.keys if k.startswith("marker.")]
        return {
            "verdict": "changed" if self.changed else "unchanged",
            "changes": [n.to_json() for n in self.changes],
            "remounted": self.remounted,
            "marker": {k.removeprefix("marker."): self._with_interval(k) for k in marker},
            "late_s": self._with_interval("late_s"),
            "one_clock": "late_s" in self.tested_keys,
            "battery_V": list(self.volts),
            "numbers": [self._number(c) for c in self.alarm.tested.changes()],
            "score": self.alarm.score,
            "alarm_above": self.alarm.above,
            "alarm_rate": self.alarm.rate,
            "p_errors": self.alarm.p_errors,
            "p_rank": self.alarm.p_rank,
            "healthy_runs": len(self.alarm.healthy),
            "promised_rate": self.alarm.promised,
            "first_is_odd": self.alarm.first_is_odd,
            "left_out": list(self.left_out),
            "runs": [_run_json(o) for o in (self.first, self.second)],
        }

    def _with_interval(self, key: str) -> dict[str, float]:
        value, reach = self.size_of(key)
        return {"value": value, "low": value - reach, "high": value + reach}

    def _number(self, change: Change) -> dict[str, Any]:
        sizes = [self.alarm.shown(change, share) for share in (0.5, MOSTLY)]
        return {**change.to_json(), "smallest_shown": sizes[0], "shown_9_of_10": sizes[1]}


def _run_json(opened: Opened) -> dict[str, Any]:
    run = opened.measurement
    return {
        "log": run.log_name,
        "log_sha256": run.log_sha256,
        "robot_id": opened.track.robot_id,
        "recorded_utime_us": run.recorded_utime_us,
    }


def compare_runs(
    first: Measurement,
    second: Measurement,
    model_file: ModelFile,
    *,
    healthy: Sequence[Measurement] = (),
    rate: float = ALARM_RATE,
    tell: Callable[[str], None] = lambda _: None,
) -> RunComparison:
    """Compares two runs of one robot.

    With healthy runs the alarm is calibrated on this robot: its score is ranked among theirs.
    Where they are too few for the rate, the standard errors must say so, too.

    Args:
        first: run that was healthy.
        second: run in question.
        model_file: of the robot.
        healthy: more runs of it, on other days, in which nothing was wrong.
        rate: of false alarms.
        tell: is told what is being done.

    Raises:
        LogError: one of the two cannot be judged.
    """
    tell(first.label)
    opened = open_run(first, model_file)
    pairs, left_out = [], []
    for run in healthy:
        tell(run.label)
        try:
            pairs.append(difference(opened, open_run(run, model_file)))
        except LogError as error:
            left_out.append(f"Healthy run left out: {error}")
    tell(second.label)
    other = open_run(second, model_file)
    result = compared(opened, other, pairs, rate)
    return replace(result, left_out=tuple(left_out))


def compared(
    first: Opened, second: Opened, healthy: Sequence[Difference], rate: float
) -> RunComparison:
    """Compares two opened runs; see `compare_runs`.

    Args:
        first: run that was healthy.
        second: run in question.
        healthy: differences of healthy runs from the first one.
        rate: of false alarms.
    """
    whole = difference(first, second)
    keys = may_alarm(whole, first.one_clock and second.one_clock)
    others = [both_ways(pair) for pair in healthy]
    kinds = kinds_of(first.model, keys)

    def judge(pair: Difference, pieces: int = 1) -> Alarm:
        if not others:
            return alarm([day_of(pair.only(keys), run) for run in (0, 1)], kinds, rate, pieces)
        choices = zip(both_ways(pair), *others, strict=True)
        days = [
            [day_of(own.only(keys), 0), *(day_of(p.only(keys), 1) for p in (*rest, own))]
            for own, *rest in choices
        ]
        return alarm(steadier(days, kinds), kinds, rate, pieces)

    own = whole.only(keys)
    found = judge(whole)
    if not others:
        pieces = (whole, difference(first, second_half(second)))
        found = min((judge(pair, len(pieces)) for pair in pieces), key=lambda a: a.p_errors)
    named = []
    for change, rest in found.found:
        beside = [c for c, _ in found.found if c is not change]
        named.append(Named(change, rest, onset(change, beside, own, rate)))
    settled, since_s = whole, max((n.onset.at_s for n in named), default=0.0)
    if since_s:
        settled = difference(first, _since(second, since_s))
        after = judge(settled).tested
        named = [replace(n, change=_sized_anew(n, named, after)) for n in named]
    return RunComparison(first, second, whole, settled, tuple(keys), found, tuple(named))


def both_ways(pair: Difference) -> tuple[Difference, Difference]:
    """As predictions tell it, and as white steps do: one suffers less from a model's faults.

    The other suffers less from noise.
    """
    return pair, pair.precise()


def second_half(opened: Opened) -> Opened:
    """The second half of a run; what changes within a run looks like scatter of the whole."""
    return _since(opened, float(np.ptp(opened.trajectory.start_s)) / 2)


def _since(opened: Opened, at_s: float) -> Opened:
    """A run from a moment on, s since its start."""
    data = opened.trajectory
    late = data.start_s >= data.start_s[0] + at_s
    return replace(opened, data=replace(data, keep=data.keep & late))


def _sized_anew(own: Named, named: Sequence[Named], after: Judged) -> Change:
    kinds = [n.change.kind for n in named if n is not own]
    return after.sized(own.change.kind, kinds)


def of_robot(
    measurements: Sequence[Measurement | SteadyTable], name: str, robot: int | None
) -> Measurement:
    """The run of one robot in a log, by the log's name and the robot's number if it has several.

    Raises:
        LogError: it is not there.
    """
    remedy = f"give commands and poses of one robot, or its number with {option('robot')}"
    return of_one_robot(measurements, f"{name}: holds", remedy, robot)[0]


@contextmanager
def right_before(first: str) -> Iterator[None]:
    """Says of a second run that is wrong that the first is not: so the robot may have changed.

    Args:
        first: name of that one's log.

    Raises:
        BadInputError: the second one cannot be judged.
    """
    try:
        yield
    except BadInputError as error:
        since = (
            f"{first} has no such mistake, so between the two what writes the logs was changed, or "
            "the robot itself, as by wires that were exchanged"
        )
        found = [replace(f, remedy=f"{f.remedy}; {since}") for f in error.findings]
        raise BadInputError(found) from error


def open_run(run: Measurement, model_file: ModelFile) -> Opened:
    """A run with its noise floor.

    Raises:
        LogError: it has none.
    """
    (opened,) = open_measurements([run], model_file)
    if opened.floor and opened.data is None:
        raise LogError(f"{run.label}: cannot be compared: {opened.floor.reason}.")
    return opened


def may_alarm(whole: Difference, one_clock: bool) -> list[str]:
    """Keys of differences that no new mounting of the marker and no other clock explains."""
    told = [k for k in whole.keys if not k.startswith("marker.")]
    return [k for k in told if k != "late_s" or one_clock]
