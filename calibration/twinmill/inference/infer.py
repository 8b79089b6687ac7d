# SPDX-License-Identifier: Apache-2.0
"""One log, one model: what is missing, with probabilities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.inference.always import always_of
from twinmill.inference.answer import Answer, answer
from twinmill.inference.prior import Always
from twinmill.inference.problem import problem_of
from twinmill.inference.search import Search
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import table_of
from twinmill.model.model_file import ModelFile


@dataclass(frozen=True)
class Inference:
    """What a log says of a model.

    Attributes:
        answer: verdict, effects and dependences with their probabilities.
        measurement: of the log.
        always: what the model misses in its own log, too; None where that log was not given.
    """

    answer: Answer
    measurement: Measurement
    always: Always | None

    def to_json(self) -> dict:
        """Fields of `twinmill infer --json`."""
        kernels = self.always.kernels if self.always else ()
        return {
            **self.answer.to_json(),
            "robot_id": self.measurement.track.robot_id,
            "log": self.measurement.log_name,
            "always": {
                "effects": list(self.always.effects) if self.always else [],
                "depends_on": [{"name": name, "size": size} for name, size in kernels],
            },
            "settings": {name: value for name, value, _ in PRIORS.listed()},
        }


def infer(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Inference:
    """Probabilities of what a model lacks, from one robot in one log.

    Args:
        measurements: of the log.
        model_file: the model.
        own: of the log that the model was fitted to: what it misses there, too, is no news.
        progress: told in words what is being done.

    Raises:
        LogError: these are several robots or logs, or a table.
    """
    measurement = _single(measurements, "the log")
    always = None
    if own:
        progress("what the model misses in its own log")
        always = always_of(_single(own, "the model's own log"), model_file)
    problem = problem_of(measurement, model_file, always)
    search = Search(problem, progress).run()
    return Inference(answer(table_of(search)), measurement, always)


def _single(measurements: Sequence[Measurement | SteadyTable], what: str) -> Measurement:
    if len(measurements) != 1 or not isinstance(measurements[0], Measurement):
        of = "a table of steady speeds" if len(measurements) == 1 else f"{len(measurements)} robots"
        raise LogError(
            f"infer: {what} holds {of}, and one robot's commands and poses are judged at a time; "
            "give a log of one robot, or use diagnose, which judges several."
        )
    return measurements[0]
