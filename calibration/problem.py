# SPDX-License-Identifier: Apache-2.0
"""A fit: which quantities of a model are free, on which measurements, and what they predict."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native
from twinmill.calibration.clock import estimate_offset
from twinmill.calibration.flexible import unexplained
from twinmill.calibration.measurement import Measurement
from twinmill.calibration.noise import Noise, fit_noise
from twinmill.calibration.residual import StepGrid
from twinmill.calibration.track import command_at

CLOCK = "clock.offset_s"
BASE = ("base.sideways_gain", "base.yaw_gain", "base.motor_lag_s")
# Standard deviations of the weak prior on base quantities, centred on the value at the start: wide
# against what any log tells, so that only what the log does not show is held.
BASE_PRIOR = {"base.motor_lag_s": 0.3, CLOCK: 0.3}
GAIN_PRIOR = 0.5
EFFECT_PRIOR = 2  # times the distance of an effect's default from its neutral value
STEP = 0.02  # of that distance: finite differences of effects
BASE_STEP = 0.002


@dataclass(frozen=True)
class Free:
    """One free quantity.

    Attributes:
        name, unit: in the model.
        start: centre of the weak prior, and where the fit begins unless `begin` says otherwise.
        min, max: bounds.
        prior_std: width of the prior.
        step: of finite differences.
        begin: where the fit begins.
    """

    name: str
    unit: str
    start: float
    min: float
    max: float
    prior_std: float
    step: float
    begin: float | None = None


def catalogue() -> dict[str, dict]:
    """The twin's effects by name."""
    return {entry["name"]: entry for entry in native.catalogue()}


def effect_names(model: native.Model) -> list[str]:
    """Instance names of a model's effects in their order: `dead_zone`, `dead_zone#2`."""
    seen: dict[str, int] = {}
    names = []
    for name in model.effects:
        seen[name] = seen.get(name, 0) + 1
        names.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return names


def base_quantities(model: native.Model) -> list[Free]:
    """The base model's free quantities: speeds of its duty table, or a gain if it is a line."""
    values = {v["name"]: v for v in model.values()}
    table = [n for n in values if n.startswith("base.wheel_speed_mps.") and not n.endswith(".0")]
    forward = table if model.drive == "duty" and len(table) > 1 else ["base.forward_gain"]
    return [
        Free(
            n,
            values[n]["unit"],
            values[n]["value"],
            values[n]["min"],
            values[n]["max"],
            BASE_PRIOR.get(n, GAIN_PRIOR),
            BASE_STEP,
        )
        for n in (*forward, *BASE)
    ]


def effect_quantities(model: native.Model, fresh: str | None = None) -> list[Free]:
    """Free quantities of a model's effects; those of the effect `fresh` start at their defaults."""
    entries = catalogue()
    free = []
    for instance in effect_names(model):
        for p in entries[instance.split("#")[0]]["parameters"]:
            name = f"{instance}.{p['name']}"
            reach = abs(p["default"] - p["neutral"])
            start = p["default"] if instance == fresh else model.get(name)
            free.append(
                Free(
                    name,
                    p["unit"],
                    start,
                    p["min"],
                    p["max"],
                    EFFECT_PRIOR * reach,
                    min(STEP * reach, 0.05 * max(abs(p["default"]), 1e-6)),
                )
            )
    return free


@dataclass
class Scene:
    """One measurement with the model of its own robot and clock, its step grid and its noise."""

    measurement: Measurement
    model: native.Model
    grid: StepGrid
    clock_free: bool
    noise: Noise | None = None

    @classmethod
    def of(cls, measurement: Measurement, model: native.Model, clock_free: bool) -> "Scene":
        """Starts from the model's clock if it is known there, else estimates it from the log."""
        own = model.for_robot(measurement.track.robot_id)
        if not own.clock_known:
            own.set(CLOCK, estimate_offset(measurement.track).offset_s)
        scene = cls(measurement, own, StepGrid.of(measurement), clock_free)
        scene.noise = scene._own_noise()
        scene.settle_noise()
        return scene

    def with_model(self, model: native.Model) -> "Scene":
        """The same measurement, clock and noise with another model."""
        model = model.for_robot(self.measurement.track.robot_id)
        model.set(CLOCK, self.model.get(CLOCK))
        return replace(self, model=model)

    def errors(self) -> np.ndarray:
        """(S, 3) one-step errors of the scene's model."""
        return self.grid.errors(
            native.one_step(self.model, self.measurement.played), self.measurement
        )

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

    def _own_noise(self) -> Noise:
        """Noise of the log, whatever the model: what no response to the commands explains."""
        errors = unexplained(self.measurement, self.grid, self.model.get(CLOCK))
        return fit_noise(errors, self._moving(), self.grid)

    def whitened(self, names: list[str], rows: np.ndarray) -> np.ndarray:
        """(B, P) values to (B, S, 3) whitened one-step errors."""
        predicted = native.one_step_batch(
            self.model, self.measurement.played, names, np.ascontiguousarray(rows)
        )
        return self.noise.whiten(self.grid.errors(predicted, self.measurement), self.grid)
