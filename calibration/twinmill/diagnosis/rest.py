# SPDX-License-Identifier: Apache-2.0
"""Rest once the found effects are in the model: how much, how firm, depending on which quantity.

How much: the squared error over the floor, above 1. How firm: whether the smooth response of the
noise floor predicts left-out parts better than the model does, block by block. On what: ridge
regression of the errors on groups of velocity terms without physics names, each judged on parts
that it was not fitted to.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.finding import HARDLY, Finding
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.formula_search import Rival, formula_of
from twinmill.diagnosis.library import LEFT_OVER, library
from twinmill.diagnosis.moments import Events, Moment, events_of
from twinmill.diagnosis.place import comes_again
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.wander import Wander, wandering
from twinmill.fitting.boosting import squares
from twinmill.fitting.compare import GOOD
from twinmill.fitting.floor import NoiseFloor
from twinmill.fitting.independence import LONGEST, fresh_shares
from twinmill.fitting.opening import Opened, thinned
from twinmill.fitting.score_fit import ScoreFit
from twinmill.formulas.term import COUPLING, PLACE, TIME, WAY, Term
from twinmill.predict.datasets import Trajectory, thinning

MOST_BLOCKS = 200
FOLDS = 5
HOLDS = 0.9  # share of a square
RIDGES = (1.0, 0.03)  # of what is of usual strength, and of what is far stronger
FLIPS = 299  # random signs of blocks that make the null distribution
MOMENTS = "single moments"
STEADY = ("speed", "turning rate", COUPLING, "direction of rotation")
FIRM, FEW, NOISE = "firm", "in too few stretches", "may be noise"
WANDERS, MAY_WANDER = "wanders by itself", "may wander by itself"
NOT_LOOKED_AT = "not looked at"
SLOW = (TIME, WAY, PLACE)  # groups that change slowly along any drive
FOLLOWS = 4  # numbers over time beyond which a group follows a wander: one formula has no more


@dataclass(frozen=True)
class Dependence:
    """A group of terms: the held-out fall of the cost that it brings, and whether chance could.

    Attributes:
        own: (T,) bool, the terms of it that bring most.
        if_new: chance could not, if each prediction told something new.
    """

    group: str
    gain: float
    sure: bool
    own: np.ndarray
    if_new: bool = False


@dataclass(frozen=True)
class Tested:
    """Terms of a group that are tested together.

    Attributes:
        places: (k,) of the terms, ascending.
    """

    group: str
    places: np.ndarray


# Share of a test's evidence that counts, of (R,) errors that it leaves and those that it explained.
Fresh = Callable[[Tested, np.ndarray, np.ndarray], float]


@dataclass(frozen=True)
class Rest:
    """Errors that remain, and their dependences.

    Attributes:
        share: of the squared error above the floor that the model as given had.
        firm: the smooth response predicts left-out parts better, beyond doubt.
        far: what is left is too large to be noise, in however few stretches it is.
        depends_on: groups, the strongest first.
        likely: no group is beyond chance; something is left, and these stand out.
        term, coefficient: the best single formula, in its unit; None if no group helps.
        takes: share of what is left that the formula takes on left-out parts.
        family_takes: the same of all that was tested of the first group together.
        little: no more than what is called good, however sure it is.
        left_over: fall of the cost per independent error by every group that brings any.
        old: groups that help no more than they did on other logs.
        events: single moments that neither commands nor findings explain, and the like.
        again: least share of the squared error of way that comes again at the same places. The
            floor counts it as noise, since it follows from no command.
        proven: a formula for it that blocks which neither chose nor fitted it bear out.
        if_new: something would be beyond chance if each prediction told something new.
        wanders: errors tell the next ones, as those of what wanders by itself do, or far more is
            random than was.
        by_itself: what wanders, where nothing shows that the rest is anything else.
        looked_at: false where the share alone is known.
    """

    share: float
    firm: bool
    depends_on: list[str]
    term: Term | None = None
    coefficient: float = 0.0
    takes: float = 0.0
    left_over: Mapping[str, float] | None = None
    old: tuple[str, ...] = ()
    events: Events = field(default_factory=Events)
    again: float = 0.0
    proven: Formula | None = None
    far: bool = False
    likely: bool = False
    family_takes: float = 0.0
    little: bool = False
    if_new: bool = False
    wanders: bool = False
    by_itself: Wander | None = None
    looked_at: bool = True

    def with_findings(self, findings: Sequence[Finding]) -> "Rest":
        """With what doubtful findings depend on: first, if they take more than is left.

        Where they take less, and what is left tells by itself on what it depends, that stands.
        """
        return self.with_first(
            [f.depends_on for f in findings if f.depends_on and f.share >= self.least]
        )

    def with_first(self, names: Sequence[str]) -> "Rest":
        """With these before all else that it depends on: likely, where nothing else is known."""
        likely = self.likely or bool(names and not self.depends_on)
        every = dict.fromkeys([*names, *self.depends_on])
        return replace(self, depends_on=list(every), likely=likely)

    def most_likely(self, names: Sequence[str]) -> "Rest":
        """With what it may depend on, if nothing is known of that."""
        return replace(self, depends_on=list(names), likely=bool(names))

    def as_before(self) -> "Rest":
        """As no news: what it depends on, the model missed on the logs that it was fitted to."""
        old = (*self.old, *self.depends_on)
        return replace(self, firm=False, depends_on=[], old=old, by_itself=None)

    def as_answers(self) -> "Rest":
        """As what a controller's answers may make of noise, of which nothing can be told.

        What follows place or time, comes at moments, or wanders by itself, no answer makes.
        """
        if {PLACE, TIME, MOMENTS} & set(self.depends_on):
            return self
        return replace(
            self, firm=False, far=False, depends_on=[], likely=False, term=None, proven=None
        )

    def at_few_commands(self) -> "Rest":
        """Without steady speeds, where little is left: at few commands the base may make them.

        Nor is a formula of these then proven.
        """
        if not self.little:
            return self
        kept = [g for g in self.depends_on if g not in STEADY and not g.startswith("command of")]
        proven = self.proven if self.proven and {*self.proven.depends_on} <= {*kept} else None
        return replace(self, depends_on=kept, likely=self.likely and bool(kept), proven=proven)

    @property
    def moments(self) -> tuple[Moment, ...]:
        """Single moments that neither commands nor findings explain."""
        return self.events.moments

    @property
    def least(self) -> float:
        """Share that a finding must take so that what it depends on is told first."""
        return self.share if self.depends_on else 0.0

    @property
    def on(self) -> str:
        """On what it depends all the time, as `on X and Y`; empty if that is not known."""
        names = [name for name in self.depends_on if name != MOMENTS]
        if self.likely and names:
            size = f", {self.by_itself.words}" if self.by_itself and self.by_itself.words else ""
            by_itself = f", or wanders by itself{size}" if self.wanders else ""
            return f"most likely on {' or '.join(names)}{by_itself}"
        return f"on {' and '.join(names)}" if names else ""

    @property
    def certainty(self) -> str:
        """In words: FIRM, FEW, NOISE, WANDERS, MAY_WANDER or NOT_LOOKED_AT."""
        if not self.looked_at:
            return NOT_LOOKED_AT
        known = self.depends_on and not self.likely
        if self.share < HARDLY and not (self.again or self.proven):  # of which no score tells
            return FEW if self.far else NOISE
        if known or (self.firm and not self.little):
            return FIRM
        if self.by_itself and not self.little:
            return MAY_WANDER if self.depends_on else WANDERS
        return FEW if self.far else NOISE

    @property
    def formula(self) -> str | None:
        """The best term as `signal += p0 * formula`; None if there is none."""
        return f"{self.term.adds_to} += p0 * {self.term.formula}" if self.term else None

    @property
    def equation(self) -> dict[str, str] | None:
        """Texts of an effect `equation` that adds the best formula to a model; None if none can."""
        if not self.term or not self.term.addable:
            return None
        return {"adds_to": self.term.adds_to, "formula": f"p0*{self.term.formula}"}


@dataclass(frozen=True)
class Formulas:
    """Formulas without physics names over logs, and how the rows of a fit change by each.

    Attributes:
        logs: place among the fit's data sets, and the log.
        terms: T formulas.
        changes: T of the rows of all logs by each.
        velocities: (N, 3) of the body in each, m/s and rad/s, at the points of its response.
        seen: the logs with all starts that the fit has.
        every: Nth of them that `logs` have: neighbours tell of hundreds of terms alike.
    """

    logs: list[tuple[int, Opened]]
    terms: list[Term]
    changes: Columns
    velocities: list[np.ndarray]
    seen: list[tuple[int, Opened]]
    every: int

    def proven(self, fit: ScoreFit, rival: Rival | None = None) -> Formula | None:
        """The formula for what a fit leaves; None if none is proven, or a rival does as well."""
        return formula_of(
            fit.thinned(self.every),
            logs=self.logs,
            velocities=self.velocities,
            terms=self.terms,
            changes=self.changes,
            rival=rival,
        )

    def changed(self, less: ScoreFit, more: ScoreFit) -> list[np.ndarray]:
        """(R,) by which the rows of each log differ from one fit to another."""
        before, after = (fit.thinned(self.every).state[0] for fit in (less, more))
        return [before[i] - after[i] for i, _ in self.logs]

    def products(self, fit: ScoreFit, beside: Sequence[np.ndarray] = ()) -> "Products":
        """Products with what a fit leaves, what is free in it projected out.

        Args:
            fit: of the same data sets.
            beside: (R,) other changes of each log's rows, one column more before those of formulas.
        """
        fit = fit.thinned(self.every)
        rows, _ = fit.state
        left, free, blocks = fit.whitened([i for i, _ in self.logs])
        weight = np.concatenate([np.sqrt(fit.weight(i, rows[i])) for i, _ in self.logs])
        other = [np.concatenate(beside)[:, None]] if beside else []
        columns = Columns([*other, *self.changes.pieces])
        return Products(columns, left, blocks, weight=weight, free=free)


@dataclass(frozen=True)
class Doubted:
    """Findings in the place of which a formula may be, and what is there without them.

    Attributes:
        names: of the findings.
        formulas: over the logs, as the model moves without them.
        fit: without them.
    """

    names: tuple[str, ...]
    formulas: Formulas
    fit: ScoreFit

    def formula(self, whole: ScoreFit) -> Formula | None:
        """The formula that does better than they do in the fit that has them, if one is proven."""
        changes = self.formulas.changed(self.fit, whole)
        rival = Rival(changes, max(len(whole.unknowns) - len(self.fit.unknowns), 0))
        found = self.formulas.proven(self.fit, rival)
        return replace(found, instead_of=self.names) if found else None


def formulas_of(
    opened: Sequence[Opened], fit: ScoreFit, *, forms_alone: bool = False
) -> Formulas | None:
    """Formulas over the logs of a fit; None if it has none whose floor told a smooth response.

    Args:
        opened: the fit's measurements, in its order.
        fit: of them.
        forms_alone: those alone of which one may be proven.
    """
    seen = [(i, o) for i, o in enumerate(opened) if o.floor and o.floor.response]
    if not seen:
        return None
    places, logs = zip(*seen, strict=True)
    every = thinning([o.data for o in logs], SETTINGS.few_starts, SETTINGS.starts_apart_s)
    logs = thinned(logs, every)
    found = library(logs, [fit.models[i] for i in places], forms_alone=forms_alone)
    return Formulas(list(zip(places, logs, strict=True)), *found, seen, every)


def rest_of(
    formulas: Formulas | None,
    fit: ScoreFit,
    first: ScoreFit,
    *,
    known: Mapping[str, float],
    whole: Sequence[Opened],
    random: bool,
    without: Doubted | None = None,
) -> Rest:
    """Tests whether the residuals of a fit are noise, and on what they depend.

    Args:
        formulas: over the fit's logs, as the final model moves.
        fit: of the final model.
        first: of the model as given.
        known: what the model left in other logs already, as `left_over`.
        whole: the data sets, with all starts of predictions.
        random: the floor itself is far above the model's noise.
        without: the findings that are in doubt, and the fit and formulas without them.
    """
    left = max(fit.held_square - 1, 0.0)
    share = left / max(first.held_square - 1, left, 1e-9)
    if formulas is None:
        return Rest(share, False, [])
    logs = formulas.logs
    firm = _firm(formulas.seen, fit, lambda floor: floor.across)
    there = random or (firm and fit.held_square > GOOD**2)
    found = _dependences(formulas, fit, known, there=there)
    if fit.held_square <= SETTINGS.level**2 and not random:
        found = replace(found, depends_on=[], likely=False)
    own_logs, models = [whole[i] for i, _ in logs], [fit.models[i] for i, _ in logs]
    events = events_of(own_logs, models)
    again = comes_again(own_logs, models)
    something = bool(found.depends_on or found.if_new or events.moments or events.later or again)
    proven = None
    if without:
        proven = without.formula(fit)
    if not proven and (something or firm or fit.held_square > GOOD**2):
        proven = formulas.proven(fit)
    if found.likely and (again or proven):  # which are surer
        found = replace(found, depends_on=[], likely=False)
    others = [
        *([TIME] if events.later else []),
        *([MOMENTS] if events.moments else []),
        *([PLACE] if again else []),
    ]
    likely = found.likely or bool(events.at_changes and not (found.depends_on or again or proven))
    depends_on = _in_order(proven, found, others)
    wander = wandering(
        [
            (own.data, np.where(own.data.keep[:, None, None], own.data.errors(model), np.nan))
            for own, model in zip(own_logs, models, strict=True)
        ]
    )
    follows = firm and _firm(formulas.seen, fit, lambda floor: floor.response.unboosted)
    sure = bool(events.moments or (depends_on and not likely))
    by_itself = None if sure or follows else wander
    return replace(
        found,
        share=share,
        firm=firm and not by_itself,
        far=fit.held_square > SETTINGS.no_noise**2,
        little=fit.held_square <= GOOD**2,
        likely=likely,
        wanders=random or bool(wander),
        by_itself=by_itself,
        depends_on=depends_on,
        events=events,
        again=again,
        proven=proven,
    )


def _firm(
    logs: list[tuple[int, Opened]], fit: ScoreFit, errors: Callable[[NoiseFloor], np.ndarray]
) -> bool:
    """True if the response, of which a floor tells errors, predicts left-out blocks better.

    By t of the relative fall over blocks; or, where only a few drives show what is missing, by
    blocks of a large fall, of which hardly any are as much worse.
    """
    falls = []
    for i, own in logs:
        model = fit.block_squares[i]
        rows = (np.nan_to_num(errors(own.floor)) * own.data.weight).reshape(-1)
        response = np.bincount(own.data.block, rows**2, len(model))
        falls += list((model - response) / np.maximum(model + response, 1e-300))
    falls = np.array(falls)
    if len(falls) < 3:
        return False
    better, worse = (np.sum(sign * falls > SETTINGS.firm_fall) for sign in (1, -1))
    if better >= SETTINGS.firm_blocks * max(worse, 1):
        return True
    return bool(falls.mean() > SETTINGS.firm_t * np.std(falls, ddof=1) / np.sqrt(len(falls)))


# -- what it depends on ----------------------------------------------------------------------------


def _in_order(proven: Formula | None, found: Rest, others: Sequence[str]) -> list[str]:
    """Dependences of the rest; a formula's own comes first if it takes no less than the groups."""
    own = proven.depends_on if proven else []
    first = own if not found.depends_on or (proven and proven.takes >= found.family_takes) else []
    return list(dict.fromkeys([*first, *found.depends_on, *others, *own]))


def _dependences(
    formulas: Formulas, fit: ScoreFit, known: Mapping[str, float], *, there: bool
) -> Rest:
    whole = formulas.products(fit)
    terms = [t for t, seen in zip(formulas.terms, whole.seen, strict=True) if seen]
    own, fresh = whole.only(whole.seen), _fresh_of(formulas.logs, whole)
    return _verdict(terms, own, whole.total, known, there=there, fresh=fresh)


def _verdict(
    terms: list[Term],
    products: "Products",
    total: float,
    known: Mapping[str, float],
    *,
    there: bool,
    fresh: Fresh,
) -> Rest:
    """The groups beyond chance; where something is there, else those that stand out."""
    every = _tested(terms, products, fresh)
    left_over = {d.group: d.gain / total for d in every if d.gain > 0}
    news = [d for d in every if d.gain / total > SETTINGS.again * known.get(d.group, 0.0)]
    sure = [d for d in news if d.sure]
    old = tuple(d.group for d in every if d.sure and d not in news)
    likely = _standing_out(news) if there and not sure and not old else []
    groups = likely or _without_redundant(sure, terms, products)
    if_new = any(d.if_new for d in news)
    if not groups:
        return Rest(0.0, False, [], left_over=left_over, old=old, if_new=if_new)
    best, coefficient = _best_term(terms, products, groups[0].group)
    own = np.array([t == best for t in terms])
    takes = float(products.held_out(own) / max(total, 1e-9))
    return Rest(
        0.0,
        False,
        [d.group for d in groups],
        best,
        coefficient,
        takes,
        left_over,
        old,
        family_takes=groups[0].gain / max(total, 1e-9),
        likely=bool(likely),
        if_new=if_new,
    )


def _standing_out(groups: Sequence[Dependence]) -> list[Dependence]:
    """Those that bring so much more than the others that the data prefer them; none if many do."""
    best = max((g.gain for g in groups), default=0.0)
    near = [g for g in groups if g.gain > max(best - SETTINGS.tie, 0.0)]
    return near if best > SETTINGS.likely and len(near) <= SETTINGS.likely_ones else []


def _tested(
    terms: list[Term], products: "Products", fresh: Fresh = lambda *_: 1.0
) -> list[Dependence]:
    """Gain of each group by a family or by one formula, with its test against chance.

    It is if it is more than the largest of all that is tested is under random signs of blocks, each
    over its own spread there, and if it is evidence enough for one of so many. What wanders by
    itself looks like whatever is slow, and goes on wandering beside it: evidence counts by as much
    as what is left is new from one prediction to the next.

    Args:
        terms: of the products.
        products: with what is left.
        fresh: share of the evidence that counts.
    """
    tested = list(_tests(terms))
    if not tested:
        return []
    alike = _of_one_width(products, tested)
    gains, nulls = _gains(products, alike, 0)
    sure = if_new = gains > _enough(tested)
    if sure.any():
        _, nulls = _gains(products, alike, FLIPS)
        spread = np.maximum(nulls.std(axis=-1), 1e-12)
        highest = (nulls / spread[..., None]).max(axis=(0, 1))
        if_new = sure & (gains / spread > np.quantile(highest, 1 - SETTINGS.dependence_chance))
        sure = _beyond_memory(np.where(if_new, gains, 0.0), tested, products, fresh)
    apparent = {tested[n].group for n in np.flatnonzero(if_new.any(axis=0))}
    best: dict[str, Dependence] = {}
    for of_ridge, beyond in zip(gains, sure, strict=True):
        for test, gain, is_sure in zip(tested, of_ridge, beyond, strict=True):
            group = test.group
            known = best.get(group)
            if known is None or (is_sure, gain) > (known.sure, known.gain):
                own = np.zeros(len(terms), bool)
                own[test.places] = True
                best[group] = Dependence(group, float(gain), bool(is_sure), own, group in apparent)
    return sorted(best.values(), key=lambda d: -d.gain)


def _beyond_memory(
    gains: np.ndarray, tested: Sequence[Tested], products: "Products", fresh: Fresh
) -> np.ndarray:
    """(K, N) bool: of each group the strongest whose new evidence is enough.

    Args:
        gains: (K, N) of N tests at K ridges; 0 where they may be chance.
        tested: N tests.
        products: with what is left.
        fresh: share of the evidence that counts.
    """
    enough = _enough(tested)
    found, done = np.zeros_like(gains, bool), set()
    for k, n in sorted(np.argwhere(gains > enough).tolist(), key=lambda at: -gains[tuple(at)]):
        if tested[n].group in done:
            continue
        after = products.left_by(tested[n], RIDGES[k])
        if gains[k, n] * fresh(tested[n], after, products.left - after) > enough:
            found[k, n] = True
            done.add(tested[n].group)
    return found


def _enough(tested: Sequence[Tested]) -> float:
    """Evidence for one of so many."""
    return float(2 * np.log(len(tested) / SETTINGS.dependence_chance))


def _fresh_of(logs: Sequence[tuple[int, Opened]], products: "Products") -> Fresh:
    """For errors of the rows of some logs.

    Many numbers over the time of one log follow any wander, and tell nothing. No wander follows
    what changes within seconds.
    """

    def fresh(test: Tested, left: np.ndarray, made: np.ndarray) -> float:
        if test.group not in SLOW:
            return 1.0
        if test.group != PLACE and len(logs) == 1 and len(test.places) > FOLLOWS:
            return 0.0
        fell, share = [], []
        errors = (_errors_of(logs, products, v) for v in (left, made))
        for (data, own), (_, gone) in zip(*errors, strict=True):
            new, alone = fresh_shares(own[:, LONGEST], gone[:, LONGEST], data.start_s)
            fell.append(max(np.nansum(gone * (gone + 2 * own)), 0.0))
            share.append(new * alone)
        return float(np.dot(fell, share) / max(sum(fell), 1e-12))

    return fresh


def _errors_of(
    logs: Sequence[tuple[int, Opened]], products: "Products", rows: np.ndarray
) -> Iterator[tuple[Trajectory, np.ndarray]]:
    """Each log, and its (W, H, 3) errors; NaN where not judged.

    Args:
        logs: one after the other in the rows.
        products: over these rows.
        rows: (R,) errors as weighted there.
    """
    first = 0
    for _, own in logs:
        place = slice(first, first + own.data.weight.size)
        judged = own.data.weight > 0
        yield own.data, np.where(judged, rows[place].reshape(judged.shape), np.nan)
        first = place.stop


def _tests(terms: Sequence[Term]) -> Iterator[Tested]:
    """Each family, and each formula that it has: the same of another group is something else."""
    families: dict[tuple[str, str], list[int]] = {}
    alike: dict[tuple[str, str], list[int]] = {}
    for k, term in enumerate(terms):
        families.setdefault((term.group, term.family), []).append(k)
        alike.setdefault((term.group, term.formula), []).append(k)
    for (group, _), together in families.items():
        yield Tested(group, np.array(together))
        for formula in dict.fromkeys(terms[k].formula for k in together):
            yield Tested(group, np.array(alike[group, formula]))


@dataclass(frozen=True)
class _Alike:
    """Those of N tests that have k columns each: (n,) numbers, (n, k) columns, their products."""

    numbers: list[int]
    places: np.ndarray
    grams: "Grams"


def _of_one_width(products: "Products", tested: Sequence[Tested]) -> list[_Alike]:
    by_width: dict[int, list[int]] = {}
    for n, test in enumerate(tested):
        by_width.setdefault(len(test.places), []).append(n)
    each = ((own, np.array([tested[n].places for n in own])) for own in by_width.values())
    return [_Alike(own, places, products.grams(places)) for own, places in each]


def _gains(
    products: "Products", alike: Sequence[_Alike], flips: int
) -> tuple[np.ndarray, np.ndarray]:
    """(K, N) of N tests at K ridges, and (K, N, F) what chance brings."""
    found = np.zeros((len(RIDGES), sum(len(a.numbers) for a in alike), 1 + flips))
    for own in alike:
        for k, ridge in enumerate(RIDGES):
            gains = products.together_held_out(own.places, own.grams, flips, ridge)
            found[k, own.numbers] = gains
    return found[..., 0], found[..., 1:]


def _without_redundant(
    groups: list[Dependence], terms: list[Term], products: "Products"
) -> list[Dependence]:
    """Those groups that bring something beside the better ones, or as much as the best.

    As much brings what the best is a part of, too, as places do all of which push alike: that is
    left out.
    """
    kept: list[Dependence] = []
    gain = 0.0
    for group in groups:
        if kept and group.gain > SETTINGS.as_much * kept[0].gain:
            kept += [] if products.holds(group.own, kept[0].own) else [group]
            continue
        names = {d.group for d in [*kept, group]}
        together = products.held_out(np.array([t.group in names for t in terms]))
        if not kept or together > (1 + SETTINGS.beside) * gain:
            kept, gain = [*kept, group], together
    return kept


def _best_term(terms: list[Term], products: "Products", group: str) -> tuple[Term, float]:
    """The single term of a group that explains most, and its coefficient in its own unit."""
    own = [i for i, t in enumerate(terms) if t.group == group]
    moment = products.moments.sum(0)[own]
    energy = products.energy.sum(0)[own] + 1.0
    best = int(np.argmax(moment**2 / energy))
    term = terms[own[best]]
    return term, float(moment[best] / energy[best] * term.strength)


@dataclass(frozen=True)
class Grams:
    """Products of N sets of k columns: (N, B, k, k) by block, (N, FOLDS, k, k) by fold."""

    blocks: np.ndarray
    folds: np.ndarray

    @classmethod
    def by_fold(cls, blocks: np.ndarray) -> "Grams":
        """Grams by fold from those by block: every so-many-th block is of one fold."""
        return cls(blocks, np.stack([blocks[:, k::FOLDS].sum(1) for k in range(FOLDS)], axis=1))


class Products:
    """Products of columns with each other and with the errors, block by block.

    Columns are weighted as the errors are, and what is free is projected out of them. Sums over
    their rows as they are tell of what is left.

    Args:
        columns: T.
        left: (R,) errors.
        blocks: (R,) of errors that belong together; they ascend.
        weight: (R,) of the columns' rows.
        free: (R, P) what is free, weighted.

    Attributes:
        left: (R,) the errors.
        seen: (T,) columns of which enough is left beside what is free; the others count as 0.
        total: squared errors of all.
    """

    def __init__(
        self,
        columns: Columns,
        left: np.ndarray,
        blocks: np.ndarray,
        *,
        weight: np.ndarray,
        free: np.ndarray,
    ) -> None:
        count = blocks.max() + 1
        if count > MOST_BLOCKS:  # each has a sign: of many, neighbours are one
            blocks = blocks * MOST_BLOCKS // count
        self.edges = np.searchsorted(blocks, np.arange(blocks.max() + 2))
        self.parts = [slice(a, b) for a, b in pairwise(self.edges)]
        self.columns, self.own = columns, np.arange(len(columns))
        self.weight, self.total = weight[:, None], float(left @ left)
        basis = np.linalg.qr(free)[0]
        self.left, self.basis = left, np.ascontiguousarray(basis.T)
        known = self.weight * np.column_stack([left, basis])
        each = (native.products_beside(c, known, weight, self.edges) for c in columns.pieces)
        across, square = np.split(np.concatenate([*each], axis=-1), [-1], axis=1)
        self.moments, self.along = across[:, 0], across[:, 1:].sum(0)
        self.moments -= np.array([left[p] @ basis[p] for p in self.parts]) @ self.along
        more = squares(basis, self.parts) @ self.along - 2 * across[:, 1:]
        self.energy = square[:, 0] + np.einsum("bpt,pt->bt", more, self.along)
        before, after = square.sum((0, 1)), self.energy.sum(0)
        self.seen = (after > LEFT_OVER**2 * np.maximum(before, 1e-24)) & (before > 1e-18)
        self.moments[:, ~self.seen] = self.energy[:, ~self.seen] = 0.0

    def grams(self, places: np.ndarray) -> Grams:
        """Products of sets of columns, (N, k) by their numbers, with each other."""
        if places.shape[1] == 1:
            return Grams.by_fold(np.ascontiguousarray(self.energy.T[places[:, 0]])[..., None, None])
        pieces, own, seen = self.columns.pieces, self.own[places], self.seen[places]
        weight = self.weight[:, 0]
        blocks = native.products_left(pieces, own, weight, self.basis, self.along, self.edges)
        blocks *= (seen[:, :, None] & seen[:, None])[:, None]
        return Grams.by_fold(blocks)

    def left_by(self, test: Tested, ridge: float) -> np.ndarray:
        """(R,) what some columns leave of the errors, fitted to other blocks."""
        rows, moments = self._rows(test.places), self.moments[:, test.places]
        folds = self.grams(test.places[None]).folds[0]
        left = self.left.copy()
        for k, own in enumerate(folds):
            others = folds.sum(0) - own + ridge * np.eye(len(own))
            numbers = np.linalg.solve(others, moments.sum(0) - moments[k::FOLDS].sum(0))
            for part in self.parts[k::FOLDS]:
                left[part] -= rows[part] @ numbers
        return left

    def _rows(self, own: np.ndarray) -> np.ndarray:
        """(R, k) of some columns, what is free projected out."""
        some = self.own[own]
        rows = self.weight * self.columns.some(some)
        rows -= self.basis.T @ self.along[:, some]
        rows[:, ~self.seen[own]] = 0.0
        return rows

    def _folds(self, own: np.ndarray) -> np.ndarray:
        """(FOLDS, k, k) of the same, without blocks: of many columns those fill the memory."""
        rows = self._rows(own)
        found = np.zeros((FOLDS, rows.shape[1], rows.shape[1]))
        for b, p in enumerate(self.parts):
            found[b % FOLDS] += rows[p].T @ rows[p]
        return found

    def only(self, own: np.ndarray) -> "Products":
        """Products of some (T,) columns alone."""
        less = copy(self)
        less.own, less.seen = self.own[own], self.seen[own]
        less.moments, less.energy = self.moments[:, own], self.energy[:, own]
        return less

    @property
    def taken(self) -> np.ndarray:
        """(T,) fall of the cost by each column, fitted to all blocks."""
        return self.moments.sum(0) ** 2 / (self.energy.sum(0) + 1.0)

    def holds(self, many: np.ndarray, few: np.ndarray) -> bool:
        """True if many columns make up a few of them (nearly) whole."""
        either = many | few
        gram, many, few = self._folds(either).sum(0), many[either], few[either]
        inside = gram[np.ix_(many, many)] + 1e-9 * self.energy.sum() * np.eye(many.sum())
        across = gram[np.ix_(many, few)]
        made = np.sum(across * np.linalg.solve(inside, across))
        return bool(many.sum() > few.sum() and made > HOLDS * np.trace(gram[np.ix_(few, few)]))

    @property
    def each_held_out(self) -> np.ndarray:
        """(T,) fall of the cost by each column alone on blocks not fitted to."""
        places = np.arange(len(self.seen))[:, None]
        return self.together_held_out(places, self.grams(places), 0, 1.0)[:, 0]

    def held_out(self, own: np.ndarray) -> float:
        """Fall of the cost by these columns on blocks not fitted to."""
        places = np.flatnonzero(own)[None]
        grams = Grams(np.zeros((1, 0, own.sum(), own.sum())), self._folds(own)[None])
        return float(self.together_held_out(places, grams, 0, 1.0)[0, 0])

    def together_held_out(
        self, places: np.ndarray, grams: Grams, flips: int, ridge: float
    ) -> np.ndarray:
        """(N, 1 + F) fall by each of N sets of columns, (N, k) `places`, and what chance brings.

        Chance: random signs of what each block scatters about a fit of the columns to all others.
        About a fit that has the block itself it scatters too little, where columns are many and
        blocks few (Cameron and Miller 2015, section VI.B).

        Args:
            places: of the columns.
            grams: of the N sets.
            flips: F.
            ridge: of the fits; columns are in typical strengths.
        """
        signs = _signs(flips, len(self.parts))
        moments = np.ascontiguousarray(self.moments)
        return native.held_out(moments, places, grams.blocks, grams.folds, signs, ridge)


@cache
def _signs(flips: int, blocks: int) -> np.ndarray:
    """(F, B) random signs, the same for all that is tested."""
    return np.random.default_rng(1).choice([-1.0, 1.0], (flips, blocks))
