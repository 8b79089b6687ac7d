# SPDX-License-Identifier: Apache-2.0
"""What each command does to the body, by the model's wheels: direction and usual speed."""

import numpy as np
import twinmill_native as native

from twinmill.data.log import CommandKind

DUTY, WHEEL_RADPS = 1.0, 5.0  # at which one wheel alone is tried


def body_by_command(model: native.Model | None, kind: CommandKind) -> np.ndarray | None:
    """(3, 4) forward m/s, left m/s, turn rad/s by unit of each column of a log's commands.

    Velocity commands need no wheels. None where the model is for another kind of command.
    """
    if kind == "twist":
        return np.eye(3, 4)
    if model is None or model.drive != kind:
        return None
    size = DUTY if kind == "duty" else WHEEL_RADPS
    steady = native.steady(model, np.ascontiguousarray(size * np.eye(4)), [], np.empty((0, 0)))
    return steady.reshape(4, -1)[:, :3].T / size


def columns_in_use(body: np.ndarray) -> int:
    """How many columns move the robot: four wheels, or three where the fourth is unused."""
    return 3 if not np.any(body[:, 3]) else 4
