# SPDX-License-Identifier: Apache-2.0
"""Search over sets of effects.

Nothing is accepted or refused on the way: a set that was fitted competes in the end. Moves: one
effect more, two at once, one exchanged, one left out.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import SupportsIndex

import numpy as np
import twinmill_native as native

from twinmill.inference.candidate import Candidate
from twinmill.inference.discrepancy import CHANCE, SIZES
from twinmill.inference.evidence import Columns, Linear
from twinmill.inference.hypothesis import Hypothesis, next_of_kind
from twinmill.inference.moments import MOMENTS
from twinmill.inference.problem import Problem, View
from twinmill.inference.screening import Screened, gains_of_pairs, nearby, screened
from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import catalogue_name, key_of, newest_instance

MOST = 4  # effects of a set
FITTED = 6  # effects that are fitted beside the best set, by what each would gain alone ...
BESIDE = 2  # ... and beside the likeliest dependence
INSTEAD = 2  # effects tried in the place of each one of the best sets
PAIRS = 2  # of effects that are fitted together, by what they would gain together
SETS = 2  # best sets whose effects are exchanged, within ...
NEAR = 4.0  # ... this log odds of the best
TRIED = (-2, -1, -0.5, 0.5, 1, 2, 4)  # sizes at which a fit may begin, times the card's
WORTH = -3.0  # gain in log evidence below which an effect is not fitted


_Screen = tuple[tuple[Hypothesis, Linear], dict[str, Candidate], dict[str, Screened]]


@dataclass(frozen=True)
class Evidence:
    """Evidence for one hypothesis under one noise.

    Attributes:
        hypothesis: with its best numbers.
        linear: the linear model.
        alone: log evidence with no dependence.
        gains, falls: (F, S) gain in log evidence, and fall of the squares, by each kernel and size.
        span: (Q, R) orthonormal rows that span what the effects change: a dependence is the part
            that they do not take.
        inside: (K, Q) products of all kernels' white columns with these.
        cross, push, grams: (K, P) what the numbers take of that part, and once they have, its
            products with the data (K,) and, kernel by kernel, with itself.
    """

    hypothesis: Hypothesis
    linear: Linear
    alone: float
    gains: np.ndarray
    falls: np.ndarray
    span: np.ndarray
    inside: np.ndarray
    cross: np.ndarray
    push: np.ndarray
    grams: list[np.ndarray]

    def likeliest(self, among: Sequence[int]) -> tuple[int, int, float]:
        """Likeliest of some kernels, place of its size, and gain with that size's chance."""
        gains = self.gains[among] + np.log(CHANCE)
        k, s = np.unravel_index(gains.argmax(), gains.shape)
        return among[int(k)], int(s), float(gains[k, s])

    def white(self, view: View, f: SupportsIndex) -> np.ndarray:
        """(K, R) white columns of a kernel, without what the effects take."""
        return view.white(f) - self.inside[view.parts[f]] @ self.span

    def with_kernel(self, view: View, f: int, size: float) -> Linear:
        """The linear model with a kernel of a size more."""
        at = view.parts[f]
        columns = view.white(f), self.span
        more = Columns(columns, (size * np.eye(len(columns[0])), -size * self.inside[at].T))
        gram, push = size**2 * self.grams[f], size * self.push[at]
        return self.linear.with_projected(more, size * self.cross[at], gram, push)


class Search:
    """Sets of effects that were fitted, with their evidence under the first noise."""

    def __init__(self, problem: Problem, progress: Callable[[str], None] = lambda _: None) -> None:
        self.problem = problem
        self.view = problem.view(problem.noise)
        self.progress = progress
        self.fitted: dict[tuple[str, ...], Evidence] = {}
        words = dict.fromkeys(k.depends_on for k in problem.kernels)
        self.words = (*words, MOMENTS) if problem.has_moments else (*words,)
        self._keep(problem.base)

    def run(self) -> "Search":
        """Forward while more effects are likelier, pairs, then exchanges among the best sets."""
        frontier = self.problem.base
        for depth in range(MOST):
            self.progress(f"effect {depth + 1}")
            grown = self._grow(frontier, FITTED - depth, BESIDE)
            if not grown:
                break
            best = max(grown, key=lambda h: self._log_posterior(h.effects))
            if self._log_posterior(best.effects) < max(map(self._log_posterior, self.fitted)):
                break
            frontier = self.polished(best.effects)
        self.progress("pairs of effects")
        self._pair()
        self.progress("exchanging effects")
        self._exchange()
        return self

    def likely(self, within: float = np.inf) -> list[tuple[str, ...]]:
        """Sets of effects that were fitted, within a log odds of the likeliest, which is first."""
        log = {names: self._log_posterior(names) for names in self.fitted}
        order = sorted(log, key=log.__getitem__, reverse=True)
        return [names for names in order if log[names] >= log[order[0]] - within]

    def polished(self, effects: tuple[str, ...]) -> Hypothesis:
        """A set fitted anew with all slopes where its numbers are now."""
        self._keep(self.view.fitter.fit(self.fitted[effects].hypothesis))
        return self.fitted[effects].hypothesis

    def _exchange(self) -> None:
        asked: set[tuple[tuple[str, ...], str]] = set()
        for _ in range(SETS):
            order = self.likely(NEAR)
            for names in order[:SETS]:
                for name in _last_of_kinds(names) if len(names) > 1 else ():
                    if (names, name) not in asked:
                        asked.add((names, name))
                        others = [n for n in self.problem.names if n != name]
                        self._grow(self.without(names, name), INSTEAD, 1, others)
            if self.likely()[0] == order[0]:
                return

    def joined(self, names: tuple[str, ...], more: Sequence[str]) -> tuple[str, ...]:
        """A fitted set with some effects more, fitted if it was not.

        What it has, or its model cannot have, is not added.
        """
        for name in (n for n in more if n not in names):
            both = self._known((*names, name))
            if both is None:
                h = self.fitted[names].hypothesis
                told, columns, each = self._screened(h, (name,))
                if name not in each:
                    continue
                found = self._fitted(h, told, columns[name], each[name])
                self._keep(found)
                both = found.effects
            names = both
        return names

    def without(self, names: tuple[str, ...], name: str) -> Hypothesis:
        """A fitted set less one effect, fitted if it was not."""
        rest = self._known([n for n in names if n != name])
        if rest is not None:
            return self.fitted[rest].hypothesis
        less = self.view.fitter.without(self.fitted[names].hypothesis, name)
        self._keep(less)
        return less

    def _pair(self) -> None:
        """Fits effects that gain together, none of which is the best alone, where growth begins."""
        (_, linear), _, alone = self._beside_base
        best = max(alone, key=lambda n: alone[n].gain, default="")
        gains = gains_of_pairs(linear, {n: own.white for n, own in alone.items() if n != best})
        for pair in sorted(gains, key=lambda p: -gains[p])[:PAIRS]:
            first, second = sorted(pair, key=lambda n: -alone[n].gain)
            if self._known(pair) is None:
                if (first,) not in self.fitted:
                    self._grow(self.problem.base, 1, 0, (first,))
                if (first,) in self.fitted:
                    self._grow(self.fitted[(first,)].hypothesis, 1, 0, (second,))

    def _grow(
        self, h: Hypothesis, alone: int, beside: int, names: Collection[str] | None = None
    ) -> list[Hypothesis]:
        """Fits the likeliest sets of one effect more, one of some or of all."""
        own = self.fitted[h.effects]
        told, columns, each = self._screened(h, names) if h.effects else self._beside_base
        if names is not None:
            each = {n: each[n] for n in names if n in each}
        order = sorted(each, key=lambda n: -each[n].gain)[:alone]
        if own.gains.max() > 0 and beside:
            f, s = np.unravel_index(own.gains.argmax(), own.gains.shape)
            with_likely = told[1].with_columns(SIZES[s] * own.white(self.view, f))
            among = {n: columns[n] for n in each}
            other = screened(with_likely, among, self.view.fitter.whiten)
            more = sorted(other, key=lambda n: -other[n].gain)[:beside]
            each = each | {n: other[n] for n in more if n not in order}
            order += [n for n in more if n not in order]
        grown = []
        for name in order:
            seen, more_of = each[name], (*h.effects, next_of_kind(h.effects, name))
            if seen.gain < WORTH or self._known(more_of) is not None:
                continue
            found = self._fitted(h, told, columns[name], seen)
            self._keep(found)
            grown.append(found)
        return grown

    @cached_property
    def _beside_base(self) -> _Screen:
        return self._screened(self.problem.base)

    def _screened(self, h: Hypothesis, names: Collection[str] | None = None) -> _Screen:
        """A hypothesis with the base as known, linear there, and some effects or all beside it."""
        told = self.problem.told(h)
        columns, linear = self.problem.columns(told, names), told.linear(self.view.fitter)
        return (told, linear), columns, screened(linear, columns, self.view.fitter.whiten)

    def _fitted(
        self, h: Hypothesis, told: tuple[Hypothesis, Linear], c: Candidate, seen: Screened
    ) -> Hypothesis:
        """From the linear start, and where the effect may be bent from another size, too.

        Args:
            h: without the effect.
            told: the same with the base's numbers as known, and its linear model.
            c: the effect.
            seen: what it would gain beside `told`.
        """
        fitter, start, grid = self.view.fitter, seen.starts[0], seen.grid
        if c.where is not None:
            start, log_share = nearby(
                c, seen.starts, *told, steps=fitter.steps, whiten=fitter.whiten
            )
            grid += log_share
        found = fitter.with_effect(h, c, start, grid)
        if c.limits is not None:
            return found
        if c.where is not None:
            return self._of_any_size(found, told[0], c, grid)
        value = np.array([p.value for p in c.parameters])
        best = found.log_evidence(found.linear(fitter))
        for other in [start, value] if len(value) > 1 else [self._best_size(*told, c)]:
            again = fitter.with_effect(told[0], c, other, grid)
            then = again.log_evidence(again.linear(fitter))
            if then > best:
                found, best = again, then
        return self._of_any_size(found, told[0], c, grid)

    def _of_any_size(
        self, found: Hypothesis, told: Hypothesis, c: Candidate, grid: float
    ) -> Hypothesis:
        """The newest effect as it was fitted, or with sizes that are unusual if these are likelier.

        A prior of two widths, whose tail is not so thin that no data could tell a lever of a metre.
        """
        own = slice(len(told.mean), None)
        z2 = float(np.sum((found.value - found.mean)[own] ** 2 / np.diag(found.cov)[own]))
        if z2 < -2 * np.log(PRIORS.far):  # no wider prior can gain its price
            return found
        fitter, instance = self.view.fitter, found.instance(found.effects[-1])
        values = [found.model.get(f"{instance}.{key_of(p.name)}") for p in c.parameters]
        far = fitter.with_effect(told, c, np.array(values), grid, far=True)
        both = [h.log_evidence(h.linear(fitter)) for h in (found, far)]
        return far if both[1] > both[0] else found

    def _best_size(self, told: Hypothesis, linear: Linear, c: Candidate) -> np.ndarray:
        """(1,) one of TRIED sizes of an effect of one number: what it leaves is least there.

        The other numbers of the hypothesis are free in it, but linear.
        """
        (p,) = c.parameters
        model = told.model.copy()
        model.add_effect(c.name)
        name = f"{newest_instance(model, c.name)}.{key_of(p.name)}"
        sizes = np.clip(p.usual + np.array([0, *TRIED]) * (p.value - p.usual), p.min, p.max)
        errors = self.problem.steps.errors(model, [name], sizes[:, None])
        left = linear.y + self.view.fitter.whiten(errors[1:] - errors[0])
        squares = (left**2).sum(axis=1) - (linear.taken(left)[0] ** 2).sum(axis=1)
        return sizes[1:][[np.argmin(squares)]]

    def _known(self, effects: Sequence[str]) -> tuple[str, ...] | None:
        """The fitted set of these effects, in whichever order it was fitted; None if none was."""
        return next((own for own in self.fitted if sorted(own) == sorted(effects)), None)

    def _keep(self, h: Hypothesis) -> None:
        self.fitted[h.effects] = evidence(h, self.view, h.linear(self.view.fitter))

    def _log_posterior(self, names: tuple[str, ...]) -> float:
        """Weight of a set at its best: alone or with the likeliest dependence, up to a constant."""
        own = self.fitted[names]
        forms = len(self.problem.kernels)
        other = float((own.gains + np.log(CHANCE)).max()) - np.log(forms)
        best = max(np.log(1 - PRIORS.outside), np.log(PRIORS.outside) + other)
        return own.alone + log_prior_of_effects(len(names), len(self.problem.names)) + best


def _last_of_kinds(names: tuple[str, ...]) -> list[str]:
    """Effects that may be left out: of several of a kind the last."""
    kind = {catalogue_name(name): name for name in names}
    return list(kind.values())


def log_prior_of_effects(count: int, candidates: int) -> float:
    """Log prior of a set of so many effects."""
    each = count * np.log(PRIORS.effects / candidates)
    return float(each + max(count - 1, 0) * np.log(PRIORS.further))


def evidence(h: Hypothesis, view: View, linear: Linear, cov: np.ndarray | None = None) -> Evidence:
    """Evidence of a hypothesis alone and with each dependence.

    Args:
        h: the hypothesis.
        view: under a noise.
        linear: of `h.linear`, with all that is there as well.
        cov: prior covariance in the place of its own.
    """
    rows, named = linear.parts[0].rows[0], int(h.named.sum())
    span, inside = rows[named:-1], view.stacked.dot(rows)[:, named:-1]
    cross, push = linear.taken(view.stacked)
    of_span, push_of_span = linear.taken(span)
    cross, push = cross - inside @ of_span, push - inside @ push_of_span
    own = np.concatenate([cross, inside], axis=1)
    grams = [gram - own[at] @ own[at].T for at, gram in zip(view.parts, view.grams, strict=True)]
    gains, falls = native.gains_by_size(grams, push, SIZES)
    gains = gains + view.log_shares[:, None]
    alone = h.log_evidence(linear, cov)
    return Evidence(h, linear, alone, gains, falls, span, inside, cross, push, grams)
