# SPDX-License-Identifier: Apache-2.0
"""Dependences that a base may always have had, though its own log did not ask for them.

A function of speed, heading, turns or the past holds in every log. Where the drive of the own log
shows little of it, a later log that shows it has two explanations: it is new, or it always was
there. The second has the weights' posterior in the own log as its prior, and the probability that
the own log leaves each size (as `hidden` has it of effects; Bishop 2006, ch. 3.3).
"""

from dataclasses import dataclass, field

import numpy as np

from twinmill.inference.discrepancy import SIZES
from twinmill.inference.evidence import Linear
from twinmill.inference.hidden import told_beside
from twinmill.inference.settings import PRIORS


@dataclass(frozen=True)
class Lasting:
    """Evidence in the base's own log on one kernel that was not found in it, K weights.

    Attributes:
        chance: (S,) posterior probability of each of SIZES there; what is left is that of none.
        gram, push: (K, K), (K,) products of its white columns, and with what is left, once the base
            has taken its part.
        shift: (N, K) change of the base's numbers with each weight.
    """

    chance: np.ndarray
    gram: np.ndarray = field(repr=False)
    push: np.ndarray = field(repr=False)
    shift: np.ndarray = field(repr=False)

    @classmethod
    def of(
        cls, chance: np.ndarray, white: np.ndarray, linear: Linear, root: np.ndarray
    ) -> "Lasting":
        """Evidence from one's own log.

        Args:
            chance: (S,).
            white: (K, R) columns of the kernel.
            linear: the base's model with all that was found, N numbers.
            root: (N, N) Cholesky factor of the prior of these.
        """
        return cls(chance, *told_beside(linear, white, root))

    def columns(self, white: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """(K, R) white columns of a later log, with what the base's numbers change beside them.

        Args:
            white: (K, R) of the kernel.
            slopes: (N, R) of the base's numbers.
        """
        return white + self.shift.T @ slopes

    def gains(self, linear: Linear, columns: np.ndarray) -> np.ndarray:
        """(S,) gain in log evidence of a later log by a kernel that always had each size.

        Args:
            linear: of that log, without it.
            columns: (K, R), as of `columns`.
        """
        gram, push = linear.projected(columns, columns @ columns.T)
        return np.array([self._gain(gram, push, size) for size in SIZES])

    def _gain(self, gram: np.ndarray, push: np.ndarray, size: float) -> float:
        cov = np.linalg.inv(self.gram + np.eye(len(self.gram)) / size**2)
        mean = cov @ self.push
        low = np.linalg.cholesky(cov + np.diag((PRIORS.sheet * mean) ** 2))
        own = low.T @ gram @ low + np.eye(len(gram))
        left = low.T @ (push - gram @ mean)
        known = mean @ push - 0.5 * mean @ gram @ mean
        return float(known + 0.5 * (left @ np.linalg.solve(own, left) - np.linalg.slogdet(own)[1]))
