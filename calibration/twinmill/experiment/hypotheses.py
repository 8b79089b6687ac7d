# SPDX-License-Identifier: Apache-2.0
"""Which effects the next run must part, and the model without them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill.estimation.opened import Opened
from twinmill.experiment.candidates import Candidate, candidates
from twinmill.experiment.information import CandidateEffect
from twinmill.experiment.screen import excesses
from twinmill.model.parameters import (
    Parameter,
    all_effect_parameters,
    beginning_at_a_moment,
    catalogue_of,
)
from twinmill.predict.modelled_log import ModelledLog

MOST_NAMED = 5  # effects in a sentence
WEAKEST = 4  # effects that show least, where nothing else is in question


@dataclass(frozen=True)
class State:
    """Logs and tables with the model so far, what is free of it, and (H, 3) floors of the logs."""

    logs: list[ModelledLog]
    free: list[Parameter]
    floors: list[np.ndarray]


@dataclass(frozen=True)
class Hypotheses:
    """Effects in question, with the numbers that a run has to tell apart.

    Attributes:
        alike: effects that the diagnosis could not tell apart.
        named: effects that it named; in question if another could imitate one of them after all.
        closest: the two most probable, for want of other questions.
        state: of the diagnosis, the effects alike or named taken out and the rest refitted; free
            is all of the base that the next run may show.
        fitted: parameters by effect, of those that the logs tell.
    """

    alike: list[str]
    named: list[str]
    closest: list[str]
    state: State
    fitted: dict[str, dict[str, float]]


def hypotheses_of(found: Inference | Fleet, base: list[Parameter]) -> Hypotheses:
    """Effects that are neither sure nor ruled out are alike; else those named are in question.

    Args:
        found: diagnosis of the logs so far.
        base: of the model, also what these logs cannot tell.
    """
    answer, once = found.answer, beginning_at_a_moment()  # another run cannot show the latter
    unsure = [name for name in answer.open if name not in once]
    sure = [f.effect for f in answer.findings if f.certainty == "sure" and f.effect not in once]
    alike = unsure if len(unsure) > 1 else []
    return Hypotheses(
        alike,
        [] if alike else [*sure, *unsure],
        [*answer.effects][:2],
        _state(found.opened, found.opened[0].model, base),
        {f.effect: {name: v for name, (v, _) in f.numbers.items()} for f in answer.findings},
    )


def question(
    asked: Hypotheses, known: list[CandidateEffect], margins: np.ndarray, least_chi2: float
) -> tuple[list[str], str]:
    """Names of the effects in question, and a sentence.

    Args:
        asked: what the diagnosis leaves open.
        known: all effects.
        margins: (T, 1 + J) of the logs so far, over their scatter.
        least_chi2: a smaller margin decides nothing.
    """
    names = [s.name for s in known]
    if asked.alike:
        return asked.alike, f"These logs cannot tell {_from(asked.alike)}."
    doubtful = []
    for effect in (n for n in asked.named if n in names):
        rivals = np.flatnonzero(margins[names.index(effect), 1:] < least_chi2)
        doubtful += [effect, *(names[j] for j in rivals)] if len(rivals) else []
    if doubtful:
        doubtful = list(dict.fromkeys(doubtful))
        return doubtful, f"These logs hardly tell {_from(doubtful)}."
    if len(asked.closest) > 1:
        first, second = asked.closest
        return (
            asked.closest,
            f"These logs tell all effects apart; closest were {first} and {second}.",
        )
    weakest = [names[i] for i in np.argsort(margins.min(axis=-1))[:WEAKEST]]
    return weakest, f"These logs tell all effects apart; least {', '.join(weakest)}."


def candidate_effects(
    logs: list[ModelledLog], planned: ModelledLog, *, state: State, asked: Hypotheses, usual: float
) -> list[CandidateEffect]:
    """Effects between which the planned run may have to decide, each as one step of its strength.

    Args:
        logs: recorded so far, with the model that lacks the effects in question.
        planned: the run to be judged, with predicted poses in the place of measured ones.
        state: the logs with the parameters that are refitted beside each effect.
        asked: effects in question, with their fitted strengths.
        usual: score that predictions of this model usually have; errors of the planned run are
            taken to scatter by this factor over the noise at least.

    Returns:
        All effects that change a prediction of the logs or of the planned run, each from neutral to
        its fitted strength, or to the default on its card where it was not fitted.
    """
    shown, _ = candidates([*logs, planned])
    without = [s.white_errors() for s in logs]
    found = [(candidate, candidate.columns(logs, without)) for candidate, _ in shown]
    cards = catalogue_of(logs[0].model)
    return [
        CandidateEffect(c, _whole(cards[c.effect], asked.fitted), max(excess, usual**2))
        for (c, _), excess in zip(found, excesses(logs, state.free, found), strict=True)
    ]


def _whole(card: dict[str, Any], fitted: dict[str, dict[str, float]]) -> Candidate:
    """The one step from neutral to the effect's strength, by its card of such a robot."""
    parameters = card["parameters"]
    values = fitted.get(card["name"], {})
    return Candidate(
        card["name"],
        tuple(p["name"] for p in parameters),
        tuple(p["neutral"] for p in parameters),
        (tuple(values.get(p["name"], p["default"]) for p in parameters),),
        np.ones(1),
        True,
    )


def _state(opened: Sequence[Opened], model: native.Model, base: list[Parameter]) -> State:
    logs = [
        (log.with_model(model), o.floor.rms)
        for o in opened
        if o.floor and o.data is not None and isinstance(log := o.modelled(), ModelledLog)
    ]
    free = [p.at(model.get(p.name)) for p in [*base, *all_effect_parameters(model)]]
    return State([log for log, _ in logs], free, [rms for _, rms in logs])


def _from(names: list[str]) -> str:
    """`a from b from c`; of many the first, and how many more."""
    more = len(names) - MOST_NAMED
    return " from ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
