# SPDX-License-Identifier: Apache-2.0
"""One robot, one model: what is missing, with probabilities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from twinmill.data.measurement import Measurement, of_one_robot
from twinmill.data.steady_table import SteadyTable
from twinmill.inference.always import always_of
from twinmill.inference.answer import Answer, answer
from twinmill.inference.kept import kept
from twinmill.inference.prior import Always
from twinmill.inference.problem import problem_of
from twinmill.inference.search import Search
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import table_of
from twinmill.model.model_file import ModelFile

ONE = (
    "one robot's commands and poses are judged at a time: give logs of one robot, or use diagnose, "
    "which judges several"
)


@dataclass(frozen=True)
class Inference:
    """What logs of a robot say of a model.

    Attributes:
        answer: verdict, effects and dependences with their probabilities.
        measurements: of the logs.
        always: what the model misses in its own logs, too; None where that is not known.
    """

    answer: Answer
    measurements: Sequence[Measurement]
    always: Always | None

    def to_json(self) -> dict:
        """Fields of `twinmill infer --json`."""
        kernels = self.always.kernels if self.always else ()
        return {
            **self.answer.to_json(),
            "robot_id": self.measurements[0].track.robot_id,
            "log": self.measurements[0].log_name,
            "logs": [m.log_name for m in self.measurements],
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
    """Probabilities of what a model lacks, from one robot in one log or several.

    Args:
        measurements: of the logs, which are judged together.
        model_file: the model.
        own: of the logs that the model was fitted to: what it misses there, too, is no news.
            Without them its file may tell that.
        progress: told in words what is being done.

    Raises:
        LogError: these are several robots, or tables.
        ModelError: what the file keeps cannot be read.
    """
    runs = of_one_robot(measurements, "infer: the logs hold", ONE)
    always = kept(model_file)
    if own:
        progress("what the model misses in its own log")
        always = always_of(of_one_robot(own, "infer: the model's own logs hold", ONE), model_file)
    problem = problem_of(runs, model_file, always)
    search = Search(problem, progress).run()
    return Inference(answer(table_of(search)), runs, always)
