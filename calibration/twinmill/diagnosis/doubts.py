# SPDX-License-Identifier: Apache-2.0
"""Reasons to doubt a finding: its size, other effects that do the same, and what is left.

An effect that is named surely and is not there sends its user the wrong way, so each doubt is told
with the finding.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from twinmill.diagnosis.acceptance import when_s
from twinmill.diagnosis.constancy import Change, OneHeading
from twinmill.diagnosis.finding import Finding, doubted
from twinmill.diagnosis.rest import STEADY, Rest
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.search import PAUSE_S
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.ties import bends_speed, in_common, way_apart
from twinmill.diagnosis.trials import REFIT, Trial, estimates_of
from twinmill.fitting.compare import GOOD
from twinmill.formulas.term import CHANGE, COUPLING, PAST, PLACE, TIME
from twinmill.model.parameters import (
    WHERE_OR_WHEN,
    ParameterEstimate,
    catalogue,
    catalogue_of,
    effect_names,
    key_of,
    lasts_for_a_while,
    late_part,
    needing,
    newest_instance,
    with_role,
)
from twinmill.predict.datasets import Trajectory, errors_of

# Groups of a rest, and what the cards of effects that act by them need or are shown by.
BY = {
    PLACE: {"places", "place"},
    "heading": {"headings", "heading"},
    TIME: {"history", "battery"},
    CHANGE: {"changes"},
    PAST: {"changes"},
}

# On what the motion depends if an effect is there whose card has such words: the first that fits.
ACTS_ON = (
    ({"places"}, PLACE),
    ({"headings"}, "heading"),
    ({"history"}, TIME),
    ({"battery"}, TIME),
    ({"clock", "long"}, TIME),
    ({"changes"}, CHANGE),
    ({"reversals"}, "direction of rotation"),
    ({"arcs"}, COUPLING),
    ({"levels"}, "speed"),
)


def of_one(
    done: Search,
    name: str,
    own: Sequence[ParameterEstimate],
    change: Change | OneHeading | None,
) -> str:
    """A doubt about one effect by itself; empty if there is none.

    Args:
        done: the search.
        name: of the effect.
        own: its parameters in the final model.
        change: of one of them with what the robot was doing; None if each is one number.
    """
    card = catalogue_of(done.last.state.model)[name]
    if doubt := _at_bound(card, own) or _faster(name, own):
        return doubt
    if done.last.state.model.drive == "duty" and (doubt := _wanders(card, own)):
        return doubt
    if with_role(name, "moment") and (doubt := _at_other_commands(done.last, name)):
        return doubt
    if lasts_for_a_while(name) and when_s(done.last, name)[0] < PAUSE_S:
        return "it is there from the start: what runs in, or warms up, fades so by itself"
    lone = _stands_alone(done, name) and name not in needing("clocks")  # crystals err by so much
    if not lone and (doubt := _unusual(card, own)):
        return doubt
    if change:
        return change.why
    if name != REFIT and any(t.names == (REFIT,) for t in done.imitators_of(name)):
        return "other numbers of the base take nearly as much, and the errors left are no noise"
    if (
        done.last.fit.chance_of_none(newest_instance(done.last.state.model, name))
        > SETTINGS.nothing
    ):
        return f"parts of these logs do not agree that {name} is there: its size may be nothing"
    return ""


def seen_once(done: Search, name: str, less: Trial | None) -> list[str] | None:
    """Losses of a moment that do the same, where one visit of its place speaks for an effect.

    None if several visits do, or it has no place.

    Args:
        done: the search.
        name: of the effect.
        less: the final state refitted without it.
    """
    instance = newest_instance(done.last.state.model, name)
    if less is None or _visits(done.last, less, instance) != 1:
        return None
    return [n for n in _same(done, name) if with_role(n, "moment")]


def instead_over_time(done: Search, name: str) -> list[str]:
    """Effects that do the same as one that changes with the time, or with the speed.

    A drive that goes through its speeds one after the other takes one for the other. Where
    something is left beside the one that was found, its form may be wrong. Beside one of the time,
    another of the time that ended at its bound would do more with a larger size: heat, while the
    battery empties.
    """
    if not _is_slow(name):
        left = bends_speed(name) and done.last.held_score >= SETTINGS.level
        return [n for n in _same(done, name) if _is_slow(n)] if left else []
    bounded = {t.names[0] for t in done.round_of(name).trials if _is_bounded(t)}
    larger = _same(done, name, SETTINGS.same_in_time, SETTINGS.same_at_bound)
    timed = [n for n in larger if _is_slow(n) and n in bounded]
    if done.last.held_score < SETTINGS.level:
        return timed
    return [*timed, *(n for n in _same(done, name) if bends_speed(n))]


def instead_in_family(done: Search, name: str, left: float) -> list[str]:
    """Effects of its family that do the same as one beside which something is left.

    A form that is not quite right leaves it, and theirs is as near.

    Args:
        done: the search.
        name: of the effect.
        left: share of the excess that no finding takes.
    """
    nothing = left <= SETTINGS.nothing_left or done.last.held_score < SETTINGS.level
    if name == REFIT or nothing:
        return []
    family = catalogue()[name]["family"]
    return [
        n for n in _same(done, name) if n not in done.found and catalogue()[n]["family"] == family
    ]


def instead_of_moment(done: Search, name: str) -> list[str]:
    """Effects that do the same as one of a moment.

    Those of a place, where the robot was at that time: any, if it was nowhere else near; and those
    of the time that it has been driving, as a motor that warms up early and stays warm. One of
    these that ended at its bound would do more, and need do half.
    """
    if not with_role(name, "moment"):
        return []
    anywhere = _is_even(done.last, name) and _in_a_place_of_its_own(done.last, name)
    placed = [n for n in (catalogue() if anywhere else _same(done, name)) if with_role(n, "place")]
    bounded = _same(done, name, SETTINGS.same_in_time, at_bound=SETTINGS.same_at_bound)
    timed = [n for n in bounded if _is_slow(n)]
    for_good = [n for n in catalogue() if with_role(n, "moment") and not lasts_for_a_while(n)]
    return [*placed, *timed, *(for_good if _may_not_end(done.last, name) else ())]


def _may_not_end(last: Trial, name: str) -> bool:
    """True if the end of an effect of a while may lie beyond its log."""
    if not lasts_for_a_while(name):
        return False
    key = with_role(name, "moment")[-1]
    (end,) = (e for e in estimates_of(last, name) if e.name.endswith(f".{key}"))
    latest_s = max(d.start_s[-1] for d in last.fit.datasets if isinstance(d, Trajectory))
    return end.value + SETTINGS.within * (end.std or 0.0) > latest_s


def _is_even(last: Trial, name: str) -> bool:
    """True if one size says all of an effect: a loss that is one of both sides."""
    card, own = catalogue_of(last.state.model)[name], estimates_of(last, name)
    sizes = [(e, away) for e, p, away in _sizes(card, own) if p["role"] == "size"]
    return sum(away > SETTINGS.within * e.std for e, away in sizes) < 2


def _in_a_place_of_its_own(last: Trial, name: str) -> bool:
    """True if the robot, during a momentary effect, drives where it drives at no other time.

    Then the floor there may be as it is, and no log of this drive tells. When it begins and ends is
    known to a part of its while, so that the middle of it decides.
    """
    begin_s, *end_s = when_s(last, name)
    (data,) = (d for d in last.fit.datasets if isinstance(d, Trajectory))
    place, away_s = data.measurement.track.pose[data.windows.starts, :2], SETTINGS.away_s
    until_s = min([*end_s, data.start_s[-1]])
    rim_s = SETTINGS.rim * (until_s - begin_s)
    there = (data.start_s >= begin_s + rim_s) & (data.start_s < until_s - rim_s)
    elsewhen = (data.start_s < begin_s - away_s) | (data.start_s > until_s + away_s)
    if not (there.any() and elsewhen.any()):
        return False
    way_m = np.hypot(*np.diff(place, axis=0, append=place[-1:]).T)
    apart_m = np.hypot(*(place[there].T[:, :, None] - place[elsewhen].T[:, None]))
    again = apart_m.min(axis=1) < SETTINGS.again_m
    return bool(way_m[there] @ again < SETTINGS.comes_by * way_m[there].sum())


def undetermined(findings: Sequence[Finding]) -> list[Finding]:
    """Findings, those doubtful of which these logs determine none of the numbers."""
    why = "none of its own numbers is determined by these logs"
    return [
        doubted(f, why)
        if f.certainty == "sure" and f.parameters and not any(p.told for p in f.parameters)
        else f
        for f in findings
    ]


def within_the_table(
    found: Sequence[Finding], less: Mapping[str, Trial], last: Trial
) -> list[Finding]:
    """Findings, doubtful where speeds that other logs told may be as wrong as what they change.

    Args:
        found: of a robot of duties, whose base other logs told.
        less: the final state refitted without each effect.
        last: the final state.
    """

    def judged(finding: Finding) -> Finding:
        bends = finding.effect in less and bends_speed(finding.effect)
        if not bends or way_apart(less[finding.effect], last) > SETTINGS.told_speeds:
            return finding
        why = (
            f"it changes the way by less than {100 * SETTINGS.told_speeds:.1f} %, and speeds that "
            "another log told are seldom known better"
        )
        return replace(doubted(finding, why), within_told=True)

    return [judged(f) for f in found]


def _sizes(
    card: dict, own: Sequence[ParameterEstimate]
) -> Iterator[tuple[ParameterEstimate, dict, float]]:
    """Each estimate with its entry of the card and its distance from neutral."""
    entry = {p["name"]: p for p in card["parameters"]}
    for e in own:
        p = entry[key_of(e.name)]
        yield e, p, abs(e.value - p["neutral"])


def at_bounds(findings: Sequence[Finding]) -> list[Finding]:
    """Findings, in doubt where a number of the base ended at its bound: it would have gone on."""
    found = []
    for f in findings:
        names = [e.name for e in f.parameters if f.effect == REFIT and e.at_bound]
        found.append(doubted(f, f"{names[0]} is at its bound") if names else f)
    return found


def _at_bound(card: dict, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where an estimate ended at its bound, and a usual one is excluded; else empty."""
    for e, p, away in _sizes(card, own):
        excluded = e.std is None or abs(e.value - p["default"]) > SETTINGS.beyond * e.std
        if e.at_bound and away > 1e-3 and excluded:
            return f"{e.name} is at its bound ({e.value:.3g}): another effect may be behind it"
    return ""


def _unusual(card: dict, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where an estimate is far larger than is usual; else empty."""
    for e, p, away in _sizes(card, own):
        if p["role"] == "size" and away > SETTINGS.beyond * p["usual_size"]:
            return (
                f"{e.name} = {e.value:.3g} is far beyond what is usual: another effect may be "
                "behind it"
            )
    return ""


def _faster(name: str, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where a loss makes the robot faster; else empty."""
    if not (own and (_is_event(name) or _rubs(name))):
        return ""
    loss, *_ = own
    if loss.value < -SETTINGS.within * loss.std:
        return (
            f"{loss.name} = {loss.value:.3g} makes the robot faster, which few floors or faults do"
        )
    return ""


def _wanders(card: dict, own: Sequence[ParameterEstimate]) -> str:
    """A doubt where a loss from a moment on is no more than battery and heat do; else empty."""
    if not with_role(card["name"], "moment"):
        return ""
    sizes = [(away, e) for e, p, away in _sizes(card, own) if p["role"] == "size"]
    most, loss = max(sizes, key=lambda pair: pair[0])
    if most < SETTINGS.drift_std:
        return f"{loss.name} = {loss.value:.3g}: speeds wander by as much with battery and heat"
    return ""


def _at_other_commands(last: Trial, name: str) -> str:
    """A doubt where an effect of a moment is there while commands are larger than otherwise."""
    begin_s, *end_s = when_s(last, name)
    tracks = [d.measurement.track for d in last.fit.datasets if isinstance(d, Trajectory)]
    for track in tracks:
        size = np.abs(track.command / np.maximum(np.abs(track.command).max(axis=0), 1e-9)).sum(1)
        t_s = track.command_t_s - track.command_t_s[0]
        held_s = np.diff(t_s, append=t_s[-1])
        on = (t_s >= begin_s) & (t_s < min(end_s, default=np.inf))
        inside, outside = (size > 0) & on, (size > 0) & ~on
        if not inside.any() or not outside.any():
            continue
        most = np.quantile(size[outside], 0.95, weights=held_s[outside], method="inverted_cdf")
        if np.average(size[inside] > most, weights=held_s[inside]) > SETTINGS.other_commands:
            return (
                "while it is there the commands are larger than at other times, so that it may be "
                "a limit of them"
            )
    return ""


def _visits(last: Trial, less: Trial, instance: str) -> int | None:
    """How many visits of an effect's place speak for it, in all logs; None for one without a place.

    By the fall of the squared errors in windows that begin there: at least `weighty` of the
    largest.
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
            visit = np.cumsum(np.diff(data.start_s[there], prepend=-np.inf) > SETTINGS.away_s) - 1
            fall = (before**2 - after**2).reshape(len(there), -1).sum(axis=1)[there]
            falls += list(np.bincount(visit, fall))
    return int(np.sum(np.array(falls) > SETTINGS.weighty * max(falls, default=0.0)))


def _stands_alone(done: Search, name: str) -> bool:
    """True if nothing is left beside an effect, and no other comes near to its share.

    Then it is right though its size is none that is usual.
    """
    this = done.round_of(name)
    most = this.accepted.held_score**2 + SETTINGS.near
    near = [t for t in this.trials if t is not this.accepted and t.held_score**2 < most]
    return done.last.held_score < GOOD and all(_beats(done, this.accepted, t) for t in near)


def _beats(done: Search, one: Trial, other: Trial) -> bool:
    """True if one is better by as much as an addition must bring, also without its best block."""
    evidence, without_best, _ = one.fit.against(other.fit)
    least = done.settings
    return evidence > least.evidence and without_best > least.without_best


def _same(
    done: Search,
    name: str,
    least: float = SETTINGS.same,
    at_bound: float = SETTINGS.same_fall,
) -> list[str]:
    """Effects that alone took the same errors as this one, when it was accepted.

    Args:
        done: the search.
        name: of the effect.
        least: of the cosine of what they take.
        at_bound: share of its fall of the error that is enough for one that is at its bound; no
            more than is enough for others.
    """
    this = done.round_of(name)
    if name == REFIT or this.accepted.names != (name,):
        return []
    taken = this.before.held_score**2 - this.accepted.held_score**2

    def takes_enough(trial: Trial) -> bool:
        fell = this.before.held_score**2 - trial.held_score**2
        enough = fell > SETTINGS.same_fall * taken
        return enough or (fell > at_bound * taken and _is_bounded(trial))

    return [
        t.names[0]
        for t in this.trials
        if len(t.names) == 1
        and t.names[0] not in (name, REFIT)
        and takes_enough(t)
        and in_common(this.before, this.accepted, t) > least
    ]


def _is_bounded(trial: Trial) -> bool:
    """True if a number of a trial of one effect ended at its bound."""
    return any(e.at_bound for e in estimates_of(trial, trial.names[0]))


def stand_in(done: Search, name: str) -> str | None:
    """Another effect that was found and alone does what this one does; None if there is none.

    Two of one family may both be there, and of two that act by the same thing the better one is
    right and the other its rest; see KINDS.
    """
    for other in _same(done, name):
        family = catalogue()[name]["family"] == catalogue()[other]["family"]
        alike = family or any(of(name) and of(other) for of, *_ in KINDS)
        if other in done.found and not alike:
            return other
    return None


def undone(found: Sequence[Finding], last: Trial) -> list[Finding]:
    """Findings, doubtful where one undoes much of what another does.

    Two effects that are there take errors of their own each, so that what they do to the
    predictions has little in common. Two that are needed together to do nothing else imitate a
    third.

    Args:
        found: in the order of worth.
        last: the final state.
    """
    names = [f.effect for f in found if f.effect != REFIT]
    does = {n: _change_by(last, newest_instance(last.state.model, n)) for n in names}
    for one, other in combinations(names, 2):
        size = np.linalg.norm(does[one]) * np.linalg.norm(does[other])
        if does[one] @ does[other] < -SETTINGS.undone * size:
            why = f"{one} and {other} undo much of each other: both may be one other effect"
            both = _acts_by(one) & _acts_by(other)
            on = next((group for group, words in BY.items() if words & both), "")
            found = [
                doubted(f, why, wrong_form=True, depends_on=on) if f.effect in (one, other) else f
                for f in found
            ]
    return list(found)


def beside_stale(found: Sequence[Finding]) -> list[Finding]:
    """Findings of logs of few commands, doubtful where numbers of the base were stale as well.

    Each command tells a few steady speeds, which other numbers and another effect make as well.
    """
    if REFIT not in [f.effect for f in found]:
        return list(found)
    steady = needing("steady_speed")
    why = "at the few commands of these logs other numbers and another effect may do the same"
    return [doubted(f, why) if f.effect in steady else f for f in found]


def _change_by(last: Trial, instance: str) -> np.ndarray:
    """(R,) by which the errors of all data sets change by an effect of the final model."""
    less = []
    for data, model in zip(last.fit.datasets, last.state.models, strict=True):
        model = model.copy()
        model.remove_effect(effect_names(model).index(instance))
        less.append(errors_of(data, model))
    return np.concatenate(less) - last.fit.errors


def beside_larger(finding: Finding, larger: str | None, before: Trial, after: Trial) -> Finding:
    """The finding, doubtful where it takes little of what a larger one leaves."""
    left = after.held_score**2
    if (
        larger is None
        or finding.effect == REFIT
        or before.held_score**2 - left >= SETTINGS.slight * left
    ):
        return finding
    return doubted(finding, f"it takes little of what {larger} leaves, which may have another form")


def of_another_form(found: Sequence[Finding], rest: Rest) -> list[Finding]:
    """Findings, doubtful where their form is wrong: by the first of FORM_RULES that says so.

    Args:
        found: in the order of worth.
        rest: what is left.
    """

    def judged(finding: Finding) -> Finding:
        doubts = (rule(finding, found, rest) for rule in FORM_RULES)
        return next((d for d in doubts if d is not None), finding)

    return [judged(f) for f in found]


def _swings(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """One finding makes the robot later and another sooner.

    A lag below its own and a delay imitate a body that swings. One that takes next to nothing is a
    correction of the other.
    """
    late_s = [_lateness_s(f) if f.share > SETTINGS.nothing_left else 0.0 for f in found]
    if not _lateness_s(finding) or not min(late_s) < 0 < max(late_s):
        return None
    why = "sooner by one lag and later by another is what a body does that swings"
    return doubted(finding, why, wrong_form=True, depends_on=CHANGE)


def _heading_is_late(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """Turning comes late, and in curves the robot drifts inwards by as much.

    A heading that is told late by T is off by omega T, so that a robot that drives with v seems to
    drift by v omega T to the inside: as slip of -T does.
    """
    both = {f.effect: f for f in found if f.effect in ("yaw_lag", "lateral_slip")}
    if finding.effect not in both or len(both) < 2:
        return None
    turn, drift = (both[name].parameters[0] for name in ("yaw_lag", "lateral_slip"))
    if abs(turn.value + drift.value) > SETTINGS.within * np.hypot(turn.std, drift.std):
        return None
    why = f"both are what a heading does that is told {turn.value:.3f} s later than the place is"
    return doubted(finding, why, wrong_form=True, depends_on=CHANGE)


def _is_of_an_uneven_wheel(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """A wheel is weak, and errors follow the angle of one: a flat place does both."""
    uneven = any(group.startswith("angle of") for group in rest.depends_on)
    uneven |= any(f.effect in needing("wheel_angle") for f in found)
    if finding.effect != "wheel_gain" or not uneven:
        return None
    why = "errors follow the angle of a wheel, and one with a flat place rolls less far as well"
    return doubted(finding, why, wrong_form=True)


def _leaves_what_depends_on_speed(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """A weak wheel loses a share at all speeds: one that rubs leaves what depends on them."""
    on = _left_on(rest, STEADY)
    if finding.effect != "wheel_gain" or not on:
        return None
    return doubted(finding, f"what is left depends on {on}, as where a wheel rubs or slips")


def _leaves_what_couples_the_axes(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """A marker aside is led round alike in all turns: where a wheel slips in some it is not."""
    on = _left_on(rest, (COUPLING,))
    if finding.effect != "marker_offset" or not on:
        return None
    return doubted(finding, f"what is left depends on {on}, as where a wheel slips in turns")


def _left_on(rest: Rest, groups: Collection[str]) -> str:
    """The first of some groups on which more than little of what is left depends for sure."""
    on = [g for g in rest.depends_on if g in groups and not rest.likely]
    return on[0] if on and rest.share > SETTINGS.wheel_leaves else ""


def _comes_and_goes(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """Losses come at several times, or as large ones at a place and at a moment."""
    losses = _alike_losses(found)
    if finding not in losses or len(losses) < 2:
        return None
    why = "losses at several times may be one that comes and goes"
    return doubted(finding, why, wrong_form=True, depends_on=TIME)


def _is_beside_doubtful_of_its_kind(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """Another finding acts on the same, is doubtful and takes much."""
    on = _depends_on(finding.effect)
    alike = [
        f.effect
        for f in found
        if f is not finding and f.certainty == "doubtful" and f.share > SETTINGS.much_left
    ]
    alike = [name for name in alike if on and _depends_on(name) == on]
    if not alike:
        return None
    why = f"{alike[0]} acts on {on} as well, and is doubtful: both may be one other effect"
    return doubted(finding, why)


def _is_no_loss(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """A loss of a moment that is none: what runs in or warms up makes a robot faster."""
    why = _faster(finding.effect, finding.parameters)
    if not (why and with_role(finding.effect, "moment")):
        return None
    return doubted(finding, why, wrong_form=True, depends_on=TIME)


def _is_of_a_place_that_changes(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """A place slows the robot, and at some time another finding makes it faster."""
    faster = [f.effect for f in found if f is not finding and _faster(f.effect, f.parameters)]
    if not (faster and with_role(finding.effect, "place")):
        return None
    why = f"{faster[0]} makes the robot faster at some time, so that its place may change"
    return doubted(finding, why, wrong_form=True, depends_on=PLACE)


def _is_some_moments(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """A loss at a place, or one at a moment that is doubtful already; single moments are left."""
    doubtful = _is_event(finding.effect) and finding.certainty == "doubtful"
    if not rest.moments or not (doubtful or with_role(finding.effect, "place")):
        return None
    why = "single moments are left, of which this may be some"
    return doubted(finding, why, wrong_form=True)


def _is_beside_larger_group(
    finding: Finding, found: Sequence[Finding], rest: Rest
) -> Finding | None:
    """A larger one is this or that, of another kind each: which decides what is left for this."""
    larger = [f for f in found if f.group and f.share > finding.share]
    larger = [f for f in larger if not any(all(map(of, f.group)) for of, *_ in KINDS)]
    if finding.certainty != "sure" or finding.effect == REFIT or not larger:
        return None
    names = " or ".join(larger[0].group)
    return doubted(finding, f"what it takes hangs on which is there, {names}")


def _leaves_its_own(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """Finding that is doubtful since the rest still depends on the quantity that it acts by.

    A robot comes to other places as time goes by, so that a place may stand for the time, and a
    while for a place.
    """
    acts_by = _acts_by(finding.effect)
    if _is_placed(finding.effect):
        acts_by |= BY[TIME]
    if lasts_for_a_while(finding.effect):
        acts_by |= BY[PLACE]
    for group in rest.depends_on:
        if BY.get(group, set()) & acts_by and _much_left_by(rest, group):
            why = f"what is left still depends on {group}, so that it may have another form"
            return doubted(finding, why, wrong_form=finding.share < SETTINGS.nearly_all)
    return None


def _is_second(finding: Finding, found: Sequence[Finding], rest: Rest) -> Finding | None:
    """A better finding of the same of KINDS does already what this one does.

    Where a kind needs three, not even the best of them is sure.
    """
    for of_kind, does, what in KINDS:
        alike = [f for f in found if of_kind(f.effect)]
        if finding in alike[1:]:
            first = alike[0].effect
            return doubted(finding, f"{first} {does}, too: both may be one other {what}")
        if finding in alike and len(alike) >= SETTINGS.of_a_kind:
            names = ", ".join(f.effect for f in alike[1:])
            return doubted(finding, f"{names}: each {does}, too: all may be one other {what}")
    return None


FORM_RULES = (
    _swings,
    _heading_is_late,
    _is_of_an_uneven_wheel,
    _leaves_what_depends_on_speed,
    _leaves_what_couples_the_axes,
    _comes_and_goes,
    _is_no_loss,
    _is_of_a_place_that_changes,
    _is_some_moments,
    _is_beside_doubtful_of_its_kind,
    _is_beside_larger_group,
    _leaves_its_own,
    _is_second,
)


def _much_left_by(rest: Rest, group: str) -> bool:
    """True if a group takes much of the rest; without formulas for it that is not known."""
    taken = (rest.left_over or {}).get(group, 1.0)
    return rest.share > SETTINGS.nothing_left and taken > SETTINGS.form_takes


def _alike_losses(found: Sequence[Finding]) -> list[Finding]:
    """Findings of a moment, and those of a place that are as large as one of a moment.

    Or that are doubtful, and take so much that they stand for something.

    None of a moment that ends where another begins: together they are one of another form.
    """
    events = [f for f in found if with_role(f.effect, "moment")]
    events = [f for f in events if not any(_adjoin(f, other) for other in events)]

    def as_large(finding: Finding) -> bool:
        own, *_ = finding.parameters
        losses = [f.parameters[0] for f in events]
        if events and finding.certainty == "doubtful" and finding.share > SETTINGS.much_left:
            return True
        known = own.value > SETTINGS.within * own.std
        return known and any(
            abs(own.value - e.value) < SETTINGS.within * np.hypot(own.std, e.std) for e in losses
        )

    places = [f for f in found if with_role(f.effect, "place") and as_large(f)]
    return [*events, *places]


def _adjoin(one: Finding, other: Finding) -> bool:
    """True if one of two findings of a moment ends where the other begins."""
    (begin_s, *end_s), (again_s, *over_s) = map(_when_s, (one, other))
    pairs = [*((e, again_s) for e in end_s), *((o, begin_s) for o in over_s)]
    return one is not other and any(abs(a - b) < PAUSE_S for a, b in pairs)


def _when_s(finding: Finding) -> list[float]:
    """When it begins and, if it does, ends, s since the first command."""
    keys = with_role(finding.effect, "moment")
    return [e.value for e in finding.parameters if key_of(e.name) in keys]


def beside_more(found: Sequence[Finding], rest: Rest, cards: Mapping[str, dict]) -> list[Finding]:
    """Findings, doubtful where much is left, or more than all of them take, and it is no noise.

    A lag is doubtful where much is left at all: something else at changes of the command is late,
    too. Numbers of the base are where they alone were found: they take a part of most that is left.
    So they are where more is left than they take.

    Args:
        found: in the order of worth.
        rest: what is left.
        cards: of effects, with the parameters that this robot's wheels have.
    """
    alone = all(f.effect == REFIT for f in found)
    effects = [f for f in found if f.effect != REFIT]
    taken = sum(f.share for f in effects)
    unsure = sum(f.share for f in effects if f.certainty == "doubtful")
    sure = taken - unsure
    no_noise = bool(rest.firm or rest.depends_on)

    def judged(finding: Finding) -> Finding:
        if finding.effect == REFIT:
            something = no_noise and rest.share > SETTINGS.nothing_left
            less = finding.share < rest.share and rest.share > SETTINGS.nothing_left
            why = "something else is left, a part of which these numbers may stand for"
            return doubted(finding, why) if (alone and something) or less else finding
        if rest.share > taken and no_noise:
            why = "more is left than it takes, so that it may be a part of something else"
            return doubted(finding, why, depends_on=_depends_on(finding.effect))
        much = no_noise and rest.share > SETTINGS.much
        if much and rest.share + unsure > sure:
            return doubted(finding, "more is left or doubtful than is sure, and it is no noise")
        if much and (why := _unusual(cards[finding.effect], finding.parameters)):
            return doubted(finding, why)
        if rest.firm and rest.share > SETTINGS.lag_leaves and _is_late(finding.effect):
            why = "much is left: something else at changes of the command may be late"
            return doubted(finding, why, wrong_form=not rest.moments)
        if rest.share > SETTINGS.much_left:
            return doubted(finding, "much is left, so that it may be a part of something else")
        return finding

    return [judged(f) for f in found]


def of_no_right_model(found: Sequence[Finding], rest: Rest, score: float) -> list[Finding]:
    """Findings, doubtful where the model with all of them is none that is right.

    What is left may be something else, where it depends on something.

    Args:
        found: of which many that are doubtful were judged.
        rest: what is left.
        score: held out, of that model.
    """
    told = rest.depends_on and not rest.likely
    if told or score <= SETTINGS.no_right_model or rest.share <= SETTINGS.left_by_right:
        return list(found)
    why = f"the score that is left is {score:.2f}, and that of a right model is 1"
    return [doubted(f, why) if f.certainty == "sure" and f.effect != REFIT else f for f in found]


def of_many(found: Sequence[Finding]) -> list[Finding]:
    """Findings, as of another form where they are many, or two of a kind, and not one is sure.

    So many faults at once are rarer than one that the catalogue does not have, and of which each
    takes a part.
    """
    effects = [f for f in found if f.effect != REFIT]
    doubtful = all(f.certainty == "doubtful" for f in effects)
    alike = any(sum(of(f.effect) for f in effects) > 1 for of, *_ in KINDS)
    if not doubtful or not (alike or len(effects) >= SETTINGS.of_a_kind):
        return list(found)
    why = "so many doubtful effects together may be one that is none of them"
    return [f if f.effect == REFIT else doubted(f, why, wrong_form=True) for f in found]


def acted_on(found: Sequence[Finding], least: float) -> list[str]:
    """Dependences of the first doubtful finding that takes so much; empty if there is none.

    A robot comes to other places as time goes by: beside what is of a place, what is of a moment
    tells nothing.
    """
    taking = [f for f in found if f.certainty == "doubtful" and f.share >= least]
    placed = any(_is_placed(f.effect) for f in taking)
    telling = [f for f in taking if not (placed and with_role(f.effect, "moment"))]
    names = (f.depends_on or _depends_on(f.effect) for f in telling)
    return [n for n in names if n][:1]


def _depends_on(effect: str) -> str:
    """On what the motion depends if an effect is there; empty where its card does not say."""
    return next((on for words, on in ACTS_ON if words <= _acts_by(effect)), "")


def _acts_by(effect: str) -> set[str]:
    """Quantities that the effect's card names as causes; none for a refit, which has no card."""
    card = catalogue().get(effect, {"identify": (), "needs": "", "family": ""})
    return {*card["identify"], card["needs"], card["family"]}


def _is_late(effect: str) -> bool:
    """True if all of the motion comes late, at every change of the command."""
    always = {"changes", "steps"} <= _acts_by(effect) and "spin" not in _acts_by(effect)
    return bool(late_part(effect)) or always


def _is_placed(effect: str) -> bool:
    """True if it changes with the place in the room."""
    return "places" in _acts_by(effect)


def _is_event(effect: str) -> bool:
    """True if it is at a place or from a moment on."""
    return any(with_role(effect, role) for role in WHERE_OR_WHEN)


def _rubs(effect: str) -> bool:
    """True if it is friction that a drive straight ahead shows at several speeds."""
    return {"friction", "straight", "levels"} <= _acts_by(effect)


def _is_timed(effect: str) -> bool:
    """True if it changes with the time that the robot has been driving."""
    return bool(BY[TIME] & _acts_by(effect))


def _is_slow(effect: str) -> bool:
    """True if it changes all the time that the robot has been driving, from no moment on."""
    return _is_timed(effect) and not with_role(effect, "moment")


# Effects of which a second one may be the rest of the first in another form: what they act by.
KINDS = (
    (bends_speed, "bends the speed over the command", "curve"),
    (_is_late, "is late at changes of the command", "lag"),
    (_is_placed, "changes with the place", "floor"),
    (_is_timed, "changes with time", "loss"),
)


def _lateness_s(finding: Finding) -> float:
    """By how much a finding makes the motion later; 0 where it makes nothing late."""
    part = late_part(finding.effect)
    return next((e.value for e in finding.parameters if part and key_of(e.name) == part[1]), 0.0)
