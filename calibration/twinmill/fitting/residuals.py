# SPDX-License-Identifier: Apache-2.0
"""Residuals of each prediction, in its own unit."""

from dataclasses import dataclass

import numpy as np

from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.compare import RobotComparison
from twinmill.predict import steady_states, windows
from twinmill.predict.datasets import Trajectory
from twinmill.predict.steady_errors import SteadyComparison
from twinmill.predict.steady_states import SteadyStates


@dataclass(frozen=True)
class Residuals:
    """Measured less predicted, of one robot in one log or table.

    Attributes:
        log_name, robot_id: whose they are.
        start_s: (W,) when predictions start, capture's clock; NaN in a table.
        horizon_s: (H,) how far they go; NaN in a table.
        channels: C names with their units.
        measured: (W, H, C) displacements seen from the start, or what a table tells.
        errors: (W, H, C); NaN where there is none that is judged.
        floor: (W, H, C) errors that count as one.
    """

    log_name: str
    robot_id: int
    start_s: np.ndarray
    horizon_s: np.ndarray
    channels: tuple[tuple[str, str], ...]
    measured: np.ndarray
    errors: np.ndarray
    floor: np.ndarray

    @classmethod
    def of(cls, robot: RobotComparison | SteadyComparison) -> "Residuals":
        """Residuals of one robot that a model was compared with."""
        name, errors = robot.measurement.log_name, robot.errors
        if isinstance(robot, SteadyComparison):
            nothing = np.full(len(errors), np.nan)
            parts = (robot.predicted + errors, errors, robot.modelled.floor())
            return cls(
                *(name, robot.robot_id, nothing, np.array([np.nan])),
                tuple(robot.modelled.channels),
                *(part[:, None] for part in parts),
            )
        track, own = robot.measurement.track, robot.windows
        return cls(
            *(name, robot.robot_id, track.pose_t_s[own.starts], np.array(windows.HORIZONS_S)),
            windows.CHANNELS,
            own.measured(robot.measurement),
            errors,
            np.broadcast_to(robot.floor.rms, errors.shape),
        )

    def columns(self) -> dict[str, np.ndarray | str | int]:
        """Columns of a table with a row for each error."""
        known = np.isfinite(self.errors)
        start, horizon, channel = np.nonzero(known)
        names, units = np.array(self.channels).T
        return {
            "log": self.log_name,
            "robot_id": self.robot_id,
            "t_s": self.start_s[start],
            "horizon_s": self.horizon_s[horizon],
            "channel": names[channel],
            "unit": units[channel],
            "measured": self.measured[known],
            "predicted": self.measured[known] - self.errors[known],
            "residual": self.errors[known],
            "floor": self.floor[known],
        }


def residuals_of(fit: ScoreFit) -> list[Residuals]:
    """Residuals of each data set of a finished fit."""
    found: list[Residuals] = []
    for data, model, rows in zip(fit.datasets, fit.models, fit.state[0], strict=True):
        if isinstance(data, Trajectory):
            errors = data.as_errors(rows)
            floor, measured = np.broadcast_to(data.floor, errors.shape), data.measured
            start_s, horizon_s = data.start_s, np.array(windows.HORIZONS_S)
            channels = windows.CHANNELS
        elif isinstance(data, SteadyStates):
            own = data.fitted(model)
            errors, floor = own.errors()[:, None], data.floor()[:, None]
            measured = errors + own.predicted()[:, None]
            start_s, horizon_s = np.full(len(errors), np.nan), np.array([np.nan])
            channels = steady_states.CHANNELS
        else:
            raise TypeError(f"{data.label}: has no errors in a unit of its own.")
        name = data.measurement.log_name
        told = (measured, errors, floor)
        found.append(Residuals(name, data.robot_id, start_s, horizon_s, tuple(channels), *told))
    return found
