# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis tells."""

from collections.abc import Sequence
from dataclasses import dataclass

from twinmill.diagnosis.evidence import State
from twinmill.diagnosis.omnibus import Omnibus
from twinmill.diagnosis.ranking import Ranked
from twinmill.diagnosis.robots import RobotOff
from twinmill.diagnosis.settled import Sum
from twinmill.fitting.compare import Comparison
from twinmill.model.freedom import Estimate
from twinmill.predict.detection_errors import BitComparison


@dataclass(frozen=True)
class Diagnosis:
    """The result.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous or outside_catalogue.
        sentence: the same for people.
        before: the model as given; score_refit: its base refitted.
        found: names of the missing effects, most important first.
        ranking: effects, best first.
        not_identifiable: effect and why.
        omnibus: what the found effects leave.
        share_unexplained: of all that could be explained.
        state: scenes with the model that has the found effects.
        notes: sentences on what to keep in mind.
        next_experiment: which run would settle what this log leaves open, or None.
        sums: of found effects that are firmer than their parts.
        bits: of the robots' cameras with the model as given, or None.
        bits_after: with the effects of the camera that were found; None if there are none.
        bit_steps: the camera's effects as found, each with the bits' score on held-out frames; the
            first is the model without them.
        bit_estimates: of all effects of the camera, with what was found.
        robots_off: those that differ from the others; `state` is without them.
    """

    verdict: str
    sentence: str
    before: Comparison
    score_refit: float
    found: list[str]
    ranking: list[Ranked]
    not_identifiable: list[tuple[str, str]]
    omnibus: Omnibus
    share_unexplained: float
    state: State
    steps: list[tuple[str | None, float]]
    notes: list[str]
    next_experiment: dict | None
    sums: list[Sum]
    bits: BitComparison | None = None
    bits_after: BitComparison | None = None
    bit_steps: Sequence[tuple[str | None, float]] = ()
    bit_estimates: tuple[Estimate, ...] = ()
    robots_off: tuple[RobotOff, ...] = ()

    def to_json(self) -> dict:
        """The interface's object."""
        top = next((r.group for r in self.ranking if r.group is not None), None)
        same = [r.effect for r in self.ranking if r.group == top and top is not None]
        term = self.omnibus.term
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "score": self.before.score,
            "score_refit": self.score_refit,
            "found": self.found,
            "ranking": [r.to_json() for r in self.ranking],
            "confusable_with": [e for e in same if e not in self.found],
            "not_identifiable": [{"effect": e, "why": w} for e, w in self.not_identifiable],
            "unexplained": {
                "depends_on": [g.group for g in self.omnibus.groups],
                "share": self.share_unexplained,
                "formula": f"{term.adds_to} += p0 * {term.formula}" if term else None,
                "p0": self.omnibus.coefficient if term else None,
                "equation": self.omnibus.equation,
            },
            "steps": [{"effect": e, "score_heldout": s} for e, s in self.steps],
            "sums": [s.to_json() for s in self.sums],
            "next_experiment": self.next_experiment,
            "time_base": [
                {"log": r.scene.measurement.log_name, **r.scene.measurement.time_base.to_json()}
                for r in self.before.robots
                if r.scene.measurement.time_base
            ],
            "robots_off": [r.to_json() for r in self.robots_off],
            "bits": self.bits.to_json() if self.bits else None,
            "bits_after": self.bits_after.to_json() if self.bits_after else None,
            "bit_steps": [{"effect": e, "score_heldout": s} for e, s in self.bit_steps],
            "notes": self.notes,
        }
