# SPDX-License-Identifier: Apache-2.0
"""Input of inference: a base's errors, prior, noise, and all that it may lack.

Robots of any kind are judged by subclasses that know their physics: `planar` those that drive on a
floor, `twinmill.joints.problem` those that MuJoCo can load.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Protocol, SupportsIndex

import numpy as np

from twinmill.inference.candidate import Candidate
from twinmill.inference.discrepancy import Kernel
from twinmill.inference.evidence import Bank, Linear
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.lasting import Lasting
from twinmill.inference.moments import Rate
from twinmill.inference.noise import Noise, Usual, fit_noise, weights_of
from twinmill.inference.prior import Prior
from twinmill.inference.settings import PRIORS

FLEXIBLE = 0.05  # gain error of each kernel while noise is looked for first


class Steps(Protocol):
    """Steps of a log, each predicted from the state that was measured at its start.

    Attributes:
        observed: (C,) channels that were measured.
        block: (W,) number of the block of time.
    """

    observed: np.ndarray
    block: np.ndarray

    def __len__(self) -> int: ...

    def errors(self, model: Any, names: Any = (), values: Any = None) -> np.ndarray:
        """(B, W, C) measured less predicted, for B rows of values of named quantities."""


@dataclass(frozen=True)
class Kinds:
    """Knowledge of the competing effects, beside the changes that they make.

    Attributes:
        told_by: dependences for which each effect may be mistaken.
        local: effects of a place or a while, which may be there more than once.
        at_moments: effects that act from a moment on.
        sized: effects that act everywhere and have sizes alone.
    """

    told_by: Mapping[str, tuple[str, ...]]
    local: frozenset[str] = frozenset()
    at_moments: frozenset[str] = frozenset()
    sized: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Missed:
    """Part of a model whose formula is off by some of its size.

    Attributes:
        words: dependences for which it may be mistaken.
        change: (W, C) of the prediction by it.
    """

    words: tuple[str, ...]
    change: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class View:
    """Possible lacks of a model, whitened under a noise.

    Attributes:
        fitter: of the log, under that noise.
        kernels: F nameless dependences.
        stacked: (sum of K, R) their white columns.
        parts: of each kernel in these.
        grams: of each kernel, (K, K) products.
        log_shares: (F,) of their prior odds.
        moments: white columns of moments, and their products, as `moments.find` takes them.
        log_sizes: (R,) of the noise, less a share of its log prior.
        block: (R,) number of the block of time of each white row.
        growth: log odds of the noise as something new, and the squares that it takes beyond those
            of the usual noise; None where no other log told that.
    """

    fitter: Fitter
    kernels: list[Kernel]
    stacked: Bank
    parts: list[slice]
    grams: list[np.ndarray]
    log_shares: np.ndarray
    moments: tuple[Bank, np.ndarray]
    log_sizes: np.ndarray
    block: np.ndarray
    growth: tuple[float, float] | None

    @property
    def log_size(self) -> float:
        """Constant by which each log evidence under this noise is less."""
        return float(self.log_sizes.sum())

    def white(self, f: SupportsIndex) -> np.ndarray:
        """(K, R) white columns of a kernel."""
        return self.stacked.columns[self.parts[f]]


@dataclass(frozen=True)
class Problem(ABC):
    """One robot in one log or several.

    Attributes:
        steps: of the logs.
        prior: of the base.
        base: fitted, nothing missing.
        kernels: nameless dependences that compete.
        names: of the effects that compete.
        rate: of moments, as the base's own log had them; None where that is not known.
        usual: noise as other logs had it.
        noise: what all flexible terms together leave.
        wander: kernels of time and place that are no news, and the probability of each size.
        kinds: of effects.
        missed: what the base always misses, as far as known.
    """

    steps: Steps
    prior: Prior
    base: Hypothesis
    kernels: list[Kernel]
    names: list[str]
    rate: Rate | None
    usual: Usual
    noise: Noise
    wander: dict[str, np.ndarray]
    kinds: Kinds
    missed: tuple[Missed, ...]

    @abstractmethod
    def candidate(self, name: str, model: Any) -> Candidate:
        """Change by an effect beside a model.

        Raises:
            ValueError: the effect cannot be added to this model.
        """

    @abstractmethod
    def forms(self, change: np.ndarray) -> tuple[np.ndarray, ...]:
        """Arrays (K, W, C): what an effect's formula may miss, each for a relative error of one.

        Args:
            change: (W, C) of the prediction by the effect.
        """

    def always_there(
        self, h: Hypothesis, effects: Sequence[str]
    ) -> tuple[Hypothesis, float] | None:
        """A hypothesis some of whose effects the base always lacked, and their Bayes factor.

        None where no log that the base was fitted to tells of them.
        """
        return None

    def lasting(self, kernel: str) -> Lasting | None:
        """Evidence of the base's own log on a kernel that was not found in it; None if none."""
        return None

    def in_own_log(self, slopes: np.ndarray) -> np.ndarray:
        """(N', R) slopes of the numbers that the base's own log had, of (N, R) of a hypothesis."""
        return slopes

    @property
    def has_moments(self) -> bool:
        """Something may happen at moments: these are logs, and no tables."""
        return True

    @abstractmethod
    def of_moments(self) -> np.ndarray:
        """(B + 1, N, W, C) change by a gain or a push of usual size up to each of the bins."""

    def view(self, noise: Noise) -> View:
        """Possible lacks, whitened under a noise."""
        fitter = Fitter(self.steps, noise, self.prior.columns)
        channels = len(self.steps.observed)
        stacked = fitter.whiten(np.concatenate([k.columns for k in self.kernels]))
        edges = np.cumsum([0, *(len(k.columns) for k in self.kernels)])
        parts = [slice(a, b) for a, b in pairwise(edges)]
        at_moments = fitter.whiten(self.of_moments())
        flat = at_moments.reshape(-1, at_moments.shape[-1])
        return View(
            fitter,
            self.kernels,
            Bank(stacked),
            parts,
            [stacked[part] @ stacked[part].T for part in parts],
            np.array([kernel.log_share for kernel in self.kernels]),
            (Bank(at_moments), flat @ flat.T),
            noise.log_sizes(self.steps.observed)
            - self.usual.log_density(noise) / (channels * len(self.steps)),
            np.tile(self.steps.block, channels),
            self._growth(noise) if self.usual.told else None,
        )

    def _growth(self, noise: Noise) -> tuple[float, float]:
        observed, usual = self.steps.observed, noise.at(self.usual.logs)
        smaller = np.exp(2 * (usual.log_sizes(observed) - noise.log_sizes(observed)))
        return self.usual.log_growth(noise), max(float(np.sum(1 - smaller)), 0.0)

    def told(self, h: Hypothesis) -> Hypothesis:
        """A hypothesis with the base's numbers where other logs told them, which is no clock.

        Without an effect they may have gone far to stand in for it: what it would change, and what
        they would, are compared where neither has yet. In the base's own log nothing told them.
        """
        known = np.array([not n.startswith("clock.") for n in h.labels]) & ~h.of_effects
        known &= self.prior.known
        value = np.where(known, np.clip(h.mean, h.low, h.high), h.value)
        fitter = Fitter(self.steps, self.noise, self.prior.columns)
        return fitter.at(replace(h, value=value))

    def columns(self, h: Hypothesis, names: Collection[str] | None = None) -> dict[str, Candidate]:
        """Change by each effect that a hypothesis lacks; of some effects, or of all.

        What acts at a place or for a while may be there more than once.
        """
        found = {}
        for name in self.names if names is None else names:
            if name not in h.effects or name in self.kinds.local:
                try:
                    found[name] = self.candidate(name, h.model)
                except ValueError:  # this model cannot have it
                    continue
        return found


def flexible_noise(p: Problem) -> Noise:
    """The noise that all effects and all dependences together leave; far errors weigh less."""
    errors, columns = flexible(p)
    noise = fit_noise(errors, columns, p.noise, p.usual)
    white = noise.whiten(columns)
    y = noise.whiten(errors)
    left = Linear.of(y, white).residuals.reshape(len(p.steps.observed), -1)
    return replace(noise, weight=weights_of(left))


def flexible(p: Problem) -> tuple[np.ndarray, np.ndarray]:
    """(W, C) errors of the base as known, and (K, W, C) columns of all that may be beside it."""
    base = p.told(p.base)
    free = [np.tensordot(np.linalg.cholesky(base.cov).T, base.slopes, 1)]
    for c in p.columns(base).values():
        if c.where is None and len(c.columns):
            free.append(PRIORS.size * c.columns)
    free += [FLEXIBLE * k.columns for k in p.kernels]
    return base.errors, np.concatenate(free)
