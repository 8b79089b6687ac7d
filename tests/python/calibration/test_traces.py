# SPDX-License-Identifier: Apache-2.0
"""Traces of a motion, and information of a run, as their descriptions say: by SciPy and algebra."""

import numpy as np
from scipy import signal, stats
from scipy.spatial.distance import jensenshannon

from twinmill.fitting.dependence import fading, held, wound
from twinmill.swarm.experiments import divergence_bits, entropy_bits


def test_an_event_fades_by_e_in_its_time():
    events = np.random.default_rng(1).normal(size=(40, 2))
    step_s = np.full(40, 0.02)
    step_s[0] = step_s[20] = 0.0  # two stretches
    expected = signal.lfilter([1.0], [1.0, -np.exp(-0.02 / 0.4)], events, axis=0)
    np.testing.assert_allclose(fading(events, 0.4, step_s), expected)


def test_play_is_taken_up_over_its_width_and_stays_at_an_end():
    """Half of it in either direction is 0.1 m: from the middle 0.05 m are half of the way."""
    way_m = np.array([0.05, 0.05, 0.3, -0.05, -0.05, -0.1, -1.0])
    np.testing.assert_allclose(wound(way_m, 0.1), [0.5, 1, 1, 0.5, 0, -1, -1])


def test_a_small_change_is_not_taken():
    told = np.array([0.0, 0.1, 0.3, 0.4, 0.5, 0.45, 0.1])
    np.testing.assert_allclose(held(told, 0.25), [0, 0, 0.3, 0.3, 0.3, 0.3, 0.3])


def test_information_of_a_run_is_that_of_scipy():
    a, b = np.random.default_rng(2).dirichlet(np.ones(4), size=(2, 5))
    np.testing.assert_allclose(entropy_bits(a), stats.entropy(a, base=2, axis=1))
    np.testing.assert_allclose(divergence_bits(a, b), jensenshannon(a, b, base=2, axis=1) ** 2)
    apart = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    np.testing.assert_allclose(divergence_bits(*apart), 1.0)
