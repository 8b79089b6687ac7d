# SPDX-License-Identifier: Apache-2.0
"""How many of the errors that a noise floor leaves are independent.

A heading that wanders shows in two channels at once, and one that wanders slowly in the next
prediction as well. Counted as if each were new, they are evidence for whatever resembles them.
"""

import numpy as np

from twinmill.predict.datasets import INDEPENDENT_S
from twinmill.predict.windows import EVERY_S, HORIZONS_S

LONGEST = HORIZONS_S.index(INDEPENDENT_S)
SURE = 2.0  # standard errors of a correlation of which there is none: below it counts as none
MOST_SIZE = 3.0  # times the median size: errors beyond are as large
MOST = 0.9  # correlation with the next prediction
LATEST = 5  # predictions, up to which a wander is followed


def independent_shares(errors: np.ndarray, start_s: np.ndarray) -> np.ndarray:
    """(3,) share of the errors of each channel that are independent; 1 where that is not known.

    Of n channels of one disturbance each tells one nth (Kish 1965, section 8.2). Of a first-order
    process of correlation r from one prediction to the next (1 - r) / (1 + r) count (Bayley and
    Hammersley 1946).

    Args:
        errors: (W, H, 3) of a smooth response; NaN where not judged.
        start_s: (W,) ascending begins of the predictions.
    """
    own = _of_size_one(errors[:, LONGEST])
    alike = _correlations(own, own)
    after, there = following(start_s)
    again = np.diag(_correlations(own[there], own[after])).clip(0.0, MOST)
    return _fresh(again) / np.sum(alike**2, axis=0).clip(1.0)


def fresh_shares(errors: np.ndarray, made: np.ndarray, start_s: np.ndarray) -> tuple[float, float]:
    """Shares of a log's evidence for what explains its errors that are new, and told once.

    What each prediction says of it is the product of what is made and what is left. A slow wander
    says it again in the next prediction, but not of what comes at each start; and one disturbance
    says it in several channels. So sums of these products vary by more than if each were new (Newey
    and West 1987).

    Args:
        errors: (W, 3) of the longest horizon that are left, over their sizes; NaN where not judged.
        made: (W, 3) of what was explained.
        start_s: (W,) ascending begins of the predictions.
    """
    each = np.nan_to_num(errors * made)
    each -= each.mean(axis=0)
    every = each.sum(axis=1)
    square, alone = np.mean(every**2), np.sum(np.mean(each**2, axis=0))
    if square <= 0:
        return 1.0, 1.0
    return 1 / (1 + 2 * _again(every, start_s) / square), float(min(alone / square, 1.0))


def _again(every: np.ndarray, start_s: np.ndarray) -> float:
    """Sum of the covariances of (W,) values with those of later predictions, while they are alike.

    The first that is not ends it: those beyond are chance (Geyer 1992).
    """
    total = 0.0
    for later in range(1, LATEST + 1):
        after, there = following(start_s, later * INDEPENDENT_S)
        alike = float(np.mean(every[there] * every[after])) if len(there) else 0.0
        if alike <= 0:
            break
        total += alike
    return total


def told_before(errors: np.ndarray, start_s: np.ndarray) -> np.ndarray:
    """(C,) correlation of (W, C) errors of the longest horizon with those before, 0 to MOST."""
    own = _of_size_one(errors)
    after, there = following(start_s)
    return np.diag(_means(own[there], own[after])[0]).clip(0.0, MOST)


def along_the_way(errors: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """(W, 4) errors along the way that was gone, across it, of the heading, and the way it turned.

    A gain that wanders shows in the first and the last, with one sign in whatever direction the
    robot moves; a push aside and a turn in the others.

    Args:
        errors: (W, 3) m, m, rad of one horizon; NaN where not judged.
        moved: (W, 3) displacements.
    """
    forward, left, turned = errors.T
    course = np.arctan2(moved[:, 1], moved[:, 0])
    c, s = np.cos(course), np.sin(course)
    along, across = c * forward + s * left, c * left - s * forward
    return np.column_stack([along, across, turned, turned * np.sign(moved[:, 2])])


def fresh_of_blocks(again: float, block_s: float) -> float:
    """Share that counts of sums over blocks, of a correlation from prediction to prediction."""
    return float(_fresh(again ** (block_s / INDEPENDENT_S)))


def _fresh(again: np.ndarray) -> np.ndarray:
    """Share that counts of a first-order process of such correlations."""
    return (1 - again) / (1 + again)


def _of_size_one(errors: np.ndarray) -> np.ndarray:
    """(W, 3) errors, of which those of a while in which something happens are no larger than most.

    What a few share says nothing of all others.
    """
    known = np.where(np.isfinite(errors).any(axis=0), errors, 0.0)
    middle = np.nanmedian(np.abs(known), axis=0)
    cut = np.clip(errors, -MOST_SIZE * middle, MOST_SIZE * middle)
    size = np.sqrt(np.nanmean(np.where(middle > 0, cut, 1.0) ** 2, axis=0))
    return np.where(middle > 0, cut, np.nan) / size


def following(start_s: np.ndarray, later_s: float = INDEPENDENT_S) -> tuple[np.ndarray, np.ndarray]:
    """Predictions that begin so much later than others, and those others."""
    wanted_s = start_s + later_s
    at = np.searchsorted(start_s, wanted_s - EVERY_S / 2)
    there = np.flatnonzero(at < len(start_s))
    there = there[np.abs(start_s[at[there]] - wanted_s[there]) < EVERY_S]
    return at[there], there


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3, 3) of (W, 3) errors of size one; 0 where chance would make so much."""
    mean, count = _means(a, b)
    return np.where(np.abs(mean) > by_chance(count * EVERY_S), mean, 0.0)


def by_chance(span_s: np.ndarray | float) -> np.ndarray | float:
    """Up to which a correlation of predictions that span so long counts as none."""
    return SURE / np.sqrt(np.maximum(span_s / INDEPENDENT_S, 1))


def _means(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) mean products of (W, 3) errors, and of how many."""
    product = a[:, :, None] * b[:, None, :]
    count = np.isfinite(product).sum(axis=0)
    return np.nansum(product, axis=0) / np.maximum(count, 1), count
