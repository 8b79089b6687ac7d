# SPDX-License-Identifier: Apache-2.0
"""Makes measurements ready to be scored by a model, over the floor that their noise makes."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.estimation.opened import Opened, opened_over
from twinmill.inference.floor import noise_floor
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import CLOCK, GAINS, Parameter, base_parameters
from twinmill.predict.datasets import Trajectory
from twinmill.predict.steady_states import SteadyStates

FEW_COMMANDS = 4  # different ones, below which a log tells nothing of others
WIDE_STD = 0.15  # of a robot's gains where they are in question


def open_measurements(
    measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile
) -> list[Opened]:
    """Floors of all, and clocks aligned to the model as given.

    An offset that another log on the same clocks told is kept, and one that was declared to be
    zero: only so can a delay be told from it. A robot whose own run does not tell it (one that saw
    nobody all the while has one command) takes that of the others in its log.

    """
    opened = [opened_over(m, model_file, k, noise_floor) for k, m in enumerate(measurements)]
    return [on_clock_of_others(o, opened) for o in opened]


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


def wide_gains(model: native.Model, names: Sequence[str] = GAINS) -> tuple[Parameter, ...]:
    """A robot's own gains where they are in question, those of the base about the model's."""
    free = base_parameters(model, names)
    return tuple(replace(p, usual=model.get(p.name), std=WIDE_STD) for p in free)
