# SPDX-License-Identifier: Apache-2.0
"""A comparison of several logs speaks of all of them."""

import numpy as np
import pytest

from twinmill.fitting.compare import compare


def test_errors_beside_the_score_of_several_logs_are_of_all_of_them(
    tanh_robot, measure, true_model
):
    """Truth: root mean squares over the predictions of both; the second robot is more sluggish."""
    runs = [measure(tanh_robot(), 61, 20.0), measure(tanh_robot(lag_s=0.15), 62, 40.0)]
    found = compare(runs, true_model)
    told = found.to_json()
    both = np.sqrt(np.nanmean(np.concatenate([r.errors for r in found.robots]) ** 2, axis=0))
    assert [row["rms"] for row in told["errors"]] == pytest.approx(both.T.ravel(), rel=0.02)
    for robot, own in zip(told["robots"], found.robots, strict=True):
        alone = np.sqrt(np.nanmean(own.errors**2, axis=0))
        assert [row["rms"] for row in robot["errors"]] == pytest.approx(alone.T.ravel())
