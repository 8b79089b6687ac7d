# SPDX-License-Identifier: Apache-2.0
"""Information of a run, as SciPy and algebra have it."""

import numpy as np
from scipy import stats
from scipy.spatial.distance import jensenshannon

from twinmill.swarm.experiments import divergence_bits, entropy_bits


def test_information_of_a_run_is_that_of_scipy():
    a, b = np.random.default_rng(2).dirichlet(np.ones(4), size=(2, 5))
    np.testing.assert_allclose(entropy_bits(a), stats.entropy(a, base=2, axis=1))
    np.testing.assert_allclose(divergence_bits(a, b), jensenshannon(a, b, base=2, axis=1) ** 2)
    apart = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    np.testing.assert_allclose(divergence_bits(*apart), 1.0)
