# SPDX-License-Identifier: Apache-2.0
"""A steady-state table with the model that is to explain it: what a scene is for a log."""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.steady_table import STILL_MPS, Sheet
from twinmill.model.mixing import duties_from_vendor_move
from twinmill.predict.floor import Floor, floor_of
from twinmill.predict.folds import BLOCK_S, halves, held_errors, step_mask
from twinmill.predict.problem import stated_names

CHANNELS = (("speed", "m/s"), ("turn", "rad/s"), ("standing side", "m/s"))

TYPING_ERROR = 10.0  # times the floor: beyond it, more likely the sheet is wrong than the model


@dataclass(frozen=True)
class SteadyGrid:
    """The inputs as steps of a grid: each is a block of its own.

    Attributes:
        source: (U,) place of the input in the sheet.
        t_s: (U,) far enough apart to be blocks.
    """

    source: np.ndarray
    t_s: np.ndarray


@dataclass
class SteadyScene:
    """One robot of a table with its model. Residuals are (U, 3), as CHANNELS; NaN if not measured.

    The third is the rim speed of the slower side where a note says that it stood still: an input
    that could not be measured tells something, too.
    """

    measurement: Sheet
    model: native.Model
    commands: np.ndarray
    grid: SteadyGrid
    clock_free: bool = False
    gains_free: bool = False
    noise: None = None

    @classmethod
    def of(cls, sheet: Sheet, model: native.Model) -> "SteadyScene":
        """A sheet with a model of its kind of robot.

        Raises:
            LogError: the model is driven by measured wheel speeds, which a table does not have.
        """
        own = model.for_robot(sheet.robot_id)
        number = np.arange(len(sheet.inputs))
        grid = SteadyGrid(number, BLOCK_S * (number + 0.5))
        return cls(sheet, own, _commands(sheet, own), grid)

    def with_model(self, model: native.Model) -> "SteadyScene":
        """The same table with another model."""
        return replace(self, model=model.for_robot(self.measurement.robot_id))

    @property
    def stated(self) -> set[str]:
        """Names that the model file states of this robot alone."""
        return stated_names(self.model, self.measurement.robot_id)

    def settle_noise(self) -> None:
        """Nothing: the scatter of a table does not depend on the model."""

    def predicted(self) -> np.ndarray:
        """(U, 3) what the model predicts, as CHANNELS."""
        return self._predicted([], np.zeros((1, 0)))[0]

    def errors(self) -> np.ndarray:
        """(U, 3) measured less predicted."""
        return self._measured() - self.predicted()

    def ratios(self) -> np.ndarray:
        """(U, 3) errors over their floor, for scores: those that no model makes are cut.

        What was only seen to be zero, and is predicted so, was not measured: NaN.
        """
        ratios = self.errors() / self.floor()
        agreed = (self._measured() == 0) & (np.abs(ratios) < 1)
        return np.where(agreed, np.nan, np.clip(ratios, -TYPING_ERROR, TYPING_ERROR))

    def white_errors(self) -> np.ndarray:
        """(U, 3) errors over their floor; zero where nothing was measured."""
        return np.nan_to_num(self.errors() / self.floor())

    def whitened(self, names: list[str], rows: np.ndarray) -> np.ndarray:
        """(B, P) values to (B, U, 3) the same."""
        predicted = self._predicted(names, np.ascontiguousarray(rows))
        return np.nan_to_num((self._measured() - predicted) / self.floor())

    def floor(self) -> np.ndarray:
        """(U, 3) standard deviations."""
        still = np.full(len(self.commands), STILL_MPS)
        return np.column_stack([self.measurement.floor, still])

    def _measured(self) -> np.ndarray:
        still = np.where(self.measurement.still, 0.0, np.nan)
        return np.column_stack([self.measurement.value, still])

    def _predicted(self, names: list[str], rows: np.ndarray) -> np.ndarray:
        steady = native.steady(self.model, self.commands, names, rows)
        vx, vy, turn = np.moveaxis(steady[..., :3], -1, 0)
        rim = steady[..., 3:]
        forward, left = _direction(self.measurement.inputs)
        sign = np.where(vx * forward + vy * left < 0, -1.0, 1.0)
        sides = np.stack([rim[..., [0, 2]].mean(-1), rim[..., [1, 3]].mean(-1)], -1)
        asked = np.stack(
            [np.abs(self.commands[:, [0, 2]]).mean(1), np.abs(self.commands[:, [1, 3]]).mean(1)], -1
        )
        slow = np.take_along_axis(sides, asked.argmin(-1)[None, :, None], -1)[..., 0]
        return np.stack([sign * np.hypot(vx, vy), turn, np.abs(slow)], -1)


def _direction(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commanded direction, forward and left; the vendor's 90 degrees are forward, 0 is right."""
    angle = np.radians(inputs[:, 1])
    sign = np.where(inputs[:, 0] < 0, -1.0, 1.0)
    return sign * np.sin(angle), -sign * np.cos(angle)


def _commands(sheet: Sheet, model: native.Model) -> np.ndarray:
    """(U, 4) commands in the unit of the model's drive."""
    if model.drive == "duty":
        return np.array([duties_from_vendor_move(*row) for row in sheet.inputs]) / 100.0
    if model.drive == "twist":
        forward, left = _direction(sheet.inputs)
        speed = np.abs(sheet.inputs[:, 0]) * model.get("base.speed_per_input_mps")
        turn = -sheet.inputs[:, 2] * model.get("base.turn_per_input_radps")
        return np.column_stack([forward * speed, left * speed, turn, np.zeros(len(turn))])
    raise LogError(
        f"{sheet.log_name}: the model is driven by measured wheel speeds, and a steady-state table "
        'has inputs; take a model with drive = "duty" or "twist".'
    )


@halves.register
def _(scene: SteadyScene) -> np.ndarray:
    """(U,) 0 or 1: by robots, so that what is judged is another robot; by inputs if it is alone."""
    sheet, count = scene.measurement, len(scene.commands)
    if sheet.fold is None:
        return np.array([bin(k).count("1") % 2 for k in range(count)])
    return np.full(count, sheet.fold)


@step_mask.register
def _(scene: SteadyScene, half: np.ndarray, which: int) -> np.ndarray:
    return half == which


@held_errors.register
def _(scene: SteadyScene, half: np.ndarray, which: int) -> np.ndarray:
    """(U, 1, 3) errors over their floor."""
    return np.where((half == which)[:, None], scene.ratios(), np.nan)[:, None]


@floor_of.register
def _(scene: SteadyScene) -> Floor:
    """One: errors of a table are given over their floor."""
    alone = scene.measurement.fold is None
    return Floor(np.ones((1, len(CHANNELS))), "repeat" if alone else "spread")
