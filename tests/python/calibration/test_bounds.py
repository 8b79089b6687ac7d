# SPDX-License-Identifier: Apache-2.0
"""Normal distributions that end at bounds, against SciPy's and against an integral."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import Normal, multivariate_normal, norm

from twinmill.inference.bounds import log_within
from twinmill.inference.evidence import Linear
from twinmill.inference.hypothesis import Hypothesis


@pytest.mark.parametrize(
    "low, high",
    [(-1, 2), (0, np.inf), (-np.inf, -3), (30, 31), (-41, -40), (-np.inf, np.inf), (5, 5.0001)],
)
def test_share_within_bounds_is_scipys(low, high):
    mean, std = 0.25, 0.5
    expected = Normal(mu=mean, sigma=std).logcdf(low, high)
    assert log_within(low, high, mean, std) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def bounded(low, high, std):
    """A hypothesis of two numbers, about zero, at their prior."""
    return Hypothesis(
        effects=(), model=None, labels=("base.a", "base.b"), named=np.ones(2, bool),
        mean=np.zeros(2), cov=np.diag(std**2), low=low, high=high, step=np.ones(2),
        value=np.zeros(2), grid={}, slopes=np.zeros((2, 25, 1)), errors=np.zeros((25, 1)),
    )  # fmt: skip


@pytest.mark.parametrize("truth", [0.4, 3.0])
def test_evidence_of_a_number_that_ends_at_its_bounds_is_the_integral_between_them(truth):
    """One number of a base and one of an effect, which the data want within or beyond its bound."""
    random = np.random.default_rng(4)
    x, std = random.normal(size=(2, 25)), np.array([0.5, 0.8])
    y = x.T @ [0.3, truth] + random.normal(size=25)
    low, high = 0.1, 1.5
    rest = multivariate_normal(np.zeros(25), np.eye(25) + std[0] ** 2 * np.outer(x[0], x[0]))
    peak = rest.logpdf(y - high * x[1])

    def density(value):
        return norm(0, std[1]).pdf(value) * np.exp(rest.logpdf(y - value * x[1]) - peak)

    area = quad(density, low, high, epsabs=0, epsrel=1e-11)[0]
    share = norm(0, std[1]).cdf(high) - norm(0, std[1]).cdf(low)
    expected = np.log(area / share) + peak
    linear = Linear.of(y, std[:, None] * x)
    h = bounded(np.array([-np.inf, low]), np.array([np.inf, high]), std)
    constant = multivariate_normal(np.zeros(25), np.eye(25)).logpdf(np.zeros(25))
    assert h.log_evidence(linear) + constant == pytest.approx(expected, abs=1e-7)
