# SPDX-License-Identifier: Apache-2.0
"""A measurement with what scoring it takes: data set, floor, and the model of its robot."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.data.track import Track
from twinmill.estimation.equations import check_states
from twinmill.estimation.refit import refitted, too_poor
from twinmill.estimation.score_fit import ScoreFit
from twinmill.estimation.settings import FIT_SETTINGS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CLOCK,
    CLOCK_RATE,
    HEADING,
    Parameter,
    ParameterEstimate,
    base_parameters,
    of_each_log,
    take_alignment,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.steady_states import SteadyStates

CLOCK_REACH_S = 1.0  # how far from its start an offset of the clocks is looked for
RATE_REACH_PPM = 500.0


@dataclass(frozen=True)
class NoiseFloor:
    """Floor of one robot's errors in one log, by noise alone.

    Attributes:
        rms: (H, 3) errors that count as one; NaN where a channel does not move.
        keep: (W,) bool: windows that are judged; in the others something happened once.
        kind: how it was found; None if the log cannot give a floor.
        reason: why it cannot; empty otherwise.
        offset_s: capture's clock less the robot's, of the base refitted to the log.
        heading_rad: that the robot holds where it was not recorded; else 0.
        independent: (3,) share of the errors of each channel that are.
        by_chance: between which scores 95 % of the draws of the noise lie, those of a right model.
        memories: (N, F) correlations of `twinmill.predict.whiteness` in each draw.
    """

    rms: np.ndarray
    keep: np.ndarray
    kind: str | None
    reason: str = ""
    offset_s: float = 0.0
    heading_rad: float = 0.0
    independent: np.ndarray = field(default_factory=lambda: np.ones(3))
    by_chance: tuple[float, float] = (float("nan"), float("nan"))
    memories: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    @classmethod
    def none(cls, data: Trajectory, reason: str) -> "NoiseFloor":
        """Floor of a log that gives none, with the reason."""
        everything = np.ones(len(data.measured), bool)
        return cls(np.full(data.floor.shape, np.nan), everything, None, reason)


@dataclass(frozen=True)
class Opened:
    """One measurement with what scoring it takes.

    Attributes:
        measurement: of a log or a table.
        data: over its floor; None where the log gives none.
        model: of its robot, on its clock.
        floor: of a log; None of a table.
        same_clock: commands and poses are stamped by one clock, and as late all the time.
        phases: of the model's formulas, as they were found for this log.
    """

    measurement: Measurement | SteadyTable
    data: Trajectory | SteadyStates | None
    model: native.Model
    floor: NoiseFloor | None
    same_clock: bool
    phases: tuple[ParameterEstimate, ...] = ()

    @property
    def run(self) -> Measurement:
        """A robot in a log; a table has none."""
        if isinstance(self.measurement, SteadyTable):
            raise TypeError(f"{self.measurement.log_name}: a steady table has no track.")
        return self.measurement

    @property
    def track(self) -> Track:
        """Cleaned poses and commands of a log; a table has none."""
        return self.run.track

    @property
    def trajectory(self) -> Trajectory:
        """Predictions of a log, over its floor; a table, or a log without a floor, has none."""
        if not isinstance(self.data, Trajectory):
            raise TypeError(f"{self.measurement.log_name}: has no predictions of poses.")
        return self.data

    @property
    def known_floor(self) -> NoiseFloor:
        """Floor of a log; a table has none."""
        if self.floor is None:
            raise TypeError(f"{self.measurement.log_name}: a steady table has no floor.")
        return self.floor

    @property
    def score(self) -> float:
        """Score of its model; NaN without a floor."""
        return float("nan") if self.data is None else self.data.score(self.model)

    @property
    def one_clock(self) -> bool:
        """True if the log or the model file declares that one clock stamped all."""
        return self.floor is not None and (self.run.same_clock or self.model.clock_same)

    @property
    def heading_held(self) -> bool:
        """True if the heading was not recorded, so that the robot is taken to hold one."""
        return self.floor is not None and not self.track.has_heading

    def modelled(self) -> ModelledLog | SteadyStates:
        """Measurement, model and noise, as reports and other tests look at them."""
        if isinstance(self.data, SteadyStates):
            return self.data.with_model(self.model)
        return ModelledLog.on_clock(self.run, self.model, clock_free=not self.same_clock)

    def aligned(
        self,
        model: native.Model,
        offset_s: float | None = None,
        rounds: int = FIT_SETTINGS.rounds,
    ) -> "Opened":
        """Log under another model, on the clock, heading, angles and phases that suit it.

        They are those with which it predicts best. One clock for commands and poses is kept, a
        heading that was recorded, and all of a measurement without a floor. The wheels' angles at
        the begin are found if the model acts by them, and the phases of its formulas: no other log
        tells them.

        Args:
            model: of all robots.
            offset_s: where the search begins; by default where the floor was found.
            rounds: of the search.
        """
        free = not self.same_clock or self.heading_held or of_each_log(model)
        if self.data is None or self.floor is None or not free:
            return self.with_model(model)
        own = self.with_model(model).model
        unknown = []
        if not self.same_clock:
            own.set(CLOCK, self.floor.offset_s if offset_s is None else offset_s)
            unknown += _clock(own)
        if self.heading_held:
            own.set(HEADING, self.floor.heading_rad)
            unknown += base_parameters(own, [HEADING])
        unknown += of_each_log(own)
        data = replace(self.data, own=tuple(unknown))
        fit = ScoreFit([data], [own], [])
        fit.begin_at_best_start()
        fit.fit(rounds)
        return replace(self, data=data, model=fit.models[0], phases=tuple(fit.first_phases))

    def realigned(self) -> "Opened":
        """Log on the clock and heading that would be found for its model anew."""
        return self.aligned(self.model)

    def with_fitted(self, model: native.Model) -> "Opened":
        """Log under a fitted model of its own robot, its clock included."""
        return replace(self, model=model)

    def with_model(self, model: native.Model) -> "Opened":
        """Log under another model, on an unchanged clock."""
        if isinstance(self.measurement, SteadyTable):
            return replace(self, model=model.for_robot(self.measurement.robot_id))
        own = model.for_robot(self.track.robot_id)
        take_alignment(own, self.model)
        data = self.data and self.trajectory.with_own_start(own)
        return replace(self, model=own, data=data)


def opened_over(
    measurement: Measurement | SteadyTable,
    model_file: ModelFile,
    number: int,
    floor_of: Callable[[Measurement, ModelFile], NoiseFloor],
) -> Opened:
    """A measurement over a floor, aligned to the model as given.

    Args:
        measurement: a run, or a table, which has its own floor.
        model_file: the model.
        number: among others, see `Trajectory.first_part`.
        floor_of: finds the floor of a run.
    """
    if isinstance(measurement, SteadyTable):
        table = SteadyStates.of(measurement, model_file.model)
        return Opened(measurement, table, table.model, None, True)
    model, same_clock = on_its_clock(measurement, model_file)
    punctual = measurement.punctual()
    data = Trajectory.of(punctual)
    check_states(data, model)
    floor = floor_of(measurement, model_file)
    if floor.kind is None:
        return Opened(punctual, None, model, floor, same_clock)
    data = replace(
        data.over(floor.rms, floor.keep), first_part=number, independent=floor.independent
    )
    return Opened(punctual, data, model, floor, same_clock).aligned(model)


def coarse_floor(measurement: Measurement, model_file: ModelFile) -> NoiseFloor:
    """Errors of the base refitted to a log: units good enough to align it."""
    data = Trajectory.of(measurement.punctual())
    if reason := too_poor(data):
        return NoiseFloor.none(data, reason)
    refit = refitted(data, model_file, known_offset_s(measurement, model_file))
    return NoiseFloor(
        refit.rms,
        np.ones(len(data.measured), bool),
        kind="refit",
        offset_s=refit.base.get(CLOCK),
        heading_rad=refit.base.get(HEADING),
    )


def on_its_clock(measurement: Measurement, model_file: ModelFile) -> tuple[native.Model, bool]:
    """The model of a log's robot, and whether its commands are known to be on the poses' clock.

    Where their lateness changes, a mean of it is found with the clock's offset, and is no delay.
    """
    model = model_file.model.for_robot(measurement.track.robot_id)
    told = model.clock_known and measurement.log_sha256 not in model_file.clock_logs
    declared = measurement.same_clock
    if declared and not told:
        model.set(CLOCK, 0.0)
    return model, (told or declared) and measurement.lateness is None


def known_offset_s(measurement: Measurement, model_file: ModelFile) -> float | None:
    """Offset of a log's clocks, as declared or told by other logs; None where nothing tells it."""
    model, same_clock = on_its_clock(measurement, model_file)
    return model.get(CLOCK) if same_clock else None


def _clock(model: native.Model) -> list[Parameter]:
    """Offset and rate of one measurement's clock."""
    offset, rate = base_parameters(model, [CLOCK, CLOCK_RATE])
    at = offset.value
    return [
        replace(offset, min=at - CLOCK_REACH_S, max=at + CLOCK_REACH_S),
        replace(rate, usual=0.0, min=-RATE_REACH_PPM, max=RATE_REACH_PPM),
    ]
