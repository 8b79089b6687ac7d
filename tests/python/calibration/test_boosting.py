# SPDX-License-Identifier: Apache-2.0
"""Boosting by groups: on data that are linear in one group, by algebra, and on noise alone."""

import numpy as np
import pytest

from twinmill.fitting.boosting import Learners, Parts, boosted

ROWS, PARTS, NOISE = 800, 8, 0.5


def learners(random):
    inside = np.repeat(np.arange(PARTS), ROWS // PARTS)
    parts = Parts(inside, inside, inside, PARTS)
    batches = [
        (random.normal(size=(ROWS, width)), np.split(np.arange(width), [first]))
        for width, first in ((13, 3), (34, 30))
    ]
    return Learners(batches, parts)


@pytest.mark.parametrize("seed", range(5))
def test_takes_the_groups_that_made_the_values_the_larger_first(seed):
    random = np.random.default_rng(seed)
    groups = learners(random)
    wide, narrow = random.normal(size=10), random.normal(size=4)
    wide, narrow = 2 * wide / np.linalg.norm(wide), narrow / np.linalg.norm(narrow)
    made = groups.rows_of(1) @ wide + groups.rows_of(3) @ narrow
    wanted = made + NOISE * random.normal(size=ROWS)
    assert [number for number, *_ in boosted(groups, wanted, ROWS)][:2] == [1, 3]


@pytest.mark.parametrize("seed", range(10))
def test_takes_nothing_from_noise(seed):
    random = np.random.default_rng(100 + seed)
    assert not list(boosted(learners(random), random.normal(size=ROWS), ROWS))


def test_what_is_left_of_a_part_is_predicted_without_it():
    random = np.random.default_rng(7)
    groups = learners(random)
    x = groups.rows_of(0).astype(float)
    wanted = x @ np.array([1.0, -2.0, 0.5]) + NOISE * random.normal(size=ROWS)
    _, number, ridge, each = groups.best(wanted)
    first = slice(0, ROWS // PARTS)
    rest = np.ones(ROWS, bool)
    rest[first] = False
    rise = ridge * np.mean((x**2).sum(axis=0)) * np.eye(3)
    alone = np.linalg.solve(x[rest].T @ x[rest] + rise, x[rest].T @ wanted[rest])
    assert number == 0
    assert each[0] == pytest.approx(alone, rel=1e-4)
    assert groups.left(wanted, number, each)[first] == pytest.approx(
        wanted[first] - x[first] @ alone, abs=1e-3
    )


def test_sums_over_cells_give_those_of_rows_inside_each_part_and_apart_from_it():
    random = np.random.default_rng(3)
    count, rows = 5, 400
    inside = random.integers(0, count, rows)
    ends, begins = (np.where(random.random(rows) < 0.4, (inside + k) % count, inside)
                    for k in (1, -1))  # fmt: skip
    parts = Parts(inside, ends, begins, count)
    order = parts.order
    values = random.normal(size=rows)[order]
    parts = parts.at(order)
    own, others = parts.summed(np.array([values[cell].sum() for cell in parts.cells]))
    inside, ends, begins = inside[order], ends[order], begins[order]
    for k in range(count):
        touches = (inside == k) | (ends == k) | (begins == k)
        assert own[k] == pytest.approx(values[inside == k].sum())
        assert others[k] == pytest.approx(values[~touches].sum())
