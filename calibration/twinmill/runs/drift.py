# SPDX-License-Identifier: Apache-2.0
"""A robot's numbers over its calibrations: which left the band of those before, and which drift.

The band of a calibration is where that of an unchanged robot would lie with all its numbers at
once, but for a share `rate`: a prediction interval by Student's t from the calibrations before it,
which show both the errors of fits and what varies from day to day. A steady drift, which such a
band follows, shows as a trend (Mann 1945).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.arguments import option
from twinmill.chance import t_quantile
from twinmill.defaults import ALARM_RATE
from twinmill.model.parameters import CLOCK, CLOCK_RATE, catalogue_name
from twinmill.runs.difference import MOUNTING
from twinmill.runs.history import Calibration, Number

FEWEST_BEFORE = 2  # calibrations that a band is made from: one shows nothing of days
TESTS = 2  # of each number: the band, and the trend


@dataclass(frozen=True)
class Series:
    """One number over the calibrations that have it.

    Attributes:
        last: as the last calibration has it.
        days: (N,) places of these calibrations among all.
        values, stds: (N,)
        low, high: (N,) band; NaN where too few calibrations were before.
        trend_p: chance of so steady a trend among numbers in a random order.
        natural: it changes with how the marker is mounted, or with clocks, and is no alarm.
        rate: of false alarms of its band and its trend together.
    """

    last: Number
    days: np.ndarray
    values: np.ndarray
    stds: np.ndarray
    low: np.ndarray
    high: np.ndarray
    trend_p: float
    natural: bool
    rate: float

    @property
    def outside(self) -> np.ndarray:
        """(N,) whether a calibration is out of its band."""
        return (self.values < self.low) | (self.values > self.high)

    @property
    def drifts(self) -> bool:
        """True if it has a trend."""
        return self.trend_p <= self.rate / TESTS

    @property
    def left(self) -> bool:
        """True if the last calibration is out of its band, or all have a trend; nuisances aside."""
        return not self.natural and bool(self.outside[-1] or self.drifts)


@dataclass(frozen=True)
class Drift:
    """All numbers of a history.

    Attributes:
        calibrations: by date.
        series: by name.
        rate: of false alarms of a calibration.
    """

    calibrations: Sequence[Calibration]
    series: Sequence[Series]
    rate: float

    @property
    def left(self) -> list[Series]:
        """Numbers that left their band or drift."""
        return [s for s in self.series if s.left]

    def to_json(self) -> dict[str, Any]:
        """The interface's object."""
        return {
            "verdict": "changed" if self.left else "unchanged",
            "robot_id": self.calibrations[-1].robot_id,
            "calibrations": len(self.calibrations),
            "alarm_rate": self.rate,
            "left": [s.last.name for s in self.left],
            "numbers": [self._series(s) for s in self.series],
        }

    def _series(self, s: Series) -> dict[str, Any]:
        dates = [self.calibrations[k].date_json for k in s.days]
        rows = zip(dates, s.values, s.stds, s.low, s.high, s.outside, strict=True)
        keys = ("date", "value", "std", "low", "high", "outside")
        return {
            "name": s.last.name,
            "unit": s.last.unit,
            "words": s.last.words,
            "natural": s.natural,
            "left": s.left,
            "trend_p": s.trend_p,
            "points": [dict(zip(keys, row, strict=True)) for row in rows],
        }


def drift(calibrations: Sequence[Calibration], rate: float = ALARM_RATE) -> Drift:
    """Bands and trends of all numbers that the last calibration has.

    Args:
        calibrations: of one robot, by date.
        rate: chance that an unchanged robot leaves any band, or has any trend.

    Raises:
        ValueError: there are fewer than two.
    """
    if len(calibrations) < 2:
        raise ValueError(
            f"the history has {len(calibrations)} calibration"
            f"{'s' * (len(calibrations) != 1)}, and drift shows from two on; add one with "
            f"`twinmill fit` with {option('history')}."
        )
    names = [n.name for n in calibrations[-1].numbers]
    tested = max(1, sum(not _is_natural(name) for name in names))
    return Drift(calibrations, [_series(calibrations, n, rate / tested) for n in names], rate)


def _is_natural(name: str) -> bool:
    return name in (CLOCK, CLOCK_RATE) or catalogue_name(name) in MOUNTING


def _series(calibrations: Sequence[Calibration], name: str, rate: float) -> Series:
    found = [(day, n) for day, c in enumerate(calibrations) for n in c.numbers if n.name == name]
    values, stds = (np.array([getattr(n, k) for _, n in found]) for k in ("value", "std"))
    bands = [_band(values[:k], stds[:k], stds[k], rate / TESTS) for k in range(len(found))]
    low, high = np.array(bands).T
    return Series(
        last=found[-1][1],
        days=np.array([day for day, _ in found]),
        values=values,
        stds=stds,
        low=low,
        high=high,
        trend_p=_trend_p(values),
        natural=_is_natural(name),
        rate=rate,
    )


def _band(before: np.ndarray, stds: np.ndarray, std: float, rate: float) -> tuple[float, float]:
    """Where the next value of an unchanged number lies.

    Args:
        before: values of earlier calibrations.
        stds: their standard errors.
        std: of the next value.
        rate: chance that it lies elsewhere.
    """
    count = len(before)
    if count < FEWEST_BEFORE:
        return float("nan"), float("nan")
    errors = float(np.mean(stds**2))
    days = max(float(before.var(ddof=1)) - errors, 0.0)
    wide = np.sqrt((days + std**2) + (days + errors) / count)
    reach = t_quantile(1 - rate / 2, count - 1) * wide
    return float(before.mean() - reach), float(before.mean() + reach)


def _trend_p(values: np.ndarray) -> float:
    """By Kendall's rank correlation with time, exact for few values."""
    from scipy.stats import kendalltau  # slow to import, for a drift alone

    if len(values) < 3 or np.ptp(values) == 0:
        return 1.0
    return float(kendalltau(np.arange(len(values)), values).pvalue)
