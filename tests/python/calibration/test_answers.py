# SPDX-License-Identifier: Apache-2.0
"""Commands that answer how the robot strayed, by the algebra of least squares."""

import numpy as np

from twinmill.fitting.answers import are_answers

WINDOWS, HORIZONS, EVERY_S = 480, 5, 0.25


def predictions(random, answer, channels=(0,)):
    """(W, H, 3) errors of a model and of a response, and (W,) starts; 1 m of early error.

    Commands add 1 m at random early and late, and late what they answer to the early error.
    """
    errors, left = np.full((2, WINDOWS, HORIZONS, 3), np.nan)
    for c in channels:
        errors[..., c], left[..., c] = _of_channel(random, answer)
    return errors, left, EVERY_S * np.arange(WINDOWS)


def _of_channel(random, answer):
    early, before, script, noise = random.normal(size=(4, WINDOWS))
    late = script + answer * early
    errors, left = np.full((2, WINDOWS, HORIZONS), np.nan)
    left[:, 3], errors[:, 3] = early, early + before
    errors[:, 4] = early + before + late + noise
    left[:, 4] = early + noise
    return errors, left


def test_late_commands_that_hold_early_errors_are_answers():
    """Early error on late commands has the slope a / (1 + a^2), by least squares."""
    random = np.random.default_rng(1)
    assert all(are_answers(*predictions(random, 0.5)) for _ in range(20))
    by_script = [are_answers(*predictions(random, 0.0)) for _ in range(200)]
    assert np.mean(by_script) < 0.02  # three standard errors to one side: 0.1 %


def test_a_heading_and_what_it_takes_aside_need_less_each():
    """At a slope of 0.15, below the least of one channel."""
    random = np.random.default_rng(2)
    told = [
        [are_answers(*predictions(random, 0.15, channels)) for _ in range(100)]
        for channels in ((2,), (1, 2))
    ]
    assert np.mean(told[1]) > max(0.5, 2 * np.mean(told[0]))
    by_script = [are_answers(*predictions(random, 0.0, (1, 2))) for _ in range(200)]
    assert np.mean(by_script) < 0.02
