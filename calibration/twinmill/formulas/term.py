# SPDX-License-Identifier: Apache-2.0
"""One candidate formula without a physics name, and what a velocity does to the errors of a log."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.fitting.response import Response
from twinmill.model.parameters import words

STILL = (0.002, 0.002, 0.01)  # m/s, m/s, rad/s: below it an axis does not move; wheels differ
CHANNELS = ("vx_mps", "vy_mps", "omega_radps")
SPEEDS = ("vx", "vy", "omega")
# m/s, m/s, rad/s, m/s: what a term of full size may add.
TYPICAL = {"vx_mps": 0.01, "vy_mps": 0.01, "omega_radps": 0.05, "rim_mps": 0.01}
# Rates, voltage, history, wheels, and what names a part of the motion: no names of a formula.
NO_NAMES = {
    "dvx",
    "dvy",
    "domega",
    "V",
    "way",
    "ago",
    "drift",
    "push",
    "travel",
    "aside",
    "spot",
    "lean",
    "held",
    "unwound",
    "swings",
    "dv",
    "wheel_rad",
    "wheel_radps",
} | {f"after_{event}" for event in ("reversal", "start", "rise")}
SWELL = 0.05  # share of all speeds: a usual loss
COUPLING = "coupling of the axes"
CHANGE = "change of the command"
PAST = "past motion"
TIME = "time"
WAY = "way driven"
PLACE = "place"


@dataclass(frozen=True)
class Term:
    """One candidate formula: adds p0 times `formula` to a velocity of the body or of a rim.

    Attributes:
        group: what it depends on.
        adds_to, formula: as the effect `equation` takes them, but for names in NO_NAMES.
        size: of the formula's values, 95th percentile.
        family: of terms of the group that are tested together.
    """

    group: str
    adds_to: str
    formula: str
    size: float
    family: str = ""

    @property
    def addable(self) -> bool:
        """The effect `equation` knows all its names."""
        return not words(self.formula) & NO_NAMES

    @property
    def is_form(self) -> bool:
        """A form of its own, which the effect `equation` can have.

        Not what changes all speeds at once with time: the form `motion` says that without wheels.
        """
        return not self.family and not self.formula.endswith("*rim") and self.addable

    @property
    def is_step(self) -> bool:
        """Before a moment it is the opposite of what it is after it."""
        return self.formula.startswith("sign(t - ")

    @property
    def strength(self) -> float:
        """p0 at which the term adds what is typical."""
        return TYPICAL[self.adds_to] / self.size


def times(n: int, name: str) -> str:
    """So many times a name, as a formula has it."""
    return f"{n}*{name}" if n > 1 else name


def moves(velocity: np.ndarray) -> np.ndarray:
    """(N,) bool: whether the body moves, of (N, 3) m/s and rad/s."""
    return np.hypot(velocity[:, 0], velocity[:, 1]) + 0.1 * np.abs(velocity[:, 2]) > 0.01


def displaced(
    response: Response, velocity: np.ndarray, values: np.ndarray, axis: int
) -> np.ndarray:
    """(W, H, 3, T) change of windows' displacements by (N, T) velocities in a body axis, linear."""
    heading = response.data.measurement.track.heading_smooth
    return native.displaced_by(
        np.ascontiguousarray(values),
        np.ascontiguousarray(velocity),
        axis,
        response.step_s,
        response.ahead,
        response.starts,
        np.ascontiguousarray(np.maximum(response.ends, 0)),
        np.nan_to_num(heading[response.data.windows.starts]),
    )


def displaced_by(
    response: Response, velocity: np.ndarray, values: Mapping[int, np.ndarray]
) -> np.ndarray:
    """(W, H, 3, T) the same by (N, T) velocities in each of several body axes."""
    first, *others = (displaced(response, velocity, v, axis) for axis, v in values.items())
    for other in others:
        first += other
    return first
