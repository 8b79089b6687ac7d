# SPDX-License-Identifier: Apache-2.0
"""Runs of one robot on several days, each judged against the mean of the others.

Each has its differences from the first run. What varies from day to day beyond the errors of a fit
is found from the runs themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy.linalg import eigh

from twinmill.model.parameters import catalogue_name
from twinmill.runs.changes import Judged, Kind
from twinmill.runs.difference import BATTERY, Difference, follows_charge

# A lithium cell between full and empty: charges drawn evenly from that range spread the logarithm
# of the voltage by this standard deviation.
FULL_V, EMPTY_V = 4.2, 3.3
CHARGE_STD = float(np.log(FULL_V / EMPTY_V) / np.sqrt(12))


@dataclass(frozen=True)
class Day:
    """Quantities of a robot that one run tells.

    Attributes:
        values: (K,) its differences from the first run; zeros of that itself.
        variances: (K,) of their errors by leaving out blocks, without the first run's part.
        by_curvature: (K, K) covariance of their errors likewise, by the curvature of the cost.
        blocks: of time that count as independent.
        charge_std: of the logarithm of all speeds, due to a charge that is not known.
    """

    values: np.ndarray
    variances: np.ndarray
    by_curvature: np.ndarray
    blocks: int
    charge_std: float


def day_of(pair: Difference, run: int) -> Day:
    """One of the two runs of a pair; errors are shared out by how long each run is.

    Args:
        pair: differences of the second run from the first.
        run: 0 of the first, 1 of the second.
    """
    own, other = (pair.fit.trajectories[k] for k in (run, 1 - run))
    share = other.covered_s / (own.covered_s + other.covered_s)
    return Day(
        run * pair.values,
        share * np.diag(pair.covariance),
        share * pair.by_curvature,
        len(np.unique(own.block[np.repeat(own.keep, own.measured[0].size)])),
        CHARGE_STD if _charge_is_missed(pair.fit.models[run]) else 0.0,
    )


def _charge_is_missed(model: native.Model) -> bool:
    return follows_charge(model) and BATTERY not in map(catalogue_name, model.effects)


def steadier(choices: Sequence[Sequence[Day]], kinds: Sequence[Kind]) -> Sequence[Day]:
    """Those estimates of the same days by which changes show most among what days scatter.

    The day in question counts as any other, so that the choice favours none.
    """
    return max(choices, key=lambda days: _shown(np.array([d.values for d in days]), kinds))


def _shown(values: np.ndarray, kinds: Sequence[Kind]) -> float:
    """Sum of the logarithms of what (N, K) values of days tell of a unit of each change."""
    spread = np.cov(values.T)
    if len(values) - 1 <= values.shape[1]:
        spread = np.diag(np.diag(spread))
    told = np.linalg.pinv(spread)
    return float(sum(np.log(kind.direction @ told @ kind.direction) for kind in kinds))


def judged(days: Sequence[Day], k: int, kinds: Sequence[Kind]) -> Judged:
    """One of several days against the mean of the others.

    Args:
        days: two at least; the order of the others has no part in it.
        k: place of the day.
        kinds: of changes that the robot may have.
    """
    day, others = days[k], [*days[:k], *days[k + 1 :]]
    count, nothing = len(others), np.zeros(len(days[k].values))
    common = next((kind.direction for kind in kinds if kind.key == "wheels.all"), nothing)
    wider = _wider(days)
    errors = [_errors(d, wider, common) for d in days]
    own = errors.pop(k)
    mean = np.mean([o.values for o in others], axis=0)
    between = _between_days(others, mean, errors) * (1 + 1 / count)
    scatter = own + sum(errors) / count**2 + between
    free = sum(d.blocks for d in days) - len(days)
    return Judged(day.values - mean, scatter, max(free, 1), kinds)


def _wider(days: Sequence[Day]) -> np.ndarray:
    """(K,) how many times wider errors are by blocks than by the curvature, over all days.

    So the few blocks of a day decide how wide errors are, and not how they go together. Of two
    days alone nothing shows how drives and days differ: then they are no less than by the
    curvature, as in fits for evidence.
    """
    ratio = sum(d.variances for d in days) / sum(np.diag(d.by_curvature) for d in days)
    return np.sqrt(np.maximum(ratio, 1.0) if len(days) == 2 else ratio)


def _errors(day: Day, wider: np.ndarray, common: np.ndarray) -> np.ndarray:
    """(K, K) covariance of a day's numbers."""
    return day.by_curvature * np.outer(wider, wider) + day.charge_std**2 * np.outer(common, common)


def _between_days(
    others: Sequence[Day], mean: np.ndarray, errors: Sequence[np.ndarray]
) -> np.ndarray:
    """(K, K) covariance between days beyond their errors.

    By moments, and of what scatters less than the errors none (Amemiya 1985, The American
    Statistician 39). Days that are no more than the numbers tell only of each by itself.
    """
    if len(others) < 2:
        return np.zeros((len(mean), len(mean)))
    away = np.array([o.values - mean for o in others])
    found, within = away.T @ away / (len(others) - 1), np.mean(errors, axis=0)
    if len(others) <= len(mean):
        return np.diag(np.maximum(np.diag(found - within), 0.0))
    values, ways = eigh(found, within)
    ways = within @ ways  # these are orthonormal by the errors, and so made what they stand for
    return (ways * np.maximum(values - 1, 0.0)) @ ways.T
