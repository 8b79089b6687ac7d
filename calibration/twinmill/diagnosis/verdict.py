# SPDX-License-Identifier: Apache-2.0
"""The verdict of a diagnosis, and its sentence."""

from dataclasses import dataclass

from twinmill.diagnosis.omnibus import CHANGE, Omnibus
from twinmill.diagnosis.ranking import Ranked, groups_of
from twinmill.diagnosis.search import SILENT
from twinmill.fitting.compare import GOOD
from twinmill.model.freedom import Estimate

HELPED = 0.95  # a refit that lowers the score below this share of it was worth it
OUTSIDE = 0.1  # share of what could be explained that no effect does
# Effects that hold back what follows a change of the command: one imitates another.
LATE = {
    "input_delay",
    "clock_offset",
    "motor_lag",
    "lag_by_duty",
    "slew_limit",
    "reversal_dead_time",
    "coasting",
}
WORSE = 1.5  # score over the usual one, beyond which it is a finding
IMITATED = 0.02  # the same share, of what depends on the kind of change, where one of LATE is found


@dataclass(frozen=True)
class Weighed:
    """What the verdict rests on.

    Attributes:
        score, score_refit: of the model as given, and with its base refitted.
        names: of the effects found.
        share: of what could be explained, unexplained by them.
        left: held-out score with the effects found.
        usual: score of the model on the logs that it was fitted to.
        noises: what was said of unusual noise.
        at_bound: estimates of found effects that are at their bounds.
    """

    score: float
    score_refit: float
    names: list[str]
    ranking: list[Ranked]
    omnibus: Omnibus
    share: float
    left: float
    usual: float
    noises: list[str]
    at_bound: list[Estimate]

    @property
    def verdict(self) -> str:
        """As in Diagnosis."""
        if self._outside:
            return "outside_catalogue"
        if self.names:
            tied = {r.group for r in self.ranking if r.effect in self.names and r.group is not None}
            return "ambiguous" if tied else "effect_missing"
        if self.score_refit < HELPED * self.score and self.score > GOOD:
            return "refit_enough"
        return "model_adequate"

    @property
    def _outside(self) -> bool:
        changes = any(g.group == CHANGE for g in self.omnibus.groups)
        imitated = changes and bool(LATE & set(self.names)) and self.share > IMITATED
        random = bool(self.noises) and not self.names
        unexplained = (self.share > OUTSIDE or imitated) and self.left > SILENT
        return unexplained or self.left > WORSE * self.usual or random

    @property
    def sentence(self) -> str:
        """The verdict for people."""
        verdict, names = self.verdict, " and ".join(self.names)
        if verdict == "model_adequate":
            return "Nothing is missing that these logs would show."
        if verdict == "refit_enough":
            return (
                "No effect is missing; the base model's numbers were stale, and a refit is enough."
            )
        if verdict == "effect_missing":
            return f"Missing: {names}.{self._doubt}"
        if verdict == "ambiguous":
            same = " or ".join(groups_of(self.ranking, self.names))
            return f"Missing: one of {same}; these logs cannot tell which.{self._doubt}"
        if self.noises and not self.names and (self.left < GOOD or not self.omnibus.groups):
            return "Something random disturbs the motion that no effect of the catalogue describes."
        on = " and ".join(g.group for g in self.omnibus.groups)
        depends = f"it depends on {on}" if on else "no formula that was tried describes it"
        also = f" {names} explain{'s' if len(self.names) == 1 else ''} part of it." if names else ""
        return f"Something outside the catalogue is there; {depends}.{also}"

    @property
    def _doubt(self) -> str:
        """What makes a name doubtful."""
        if not self.at_bound:
            return ""
        named = " and ".join(e.name for e in self.at_bound)
        are = "is at its bound" if len(self.at_bound) == 1 else "are at their bounds"
        return f" {named} {are}: another effect may be behind it."
