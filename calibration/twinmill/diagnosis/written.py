# SPDX-License-Identifier: Apache-2.0
"""Which model `explain` writes: of several, the one that left-out data know best.

The model as given, its base refitted alone, with all that was found, with another member of each
group, and with a formula. What is of this run alone is in each of them while they are compared, and
in none that is written.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.apart import without_own
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.screening import screen
from twinmill.diagnosis.taking import Taken, doubtful_moments, taken
from twinmill.diagnosis.trials import (
    REFIT,
    State,
    Trial,
    cross_validate,
    fitted_from,
    with_base,
    with_effects,
    without_effect,
)
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    LAG,
    base_lag_is_identifiable,
    base_parameters,
    is_local,
    take_alignment,
    with_role,
)
from twinmill.predict.datasets import total_score


@dataclass(frozen=True)
class Candidate:
    """A model that may be written.

    Attributes:
        fit: of it, with what is of this run alone.
        effects: that it has beside those of the model as given.
        score: on left-out parts of all robots, those that differ from the others too.
        blocks: (B,) squared errors over the floor of left-out blocks.
        as_given: it has the numbers of the model as given.
        beyond: a formula that it has, refitted with the rest.
    """

    fit: ScoreFit
    effects: tuple[str, ...]
    score: float
    blocks: np.ndarray
    as_given: bool = False
    beyond: Taken | None = None

    def outdoes(self, other: "Candidate") -> bool:
        """True if it predicts left-out parts better: all together, and on the mean of blocks.

        A few blocks that follow no command pull the sum wherever they like.
        """
        both = np.maximum(other.blocks + self.blocks, 1e-300)
        return bool(self.score < other.score and np.mean((other.blocks - self.blocks) / both) > 0)


def best_of(candidates: Sequence[Candidate]) -> Candidate:
    """The one that none after it outdoes: of two that do as well the one that comes first."""
    best, *others = candidates
    for other in others:
        best = other if other.outdoes(best) else best
    return best


@dataclass(frozen=True)
class Candidates:
    """Models that may be written after a diagnosis.

    Attributes:
        diagnosis: with what was found.
        model_file: the model as given.
        gone: effects of this run alone that something lasting stands for.
    """

    diagnosis: Diagnosis
    model_file: ModelFile
    gone: tuple[str, ...] = ()

    @cached_property
    def given(self) -> Candidate:
        """The model with the numbers that it has."""
        free = base_parameters(self._start.model, [LAG]) if self._is_later else []
        start = replace(
            self._start,
            datasets=[without_own(d, ()) for d in self._start.datasets],
            free=tuple(free),
        )
        trial = fitted_from(with_effects(start, self._passing), self.diagnosis.search.last)
        held = [r.score_before for r in self.diagnosis.robots_off for _ in r.models]
        score = total_score([*trial.fit.held_scores, *held])
        return Candidate(trial.fit, (), score, _blocks(trial.fit), as_given=True)

    @property
    def as_found(self) -> Candidate:
        """All that was found as the search left it, its base not fitted any more."""
        last = self.diagnosis.search.last
        return self._candidate(last.fit, self._lasting(last.state.model), last.fit)

    def refitted(self) -> Candidate:
        """Its base refitted alone."""
        start = replace(self._start, free=self.diagnosis.search.start.free)
        return self.of(fitted_from(with_effects(start, self._passing), self.diagnosis.search.last))

    def of(self, trial: Trial) -> Candidate:
        """All effects of a trial and the base fitted to the score, never to a worse one held out.

        So that a later diagnosis knows what these logs told of the base, found stale or not.
        """
        fit, held = with_base(trial, self.diagnosis.base_names)
        return self._candidate(fit, self._lasting(trial.state.model), held)

    def others_of_groups(self) -> Iterator[Candidate]:
        """All that was found, with another member of a group in the place of the one told first."""
        last = self.diagnosis.search.last
        for finding in self.diagnosis.findings:
            if finding.effect in (REFIT, *self.diagnosis.passing) or not finding.group:
                continue
            less = without_effect(last, finding.effect)
            for name in finding.group[1:] if less else ():
                if name in (REFIT, *last.state.model.effects) or with_role(name, "moment"):
                    continue
                (there,) = screen(less, names=[name])
                yield self.of(cross_validate(less, (name,), there.start))

    def with_formula(self, own: Candidate, proven: Formula) -> Candidate:
        """One with a formula beside what it has, refitted with it; without what that replaces."""
        told = self.diagnosis
        beside = [f for f in told.findings if f.effect not in (REFIT, *proven.instead_of)]
        doubtful = [f.effect for f in beside if f.certainty == "doubtful"]
        found = taken(
            own.fit,
            proven,
            beside=[f.effect for f in beside if f.effect in doubtful or is_local(f.effect)],
            runs=len({o.measurement.log_sha256 for o in told.opened}),
            passing=doubtful_moments(told.findings, proven),
            given=told.search.rounds[0].before.fit.held_square,
        )
        kept = [n for n in own.effects if n not in found.formula.instead_of]
        return replace(self._candidate(found.fit, kept, found.fit), beyond=found)

    def _candidate(self, fit: ScoreFit, effects: Sequence[str], held: ScoreFit) -> Candidate:
        """One with the robots that differ by their own numbers."""
        off = [r.score_after for r in self.diagnosis.robots_off for _ in r.models]
        score = total_score([*held.held_scores, *off])
        return Candidate(fit, tuple(effects), score, _blocks(held))

    def _lasting(self, model: native.Model) -> list[str]:
        """Effects of a model beside those of the model as given, but for those of this run."""
        found = model.effects[len(self.model_file.model.effects) :]
        return [name for name in found if name not in self.diagnosis.passing]

    @cached_property
    def _start(self) -> State:
        """The model as given on the logs that the search saw, on the clocks found."""
        last = self.diagnosis.search.last.state
        models = [self.model_file.model.for_robot(d.robot_id) for d in last.datasets]
        for model, found in zip(models, last.models, strict=True):
            take_alignment(model, found)
        return replace(self.diagnosis.search.start, datasets=last.datasets, models=models)

    @property
    def _passing(self) -> list[str]:
        """Effects of this run alone, as often as they were found."""
        found = self.diagnosis.model.effects[len(self.model_file.model.effects) :]
        passing = {*self.diagnosis.passing} - {*self.gone}
        return [name for name in found if name in passing]

    @property
    def _is_later(self) -> bool:
        return bool(self.diagnosis.rest.events.later) and base_lag_is_identifiable(
            self.model_file.model
        )


def _blocks(fit: ScoreFit) -> np.ndarray:
    return np.concatenate(fit.block_squares)
