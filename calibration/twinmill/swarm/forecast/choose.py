# SPDX-License-Identifier: Apache-2.0
"""Which cells tell most: whether the model is right at all, and which of its numbers are."""

import numpy as np

from twinmill.swarm.forecast.draws import Forecast

WORLDS = 400  # imagined, over which the expectation is taken
FLOOR = 1e-6


def choose(expected: Forecast, count: int, repeats: int, seed: int) -> list[tuple[int, float]]:
    """Cells one by one, each for what it adds to those before it.

    The information is that of the outcomes about which hypothesis holds: half of the belief is in
    the base rate of the classes, whatever the cell, half in the models drawn, each alike. It is the
    expected fall of the entropy over hypotheses (Lindley 1956), over imagined worlds.

    Args:
        expected: in all cells.
        count: cells to choose.
        repeats: runs of each.
        seed: of the imagined worlds.

    Returns:
        Cells, with the information in bits of all up to each.
    """
    random = np.random.default_rng(seed)
    models = len(expected.draws)
    base = np.broadcast_to(expected.base_rate, expected.share.shape)
    said = np.concatenate([base[None], expected.draws])  # (H, C, K)
    belief = np.array([0.5, *np.full(models, 0.5 / models)])
    true = random.choice(len(said), WORLDS, p=belief)
    outcome = random.multinomial(repeats, said[true])  # (W, C, K)
    likely = np.einsum("wck,hck->cwh", outcome, np.log(np.maximum(said, FLOOR)))
    so_far = np.tile(np.log(belief), (WORLDS, 1))
    before = _entropy_bits(so_far)
    found: list[tuple[int, float]] = []
    left = list(range(len(likely)))
    while left and len(found) < count:
        told = [before - _entropy_bits(so_far + likely[c]) for c in left]
        best = int(np.argmax(told))
        cell = left.pop(best)
        so_far = so_far + likely[cell]
        found.append((cell, float(told[best])))
    return found


def _entropy_bits(log_weight: np.ndarray) -> float:
    """Mean over worlds of (W, H) beliefs, not normalised."""
    weight = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
    p = weight / weight.sum(axis=1, keepdims=True)
    return float(-np.sum(p * np.log2(np.maximum(p, 1e-300)), axis=1).mean())
