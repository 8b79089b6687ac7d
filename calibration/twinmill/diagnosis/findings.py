# SPDX-License-Identifier: Apache-2.0
"""Findings of a diagnosis: what each effect takes away, how sure it is, and its rivals."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.constancy import Change, changes_of
from twinmill.diagnosis.library import CHANGE, TIME
from twinmill.diagnosis.rest import Rest
from twinmill.diagnosis.search import (
    REFIT,
    Round,
    Search,
    State,
    Trial,
    comes_again,
    fitted,
    grown,
    of_levels,
)
from twinmill.fitting.compare import GOOD
from twinmill.model.parameters import (
    LAG,
    LAG_EFFECT,
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
    the effects in this order. Effects that stand in for each other lose little alone: where the
    first takes less than a later one, the order is that of what each takes in the chain.

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
    falls = {
        n: a.held_score**2 - b.held_score**2
        for n, (a, b) in zip(names, pairwise(chain), strict=True)
    }
    if falls and max(falls.values()) > falls[names[0]]:
        names.sort(key=lambda n: -falls[n])
        chain = _chain(names, first, done.last)
    errors = [_squared(t) for t in chain]
    # Where the floor itself holds a part of what was found, the final error stands for it.
    excess = max(errors[0] - min(errors[-1], 1.0), 1e-9)
    changes = changes_of(done.last)
    found = []
    for k, name in enumerate(names):
        share = float(np.clip((errors[k] - errors[k + 1]) / excess, 0.0, 1.0))
        finding = _finding(done, name, less.get(name), share, changes)
        if again := comes_again(done, name):
            why = f"it comes more than once: from {again[0]:.0f} to {again[1]:.0f} s, too"
            finding = _doubted(finding, why, wrong_form=True, depends_on=TIME)
        larger = next((n for n in names[:k] if n != REFIT), None)
        found.append(_beside_larger(finding, larger, *chain[k : k + 2]))
    return found, [(n, t.held_score) for n, t in zip(names, chain[1:], strict=True)]


def _beside_larger(finding: Finding, larger: str | None, before: Trial, after: Trial) -> Finding:
    """The finding, doubtful where it takes little of what a larger one leaves."""
    left = after.held_score**2
    if larger is None or finding.effect == REFIT or before.held_score**2 - left >= SLIGHT * left:
        return finding
    return _doubted(
        finding, f"it takes little of what {larger} leaves, which may have another form"
    )


def of_another_form(found: Sequence[Finding], depends_on: Sequence[str]) -> list[Finding]:
    """Findings, doubtful where their form is wrong.

    So it is where what is left still depends on what they act by; where one makes the robot later
    and another sooner: a lag below its own and a delay imitate a body that swings; and where a
    second one bends the curve of speed over command as a better one does already, or comes late at
    every change of the command; and where losses come at several times.

    Args:
        found: in the order of worth.
        depends_on: groups that what is left depends on.
    """
    late_s = [_lateness_s(f) for f in found]
    swings = min(late_s, default=0.0) < 0 < max(late_s, default=0.0)
    curves = [f.effect for f in found if f.effect in _curves()]
    late = [f.effect for f in found if _is_late(f)]
    events = [f.effect for f in found if with_role(f.effect, "moment")]

    def judged(finding: Finding) -> Finding:
        if swings and _lateness_s(finding):
            why = "sooner by one lag and later by another is what a body does that swings"
            return _doubted(finding, why, wrong_form=True, depends_on=CHANGE)
        if finding.effect in events and len(events) > 1:
            why = "losses at several times may be one that comes and goes"
            return _doubted(finding, why, wrong_form=True, depends_on=TIME)
        on = next((group for group in depends_on if BY.get(group, set()) & _acts_by(finding)), None)
        if on is not None:
            why = f"what is left still depends on {on}, so that it may have another form"
            return _doubted(finding, why, wrong_form=True)
        if finding.effect in curves[1:]:
            why = f"{curves[0]} bends the speed over the command, too: both may be one other curve"
            return _doubted(finding, why)
        if finding.effect in late[1:]:
            why = f"{late[0]} is late at changes of the command, too: both may be one other lag"
            return _doubted(finding, why)
        return finding

    return [judged(f) for f in found]


def beside_more(found: Sequence[Finding], rest: Rest) -> list[Finding]:
    """Findings, doubtful where more is left than all of them take, and it is no noise.

    A lag is doubtful where much is left at all: something else at changes of the command is late,
    too.
    """
    taken = sum(f.share for f in found if f.effect != REFIT)

    def judged(finding: Finding) -> Finding:
        if finding.effect == REFIT or not rest.firm:
            return finding
        if rest.share > taken:
            why = "more is left than it takes, so that it may be a part of something else"
            return _doubted(finding, why)
        if rest.share > LAG_LEAVES and _is_late(finding):
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


def _acts_by(finding: Finding) -> set[str]:
    """What the effect's card says of it in this respect; nothing for a refit, which has none."""
    card = catalogue().get(finding.effect, {"identify": (), "needs": "", "family": ""})
    return {*card["identify"], card["needs"], card["family"]}


def _is_late(finding: Finding) -> bool:
    """Whether all of the motion comes late, at every change of the command."""
    card = catalogue().get(finding.effect, {"needs": "", "identify": ()})
    always = card["needs"] == "changes" and "steps" in card["identify"]
    return bool(late_part(finding.effect)) or (always and "spin" not in card["identify"])


def _curves() -> set[str]:
    """Effects that bend the steady speed over the command."""
    return {n for n in of_levels() if catalogue()[n]["needs"] == "steady_speed"}


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
    group = (name, *tied) if tied else None
    card = catalogue_of(done.last.state.model)[name]
    doubt = _at_bound(card, own) or ("" if _stands_alone(done, name) else _unusual(card, own))
    if not doubt and less and _visits(done.last, less, instance) == 1:
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
    return done.last.held_score < GOOD and not near


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
