# SPDX-License-Identifier: Apache-2.0
"""Orders effects by what they explain on held-out data, and groups those that look alike."""

from dataclasses import dataclass

import numpy as np

from twinmill.diagnosis.screen import Screening
from twinmill.diagnosis.search import CLOCK_OFF, DELAY, TIE_CHI2, Judged, Round, Search
from twinmill.model.freedom import Estimate

ALIKE = 0.9  # share of a signature that another effect imitates (0.95 as a correlation)
FAINT_CHI2 = 2 * TIE_CHI2  # of what is not imitated: the difference is often no more than that


@dataclass(frozen=True)
class Ranked:
    """One effect of the ranking.

    Attributes:
        score_heldout: of the model with it, on drives it was not fitted to.
        share_explained: of all that could be explained.
        p_value: of the screening, corrected for all candidates.
        evidence: log of the tempered held-out likelihood ratio.
        group: number shared by effects that the log cannot tell apart; None if it can.
    """

    effect: str
    score_heldout: float
    share_explained: float
    p_value: float
    evidence: float
    parameters: list[Estimate]
    group: int | None

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {**vars(self), "parameters": [e.to_json() for e in self.parameters]}


def rank(
    done: Search, names: list[str], explainable: float, floors: list[np.ndarray]
) -> list[Ranked]:
    """Found effects in the order of acceptance with their rivals, then the first round's rest."""
    ranking: list[Ranked] = []
    group = 0
    for this in done.rounds:
        if this.accepted is None or not set(this.accepted.trial.effects) & set(names):
            continue
        same = _tied(this)
        number = None
        if same:
            group += 1
            number = group
        for judged in [this.accepted, *same]:
            ranking += _entries(judged, this, explainable, floors, number)
    seen = {r.effect for r in ranking}
    for judged in done.rounds[0].judged:
        if len(judged.trial.effects) == 1 and judged.trial.effects[0] not in seen:
            ranking += _entries(judged, done.rounds[0], explainable, floors, None)
    return ranking


def groups_of(ranking: list[Ranked], names: list[str]) -> list[str]:
    """The found effects and all that cannot be told from them."""
    numbers = {r.group for r in ranking if r.effect in names and r.group is not None}
    return [r.effect for r in ranking if r.effect in names or r.group in numbers]


def _entries(
    judged: Judged, this: Round, explainable: float, floors: list[np.ndarray], group: int | None
) -> list[Ranked]:
    trial = judged.trial
    gain = max(this.before.chi2 - trial.chi2, 0.0)
    share = gain / max(explainable, gain, 1e-9)
    entries = []
    for effect in trial.effects:
        own = [e for e in trial.estimates if e.name.split(".")[0].split("#")[0] == effect]
        entries.append(
            Ranked(
                effect,
                trial.held.over(floors),
                float(share),
                judged.p_value,
                judged.evidence,
                own,
                group,
            )
        )
    return entries


def _tied(this: Round) -> list[Judged]:
    """Other trials of the round that do as well, and do not do it by another trace.

    One that could imitate the other is enough: of an effect with many parameters a part of what is
    fitted is noise, which one with few cannot imitate. What it cannot may be too faint to tell by.
    """
    accepted = this.accepted
    assert accepted is not None
    if len(accepted.trial.effects) > 1:
        return []
    own = _index(this.screening, accepted.trial.effects[0])
    tied = []
    for judged in this.judged:
        if judged is accepted or len(judged.trial.effects) > 1:
            continue
        if (*accepted.trial.effects, *judged.trial.effects) == (DELAY, CLOCK_OFF):
            continue  # the clocks are known, as far as a log can tell them
        other = _index(this.screening, judged.trial.effects[0])
        excess = max(this.screening.found[own].excess, this.screening.found[other].excess)
        close = judged.trial.chi2 - accepted.trial.chi2 < TIE_CHI2 * excess
        same = [this.screening.imitation(i, j) for i, j in ((own, other), (other, own))]
        faint = (1 - same[0]) * this.screening.found[own].gain < FAINT_CHI2 * excess
        if close and (max(same) > ALIKE or faint):
            tied.append(judged)
    return tied


def _index(screening: Screening, effect: str) -> int:
    return next(i for i, s in enumerate(screening.found) if s.candidate.effect == effect)
