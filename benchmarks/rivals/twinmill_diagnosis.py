# SPDX-License-Identifier: Apache-2.0
"""Twinmill itself: `twinmill diagnose`, as any user gets it."""

from typing import Any

from rivals.protocol import DOCUMENTED, Answer, Problem, Rival, predicted_by
from twinmill.diagnosis.diagnose import diagnose

NAMED = ("effect_missing", "ambiguous")


def answers(problem: Problem) -> dict[str, Answer]:
    """Its diagnosis."""
    found = diagnose([problem.measurement], problem.file)
    said: dict[str, Any] = found.to_json()
    told = said["verdict"] in (*NAMED, "outside_catalogue")
    model = found.search.last.state.models[0]
    return {DOCUMENTED: Answer(told, found.before.score, predicted_by(model), said=said)}


RIVAL = Rival(
    name="Twinmill",
    source="twinmill diagnose",
    settings={DOCUMENTED: "no option is given; predicts with the model at the search's end"},
    answers=answers,
)
