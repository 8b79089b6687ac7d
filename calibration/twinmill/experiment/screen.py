# SPDX-License-Identifier: Apache-2.0
"""Screens the catalogue by score test: how well each effect's signature fits what the model leaves.

An effect's signature is how the whitened errors would change if it were there. What the base could
imitate is projected out of it (Rao 1948; Cox and Hinkley 1974, sec. 9.3).
"""

from dataclasses import dataclass

import numpy as np

from twinmill.experiment.candidates import Candidate
from twinmill.experiment.one_step_fit import HUBER_SIGMA, System
from twinmill.model.parameters import Parameter
from twinmill.predict.modelled_log import ModelledLog

EFFECT_PRIOR = 2.0  # standard deviation of an effect over its usual strength
RIDGE = 1e-9  # of the trace
SIGNS = 999  # random signs of blocks that make the null distribution


@dataclass(frozen=True)
class Screened:
    """One candidate.

    Attributes:
        candidate: the effect.
        gain: fall of chi2 that the linear signature promises.
        excess: how much more the block scores scatter than noise alone would make them (1 = not).
        delta: (k,) linear estimate, in the order of the candidate's columns.
        expected: fall of chi2 if one of its parameters had its plausible strength.
        p_value: share of block-sign flips in which any candidate reaches this one's gain.
    """

    candidate: Candidate
    gain: float
    excess: float
    delta: np.ndarray
    expected: float
    p_value: float


@dataclass(frozen=True)
class Screening:
    """All candidates, and what is needed to see which look alike.

    Attributes:
        found: in the order of the candidates.
        signatures: per candidate (R, k), base projected out.
        left: (R,) whitened errors, base projected out.
    """

    found: list[Screened]
    signatures: list[np.ndarray]
    left: np.ndarray

    def imitation(self, i: int, j: int) -> float:
        """Share of candidate i's fitted signature that candidate j could imitate, 0 to 1."""
        wanted = self.signatures[i] @ self.found[i].delta
        return _explained(self.signatures[j], wanted) / max(float(wanted @ wanted), 1e-12)


def screen(
    logs: list[ModelledLog], base: list[Parameter], found: list[tuple[Candidate, np.ndarray]]
) -> Screening:
    """Tests all candidates, given with their columns, against what the logs' models leave."""
    system = System(logs, base)
    left, basis = project_out(system)
    blocks = np.append(system.blocks(), np.full(len(system.unknowns), -1))
    candidates = [c for c, _ in found]
    of_priors = len(system.unknowns)
    signatures = [np.pad(columns, ((0, of_priors), (0, 0))) for _, columns in found]
    signatures = [s - basis @ (basis.T @ s) for s in signatures]
    flips = np.random.default_rng(1).choice([-1.0, 1.0], (SIGNS, blocks.max() + 1))
    tests = [
        _test(s, c.strength, left, blocks, flips=flips)
        for s, c in zip(signatures, candidates, strict=True)
    ]
    highest = np.max([null for *_, null in tests], axis=0)
    screened = []
    for candidate, signature, (gain, excess, delta, _) in zip(
        candidates, signatures, tests, strict=True
    ):
        alone = np.sum(signature**2, axis=0) * candidate.strength**2
        p_value = float((1 + np.count_nonzero(highest >= gain / excess)) / (1 + SIGNS))
        screened.append(Screened(candidate, gain, excess, delta, float(alone.max()), p_value))
    return Screening(screened, signatures, left)


def project_out(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Robust whitened errors without what the free quantities explain, and a basis of these."""
    residual = system.residuals(system.start)
    residual = np.clip(residual, -HUBER_SIGMA, HUBER_SIGMA)
    jacobian = system.jacobian(system.start)
    jacobian = jacobian[:, np.linalg.norm(jacobian, axis=0) > 0]
    basis, _ = np.linalg.qr(jacobian)
    return residual - basis @ (basis.T @ residual), basis


def _explained(columns: np.ndarray, target: np.ndarray) -> float:
    gram, moment = columns.T @ columns, columns.T @ target
    return float(
        moment @ np.linalg.solve(gram + RIDGE * np.trace(gram) * np.eye(len(gram)), moment)
    )


def _test(
    signature: np.ndarray,
    strength: np.ndarray,
    left: np.ndarray,
    blocks: np.ndarray,
    *,
    flips: np.ndarray,
) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Gain, excess, estimate, and (SIGNS,) gains over excess under flipped signs of blocks."""
    count = flips.shape[1]
    inside = blocks >= 0
    rows, label = signature[inside], blocks[inside]
    # The weak prior keeps apart what the log cannot.
    gram = rows.T @ rows + np.diag(1 / (EFFECT_PRIOR * strength) ** 2)
    moments = np.zeros((count, rows.shape[1]))
    np.add.at(moments, label, rows * left[inside, None])
    delta = np.linalg.solve(gram, moments.sum(0))
    gain = float(moments.sum(0) @ delta)
    # Scores of blocks after the estimate is taken out, against the noise that each should have.
    fitted = np.zeros_like(moments)
    np.add.at(fitted, label, rows * (rows @ delta)[:, None])
    scatter = moments - fitted
    excess = float(np.trace(np.linalg.solve(gram, scatter.T @ scatter)) / rows.shape[1])
    excess = max(1.0, excess)
    flipped = flips @ scatter
    null = np.einsum("sk,sk->s", flipped, np.linalg.solve(gram, flipped.T).T) / excess
    return gain, excess, delta, null
