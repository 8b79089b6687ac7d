# SPDX-License-Identifier: Apache-2.0
"""From when on a change is there: the moment of the second run that explains its errors best.

To first order about the fit to both runs, everything else is fitted anew for each moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.chance import chi2_above
from twinmill.runs.changes import RIVAL_CHI2, Change
from twinmill.runs.difference import Difference


@dataclass(frozen=True)
class Onset:
    """When a change begins.

    Attributes:
        at_s: since the second run's start; 0 where it is there from the start on.
        low_s, high_s: moments that explain the errors about as well.
    """

    at_s: float
    low_s: float
    high_s: float

    @property
    def from_start(self) -> bool:
        """It is there all the time, as far as the run tells."""
        return self.at_s == 0.0

    def to_json(self) -> dict[str, Any]:
        """Its moments."""
        return {"from_start": self.from_start, **vars(self)}


def onset(change: Change, beside: Sequence[Change], tested: Difference, rate: float) -> Onset:
    """Finds the moment.

    Args:
        change: what it is.
        beside: other changes, taken to be there from the start on.
        tested: differences that its direction is of; those that it does not name are taken for 0.
        rate: chance of a moment within a run all of which is changed, over all blocks.
    """
    start_s = tested.fit.trajectories[1].start_s
    gain = _gain_by_moment(change, beside, tested)
    best = int(np.argmax(gain))
    begin_s = float(start_s[0])
    blocks = len(np.unique(tested.fit.datasets[1].block))
    if best == 0 or chi2_above(gain[best] - gain[0], 1) * blocks > rate:
        return Onset(0.0, 0.0, 0.0)
    close = start_s[gain > gain[best] - RIVAL_CHI2]
    return Onset(*(float(t) - begin_s for t in (start_s[best], close.min(), close.max())))


def _gain_by_moment(change: Change, beside: Sequence[Change], tested: Difference) -> np.ndarray:
    """(W,) by how much chi squared falls for a change that begins with each prediction."""
    fit = tested.fit
    rows, slopes, _ = fit.whitened([0, 1])
    free, per_unit, held = _second_as_first(tested)
    for other in beside:
        held = held + per_unit @ other.kind.direction * other.value
    column = (slopes @ per_unit @ change.kind.direction)[-len(fit.state[0][1]) :]
    constant = rows - slopes @ (fit.x - held)  # at values of 0
    prior = np.diag(1 / fit.std)
    constant = np.concatenate([constant, (held - fit.usual) / fit.std])
    others = np.concatenate([slopes @ free, prior @ free])
    count = len(fit.trajectories[1].start_s)
    own = slice(len(rows) - len(column), len(rows))
    base = np.linalg.lstsq(others, -constant, rcond=None)[0]
    left = (constant + others @ base)[own]
    normal = np.linalg.pinv(others.T @ others)

    def from_each(parts: np.ndarray) -> np.ndarray:
        """Sums over the predictions from each one on."""
        by_window = parts.reshape(count, -1, *parts.shape[1:]).sum(axis=1)
        return np.cumsum(by_window[::-1], axis=0)[::-1]

    pull = from_each(left * column)
    square = from_each(column**2)
    mixed = from_each(column[:, None] * others[own])
    own_part = square - np.einsum("wi,ij,wj->w", mixed, normal, mixed)
    seen = own_part > 1e-9 * square.max()
    return np.where(seen, pull**2 / np.where(seen, own_part, 1.0), 0.0)


def _second_as_first(tested: Difference) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How unknowns are if the second run has the first one's numbers, but for some differences.

    Returns:
        (P, F) free unknowns; (P, K) unknowns per unit of each difference; (P,) what is held.
    """
    fit = tested.fit
    names = [u.parameter.name for u in fit.unknowns]
    free, held = np.eye(len(fit.x)), np.zeros(len(fit.x))
    per_unit = np.zeros((len(fit.x), len(tested.values)))
    second = [next(c for c in fit.columns[1] if names[c] == q.name) for q in tested.quantities]
    for k, (c, q) in enumerate(zip(second, tested.quantities, strict=True)):
        per_unit[c, k] = 1.0
        if q.paired:
            first = next(c for c in fit.columns[0] if names[c] == q.name)
            free[c, first] = 1.0
            per_unit[c, k] = fit.x[first] if q.unit == "1" else 1.0
        else:
            held[c] = fit.models[0].get(q.name)
    return np.delete(free, second, axis=1), per_unit, held
