# SPDX-License-Identifier: Apache-2.0
"""A better model's duty table gets more nodes where the log tells that it is no straight line."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from twinmill.diagnosis.better import better
from twinmill.diagnosis.infer import infer
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.inference.curve import log_odds_of_curve, straight

LABELS = (*(f"base.wheel_speed_mps.{k}" for k in (1, 2, 3, 4)), "base.yaw_gain")
BENDS = np.array([[1, -0.5, 0, 0, 0], [0, -0.5, 1, -0.5, 0]])  # of nodes 1 and 3; speed 0 at duty 0


@dataclass(frozen=True)
class Numbers:
    """Labels, mean and covariance, as those of a hypothesis."""

    labels: tuple[str, ...]
    mean: np.ndarray
    cov: np.ndarray


def drawn(seed):
    """Prior (mean, cov) of five numbers, slopes of thirty readings, and these with unit noise."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(5, 5))
    slopes = random.normal(size=(30, 5))
    return random.normal(size=5), root @ root.T, slopes, random.normal(size=30)


def on_lines(mean, cov):
    """Basis of numbers without bends, and mean and covariance of their weights given that."""
    basis = null_space(BENDS)
    precise = np.linalg.inv(cov)
    within = np.linalg.inv(basis.T @ precise @ basis)
    return basis, within @ basis.T @ precise @ mean, within


@pytest.mark.parametrize("seed", range(4))
def test_odds_of_a_curve_are_the_ratio_of_the_evidences(seed):
    mean, cov, slopes, y = drawn(seed)
    basis, middle, within = on_lines(mean, cov)
    noise = np.eye(len(y))
    curve = multivariate_normal(slopes @ mean, slopes @ cov @ slopes.T + noise).logpdf(y)
    seen = slopes @ basis
    line = multivariate_normal(seen @ middle, seen @ within @ seen.T + noise).logpdf(y)
    told = np.linalg.inv(np.linalg.inv(cov) + slopes.T @ slopes)
    known = told @ (np.linalg.solve(cov, mean) + slopes.T @ y)
    h = SimpleNamespace(labels=LABELS, mean=mean, cov=cov, posterior=lambda linear: (known, told))
    own = SimpleNamespace(hypothesis=h, linear=None)
    assert log_odds_of_curve(own) == pytest.approx(curve - line, abs=1e-6)


def test_a_straight_table_has_the_posterior_of_its_own_nodes():
    mean, cov, *_ = drawn(7)
    basis, middle, within = on_lines(mean, cov)
    found = straight(Numbers(LABELS, mean, cov))
    assert found.mean == pytest.approx(basis @ middle)
    assert found.cov == pytest.approx(basis @ within @ basis.T)


def test_no_table_has_no_curve():
    h = SimpleNamespace(labels=("base.yaw_gain",))
    assert log_odds_of_curve(SimpleNamespace(hypothesis=h, linear=None)) == -np.inf


def test_a_sheet_of_two_speeds_gets_the_nodes_that_a_bent_curve_needs(
    measure, model_file, tmp_path
):
    """The robot's speed is a hyperbolic tangent of its duty: another run is predicted better."""
    sheet = model_file(
        ("[0, 25, 50, 75, 100]", "[0, 50, 100]"), ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.2, 0.4]")
    )
    run, later = [measure(seed=3)], [measure(seed=4)]
    fitted = fit(run, sheet, tmp_path / "fitted.toml", "").child
    found = infer(run, sheet)
    told = better(found, sheet, tmp_path / "better.toml", "").file
    assert found.curved and len(told.model.for_robot(3).values()) > len(sheet.model.values())
    assert compare(later, told).score < compare(later, fitted).score
