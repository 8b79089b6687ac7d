# SPDX-License-Identifier: Apache-2.0
"""Change in a log by an effect that a model may lack."""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import WHERE_OR_WHEN, Parameter

FAR = 10.0  # standard deviation of unusual sizes over that of usual ones: a tracked point on a mast
LIMITS = np.geomspace(0.25, 8.0, 16)  # times the usual limit: each a fifth more than the last


@dataclass(frozen=True)
class Where:
    """Places or whiles at which an effect may act, G of them.

    Attributes:
        masks: (M, W) steps of each place, or from each moment on.
        at: (G, Q) values of the parameters that say where or when.
        ends: (G, 2) numbers of the masks at which each while begins and ends; None where each mask
            is a place, or a while that does not end.
    """

    masks: np.ndarray
    at: np.ndarray
    ends: np.ndarray | None = None


@dataclass(frozen=True)
class Limits:
    """Limits that an effect may set, G of them.

    Attributes:
        at: (G, P) values of its parameters.
        changes: (G, W, C) change of the errors by each.
    """

    at: np.ndarray
    changes: np.ndarray


@dataclass(frozen=True)
class Candidate:
    """An effect that may be added to a model.

    Attributes:
        name: of the effect.
        parameters: of its newest instance.
        columns: (k, W, C) change of the errors by each size at its default strength.
        where: it may act; None for everywhere.
        limits: it may set, which have no size; None where it has sizes.
    """

    name: str
    parameters: list[Parameter]
    columns: np.ndarray
    where: Where | None = None
    limits: Limits | None = None

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


def with_sizes(
    name: str,
    parameters: list[Parameter],
    model: Any,
    steps: Any,
    *,
    on: np.ndarray,
    where: Where | None = None,
) -> Candidate:
    """An effect with a column for each of its sizes.

    Args:
        name: of the effect.
        parameters: of its newest instance.
        model: with it.
        steps: of the log.
        on: (P,) values at which it does nothing, and acts everywhere.
        where: it may act, as of `Candidate`.
    """
    sizes = [k for k, p in enumerate(parameters) if is_size(p)]
    points = [on]
    for k in sizes:
        points.append(on.copy())
        points[-1][k] = parameters[k].value
    errors = steps.errors(model, [p.name for p in parameters], np.array(points))
    return Candidate(name, parameters, errors[0] - errors[1:], where)


def with_limits(name: str, parameters: list[Parameter], model: Any, steps: Any) -> Candidate:
    """An effect whose limits act or not: no column is linear in them."""
    usual, value = (np.array([getattr(p, k) for p in parameters]) for k in ("usual", "value"))
    low, high = (np.array([getattr(p, k) for p in parameters]) for k in ("min", "max"))
    limit = np.array([p.role == "limit" for p in parameters])
    others = (1.0,) if limit.all() else (0.0, 1.0)
    at = np.array(
        [
            np.where(limit, np.clip(factor * value, low, high), usual + other * (value - usual))
            for factor, other in product(LIMITS, others)
        ]
    )
    errors = steps.errors(model, [p.name for p in parameters], np.vstack([usual, at]))
    changes = errors[0] - errors[1:]
    return Candidate(name, parameters, changes[:0], limits=Limits(at, changes))
