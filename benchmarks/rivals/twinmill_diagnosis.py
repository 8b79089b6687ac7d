# SPDX-License-Identifier: Apache-2.0
"""Twinmill itself: `twinmill explain`, as any user gets it."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rivals.protocol import DOCUMENTED, Answer, Problem, Rival, predicted_by
from twinmill.diagnosis.explain import explain
from twinmill.model.model_file import ModelFile

NAMED = ("effect_missing", "ambiguous")


def answers(problem: Problem) -> dict[str, Answer]:
    """Its diagnosis, and the model that it writes."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "explained.toml"
        found = explain([problem.measurement], problem.file, out=path, command="")
        model = ModelFile.load(str(path)).model
    said: dict[str, Any] = found.to_json()
    told = said["verdict"] in (*NAMED, "outside_catalogue")
    own = model.for_robot(problem.measurement.track.robot_id)
    answer = Answer(told, found.diagnosis.before.score, predicted_by(own), said=said)
    return {DOCUMENTED: answer}


RIVAL = Rival(
    name="Twinmill",
    source="twinmill explain",
    settings={DOCUMENTED: "no option is given; predicts with the model that it writes"},
    answers=answers,
)
