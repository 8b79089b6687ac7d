# SPDX-License-Identifier: Apache-2.0
"""How often an alarm is false, by the user's own healthy runs.

Were a new run like the healthy ones, its score would be as likely to have any rank among theirs as
any other. So an alarm where its rank is among the highest share `rate` is false in no more than
that share of comparisons, however scores are distributed (Vovk, Gammerman and Shafer 2005,
Algorithmic learning in a random world, section 2.2).
"""

import math
from collections.abc import Sequence


def rank_p(score: float, healthy: Sequence[float]) -> float:
    """Share of the runs, the new one included, whose score is no less than the new one's."""
    return (1 + sum(h >= score for h in healthy)) / (len(healthy) + 1)


def promised(rate: float, count: int) -> float:
    """The least rate of false alarms, no less than `rate`, that so many healthy runs can promise.

    Args:
        rate: that is asked for.
        count: of healthy runs.
    """
    return max(rate, 1 / (count + 1))


def runs_for(rate: float) -> int:
    """Healthy runs from which on a rate can be promised."""
    return math.ceil(1 / rate - 1e-9) - 1
