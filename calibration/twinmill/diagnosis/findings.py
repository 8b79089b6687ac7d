# SPDX-License-Identifier: Apache-2.0
"""Findings of a diagnosis: what each effect takes away, how sure it is, and its rivals."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.constancy import Change, changes_of
from twinmill.diagnosis.library import CHANGE, TIME
from twinmill.diagnosis.rest import LEAST, Rest
from twinmill.diagnosis.search import (
    PAUSE_S,
    REFIT,
    Round,
    Search,
    State,
    Trial,
    against,
    comes_again,
    fitted,
    grown,
    in_common,
    of_levels,
)
from twinmill.fitting.compare import GOOD
from twinmill.model.parameters import (
    LAG,
    LAG_EFFECT,
    WHERE_OR_WHEN,
    ParameterEstimate,
    catalogue,
    catalogue_of,
    effect_names,
    late_part,
    newest_instance,
    with_role,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
MISSES = 1.5  # score of a final model whose errors are not noise
WITHIN = 2.0  # standard deviations: a lag that differs by less is the model's own error
BEYOND = 3.0  # usual sizes, or standard deviations from it at a bound: doubtful beyond ...
NEAR = 0.5  # ... if another leaves less than this more of the squared score, or a rest is left
AWAY_S = 2.0  # between two visits of a place
WEIGHTY = 0.1  # share of what the visit brings that speaks loudest for a place
# Groups of a rest, and what the cards of effects that act by them need or are shown by.
BY = {
    "place": {"places", "place"},
    "heading": {"headings", "heading"},
    TIME: {"history", "battery"},
    CHANGE: {"changes"},
}
SLIGHT = 0.3  # of the squared score that is left: what a second finding must at least take
LAG_LEAVES = 0.25  # at most, of what was to be explained, where nothing else is late
SAME, SAME_FALL = 0.8, 0.85  # cosine of what two take of the errors, and share that one takes
NOTHING = 0.01  # chance of sizes like these if there were no effect, beyond which it is doubtful


@dataclass(frozen=True)
class Finding:
    """One effect that is missing, or `refit`: the base's numbers were stale.

    Attributes:
        group: names that the data cannot tell apart, its own first; None if it is alone.
        parameters: of the final model.
        share: of the squared held-out error at 0.5 s above the floor that it takes away.
        certainty: sure, group or doubtful.
        why: of a doubt; empty otherwise.
        again: the model given has the effect already, with other numbers.
        wrong_form: something of another form stands behind it.
        depends_on: what that depends on, where the doubt tells it; else empty.
    """

    effect: str
    group: tuple[str, ...] | None
    parameters: list[ParameterEstimate]
    share: float
    certainty: str
    why: str = ""
    again: bool = False
    wrong_form: bool = False
    depends_on: str = ""

    @property
    def takes(self) -> str:
        """The share in words."""
        return "< 1 %" if self.share < 0.005 else f"{100 * self.share:.0f} %"

    def to_json(self) -> dict:
        """Fields of the interface."""
        parameters = [e.to_json() for e in self.parameters]
        group = list(self.group) if self.group else None
        return {**vars(self), "parameters": parameters, "group": group}


@dataclass(frozen=True)
class Ranked:
    """One effect of the ranking.

    Attributes:
        score_heldout: of the model with it, on parts it was not fitted to.
        share_explained: of the squared score above 1 that the model as given had.
        p_value: chance of such evidence if nothing were missing, for all effects together.
        evidence: half the fall of the held-out cost.
        group: number shared by effects that the data cannot tell apart; None if they can.
    """

    effect: str
    score_heldout: float
    share_explained: float
    p_value: float
    evidence: float
    parameters: list[ParameterEstimate]
    group: int | None

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {**vars(self), "parameters": [e.to_json() for e in self.parameters]}


@dataclass(frozen=True)
class Late:
    """How late the motion follows its commands.

    Attributes:
        sum_s, sum_std_s: lag and delay together; with the clocks' offset where that is not known.
        delay_s, lag_s, clock_s: its parts; None where the data cannot part them.
        parted: whether they can.
    """

    sum_s: float
    sum_std_s: float | None
    delay_s: float | None
    lag_s: float | None
    clock_s: float | None
    parted: bool

    def to_json(self) -> dict:
        """Fields of the interface."""
        return vars(self)


def findings_of(
    done: Search, first: State, less: Mapping[str, Trial | None]
) -> tuple[list[Finding], list[tuple[str, float]]]:
    """Findings in the order of worth, and the held-out score after each of them.

    Worth is what the final model loses without the effect. Shares are those of a chain that adds
    the effects in this order. Effects that stand in for each other lose little alone, and what each
    takes depends on what was taken before: the first is the one that takes most on the average over
    one order of adding and its reverse.

    Args:
        done: the search.
        first: where it started.
        less: the final state refitted without each effect.
    """
    names = list(dict.fromkeys(done.found))
    given = _as_given(done.last, first) if REFIT in names else None
    loss = {n: _loss(done.last, given if n == REFIT else less[n]) for n in names}
    names.sort(key=lambda n: -loss[n])
    chain = _chain(names, first, done.last)
    if len(names) > 1:
        there, back = (
            _takes(names, chain),
            _takes(names[::-1], _chain(names[::-1], first, done.last)),
        )
        top = max(names, key=lambda n: there[n] + back[n])
        if top != names[0]:
            names = [top, *(n for n in names if n != top)]
            chain = _chain(names, first, done.last)
    shares = _takes(names, chain)
    changes = changes_of(done.last)
    found = []
    for k, name in enumerate(names):
        finding = _finding(done, name, less.get(name), shares[name], changes)
        if again := comes_again(done, name):
            why = f"it comes more than once: from {again[0]:.0f} to {again[1]:.0f} s, too"
            finding = _doubted(finding, why, wrong_form=True, depends_on=TIME)
        if other := _stand_in(done, name):
            why = f"{other} alone takes the same errors: both may be one other effect"
            finding = _doubted(finding, why, wrong_form=True)
        larger = next((n for n in names[:k] if n != REFIT), None)
        found.append(_beside_larger(finding, larger, *chain[k : k + 2]))
    return found, [(n, t.held_score) for n, t in zip(names, chain[1:], strict=True)]


def _takes(names: Sequence[str], chain: Sequence[Trial]) -> dict[str, float]:
    """Share of the squared error at 0.5 s above the floor that each takes in a chain."""
    errors = [_squared(t) for t in chain]
    # Where the floor itself holds a part of what was found, the final error stands for it.
    excess = max(errors[0] - min(errors[-1], 1.0), 1e-9)
    falls = [a - b for a, b in pairwise(errors)]
    return {n: float(np.clip(f / excess, 0.0, 1.0)) for n, f in zip(names, falls, strict=True)}


def _same(done: Search, name: str) -> list[str]:
    """Effects that alone took the same errors as this one, when it was accepted."""
    this = _round_of(done, name)
    if name == REFIT or this.accepted.names != (name,):
        return []
    taken = this.before.held_score**2 - this.accepted.held_score**2
    return [
        t.names[0]
        for t in this.trials
        if len(t.names) == 1
        and t.names[0] not in (name, REFIT)
        and this.before.held_score**2 - t.held_score**2 > SAME_FALL * taken
        and in_common(this.before, this.accepted, t) > SAME
    ]


def _stand_in(done: Search, name: str) -> str | None:
    """Another effect that was found and alone does what this one does; None if there is none.

    Two of one family may both be there, and of two that act by the same thing the better one is
    right and the other its rest; see KINDS.
    """
    for other in _same(done, name):
        family = catalogue()[name]["family"] == catalogue()[other]["family"]
        if (
            other in done.found
            and not family
            and not any(of(name) and of(other) for of, *_ in KINDS)
        ):
            return other
    return None


def _beside_larger(finding: Finding, larger: str | None, before: Trial, after: Trial) -> Finding:
    """The finding, doubtful where it takes little of what a larger one leaves."""
    left = after.held_score**2
    if larger is None or finding.effect == REFIT or before.held_score**2 - left >= SLIGHT * left:
        return finding
    return _doubted(
        finding, f"it takes little of what {larger} leaves, which may have another form"
    )


def of_another_form(found: Sequence[Finding], rest: Rest) -> list[Finding]:
    """Findings, doubtful where their form is wrong.

    So it is where what is left still depends on what they act by; where one makes the robot later
    and another sooner: a lag below its own and a delay imitate a body that swings; and where a
    second one of KINDS does what a better one does already; and where losses come at several times,
    or as large ones at a place and at a moment.

    Args:
        found: in the order of worth.
        rest: what is left.
    """
    depends_on = rest.depends_on if rest.share > LEAST else ()
    late_s = [_lateness_s(f) for f in found]
    swings = min(late_s, default=0.0) < 0 < max(late_s, default=0.0)
    losses = _alike_losses(found)

    def judged(finding: Finding) -> Finding:
        if swings and _lateness_s(finding):
            why = "sooner by one lag and later by another is what a body does that swings"
            return _doubted(finding, why, wrong_form=True, depends_on=CHANGE)
        if finding in losses and len(losses) > 1:
            why = "losses at several times may be one that comes and goes"
            return _doubted(finding, why, wrong_form=True, depends_on=TIME)
        on = next(
            (group for group in depends_on if BY.get(group, set()) & _acts_by(finding.effect)), None
        )
        if on is not None:
            why = f"what is left still depends on {on}, so that it may have another form"
            return _doubted(finding, why, wrong_form=True)
        for of_kind, _, does, what in KINDS:
            first, *others = [f for f in found if of_kind(f.effect)] or [None]
            if finding in others:
                return _doubted(
                    finding, f"{first.effect} {does}, too: both may be one other {what}"
                )
        return finding

    return [judged(f) for f in found]


def _alike_losses(found: Sequence[Finding]) -> list[Finding]:
    """Findings of a moment, and those of a place that are as large as one of a moment.

    None of a moment that ends where another begins: together they are one of another form.
    """
    events = [f for f in found if with_role(f.effect, "moment")]
    events = [f for f in events if not any(_adjoin(f, other) for other in events)]

    def as_large(finding: Finding) -> bool:
        own, *_ = finding.parameters
        losses = [f.parameters[0] for f in events]
        known = own.value > WITHIN * own.std
        return known and any(
            abs(own.value - e.value) < WITHIN * np.hypot(own.std, e.std) for e in losses
        )

    places = [f for f in found if with_role(f.effect, "place") and as_large(f)]
    return [*events, *places]


def _adjoin(one: Finding, other: Finding) -> bool:
    """Whether one of two findings of a moment ends where the other begins."""
    (begin_s, *end_s), (again_s, *over_s) = map(_when_s, (one, other))
    pairs = [*((e, again_s) for e in end_s), *((o, begin_s) for o in over_s)]
    return one is not other and any(abs(a - b) < PAUSE_S for a, b in pairs)


def _when_s(finding: Finding) -> list[float]:
    """When it begins and, if it does, ends, s since the first command."""
    keys = with_role(finding.effect, "moment")
    return [e.value for e in finding.parameters if e.name.split(".", 1)[1] in keys]


def beside_more(found: Sequence[Finding], rest: Rest) -> list[Finding]:
    """Findings, doubtful where more is left than all of them take, and it is no noise.

    A lag is doubtful where much is left at all: something else at changes of the command is late,
    too.
    """
    taken = sum(f.share for f in found if f.effect != REFIT)

    def judged(finding: Finding) -> Finding:
        if finding.effect == REFIT or not (rest.firm or rest.depends_on):
            return finding
        if rest.share > taken:
            why = "more is left than it takes, so that it may be a part of something else"
            on = next((on for of_kind, on, *_ in KINDS if of_kind(finding.effect)), "")
            return _doubted(finding, why, depends_on=on)
        if rest.firm and rest.share > LAG_LEAVES and _is_late(finding.effect):
            why = "much is left: something else at changes of the command may be late"
            return _doubted(finding, why, wrong_form=True)
        return finding

    return [judged(f) for f in found]


def _doubted(finding: Finding, why: str, wrong_form: bool = False, depends_on: str = "") -> Finding:
    """The finding with one more reason to doubt it; the first is told."""
    return replace(
        finding,
        certainty="doubtful",
        why=finding.why or why,
        wrong_form=finding.wrong_form or wrong_form,
        depends_on=finding.depends_on or depends_on,
    )


def _acts_by(effect: str) -> set[str]:
    """What the effect's card says of it in this respect; nothing for a refit, which has none."""
    card = catalogue().get(effect, {"identify": (), "needs": "", "family": ""})
    return {*card["identify"], card["needs"], card["family"]}


def _is_late(effect: str) -> bool:
    """Whether all of the motion comes late, at every change of the command."""
    always = {"changes", "steps"} <= _acts_by(effect) and "spin" not in _acts_by(effect)
    return bool(late_part(effect)) or always


def _bends(effect: str) -> bool:
    """Whether it bends the steady speed over the command."""
    return effect in of_levels() and "steady_speed" in _acts_by(effect)


def _is_placed(effect: str) -> bool:
    """Whether it changes with the place in the room."""
    return "places" in _acts_by(effect)


def _is_timed(effect: str) -> bool:
    """Whether it changes with the time that the robot has been driving."""
    return bool(BY[TIME] & _acts_by(effect))


# Effects of which a second one may be the rest of the first in another form: what they act by.
KINDS = (
    (_bends, "speed", "bends the speed over the command", "curve"),
    (_is_late, CHANGE, "is late at changes of the command", "lag"),
    (_is_placed, "place", "changes with the place", "floor"),
    (_is_timed, TIME, "changes with time", "loss"),
)


def _lateness_s(finding: Finding) -> float:
    """By how much a finding makes the motion later; 0 where it makes nothing late."""
    part = late_part(finding.effect)
    return next(
        (e.value for e in finding.parameters if part and e.name.split(".", 1)[1] == part[1]), 0.0
    )


def with_stale_numbers(
    found: Sequence[Finding], model: native.Model, lag_std_s: float, stds: Mapping[str, float]
) -> list[Finding]:
    """Findings in which what the model may well have by its own error is a stale number.

    Args:
        found: in the order of worth.
        model: the final one.
        lag_std_s: how well the model's lag was known.
        stds: how well other logs told the numbers of the model's effects, by name.
    """
    gone: list[Finding] = []
    own: list[ParameterEstimate] = []
    for finding in found:
        numbers = _stale_numbers(finding, model, lag_std_s, stds)
        if numbers:
            gone.append(finding)
            own += numbers
    if not gone:
        return list(found)
    share = sum(f.share for f in gone)
    stale = next((f for f in found if f.effect == REFIT), None)
    if stale is None:
        whole, place = Finding(REFIT, None, own, share, "sure"), gone[0]
    else:
        whole = replace(stale, parameters=[*stale.parameters, *own], share=stale.share + share)
        place = stale
    return [whole if f is place else f for f in found if f is place or f not in gone]


def _stale_numbers(
    finding: Finding, model: native.Model, lag_std_s: float, stds: Mapping[str, float]
) -> list[ParameterEstimate]:
    """What a finding changes, if the model may well have all of it by its own error; else none."""
    if finding.effect == LAG_EFFECT and not finding.group and lag_std_s > 0:
        extra = finding.parameters[0]
        if abs(extra.value) <= WITHIN * np.hypot(extra.std, lag_std_s):
            return [replace(extra, name=LAG, value=model.get(LAG) + extra.value)]
    known = finding.again and all(_is_error(e, model, stds) for e in finding.parameters)
    return finding.parameters if known else []


def _is_error(own: ParameterEstimate, model: native.Model, stds: Mapping[str, float]) -> bool:
    """Whether a number that changed did so within the error of the one that the model had."""
    instance, key = own.name.split(".", 1)
    name = instance.split("#")[0]
    card = next(p for p in catalogue_of(model)[name]["parameters"] if p["name"] == key)
    known = stds.get(f"{name}.{key}", 0.0)
    return abs(own.value - card["neutral"]) <= WITHIN * np.hypot(own.std, known)


def _chain(names: Sequence[str], first: State, last: Trial) -> list[Trial]:
    """Fits of the first state, and of it with one effect more each time."""
    state, chain = first, [fitted(first)]
    for name in names:
        state = grown(state, [name])
        chain.append(_from_final(state, last))
    return chain


def _from_final(state: State, last: Trial) -> Trial:
    """A fit of the state that begins at the final model's values."""
    values = {p.name: last.state.model.get(p.name) for p in last.state.free}
    models = []
    for model in state.models:
        model = model.copy()
        for p in state.free:
            model.set(p.name, values.get(p.name, p.value))
        models.append(model)
    return fitted(replace(state, models=models))


def _loss(last: Trial, less: Trial | None) -> float:
    """Rise of the squared held-out score without one effect, or with the base as it was given."""
    return 0.0 if less is None else less.held_score**2 - last.held_score**2


def _as_given(last: Trial, first: State) -> Trial:
    """The trial's effects refitted on the base of the model as given."""
    models = []
    for model, given in zip(last.state.models, first.models, strict=True):
        model = model.copy()
        for name in last.state.base:
            model.set(name, given.get(name))
        models.append(model)
    free = tuple(p for p in last.state.begun() if p.name not in last.state.base)
    return fitted(replace(last.state, models=models, free=free))


def _squared(trial: Trial) -> float:
    """Squared held-out error at 0.5 s over the floor: the mean over independent errors."""
    parts = []
    for data, rows in zip(trial.fit.datasets, trial.fit.held_out, strict=True):
        if isinstance(data, Trajectory):
            over = data.as_errors(rows)[:, HORIZON] / data.floor[HORIZON]
            parts.append(float(np.nanmean(over**2)))
        else:
            parts.append(float(rows @ rows))
    return float(np.average(parts, weights=trial.fit.sizes))


def _round_of(done: Search, name: str) -> Round:
    return next(r for r in reversed(done.rounds) if r.accepted and name in r.accepted.names)


def _rivals(done: Search, name: str) -> list[Trial]:
    """Trials that the data could not tell from this effect's, unless they were found besides.

    Where even the final model misses by far, its errors are no noise, and a few percent between two
    effects decide nothing.
    """
    this = _round_of(done, name)
    rivals = list(this.tied)
    if done.last.held_score > MISSES and len(this.accepted.names) == 1 and name != REFIT:
        fall = this.before.held_score**2 - this.accepted.held_score**2
        rivals += [
            t
            for t in this.trials
            if not any(t is r for r in (*this.tied, this.accepted))
            and len(t.names) == 1
            and t.names != (REFIT,)
            and this.before.held_score**2 - t.held_score**2 > done.settings.imitates * fall
        ]
    return [t for t in rivals if not set(t.names) & set(done.found)][: done.settings.group - 1]


def _finding(
    done: Search,
    name: str,
    less: Trial | None,
    share: float,
    changes: Mapping[str, Change],
) -> Finding:
    estimates = done.last.fit.shared_estimates()
    if name == REFIT:
        own = [e for e in estimates if e.name in done.last.state.base]
        alike = tuple(n for t in _rivals(done, REFIT) for n in t.names)
        group = (REFIT, *alike) if alike else None
        return Finding(REFIT, group, own, share, "group" if alike else "sure")
    instance = newest_instance(done.last.state.model, name)
    own = [e for e in estimates if e.name.startswith(f"{instance}.")]
    tied = [n for t in _rivals(done, name) for n in t.names]
    once = less is not None and _visits(done.last, less, instance) == 1
    instead = [n for n in _same(done, name) if with_role(n, "moment")] if once else []
    tied = list(dict.fromkeys([*tied, *instead]))[: done.settings.group - 1]
    group = (name, *tied) if tied else None
    card = catalogue_of(done.last.state.model)[name]
    doubt = _at_bound(card, own) or ("" if _stands_alone(done, name) else _unusual(card, own))
    doubt = doubt or _faster(name, own)
    if not doubt and once and not instead:
        doubt = f"one visit of its place speaks for {name}: it may be that time and not the place"
    if not doubt and instance in changes:
        doubt = changes[instance].why
    if not doubt and done.last.fit.chance_of_none(instance) > NOTHING:
        doubt = f"parts of these logs do not agree that {name} is there: its size may be nothing"
    certainty = "doubtful" if doubt else "group" if group else "sure"
    return Finding(name, group, own, share, certainty, doubt, "#" in instance)


def _sizes(
    card: dict, own: Sequence[ParameterEstimate]
) -> Iterator[tuple[ParameterEstimate, dict, float]]:
    """Each estimate with its entry of the card and its distance from neutral."""
    entry = {p["name"]: p for p in card["parameters"]}
    for e in own:
        p = entry[e.name.split(".", 1)[1]]
        yield e, p, abs(e.value - p["neutral"])


def _at_bound(card: dict, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where an estimate ended at its bound, and a usual one is excluded; else empty."""
    for e, p, away in _sizes(card, own):
        excluded = e.std is None or abs(e.value - p["default"]) > BEYOND * e.std
        if e.at_bound and away > 1e-3 and excluded:
            return f"{e.name} is at its bound ({e.value:.3g}): another effect may be behind it"
    return ""


def _unusual(card: dict, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where an estimate is far larger than is usual; else empty."""
    for e, p, away in _sizes(card, own):
        if p["role"] == "size" and away > BEYOND * p["usual_size"]:
            return (
                f"{e.name} = {e.value:.3g} is far beyond what is usual: another effect may be "
                "behind it"
            )
    return ""


def _faster(name: str, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where a loss at a place or a moment makes the robot faster; else empty."""
    loss, *_ = own
    placed = any(with_role(name, role) for role in WHERE_OR_WHEN)
    if placed and loss.value < -WITHIN * loss.std:
        return (
            f"{loss.name} = {loss.value:.3g} makes the robot faster, which few floors or faults do"
        )
    return ""


def _visits(last: Trial, less: Trial, instance: str) -> int | None:
    """How many visits of an effect's place speak for it, in all logs; None for one without a place.

    By the fall of the squared errors in windows that begin there: at least WEIGHTY of the largest.
    """
    fit = last.fit
    if f"{instance}.radius_m" not in {v["name"] for v in last.state.model.values()}:
        return None
    falls: list[float] = []
    parts = zip(fit.datasets, fit.models, less.fit.state[0], fit.state[0], strict=True)
    for data, model, before, after in parts:
        if isinstance(data, Trajectory):
            x_m, y_m, radius_m = (model.get(f"{instance}.{k}") for k in ("x_m", "y_m", "radius_m"))
            pose = data.measurement.track.pose[data.windows.starts]
            there = np.hypot(pose[:, 0] - x_m, pose[:, 1] - y_m) < radius_m
            visit = np.cumsum(np.diff(data.start_s[there], prepend=-np.inf) > AWAY_S) - 1
            fall = (before**2 - after**2).reshape(len(there), -1).sum(axis=1)[there]
            falls += list(np.bincount(visit, fall))
    return int(np.sum(np.array(falls) > WEIGHTY * max(falls, default=0.0)))


def _stands_alone(done: Search, name: str) -> bool:
    """Whether nothing is left beside an effect, and no other comes near to what it takes.

    Then it is right though its size is none that is usual.
    """
    this = _round_of(done, name)
    most = this.accepted.held_score**2 + NEAR
    near = [t for t in this.trials if t is not this.accepted and t.held_score**2 < most]
    return done.last.held_score < GOOD and all(_beats(done, this.accepted, t) for t in near)


def _beats(done: Search, one: Trial, other: Trial) -> bool:
    """Whether one is better by what an addition must bring, also without its best block."""
    evidence, without_best, _ = against(other.fit, one.fit)
    least = done.settings
    return evidence > least.evidence and without_best > least.without_best


def ranking_of(done: Search, found: Sequence[Finding]) -> list[Ranked]:
    """Found effects in the order of worth with their rivals, then the rest of the first round."""
    first = done.rounds[0].before.held_score ** 2
    ranking: list[Ranked] = []
    number = 0
    for finding in found:
        if finding.effect == REFIT:
            continue
        this, rivals = _round_of(done, finding.effect), _rivals(done, finding.effect)
        group = None
        if finding.group:
            number += 1
            group = number
        for trial in [this.accepted, *rivals]:
            entries = [_ranked(trial, n, this, first, group) for n in trial.names if n != REFIT]
            ranking += [
                e for e in entries if e.effect == finding.effect or trial is not this.accepted
            ]
    named = {r.effect for r in ranking}
    for trial in done.rounds[0].trials:
        if len(trial.names) == 1 and trial.names[0] not in {*named, REFIT}:
            ranking.append(_ranked(trial, trial.names[0], done.rounds[0], first, None))
    return ranking


def _ranked(trial: Trial, name: str, this: Round, first: float, group: int | None) -> Ranked:
    own = [e for e in trial.fit.shared_estimates() if e.name.split(".")[0].split("#")[0] == name]
    fall = this.before.held_score**2 - trial.held_score**2
    share = float(np.clip(fall / max(first - 1, fall, 1e-9), 0.0, 1.0))
    half = trial.evidence / 2
    p_value = float(min(1.0, len(this.screened) * np.exp(-max(half, 0.0))))
    return Ranked(name, trial.held_score, share, p_value, float(half), own, group)


def lateness(done: Search, found: Sequence[Finding], same_clock: bool) -> Late:
    """How late the final model is."""
    model, fit = done.last.state.model, done.last.fit
    names = [u.parameter.name for u in fit.unknowns]
    parts = {"lag": [LAG], "delay": [], "clock": []}
    for instance in effect_names(model):
        if late := late_part(instance.split("#")[0]):
            kind, key = late
            parts[kind].append(f"{instance}.{key}")
    value = {k: sum(model.get(n) for n in own) for k, own in parts.items()}
    every = [n for own in parts.values() for n in own]
    if not same_clock:
        offsets = [m.get("clock.offset_s") for m in done.last.state.models]
        value["clock"] += float(np.median(offsets))
        every.append("clock.offset_s")
    mask = np.array([n in every for n in names], float)
    free = bool(mask.any())
    std = float(np.sqrt(mask @ fit.covariance @ mask)) if free else None
    kinds = [{late[0] for n in f.group or () if (late := late_part(n))} for f in found]
    tied = any(len(k) > 1 for k in kinds)
    lag_tied = any(len(k) > 1 and "lag" in k for k in kinds)
    parted = same_clock and not tied
    return Late(
        float(sum(value.values())),
        std,
        float(value["delay"]) if parted else None,
        float(value["lag"]) if not lag_tied else None,
        float(value["clock"]) if parted else None,
        bool(parted),
    )
