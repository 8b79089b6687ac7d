# SPDX-License-Identifier: Apache-2.0
"""Nodes of a duty table that a better model gets: those that the given one has, or twice as many.

Inference has a node in the middle of each stretch (see `duties`). That all of them lie on the
straight lines between the others, A x = 0, is a hypothesis nested in that of a curve; its evidence
over the curve's is the density of A x at 0, posterior over prior (Dickey 1971, The Weighted
Likelihood Ratio, Annals of Mathematical Statistics 42). The table keeps its nodes where that is the
likelier one, and its speeds are those given A x = 0.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinmill.inference.duties import TABLE
from twinmill.inference.search import Evidence
from twinmill.inference.table import Numbers


def log_odds_of_curve(own: Evidence) -> float:
    """Log evidence that the middle nodes lie off the straight lines, over that of none that does.

    -inf of a robot that has no table.
    """
    h = own.hypothesis
    bends = _bends(h.labels)
    if not len(bends):
        return -np.inf
    posterior, prior = (
        _log_density_of_none(bends @ mean, bends @ cov @ bends.T)
        for mean, cov in (h.posterior(own.linear), (h.mean, h.cov))
    )
    return prior - posterior


def straight(numbers: Numbers) -> Numbers:
    """Posterior given that the middle nodes lie on the straight lines between the others."""
    bends = _bends(numbers.labels)
    if not len(bends):
        return numbers
    across = numbers.cov @ bends.T
    gain = across @ np.linalg.pinv(bends @ across, hermitian=True)
    mean = numbers.mean - gain @ bends @ numbers.mean
    return replace(numbers, mean=mean, cov=numbers.cov - gain @ across.T)


def _bends(labels: Sequence[str]) -> np.ndarray:
    """(M, N) middle nodes of N numbers, less the means of their neighbours; the speed at 0 is 0."""
    at = [k for k, label in enumerate(labels) if label.startswith(TABLE)]
    found = np.zeros((len(at) // 2, len(labels)))
    for m, row in enumerate(found):
        row[at[2 * m]] = 1.0
        row[[at[k] for k in (2 * m - 1, 2 * m + 1) if k >= 0]] = -0.5
    return found


def _log_density_of_none(mean: np.ndarray, cov: np.ndarray) -> float:
    """Log density of a normal distribution at 0, up to a constant."""
    return -0.5 * float(mean @ np.linalg.solve(cov, mean) + np.linalg.slogdet(cov)[1])
