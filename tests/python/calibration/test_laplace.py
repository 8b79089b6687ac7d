# SPDX-License-Identifier: Apache-2.0
"""Laplace's evidence of Bernoulli draws. Truth: quadrature by scipy, and a normal's algebra."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal, norm, truncnorm

from twinmill.inference.laplace import Prior, laplace

MISS = 0.05
STD = 0.2


def misses(count: int, frames: int):
    """Log likelihood of so many missed frames, by the rate of `missed_detection`'s card."""

    def told(rate: float) -> float:
        miss = np.clip(MISS + rate * (1 - MISS if rate > 0 else MISS), 1e-12, 1 - 1e-12)
        return float(count * np.log(miss) + (frames - count) * np.log(1 - miss))

    return told


@pytest.mark.parametrize(("count", "frames"), [(30, 200), (12, 200), (0, 400), (60, 60), (2, 20)])
@pytest.mark.parametrize("dispersion", [1.0, 3.0])
def test_evidence_is_the_integral(count, frames, dispersion):
    """To a nat: also at a bound, and at 0, where the rate of the card changes its scale."""
    told = misses(count, frames)
    prior = Prior(*(np.array([v]) for v in (0.0, STD, -1.0, 1.0, 0.1)), [{0}])
    mode = minimize_scalar(
        lambda r: 0.5 * (r / STD) ** 2 - told(r), bounds=(-1, 1), method="bounded"
    ).x
    found = laplace(lambda x, _: np.array([told(x[0])]), np.array([mode]), prior)
    within = norm.cdf(1, scale=STD) - norm.cdf(-1, scale=STD)
    top = max(told(r) for r in np.linspace(-1, 1, 2001)) / dispersion

    def density(rate: float) -> float:
        return np.exp(told(rate) / dispersion - top) * norm.pdf(rate, scale=STD) / within

    exact = np.log(quad(density, -1, 0)[0] + quad(density, 0, 1)[0]) + top
    assert found.log_evidence(dispersion) == pytest.approx(exact, abs=1.0)


def test_evidence_of_a_normal_is_exact():
    """Two numbers, of which two parts of the data tell one each, and both their sum."""
    random = np.random.default_rng(1)
    design, std = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]]), np.array([0.5, 2.0])
    data = random.normal(size=3)

    def told(x, of):
        each = norm.logpdf(data - design @ x)
        return each if of is None else np.where(np.isin(np.arange(3), sorted(of)), each, 0)

    wide = np.full(2, 1e3)
    precision = design.T @ design + np.diag(1 / std**2)
    mode = np.linalg.solve(precision, design.T @ data)
    prior = Prior(np.zeros(2), std, -wide, wide, np.ones(2), [{0, 2}, {1, 2}])
    cov = np.eye(3) + design @ np.diag(std**2) @ design.T
    found = laplace(told, mode, prior)
    assert found.log_evidence() == pytest.approx(multivariate_normal(cov=cov).logpdf(data))
    value, spread = found.posterior()
    assert value == pytest.approx(mode)
    assert spread == pytest.approx(np.sqrt(np.diag(np.linalg.inv(precision))))


def test_a_size_of_one_sign_has_half_a_normal():
    """A likelihood that falls from the bound on: its posterior is a truncated normal."""
    told = norm(-0.3, 0.4).logpdf
    prior = Prior(*(np.array([v]) for v in (0.0, 1.0, 0.0, 9.0, 1.0)), [{0}])
    found = laplace(lambda x, _: np.array([told(x[0])]), np.zeros(1), prior)
    exact = np.log(quad(lambda x: np.exp(told(x)) * 2 * norm.pdf(x), 0, 9)[0])
    assert found.log_evidence() == pytest.approx(exact, abs=1e-3)
    share = 1 / (1 + 0.4**2)
    spread = np.sqrt(share) * 0.4
    middle = -0.3 * share
    same = truncnorm(-middle / spread, np.inf, middle, spread)
    assert found.posterior()[0][0] == pytest.approx(same.mean(), rel=1e-3)
