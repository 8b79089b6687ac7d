# SPDX-License-Identifier: Apache-2.0
"""Findings of a diagnosis in their order: what each effect takes away, and its rivals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.defaults import Certainty
from twinmill.diagnosis.constancy import Change, OneHeading, changes_of
from twinmill.diagnosis.doubts import (
    beside_larger,
    instead_in_family,
    instead_of_moment,
    instead_over_time,
    of_one,
    seen_once,
    stand_in,
)
from twinmill.diagnosis.finding import Finding, Ranked, doubted
from twinmill.diagnosis.rounds import Round, Search
from twinmill.diagnosis.search import comes_again
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import (
    REFIT,
    State,
    Trial,
    estimates_of,
    fitted_from,
    on_base_of,
    with_effects,
)
from twinmill.fitting.compare import MISSING
from twinmill.formulas.term import TIME
from twinmill.model.late import Late, late_parts
from twinmill.model.parameters import (
    CLOCK,
    LAG,
    LAG_EFFECT,
    NORMAL_95,
    ParameterEstimate,
    catalogue_name,
    catalogue_of,
    effect_names,
    instance_of,
    key_of,
    late_part,
    making_late,
    needing,
    newest_instance,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
NOT_WEIGHED = "the search was stopped before what else may take the same errors was looked for"


def findings_of(
    done: Search, less: Mapping[str, Trial | None]
) -> tuple[list[Finding], list[tuple[str, float]]]:
    """Findings in the order of a chain, and the held-out score after each of them.

    The chain adds the effects by what the final model loses without each. Shares are those of the
    chain. Effects that stand in for each other lose little alone, and what each
    takes depends on what was taken before: the first is the one that takes most on the average over
    one order of adding and its reverse. Where an order is found in which none takes less than those
    after it, it is that: effects that help each other alone have none.

    Args:
        done: the search.
        less: the final state refitted without each effect.
    """
    names = list(dict.fromkeys(done.found))
    given = on_base_of(done.start, done.last, done.last.state.base) if REFIT in names else None
    loss = {n: _loss(done.last, given if n == REFIT else less[n]) for n in names}
    names.sort(key=lambda n: -loss[n])
    chains = _Chains(done.start, done.rounds[0].before, done.last)
    chain = chains.of(names)
    if len(names) > 1:
        there = _takes(names, chain)
        back = _takes(names[::-1], chains.of(names[::-1]))
        top = max(names, key=lambda n: there[n] + back[n])
        if top != names[0]:
            names = [top, *(n for n in names if n != top)]
            chain = chains.of(names)
    names, chain = _falling(names, chain, chains.of)
    shares = _takes(names, chain)
    changes, left = changes_of(done.last), 1 - sum(shares.values())
    found = []
    for k, name in enumerate(names):
        finding = _finding(
            done, name, less=less.get(name), share=shares[name], left=left, changes=changes
        )
        if again := comes_again(done, name):
            why = f"it comes more than once: from {again[0]:.0f} to {again[1]:.0f} s, too"
            finding = doubted(finding, why, wrong_form=True, depends_on=TIME)
        if other := stand_in(done, name):
            why = f"{other} alone takes the same errors: both may be one other effect"
            finding = doubted(finding, why, wrong_form=True)
        larger = next((n for n in names[:k] if n != REFIT), None)
        found.append(beside_larger(finding, larger, *chain[k : k + 2]))
    return found, [(n, t.held_score) for n, t in zip(names, chain[1:], strict=True)]


def _falling(
    names: list[str], chain: list[Trial], chained: Callable[[list[str]], list[Trial]]
) -> tuple[list[str], list[Trial]]:
    """An order in which shares fall, with its chain; as given if none is found in a few trials."""
    order, trials = names, chain
    for _ in names:
        shares = _takes(order, trials)
        ranked = sorted(order, key=lambda n: -shares[n])
        if ranked == order:
            return order, trials
        order, trials = ranked, chained(ranked)
    return names, chain


def steps_of(
    found: Sequence[Finding], chain: Sequence[tuple[str, float]], first: State, last: Trial
) -> list[tuple[str, float]]:
    """Held-out score after each finding, in their order.

    Args:
        found: findings; stale numbers stand for all of the chain that is named nowhere else.
        chain: as `findings_of` gives it, of which this is a part where the orders agree.
        first: where the search started.
        last: the final trial.
    """
    named = {f.effect for f in found} - {REFIT}
    order = [
        [n for n, _ in chain if n == f.effect or (f.effect == REFIT and n not in named)]
        for f in found
    ]
    if order == [[n] for n, _ in chain]:
        return [(f.effect, score) for f, (_, score) in zip(found, chain, strict=True)]
    state, steps = first, []
    for finding, names in zip(found, order, strict=True):
        state = with_effects(state, names)
        steps.append((finding.effect, fitted_from(state, last).held_score))
    return steps


def _takes(names: Sequence[str], chain: Sequence[Trial]) -> dict[str, float]:
    """Share of the squared error at 0.5 s above the floor that each takes in a chain."""
    errors = [_squared(t) for t in chain]
    # Where the floor itself holds a part of what was found, the final error stands for it.
    excess = max(errors[0] - min(errors[-1], 1.0), 1e-9)
    falls = [a - b for a, b in pairwise(errors)]
    return {n: float(np.clip(f / excess, 0.0, 1.0)) for n, f in zip(names, falls, strict=True)}


def with_stale_numbers(
    found: Sequence[Finding],
    model: native.Model,
    *,
    lag_std_s: float,
    clock_std_s: float,
    stds: Mapping[str, float],
    slight: Mapping[str, ParameterEstimate],
) -> list[Finding]:
    """Findings in which what the model may well have by its own error is a stale number.

    Args:
        found: in the order of the chain.
        model: the final one.
        lag_std_s: how well other logs told the model's lag; 0 where none did.
        clock_std_s: the same of the clocks' offset, which a delay cannot be told from.
        stds: how well other logs told the numbers of the model's effects, by name.
        slight: lags that do what effects do and hardly differ from the model's, by effect.
    """
    gone: list[Finding] = []
    own: list[ParameterEstimate] = []
    for finding in found:
        numbers = _stale_numbers(finding, model, lag_std_s, stds)
        numbers = numbers or _stale_clock(finding, model, clock_std_s)
        if not numbers and finding.effect in slight:
            numbers = [slight[finding.effect]]
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


def slight_lags(done: Search, first: State, score: float) -> dict[str, ParameterEstimate]:
    """By effect, the lag of the base that does nearly what it does, and is nearly as it was.

    A robot that is driven in another way is a little later or sooner than the model, though nothing
    new is there. Where the model as given hardly misses, that says no more.

    Args:
        done: the search.
        first: where it started.
        score: of the model as given.
    """
    if score > MISSING:
        return {}
    lag_s, late_s = done.last.state.model.get(LAG), _late_s(first.model)
    found = {}
    for name in done.found:
        this = done.round_of(name)
        trial = next((t for t in this.trials if t.names == (LAG_EFFECT,)), None)
        if trial is None or this.accepted.names != (name,) or not _does_as_much(this, trial):
            continue
        extra, *_ = estimates_of(trial, LAG_EFFECT)
        if abs(extra.value) <= SETTINGS.told_lag * late_s:
            found[name] = replace(extra, name=LAG, value=lag_s + extra.value)
    return found


def _does_as_much(this: Round, trial: Trial) -> bool:
    """True if a trial takes about as much as the accepted one does."""
    before = this.before.held_score**2
    return before - trial.held_score**2 > SETTINGS.rival * (before - this.accepted.held_score**2)


def beside_the_base(
    findings: Sequence[Finding], model: native.Model, *, told: bool
) -> list[Finding]:
    """With the base's own lag in words, where one adds to it; `told`: other logs told that lag."""
    lag_s = model.get(LAG)
    words = f"adds to the base's own {lag_s:.3g} s{'' if told else ', which no log told'}"
    return [
        replace(f, beside=words) if f.effect == LAG_EFFECT and lag_s > 0 else f for f in findings
    ]


def _late_s(model: native.Model) -> float:
    """How late a model is by its lags and delays."""
    own = [(i, late_part(catalogue_name(i))) for i in effect_names(model)]
    return model.get(LAG) + sum(model.get(f"{i}.{late[1]}") for i, late in own if late)


def _stale_numbers(
    finding: Finding, model: native.Model, lag_std_s: float, stds: Mapping[str, float]
) -> list[ParameterEstimate]:
    """Changes that a finding makes, if the model's own error may cover all of them; else none."""
    lag_s = model.get(LAG)
    known_s = lag_std_s or SETTINGS.stated_lag * lag_s
    alike = set(finding.group or ()) <= {*needing("changes")}
    if finding.effect == LAG_EFFECT and alike and known_s > 0:
        extra = finding.parameters[0]
        if abs(extra.value) <= SETTINGS.within * np.hypot(extra.std, known_s):
            return [replace(extra, name=LAG, value=lag_s + extra.value)]
    known = finding.again and all(_is_error(e, model, stds) for e in finding.parameters)
    return finding.parameters if known else []


def _stale_clock(
    finding: Finding, model: native.Model, clock_std_s: float
) -> list[ParameterEstimate]:
    """The offset of the clocks, if a delay may well be all of its error; else none."""
    names = {finding.effect, *(finding.group or ())}
    shifts = {*making_late("delay"), *making_late("clock")}
    if clock_std_s <= 0 or not names & shifts or not all(late_part(n) for n in names):
        return []
    _, key = late_part(finding.effect)
    late = next(e for e in finding.parameters if key_of(e.name) == key)
    if abs(late.value) > SETTINGS.within * np.hypot(late.std, clock_std_s):
        return []
    offset_s = model.get(CLOCK) + late.value
    return [replace(late, name=CLOCK, value=offset_s, words="offset of the clocks")]


def _is_error(own: ParameterEstimate, model: native.Model, stds: Mapping[str, float]) -> bool:
    """True if a number changed by no more than the error that the model gives for it."""
    instance, key = instance_of(own.name), key_of(own.name)
    name = catalogue_name(instance)
    card = next(p for p in catalogue_of(model)[name]["parameters"] if p["name"] == key)
    known = stds.get(f"{name}.{key}", 0.0)
    return abs(own.value - card["neutral"]) <= SETTINGS.within * np.hypot(own.std, known)


class _Chains:
    """Fits of the first state, and of it with one effect more each time, in any order.

    Orders that begin alike share what they begin with.
    """

    def __init__(self, first: State, begun: Trial, last: Trial) -> None:
        self._last = last
        self._known = {(): (first, begun)}

    def of(self, names: Sequence[str]) -> list[Trial]:
        """In this order."""
        upto: tuple[str, ...] = ()
        chain = [self._known[upto][1]]
        for name in names:
            state, _ = self._known[upto]
            upto = (*upto, name)
            if upto not in self._known:
                state = with_effects(state, [name])
                self._known[upto] = state, fitted_from(state, self._last)
            chain.append(self._known[upto][1])
        return chain


def _loss(last: Trial, less: Trial | None) -> float:
    """Rise of the squared held-out score without one effect, or with the base as it was given."""
    return 0.0 if less is None else less.held_score**2 - last.held_score**2


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


def _rivals(done: Search, name: str) -> list[Trial]:
    """Trials that the data could not tell from this effect's, unless they were found besides."""
    this = done.round_of(name)
    rivals = list(this.tied)
    if this.accepted.names == (name,) and name != REFIT:
        rivals += [
            t
            for t in done.imitators_of(name)
            if not any(t is r for r in this.tied) and len(t.names) == 1 and t.names != (REFIT,)
        ]
    return [t for t in rivals if not set(t.names) & set(done.found)][: done.settings.group - 1]


def _finding(
    done: Search,
    name: str,
    *,
    less: Trial | None,
    share: float,
    left: float,
    changes: Mapping[str, Change | OneHeading],
) -> Finding:
    own = estimates_of(done.last, name)
    if name == REFIT:
        moved = done.last.fit.moved
        own.sort(key=lambda e: -moved[e.name])
        alike = tuple(n for t in _rivals(done, REFIT) for n in t.names)
        group = (REFIT, *alike) if alike else None
        return Finding(REFIT, group, own, share, "group" if alike else "sure")
    instance = newest_instance(done.last.state.model, name)
    instead = seen_once(done, name, less)
    tied = [n for t in _rivals(done, name) for n in t.names]
    tied += [*(instead or ()), *instead_of_moment(done, name), *instead_over_time(done, name)]
    tied += instead_in_family(done, name, left)
    tied = list(dict.fromkeys(tied))[: done.settings.group - 1]
    group = (name, *tied) if tied else None
    doubt = of_one(done, name, own, changes.get(instance))
    if not doubt and instead == []:
        doubt = f"one visit of its place speaks for {name}: it may be that time and not the place"
    certainty: Certainty = "doubtful" if doubt else "group" if group else "sure"
    found = Finding(name, group, own, share, certainty, doubt, "#" in instance)
    change = changes.get(instance)
    if isinstance(change, Change) and change.is_of_another_form:
        return doubted(found, change.why, wrong_form=True, depends_on=change.depends_on)
    return found


def not_weighed(done: Search) -> list[Finding]:
    """Findings of a search that was stopped, most first; no fit is made for them.

    Shares are of the squared held-out score above the noise, each in the round that accepted it.
    """
    excess = max(done.rounds[0].before.held_score ** 2 - min(done.last.held_score**2, 1.0), 1e-9)
    found = []
    for name in dict.fromkeys(done.found):
        this = done.round_of(name)
        fall = this.before.held_score**2 - this.accepted.held_score**2
        share = float(np.clip(fall / len(this.accepted.names) / excess, 0.0, 1.0))
        own = estimates_of(done.last, name)
        rivals = [n for t in _rivals(done, name) for n in t.names]
        group = (name, *rivals) if rivals else None
        again = name != REFIT and "#" in newest_instance(done.last.state.model, name)
        found.append(Finding(name, group, own, share, "doubtful", NOT_WEIGHED, again))
    return sorted(found, key=lambda f: -f.share)


def ranking_of(done: Search, found: Sequence[Finding]) -> list[Ranked]:
    """Found effects in the order of worth with their rivals, then the rest of the first round."""
    first = done.rounds[0].before.held_score ** 2
    ranking: list[Ranked] = []
    number = 0
    for finding in found:
        if finding.effect == REFIT:
            continue
        this, rivals = done.round_of(finding.effect), _rivals(done, finding.effect)
        group = None
        if finding.group:
            number += 1
            group = number
        for trial in [this.accepted, *rivals]:
            entries = [
                _ranked(trial, n, this=this, first=first, group=group)
                for n in trial.names
                if n != REFIT
            ]
            ranking += [
                e for e in entries if e.effect == finding.effect or trial is not this.accepted
            ]
    named = {r.effect for r in ranking}
    for trial in done.rounds[0].trials:
        if len(trial.names) == 1 and trial.names[0] not in {*named, REFIT}:
            ranking.append(
                _ranked(trial, trial.names[0], this=done.rounds[0], first=first, group=None)
            )
    return ranking


def _ranked(trial: Trial, name: str, *, this: Round, first: float, group: int | None) -> Ranked:
    own = [e for e in trial.fit.shared_estimates() if catalogue_name(e.name) == name]
    fall = this.before.held_score**2 - trial.held_score**2
    share = float(np.clip(fall / max(first - 1, fall, 1e-9), 0.0, 1.0))
    half = float(trial.evidence / 2)
    return Ranked(name, trial.held_score, share, this.p_value(trial), half, own, group)


def lateness(done: Search, found: Sequence[Finding], same_clock: bool) -> Late:
    """How late the final model is; what else takes the same errors may have another sum."""
    model, fit = done.last.state.model, done.last.fit
    names = [u.parameter.name for u in fit.unknowns]
    value = _late_values(done.last.state, same_clock)
    lags_s = fit.x[[n == LAG for n in names]]  # one, or each robot's or run's own
    spread_s = float(np.std(lags_s, ddof=1)) if len(lags_s) > 1 else 0.0
    value["lag"] += float(np.mean(lags_s)) - model.get(LAG) if spread_s else 0.0
    every = [n for own in late_parts(model).values() for n in own] + [CLOCK] * (not same_clock)
    # Of what each log or robot has of its own, the mean.
    mask = np.array([(n in every) / names.count(n) for n in names])
    free = bool(mask.any())
    apart = max((_late_apart_s(done, f, same_clock) for f in found if f.group), default=0.0)
    variance = mask @ fit.covariance @ mask + (apart / NORMAL_95) ** 2 + spread_s**2
    std = float(np.sqrt(variance)) if free else None
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
        spread_s,
    )


def _late_values(state: State, same_clock: bool) -> dict[str, float]:
    """Seconds by lag, delay and clock; of logs whose clocks are two, the median."""
    value = {k: sum(map(state.model.get, own)) for k, own in late_parts(state.model).items()}
    if not same_clock:
        value["clock"] += float(np.median([m.get(CLOCK) for m in state.models]))
    return value


def _late_apart_s(done: Search, finding: Finding, same_clock: bool) -> float:
    """How far the lateness by others of a finding's group is from the one by the finding itself."""
    this = done.round_of(finding.effect)
    assert this.accepted is not None
    others = [t for t in _rivals(done, finding.effect) if set(t.names) <= set(finding.group or ())]
    own, *rest = (sum(_late_values(t.state, same_clock).values()) for t in (this.accepted, *others))
    return max((abs(other - own) for other in rest), default=0.0)
