# SPDX-License-Identifier: Apache-2.0
"""The base refitted to one log, from the robot's form alone.

Only that is taken from a model file: drive, wheels and geometry. So what follows from a refit is a
property of the log.
"""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.data.track import Track
from twinmill.estimation.score_fit import ScoreFit
from twinmill.model.form_file import form_file, with_numbers
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    BASE_GAINS,
    CLOCK,
    HEADING,
    LAG,
    base_parameters,
    duty_table,
    effect_parameters,
    gains_of,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import rms

ARM_M = 0.1  # a turn counts as the way of a point so far from the middle
REACH_S = 1.0  # delays and offsets that are looked for
ROUNDS = 3  # of fits, each in units of the errors before it
NODES, APART = 12, 2  # of a form's duty table, and more than so many per cent between two
FEWEST_WINDOWS = 40  # of predictions, 10 s: in fewer, noise cannot be told from motion
FEWEST_LONG = 20  # the same of predictions over the longest horizon


@dataclass(frozen=True)
class Refit:
    """A base refitted to one log.

    Attributes:
        file: the robot's form with the base's numbers.
        base: form and numbers, on the clock and the heading that were found.
        rms: (H, 3) errors that it leaves beside a delay of the commands; m, m, rad.
    """

    file: ModelFile
    base: native.Model
    rms: np.ndarray


def refitted(data: Trajectory, model_file: ModelFile, offset_s: float | None) -> Refit:
    """Gains, speeds, lag and lateness with which a robot's form predicts its log best.

    Args:
        data: windows.
        model_file: of the robot; only its form is used.
        offset_s: of the clocks; None where nothing tells it.
    """
    same_clock = offset_s is not None
    form = form_file(model_file, _nodes_pct(data.measurement.track), clock=same_clock)
    base = form.model.copy()
    base.set(CLOCK, offset_s or 0.0)
    _scale_speeds(data, base)
    names = [*acting_gains(data, base), LAG]
    table = duty_table(base)
    if len(table) > 1:
        names = [n for n in names if n != "base.forward_gain"] + table
    if same_clock:
        base.add_effect("input_delay")
        base.set("input_delay.delay_s", 0.02)
        late = effect_parameters(base, "input_delay")
    else:
        base.set(CLOCK, _best(data, base, CLOCK, np.arange(-REACH_S, REACH_S + 0.01, 0.05)))
        late = base_parameters(base, [CLOCK])
    if not data.measurement.track.has_heading:
        base.set(HEADING, _best(data, base, HEADING, np.radians(np.arange(-180.0, 180.0, 15.0))))
        late += base_parameters(base, [HEADING])
    for _ in range(ROUNDS):
        own = data.over(rms(data.errors(base)))
        free = [p.at(base.get(p.name)) for p in base_parameters(base, names) + late]
        base = ScoreFit([own], [base], free).fit(8).models[0]
    return Refit(with_numbers(form, base), base, rms(data.errors(base)))


def acting_gains(data: Trajectory, model: native.Model) -> list[str]:
    """Gains of the base along which its wheels and the log's commands move the robot."""
    gains, track = gains_of(model), data.measurement.track
    if track.command_kind != "twist":
        return gains
    return [n for n in gains if track.command[:, BASE_GAINS.index(n)].any()]


def too_poor(data: Trajectory) -> str:
    """Why a log cannot tell its noise from the motion; empty if it can."""
    whole = np.count_nonzero(np.isfinite(data.measured[:, -1, 0]))
    if len(data.windows.starts) < FEWEST_WINDOWS:
        return (
            f"{data.label}: {len(data.windows.starts) * 0.25:.0f} s of unbroken poses are too "
            "short to tell the noise from the motion; record half a minute or more"
        )
    if whole < FEWEST_LONG:
        return (
            f"{data.label}: its poses break so often that they are whole over the longest horizon "
            f"at {whole} times, too few to tell the noise from the motion; look at where and why "
            "they break"
        )
    if not np.diff(data.measurement.track.command, axis=0).any():
        return (
            f"{data.label}: the commands never change, so nothing tells the noise from the motion"
        )
    return ""


def _nodes_pct(track: Track) -> list[float]:
    """Nodes of a duty table: 0, the duties that the log dwells at longest, and 100."""
    found = [0, 100]
    if track.command_kind == "duty":
        duty = np.rint(np.abs(track.command[:-1]) * 100).astype(int)
        held_s = np.bincount(duty.ravel(), np.repeat(np.diff(track.command_t_s), duty.shape[1]))
        for pct in np.argsort(-held_s, kind="stable").tolist():
            if len(found) < NODES and held_s[pct] > 0 and min(abs(pct - f) for f in found) > APART:
                found.append(pct)
    return sorted(map(float, found))


def _scale_speeds(data: Trajectory, base: native.Model) -> None:
    """Speeds of a duty robot at which the base drives as far as the log; it is changed."""
    table = duty_table(base)
    if not table:
        return
    ways_m = [
        np.linalg.norm(rms(own)[0] * (1.0, 1.0, ARM_M))
        for own in (data.measured, data.measured - data.errors(base))
    ]
    if min(ways_m) > 0:
        for name in table:
            base.set(name, float(base.get(name) * ways_m[0] / ways_m[1]))


def _best(data: Trajectory, base: native.Model, name: str, apart: np.ndarray) -> float:
    """Value of a quantity at which the base predicts best, of a grid about its own."""
    grid = apart + base.get(name)
    own = data.over(rms(data.measured))
    squares = (own.rows(base, [name], grid[:, None]) ** 2).sum(axis=1)
    return float(grid[np.argmin(squares)])
