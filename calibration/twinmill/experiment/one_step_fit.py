# SPDX-License-Identifier: Apache-2.0
"""Whitened one-step errors of several logs and their slopes by free parameters, with priors.

One-step errors of a right model are independent once whitened, so that products of their slopes are
Fisher information: what a run tells adds up. They are used to plan runs, not to judge models.
"""

from dataclasses import replace

import numpy as np

from twinmill.model.parameters import CLOCK, CLOCK_RATE, Parameter, base_parameters
from twinmill.predict.modelled_log import ModelledLog

HUBER_SIGMA = 3.5
BLOCK_S = 4.0  # errors of one block may be correlated; blocks are not


class System:
    """Whitened errors of logs as a function of the shared parameters and of each free clock."""

    def __init__(self, logs: list[ModelledLog], free: list[Parameter]) -> None:
        self.logs, self.free = logs, list(free)
        self.unknowns: list[Parameter] = list(free)
        self.columns: list[list[int]] = []
        for modelled in logs:
            own = [i for i, p in enumerate(free) if p.name not in modelled.stated]
            if modelled.clock_free:
                own += range(len(self.unknowns), len(self.unknowns) + 2)
                offset, rate = base_parameters(modelled.model, [CLOCK, CLOCK_RATE])
                self.unknowns += [offset, replace(rate, usual=0.0)]
            self.columns.append(own)
        self.start, self.high, self.step, self.prior, self.centre = (
            np.array([getattr(p, k) for p in self.unknowns], float)
            for k in ("value", "max", "step", "std", "usual")
        )

    def _whitened(self, rows: np.ndarray) -> np.ndarray:
        """(B, P) unknowns to (B, R) whitened errors of all logs, then the prior's rows."""
        parts = []
        for modelled, columns in zip(self.logs, self.columns, strict=True):
            own, place = np.unique(rows[:, columns], axis=0, return_inverse=True)
            names = [self.unknowns[c].name for c in columns]
            white = modelled.whitened(names, own) if names else modelled.white_errors()[None]
            parts.append(white.reshape(len(own), -1)[place.ravel()])
        return np.concatenate([*parts, (rows - self.centre) / self.prior], axis=1)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """(R,) whitened errors at the unknowns x, then the prior's rows."""
        return self._whitened(x[None])[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """One-sided differences, upwards unless the bound is nearer than the step."""
        step = np.where(x + self.step <= self.high, self.step, -self.step)
        values = self._whitened(np.vstack([x, x + np.diag(step)]))
        return ((values[1:] - values[0]) / step[:, None]).T

    def blocks(self) -> np.ndarray:
        """(R,) number of the block that each whitened error belongs to, over all logs."""
        label = [np.repeat(1e6 * i + s.grid.t_s // BLOCK_S, 3) for i, s in enumerate(self.logs)]
        return np.unique(np.concatenate(label), return_inverse=True)[1]
