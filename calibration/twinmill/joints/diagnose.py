# SPDX-License-Identifier: Apache-2.0
"""Effects that an MJCF lacks, by the evidence of a log, with their cards."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twinmill.inference.answer import RobotAnswer, answer
from twinmill.inference.search import Evidence, Search
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import table_of
from twinmill.joints.always import Always, always_of
from twinmill.joints.checks import check_units, warnings_of
from twinmill.joints.files import read_joint_log
from twinmill.joints.log import JointLog, joined
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.plant import Plant
from twinmill.joints.problem import JointProblem, begun, problem_of
from twinmill.joints.series import Series, series_of

Logs = JointLog | Path | str | Sequence[JointLog | Path | str]


@dataclass(frozen=True)
class JointDiagnosis:
    """Answer of a log about an MJCF.

    Attributes:
        answer: verdict, effects and dependences with their probabilities.
        problem: that was solved.
        fitted: sets of effects that were fitted.
        warnings: what is odd about the log, in sentences.
        always: what the model lacks in its own log, too; None where that is not known.
    """

    answer: RobotAnswer
    problem: JointProblem
    fitted: Mapping[tuple[str, ...], Evidence]
    warnings: tuple[str, ...]
    always: Always | None = None

    @property
    def mjcf(self) -> Mjcf:
        """The model that was judged."""
        return self.problem.plant.mjcf

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill diagnose --json` of an MJCF."""
        told = self.answer.to_json()
        for finding in told["findings"]:
            card = self.problem.effects[finding["effect"]]
            units = {n.key: n.unit for n in card.parameters}
            finding |= {"summary": card.summary, "equation": card.equation}
            finding |= {"in": card.held_in, "in_mjcf": card.held_in == "mjcf"}
            for p in finding["parameters"]:
                p["unit"] = units[p["name"]]
        return {
            **told,
            "log": self.problem.plant.series.log.name,
            "joints": list(self.mjcf.joints),
            "actuators": list(self.mjcf.actuators),
            "warnings": list(self.warnings),
            "always": list(self.always.effects) if self.always else [],
            "in_hook": [name for name, _ in self.mjcf.hook],
            "settings": {name: value for name, value, _ in PRIORS.listed()},
        }


def diagnose_joints(
    log: Logs,
    model: Mjcf | Path | str,
    progress: Callable[[str], None] = lambda _: None,
    *,
    own: Logs | None = None,
) -> JointDiagnosis:
    """Probabilities of what an MJCF lacks, from a log of its joints and commands.

    Args:
        log: arrays, or a file of them; or several of one machine, which are judged together.
        model: opened, or its path.
        progress: told in words what is being done.
        own: log, or several, that the model was made with: what it lacks there, too, is no news.

    Raises:
        LogError: a log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.
    """
    mjcf = model if isinstance(model, Mjcf) else Mjcf.load(model)
    before = None
    if own:
        progress("what the model lacks in its own log")
        before = always_of(_searched(plant_of(own, mjcf)[0], None, progress))
    plant, warnings = plant_of(log, mjcf)
    progress("what the model predicts")
    search = _searched(plant, before, progress)
    assert isinstance(search.problem, JointProblem)
    found = answer(table_of(search))
    return JointDiagnosis(found, search.problem, search.fitted, warnings, before)


def _searched(plant: Plant, always: Always | None, progress: Callable[[str], None]) -> Search:
    """A search in a run of the model, then in one with what that found, if it is nearer."""
    model = None
    if plant.mjcf.hook or (always and always.effects):
        _, model, _ = begun(plant, always)
        plant = plant.about(model.act)
    search = Search(problem_of(plant, model, always), progress).run()
    (likely, *_) = search.likely()
    if not likely:
        return search
    model = search.fitted[likely].hypothesis.model
    nearer = plant.about(model.act)
    if nearer.is_farther_than(plant):
        return search
    progress("again, from a run with what was found")
    return Search(problem_of(nearer, model, always), progress).run()


def plant_of(logs: Logs, mjcf: Mjcf) -> tuple[Plant, tuple[str, ...]]:
    """MuJoCo at the states of a log, or of several of one machine, and what is odd about them."""
    given = [logs] if isinstance(logs, JointLog | Path | str) else logs
    each = [log if isinstance(log, JointLog) else read_joint_log(Path(log)) for log in given]
    log = joined([one.ordered(mjcf.joints, mjcf.actuators) for one in each])
    check_units(log, mjcf)
    series = series_of(log)
    return Plant.of(mjcf, series), (*warnings_of(log, mjcf), *_of_speeds(log, series, mjcf))


def _of_speeds(log: JointLog, series: Series, mjcf: Mjcf) -> list[str]:
    """Says which velocities of the robot are not those of its positions."""
    if log.qvel is None:
        return []
    found = []
    for d, name in enumerate(mjcf.joints):
        told = np.interp(series.t_s, log.t_s, log.qvel[:, d])
        factor = float(told @ series.v[:, d] / max(series.v[:, d] @ series.v[:, d], 1e-300))
        if not 0.8 < factor < 1.25:
            found.append(
                f"qvel of '{name}' is {factor:.3g} times the slope of its positions; it is not "
                "used."
            )
    return found
