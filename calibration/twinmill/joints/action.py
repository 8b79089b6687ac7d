# SPDX-License-Identifier: Apache-2.0
"""Inputs of MuJoCo in a log, which effects change, and what is usual in it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.joints.series import Series, lagged

SLOW = 0.02  # of a joint's usual speed, below which its direction is soft


@dataclass(frozen=True)
class Usual:
    """Motion and forces of the base in a log.

    Attributes:
        torque: (n, J) forces of its actuators.
        load: (J,) root mean square of the force on each joint.
        speed, reach: (J,) root mean square velocity, and range of positions.
        command: (U,) root mean square command, about a servo's position.
        gives: (n, J) momentum that a joint takes from a small force: 0 where friction holds it.
        slides: (W, J) 1 for steps in which a joint neither turns back nor is held by friction, were
            that more by an effect of usual size; 0 for others, which say nothing: friction is
            anything up to its limit there.
    """

    torque: np.ndarray
    load: np.ndarray
    speed: np.ndarray
    reach: np.ndarray
    command: np.ndarray
    gives: np.ndarray
    slides: np.ndarray

    def sign(self, v: np.ndarray, d: int) -> np.ndarray:
        """(n,) direction of a joint's motion, soft near standstill."""
        return np.tanh(v[:, d] / (SLOW * self.speed[d]))


@dataclass
class Action:
    """Inputs of MuJoCo, for effects to change.

    Attributes:
        series: of the log.
        usual: forces and velocities of the base, see `Usual`; None while these are looked for.
        model: MuJoCo's.
        q, v: (n, J) measured states.
        late_s, lag_s: (U,) of commands.
        shapes: actuator, and what becomes of its command (n,), in turn.
        force: (n, J) forces of effects.
    """

    series: Series
    usual: Usual | None
    model: Any
    q: np.ndarray
    v: np.ndarray
    late_s: np.ndarray
    lag_s: np.ndarray
    shapes: list[tuple[int, Any]]
    force: np.ndarray

    def commands(self) -> np.ndarray:
        """(n, U) commands once they are late, slow and shaped."""
        ctrl = self.series.commands(self.late_s)
        for a, lag_s in enumerate(self.lag_s):
            if lag_s > 0:
                for run in self.series.runs:
                    ctrl[run, a] = lagged(ctrl[run, a], lag_s, self.series.width_s[0])
        for a, shape in self.shapes:
            ctrl[:, a] = shape(ctrl[:, a])
        return ctrl
