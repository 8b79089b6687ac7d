# SPDX-License-Identifier: Apache-2.0
"""One robot, one model: what is missing, with probabilities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
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
    runs, before = _by_robot(measurements), _by_robot(own)
    if len(runs) > 1:
        raise LogError(
            f"infer: the logs hold {_several(runs)}, and one robot is judged at a time; give logs "
            "of one robot, or let each be judged by itself: twinmill infer in a shell, "
            "tm.infer_robots in Python."
        )
    ((robot, of_robot),) = runs.items()
    if before and robot not in before:
        raise LogError(
            f"infer: the model's own logs hold {_several(before)}, and not R{robot:02d}, which is "
            "judged; give own logs of that robot, or none."
        )
    always = kept(model_file)
    if before:
        progress("what the model misses in its own log")
        always = always_of(before[robot], model_file)
    problem = problem_of(of_robot, model_file, always)
    search = Search(problem, progress).run()
    return Inference(answer(table_of(search)), of_robot, always)


def infer_robots(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> list[Inference]:
    """`infer` for each robot of the logs by itself, in the order of their numbers.

    Args:
        measurements: of the logs.
        model_file: the model of all of them.
        own: of the logs that it was fitted to, with one robot at least; what it misses of a robot
            that is not among these is not known.
        progress: told in words what is being done.

    Raises:
        LogError: these are tables.
        ModelError: what the file keeps cannot be read.
    """
    runs, before = _by_robot(measurements), _by_robot(own)
    known = runs.keys() & before.keys()
    found = []
    for k, (robot, of_robot) in enumerate(runs.items()):
        of = f"R{robot:02d} ({k + 1} of {len(runs)}), " if len(runs) > 1 else ""
        own_logs = before.get(robot, []) if known else own
        found.append(infer(of_robot, model_file, own_logs, lambda s, of=of: progress(of + s)))
    return found


def _by_robot(measurements: Sequence[Measurement | SteadyTable]) -> dict[int, list[Measurement]]:
    """Runs of each robot, in the order of their numbers.

    Raises:
        LogError: there are tables.
    """
    runs = [m for m in measurements if isinstance(m, Measurement)]
    if len(runs) < len(measurements):
        raise LogError(
            "infer: these hold a table of steady speeds, and commands and poses are judged; give "
            "logs, or use diagnose, which judges tables."
        )
    robots = sorted({m.track.robot_id for m in runs})
    return {n: [m for m in runs if m.track.robot_id == n] for n in robots}


def _several(runs: dict[int, list[Measurement]]) -> str:
    first, last = min(runs), max(runs)
    return f"{len(runs)} robots (R{first:02d} to R{last:02d})" if len(runs) > 1 else f"R{first:02d}"
