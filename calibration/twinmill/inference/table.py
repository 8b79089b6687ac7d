# SPDX-License-Identifier: Apache-2.0
"""The table of evidence: sets of effects, each alone and with nameless dependences."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any, Self

import numpy as np

from twinmill.inference import formal, moments
from twinmill.inference.discrepancy import CHANCE, OF_FORM, SIZES, STEP, TIME
from twinmill.inference.evidence import Linear, gains_by_size
from twinmill.inference.hypothesis import Fitter, Hypothesis
from twinmill.inference.moments import MOMENTS, Moment, Rate
from twinmill.inference.noise import Noise, fit_noise
from twinmill.inference.problem import Kinds, Problem, View
from twinmill.inference.search import Evidence, Search, evidence, log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import (
    catalogue_name,
    effect_names,
    with_role,
)

COMPARED = 10  # sets of the table, within ...
BEYOND = 12.0  # ... this log odds of the best: one in 160,000 decides nothing ...
WHOLE = 4  # ... of which so many also with a stale base and with two dependences
WORTH = 1.5  # least gain of a further moment: half of what one costs
DRAWS = 60  # of blocks, for the spread of estimates


@dataclass(frozen=True)
class Entry:
    """One hypothesis of the table: effects, whether the base is stale, and a dependence or two.

    Attributes:
        effects: names.
        stale: the base's numbers are known no better than a data sheet's.
        words: dependences.
        log_evidence: integrated over numbers, forms and sizes.
        log_mimicked: for each of `subsets`, the same where an unnamed thing is in its place, of
            which the dependence is the part that the effect's form does not take.
        blocks: (B,) log density of each block of time at the posterior mean.
        fall: of the squares by the dependence.
    """

    effects: tuple[str, ...]
    stale: bool
    words: tuple[str, ...]
    log_evidence: float
    log_mimicked: tuple[float, ...]
    blocks: np.ndarray
    fall: float


@dataclass(frozen=True)
class Numbers:
    """Posterior of all numbers of one set of effects, with the likeliest dependence beside it.

    Attributes:
        model: with the effects, where and when they act as fitted.
        labels: the base's numbers, weights of its discrepancy, then those of effects, N of them.
        mean, cov: (N,), (N, N).
        own: how many of the last are of the effects.
        alone: (N, N) of these, what they are in a model without the discrepancy.
    """

    model: Any
    labels: tuple[str, ...]
    mean: np.ndarray
    cov: np.ndarray
    own: int
    alone: np.ndarray

    def of_effects(self) -> dict[str, tuple[float, float]]:
        """Name -> (value, standard deviation) of the effects' numbers."""
        first = len(self.labels) - self.own
        std = np.sqrt(np.diag(self.cov))
        rows = zip(self.labels, self.mean.tolist(), std.tolist(), strict=True)
        return {name: (value, spread) for name, value, spread in [*rows][first:]}


@dataclass(frozen=True)
class NoNews:
    """Some effects of a set are none of their own.

    Attributes:
        always: those that the base always lacked.
        formal: those that an error of the others' formulas looks like, or of what the base lacks.
        words: dependences that these share with those.
        log_odds: log evidence over that of effects that are new, the base's own log taken in.
        log_own: Bayes factor, in that log, of those that the base always lacked.
    """

    always: tuple[str, ...]
    formal: tuple[str, ...]
    words: tuple[str, ...]
    log_odds: float
    log_own: float


@dataclass(frozen=True)
class Table:
    """All that an answer is made of.

    Attributes:
        entries: hypotheses.
        numbers: of each set of effects.
        takes: of each set of effects, squares of what each of them changes.
        excess: squares that the base leaves over those of noise.
        candidates: effects that compete.
        words: dependences that compete.
        no_news: of sets, how some of their effects may be none of their own.
        swells: of sets in which several effects act from moments on, the kind of the one thing
            that they are steps of, where what they change together comes and goes once.
        kinds: of effects.
    """

    entries: list[Entry]
    numbers: dict[tuple[str, ...], Numbers]
    takes: dict[tuple[str, ...], np.ndarray]
    excess: float
    candidates: tuple[str, ...]
    words: tuple[str, ...]
    no_news: dict[tuple[str, ...], list[NoNews]]
    swells: dict[tuple[str, ...], str]
    kinds: Kinds


def subsets(effects: tuple[str, ...]) -> list[tuple[str, ...]]:
    """All sets of some of the effects, which one unnamed thing may be in the place of."""
    counts = range(1, len(effects) + 1)
    return [subset for n in counts for subset in combinations(effects, n)]


def table_of(search: Search) -> Table:
    """Evidence of the likely sets, each under the noise that suits it best of two.

    Two noises: what the best set leaves with its likeliest dependence, and what the base leaves.
    With one noise for all, slow drive noise is told as a dependence on time.
    """
    p, order = search.problem, search.likely(BEYOND)
    inside = [k for k in search.fitted if set(k) < set(order[0])]
    kept = list(dict.fromkeys([(), *order[:COMPARED], *inside]))
    whole = {(), *order[:WHOLE]}
    views = []
    fitted = {names: search.polished(names) for names in kept}
    best_set = search.fitted[order[0]]
    for h, beside in ((fitted[order[0]], _likeliest_columns(best_set, p)), (fitted[()], None)):
        search.progress("noise")
        views.append(p.view(noise_of(h, p, beside)))
    compared = _all_compared(search, fitted, views, whole)
    entries = _likeliest_of_each([e for own in compared.values() for e in own.entries])
    first = _likeliest_of_each([e for own in compared.values() for e in own.first])
    falls = {key: entry.fall for key, entry in first.items()}
    rows = len(p.steps) * int(p.steps.observed.sum())
    return Table(
        [replace(e, fall=falls.get(k, e.fall)) for k, e in entries.items()],
        {names: own.best.numbers() for names, own in compared.items()},
        {names: own.takes for names, own in compared.items()},
        max(fitted[()].linear(views[0].fitter).left - rows, 1e-9),
        tuple(p.names),
        search.words,
        {names: own.best.no_news() for names, own in compared.items()},
        {n: kind for n, own in compared.items() if (kind := _swells(own.best.h, p.kinds))},
        p.kinds,
    )


@dataclass(frozen=True)
class _Compared:
    """A set of effects under each noise.

    Attributes:
        entries: under all.
        first: those under the first noise, as are the excess of a table and ...
        takes: ... squares of what each effect changes.
        best: the comparison under the noise that suits it best.
    """

    entries: list[Entry]
    first: list[Entry]
    takes: np.ndarray
    best: "_Comparison"

    @classmethod
    def at_best(cls, search: Search, h: Hypothesis, views: Sequence[View], whole: bool) -> Self:
        """A set compared from its best numbers, which another prior may lead to."""
        search.progress("comparing hypotheses")
        own = cls.of(search, h, views, whole)
        if (start := own.best.better_start) is None:
            return own
        return cls.of(search, views[0].fitter.fit(replace(h, value=start)), views, whole)

    @classmethod
    def of(cls, search: Search, h: Hypothesis, views: Sequence[View], whole: bool) -> Self:
        """Evidence of a fitted set; if `whole`, also of a stale base, and with two dependences."""
        p, changes = search.problem, _changes(search.problem, h)
        forms = [p.forms(change) for change in changes]
        stale = _beside_stale_bases(p, h, views[0].fitter) if whole else []
        within = [[h.effects.index(n) for n in subset] for subset in subsets(h.effects)]
        each = [(view.fitter.whiten(changes) ** 2).sum(axis=1) for view in views]
        owns = []
        for view, takes in zip(views, each, strict=True):
            squares = np.array([takes[index].sum() for index in within])
            own = _Comparison(p, search.words, h, stale, changes, forms, squares, view)
            owns.append((own.entries(whole), own))
        best = max(owns, key=lambda o: max(entry.log_evidence for entry in o[0]))[1]
        return cls([e for own, _ in owns for e in own], owns[0][0], each[0], best)

    def likeliest_always(self) -> tuple[float, tuple[str, ...]]:
        """Log posterior, up to a constant, and which of its effects the base always lacked."""
        count, names = len(self.best.h.effects), len(self.best.problem.names)
        log = max(entry.log_evidence for entry in self.entries)
        each = [(odds, own) for own, _, _, odds, _ in self.best.always]
        return max(
            (log + odds + log_prior_of_effects(count - len(own), names), own) for odds, own in each
        )


def _all_compared(
    search: Search,
    fitted: dict[tuple[str, ...], Hypothesis],
    views: Sequence[View],
    whole: Collection[tuple[str, ...]],
) -> dict[tuple[str, ...], _Compared]:
    """Sets compared, and each with what the base most probably always lacked: no set chooses that.

    Args:
        search: in which sets were fitted.
        fitted: some of them.
        views: under each noise.
        whole: sets compared beside a stale base, and with two dependences, as well.
    """
    compared = {n: _Compared.at_best(search, h, views, n in whole) for n, h in fitted.items()}
    joined: set[tuple[str, ...]] = {()}
    while (always := max(own.likeliest_always() for own in compared.values())[1]) not in joined:
        joined.add(always)
        for names in fitted:
            more = search.joined(names, always)
            if more not in compared:
                h = search.fitted[more].hypothesis
                compared[more] = _Compared.at_best(search, h, views, False)
    return compared


_Case = tuple[tuple[str, ...], bool, frozenset[str]]  # effects, stale base, dependences


def _likeliest_of_each(entries: list[Entry]) -> dict[_Case, Entry]:
    """Entry with the most evidence for each set of effects, kind of base and dependences."""
    order = sorted(entries, key=lambda e: e.log_evidence)
    return {(e.effects, e.stale, frozenset(e.words)): e for e in order}


def _swells(h: Hypothesis, kinds: Kinds) -> str | None:
    """Kind of the one thing that several effects at moments are steps of; None if not of one."""
    own = [n for n in h.effects if catalogue_name(n) in kinds.at_moments]
    steps: list[tuple[float, float]] = []
    for name in own:
        kind, instance = catalogue_name(name), h.instance(name)
        size = h.model.get(f"{instance}.{with_role(kind, 'size')[0]}")
        moments_s = [h.model.get(f"{instance}.{key}") for key in with_role(kind, "moment")]
        steps += zip(moments_s, (size, -size), strict=False)
    if len(own) < 2 or not swells_once(steps):
        return None
    return min(map(catalogue_name, own), key=lambda kind: len(with_role(kind, "moment")))


def swells_once(steps: list[tuple[float, float]]) -> bool:
    """True if a course from zero, changing at times by so much each, grows once and then falls.

    Args:
        steps: time in s, and the change of the size at it.
    """
    course = np.round(np.cumsum([change for _, change in sorted(steps)]), 9)
    grows = np.diff(np.abs(course), prepend=0.0) > 0
    return bool((course * course[0] >= 0).all() and not (np.diff(grows.astype(int)) > 0).any())


def _likeliest_columns(own: Evidence, p: Problem) -> np.ndarray:
    """(K, W, 3) columns of the likeliest dependence at its size; none if it gains nothing."""
    f, s, gain = own.likeliest(range(len(p.kernels)))
    columns = SIZES[s] * p.kernels[f].columns
    return columns if gain > 0 else columns[:0]


def noise_of(h: Hypothesis, p: Problem, beside: np.ndarray | None = None) -> Noise:
    """The noise that a hypothesis leaves; steps weigh as with all flexible terms.

    Args:
        h: the hypothesis.
        p: of the logs.
        beside: (K, W, 3) columns of a dependence that is there as well.
    """
    return fit_noise(*h.about_mean(beside), p.noise, p.usual)


@dataclass(frozen=True)
class _Beside:
    """Dependences beside a set of effects before more are looked at.

    Attributes:
        words: dependences that it is; none for moments as often as usual.
        white: (K, R) columns.
        log_chance: prior of just these.
        fall: of the squares by it; 0 if it is none.
        log_relative: (M,) log prior of its size where it is what the form of each of `subsets`
            leaves, over that of a thing of its own.
        cov: prior covariance of a stale base; None for what is known.
        local: (B,) what moments cost the evidence, in the blocks in which they are: where a block
            counts less, so does the price of what happened in it.
    """

    words: tuple[str, ...]
    white: np.ndarray
    log_chance: float
    fall: float
    log_relative: np.ndarray
    cov: np.ndarray | None
    local: np.ndarray


def _log_prior(beside: _Beside) -> float:
    """Log prior of these, and that the base is stale, or is not."""
    chance = 1 - PRIORS.stale if beside.cov is None else PRIORS.stale
    return beside.log_chance + float(np.log(chance))


@dataclass(frozen=True)
class _Comparison:
    """One set of effects under one noise."""

    problem: Problem
    words: tuple[str, ...]
    h: Hypothesis
    stale: list[Hypothesis]  # the same beside each kind of stale base, where these are compared
    changes: np.ndarray  # (E, W, C) of the prediction by each effect
    forms: list[tuple[np.ndarray, ...]]  # what the formula of each effect may miss
    squares: np.ndarray  # (M,) that each of `subsets` takes
    view: View

    def entries(self, whole: bool) -> list[Entry]:
        """Alone and with each dependence; if `whole`, also of a stale base, and with two."""
        (usual, own), *others = self._plain
        news = self._usual_and_news[1]
        out = [self._alone(usual), *self._with_words(usual, own), self._alone(news)]
        out += self._of_noise(usual)
        for other, of_other in others:
            out += [self._alone(other), *self._with_words(other, of_other)]
        if whole:
            for stale in self._stale_usual:
                out += [self._alone(stale), *self._with_words(stale, self._evidence(stale))]
            for first in (news, self._likeliest(usual, own)):
                if first.fall > 0:
                    out += self._with_words(first, self._evidence(first))
                    out += self._of_noise(first)
        return _as_without_moments(out)

    def numbers(self) -> Numbers:
        """Estimates and their covariance.

        As wide as the posterior, and as blocks of time drawn again and again let them scatter,
        which is wider where the form is wrong (Lyddon, Holmes and Walker 2019, Biometrika 106).
        """
        likely = [self._likeliest(b, own) for b, own in self._plain]
        plain = [(b, own.linear) for b, own in self._plain]
        more = self._usual_and_news[1], *likely, *self._stale_usual
        every = plain + [(b, self._linear(b)) for b in more]
        best, linear = max(every, key=lambda b: b[1].log_evidence + _log_prior(b[0]))
        mean, spread = self.h.posterior(linear, best.cov)
        root = np.linalg.cholesky(self.h.cov if best.cov is None else best.cov)
        count, x = len(self.h.mean), linear.x
        parts = [x[:, self.view.block == b] for b in range(self.view.block.max() + 1)]
        grams = np.array([part @ part.T for part in parts])
        pushes = np.array([part @ linear.y[self.view.block == b] for b, part in enumerate(parts)])
        draws = np.random.default_rng(0).dirichlet(np.ones(len(parts)), DRAWS) * len(parts)
        drawn = [
            root @ np.linalg.solve(np.tensordot(w, grams, 1) + np.eye(len(x)), w @ pushes)[:count]
            for w in draws
        ]
        wider = np.sqrt(np.maximum(np.var(drawn, axis=0) / np.diag(spread), 1.0))
        return Numbers(
            self.h.model,
            self.h.labels,
            np.clip(mean, self.h.low, self.h.high),
            spread * np.outer(wider, wider),
            count - len(self.problem.prior.mean),
            self._without_discrepancy(),
        )

    def _without_discrepancy(self) -> np.ndarray:
        """(N, N) of all numbers, those of a model without the base's discrepancy.

        Its prediction is the nearest to that of the whole model, as the noise measures it and as
        far as a data sheet lets it go; weights become zero (projection of a posterior; Goutis and
        Robert 1998, Biometrika 85).
        """
        named = self.h.named
        out = np.diag(named.astype(float))
        if not named.all():
            x, beside = self._rows[: named.sum()], self.view.fitter.always
            known = np.linalg.inv(_stale_covs(self.problem, self.h)[0][np.ix_(named, named)])
            out[np.ix_(named, ~named)] = np.linalg.solve(x @ x.T + known, x @ beside.T)
        return out

    def no_news(self) -> list[NoNews]:
        """Effects that the base always lacked, or that an error of the others' formulas may be."""
        found, sized = [], self.problem.kinds.sized
        for always, h, linear, log_odds, log_own in self.always:
            found.append(NoNews(always, (), (), log_odds, log_own))
            for names in subsets(tuple(n for n in self.h.effects if n not in always)):
                kin = {n: self._kin(n, names) for n in names if catalogue_name(n) in sized}
                if len(kin) == len(names) and all(kin.values()):
                    sizes = {n: sum(size**2 for _, size in own) ** 0.5 for n, own in kin.items()}
                    own = formal.log_odds(h, linear, sizes, norms=self._norms)
                    own -= len(names) * float(np.log(len(self.forms[0]) + 1))
                    words = tuple(word for each in kin.values() for word, _ in each)
                    found.append(NoNews(always, names, words, log_odds + own, log_own))
        return [known for known in found if known.always or known.formal]

    @cached_property
    def _norms(self) -> np.ndarray:
        """(N,) of the slopes of all numbers, as the noise weighs them; 0 of a discrepancy's."""
        norms = np.zeros(len(self.h.labels))
        norms[self.h.named] = np.linalg.norm(self._rows[: self.h.named.sum()], axis=1)
        return norms

    def _kin(self, name: str, without: tuple[str, ...]) -> list[tuple[str, float]]:
        """Word and white norm of what depends on the same as an effect, and is of a formula."""
        words = self.problem.kinds.told_by[catalogue_name(name)]
        return [
            (shared[0], size)
            for part, own_words, size in self._of_formulas
            if part not in without and (shared := [w for w in own_words if w in words]) and size
        ]

    @cached_property
    def _of_formulas(self) -> list[tuple[str | None, tuple[str, ...], float]]:
        """Name, dependences and white norm of each effect, and of what the base always misses."""
        told_by, whiten = self.problem.kinds.told_by, self.view.fitter.whiten
        own = zip(self.h.effects, self.changes, strict=True)
        parts = [
            *((n, told_by[catalogue_name(n)], change) for n, change in own),
            *((None, missed.words, missed.change) for missed in self.problem.missed),
        ]
        return [(n, words, float(np.linalg.norm(whiten(change)))) for n, words, change in parts]

    @property
    def better_start(self) -> np.ndarray | None:
        """(N,) numbers at which new effects are likelier, too; None where their fit is the best.

        A fit may end beside the optimum, and another prior's lead to it.
        """
        starts = (told.value for names, told, *_ in self.always if names)
        return next((v for v in starts if self.view.fitter.is_better(self.h, v)), None)

    @cached_property
    def always(self) -> list[tuple[tuple[str, ...], Hypothesis, Linear, float, float]]:
        """Each subset that the base may always have lacked, as `_of_always` gives it."""
        return [*self._of_always()]

    def _of_always(self) -> Iterator[tuple[tuple[str, ...], Hypothesis, Linear, float, float]]:
        """Each of `subsets`, and none: with these always there, and log odds against new ones.

        The last is the part of the odds that the base's own log tells.

        What may decide is fitted anew: numbers that the base's own log tells can be far from
        these, where the model is another linear one.
        """
        fitter, new = self.view.fitter, self.h.log_evidence(self._known)
        yield (), self.h, self._known, 0.0, 0.0
        for names in subsets(self.h.effects):
            if there := self.problem.always_there(self.h, names):
                told, log_factor = there
                log_odds = told.log_evidence(told.linear(fitter)) + log_factor - new
                if log_odds > -BEYOND:
                    told = fitter.fit(told)
                    linear = told.linear(fitter)
                    log_odds = told.log_evidence(linear) + log_factor - new
                    yield names, told, linear, log_odds, log_factor

    @cached_property
    def _usual_and_news(self) -> tuple[_Beside, _Beside]:
        return self._moments(None)

    @cached_property
    def _plain(self) -> list[tuple[_Beside, Evidence]]:
        """Usual moments and each of what may be in their place, with its evidence."""
        usual = self._usual_and_news[0]
        return [(beside, self._evidence(beside)) for beside in (usual, *self._others(usual))]

    def _moments(self, cov: np.ndarray | None) -> tuple[_Beside, _Beside]:
        """Moments as often as the base's own log had them, and as news."""
        bare = self._bare(cov)
        found = moments.find(bare, *self.view.moments, WORTH)
        beside = []
        news = (Rate(), (MOMENTS,)) if self.problem.has_moments else (None, ())
        for rate, words in ((self.problem.rate, ()), news):
            on = found.on[: found.likeliest(rate)] if rate else ()
            chance = float(found.log_chance(rate)[len(on)]) if rate else 0.0
            white = np.concatenate([np.zeros((0, len(bare.y))), *(m.white for m in on)])
            fall = 2 * float(found.gains[len(on)])
            relative = self._log_relative(np.array(fall))
            local = self._price(bare, white, on, chance)
            beside.append(_Beside(words, white, chance, fall, relative, cov, local))
        return beside[0], beside[1]

    @cached_property
    def _stale_usual(self) -> list[_Beside]:
        """Usual moments beside each kind of stale base, all as likely."""
        price = float(np.log(max(len(self.stale), 1)))
        each = [self._moments(cov)[0] for cov, _ in self._of_stale]
        return [replace(beside, log_chance=beside.log_chance - price) for beside in each]

    def _others(self, usual: _Beside) -> list[_Beside]:
        """Alternatives to usual moments, which are looked for before all else.

        Nothing, where a dependence does what they do; and what the formula of an effect misses.
        """
        none = [self._without_moments(usual)] if len(usual.white) else []
        return [*none, *self._of_form(none[0] if none else usual)]

    def _without_moments(self, usual: _Beside) -> _Beside:
        rate, count = self.problem.rate, len(self.view.moments[0].columns) - 1
        chance = float(rate.log_chance(np.array(0), count)) if rate else 0.0
        nothing = np.zeros(())
        return replace(
            usual,
            white=usual.white[:0],
            log_chance=chance,
            fall=0.0,
            log_relative=self._log_relative(nothing),
            local=np.zeros_like(usual.local),
        )

    def _of_form(self, beside: _Beside) -> list[_Beside]:
        """With what the formula of one effect misses at its likeliest size; none if it is exact."""
        linear, best = self._linear(beside), (0.0, beside)
        for forms in self.forms:
            for columns in forms:
                white = self.view.fitter.whiten(columns)
                gains, _ = gains_by_size(*linear.projected(white, white @ white.T), SIZES)
                chance = np.log(OF_FORM / len(forms))
                s = int(np.argmax(gains + chance))
                gain = float(gains[s] + chance[s])
                if gain > best[0]:
                    both = np.concatenate([beside.white, SIZES[s] * white])
                    likely = beside.log_chance + float(chance[s])
                    best = gain, replace(beside, white=both, log_chance=likely)
        return [best[1]] if best[0] else []

    def _price(
        self, bare: Linear, white: np.ndarray, on: Sequence[Moment], chance: float
    ) -> np.ndarray:
        """(B,) change of the evidence by moments less that of the density, in their blocks."""
        block, count = self.view.block, self.view.block.max() + 1
        if not len(on):
            return np.zeros(count)
        linear = bare.with_columns(white)
        density = linear.log_densities(block).sum() - bare.log_densities(block).sum()
        price = linear.log_evidence + chance - bare.log_evidence - density
        rows = [np.argmax(np.abs(m.white).max(axis=0)) for m in on]
        return np.bincount(block[rows], minlength=count) * price / len(on)

    def _likeliest(self, usual: _Beside, own: Evidence) -> _Beside:
        """The likeliest form and size of a dependence, as something that is there as well."""
        f, s, gain = own.likeliest(range(len(self.view.kernels)))
        word = self.view.kernels[f].depends_on
        forms = sum(k.depends_on == word for k in self.view.kernels)
        return _Beside(
            (word,),
            np.concatenate([usual.white, SIZES[s] * own.white(self.view, f)]),
            usual.log_chance + float(np.log(CHANCE[s] / forms)),
            float(own.falls[f, s]) if gain > 0 else 0.0,
            self._log_relative(own.falls[f, s]) - np.log(CHANCE[s]),
            None,
            usual.local,
        )

    def _evidence(self, beside: _Beside) -> Evidence:
        return evidence(self.h, self.view, self._linear(beside), beside.cov)

    def _linear(self, beside: _Beside) -> Linear:
        return self._bare(beside.cov).with_columns(beside.white)

    def _bare(self, cov: np.ndarray | None) -> Linear:
        if cov is None:
            return self._known
        return next(own for of, own in self._of_stale if of is cov)

    @cached_property
    def _known(self) -> Linear:
        return self.h.linear(self.view.fitter)

    @cached_property
    def _of_stale(self) -> list[tuple[np.ndarray, Linear]]:
        return [(h.cov, h.linear(self.view.fitter)) for h in self.stale]

    @property
    def _rows(self) -> np.ndarray:
        """Rows as `Hypothesis.rows` has them."""
        return self._known.parts[0].rows[0]

    def _alone(self, beside: _Beside) -> Entry:
        """The entry with no more than what is beside."""
        linear = self._linear(beside)
        found = self.h.log_evidence(linear, beside.cov) + beside.log_chance
        return self._entry(
            beside,
            linear,
            words=beside.words,
            log_evidence=found,
            fall=beside.fall,
            mimicked=beside.log_relative if beside.words else -np.inf,
        )

    def _with_words(self, beside: _Beside, own: Evidence) -> list[Entry]:
        """Entries with each dependence that is not beside already.

        As far as the base may always have had it, it is no news.
        """
        out = []
        for word in self.words:
            if word not in (MOMENTS, *beside.words):
                at = [k for k, kernel in enumerate(self.view.kernels) if kernel.depends_on == word]
                usual = np.array([self._as_always(own, k) for k in at])
                new = own.gains[at] + np.log(CHANCE / len(at))
                for words, likely in ((beside.words, usual), ((*beside.words, word), new)):
                    if np.isfinite(likely).any():
                        out.append(self._with_word(beside, own, at, likely=likely, words=words))
        return out

    def _as_always(self, own: Evidence, f: int) -> np.ndarray:
        """(S,) log odds of a kernel that the base always had with each size, over none.

        One that gains nothing as news explains nothing.
        """
        name, white = self.view.kernels[f].name, self.view.white(f)
        chance, gains = self.problem.wander.get(name, 0 * CHANCE), own.gains[f]
        if gains.max() > 0 and (lasting := self.problem.lasting(name)):
            columns = lasting.columns(white, self._own_slopes)
            columns = columns - columns @ own.span.T @ own.span
            chance, gains = lasting.chance, lasting.gains(own.linear, columns)
        with np.errstate(divide="ignore"):
            return gains + np.log(chance)

    @cached_property
    def _own_slopes(self) -> np.ndarray:
        """(N', R) white slopes of the numbers that the base's own log had."""
        named, fitter = self.h.named, self.view.fitter
        found = np.empty((len(named), self._rows.shape[1]))
        found[named], found[~named] = self._rows[: named.sum()], fitter.always
        return self.problem.in_own_log(found)

    def _of_noise(self, beside: _Beside) -> list[Entry]:
        """An entry in which the noise itself is a thing that comes and goes, and new."""
        if self.view.growth is None:
            return []
        log_odds, fall = self.view.growth
        forms = sum(kernel.depends_on == TIME for kernel in self.view.kernels) + 1
        alone = self._alone(beside)
        log_evidence = alone.log_evidence + log_odds - np.log(forms)
        relative = beside.log_relative if beside.words else self._log_relative(np.array(fall))
        relative = np.broadcast_to(relative, len(self.squares))
        return [
            replace(
                alone,
                words=tuple(dict.fromkeys((*beside.words, TIME))),
                log_evidence=log_evidence,
                log_mimicked=tuple((log_evidence + relative).tolist()),
                fall=beside.fall if beside.words else fall,
            )
        ]

    def _with_word(
        self,
        beside: _Beside,
        own: Evidence,
        at: list[int],
        *,
        likely: np.ndarray,
        words: tuple[str, ...],
    ) -> Entry:
        """With a dependence, told in these words, whose kernels have (F, S) log odds by size."""
        total = float(np.logaddexp.reduce(likely, axis=None))
        mimicked: np.ndarray | float = beside.log_relative if beside.words else -np.inf
        if words and not beside.words:
            relative = self._log_relative(own.falls[at])
            each = own.gains[at] - np.log(len(at)) + relative
            each = each.reshape(len(relative), likely.size)
            mimicked = np.logaddexp.reduce(each, axis=1) - total
        f, s = np.unravel_index(likely.argmax(), likely.shape)
        linear = own.with_kernel(self.view, at[f], float(SIZES[s]))
        return self._entry(
            beside,
            linear,
            words=words,
            log_evidence=own.alone + beside.log_chance + total,
            fall=beside.fall if beside.words else float(own.falls[at][f, s]),
            mimicked=mimicked,
        )

    def _entry(
        self,
        beside: _Beside,
        linear: Linear,
        *,
        words: tuple[str, ...],
        log_evidence: float,
        fall: float,
        mimicked: np.ndarray | float,
    ) -> Entry:
        sizes = np.bincount(self.view.block, self.view.log_sizes)
        blocks = linear.log_densities(self.view.block) - sizes + beside.local
        found = log_evidence - self.view.log_size
        return Entry(
            self.h.effects,
            beside.cov is not None,
            words,
            found,
            tuple(float(found + m) for m in np.broadcast_to(mimicked, len(self.squares))),
            blocks,
            fall,
        )

    def _log_relative(self, falls: np.ndarray) -> np.ndarray:
        """(M, ...) log prior of a dependence that takes these squares as what effects leave.

        The share of the squares of an unnamed thing that the forms of effects do not take is
        uniform between nothing and all. Each size stands for a bin of the grid of sizes.
        """
        squares = self.squares.reshape(-1, *[1] * np.ndim(falls))
        share = falls / np.maximum(falls + squares, 1e-300)
        with np.errstate(divide="ignore"):
            return np.log(np.minimum(1, share * STEP**2) - share / STEP**2)


def _as_without_moments(entries: list[Entry]) -> list[Entry]:
    """Entries whose moments count whole, whatever blocks are drawn: they are of a few by nature."""
    order = sorted(entries, key=lambda e: e.log_evidence)  # of alike ones the likeliest is kept
    blocks = {(e.stale, frozenset(e.words)): e.blocks for e in order}
    return [
        replace(e, blocks=blocks.get((e.stale, frozenset(e.words) - {MOMENTS}), e.blocks))
        if MOMENTS in e.words
        else e
        for e in entries
    ]


def _beside_stale_bases(p: Problem, h: Hypothesis, fitter: Fitter) -> list[Hypothesis]:
    """A hypothesis with each kind of stale base, fitted anew.

    From the base's mean, too, as a known one may have gone astray; it has not where it is the best
    for a stale one as well.
    """
    value, found = h.value.copy(), []
    own = np.flatnonzero(h.named)[: len(p.prior.names)]
    value[own] = np.clip(h.mean[own], h.low[own], h.high[own])
    for cov in _stale_covs(p, h):
        stale = replace(h, cov=cov)
        best = fitter.fit(stale, known=h.slopes)
        if fitter.is_better(stale, best.value):
            other = fitter.fit(replace(stale, value=value))
            best = other if fitter.is_better(best, other.value) else best
        found.append(best)
    return found


def _stale_covs(p: Problem, h: Hypothesis) -> list[np.ndarray]:
    """(N, N) each of the prior, the base's numbers as a data sheet knows them."""
    found, count = [], len(p.prior.mean)
    for own in (p.prior.stale, *p.prior.faster):
        cov = h.cov.copy()
        cov[:count, :count] = own
        found.append(cov)
    return found


def _changes(p: Problem, h: Hypothesis) -> np.ndarray:
    """(E, W, 3) change of the prediction by each effect, m and rad."""
    found = []
    for name in h.effects:
        model = h.model.copy()
        model.remove_effect(effect_names(model).index(h.instance(name)))
        found.append(p.steps.errors(model)[0] - p.steps.errors(h.model)[0])
    return np.array(found).reshape(-1, len(p.steps), len(p.steps.observed))
