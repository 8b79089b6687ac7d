# SPDX-License-Identifier: Apache-2.0
"""How probably a diagnosis would name an effect, from what its signature leaves."""

import numpy as np
from scipy.stats import ncx2, norm

from twinmill.experiment.relevance import Relevance

ALPHA = 0.01  # chance of accepting anything if nothing is missing, over all candidates
TIE_CHI2 = 6.0  # difference of held-out chi2 that decides nothing
ALIKE = 0.9  # share of a signature that another effect imitates
FAINT_CHI2 = 2 * TIE_CHI2  # of what is not imitated: the difference is often no more than that
STRENGTHS = (0.4, 1.0, 2.5)  # times the usual, each as probable


def power(
    margins: np.ndarray,
    parameters: np.ndarray,
    *,
    candidates: int,
    relevance: Relevance,
    fitted: np.ndarray,
) -> np.ndarray:
    """Chance that each effect, if it is the one, is named.

    That is if it is accepted, told from its nearest rival, and matters enough. Where no log tells
    its strength, the mean over STRENGTHS.

    Args:
        margins: (T, 1 + J) over the scatter: with the base to imitate it, then each rival besides.
        parameters: (T,) how many each effect has.
        candidates: how many effects the threshold allows for.
        relevance: what they add to the score.
        fitted: (T,) whether the logs tell the strength.

    Returns:
        (T,) 0..1.
    """
    of_strength = {
        s: np.minimum(named_apart(s**2 * margins, parameters, candidates), relevance.chance(s))
        for s in STRENGTHS
    }
    return np.where(fitted, of_strength[1.0], np.mean(list(of_strength.values()), axis=0))


def named_apart(margins: np.ndarray, parameters: np.ndarray, candidates: int) -> np.ndarray:
    """(T,) chance that each effect is accepted and told from its nearest rival.

    Fitted to one half of the data and judged on the other, an effect's fall of chi2 is short by
    three times its number of parameters of that where it was fitted, a noncentral chi-square.
    Against a rival the difference of two fits decides: normal, of variance four times its mean.
    """
    whole, against = margins[:, 0], margins[:, 1:]
    threshold = 2 * np.log(candidates / ALPHA) + 3 * parameters
    accepted = ncx2.sf(threshold, parameters, np.maximum(whole, 1e-9))
    nearest = against.min(axis=1)
    tied = nearest < np.maximum((1 - ALIKE) * whole, FAINT_CHI2)
    ahead = (nearest - np.where(tied, TIE_CHI2, 0.0)) / (2 * np.sqrt(np.maximum(nearest, 1e-9)))
    return np.minimum(accepted, norm.cdf(ahead))


def percent(chance: float) -> str:
    """A chance for people; none is certain."""
    return (
        "over 99 %" if chance > 0.99 else "under 1 %" if chance < 0.01 else f"{100 * chance:.0f} %"
    )
