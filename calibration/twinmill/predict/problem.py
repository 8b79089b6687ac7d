# SPDX-License-Identifier: Apache-2.0
"""A measurement together with the model that is to explain it, its clock and its noise."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.clock import estimate_offset
from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.track import command_at
from twinmill.predict.flexible import unexplained
from twinmill.predict.noise import Noise, fit_noise
from twinmill.predict.residual import StepGrid

CLOCK, CLOCK_RATE = "clock.offset_s", "clock.rate_ppm"
GAINS = ("theta_a1", "theta_a2")  # of one robot: speed, and rate of turn


@dataclass
class Scene:
    """One measurement with the model of its own robot and clock, its step grid and its noise.

    Attributes:
        clock_free: offset and rate of the clock are fitted.
        gains_free: the robot's own gains are fitted: robots of a kind differ by a few percent.
    """

    measurement: Measurement
    model: native.Model
    grid: StepGrid
    clock_free: bool
    noise: Noise | None = None
    gains_free: bool = False

    @property
    def stated(self) -> set[str]:
        """Names that the model file states of this robot alone: no fit of all robots moves them."""
        return stated_names(self.model, self.measurement.track.robot_id)

    @classmethod
    def of(
        cls,
        measurement: Measurement,
        model: native.Model,
        clock_free: bool,
        offset_s: float | None = None,
    ) -> "Scene":
        """Starts from the offset given, else the model's if it is known there, else the log's own.

        Raises:
            LogError: the log's own cannot be told.
        """
        own = model.for_robot(measurement.track.robot_id)
        alone_s = _own_offset(measurement, needed=offset_s is None and not own.clock_known)
        if offset_s is not None:
            own.set(CLOCK, offset_s)
        elif not own.clock_known:
            own.set(CLOCK, alone_s)
        scene = cls(measurement, own, StepGrid.of(measurement), clock_free)
        scene.noise = scene._own_noise(own.get(CLOCK) if alone_s is None else alone_s)
        scene.settle_noise()
        return scene

    def with_model(self, model: native.Model) -> "Scene":
        """The same measurement, clock and noise with another model."""
        model = model.for_robot(self.measurement.track.robot_id)
        for name in (CLOCK, CLOCK_RATE, *(GAINS if self.gains_free else ())):
            model.set(name, self.model.get(name))
        return replace(self, model=model)

    def errors(self) -> np.ndarray:
        """(S, 3) one-step errors of the scene's model."""
        return self.grid.errors(
            native.one_step(self.model, self.measurement.played), self.measurement
        )

    def white_errors(self) -> np.ndarray:
        """(S, 3) the same, whitened."""
        return self.noise.whiten(self.errors(), self.grid)

    def settle_noise(self) -> None:
        """Takes the noise that the model leaves, if it leaves less than any smooth response did."""
        left = fit_noise([self.errors()], self._moving(), self.grid)
        if left.loudness(self.grid.period_s) < self.noise.loudness(self.grid.period_s):
            self.noise = left

    def _moving(self) -> np.ndarray:
        """(S,) bool: some command is not zero."""
        track = self.measurement.track
        t_s = self.grid.t_s - self.model.get(CLOCK)
        return np.any(command_at(t_s, track.command_t_s, track.command) != 0, axis=1)

    def _own_noise(self, offset_s: float) -> Noise:
        """Noise of the log, whatever the model: what no response to the commands explains.

        By the log's own clock: with a wrong one from elsewhere all motion would count as noise.
        """
        errors = unexplained(self.measurement, self.grid, offset_s)
        return fit_noise(errors, self._moving(), self.grid)

    def whitened(self, names: list[str], rows: np.ndarray) -> np.ndarray:
        """(B, P) values to (B, S, 3) whitened one-step errors."""
        predicted = native.one_step_batch(
            self.model, self.measurement.played, names, np.ascontiguousarray(rows)
        )
        return self.noise.whiten(self.grid.errors(predicted, self.measurement), self.grid)


def _own_offset(measurement: Measurement, needed: bool) -> float | None:
    """What the log itself tells; None if it tells none and need not."""
    try:
        return estimate_offset(measurement.track).offset_s
    except LogError:
        if needed:
            raise
        return None


def stated_names(model: native.Model, robot_id: int) -> set[str]:
    """Quantities, by name, that [robots.Rnn] states of one robot."""
    keys = model.stated_of(robot_id)
    return {k if "." in k or k in GAINS else f"base.{k}" for k in keys}
