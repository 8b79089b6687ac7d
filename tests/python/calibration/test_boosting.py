# SPDX-License-Identifier: Apache-2.0
"""Boosting by groups: on data that are linear in one group, by algebra, and on noise alone."""

import numpy as np
import pytest

from twinmill.fitting.boosting import Learner, Parts, boosted

ROWS, PARTS, NOISE = 800, 8, 0.5


def learners(random):
    inside = np.repeat(np.arange(PARTS), ROWS // PARTS)
    parts = Parts(inside, inside, inside, PARTS)
    groups = np.split(np.arange(47), np.cumsum((3, 10, 30)))
    return list(Learner.each(random.normal(size=(ROWS, 47)), parts, groups))


@pytest.mark.parametrize("seed", range(5))
def test_takes_the_groups_that_made_the_values_the_larger_first(seed):
    random = np.random.default_rng(seed)
    groups = learners(random)
    wide, narrow = random.normal(size=10), random.normal(size=4)
    wide, narrow = 2 * wide / np.linalg.norm(wide), narrow / np.linalg.norm(narrow)
    wanted = groups[1].x @ wide + groups[3].x @ narrow + NOISE * random.normal(size=ROWS)
    assert [number for number, _ in boosted(groups, wanted, ROWS)][:2] == [1, 3]


@pytest.mark.parametrize("seed", range(10))
def test_takes_nothing_from_noise(seed):
    random = np.random.default_rng(100 + seed)
    assert not list(boosted(learners(random), random.normal(size=ROWS), ROWS))


def test_what_is_left_of_a_part_is_predicted_without_it():
    random = np.random.default_rng(7)
    own = learners(random)[0]
    wanted = own.x @ np.array([1.0, -2.0, 0.5]) + NOISE * random.normal(size=ROWS)
    each = own.fitted(wanted, 1e-4)
    x, first = own.x.astype(float), own.within[0]
    rest = np.ones(ROWS, bool)
    rest[first] = False
    rise = 1e-4 * np.mean((x**2).sum(axis=0)) * np.eye(3)
    alone = np.linalg.solve(x[rest].T @ x[rest] + rise, x[rest].T @ wanted[rest])
    assert each[0] == pytest.approx(alone, rel=1e-4)
    assert own.left(wanted, each)[first] == pytest.approx(
        wanted[first] - x[first] @ alone, abs=1e-3
    )
