# SPDX-License-Identifier: Apache-2.0
"""Robots of a kind whose speeds or lag differ by more than those of the others.

A robot's number x_r, known to s_r, is that of its kind m give or take their spread t; or, with a
small probability, anything that a data sheet may say (random effects with a contaminating
component: Beath 2014, Research Synthesis Methods 5):

    p(x_r | m, t) = (1 - q) N(x_r; m, s_r^2 + t^2) + q N(x_r; m, s_r^2 + w^2)

Its probability to be odd is averaged over m and t.
"""

import numpy as np
from scipy.special import logsumexp

from twinmill.chance import normal_log_density
from twinmill.inference.settings import PRIORS

SPREAD = 0.03  # largest of speeds among robots of a kind, relative: see docs/inference.md
SPREADS = SPREAD * np.geomspace(0.1, 1.0, 6)  # that compete, equally likely as logarithms
MIDDLES = 401  # of a kind that compete, about all robots


def odd(
    values: np.ndarray, stds: np.ndarray, share: float = 1.0, member: float | None = None
) -> np.ndarray:
    """(R,) probability of each robot to be none of its kind in a number.

    Args:
        values: (R,) over what is usual.
        stds: (R,) of these; infinite where nothing is known.
        share: how much less well than speeds the number is known of a kind.
        member: value of one more that is known to be of the kind, as the robot of which the model
            was made; None where there is none.
    """
    known = np.isfinite(stds)
    own = np.zeros(len(values))
    if known.sum() + (member is not None) < 2:
        return own
    x, s = values[known], stds[known]
    ends = x if member is None else np.r_[x, member]
    m = np.linspace(ends.min() - SPREAD, ends.max() + SPREAD, MIDDLES)[:, None, None]
    t = share * SPREADS[:, None]
    alike = np.log(1 - PRIORS.stale) + normal_log_density(x, m, np.hypot(s, t))
    other = np.log(PRIORS.stale) + normal_log_density(x, m, np.hypot(s, share * PRIORS.sheet))
    either = np.logaddexp(alike, other)
    log = either.sum(axis=-1)
    if member is not None:
        log = log + normal_log_density(member, m, t)[..., 0]
    weights = np.exp(log - logsumexp(log))
    own[known] = np.einsum("mt,mtr->r", weights, np.exp(other - either))
    return own


def slopes(
    measured: np.ndarray, predicted: np.ndarray, block: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(C,) measured over predicted motion in each channel, and standard deviations.

    By regression through the origin, and the jackknife over blocks (Efron 1982).

    Args:
        measured: (W, C) displacements.
        predicted: likewise; a channel in which nothing is has an infinite standard deviation.
        block: (W,) number of the block of time.
    """
    of_block = np.unique(block, return_inverse=True)[1]
    products = np.array([np.bincount(of_block, c) for c in (measured * predicted).T])
    squares = np.array([np.bincount(of_block, c) for c in (predicted**2).T])
    count = squares.shape[1]
    rest = squares.sum(axis=1, keepdims=True) - squares
    drives = (rest > 0).all(axis=1) & (count > 1)
    value, std = np.ones(len(squares)), np.full(len(squares), np.inf)
    own = products[drives].sum(axis=1) / squares[drives].sum(axis=1)
    less = (products[drives].sum(axis=1, keepdims=True) - products[drives]) / rest[drives]
    value[drives] = own
    std[drives] = np.sqrt((count - 1) * less.var(axis=1))
    return value, std
