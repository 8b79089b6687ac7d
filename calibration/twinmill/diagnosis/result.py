# SPDX-License-Identifier: Apache-2.0
"""The result of a diagnosis, for reports and JSON."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import twinmill_native as native

from twinmill.data.checks.settings import CHECKS
from twinmill.defaults import Verdict
from twinmill.diagnosis.apart import Apart
from twinmill.diagnosis.finding import Finding, Ranked
from twinmill.diagnosis.moments import every_s
from twinmill.diagnosis.outliers import Outlier
from twinmill.diagnosis.resolution import Resolution
from twinmill.diagnosis.rest import FIRM, NOISE, Rest
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT
from twinmill.fitting.compare import Comparison
from twinmill.fitting.opening import Opened
from twinmill.fitting.settings import FLOOR_SETTINGS
from twinmill.model.late import Late
from twinmill.model.parameters import ParameterEstimate, makes_late
from twinmill.predict.detection_errors import DetectionComparison

PASSES = ("model_adequate", "refit_enough")  # verdicts that let pass what is left


@dataclass(frozen=True)
class Diagnosis:
    """The result.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous, outside_catalogue or
            cannot_tell.
        sentence: the same for people.
        before: the model as given; score_refit: its base refitted, held out.
        findings: in the order of worth.
        ranking: effects, best first.
        not_identifiable: effect and why.
        rest: what the findings leave.
        late: how late the motion is; None of tables.
        search: all that was tried.
        opened: measurements with the model that has the findings.
        modelled: the same with the models that were found, as reports look at them.
        steps: held-out score of the model as given and after each finding.
        notes: sentences on what to keep in mind.
        next_experiment: which run would settle what this log leaves open, or None.
        robots_off: those that differ from the others.
        runs_off: runs of one robot that differ from those that the model as given predicts.
        detections: of the robots' cameras with the model as given, or None.
        detections_after: with the effects of the camera that were found; None if there are none.
        detection_steps: the camera's effects as found, each with the detections' score on held-out
            frames; the first is the model without them.
        detection_estimates: of all effects of the camera, with what was found.
        camera: effects of the camera that were found.
        robots: how small a difference of each robot would have been seen.
        base_names: quantities of the base that these measurements move.
        apart: numbers in which robots or runs differ, each of which has its own here; None where
            one set of numbers does as well.
    """

    verdict: Verdict
    sentence: str
    before: Comparison
    score_refit: float
    findings: list[Finding]
    ranking: list[Ranked]
    not_identifiable: list[tuple[str, str]]
    rest: Rest
    late: Late | None
    search: Search
    opened: Sequence[Opened]
    modelled: Sequence
    steps: list[tuple[str | None, float]]
    notes: list[str]
    next_experiment: dict | None
    robots_off: tuple[Outlier, ...] = ()
    runs_off: tuple[Outlier, ...] = ()
    detections: DetectionComparison | None = None
    detections_after: DetectionComparison | None = None
    detection_steps: Sequence[tuple[str | None, float]] = ()
    detection_estimates: tuple[ParameterEstimate, ...] = ()
    camera: tuple[Finding, ...] = ()
    base_names: tuple[str, ...] = ()
    robots: tuple[Resolution, ...] = ()
    apart: Apart | None = None

    @property
    def lines(self) -> list[str]:
        """The sentence in parts: one for each that differs, then what is said of the rest."""
        own = [r.sentence for r in (*self.robots_off, *self.runs_off)]
        rest = self.sentence
        for sentence in own:
            rest = rest.removeprefix(sentence).lstrip()
        return [line for line in (*own, rest) if line]

    def with_robots_off(self, off: Sequence[Outlier]) -> "Diagnosis":
        """Diagnosis with the robots that differed told anew, in their order."""
        said = self.sentence
        for before, now in zip(self.robots_off, off, strict=True):
            said = said.replace(before.sentence, now.sentence, 1)
        return replace(self, robots_off=tuple(off), sentence=said)

    @property
    def motion(self) -> list[str]:
        """Effects of the motion that were found, most important first."""
        return [f.effect for f in self.findings if f.effect != REFIT]

    @property
    def found(self) -> list[str]:
        """All effects that were found."""
        return [*self.motion, *(f.effect for f in self.camera)]

    @property
    def passing(self) -> list[str]:
        """Effects that were found and are of this run, or may be: no other run has them.

        Where lateness changes within a log, so are those that make it late.
        """
        later = self.rest.events.later
        return [f.effect for f in self.findings if f.passes or (later and makes_late(f.effect))]

    @property
    def lasting(self) -> list[str]:
        """Effects that were found, but for those."""
        return [name for name in self.found if name not in self.passing]

    def finding(self, effect: str) -> Finding | None:
        """Finding about an effect; None if it was not found."""
        own = [f for f in (*self.findings, *self.camera) if f.effect == effect]
        return own[0] if own else None

    @property
    def model(self) -> native.Model:
        """The common model with the findings of the motion."""
        return self.search.last.state.model

    @property
    def is_left(self) -> bool:
        """True if the rest is worth telling: more than nothing is left, or doubtful names are."""
        if self.verdict in PASSES or (self.apart and not self.rest.depends_on):
            return False
        return self.rest.share >= SETTINGS.nothing_left or self.verdict == "outside_catalogue"

    @property
    def rest_certainty(self) -> str:
        """As `Rest.certainty`; what the verdict lets pass is not firm."""
        passed = self.verdict in PASSES and self.rest.certainty == FIRM
        return NOISE if passed else self.rest.certainty

    def to_json(self) -> dict:
        """The interface's object."""
        top = next((r.group for r in self.ranking if r.group is not None), None)
        same = [r.effect for r in self.ranking if r.group == top and top is not None]
        rest = self.rest
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "stopped": self.search.stopped,
            "score": self.before.score,
            "score_refit": self.score_refit,
            "findings": [f.to_json() for f in self.findings],
            "rest": {
                "share": rest.share,
                "firm": self.rest_certainty == FIRM,
                "certainty": self.rest_certainty,
                "told": self.is_left,
                "depends_on": rest.depends_on,
                "likely": rest.likely,
                "wander": asdict(rest.by_itself) if rest.by_itself else None,
                "formula": rest.proven.equals if rest.proven else None,
                "moments": [m.to_json() for m in rest.moments],
                "every_s": every_s(rest.moments) or None,
                "later": [change.to_json() for change in rest.events.later],
                "proven": rest.proven.to_json() if rest.proven else None,
            },
            "late": self.late.to_json() if self.late else None,
            "input": [],
            "found": self.found,
            "ranking": [r.to_json() for r in self.ranking],
            "confusable_with": [e for e in same if e not in self.found],
            "not_identifiable": [{"effect": e, "why": w} for e, w in self.not_identifiable],
            "unexplained": {
                "depends_on": rest.depends_on,
                "share": rest.share,
                "formula": rest.formula,
                "p0": rest.coefficient if rest.term else None,
                "equation": rest.equation,
            },
            "steps": [{"effect": e, "score_heldout": s} for e, s in self.steps],
            "next_experiment": self.next_experiment,
            "time_base": [
                {"log": r.measurement.log_name, **r.measurement.time_base.to_json()}
                for r in self.before.robots
                if getattr(r.measurement, "time_base", None)
            ],
            "robots": [r.to_json() for r in self.robots],
            "apart": self.apart.to_json() if self.apart else None,
            "robots_off": [r.to_json() for r in self.robots_off],
            "runs_off": [{"log": r.log_name, **r.to_json()} for r in self.runs_off],
            "camera": [f.to_json() for f in self.camera],
            "bits": self.detections.to_json() if self.detections else None,
            "bits_after": self.detections_after.to_json() if self.detections_after else None,
            "bit_steps": [{"effect": e, "score_heldout": s} for e, s in self.detection_steps],
            "notes": self.notes,
            "warnings": self.before.warnings,
            "settings": asdict(self.search.settings),
            "floor_settings": asdict(FLOOR_SETTINGS),
            "check_settings": asdict(CHECKS),
            "passes": self.search.passes,
        }
