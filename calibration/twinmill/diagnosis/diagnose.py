# SPDX-License-Identifier: Apache-2.0
"""Diagnosis of whatever was measured: one robot or several of a kind, or tables."""

from collections.abc import Callable, Collection, Sequence

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis.fleet import Fleet, judge_fleet
from twinmill.diagnosis.infer import Inference, infer
from twinmill.model.model_file import ModelFile


def diagnose(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    own: Sequence[Measurement | SteadyTable] = (),
    progress: Callable[[str], None] = lambda _: None,
    *,
    without: Collection[str] = (),
) -> Inference | Fleet:
    """Probabilities of what a model lacks.

    Args:
        measurements: of one robot, or of several.
        model_file: the model of all of them.
        own: of the logs that the model was fitted to; see `infer`.
        progress: told in words what is being done.
        without: effects that do not compete.

    Raises:
        LogError: these cannot be judged.
        ModelError: what the file keeps cannot be read.
    """
    robots = {m.track.robot_id for m in measurements if isinstance(m, Measurement)}
    judge = judge_fleet if len(robots) > 1 else infer
    return judge(measurements, model_file, own, progress, without=without)
