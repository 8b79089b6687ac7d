# SPDX-License-Identifier: Apache-2.0
"""Models with a formula predict other drives of robots that have what no effect says.

The robots are no twin: each hides something of its own, written here in NumPy over whole motions.
"""

import numpy as np
import pytest

from twinmill.diagnosis.explain import Explanation, explain
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names

STEP_S = 1 / 480  # of the robot


def followed(goal: np.ndarray, lag_s: float) -> np.ndarray:
    """(K, n) what goes to (K, n) with a first-order lag, from 0."""
    found, now = np.empty_like(goal), np.zeros(goal.shape[1])
    for k, to in enumerate(goal):
        now = now + STEP_S / lag_s * (to - now)
        found[k] = now
    return found


def gripping_after_rests(motion: np.ndarray) -> np.ndarray:
    """Less way after each start, as on tyres that have to be warm."""
    moves = (np.abs(motion).max(axis=1, keepdims=True) > 0.01) * 1.0
    return motion * (0.75 + 0.25 * followed(moves, 0.8))


def resonant(motion: np.ndarray) -> np.ndarray:
    """A quarter less around 0.2 m/s."""
    speed = np.hypot(motion[:, 0], motion[:, 1])
    share = 1 - 0.25 * np.exp(-(((speed - 0.2) / 0.05) ** 2))
    return motion * np.column_stack([share, share, np.ones(len(share))])


def creeping(motion: np.ndarray) -> np.ndarray:
    """A fifth of each speed comes late, whatever moves: as wheels do on soft gears."""
    return 0.8 * motion + 0.2 * followed(motion, 0.6)


def switched(motion: np.ndarray) -> np.ndarray:
    """A tenth less while something else takes power, every 16 s of the run."""
    t_s = np.arange(len(motion)) * STEP_S
    return motion * (1 - 0.1 * (np.sin(2 * np.pi * t_s / 16 - 1.0) > 0.3))[:, None]


@pytest.fixture
def hiding(tanh_robot):
    """A robot whose motion is hindered so."""

    def make(hindered):
        class Hiding(tanh_robot):
            def hindered(self, motion):
                return hindered(motion)

        return Hiding()

    return make


@pytest.fixture
def explained(measure, hiding, one_clock_base, tmp_path):
    """What `explain` makes of drives of 80 s each."""

    def make(hindered, *seeds) -> Explanation:
        logs = [measure(hiding(hindered), seed, 80.0) for seed in seeds]
        return explain(logs, one_clock_base, out=tmp_path / "explained.toml", command="")

    return make


@pytest.mark.parametrize("hindered", [gripping_after_rests, resonant, creeping])
def test_a_model_with_the_formula_predicts_a_drive_that_nobody_fitted(
    explained, hiding, measure, one_clock_base, hindered
):
    """Errors over the log's own noise: 1 is all that can be had."""
    result = explained(hindered, 101)
    assert result.formula and result.formula.kept
    other = [measure(hiding(hindered), 77, 60.0)]
    with_it = compare(other, ModelFile.load(str(result.path))).score
    assert with_it < 1.1 < 1.3 < compare(other, one_clock_base).score


def test_a_formula_of_the_moments_of_one_run_is_told_and_not_taken(explained):
    result = explained(switched, 101)
    assert result.diagnosis.rest.proven.names_time
    assert "one run" in result.formula.why_not and not result.formula.kept
    assert "equation" not in effect_names(ModelFile.load(str(result.path)).model)


def test_moments_that_two_runs_share_are_taken(explained):
    result = explained(switched, 101, 102)
    assert result.formula.kept
    assert "equation" in effect_names(ModelFile.load(str(result.path)).model)
