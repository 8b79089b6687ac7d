# SPDX-License-Identifier: Apache-2.0
"""Terms that are judged together, and the humps and texts that they are made of."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from twinmill.fitting.opening import Opened
from twinmill.formulas.term import STILL, TYPICAL, Term, displaced_by

HUMPS = 8  # over the range of a speed, or of a place
MOST = 0.99  # quantile of a speed up to which humps reach

# From a log and the (N, 3) velocities of its robot to (N, k) additions in axes of the body.
Values = Callable[[Opened, np.ndarray], dict[int, np.ndarray]]


@dataclass(frozen=True)
class Family:
    """Terms, and the (N, k) velocities that they add to axes of the body at their strengths."""

    terms: list[Term]
    values: Values

    def columns(self, own: Opened, velocity: np.ndarray) -> np.ndarray:
        """(R, k) change of a log's rows, as (N, 3) `velocity` moves the robot."""
        values = self.values(own, np.where(np.abs(velocity) < STILL, 0.0, velocity))
        change = displaced_by(own.response, velocity, values)
        change *= np.nan_to_num(own.trajectory.weight)[..., None]
        return change.reshape(-1, len(self.terms))


@dataclass(frozen=True)
class Humps:
    """Triangles that cover a range evenly: 1 at a middle, and 0 from a width on.

    Attributes:
        middles: (k,), to three digits, as a formula has them.
        width: half of a hump's, to three digits.
    """

    middles: np.ndarray
    width: float

    @classmethod
    def over(cls, low: float, high: float, count: int = HUMPS) -> "Humps":
        """So many, of which the outer ones reach beyond the range."""
        width = max((high - low) / count, 1e-9)
        middles = low + width * (np.arange(count) + 0.5)
        return cls(np.array([float(f"{m:.3g}") for m in middles]), float(f"{width:.3g}"))

    def of(self, values: np.ndarray) -> np.ndarray:
        """(N, k) of (N, 1) values."""
        return np.maximum(0.0, 1.0 - np.abs(values - self.middles) / self.width)

    def texts(self, name: str) -> list[str]:
        """Formulas of each hump over a name, as the effect `equation` takes them."""
        return [f"max(0, 1 - abs({name} - {m:g})/{self.width:g})" for m in self.middles]


def pushed(own: Opened, shares: np.ndarray) -> dict[int, np.ndarray]:
    """Values along the room's x, then its y, by (N, K) shares of what is typical."""
    pushes = TYPICAL["vx_mps"] * shares
    c, s = (f(own.response.heading_rad)[:, None] * pushes for f in (np.cos, np.sin))
    return {0: np.hstack([c, s]), 1: np.hstack([-s, c])}
