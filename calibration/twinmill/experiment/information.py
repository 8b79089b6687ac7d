# SPDX-License-Identifier: Apache-2.0
"""Information of runs on effects: products of whitened signatures, which add up over runs.

How well effect i can be told from effect j is the energy of i's signature that j, the base and the
clock together cannot imitate: a Schur complement (Atkinson and Fedorov 1975, Biometrika 62(1)).
"""

from dataclasses import dataclass

import numpy as np

from twinmill.experiment.candidates import Candidate
from twinmill.experiment.one_step_fit import System
from twinmill.experiment.screen import EFFECT_PRIOR
from twinmill.model.parameters import Parameter
from twinmill.predict.modelled_log import ModelledLog

CLOCKS = 2  # offset and rate of a run


@dataclass(frozen=True)
class CandidateEffect:
    """An effect that could be the missing one.

    Attributes:
        candidate: its derivatives.
        whole: the one step from neutral to the strength that it has or plausibly could have.
        excess: how much more the log's errors scatter along it than noise alone would make them.
    """

    candidate: Candidate
    whole: Candidate
    excess: float

    @property
    def name(self) -> str:
        """Name of the effect in the catalogue."""
        return self.candidate.effect


class FisherInformation:
    """Adds up what runs tell.

    Columns are those of the shared free quantities, then for each candidate its derivatives and its
    whole step, then the clock of the planned run.
    """

    def __init__(self, free: list[Parameter], candidate_effects: list[CandidateEffect]) -> None:
        self.free, self.candidate_effects = free, candidate_effects
        counts = [len(s.candidate.strength) + 1 for s in candidate_effects]
        ends = len(free) + np.cumsum(counts)
        # A rival imitates with its derivatives; its whole step is no freedom more.
        self.places = [np.arange(e - c, e - 1) for e, c in zip(ends, counts, strict=True)]
        self.shared = int(ends[-1])
        self.nuisance = np.r_[0 : len(free), self.shared : self.shared + CLOCKS]
        self.steps = ends - 1  # places of the whole steps

    def told(self, modelled: ModelledLog) -> np.ndarray:
        """(C, C) products of a measured run; its own clock is projected out."""
        columns, prior = self._columns(modelled)
        gram = columns.T @ columns
        own = slice(self.shared, None)
        clock = gram[own, own] + np.diag(prior)
        gram -= gram[:, own] @ np.linalg.solve(clock, gram[own])
        gram[own] = gram[:, own] = 0
        return gram

    def predicted(self, modelled: ModelledLog) -> np.ndarray:
        """(K, C, C) products of each part of a planned run."""
        columns, _ = self._columns(modelled)
        parts = [slice(3 * p.start, 3 * p.stop) for p in modelled.grid.slices]
        return np.array([columns[p].T @ columns[p] for p in parts])

    def margins(self, grams: np.ndarray) -> np.ndarray:
        """(..., C, C) to (..., T, 1 + J): what of each candidate's whole step is left.

        First with the free quantities alone to imitate it, then with each other candidate besides;
        none is a rival of its own: infinity.
        """
        left = self._without_nuisance(grams)
        whole = np.diagonal(left, axis1=-2, axis2=-1)[..., self.steps]
        margins = [whole]
        for j, place in enumerate(self.places):
            strength = self.candidate_effects[j].candidate.strength
            prior = np.diag(1 / (EFFECT_PRIOR * strength) ** 2)
            rival = left[..., place[:, None], place] + prior
            cross = left[..., place[:, None], self.steps]
            imitated = np.sum(cross * np.linalg.solve(rival, cross), axis=-2)
            margin = whole - imitated
            margin[..., j] = np.inf
            margins.append(margin)
        return np.maximum(np.stack(margins, axis=-1), 0.0)

    def shifts(self, grams: np.ndarray) -> np.ndarray:
        """(C, C) to (T, F) changes of the free quantities that imitate each whole step best."""
        at = self.nuisance
        found = np.linalg.solve(self._inner(grams), grams[at][:, self.steps])
        return -found[: len(self.free)].T

    def _without_nuisance(self, grams: np.ndarray) -> np.ndarray:
        """Products after the free quantities and the planned run's clock are projected out."""
        cross = grams[..., self.nuisance, :]
        return grams - np.swapaxes(cross, -1, -2) @ np.linalg.solve(self._inner(grams), cross)

    def _inner(self, grams: np.ndarray) -> np.ndarray:
        """Products of the free quantities and the clock, with their priors."""
        at = self.nuisance
        widths = np.array([f.std for f in self.free] + [np.inf] * CLOCKS)
        return grams[..., at[:, None], at] + np.diag(1 / widths**2 + 1e-9)

    def _columns(self, modelled: ModelledLog) -> tuple[np.ndarray, np.ndarray]:
        """(R, C) columns of a run, and (2,) 1 / variance of its clock's priors."""
        system = System([modelled], self.free)
        count = len(system.unknowns)
        jacobian = system.jacobian(system.start)[:-count]
        clock = np.zeros((len(jacobian), CLOCKS))
        if modelled.clock_free:
            clock = jacobian[:, -CLOCKS:]
        without = [modelled.white_errors()]
        effects = [
            c.columns([modelled], without)
            for s in self.candidate_effects
            for c in (s.candidate, s.whole)
        ]
        prior = 1 / system.prior[-CLOCKS:] ** 2 if modelled.clock_free else np.ones(CLOCKS)
        return np.hstack([jacobian[:, : len(self.free)], *effects, clock]), prior
