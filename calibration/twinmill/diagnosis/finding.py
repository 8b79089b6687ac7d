# SPDX-License-Identifier: Apache-2.0
"""Results of a diagnosis about one effect, a ranking, and the lateness of the motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from twinmill.defaults import Certainty
from twinmill.formulas.term import TIME
from twinmill.model.parameters import ParameterEstimate, with_role

HARDLY = 0.005  # a share that is told as less than a percent


@dataclass(frozen=True)
class Finding:
    """One effect that is missing, or `refit`: the base's numbers were stale.

    Attributes:
        group: names that the data cannot tell apart, its own first; None if it is alone.
        parameters: of the final model.
        share: of the squared held-out error at 0.5 s above the floor that it takes away.
        certainty: sure, group or doubtful.
        why: of a doubt; empty otherwise.
        again: the model given has the effect already, with other numbers.
        wrong_form: something of another form stands behind it.
        depends_on: what that depends on, where the doubt tells it; else empty.
        within_told: it is no more than numbers that other logs told may be wrong by.
        beside: in words, the number of the base that it adds to; empty if there is none.
    """

    effect: str
    group: tuple[str, ...] | None
    parameters: list[ParameterEstimate]
    share: float
    certainty: Certainty
    why: str = ""
    again: bool = False
    wrong_form: bool = False
    depends_on: str = ""
    within_told: bool = False
    beside: str = ""

    @property
    def passes(self) -> bool:
        """True if it is, or may be, of a moment of its run: no other run has it.

        So is a place that may be a moment, or is in doubt, and a number that changed as time went.
        """
        alike = (self.effect, *(self.group or ()))
        doubtful = self.certainty == "doubtful"
        if with_role(self.effect, "place"):
            return doubtful or any(with_role(name, "moment") for name in alike)
        changes = doubtful and self.depends_on == TIME
        return changes or bool(with_role(self.effect, "moment"))

    @property
    def takes(self) -> str:
        """The share in words."""
        return "< 1 %" if self.share < HARDLY else f"{100 * self.share:.0f} %"

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        parameters = [e.to_json() for e in self.parameters]
        group = list(self.group) if self.group else None
        return {**vars(self), "parameters": parameters, "group": group}


@dataclass(frozen=True)
class Ranked:
    """One effect of the ranking.

    Attributes:
        score_heldout: of the model with it, on parts it was not fitted to.
        share_explained: of the squared score above 1 that the model as given had.
        p_value: chance of such evidence if nothing were missing, for all effects together.
        evidence: half the fall of the held-out cost.
        group: number shared by effects that the data cannot tell apart; None if they can.
    """

    effect: str
    score_heldout: float
    share_explained: float
    p_value: float
    evidence: float
    parameters: list[ParameterEstimate]
    group: int | None

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return {**vars(self), "parameters": [e.to_json() for e in self.parameters]}


def doubted(finding: Finding, why: str, wrong_form: bool = False, depends_on: str = "") -> Finding:
    """The finding with one more reason to doubt it; the first is told."""
    return replace(
        finding,
        certainty="doubtful",
        why=finding.why or why,
        wrong_form=finding.wrong_form or wrong_form,
        depends_on=finding.depends_on or depends_on,
    )


def part_of_all(findings: Sequence[Finding], left: float) -> float:
    """By what shares are multiplied where they are told, so that with what is left they make 1.

    What findings take is judged at half a second, what is left at all horizons; and one that takes
    less than nothing beside others counts as nothing.

    Args:
        findings: of one diagnosis.
        left: share that they leave.
    """
    taken = sum(f.share for f in findings)
    return 1 / (taken + left) if taken >= HARDLY else 1.0


def of_all(findings: Sequence[Finding], left: float) -> list[Finding]:
    """The findings with shares of all that was there."""
    part = part_of_all(findings, left)
    return [replace(f, share=part * f.share) for f in findings]
