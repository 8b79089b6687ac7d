# SPDX-License-Identifier: Apache-2.0
"""Which effects the next run must part, and the model without them."""

from dataclasses import dataclass

import numpy as np
from twinmill.calibration.diagnosis.candidates import Candidate, candidates
from twinmill.calibration.diagnosis.diagnose import Diagnosis
from twinmill.calibration.diagnosis.evidence import State
from twinmill.calibration.diagnosis.ranking import Ranked
from twinmill.calibration.diagnosis.screen import screen
from twinmill.calibration.fit import refit
from twinmill.calibration.freedom import catalogue
from twinmill.calibration.next_experiment.information import Subject
from twinmill.calibration.problem import Scene

WEAKEST = 4  # effects that show least, where nothing else is in question


@dataclass(frozen=True)
class Contest:
    """What is in question.

    Attributes:
        effects: names; empty if nothing is, and then the effects that show least are taken.
        why: a sentence.
        state: of the diagnosis, the ambiguous effects taken out and the rest refitted.
        fitted: parameters by effect, of those that the logs tell.
    """

    effects: list[str]
    why: str
    state: State
    fitted: dict[str, dict[str, float]]


def contest(diagnosis: Diagnosis) -> Contest:
    """Ambiguous effects; else those that the logs cannot show; else the two most probable."""
    ranking, hidden = diagnosis.ranking, [e for e, _ in diagnosis.not_identifiable]
    top = next((r.group for r in ranking if r.group is not None), None)
    if top is not None:
        same = [r for r in ranking if r.group == top]
        names = [r.effect for r in same]
        why = f"These logs cannot tell {' from '.join(names)}."
        return Contest(names, why, _without(diagnosis, names), _values(same))
    if hidden:
        why = f"These logs cannot show {', '.join(hidden)}."
        return Contest(hidden, why, diagnosis.state, {})
    if len(ranking) > 1:
        names = [r.effect for r in ranking[:2]]
        why = f"These logs tell all effects apart; closest were {' and '.join(names)}."
        return Contest(names, why, _without(diagnosis, names), _values(ranking[:2]))
    why = "These logs would show and tell apart all effects; what shows least is made to show more."
    return Contest([], why, diagnosis.state, {})


def subjects(scenes: list[Scene], planned: Scene, state: State, asked: Contest) -> list[Subject]:
    """Every effect that the logs or the planned run show, at its fitted or its usual strength."""
    found, _ = candidates([*scenes, planned])
    tested = screen(scenes, state.free, found).found
    return [
        Subject(t.candidate, _whole(t.candidate.effect, asked.fitted), t.excess) for t in tested
    ]


def _whole(effect: str, fitted: dict[str, dict[str, float]]) -> Candidate:
    """The one step from neutral to the effect's strength."""
    parameters = catalogue()[effect]["parameters"]
    values = fitted.get(effect, {})
    return Candidate(
        effect,
        tuple(p["name"] for p in parameters),
        tuple(p["neutral"] for p in parameters),
        (tuple(values.get(p["name"], p["default"]) for p in parameters),),
        np.ones(1),
        True,
    )


def _without(diagnosis: Diagnosis, names: list[str]) -> State:
    """The diagnosis' state without these effects, the rest refitted."""
    state = diagnosis.state
    model = state.model.copy()
    for index in reversed(range(len(model.effects))):
        if model.effects[index] in names:
            model.remove_effect(index)
    reduced = State([s.with_model(model) for s in state.scenes], state.base, state.floors)
    refit(reduced.scenes, reduced.free)
    return reduced


def _values(ranked: list[Ranked]) -> dict[str, dict[str, float]]:
    """Fitted parameters by effect and short name."""
    return {r.effect: {e.name.split(".", 1)[1]: e.value for e in r.parameters} for r in ranked}
