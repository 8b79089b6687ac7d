# SPDX-License-Identifier: Apache-2.0
"""Scatter of the errors that a model leaves, along each effect's signature.

An effect's signature is how the whitened errors would change if it were there. What the base could
imitate is projected out of it (Rao 1948; Cox and Hinkley 1974, sec. 9.3).
"""

import numpy as np

from twinmill.experiment.candidates import Candidate
from twinmill.experiment.one_step_fit import HUBER_SIGMA, System
from twinmill.model.parameters import Parameter
from twinmill.predict.modelled_log import ModelledLog

EFFECT_PRIOR = 2.0  # standard deviation of an effect over its usual strength


def excesses(
    logs: list[ModelledLog], base: list[Parameter], found: list[tuple[Candidate, np.ndarray]]
) -> list[float]:
    """Scatter of block scores along each candidate over that of noise alone, at least 1.

    Args:
        logs: with the model that lacks the candidates.
        base: parameters that are refitted beside each.
        found: candidates with their columns.
    """
    system = System(logs, base)
    left, basis = project_out(system)
    blocks = system.blocks()
    of_priors = len(system.unknowns)
    signatures = [np.pad(columns, ((0, of_priors), (0, 0))) for _, columns in found]
    signatures = [s - basis @ (basis.T @ s) for s in signatures]
    kept = len(blocks)
    return [
        _excess(s[:kept], c.strength, left[:kept], blocks)
        for s, (c, _) in zip(signatures, found, strict=True)
    ]


def project_out(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Robust whitened errors without what the free quantities explain, and a basis of these."""
    residual = system.residuals(system.start)
    residual = np.clip(residual, -HUBER_SIGMA, HUBER_SIGMA)
    jacobian = system.jacobian(system.start)
    jacobian = jacobian[:, np.linalg.norm(jacobian, axis=0) > 0]
    basis, _ = np.linalg.qr(jacobian)
    return residual - basis @ (basis.T @ residual), basis


def _excess(rows: np.ndarray, strength: np.ndarray, left: np.ndarray, blocks: np.ndarray) -> float:
    """Scatter of a signature's block scores after the estimate is taken out, over the noise's."""
    # The weak prior keeps apart what the log cannot.
    gram = rows.T @ rows + np.diag(1 / (EFFECT_PRIOR * strength) ** 2)
    scores = np.zeros((blocks.max() + 1, rows.shape[1]))
    np.add.at(scores, blocks, rows * left[:, None])
    delta = np.linalg.solve(gram, scores.sum(0))
    np.subtract.at(scores, blocks, rows * (rows @ delta)[:, None])
    return max(1.0, float(np.trace(np.linalg.solve(gram, scores.T @ scores)) / rows.shape[1]))
