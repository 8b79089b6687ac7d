# SPDX-License-Identifier: Apache-2.0
"""A measurement together with the model that is to explain it, its clock and its noise."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import command_at
from twinmill.model.parameters import CLOCK, stated_names, take_alignment
from twinmill.predict.flexible import unexplained
from twinmill.predict.noise import Noise, fit_noise
from twinmill.predict.residual import StepGrid

LEAST_SPEED_MPS = 1e-3  # below it a robot stands


@dataclass
class ModelledLog:
    """One robot in one log with the model of that robot on its clock, step grid and noise.

    Attributes:
        clock_free: the clock's offset was found from this log itself.
    """

    measurement: Measurement
    model: native.Model
    grid: StepGrid
    clock_free: bool
    noise: Noise | None = None

    @property
    def known_noise(self) -> Noise:
        """The noise, which every maker of a log settles."""
        assert self.noise is not None
        return self.noise

    @property
    def stated(self) -> set[str]:
        """Names that the model file states of this robot alone: no fit of all robots moves them."""
        return stated_names(self.model, self.measurement.track.robot_id)

    @classmethod
    def on_clock(
        cls, measurement: Measurement, model: native.Model, clock_free: bool
    ) -> "ModelledLog":
        """A log with a robot's own model on the measurement's clock, and the noise in the log."""
        modelled = cls(measurement, model, StepGrid.of(measurement), clock_free)
        modelled.noise = fit_noise(
            unexplained(measurement, modelled.grid, model.get(CLOCK)),
            modelled._moving(),
            modelled.grid,
        )
        modelled.settle_noise()
        return modelled

    def with_model(self, model: native.Model) -> "ModelledLog":
        """A copy with another model; measurement, clock and noise stay."""
        model = model.for_robot(self.measurement.track.robot_id)
        take_alignment(model, self.model)
        return replace(self, model=model)

    def fitted(self, model: native.Model) -> "ModelledLog":
        """A copy with a model of its own robot that was fitted to it, its clock included."""
        modelled = replace(self, model=model)
        modelled.settle_noise()
        return modelled

    def errors(self) -> np.ndarray:
        """(S, 3) one-step errors of the model."""
        return self.grid.errors(
            native.one_step(self.model, self.measurement.played), self.measurement
        )

    def white_errors(self) -> np.ndarray:
        """(S, 3) the same, whitened."""
        return self.known_noise.whiten(self.errors(), self.grid)

    def settle_noise(self) -> None:
        """Takes the noise that the model leaves, if it leaves less than any smooth response did."""
        left = fit_noise([self.errors()], self._moving(), self.grid)
        if left.loudness(self.grid.period_s) < self.known_noise.loudness(self.grid.period_s):
            self.noise = left

    @property
    def noise_at_speed(self) -> Noise:
        """The noise, with the RMS speed at which it was seen while the robot drove."""
        pose, grid = self.measurement.track.pose, self.grid
        ends = native.one_step(self.model, self.measurement.played)[grid.source]
        way_m = np.linalg.norm(ends[:, :2] - pose[grid.origin, :2], axis=1) * grid.share
        speed_mps = way_m[way_m > LEAST_SPEED_MPS * grid.period_s] / grid.period_s
        rms_mps = np.sqrt(np.mean(speed_mps**2)) if len(speed_mps) else 0.0
        return replace(self.known_noise, speed_mps=float(rms_mps))

    def _moving(self) -> np.ndarray:
        """(S,) bool: some command is not zero."""
        track = self.measurement.track
        t_s = self.grid.t_s - self.model.get(CLOCK)
        return np.any(command_at(t_s, track.command_t_s, track.command) != 0, axis=1)

    def whitened(self, names: list[str], rows: np.ndarray) -> np.ndarray:
        """(B, P) values to (B, S, 3) whitened one-step errors."""
        predicted = native.one_step_batch(
            self.model, self.measurement.played, names, np.ascontiguousarray(rows)
        )
        return self.known_noise.whiten(self.grid.errors(predicted, self.measurement), self.grid)
