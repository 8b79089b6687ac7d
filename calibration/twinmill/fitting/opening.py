# SPDX-License-Identifier: Apache-2.0
"""Makes measurements ready to be scored by a model: data set, floor, and the model of its robot."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.data.track import Track
from twinmill.fitting.equations import check_states
from twinmill.fitting.floor import NoiseFloor, coarse_offset_s, no_floor, noise_floor, too_poor
from twinmill.fitting.response import Response
from twinmill.fitting.score_fit import ScoreFit
from twinmill.fitting.settings import FIT_SETTINGS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    CLOCK,
    CLOCK_RATE,
    GAINS,
    HEADING,
    LAG,
    Parameter,
    ParameterEstimate,
    base_parameters,
    of_each_log,
    take_alignment,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.steady_states import SteadyStates
from twinmill.predict.windows import rms

CLOCK_REACH_S = 1.0  # how far from its start an offset of the clocks is looked for
RATE_REACH_PPM = 500.0
FEW_COMMANDS = 4  # different ones, below which a log tells nothing of others
SPREAD = 0.03  # standard deviation of gains among robots of a kind where the model states none
WIDE_STD = 0.15  # of a robot's gains where they are in question
OWN = (LAG, *GAINS)  # what each robot, or each run, may have of its own
ROUGH = 4  # of so many starts of predictions one is looked at first


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
    def response(self) -> Response:
        """Smooth response to the commands by which the floor of a log was found."""
        if self.floor is None or self.floor.response is None:
            raise TypeError(f"{self.measurement.log_name}: has no floor by a response.")
        return self.floor.response

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


def open_measurements(
    measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile
) -> list[Opened]:
    """Floors of all, and clocks aligned to the model as given.

    An offset that another log on the same clocks told is kept, and one that was declared to be
    zero: only so can a delay be told from it. A robot whose own run does not tell it (one that saw
    nobody all the while has one command) takes that of the others in its log.

    """
    opened = [_open(m, model_file, k) for k, m in enumerate(measurements)]
    return [on_clock_of_others(o, opened) for o in opened]


def _open(measurement: Measurement | SteadyTable, model_file: ModelFile, number: int) -> Opened:
    if isinstance(measurement, SteadyTable):
        table = SteadyStates.of(measurement, model_file.model)
        return Opened(measurement, table, table.model, None, True)
    measurement = measurement.punctual()
    model, same_clock = _on_its_clock(measurement, model_file)
    data = Trajectory.of(measurement)
    check_states(data, model)
    floor = noise_floor(data, model, same_clock)
    if floor.kind is None or floor.response is None:
        return Opened(measurement, None, model, floor, same_clock)
    ratio = floor.response.radius_ratio
    data = replace(
        data.over(floor.rms, floor.keep),
        first_part=number,
        radius_ratio=ratio,
        independent=floor.independent,
    )
    return Opened(measurement, data, model, floor, same_clock).aligned(model)


def _on_its_clock(measurement: Measurement, model_file: ModelFile) -> tuple[native.Model, bool]:
    """The model of a log's robot, and whether its commands are known to be on the poses' clock.

    Where their lateness changes, a mean of it is found with the clock's offset, and is no delay.
    """
    model = model_file.model.for_robot(measurement.track.robot_id)
    told = model.clock_known and measurement.log_sha256 not in model_file.clock_logs
    declared = measurement.same_clock
    if declared and not told:
        model.set(CLOCK, 0.0)
    return model, (told or declared) and measurement.lateness is None


def open_roughly(measurement: Measurement, model_file: ModelFile) -> Opened | None:
    """A log for a quick look: some of its predictions, weighed by the model's own errors.

    It takes a tenth of a second, where the noise floor takes more than one. In place of the floor
    stands the RMS error of the model itself in each channel and at each horizon, so that its
    score tells nothing; its errors in one regime against another's do.

    Args:
        measurement: one robot's log.
        model_file: the model.

    Returns:
        The log with the robot's model, its clock found roughly unless it is known; None where the
        log is too poor for a noise floor, or has no heading.
    """
    measurement = measurement.punctual()
    model, same_clock = _on_its_clock(measurement, model_file)
    data = Trajectory.of(measurement).thinned(ROUGH)
    if too_poor(data) or not measurement.track.has_heading:
        return None
    if not same_clock:
        model.set(CLOCK, coarse_offset_s(data, model))
    errors = rms(data.errors(model))
    floor = replace(no_floor(data, ""), rms=errors, offset_s=model.get(CLOCK))
    rough = Opened(measurement, data.over(errors), model, floor, same_clock).aligned(model)
    over = rms(rough.trajectory.errors(rough.model))
    return replace(rough, data=rough.trajectory.over(over))


def _clock(model: native.Model) -> list[Parameter]:
    """Offset and rate of one measurement's clock."""
    offset, rate = base_parameters(model, [CLOCK, CLOCK_RATE])
    at = offset.value
    return [
        replace(offset, min=at - CLOCK_REACH_S, max=at + CLOCK_REACH_S),
        replace(rate, usual=0.0, min=-RATE_REACH_PPM, max=RATE_REACH_PPM),
    ]


def on_clock_of_others(own: Opened, opened: Sequence[Opened]) -> Opened:
    """One that does not tell its clock, on that of the others in its log; the rest as they are."""
    if own.data is not None or own.same_clock:
        return own
    log = own.measurement.log_sha256
    known = [
        o for o in opened if o.data is not None and o.floor and o.measurement.log_sha256 == log
    ]
    if not known:
        return own
    offset_s = float(np.median([o.model.get(CLOCK) for o in known]))
    model = own.model.copy()
    model.set(CLOCK, offset_s)
    told = (
        "its commands do not tell its clock offset; that of the log's other robots is taken "
        f"({offset_s:.3f} s)."
    )
    measurement = replace(own.measurement, warnings=[*own.measurement.warnings, told])
    return replace(own, measurement=measurement, model=model)


def lateness_changes(opened: Sequence[Opened]) -> list[str]:
    """Labels of logs where each has a lateness that changes, so that none tells one; else empty."""
    logs = [o.run for o in opened if o.floor and o.data is not None]
    return [m.label for m in logs] if all(m.lateness_changes for m in logs) else []


def lag_is_kept(opened: Sequence[Opened], told: Collection[str]) -> bool:
    """True if the lag keeps its value, as lateness changes in all logs.

    It does where other logs told it (`told` has names), and where it is not known how lateness
    changes; else how quickly the robot follows tells it, once the change is taken into account.
    """
    logs = [o.run for o in opened if o.floor and o.data is not None]
    unknown = any(m.lateness is None for m in logs)
    return bool(lateness_changes(opened)) and (bool(told) or unknown)


def untold_parts(opened: Sequence[Opened], told: Collection[str]) -> list[str]:
    """Parts of lateness that keep their values: "lag", "delay", "clock"; see `lag_is_kept`."""
    lag = ["lag"] if lag_is_kept(opened, told) else []
    return [*lag, "delay", "clock"] if lateness_changes(opened) else []


@dataclass(frozen=True)
class Judged(Opened):
    """One that has a floor; a name for type checkers alone, that no object is made of."""

    data: Trajectory | SteadyStates


def judged(opened: Sequence[Opened]) -> list[Judged]:
    """Those that have a floor.

    Raises:
        LogError: none has.
    """
    known = [o for o in opened if o.data is not None]
    if not known:
        raise LogError(f"{' '.join(o.floor.reason for o in opened if o.floor)}.")
    return cast("list[Judged]", known)


def of_few_commands(opened: Sequence[Opened]) -> str:
    """A sentence where logs have so few commands that a fit holds at these alone; else empty.

    A command counts if it was in force for a hundredth of the time, and moved the robot. Where such
    commands are the lesser part of the drive, as by a stick or by encoders, it has many.

    Args:
        opened: measurements; of tables nothing is said.
    """
    tracks = [o.track for o in opened if o.floor]
    if not tracks or len(tracks) < len(opened):
        return ""
    commands = np.concatenate([t.command[:-1] for t in tracks])
    shares = np.concatenate([np.diff(t.command_t_s) for t in tracks])
    shares = shares / max(shares.sum(), 1e-9)
    top = max(np.abs(commands).max(), 1e-9)
    kinds, which = np.unique((commands / top).round(2), axis=0, return_inverse=True)
    held, moving = np.bincount(which.ravel(), shares), kinds.any(axis=1)
    count = int(np.sum(moving & (held > 0.01)))
    if count >= FEW_COMMANDS or held[moving & (held > 0.01)].sum() < held[moving].sum() / 2:
        return ""
    told = "one command" if count == 1 else f"{count} different commands"
    return (
        f"these logs have {told}, and what is fitted to them holds at such commands alone: drive "
        "all axes at five levels or more before the model is used at others"
    )


def thinned(opened: Sequence[Opened], every: int) -> list[Opened]:
    """Logs with every Nth start of predictions."""
    if every < 2:
        return list(opened)
    return [
        replace(o, data=o.trajectory.thinned(every), floor=o.floor.thinned(every)) if o.floor else o
        for o in opened
    ]


def wide_gains(model: native.Model, names: Sequence[str] = GAINS) -> tuple[Parameter, ...]:
    """A robot's own gains where they are in question, those of the base about the model's."""
    free = base_parameters(model, names)
    return tuple(replace(p, usual=model.get(p.name), std=WIDE_STD) for p in free)


def with_own_gains(opened: Sequence[Opened]) -> list[Opened]:
    """Each robot of several with gains of its own: robots of a kind differ by a few percent."""
    logs = [o for o in opened if o.floor]
    if len({o.track.robot_id for o in logs}) < 2:
        return list(opened)
    return [_with_gains(o) if o.floor else o for o in opened]


def with_own_of_runs(
    opened: Sequence[Opened], stds: Mapping[str, float] | None = None
) -> list[Opened]:
    """Each run of each robot with a motor lag and gains of its own.

    Args:
        opened: logs.
        stds: of those that differ among the runs, by name; None: of all, and they are in question.
    """
    return [_with_own_of_run(o, stds) for o in opened]


def _with_own_of_run(own: Opened, stds: Mapping[str, float] | None) -> Opened:
    names = OWN if own.track.has_heading else OWN[:2]  # else it is never turned
    free = []
    for p in base_parameters(own.model, names):
        usual = p.value if p.name == LAG else 1.0
        std = stds.get(p.name, 0.0) if stds else p.std
        free += [replace(p, usual=usual, std=std)] if std else []
    others = tuple(p for p in own.trajectory.own if p.name not in OWN)
    return replace(own, data=replace(own.trajectory, own=(*others, *free), by_run=True))


def with_own_lags(opened: Sequence[Opened], spread_s: float) -> list[Opened]:
    """Each robot with a motor lag of its own.

    Args:
        opened: of several robots.
        spread_s: standard deviation of the lags among them.
    """
    return [_with_lag(o, spread_s) if o.floor else o for o in opened]


def _with_lag(own: Opened, spread_s: float) -> Opened:
    (lag,) = base_parameters(own.model, [LAG])
    lag = replace(lag, usual=lag.value, std=spread_s)
    return replace(own, data=replace(own.trajectory, own=(*own.trajectory.own, lag)))


def _with_gains(own: Opened) -> Opened:
    names = GAINS if own.track.has_heading else GAINS[:1]  # else it is never turned
    gains = []
    for p in base_parameters(own.model, names):
        spread = own.model.get(f"idiosyncrasy.{p.name}_std") or SPREAD
        gains.append(replace(p, usual=1.0, std=spread))
    data = own.trajectory
    return replace(own, data=replace(data, own=(*data.own, *gains)))
