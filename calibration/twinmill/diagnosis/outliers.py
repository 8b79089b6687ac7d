# SPDX-License-Identifier: Apache-2.0
"""Robots that differ from the others of their kind, how, and what difference would have shown.

The common model is held. On each robot alone its own gains are tried, of all its speed or by axis,
and, beside gains of its own within the spread of a kind, every effect of the catalogue. What a
robot would take sets it apart if it is far from what each of the others would take: far over its
own uncertainty and over the spread of the others, all parameters of an effect together (Mahalanobis
1936). Runs of one robot are compared as robots are.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.chance import chi2_above
from twinmill.data.measurement import Measurement
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.screening import screen
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, State, Trial, cross_validate, fitted
from twinmill.fitting.opening import OWN, Opened, wide_gains, with_own_lags
from twinmill.model.parameters import (
    BASE_GAINS,
    GAINS,
    LAG_EFFECT,
    Parameter,
    ParameterEstimate,
    catalogue,
    catalogue_name,
    drives_sideways,
    effect_parameters,
    key_of,
    newest_instance,
)
from twinmill.predict.datasets import Trajectory, total_score

TRIED = 3
WHEELS = "wheel_gain"
OF_GAINS = {"gains": GAINS, "axes": BASE_GAINS}  # trials of gains alone: of all its speed, by axis
SIDES = {
    ("fl", "rl"): "left wheels",
    ("fr", "rr"): "right wheels",
    ("fl", "fr"): "front wheels",
    ("rl", "rr"): "rear wheels",
}


def middle_and_scale(values: list[float]) -> tuple[float, float]:
    """Median, and a standard deviation by the median absolute one (Rousseeuw and Croux 1993)."""
    middle = np.median(values)
    return float(middle), float(1.4826 * np.median(np.abs(np.array(values) - middle)))


def odd_ones(away: dict[int, float]) -> set[int]:
    """Those that are more than `odd` scales off: the worst, and always fewer than half."""
    worst = sorted(away, key=lambda i: -away[i])[: max(len(away) - 1, 0) // 2]
    return {i for i in worst if away[i] > SETTINGS.odd}


@dataclass(frozen=True)
class Outlier:
    """One robot that differs.

    Attributes:
        effect: what sets it apart: effects, or gains; None if nothing that was tried does.
        parameters: of its own.
        score_before, score_after: held out, with the model of all and with its own.
        score_others: of the others with the model of all.
        p_value: chance of such a difference among as many robots that are alike.
        sentence: in plain words.
        why: in numbers.
        smallest_shown: by effect the smallest difference that this log would have shown.
        beside: what else is its own: speed and turn over the model's, its motor lag.
        models: with what all lack and its own, one for each log; none where its camera differs.
        log_name, log_sha256: of the only run in which it differs; empty where it does in all.
    """

    robot_id: int
    effect: str | None
    parameters: list[ParameterEstimate]
    score_before: float
    score_after: float
    score_others: float
    p_value: float
    sentence: str
    why: str
    smallest_shown: dict[str, float]
    beside: list[ParameterEstimate]
    models: Sequence[native.Model] = ()
    log_name: str = ""
    log_sha256: str = ""

    @property
    def label(self) -> str:
        """The robot as channels name it, such as R03."""
        return f"R{self.robot_id:02d}"

    def of_run(self, run: Measurement) -> "Outlier":
        """Outlier from one run of a robot."""
        told = self.sentence.partition(": ")[2]
        return replace(
            self,
            robot_id=run.track.robot_id,
            sentence=f"Run {run.log_name} differs: {told}",
            log_name=run.log_name,
            log_sha256=run.log_sha256,
        )

    @property
    def by_gains(self) -> bool:
        """True if its gains alone set it apart."""
        gains = (*GAINS, *BASE_GAINS)
        return bool(self.parameters) and all(e.name in gains for e in self.parameters)

    @property
    def by_own_numbers(self) -> bool:
        """True if all its speed, its turning or its motor lag sets it apart, as runs may differ."""
        return self.effect == LAG_EFFECT or {e.name for e in self.parameters} <= {*GAINS}

    def to_json(self) -> dict:
        """Fields of the interface."""
        fields = ("robot_id", "effect", "score_before", "score_after", "p_value", "why", "sentence")
        parameters = [e.to_json() for e in self.parameters]
        return {
            **{k: getattr(self, k) for k in fields},
            "parameters": parameters,
            "smallest_shown": self.smallest_shown,
        }


@dataclass(frozen=True)
class Alone:
    """One robot alone: the common model held, its clock free.

    Attributes:
        as_all: without gains of its own.
        before: with gains of its own, as far as robots of a kind differ.
        trials: by name; effects beside such gains, a motor lag always among them.
    """

    robot_id: int
    as_all: Trial
    before: Trial
    trials: dict[str, Trial]


def one_by_one(
    opened: Sequence[Opened], done: Search, progress: Callable[[str], None] = lambda _: None
) -> list[Alone]:
    """Each robot alone with the common model; none where they are fewer than three.

    Args:
        opened: of the search, in its order.
        done: the common search.
        progress: told in words what is being done.
    """
    if len(_ids(opened)) < SETTINGS.fewest_robots:
        return []
    return _each_alone(opened, done.last.state, progress)


def outliers(alone: Sequence[Alone]) -> list[Outlier]:
    """Robots that differ; never as many as half."""
    found = [off for a in alone if (off := _judged(a, alone))]
    found.sort(key=lambda off: off.p_value)
    return found[: max(len(alone) - 1, 0) // 2]


def spread_of_lags_s(alone: Sequence[Alone]) -> float:
    """Standard deviation of the motor lags among robots of a kind; 0 where they may be one.

    By the chi2 test of one common value, and if lags of their own explain more than chance in two
    robots at least.
    """
    trials = [a.trials[LAG_EFFECT] for a in alone]
    if sum(t.evidence > SETTINGS.odd_evidence for t in trials) < 2:
        return 0.0
    lags_s, variances = np.array([(v[0], s[0, 0]) for v, s in map(_values, trials)]).T
    middle_s = np.average(lags_s, weights=1 / variances)
    one_lag = chi2_above(np.sum((lags_s - middle_s) ** 2 / variances), len(trials) - 1)
    return float(np.std(lags_s, ddof=1)) if one_lag < SETTINGS.odd_chance else 0.0


def odd_of_two(
    opened: Sequence[Opened],
    first: State,
    good: float,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Outlier]:
    """The robot of two that the model as given misses, where it predicts the other one.

    Two robots do not tell which of them is odd; a model that one of them follows does.

    Args:
        opened: of two robots; for other numbers there is no answer.
        first: the state with the model as given.
        good: score up to which the model predicts a robot.
        progress: told in words what is being done.
    """
    if len(_ids(opened)) != 2:
        return []
    alone = _each_where_some_follow(opened, first, good, progress)
    if not alone:
        return []
    off = _judged(max(alone, key=lambda a: a.before.held_score), alone)
    return [off] if off and off.effect else []


def odd_runs(
    opened: Sequence[Opened],
    first: State,
    good: float,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Outlier]:
    """Runs of one robot that the model as given misses, where it predicts others, and by what.

    None of those that nothing explains: what they have the others may not show.

    Args:
        opened: logs of one robot; of others, and of tables, there is no answer.
        first: the state with the model as given.
        good: score up to which the model predicts a run.
        progress: told in words what is being done.
    """
    if len(opened) < 2 or len(_ids(opened)) != 1 or not all(o.floor for o in opened):
        return []
    runs = [_as_robot(o, k) for k, o in enumerate(opened)]
    alone = _each_where_some_follow(runs, first, good, progress)
    usual = [a for a in alone if a.as_all.held_score <= good]
    missed = [_simplest(a) for a in alone if a.as_all.held_score > good]
    found = []
    for a in missed:
        off = _judged(a, [a, *usual])
        explained = off is not None and off.effect and off.score_after <= good
        if explained and _is_of_it_alone(a, off, usual):
            found.append(off.of_run(opened[a.robot_id].measurement))
    return found


def _as_robot(own: Opened, number: int) -> Opened:
    """A run under a number of its own, to be compared with others as robots are."""
    track = replace(own.track, robot_id=number)
    return replace(own, measurement=replace(own.measurement, track=track))


def _is_of_it_alone(own: Alone, off: Outlier, usual: Sequence[Alone]) -> bool:
    """True if another run surely lacks the oddity; a run that cannot show it may have it."""
    trial = "gains" if off.by_own_numbers else "axes"
    name = trial if off.by_gains else off.effect
    mine, spread = _apart(own.trials[name])
    others = [_apart(a.trials[name]) for a in usual]
    aways = [(mine - theirs) @ np.linalg.pinv(spread + s) @ (mine - theirs) for theirs, s in others]
    return any(chi2_above(float(away), len(mine)) < SETTINGS.odd_chance for away in aways)


def _simplest(own: Alone) -> Alone:
    """Prefers gains and lag tried alone, if nothing else does better than one of them."""
    plain = {name: own.trials[name] for name in ("gains", LAG_EFFECT)}
    plain_cost, cost = (
        min(t.fit.held_cost for t in trials.values()) for trials in (plain, own.trials)
    )
    return replace(own, trials=plain) if plain_cost < cost + SETTINGS.tie else own


def anew(
    off: Outlier, opened: Sequence[Opened], common: native.Model, lag_std_s: float = 0.0
) -> Outlier:
    """Outlier with its numbers fitted beside another model of all than it was judged with.

    What the others have may have moved since; numbers beside what was before would not fit to it.

    Args:
        off: as it was judged, with what it differs in.
        opened: its logs, with gains of its own.
        common: model of all, which has the effect of this robot as well.
        lag_std_s: among the others, where each of them has a motor lag of its own; else 0.
    """
    names = (off.effect,) if off.effect and not off.by_gains else ()
    own = [o.with_model(common) for o in opened]
    if lag_std_s and names != (LAG_EFFECT,):
        own = with_own_lags(own, lag_std_s)
    data = [_without_gains(o.data) if off.by_gains else o.data for o in own]
    free = tuple(p for name in names for p in _begun_at(off, common, name))
    trial = replace(fitted(State(data, [o.model for o in own], free)), names=names)
    if off.by_gains:
        trial = _with_gains(trial, [e.name for e in off.parameters])
    if not off.effect:
        beside, after = _own_numbers(trial), trial.held_score
        return replace(off, score_after=after, beside=beside, models=trial.fit.models)
    parameters, after = _estimates(trial), trial.held_score
    return replace(
        off,
        parameters=parameters,
        score_after=after,
        sentence=_plain(off.robot_id, parameters, common),
        why=_why(off.score_before, off.score_others, off.effect, after),
        beside=_own_numbers(trial),
        models=_models(trial, parameters),
    )


def _begun_at(off: Outlier, common: native.Model, effect: str) -> list[Parameter]:
    """Free parameters of an effect in another model, begun where it was found."""
    found = {key_of(e.name): e.value for e in off.parameters}
    free = effect_parameters(common, newest_instance(common, effect))
    return [p.at(found.get(key_of(p.name), p.value)) for p in free]


def _ids(opened: Sequence[Opened]) -> list[int]:
    return sorted({o.track.robot_id for o in opened if o.floor})


def _each_where_some_follow(
    opened: Sequence[Opened], first: State, good: float, progress: Callable[[str], None]
) -> list[Alone]:
    """Each robot as `_each_alone` has it, if the first state predicts one and misses another."""
    scores = [fitted(_alone_state(opened, first, i)).held_score for i in _ids(opened)]
    return _each_alone(opened, first, progress) if min(scores) <= good < max(scores) else []


def _each_alone(
    opened: Sequence[Opened], state: State, progress: Callable[[str], None]
) -> list[Alone]:
    """Each robot with what may set some robot apart tried on it."""
    before = {}
    for i in _ids(opened):
        progress(f"robot {i} alone")
        before[i] = fitted(_alone_state(opened, state, i, gains=True))
    names = _suspects(before, progress)
    alone = []
    for i, own in before.items():
        progress(f"robot {i} alone")
        as_all = fitted(_alone_state(opened, state, i))
        trials = {n: cross_validate(own, (n,)) for n in dict.fromkeys([*names, LAG_EFFECT])}
        axes = drives_sideways(as_all.state.model)
        gains = {n: _with_gains(as_all, g) for n, g in OF_GAINS.items() if n == "gains" or axes}
        alone.append(Alone(i, as_all, own, {**gains, **trials}))
    return alone


def _alone_state(
    opened: Sequence[Opened], state: State, robot_id: int, gains: bool = False
) -> State:
    """One robot's data with the state's model; free are its clock and, if asked, its gains."""
    own = [i for i, o in enumerate(opened) if o.floor and o.track.robot_id == robot_id]
    data, models = [], []
    for i in own:
        data.append(opened[i].data if gains else _without_gains(opened[i].data))
        model = state.models[i].copy()
        for name in GAINS:
            model.set(name, 1.0)
        models.append(model)
    return State(data, models, (), (), state.excluded)


def _without_gains(data: Trajectory) -> Trajectory:
    return replace(data, own=tuple(p for p in data.own if p.name not in GAINS))


def _suspects(before: dict[int, Trial], progress: Callable[[str], None]) -> list[str]:
    """Effects that some robot would take beyond doubt, by the linear screening: the surest first.

    A weak wheel is the most frequent fault, and is always tried.
    """
    worth: dict[str, list[float]] = {}
    for robot_id, trial in before.items():
        progress(f"screening robot {robot_id}")
        for s in screen(trial):
            worth.setdefault(s.name, []).append(s.gain)
    # What all robots would take alike is no difference.
    apart = {n: max(g) - np.median(g) for n, g in worth.items()}
    best = sorted(
        (n for n in apart if apart[n] > SETTINGS.odd_evidence / 2 and n != REFIT),
        key=lambda n: -apart[n],
    )
    wheels = [WHEELS] if WHEELS in apart else []
    return [*wheels, *[n for n in best if n != WHEELS][:TRIED]]


def _with_gains(as_all: Trial, names: Sequence[str]) -> Trial:
    """Gains of its own, however large."""
    free = wide_gains(as_all.state.model, names)
    state = replace(as_all.state, free=free)
    fit = state.fit_of(free).fit()
    evidence = as_all.fit.held_cost - fit.held_cost
    return Trial(("gains",), fit, replace(state, models=fit.models), evidence, evidence, 0.0)


def _values(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """(k,) values and (k, k) covariance of what a trial added.

    Wheels have all that they lack: what they have in common may have gone into the robot's gains.
    """
    count = len(trial.state.free)
    total = np.eye(count, len(trial.fit.x))
    speed = [c for c, u in enumerate(trial.fit.unknowns) if u.parameter.name == GAINS[0]]
    if trial.names == (WHEELS,) and speed:
        total[:, speed] = 1 / len(speed)
    values = total @ trial.fit.x - total[:, count:].sum(axis=1)
    return values, total @ trial.fit.covariance @ total.T


def _apart(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Changes that compare robots: of wheels how they differ, since speed is the robots' own."""
    values, spread = _values(trial)
    if trial.names != (WHEELS,):
        return values, spread
    centred = np.eye(len(values)) - 1 / len(values)
    return centred @ values, centred @ spread @ centred


def _judged(own: Alone, alone: Sequence[Alone]) -> Outlier | None:
    """The robot as an outlier, or None: of what sets it apart the most probable.

    A lag in which all robots differ sets none apart; what imitates that is no fault of one. Gains
    by axis that do no better than one of all speed are that one.
    """
    best, best_name, best_p = None, "", 1.0
    by_gains = own.trials["gains"].evidence
    for name, trial in own.trials.items():
        if trial.evidence < SETTINGS.odd_evidence:
            continue
        if name == "axes" and trial.evidence < by_gains + SETTINGS.tie:
            continue
        p_value = _p_value(own, name, alone)
        better = best is None or trial.fit.held_cost < best.fit.held_cost
        if p_value < SETTINGS.odd_chance and better:
            best, best_name, best_p = trial, name, p_value
    lag = own.trials[LAG_EFFECT]
    of_all = spread_of_lags_s(alone) > 0 and best_name != LAG_EFFECT
    if of_all and lag.fit.held_cost < (best or own.before).fit.held_cost - SETTINGS.tie:
        return None
    if best is None or _stands_out(best.held_score, alone):
        return _unexplained(own, alone)
    parameters = _estimates(best)
    after = best.held_score
    before = own.as_all.held_score
    others = total_score([a.as_all.held_score for a in alone if a is not own])
    effect = " + ".join(e.name for e in parameters) if best_name in OF_GAINS else best_name
    return Outlier(
        robot_id=own.robot_id,
        effect=effect,
        parameters=parameters,
        score_before=before,
        score_after=after,
        score_others=others,
        p_value=best_p,
        sentence=_plain(own.robot_id, parameters, own.as_all.state.model),
        why=_why(before, others, effect, after),
        smallest_shown=_smallest(own),
        beside=[] if best_name in OF_GAINS else _own_numbers(best),
        models=_models(best, parameters),
    )


def _why(before: float, others: float, effect: str, after: float) -> str:
    return (
        f"its errors are {before:.2f} times the floor with the model of all, those of the others "
        f"{others:.2f}; with {effect} of its own {after:.2f}"
    )


def _own_numbers(trial: Trial) -> list[ParameterEstimate]:
    """Gains and lag that stood beside an effect; beside wheels no gains, they are in these."""
    own = trial.fit.own_estimates(0)
    gone = GAINS if trial.names == (WHEELS,) else ()
    return [own[name] for name in OWN if name in own and name not in gone]


def _models(trial: Trial, parameters: Sequence[ParameterEstimate]) -> list[native.Model]:
    """Model of each log at these values; gains that wheels were told beside are in theirs."""
    if trial.names != (WHEELS,):
        return trial.fit.models
    models = [m.copy() for m in trial.fit.models]
    for model in models:
        for name, value in [(g, 1.0) for g in GAINS] + [(e.name, e.value) for e in parameters]:
            model.set(name, value)
    return models


def _p_value(own: Alone, name: str, alone: Sequence[Alone]) -> float:
    """Chance that a robot like the others is so far from them, for all robots and trials."""
    mine, spread = _apart(own.trials[name])
    theirs = np.array([_apart(a.trials[name])[0] for a in alone if a is not own])
    middle = np.median(theirs, axis=0)
    scale = np.array([middle_and_scale(list(column))[1] for column in theirs.T])
    usual = np.array([p.std for p in own.trials[name].state.free])
    of_gains = dict.fromkeys(OF_GAINS, SETTINGS.spread)
    least = {**of_gains, WHEELS: SETTINGS.spread / 2}.get(name, SETTINGS.spread_of_effects * usual)
    total = spread + np.diag(np.maximum(scale, least) ** 2)
    away = float((mine - middle) @ np.linalg.solve(total, mine - middle))
    free = len(mine) - (name == WHEELS)
    return float(min(1.0, len(alone) * len(own.trials) * chi2_above(away, free)))


def _estimates(trial: Trial) -> list[ParameterEstimate]:
    """Estimates of the parameters that a trial added."""
    found = trial.fit.shared_estimates()
    if trial.names != (WHEELS,):
        return found
    values, spread = _values(trial)
    stds = np.sqrt(np.diag(spread))
    return [
        replace(e, value=float(v), std=float(s), seen=True)
        for e, v, s in zip(found, values, stds, strict=True)
    ]


def _usual(alone: Sequence[Alone]) -> tuple[float, float]:
    """Median and scale of the logarithm of the robots' scores."""
    return middle_and_scale([np.log(max(a.before.held_score, 1.0)) for a in alone])


def _stands_out(score: float, alone: Sequence[Alone]) -> bool:
    """True if a robot of such a score is missed by far more than the others are."""
    middle, scale = _usual(alone)
    return np.log(max(score, 1.0)) - middle > max(SETTINGS.odd * max(scale, 0.06), np.log(1.5))


def _unexplained(own: Alone, alone: Sequence[Alone]) -> Outlier | None:
    """A robot whose errors stand out although nothing that was tried explains them.

    What takes a part of them and leaves the robot far from all others is not what it has.
    """
    before = own.before.held_score
    if not _stands_out(before, alone):
        return None
    others = float(np.exp(_usual(alone)[0]))
    return Outlier(
        robot_id=own.robot_id,
        effect=None,
        parameters=[],
        score_before=before,
        score_after=before,
        score_others=others,
        p_value=SETTINGS.odd_chance,
        sentence=f"R{own.robot_id:02d} differs, and no effect of the catalogue explains how.",
        why=f"its errors are {before:.2f} times the floor, those of the others {others:.2f}; "
        "pushes and bumps by others would look so",
        smallest_shown=_smallest(own),
        beside=_own_numbers(own.before),
        models=own.before.fit.models,
    )


def _smallest(own: Alone) -> dict[str, float]:
    """Four standard deviations of each first parameter: less would not have been beyond doubt."""
    shown = {}
    for trial in own.trials.values():
        _, spread = _values(trial)
        for p, variance in zip(trial.state.free, np.diag(spread), strict=True):
            shown[p.name] = float(4 * np.sqrt(variance))
    return shown


# -- plain words --------------------------------------------------------------------------------


def _plain(robot_id: int, parameters: Sequence[ParameterEstimate], common: native.Model) -> str:
    """A sentence on a robot, by its own numbers beside those of all."""
    axes = {e.name: e for e in parameters if e.name in BASE_GAINS}
    words = _axis_words(axes, common) if axes else in_words(parameters)
    return f"R{robot_id:02d}: {words}."


def in_words(parameters: Sequence[ParameterEstimate]) -> str:
    """Action of an effect's parameters on a robot, in words; only those that say something."""
    of_wheels = {key_of(e.name): e.value for e in parameters if _of_wheel(e)}
    if words := _side_words(of_wheels) or _odd_wheel_words(of_wheels):
        return words
    told = [e for e in parameters if abs(_away(e)) > max(2 * e.std, _least(e))]
    told = told or sorted(parameters, key=lambda e: -abs(_away(e)) / max(e.std, 1e-9))[:1]
    gains = {e.name: e.value - 1 for e in told if e.name in GAINS}
    if gains:
        return " and ".join(_gain_words(gains))
    wheels = {key_of(e.name): e.value for e in told if _of_wheel(e)}
    if wheels:
        return _wheel_words(wheels)
    said: dict[str, list[str]] = {}
    for e in told:
        said.setdefault(_effect_words(e), []).append(_number(e))
    return "; ".join(f"{words} ({', '.join(numbers)})" for words, numbers in said.items())


def _of_wheel(estimate: ParameterEstimate) -> bool:
    return estimate.name.startswith(f"{WHEELS}.")


def _away(estimate: ParameterEstimate) -> float:
    """Distance of a value from neutral."""
    if estimate.name in GAINS:
        return estimate.value - 1
    effect, key = catalogue_name(estimate.name), key_of(estimate.name)
    return estimate.value - _entry(effect, key)["neutral"]


def _entry(effect: str, key: str) -> dict:
    """A parameter's card; that of a wheel of another robot says no more than its name."""
    plain = {"name": key, "neutral": 0.0, "above": f"{key} strong", "below": f"{key} weak"}
    return next((p for p in catalogue()[effect]["parameters"] if p["name"] == key), plain)


def _least(estimate: ParameterEstimate) -> float:
    """Least distance from neutral that is put into words."""
    return 2 * SETTINGS.spread if estimate.name in GAINS or _of_wheel(estimate) else 0.0


def _axis_words(gains: Mapping[str, ParameterEstimate], common: native.Model) -> str:
    """Axes on which a robot differs from the others; at least that on which it surely does most."""
    away = {n: (e.value / common.get(n) - 1, e.std / common.get(n)) for n, e in gains.items()}
    told = [n for n, (by, std) in away.items() if abs(by) > max(2 * std, 2 * SETTINGS.spread)]
    told = told or [max(away, key=lambda n: abs(away[n][0]) / max(away[n][1], 1e-9))]
    return " and ".join(_gain_words({n: away[n][0] for n in told}))


def _gain_words(gains: dict[str, float]) -> list[str]:
    words = {
        GAINS[0]: ("drives {:.0f} % faster", "drives {:.0f} % slower"),
        GAINS[1]: ("turns {:.0f} % more", "turns {:.0f} % less"),
        BASE_GAINS[0]: ("drives {:.0f} % faster ahead", "drives {:.0f} % slower ahead"),
        BASE_GAINS[1]: ("drives {:.0f} % faster sideways", "drives {:.0f} % slower sideways"),
        BASE_GAINS[2]: ("turns {:.0f} % more", "turns {:.0f} % less"),
    }
    return [words[n][v < 0].format(100 * abs(v)) + " than the others" for n, v in gains.items()]


def _side_words(wheels: dict[str, float]) -> str:
    """Wheels of a side that are alike, as those of two-wheeled robots are, are one thing."""
    left, right = (
        [wheels[w] for w in side if w in wheels] for side in (("fl", "rl"), ("fr", "rr"))
    )
    if not left or not right:
        return ""
    means = {"left": float(np.mean(left)), "right": float(np.mean(right))}
    apart = abs(means["left"] - means["right"])
    if apart < 2 * SETTINGS.spread or max(np.ptp(left), np.ptp(right)) > apart / 3:
        return ""
    small, large = sorted(means, key=lambda side: abs(means[side]))
    if abs(means[small]) < apart / 4:
        weak = "weak" if means[large] < 0 else "strong"
        return f"{large} wheels {100 * abs(means[large]):.0f} % {weak}"
    weak, other = sorted(means, key=means.get)
    return f"{weak} wheels {100 * apart:.0f} % weaker than the {other} ones"


def _odd_wheel_words(wheels: dict[str, float]) -> str:
    """One of four wheels, where the others are alike, and not as the model: all drive a bit off."""
    if len(wheels) < 4:
        return ""
    rest = {w: [v for other, v in wheels.items() if other != w] for w in wheels}
    odd = min(wheels, key=lambda w: np.ptp(rest[w]))
    others = float(np.mean(rest[odd]))
    apart = wheels[odd] - others
    alike = np.ptp(rest[odd]) < min(abs(apart) / 3, 2 * SETTINGS.spread)
    if not alike or abs(others) < SETTINGS.spread or abs(apart) < 2 * SETTINGS.spread:
        return ""
    name = _entry("wheel_gain", odd)["below"].removesuffix(" weak")
    return (
        f"{name} {100 * abs(apart):.0f} % {'weaker' if apart < 0 else 'stronger'} than the others"
    )


def _wheel_words(wheels: dict[str, float]) -> str:
    """Wheels in words; two of one side that agree are named together."""
    for pair, side in SIDES.items():
        values = [wheels.get(w) for w in pair]
        if set(wheels) == set(pair) and values[0] * values[1] > 0:
            mean = float(np.mean(values))
            return f"{side} {100 * abs(mean):.0f} % {'weak' if mean < 0 else 'strong'}"
    entry = {w: _entry("wheel_gain", w) for w in wheels}
    told = sorted(wheels, key=lambda w: -abs(wheels[w]))
    return ", ".join(
        f"{entry[w]['below' if wheels[w] < 0 else 'above']} by {100 * abs(wheels[w]):.0f} %"
        for w in told
    )


def _effect_words(estimate: ParameterEstimate) -> str:
    effect, key = catalogue_name(estimate.name), key_of(estimate.name)
    p = _entry(effect, key)
    return p["above" if _away(estimate) > 0 else "below"] or catalogue()[effect]["phrase"]


def _number(estimate: ParameterEstimate) -> str:
    return f"{estimate.name} {estimate.value:.3g}{estimate.of_unit}"
