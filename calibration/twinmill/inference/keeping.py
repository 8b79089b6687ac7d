# SPDX-License-Identifier: Apache-2.0
"""Models that keep what they always miss, and the logs that are judged by that."""

from collections.abc import Sequence

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.model.model_file import ModelFile


def keeps_its_error(
    measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile
) -> bool:
    """True if the file tells what its model always misses, and one robot's logs are judged.

    Several robots are compared with each other, and tables read, by the older engine alone.
    """
    robots = {m.track.robot_id if isinstance(m, Measurement) else None for m in measurements}
    return "always" in model_file.fit and len(robots) == 1 and None not in robots
