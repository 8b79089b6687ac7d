# SPDX-License-Identifier: Apache-2.0
"""Models that keep what they always miss, and the logs of which that is known."""

from collections.abc import Sequence

import tomlkit

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.model.model_file import ModelFile


def is_own(measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile) -> bool:
    """True if one of these logs told what the model always misses."""
    told = {*model_file.fit.get("always", {}).get("logs", ())}
    return any(m.log_sha256 in told for m in measurements)


def with_its_error(
    model_file: ModelFile, measurements: Sequence[Measurement | SteadyTable]
) -> ModelFile:
    """A fitted model's file with what it misses in the logs that it was fitted to.

    Itself where these are of several robots or tables.
    """
    logs = [m for m in measurements if isinstance(m, Measurement)]
    if len(logs) < len(measurements) or len({m.robot_id for m in logs}) != 1:
        return model_file
    from twinmill.inference.always import always_of  # slow to import, for who fits alone
    from twinmill.inference.kept import as_table

    document = tomlkit.parse(model_file.text)
    found = as_table(always_of(logs, model_file), [m.log_sha256 for m in logs])
    document.setdefault("fit", tomlkit.table())["always"] = found
    return ModelFile.of(model_file.path, tomlkit.dumps(document))
