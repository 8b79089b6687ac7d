# SPDX-License-Identifier: Apache-2.0
"""A hypothesis: a base model with some effects, fitted, and linear about its best numbers."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from twinmill.inference.bounds import log_within
from twinmill.inference.candidate import FAR, Candidate, is_size, size_std
from twinmill.inference.evidence import Columns, Linear
from twinmill.inference.noise import Noise
from twinmill.inference.prior import Prior
from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import (
    WHERE_OR_WHEN,
    catalogue_name,
    effect_names,
    instance_of,
    key_of,
    newest_instance,
)

ROUNDS = 6  # of Levenberg and Marquardt: most fits need three
TRIES = 5  # dampings within a round
RUNS_AWAY = 1e6  # m or rad in a step for a unit of a number: no slope, the motion is unstable there
SETTLED = 0.1  # units of the log posterior: less decides nothing
LIMIT_SPREAD = 0.5  # prior of a limit about its start on the grid, relative: twice the grid's step
LIMIT_STEP = 0.02  # of finite differences in a limit, relative: what it cuts off bends with it
NO_SLOPES = np.zeros((0, 1, 1))
CostAt = Callable[[np.ndarray], tuple[np.ndarray, float]]


@dataclass(frozen=True)
class Guess:
    """A set of missing effects at some numbers, not fitted yet.

    Numbers are `labels`: the base's, weights of its discrepancy, then those of effects.

    Attributes:
        effects: names, in the order in which they were added; a second of a kind is `name#2`.
        model: with them.
        labels: N of them; `named` (N,) says which are quantities of the model.
        mean, cov: (N,), (N, N) of the prior, a normal distribution within bounds.
        low, high, step, value: (N,) these bounds, steps of finite differences, numbers.
        grid: log evidence of what was integrated on a grid, by effect, less that of its best point.
    """

    effects: tuple[str, ...]
    model: Any
    labels: tuple[str, ...]
    named: np.ndarray
    mean: np.ndarray
    cov: np.ndarray
    low: np.ndarray
    high: np.ndarray
    step: np.ndarray
    value: np.ndarray
    grid: dict[str, float]

    @classmethod
    def of_base(cls, model: Any, prior: Prior) -> "Guess":
        """The base alone, at the prior's mean."""
        more = len(prior.mean) - len(prior.names)
        wide = np.full(more, np.inf)
        value = np.r_[np.clip(prior.mean[: len(prior.names)], prior.low, prior.high),
                      prior.mean[len(prior.names):]]  # fmt: skip
        return cls(
            effects=(),
            model=model,
            labels=(*prior.names, *(f"discrepancy {k}" for k in range(more))),
            named=np.r_[np.ones(len(prior.names), bool), np.zeros(more, bool)],
            mean=prior.mean,
            cov=prior.cov,
            low=np.r_[prior.low, -wide],
            high=np.r_[prior.high, wide],
            step=np.r_[prior.step, np.ones(more)],
            value=value,
            grid={},
        )

    @property
    def of_effects(self) -> np.ndarray:
        """(N,) numbers of effects that the hypothesis adds."""
        added = {self.instance(name) for name in self.effects}
        return np.array([instance_of(n) in added for n in self.labels])

    def instance(self, effect: str) -> str:
        """Instance name in the model of one of the effects; the base may have its kind, too."""
        kind = catalogue_name(effect)
        own = [n for n in self.effects if catalogue_name(n) == kind]
        every = [n for n in effect_names(self.model) if catalogue_name(n) == kind]
        return every[own.index(effect) - len(own)]


@dataclass(frozen=True)
class Hypothesis(Guess):
    """A set of missing effects at its best numbers, to which its model is set.

    Attributes:
        slopes: (N, W, 3) change of the prediction with each number.
        errors: (W, 3) at the best numbers.
    """

    slopes: np.ndarray = field(repr=False)
    errors: np.ndarray = field(repr=False)

    def rows(self, fitter: "Fitter") -> np.ndarray:
        """(M, R) white slopes of named quantities, what the effects' span, and what is to explain.

        The second are orthonormal.
        """
        own, away = fitter.whiten(self.slopes[self.named]), self.value - self.mean
        y = fitter.whiten(self.errors) + away[self.named] @ own + away[~self.named] @ fitter.always
        span = np.linalg.qr(own[self.of_effects[self.named]].T)[0].T
        return np.concatenate([own, span, y[None]])

    def about_mean(self, beside: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(W, C) errors at the prior's mean, and (N', W, C) columns of standard normal numbers.

        Args:
            beside: (K, W, C) columns that are there as well.
        """
        columns = np.tensordot(np.linalg.cholesky(self.cov).T, self.slopes, 1)
        at_mean = self.errors + np.tensordot(self.value - self.mean, self.slopes, 1)
        return at_mean, columns if beside is None else np.concatenate([columns, beside])

    def linear(self, fitter: "Fitter") -> Linear:
        """The linear model of a log about the best numbers."""
        rows, root = self.rows(fitter), np.linalg.cholesky(self.cov)
        roots = np.zeros((len(rows), len(root))), root[~self.named]
        roots[0][: self.named.sum()] = root[self.named]
        products, beside = rows @ rows.T, rows @ fitter.always.T
        across = roots[0].T @ beside @ roots[1]
        gram = roots[0].T @ products @ roots[0] + roots[1].T @ fitter.gram_always @ roots[1]
        push = products[-1] @ roots[0] + beside[-1] @ roots[1]
        columns = Columns((rows, fitter.always), roots)
        return Linear.of_products(columns, gram + across + across.T, push)

    def log_evidence(self, linear: Linear, cov: np.ndarray | None = None) -> float:
        """Log evidence, with what was integrated on grids, of numbers that end at their bounds."""
        cov = self.cov if cov is None else cov
        root = np.linalg.cholesky(cov)[self.named]  # weights have no bounds
        ways = np.pad(root, ((0, 0), (0, len(linear.mean) - root.shape[1])))
        mean = self.mean[self.named] + ways @ linear.mean
        after = log_within(self.low[self.named], self.high[self.named], mean, linear.stds(ways))
        within = float(after.sum()) - self.log_share(self.mean, cov)
        return linear.log_evidence + sum(self.grid.values()) + within

    def log_share(self, mean: np.ndarray, cov: np.ndarray) -> float:
        """Log of the share within its bounds of a distribution of its numbers, (N,) and (N, N)."""
        return float(log_within(self.low, self.high, mean, np.sqrt(np.diag(cov))).sum())

    def posterior(
        self, linear: Linear, cov: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(N,) mean and (N, N) covariance; of a model with more columns than these, their part."""
        root, count = np.linalg.cholesky(self.cov if cov is None else cov), len(self.mean)
        spread = root @ linear.covariance[:count, :count] @ root.T
        return self.mean + root @ linear.mean[:count], spread


def next_of_kind(effects: tuple[str, ...], name: str) -> str:
    """Name of one effect more in a set: `name`, or `name#2` where it is the second of its kind."""
    there = sum(catalogue_name(n) == name for n in effects)
    return f"{name}#{there + 1}" if there else name


@dataclass(frozen=True)
class _Point:
    """Numbers (N,) that a fit has come to, (W, 3) errors, cost, and damping of the next step."""

    value: np.ndarray
    errors: np.ndarray
    cost: float
    damping: float


def _stepped(
    h: Guess, at: _Point, *, pull: np.ndarray, curved: np.ndarray, cost_at: CostAt
) -> _Point:
    """After a step of Levenberg and Marquardt, damped until it is likelier there, if it is.

    Args:
        h: for its bounds.
        at: where the step begins.
        pull: (N,) gradient of the log posterior there.
        curved: (N, N) its curvature.
        cost_at: errors and cost at some numbers.
    """
    for _ in range(TRIES):
        step = np.linalg.solve(curved + at.damping * np.diag(np.diag(curved)), pull)
        value = np.clip(at.value + step, h.low, h.high)
        errors, cost = cost_at(value)
        if cost < at.cost:
            return _Point(value, errors, cost, at.damping / 10)
        at = replace(at, damping=10 * at.damping)
    return at


@dataclass(frozen=True)
class Fitter:
    """Fits hypotheses to the steps of a log under a noise.

    Attributes:
        steps, noise: of the log.
        discrepancy: (K, W, 3) columns of the base's discrepancy.
    """

    steps: Any
    noise: Noise
    discrepancy: np.ndarray

    def whiten(self, rows: np.ndarray) -> np.ndarray:
        """(..., 3 W) of (..., W, 3)."""
        return self.noise.whiten(rows)

    @cached_property
    def always(self) -> np.ndarray:
        """(K, R) white columns of the base's discrepancy."""
        shape = len(self.discrepancy), len(self.steps), len(self.steps.observed)
        return self.whiten(self.discrepancy.reshape(shape))

    @cached_property
    def gram_always(self) -> np.ndarray:
        """(K, K) their products."""
        return self.always @ self.always.T

    def fit(
        self,
        h: Guess,
        rounds: int = ROUNDS,
        kept: np.ndarray = NO_SLOPES,
        known: np.ndarray | None = None,
    ) -> Hypothesis:
        """Levenberg and Marquardt from its numbers.

        Args:
            h: with these numbers.
            rounds: at most.
            kept: (K, W, 3) first slopes, as they were elsewhere; they stay.
            known: (N, W, 3) all slopes at its numbers, where they are known.
        """
        precision = np.linalg.inv(h.cov)
        cost_at = partial(self._cost, h, precision=precision)
        value = np.clip(h.value, h.low, h.high)
        at, count = _Point(value, *cost_at(value), damping=1e-3), len(value)
        white, gram = np.zeros((count, self.always.shape[1])), np.zeros((count, count))
        white[~h.named], gram[np.ix_(~h.named, ~h.named)] = self.always, self.gram_always
        fresh = np.arange(count) >= len(kept)

        def take(rows: np.ndarray, slopes: np.ndarray) -> None:
            white[rows] = self.whiten(slopes[rows])
            gram[rows] = white[rows] @ white.T
            gram[:, rows] = gram[rows].T

        if len(kept):
            take(np.flatnonzero(h.named & ~fresh), kept)
        slopes = known
        for _ in range(rounds):
            if slopes is None:
                slopes = self._slopes(replace(h, value=at.value), kept)
            take(np.flatnonzero(h.named & fresh), slopes)
            curved, cost = gram + precision, at.cost
            for _ in range(ROUNDS):  # with these slopes, which cost most
                pull = white @ self.whiten(at.errors) - precision @ (at.value - h.mean)
                if 0.5 * pull @ np.linalg.solve(curved, pull) < SETTLED:
                    break
                before, at = at, _stepped(h, at, pull=pull, curved=curved, cost_at=cost_at)
                if before.cost - at.cost < SETTLED:
                    break
            if at.cost == cost:
                break
            slopes = None
        return self.at(replace(h, value=at.value), at.errors, kept if slopes is None else slopes)

    def at(
        self, h: Guess, errors: np.ndarray | None = None, kept: np.ndarray = NO_SLOPES
    ) -> Hypothesis:
        """A hypothesis linear about its numbers, its model set to them.

        Args:
            h: with these numbers.
            errors: (W, 3) at them.
            kept: (K, W, 3) first slopes, as they were elsewhere, or all.
        """
        model = h.model.copy()
        for name, v in zip(np.array(h.labels)[h.named], h.value[h.named], strict=True):
            model.set(str(name), float(v))
        if errors is None:
            errors = self.steps.errors(model)[0] - self._always(h)
        found = replace(h, model=model)
        return Hypothesis(**{**vars(found), "slopes": self._slopes(found, kept), "errors": errors})

    def with_effect(
        self, h: Hypothesis, c: Candidate, start: np.ndarray, grid: float, *, far: bool = False
    ) -> Hypothesis:
        """The hypothesis with an effect more, fitted from a start.

        Args:
            h: without it.
            c: the effect.
            start: (P,) values of its parameters.
            grid: log evidence of places, whiles or limits, less that of the best.
            far: its sizes are among those that may be FAR times as large as usual.
        """
        wide, chance = (FAR, PRIORS.far) if far else (1.0, 1 - PRIORS.far)
        model = h.model.copy()
        model.add_effect(c.name)
        instance, effect = newest_instance(model, c.name), next_of_kind(h.effects, c.name)
        for p, v in zip(c.parameters, start, strict=True):
            model.set(f"{instance}.{key_of(p.name)}", float(v))
        local = np.array([p.role in WHERE_OR_WHEN for p in c.parameters])
        limit = np.array([p.role == "limit" for p in c.parameters])[~local]
        free = [p for p, here in zip(c.parameters, local, strict=True) if not here]
        start = start[~local]
        mean = np.where(limit, start, [p.usual for p in free])
        std = np.where(
            limit, LIMIT_SPREAD * np.abs(start), [wide ** is_size(p) * size_std(p) for p in free]
        )
        count = len(h.mean)
        cov = np.zeros((count + len(free),) * 2)
        cov[:count, :count] = h.cov
        cov[range(count, len(cov)), range(count, len(cov))] = std**2
        grown = Guess(
            effects=(*h.effects, effect),
            model=model,
            labels=(*h.labels, *(f"{instance}.{key_of(p.name)}" for p in free)),
            named=np.r_[h.named, np.ones(len(free), bool)],
            mean=np.r_[h.mean, mean],
            cov=cov,
            low=np.r_[h.low, [p.min for p in free]],
            high=np.r_[h.high, [p.max for p in free]],
            step=np.r_[h.step, np.where(limit, LIMIT_STEP * np.abs(start), [p.step for p in free])],
            value=np.r_[h.value, start],
            grid={**h.grid, effect: grid + float(np.log(chance))},
        )
        return self.fit(grown, kept=h.slopes)

    def without(self, h: Hypothesis, effect: str) -> Hypothesis:
        """The hypothesis without one of its effects, of several of a kind the last, fitted anew."""
        model, instance = h.model.copy(), h.instance(effect)
        model.remove_effect(effect_names(model).index(instance))
        keep = np.array([instance_of(n) != instance for n in h.labels])
        part = {
            k: getattr(h, k)[keep]
            for k in ("named", "mean", "low", "high", "step", "value", "slopes")
        }
        less = replace(
            h,
            effects=tuple(n for n in h.effects if n != effect),
            model=model,
            labels=tuple(n for n, k in zip(h.labels, keep, strict=True) if k),
            cov=h.cov[np.ix_(keep, keep)],
            grid={k: v for k, v in h.grid.items() if k != effect},
            **part,
        )
        return self.fit(less, rounds=3, kept=less.slopes)

    def is_better(self, h: Hypothesis, value: np.ndarray) -> bool:
        """True if a hypothesis is likelier at other numbers (N,) than at its own."""
        precision = np.linalg.inv(h.cov)
        cost, there = (self._cost(h, v, precision)[1] for v in (h.value, value))
        return there < cost - SETTLED

    def _cost(self, h: Guess, value: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, float]:
        """Errors (W, 3) at some numbers, and the negative log posterior."""
        names = np.array(h.labels)[h.named].tolist()
        errors = self.steps.errors(h.model, names, value[h.named])[0]
        errors -= np.tensordot(value[~h.named], self.discrepancy, 1) if (~h.named).any() else 0.0
        white, away = self.whiten(errors), value - h.mean
        return errors, float(0.5 * white @ white + 0.5 * away @ precision @ away)

    def _slopes(self, h: Guess, kept: np.ndarray) -> np.ndarray:
        """(N, W, 3) change of the prediction with each number; (K, W, 3) first ones are kept."""
        count, known = len(h.value), len(kept)
        if known == count:
            return kept
        out = np.empty((count, len(self.steps), len(self.steps.observed)))
        out[:known] = kept
        if not h.named.all():
            out[~h.named] = self.discrepancy
        fresh = np.flatnonzero(h.named & (np.arange(count) >= known))
        up = np.where(h.value + h.step <= h.high, h.step, -h.step)
        points = np.tile(h.value, (2 * len(fresh), 1))
        points[np.arange(len(fresh)), fresh] += up[fresh]
        points[len(fresh) + np.arange(len(fresh)), fresh] -= up[fresh]
        points = np.clip(points, h.low, h.high)
        apart = (
            points[np.arange(len(fresh)), fresh]
            - points[len(fresh) :][np.arange(len(fresh)), fresh]
        )
        names = np.array(h.labels)[h.named].tolist()
        errors = self.steps.errors(h.model, names, points[:, h.named])
        difference = errors[len(fresh) :] - errors[: len(fresh)]
        with np.errstate(over="ignore", invalid="ignore"):
            found = difference / np.where(apart, apart, np.inf)[:, None, None]
        found[~(np.abs(found).max(axis=(1, 2)) < RUNS_AWAY)] = 0.0
        out[fresh] = found
        return out

    def _always(self, h: Guess) -> np.ndarray | float:
        """(W, 3) the base's discrepancy at the best weights."""
        weights = h.value[~h.named]
        return np.tensordot(weights, self.discrepancy, 1) if len(weights) else 0.0
