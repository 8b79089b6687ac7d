# SPDX-License-Identifier: Apache-2.0
"""Runs of one robot on several days, each judged against the mean of the others.

Each has its differences from the first run. What varies from day to day beyond the errors of a fit
is found from the runs themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.model.parameters import catalogue_name
from twinmill.runs.changes import Judged, Kind
from twinmill.runs.difference import BATTERY, Difference, follows_charge

# A lithium cell between full and empty: charges drawn evenly from that range spread the logarithm
# of the voltage by this standard deviation.
FULL_V, EMPTY_V = 4.2, 3.3
CHARGE_STD = float(np.log(FULL_V / EMPTY_V) / np.sqrt(12))


@dataclass(frozen=True)
class Day:
    """What one run tells of its robot.

    Attributes:
        values: (K,) its differences from the first run; zeros of that itself.
        errors: (K, K) their covariance, without the first run's part.
        metric: (K, K) likewise, by the curvature.
        blocks: of time that count as independent.
        charge_std: of the logarithm of all speeds, due to a charge that is not known.
    """

    values: np.ndarray
    errors: np.ndarray
    metric: np.ndarray
    blocks: int
    charge_std: float


def day_of(pair: Difference, run: int) -> Day:
    """One of the two runs of a pair; errors are shared out by how long each run is.

    Args:
        pair: differences of the second run from the first.
        run: 0 of the first, 1 of the second.
    """
    own, other = (pair.fit.datasets[k] for k in (run, 1 - run))
    share = other.covered_s / (own.covered_s + other.covered_s)
    return Day(
        run * pair.values,
        share * pair.covariance,
        share * pair.by_curvature,
        len(np.unique(own.block)),
        CHARGE_STD if _charge_is_missed(pair.fit.models[run]) else 0.0,
    )


def _charge_is_missed(model: native.Model) -> bool:
    return follows_charge(model) and BATTERY not in map(catalogue_name, model.effects)


def judged(day: Day, others: Sequence[Day], kinds: Sequence[Kind]) -> Judged:
    """A day against the mean of others.

    Args:
        day: it is not among the others.
        others: one at least.
        kinds: of changes that the robot may have.
    """
    count = len(others)
    nothing = np.zeros(len(day.values))
    common = next((k.direction for k in kinds if k.key == "wheels.all"), nothing)
    mean = np.mean([o.values for o in others], axis=0)
    natural = _between_days(others, mean, common)

    def own(of: Day, name: str) -> np.ndarray:
        return getattr(of, name) + of.charge_std**2 * np.outer(common, common)

    def summed(name: str) -> np.ndarray:
        mean_error = sum(own(o, name) for o in others) / count**2
        return own(day, name) + mean_error + natural * (1 + 1 / count)

    free = day.blocks + sum(o.blocks for o in others) - 1 - count
    return Judged(day.values - mean, summed("errors"), summed("metric"), max(free, 1), kinds)


def _between_days(others: Sequence[Day], mean: np.ndarray, common: np.ndarray) -> np.ndarray:
    """(K, K) variances between days beyond what errors and charges explain.

    By moments, no less than zero (DerSimonian and Laird 1986).
    """
    if len(others) < 2:
        return np.zeros((len(mean), len(mean)))
    squares = sum((o.values - mean) ** 2 for o in others) / (len(others) - 1)
    explained = [np.diag(o.errors) + o.charge_std**2 * common**2 for o in others]
    return np.diag(np.maximum(squares - np.mean(explained, axis=0), 0.0))
