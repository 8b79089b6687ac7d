# SPDX-License-Identifier: Apache-2.0
"""Errors of formulas that look like effects.

Each effect that a model has or that its base always misses is of a formula that is off by some of
its size. Where that error looks like a further effect of the catalogue, this is no news. Its size
has then the prior of such an error, not that of its card: Bayes factors of both priors, in the
model that is linear about the fit.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from twinmill.inference.bounds import log_within
from twinmill.inference.discrepancy import OF_FORM, SIZES
from twinmill.inference.evidence import Linear
from twinmill.inference.hypothesis import Hypothesis
from twinmill.model.parameters import instance_of


def log_odds(
    h: Hypothesis, linear: Linear, sizes: Mapping[str, float], *, norms: np.ndarray
) -> float:
    """Log evidence of some effects as errors of formulas, over that of effects of their own.

    Args:
        h: with these effects, which act everywhere and have sizes alone.
        linear: its linear model.
        sizes: of each of them, norm of what is of formulas that are off, as the noise weighs it.
        norms: (N,) of the slopes of all numbers, weighed likewise.
    """
    of = {h.instance(name): size for name, size in sizes.items()}
    at = [k for k, label in enumerate(h.labels) if instance_of(label) in of]
    each_of = [instance_of(h.labels[k]) for k in at]
    size = np.array([of[name] / np.sqrt(each_of.count(name)) for name in each_of])
    mean, cov = h.posterior(linear)
    own = h.cov[np.ix_(at, at)]
    inverse = np.linalg.inv(cov[np.ix_(at, at)])
    seen = _Seen(
        inverse - np.linalg.inv(own),
        inverse @ (mean - h.mean)[at],
        (h.low - h.mean)[at],
        (h.high - h.mean)[at],
    )
    usual = norms[at] / size
    card = 1 / np.diag(own)  # is as wide as the prior may be: of what the log does not show
    each = [seen.log_evidence(np.diag(1 / (card + (usual / s) ** 2))) for s in SIZES]
    return float(logsumexp(np.array(each) + np.log(OF_FORM))) - seen.log_evidence(own)


@dataclass(frozen=True)
class _Seen:
    """Likelihood of an effect's numbers about what is usual.

    Attributes:
        precision, push: (P, P), (P,) of it, where all is usual.
        low, high: (P,) bounds of its card. An error that looks like an effect of one sign has that
            sign: the opposite does not look like it.
    """

    precision: np.ndarray
    push: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def log_evidence(self, prior: np.ndarray) -> float:
        """Log evidence under N(0, prior) within the bounds."""
        grown = np.eye(len(self.push)) + prior @ self.precision
        mean = np.linalg.solve(grown, prior @ self.push)
        std = np.sqrt(np.diag(np.linalg.solve(grown, prior)))
        found = 0.5 * float(self.push @ mean - np.linalg.slogdet(grown)[1])
        before = log_within(self.low, self.high, np.zeros(len(mean)), np.sqrt(np.diag(prior)))
        return found + float(np.sum(log_within(self.low, self.high, mean, std) - before))
