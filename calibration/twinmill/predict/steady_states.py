# SPDX-License-Identifier: Apache-2.0
"""A steady-state table with the model that is to explain it, as a data set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.steady_table import STILL_MPS, SteadyTable
from twinmill.model.mixing import asked_by_vendor_move
from twinmill.predict.datasets import PARTS

CHANNELS = (("speed", "m/s"), ("turn", "rad/s"), ("standing side", "m/s"))
ON_BENCH = tuple((f"wheel {k}", "rad/s") for k in (1, 2, 3, 4))

# Times the usual error, or the floor: beyond it the table is wrong rather than the model. Such an
# error counts by its logarithm: a single one decides little, and has a slope to follow.
TYPING_ERROR = 10.0
STANDS = 1e-9  # m/s: a robot that stands is told in the direction of its input alone
DRIVEN_BY = {"wheel_speed": "measured wheel speeds", "twist": "velocities of the body"}


@dataclass
class SteadyStates:
    """One robot of a table with its model: a data set. Values are (U, C), as `channels`.

    A tape tells how fast a robot is, forwards or backwards alike.
    The third of CHANNELS is the rim speed of the slower side where a note says that it stood still:
    an input that could not be measured tells something, too. NaN is not measured.
    """

    measurement: SteadyTable
    model: native.Model
    commands: np.ndarray
    own: tuple[Any, ...] = ()
    noise: None = None
    clock_free: bool = False
    by_run = False

    @classmethod
    def of(cls, sheet: SteadyTable, model: native.Model) -> "SteadyStates":
        """A table with a model of its kind of robot.

        Raises:
            LogError: the model is driven by measured wheel speeds, which a table does not have.
        """
        own = model.for_robot(sheet.robot_id)
        return cls(sheet, own, _commands(sheet, own))

    @property
    def label(self) -> str:
        """Name of the table and number of the robot."""
        return f"{self.measurement.log_name} R{self.robot_id:02d}"

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """Names and units."""
        return ON_BENCH if self.measurement.of_wheels else CHANNELS

    @property
    def robot_id(self) -> int:
        """Number of the robot in the table."""
        return self.measurement.robot_id

    @property
    def block(self) -> np.ndarray:
        """(R,) the input of each row: what the runs at one input have in common."""
        return np.repeat(np.arange(len(self.commands)), len(self.channels))

    @property
    def part(self) -> np.ndarray:
        """(R,) left out together: a robot among several, an input of one alone."""
        fold = self.measurement.fold
        return self.block % PARTS if fold is None else np.full(len(self.block), fold)

    @property
    def channel(self) -> np.ndarray:
        """(R,) which of `channels` each row is."""
        return np.tile(np.arange(len(self.channels)), len(self.commands))

    @property
    def n_eff(self) -> np.ndarray:
        """(C,) number of values that were measured, each independent."""
        return np.isfinite(self.measured()).sum(axis=0).astype(float)

    def with_model(self, model: native.Model) -> "SteadyStates":
        """A copy with another model."""
        return replace(self, model=model.for_robot(self.measurement.robot_id))

    def fitted(self, model: native.Model) -> "SteadyStates":
        """A copy with a model of its own robot that was fitted to it."""
        return replace(self, model=model)

    def predicted(self) -> np.ndarray:
        """(U, C) what the model predicts, as `channels`."""
        return self._predicted(self.model, [], np.zeros((1, 0)))[0]

    def errors(self) -> np.ndarray:
        """(U, C) measured less predicted."""
        return self.measured() - self.predicted()

    def errors_with(
        self, model: native.Model, names: Sequence[str], values: np.ndarray
    ) -> np.ndarray:
        """(B, U, C) measured less predicted, for B rows of values of named quantities."""
        return self.measured() - self._predicted(model, list(names), np.ascontiguousarray(values))

    def ratios(self) -> np.ndarray:
        """(U, C) errors over their floor, for scores: large ones count by their logarithm.

        What was only seen to be zero, and is predicted so, was not measured: NaN.
        """
        return self._robust(self.errors() / self.floor())

    @cached_property
    def _most(self) -> float:
        """Error over floor from which it is one of typing, by what is usual with the model."""
        usual = np.nanmedian(np.abs(self.errors() / self.floor()))
        return TYPING_ERROR * max(1.0, float(np.nan_to_num(usual)))

    def _robust(self, ratios: np.ndarray) -> np.ndarray:
        size = np.abs(ratios)
        agreed = (self.measured() == 0) & (size < 1)
        robust = np.minimum(size, self._most) * (1 + np.log(np.maximum(size / self._most, 1)))
        return np.where(agreed, np.nan, np.copysign(robust, ratios))

    def rows(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """(B, R) errors over floor for B rows of values; squares add up to the score's."""
        ratios = self._robust(self.errors_with(model, names, values) / self.floor())
        return np.nan_to_num(ratios).reshape(len(values), -1) * np.sqrt(self.judged)

    def rows_by_part(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        """(R,) the same, each part by its own one of PARTS rows of values."""
        rows = self.rows(model, names, values)
        return rows[self.part, np.arange(rows.shape[1])]

    @property
    def judged(self) -> np.ndarray:
        """(R,) share of the squared score that each row would make up if all were 1."""
        known = np.isfinite(self.measured())
        count = known.sum(axis=0)
        return (known / (np.maximum(count, 1) * np.count_nonzero(count))).reshape(-1)

    def score(self, model: native.Model) -> float:
        """RMS over channels of error over floor."""
        return float(np.sqrt(np.sum(self.rows(model, [], np.zeros((1, 0))) ** 2)))

    def floor(self) -> np.ndarray:
        """(U, C) standard deviations of measured values, as `channels`."""
        if self.measurement.of_wheels:
            return self.measurement.floor
        still = np.full(len(self.commands), STILL_MPS)
        return np.column_stack([self.measurement.floor, still])

    def measured(self) -> np.ndarray:
        """(U, C) values, as `channels`; NaN is not measured."""
        if self.measurement.of_wheels:
            return self.measurement.value
        still = np.where(self.measurement.still, 0.0, np.nan)
        return np.column_stack([self.measurement.value, still])

    def _predicted(self, model: native.Model, names: list[str], rows: np.ndarray) -> np.ndarray:
        steady = native.steady(model, self.commands, names, rows)
        if self.measurement.of_wheels:
            return steady[..., 3:] / model.get("robot.wheel_radius_m")
        vx, vy, turn = np.moveaxis(steady[..., :3], -1, 0)
        return np.stack([np.hypot(vx, vy), turn, np.abs(self._slow(steady[..., 3:]))], -1)

    def _slow(self, rim: np.ndarray) -> np.ndarray:
        """(..., U) rim speed of the side that is asked for less, of (..., U, 4)."""
        sides = np.stack([rim[..., [0, 2]].mean(-1), rim[..., [1, 3]].mean(-1)], -1)
        asked = np.stack(
            [np.abs(self.commands[:, [0, 2]]).mean(1), np.abs(self.commands[:, [1, 3]]).mean(1)], -1
        )
        at = np.broadcast_to(asked.argmin(-1)[:, None], (*sides.shape[:-1], 1))
        return np.take_along_axis(sides, at, -1)[..., 0]

    def motion(self, model: native.Model) -> tuple[np.ndarray, np.ndarray]:
        """Velocity that each value is of, and the value's change with it, both (U, C, 3).

        The body's forward, left and turn in m/s and rad/s; on a bench the wheel's in rad/s, and 0.
        """
        if self.measurement.of_wheels:
            speed = self._predicted(model, [], np.zeros((1, 0)))[0]
            along = np.array([1.0, 0.0, 0.0])
            return speed[..., None] * along, np.broadcast_to(along, (*speed.shape, 3))
        steady = native.steady(model, self.commands, [], np.zeros((1, 0)))[0]
        vx, vy, turn = steady[:, :3].T
        size, zero, one = np.hypot(vx, vy), np.zeros(len(vx)), np.ones(len(vx))
        way = np.where(size > STANDS, [vx, vy], _direction(self.measurement.inputs))
        way = way / np.hypot(*way)
        slow = self._slow(steady[:, 3:])
        lever_m = np.where(turn != 0, (slow - vx) / np.where(turn != 0, turn, 1.0), 0.0)
        side = np.sign(slow) * [one, zero, lever_m]
        change = np.stack([[*way, zero], [zero, zero, one], side]).transpose(2, 0, 1)
        return np.repeat(steady[:, None, :3], len(CHANNELS), axis=1), change


def _direction(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commanded direction, forward and left; the vendor's 90 degrees are forward, 0 is right."""
    angle = np.radians(inputs[:, 1])
    sign = np.where(inputs[:, 0] < 0, -1.0, 1.0)
    return sign * np.sin(angle), -sign * np.cos(angle)


def _commands(sheet: SteadyTable, model: native.Model) -> np.ndarray:
    """(U, 4) commands in the unit of the model's drive; whose program rounds them no table says."""
    if sheet.of_wheels and model.drive == "duty":
        return sheet.inputs / 100.0
    if model.drive == "duty":
        asked = np.array([asked_by_vendor_move(*row) for row in sheet.inputs])
        return np.clip(asked / 100.0, -1, 1)
    if model.drive == "twist" and not sheet.of_wheels:
        forward, left = _direction(sheet.inputs)
        speed = np.abs(sheet.inputs[:, 0]) * model.get("base.speed_per_input_mps")
        turn = -sheet.inputs[:, 2] * model.get("base.turn_per_input_radps")
        return np.column_stack([forward * speed, left * speed, turn, np.zeros(len(turn))])
    if sheet.of_wheels:
        raise LogError(
            f"{sheet.log_name}: the model is driven by {DRIVEN_BY[model.drive]}, and a bench test "
            'has duties; take a model with drive = "duty".'
        )
    raise LogError(
        f"{sheet.log_name}: the model is driven by measured wheel speeds, and a steady-state table "
        'has inputs; take a model with drive = "duty" or "twist".'
    )
