# SPDX-License-Identifier: Apache-2.0
"""Sum of a score over data sets, and data that are left out together: algebra."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.measurement import Measurement
from twinmill.data.track import make_track
from twinmill.predict.datasets import PARTS, Trajectory, total_score


@pytest.fixture
def data(driven):
    """A circle of 60 s over a floor that differs from cell to cell."""
    made = Trajectory.of(Measurement.live(make_track(driven(60.0))))
    return made.over(np.random.default_rng(1).uniform(0.5, 2.0, (5, 3)))


def squared(data, errors):
    """Sum of the squares of what a prediction that errs so would leave."""
    return float(np.sum((np.nan_to_num(errors) * data.weight) ** 2))


def test_score_is_error_over_floor(data):
    unit = np.broadcast_to(data.floor, data.measured.shape).copy()
    assert squared(data, unit) == pytest.approx(1)
    assert squared(data, 2 * unit) == pytest.approx(4)
    # One of 15 cells three times its floor: (14 + 9) / 15.
    unit[:, 2, 1] *= 3
    assert squared(data, unit) == pytest.approx(23 / 15)


def test_what_is_masked_or_never_moves_does_not_count(data):
    unit = np.broadcast_to(data.floor, data.measured.shape).copy()
    keep = np.arange(len(unit)) % 3 > 0
    unit[~keep] *= 100
    assert squared(data.over(data.floor, keep), unit) == pytest.approx(1)
    still = data.floor.copy()
    still[:, 2] = 0.0
    assert squared(data.over(still, keep), unit) == pytest.approx(1)


def test_each_error_is_left_out_once_and_with_its_whole_block(data):
    assert set(data.part) == set(range(PARTS))
    for block in np.unique(data.block):
        assert len(set(data.part[data.block == block])) == 1
    # Blocks follow one another in time, so that each part holds early and late drives.
    first = [data.block[data.part == k].min() for k in range(PARTS)]
    assert sorted(first) == list(range(PARTS))


def test_every_third_start_sees_what_these_saw(data, model_file):
    """Errors of a prediction do not hang on what else is predicted; as many count as one error."""
    model, thin = model_file().model, data.thinned(3)
    assert thin.errors(model) == pytest.approx(data.errors(model)[::3], nan_ok=True)
    unit = np.broadcast_to(data.floor, data.measured.shape).copy()
    assert squared(thin, unit[::3]) == pytest.approx(1)
    assert thin.n_eff == pytest.approx(data.n_eff, rel=0.02)
    assert np.array_equal(thin.block.reshape(-1, 15), data.block.reshape(-1, 15)[::3])


def test_rows_are_errors_over_floor_and_come_back(data, model_file):
    model = model_file().model
    rows = data.rows(model, ["base.yaw_gain"], np.array([[model.get("base.yaw_gain")]]))[0]
    assert rows @ rows == pytest.approx(data.score(model) ** 2)
    assert data.as_errors(rows) == pytest.approx(data.errors(model), nan_ok=True)


def test_any_batch_gives_the_same_rows(data, model_file):
    model, values = model_file().model, np.linspace(0.5, 1.5, 5)[:, None]
    together = data.rows(model, ["base.yaw_gain"], values)
    alone = [data.rows(model, ["base.yaw_gain"], values[[i]])[0] for i in range(5)]
    assert np.array_equal(together, np.array(alone))
    assert len(np.unique(together[:, data.weight.reshape(-1) > 0], axis=0)) == 5


def test_score_of_several_is_the_geometric_mean_of_none_below_one():
    assert total_score([0.8]) == 0.8
    assert total_score([2.0, 8.0]) == pytest.approx(4.0)
    assert total_score([0.5, 4.0]) == pytest.approx(2.0)


def test_independent_errors_are_three_channels_every_two_seconds(data):
    assert data.n_eff.sum() == pytest.approx(3 * 60 / 2, rel=0.05)
    flat = data.floor.copy()
    flat[:, 2] = 0.0
    assert data.over(flat).n_eff.sum() == pytest.approx(2 * 60 / 2, rel=0.05)
    half = replace(data, keep=np.arange(len(data.keep)) % 2 == 0)
    assert half.n_eff.sum() == pytest.approx(data.n_eff.sum() / 2, rel=0.05)
