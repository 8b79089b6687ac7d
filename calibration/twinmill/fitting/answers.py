# SPDX-License-Identifier: Apache-2.0
"""Test for commands that respond to errors of the robot, as those of a controller do.

What the robot is told can say nothing of what disturbed it before. Where a controller closes the
loop, it does: commands late in a prediction tell of errors early in it, and a response to commands
that is fitted to where predictions end is better than any physics can be (Ljung 1999, section
13.4). The noise floor is too low then.
"""

from typing import NamedTuple

import numpy as np

from twinmill.chance import t_quantile
from twinmill.predict.datasets import BLOCK_S
from twinmill.predict.windows import HORIZONS_S

EARLY, LATE = HORIZONS_S.index(1.0), HORIZONS_S.index(2.0)
FEWEST = 4  # blocks
LEAST, LEAST_OF_TWO = 0.2, 0.1  # early error for each metre or radian that late commands add
CHANCE = 0.005  # of so large a slope in any channel where commands tell of no error
CHANCE_OF_TWO = 0.01  # the same of the mean t of two channels, as if they were one


class Slope(NamedTuple):
    """Slope of early errors over what late commands add, its t, and the number of blocks."""

    value: float
    t: float
    blocks: int

    def beyond(self, chance: float) -> bool:
        """True if so large a slope has less than this chance where there is none."""
        return self.t > t_quantile(1 - chance, self.blocks - 1)


def are_answers(errors: np.ndarray, left: np.ndarray, start_s: np.ndarray) -> bool:
    """True if the response to late commands correlates with errors from before them.

    By least squares beside what early commands add; much in one channel, or some in two: a heading
    that strays takes the robot aside as well.

    Args:
        errors: (W, H, 3) of a physical model's predictions.
        left: (W, H, 3) of a response's, on parts that it was not fitted to; NaN where not judged.
        start_s: (W,) begins of the predictions.
    """
    added = errors - left
    late = added[:, LATE] - added[:, EARLY]
    block = np.floor((start_s - start_s[0]) / BLOCK_S).astype(int)
    slopes = [_slope(left[:, EARLY, c], added[:, EARLY, c], late[:, c], block) for c in range(3)]
    if any(s.value > LEAST and s.beyond(CHANCE / 3) for s in slopes):
        return True
    _, aside, turn = slopes
    both = aside._replace(t=(aside.t + turn.t) / 2)
    return min(aside.value, turn.value) > LEAST_OF_TWO and both.beyond(CHANCE_OF_TWO)


def _slope(y: np.ndarray, beside: np.ndarray, late: np.ndarray, block: np.ndarray) -> Slope:
    """Its standard error is by leaving out a block at a time; 0 where it cannot be told."""
    rows = np.column_stack([beside, late, y])
    seen = np.isfinite(rows).all(axis=1)
    rows, (_, own) = rows[seen], np.unique(block[seen], return_inverse=True)
    grams = np.zeros((own.max(initial=0) + 1, 3, 3))
    np.add.at(grams, own, rows[:, :, None] * rows[:, None, :])
    whole = grams.sum(axis=0)
    if len(grams) < FEWEST or np.linalg.matrix_rank(whole[:2, :2], hermitian=True) < 2:
        return Slope(0.0, 0.0, FEWEST)
    without = whole - grams
    slopes = np.linalg.solve(without[:, :2, :2], without[:, :2, 2:])[:, 1, 0]
    slope = np.linalg.solve(whole[:2, :2], whole[:2, 2])[1]
    std = np.sqrt((len(slopes) - 1) * np.var(slopes))
    return Slope(float(slope), float(slope / std), len(slopes))
