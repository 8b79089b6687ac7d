# SPDX-License-Identifier: Apache-2.0
"""Decides if a run is too unlike the healthy ones for chance, and names the change."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from twinmill.chance import t_quantile
from twinmill.runs.changes import Change, Judged, Kind, rivals
from twinmill.runs.rate import promised, rank_p, runs_for
from twinmill.runs.reference import Day, judged


@dataclass(frozen=True)
class Alarm:
    """A run among healthy ones.

    Attributes:
        tested: its differences from their mean.
        score: the largest of them, in standard errors.
        healthy: scores of the healthy runs, the first run's first: each against all others.
        rate: of false alarms that is asked for.
        pieces: stretches of the run that are judged; each has its share of the rate.
    """

    tested: Judged
    score: float
    healthy: tuple[float, ...]
    rate: float
    pieces: int = 1

    @property
    def calibrated(self) -> bool:
        """True if there are healthy runs beside the first one."""
        return len(self.healthy) > 1

    @property
    def p_errors(self) -> float:
        """Chance of such a score by the standard errors alone."""
        return min(1.0, self.pieces * self.tested.chance(self.score))

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
        """True if the first run is less like all others than any of them."""
        first, *others = self.healthy
        return self.calibrated and first > max([self.score, *others])

    @cached_property
    def above(self) -> float:
        """Score above which there is an alarm.

        Too few healthy runs for the rate leave the word to the standard errors, too.
        """
        if len(self.healthy) >= runs_for(self.rate):
            place = int(self.rate * (len(self.healthy) + 1) + 1e-9)
            return sorted(self.healthy)[-place]
        by_errors = float(np.quantile(self.tested.by_errors, 1 - self.rate / self.pieces))
        return max([by_errors, *(self.healthy if self.calibrated else ())])

    def shown(self, change: Change, share: float) -> float:
        """Size from which on a change is an alarm in this share of such pairs of runs."""
        return (self.above + t_quantile(share, change.free)) * change.std

    @cached_property
    def found(self) -> list[tuple[Change, tuple[Change, ...]]]:
        """Changes, the surest first, each with those that explain it as well.

        Beside the first ones another is told if it is still larger than an alarm takes.
        """
        kinds: list[Kind] = []
        others = []
        while len(kinds) < len(self.tested.values):
            changes = self.tested.changes(kinds)
            best = max(changes, key=lambda c: abs(c.score))
            if abs(best.score) <= self.above:
                break
            kinds.append(best.kind)
            others.append(tuple(rivals(best, changes)))
        sizes = [self.tested.sized(kind, [k for k in kinds if k is not kind]) for kind in kinds]
        return list(zip(sizes, others, strict=True))


def alarm(days: Sequence[Day], kinds: Sequence[Kind], rate: float, pieces: int = 1) -> Alarm:
    """Judges the last day by the others, and each of these by all, itself left out.

    Args:
        days: the first run, other healthy ones, and the run in question.
        kinds: of changes that the robot may have.
        rate: of false alarms.
        pieces: see `Alarm`.
    """
    against = [judged(days, k, kinds) for k in range(len(days))]
    *healthy, score = (a.score for a in against)
    return Alarm(against[-1], score, tuple(healthy), rate, pieces)
