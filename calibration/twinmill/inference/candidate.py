# SPDX-License-Identifier: Apache-2.0
"""What an effect that a model may lack would change in a log."""

from dataclasses import dataclass

import numpy as np

from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import WHERE_OR_WHEN, Parameter


@dataclass(frozen=True)
class Candidate:
    """An effect that may be added to a model.

    Attributes:
        name: of the effect.
        parameters: of its newest instance.
        columns: (k, W, C) change of the errors by each size at its default strength.
        masks: (G, W) steps of each place or while; None where it acts everywhere.
        at: (G, P) values that belong to these, or to limits; None where it has neither.
        fixed: (G, W, C) change of the errors by limits, which have no size.
    """

    name: str
    parameters: list[Parameter]
    columns: np.ndarray
    masks: np.ndarray | None = None
    at: np.ndarray | None = None
    fixed: np.ndarray | None = None

    @property
    def sizes(self) -> list[int]:
        """Parameters that have a column."""
        return [k for k, p in enumerate(self.parameters) if is_size(p)]

    @property
    def one_sided(self) -> np.ndarray:
        """(k,) sizes that the card lets be positive only: their prior is half a normal one."""
        own = [self.parameters[k] for k in self.sizes]
        return np.array([p.min >= p.usual for p in own], bool)


def size_std(parameter: Parameter) -> float:
    """Standard deviation of the prior of an effect's size, in its unit."""
    return PRIORS.size * abs(parameter.strength) if is_size(parameter) else parameter.std


def is_size(parameter: Parameter) -> bool:
    """True of a parameter that says how strong an effect is, so that it has a column."""
    return parameter.role not in (*WHERE_OR_WHEN, "radius", "limit")
