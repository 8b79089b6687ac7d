# SPDX-License-Identifier: Apache-2.0
"""Searches for what a model lacks, by the score on parts of the data that were not fitted to.

In each round every candidate is screened by what it would take away if all were linear; the best
are fitted. One is accepted if its held-out evidence is beyond doubt, blocks agree on it, and it
matters. Afterwards those that later ones made needless are dropped.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS, Settings
from twinmill.diagnosis.starts import MARGIN, Left, Starts, starts_of
from twinmill.fitting.detection_fit import DetectionFit
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.parameters import (
    CAMERA_STAGES,
    GAINS,
    LAG,
    LAG_EFFECT,
    WHERE_OR_WHEN,
    Parameter,
    all_effect_parameters,
    base_lag_is_identifiable,
    base_parameters,
    catalogue,
    catalogue_of,
    effect_names,
    effect_parameters,
    lasts_for_a_while,
    making_late,
    needing,
    newest_instance,
    with_role,
)
from twinmill.predict.datasets import Dataset, Trajectory, total_score
from twinmill.predict.detections import Detections

REFIT = "refit"  # the base's numbers were stale: a candidate like any effect
REFIT_IN_WORDS = "stale numbers of the base"
SECONDS = 3.0  # of a log, in which what happened in a moment is seen
PAUSE_S = 2.0  # between the end of what lasts for a while and its next begin


@dataclass(frozen=True)
class State:
    """Where a search stands: data sets, a model for each, and what is free in all of them."""

    datasets: Sequence[Dataset]
    models: Sequence[native.Model]
    free: tuple[Parameter, ...]
    base: tuple[str, ...] = ()
    excluded: frozenset[str] = frozenset()

    @property
    def model(self) -> native.Model:
        """The common model: of a robot of which nothing special is stated, if there is one."""
        ids = [d.robot_id for d in self.datasets]
        stated = [len(m.stated_of(i)) for m, i in zip(self.models, ids, strict=True)]
        return self.models[int(np.argmin(stated))]

    @property
    def by_channel(self) -> bool:
        """Logs have enough errors for a scale of each channel; tables do not."""
        return all(isinstance(d, Trajectory) for d in self.datasets)

    @property
    def of_cameras(self) -> bool:
        """Whether the data are detections."""
        return isinstance(self.datasets[0], Detections)

    def fit_of(self, free: Sequence[Parameter]) -> ScoreFit | DetectionFit:
        """What fits these parameters to the data, by the kind of data."""
        if self.of_cameras:
            return DetectionFit(self.datasets, self.models, free)
        return ScoreFit(self.datasets, self.models, free, self.by_channel)

    def begun(self) -> tuple[Parameter, ...]:
        """Free parameters, begun at the model's values."""
        return tuple(p.at(self.model.get(p.name)) for p in self.free)


def camera_state(
    cameras: Sequence[Detections], model: native.Model, excluded: Collection[str] = ()
) -> State:
    """Where a search for what the camera lacks starts: its effects are free, all else is held.

    Args:
        cameras: frames with poses; at least one robot's.
        model: of all robots.
        excluded: effects that are not considered.
    """
    raw = all(c.frames.has_raw for c in cameras)
    hidden = {*excluded, *(() if raw else needing("raw_frames"))}
    free = tuple(all_effect_parameters(model, CAMERA_STAGES))
    models = [model.for_robot(c.robot_id) for c in cameras]
    return State(cameras, models, free, excluded=frozenset(hidden))


@dataclass(frozen=True)
class Trial:
    """A fit with something added.

    Attributes:
        names: what was added: effects, or REFIT.
        fit: of all free parameters.
        state: with the fitted models.
        evidence: fall of the held-out cost against the state it started from.
        without_best: the same without the block with the most evidence for it; of what lasts for a
            while without the 3 s with the most, if enough is left.
        blocks_t: t of the relative fall over blocks.
    """

    names: tuple[str, ...]
    fit: ScoreFit | DetectionFit
    state: State
    evidence: float
    without_best: float
    blocks_t: float

    @property
    def held_score(self) -> float:
        """On parts that were not fitted to."""
        return total_score(self.fit.held_scores)


@dataclass(frozen=True)
class Screened:
    """What the linear screening says of one candidate.

    Attributes:
        columns: (R, k) of all data sets, weighted, what is free projected out.
        gain: expected fall of the cost.
        size: expected fall of the cost if it had its usual strength.
        start: values that the fit begins at, by name; a place, moment or limit is searched.
    """

    name: str
    columns: np.ndarray
    gain: float
    size: float
    start: dict[str, float] = field(default_factory=dict)


@dataclass
class Round:
    """One step of a search."""

    before: Trial
    screened: list[Screened]
    trials: list[Trial]
    accepted: Trial | None = None
    tied: list[Trial] = field(default_factory=list)

    def p_value(self, trial: Trial) -> float:
        """Bound of the chance of such evidence if nothing were missing, for all candidates."""
        return float(min(1.0, len(self.screened) * np.exp(-max(trial.evidence / 2, 0.0))))


@dataclass
class Search:
    """A whole search: rounds, the last trial, and what was dropped again."""

    rounds: list[Round]
    last: Trial
    dropped: list[str]
    settings: Settings

    @property
    def found(self) -> list[str]:
        """Names accepted and kept, in order."""
        names = [n for r in self.rounds if r.accepted for n in r.accepted.names]
        return [n for n in names if n not in self.dropped]

    def round_of(self, name: str) -> Round:
        """The last round in which an effect was accepted."""
        return next(r for r in reversed(self.rounds) if r.accepted and name in r.accepted.names)

    @property
    def faint(self) -> list[tuple[str, str]]:
        """Effects that could be there and not be seen, and why."""
        hidden = []
        for s in self.rounds[-1].screened:
            if s.name == REFIT:
                continue
            if s.size < 1e-6:
                hidden.append((s.name, "the data have no drive on which it acts"))
            elif self.settings.traced**2 * s.size < self.settings.faint:
                hidden.append((s.name, "even three times its usual size would not be visible"))
        return hidden

    @property
    def passes(self) -> int:
        """How often a plant ran over a whole data set, on the average."""
        fits = [t.fit for r in self.rounds for t in (r.before, *r.trials)]
        return round(sum(f.passes for f in fits) / max(len(self.last.state.datasets), 1))


def search(
    state: State,
    progress: Callable[[str], None] = lambda _: None,
    settings: Settings = SETTINGS,
    known: float = 1.0,
) -> Search:
    """Adds what is missing until nothing is worth it.

    Args:
        state: where it starts.
        progress: told in words what is being done.
        settings: numbers that decide.
        known: score that the model has on the logs that it was fitted to; 0 where none is known.
            What it missed there it misses here, too, and in the same way over and over, so that
            evidence must be stronger where the score is no worse than that.
    """
    before = fitted(state)
    if before.held_score < settings.news * known:
        settings = settings.stricter(settings.usual * known)
    rounds: list[Round] = []
    dropped: list[str] = []
    starts: dict[str, Starts] = {}
    first_excess = max(before.held_score**2 - 1, 0.0)
    for number in range(settings.most):
        progress(f"round {number + 1}: screening the catalogue")
        screened = screen(before, starts)
        this = Round(before, screened, [])
        rounds.append(this)
        for candidate in _promising(screened, settings)[: settings.fitted]:
            progress(f"round {number + 1}: trying {candidate.name}")
            this.trials.append(cross_validate(before, (candidate.name,), candidate.start))
        this.accepted = _best(before, this.trials, first_excess, settings)
        if this.accepted is None:
            progress(f"round {number + 1}: trying pairs")
            for pair in _pairs(before, screened, settings):
                this.trials.append(cross_validate(before, pair))
            this.accepted = _best(before, this.trials, first_excess, settings)
        this.trials.sort(key=lambda t: t.fit.held_cost)
        if this.accepted is None:
            break
        this.tied = _tied(this, settings)
        before, gone = _pruned(
            this.accepted,
            [n for r in rounds for n in r.accepted.names if n not in dropped],
            settings,
        )
        dropped += gone
    progress("exchanging what was found for other effects")
    found = [n for r in rounds if r.accepted for n in r.accepted.names if n not in dropped]
    before, kept = _exchanged(rounds, before, found=found, starts=starts, settings=settings)
    accepted = [n for r in rounds if r.accepted for n in r.accepted.names]
    return Search(rounds, before, [n for n in accepted if n not in kept], settings)


# -- trials -------------------------------------------------------------------------------------


def fitted(state: State) -> Trial:
    """The state's free parameters fitted."""
    fit = state.fit_of(state.begun()).fit()
    return Trial((), fit, replace(state, models=fit.models), 0.0, 0.0, 0.0)


def with_effects(
    state: State, names: Sequence[str], start: dict[str, float] | None = None
) -> State:
    """The state with effects added at where their fit begins, or the base set free."""
    models = [m.copy() for m in state.models]
    free = list(state.begun())
    for name in names:
        if name == REFIT:
            free += base_parameters(
                models[0], [n for n in state.base if n not in {p.name for p in free}]
            )
            continue
        for model in models:
            model.add_effect(name)
        fresh = effect_parameters(models[0], effect_names(models[0])[-1], fresh=True)
        fresh = [p.at((start or {}).get(p.name, p.value)) for p in fresh]
        for model in models:
            for p in fresh:
                model.set(p.name, p.value)
        free += fresh
    return replace(state, models=models, free=tuple(free))


def cross_validate(
    before: Trial, names: tuple[str, ...], start: dict[str, float] | None = None
) -> Trial:
    """A fit of the state before with something added, judged on held-out parts."""
    state = with_effects(before.state, names, start)
    fit = state.fit_of(state.free)
    fit.begin_at_best(state.free[len(before.state.free) :])
    fit.fit()
    after = replace(state, models=fit.models)
    evidence, without_best, blocks_t = fit.against(before.fit)
    within = _without_best_seconds(names, after, fit, before)
    if within > SETTINGS.lasts * evidence:
        without_best = max(without_best, within)
    return Trial(names, fit, after, evidence, without_best, blocks_t)


def _without_best_seconds(
    names: Sequence[str], state: State, fit: ScoreFit | DetectionFit, before: Trial
) -> float:
    """Evidence for what lasts for a while, without the SECONDS with the most; 0 for all else.

    A while may lie within one block. What happened in a moment is seen for two seconds.
    """
    if len(names) > 1 or not lasts_for_a_while(names[0]):
        return 0.0
    logs = [d for d in state.datasets if isinstance(d, Trajectory)]
    least = []
    for shift in (0.0, 0.5):
        numbers = [((d.start_s - d.start_s[0]) / SECONDS + shift).astype(int) for d in logs]
        blocks = [np.repeat(p, d.measured[0].size) for p, d in zip(numbers, logs, strict=True)]
        least.append(fit.least_against(before.fit, blocks))
    return min(least)


def _best(
    before: Trial, trials: list[Trial], first_excess: float, settings: Settings
) -> Trial | None:
    """Of those with enough evidence, and that matter, the one with the least held-out cost.

    Of two that do as well, the one with fewer numbers.
    """
    good = []
    for trial in trials:
        if trial.names == (REFIT,) and _is_common(before, trial, settings):
            good.append(trial)
            continue
        if not _matters(before, trial, first_excess, settings):
            continue
        at_nothing = all(_is_neutral(trial, n) or _began_before(trial, n) for n in trial.names)
        if not at_nothing and _proven(trial, before.held_score, settings):
            good.append(trial)
    best = min(good, key=lambda t: _cost(t, settings), default=None)
    # Stale numbers of the base are more likely than an effect that does the same.
    stale = [
        t
        for t in good
        if t.names == (REFIT,) and t.fit.held_cost - best.fit.held_cost < settings.tie
    ]
    return stale[0] if stale else best


def _began_before(trial: Trial, name: str) -> bool:
    """An effect of a moment that is hardly within the logs: it is there all the time, or never."""
    if not with_role(name, "moment"):
        return False
    logs = [d for d in trial.state.datasets if isinstance(d, Trajectory)]
    times_s = np.concatenate([d.start_s for d in logs])
    low_s, high_s = np.quantile(times_s, (MARGIN, 1 - MARGIN))
    return not all(low_s < t_s < high_s for t_s in _when_s(trial, name))


def _when_s(trial: Trial, name: str) -> list[float]:
    """Moments at which an effect begins and ends, s since the first command."""
    model = trial.state.model
    instance = newest_instance(model, name)
    return [model.get(f"{instance}.{key}") for key in with_role(name, "moment")]


def comes_again(done: Search, name: str) -> tuple[float, float] | None:
    """When an effect that begins and ends comes a second time, s since the first command.

    None if it does not, or if the second time touches the first, which is another form of one.
    """
    if name not in done.found or not lasts_for_a_while(name):
        return None
    (again,) = screen(done.last, names=[name])
    trial = cross_validate(done.last, (name,), again.start)
    (begin_s, end_s), (again_s, over_s) = _when_s(done.last, name), _when_s(trial, name)
    apart_s = max(again_s - end_s, begin_s - over_s)
    fresh = _proven(trial, done.last.held_score, done.settings) and not _began_before(trial, name)
    return (again_s, over_s) if fresh and apart_s > PAUSE_S else None


def _is_common(before: Trial, refit: Trial, settings: Settings) -> bool:
    """Whether the base's numbers take what each robot's own gains took, and all took alike.

    That makes no prediction better; it is far more likely than as many robots that are no usual
    ones.
    """
    own = any(p.name in GAINS for d in before.state.datasets for p in d.own)
    as_good = refit.held_score < settings.common * before.held_score
    return own and as_good and refit.evidence > settings.evidence


def _matters(before: Trial, trial: Trial, first_excess: float, settings: Settings) -> bool:
    """Whether the addition is worth its words, by the fall of the squared score or detections."""
    if before.state.of_cameras:
        return _changes_enough_bits(before, trial, settings)
    fall = before.held_score**2 - trial.held_score**2
    return fall > 0 and fall >= _least_fall(before, trial, first_excess, settings) * len(
        trial.names
    )


def _changes_enough_bits(before: Trial, trial: Trial, settings: Settings) -> bool:
    """Whether it changes more detections than clock errors of a few ms and blurred poses do."""
    seen = before.fit.in_view
    least = min(settings.bits, settings.bits_in_view * min(seen, 1 - seen))
    own = [e for e in trial.fit.shared_estimates() if e.name.split(".")[0] in trial.names]
    by_clock = any(e.unit == "s" and abs(e.value) < settings.late_s for e in own)
    by_clock &= any(d.clock_free for d in trial.fit.datasets)
    return trial.fit.changed(before.fit) > least and not by_clock


def _least_fall(before: Trial, trial: Trial, first_excess: float, settings: Settings) -> float:
    """Least fall of the squared score that matters."""
    score = before.held_score
    if score >= 1.0:
        return min(settings.worth * first_excess, settings.enough)
    if _proven(trial, score, settings.stricter(settings.strong)):
        return settings.least_strong * score**2
    least, most = settings.least_below * score**2, settings.most_below * score**2
    return float(np.clip(settings.below * first_excess, least, most))


def _exchanged(
    rounds: list[Round],
    last: Trial,
    *,
    found: Sequence[str],
    starts: dict[str, Starts],
    settings: Settings,
) -> tuple[Trial, list[str]]:
    """The last state with each effect exchanged for another one, if that is better.

    An effect was accepted beside what was known in its round; what came later may do a part of it,
    and leave a rest that another one takes as well or better (a forward search alone cannot see
    that; Miller 2002 calls this sequential replacement). What is as good is tied.

    Returns:
        The best, and the findings that are left; an exchange is one more round.
    """
    kept = list(found)
    for name in [n for n in found if n != REFIT]:
        if name not in kept:
            continue
        base = without_effect(last, name)
        if base is None:
            continue
        others = _rivals(base, name, beside=len(kept) > 1, starts=starts, settings=settings)
        trials = [cross_validate(base, (s.name,), s.start) for s in others]
        close = [t for t in trials if _cost(t, settings) < _cost(last, settings) + settings.tie]
        if not close:
            continue
        stale = [t for t in close if t.names == (REFIT,)]
        best = min(stale or close, key=lambda t: _cost(t, settings))
        if not stale and _cost(best, settings) >= _cost(last, settings):
            this = next(r for r in reversed(rounds) if r.accepted and name in r.accepted.names)
            known = {n for t in this.tied for n in t.names}
            this.tied += [t for t in close if t.names[0] not in known]
            continue
        same = [t for t in close if _cost(t, settings) < _cost(best, settings) + settings.tie]
        if _cost(last, settings) < _cost(best, settings) + settings.tie:
            same.append(replace(last, names=(name,)))
        tied = [t for t in same if t is not best]
        rounds.append(Round(base, rounds[-1].screened, trials, best, tied))
        kept = [n for n in kept if n != name]
        last, gone = _pruned(best, kept, settings)
        kept = [*(n for n in kept if n not in gone), *best.names]
    return last, kept


def _rivals(
    base: Trial, name: str, *, beside: bool, starts: dict[str, Starts], settings: Settings
) -> list[Screened]:
    """Candidates in the place of an effect, once all else that was found is there.

    Args:
        base: the last state without the effect.
        name: of the effect.
        starts: of effects whose start is searched.
        settings: numbers that decide.
        beside: whether something else was found; if not, the first round has compared them.
    """
    late = [n for n in candidates(base.state) if with_role(n, "lateness")]
    late = [n for n in late if n != name] if with_role(name, "lateness") else []
    if not beside:
        return screen(base, starts, late) if late else []
    screened = screen(base, starts)
    own = next((s.gain for s in screened if s.name == name), 0.0)
    likely = [s for s in _promising(screened, settings) if s.gain > settings.rival * own]
    likely = [s for s in likely if s.name != name][: settings.exchanged]
    names = {s.name for s in likely}
    return likely + [s for s in screened if s.name in late and s.name not in names]


def _cost(trial: Trial, settings: Settings) -> float:
    """Held-out cost, and what its numbers cost."""
    return trial.fit.held_cost + settings.each * len(trial.fit.x)


def _proven(trial: Trial, score: float, settings: Settings) -> bool:
    """Enough evidence, and blocks that agree; near the noise agreement alone is not enough."""
    count = len(trial.names)
    enough, less = settings.evidence * count, settings.less_evidence * count
    if count == 1 and lasts_for_a_while(trial.names[0]):
        enough = less = settings.passing
    loud = trial.evidence >= enough
    somewhere = count == 1 and bool(with_role(trial.names[0], "place"))
    least = settings.without_visit if somewhere else settings.without_best
    spread = trial.without_best >= least * count
    agreed = (
        score >= settings.drowned and trial.evidence >= less and trial.blocks_t >= settings.blocks_t
    )
    return (loud and spread) or agreed


def _is_neutral(trial: Trial, name: str) -> bool:
    """An effect whose sizes are all where it does nothing explains nothing, wherever it is."""
    if name == REFIT:
        return False
    instance = newest_instance(trial.state.model, name)
    for p in catalogue_of(trial.state.model)[name]["parameters"]:
        if p["role"] in WHERE_OR_WHEN:
            continue
        value = trial.state.model.get(f"{instance}.{p['name']}")
        if abs(value - p["neutral"]) > 1e-3 * abs(p["default"] - p["neutral"]):
            return False
    return True


# -- screening ----------------------------------------------------------------------------------


def candidates(state: State) -> list[str]:
    """Effects that could be added to the model.

    An effect that the model has with numbers that are held can be there once more: they changed.
    """
    model = state.model
    moved = {p.name.split(".")[0].split("#")[0] for p in state.free}
    if model.get(LAG) == 0 and base_lag_is_identifiable(model):
        # Without a first lag, a second one is no other than the first.
        moved |= {n for n in making_late("lag") if n != LAG_EFFECT}
    names = []
    if any(n not in {p.name for p in state.free} for n in state.base):
        names.append(REFIT)
    for name, entry in catalogue_of(model).items():
        usable = entry["stage"] in state.datasets[0].stages and not entry["texts"]
        if usable and name not in moved and name not in state.excluded:
            names.append(name)
    return names


def screen(
    before: Trial, starts: dict[str, Starts] | None = None, names: Sequence[str] | None = None
) -> list[Screened]:
    """Every candidate's expected worth, by its signature over what is free.

    Args:
        before: what is free in it is projected out.
        starts: of effects whose start is searched, found in earlier rounds; new ones are added.
            What was accepted since changes little of how a patch of the floor changes the rows, but
            much of which limit is the right one.
        names: of the candidates, where not all that the state can have are meant.
    """
    fit, state = before.fit, before.state
    if state.of_cameras:
        return [_screened_bits(name, before) for name in candidates(state)]
    starts = {} if starts is None else starts
    rows, _ = fit.state
    weights = [np.sqrt(fit.weight(i, r)) for i, r in enumerate(rows)]
    left, columns, _ = fit.whitened(range(len(rows)))
    free = np.vstack([columns, np.diag(1 / fit.std)]) if len(fit.x) else np.zeros((len(left), 0))
    padded = np.concatenate([left, (fit.usual - fit.x) / fit.std * -1]) if len(fit.x) else left
    basis = np.linalg.qr(free)[0] if len(fit.x) else free
    rest = padded - basis @ (basis.T @ padded)
    ends = np.cumsum([len(r) for r in rows])[:-1]
    parts = (np.split(whole[: len(left)], ends) for whole in (rest, basis))
    what_is_left = Left(weights, *parts)
    found = []
    for name in candidates(state) if names is None else names:
        if name not in starts or with_role(name, "limit"):
            of = starts_of(name, state.models, state.datasets, rows)
            starts |= {name: of} if of else {}
        start = starts[name].best(what_is_left) if name in starts else {}
        found.append(
            _screened(name, state, rows=rows, weights=weights, basis=basis, rest=rest, start=start)
        )
    return found


def _screened_bits(name: str, before: Trial) -> Screened:
    """By a grid of values: the likelihood of detections has edges, and no signature."""
    state = with_effects(before.state, (name,))
    alone = DetectionFit(state.datasets, state.models, state.free[len(before.state.free) :])
    gain, trace = alone.promise(), alone.trace(before.fit, SETTINGS.traced)
    return Screened(name, np.zeros((0, 0)), gain, trace / SETTINGS.traced**2)


def _reach(name: str, parameters: Sequence[Parameter], start: dict[str, float]) -> np.ndarray:
    """(k,) how far from neutral the usual strength is; of the base's numbers a usual error."""
    if name == REFIT:
        return np.array([STALE * p.std for p in parameters])
    return np.array([start.get(p.name, p.value) - p.usual for p in parameters])


def _widths(name: str, parameters: Sequence[Parameter], start: dict[str, float]) -> np.ndarray:
    """(k,) standard deviations of the prior, in usual strengths."""
    reach = np.abs(_reach(name, parameters, start))
    std = np.array([p.std for p in parameters])
    return np.maximum(std / np.maximum(reach, 1e-12), 1.0)


def _screened(
    name: str,
    state: State,
    *,
    rows: list[np.ndarray],
    weights: list[np.ndarray],
    basis: np.ndarray,
    rest: np.ndarray,
    start: dict[str, float],
) -> Screened:
    """Slopes at neutral, or the way to the usual strength where these say nothing of it."""
    parameters, small, whole = _signatures(name, state, rows=rows, weights=weights, start=start)
    pad = len(rest) - len(small)
    small, whole = (np.vstack([c, np.zeros((pad, c.shape[1]))]) for c in (small, whole))
    small, whole = (c - basis @ (basis.T @ c) for c in (small, whole))
    linear = small.sum(axis=1)
    size, reached = np.linalg.norm(linear), np.linalg.norm(whole)
    agree = linear @ whole[:, 0] / max(size * reached, 1e-12)
    used = small if agree > 0.5 and 1 / 3 < size / max(reached, 1e-12) < 3 else whole
    # Columns are in default strengths, and the prior's width in these.
    widths = np.ones(used.shape[1]) if used is whole else _widths(name, parameters, start)
    gram = used.T @ used + np.diag(1 / widths**2)
    moment = used.T @ rest
    gain = float(moment @ np.linalg.solve(gram, moment))
    size = float((whole**2).sum())
    if used is small:  # half of the prior's width is a usual strength
        size = float(np.max((small**2).sum(axis=0) * widths**2)) / 4
    return Screened(name, used, gain, size, start)


def _signatures(
    name: str,
    state: State,
    *,
    rows: list[np.ndarray],
    weights: list[np.ndarray],
    start: dict[str, float],
) -> tuple[list[Parameter], np.ndarray, np.ndarray]:
    """How the rows change with what is new.

    Returns:
        Its parameters; (R, k) change by a small part of each one's usual strength, scaled up to it;
        (R, 1) change by the usual strength of all.
    """
    small, whole, parameters = [], [], []
    for dataset, model, row, weight in zip(
        state.datasets, state.models, rows, weights, strict=True
    ):
        parameters, names, points = _points(name, state, model, start)
        values = dataset.rows(points.model, names, points.values)
        steps = points.share
        small.append(weight[:, None] * (row - values[:-1]).T / steps)
        whole.append(weight[:, None] * (row - values[-1:]).T)
    return parameters, np.concatenate(small), np.concatenate(whole)


@dataclass(frozen=True)
class _Points:
    model: native.Model
    values: np.ndarray
    share: float


SMALL = 0.05
STALE = 0.3  # of the prior's width: a usual error of the base's numbers


def _points(
    name: str, state: State, model: native.Model, start: dict[str, float]
) -> tuple[list[Parameter], list[str], _Points]:
    """Parameters, their names, and values: a small step of each alone, then the usual of all."""
    model = model.copy()
    if name == REFIT:
        free = {p.name for p in state.free}
        parameters = base_parameters(model, [n for n in state.base if n not in free])
        origin = np.array([p.value for p in parameters])
    else:
        model.add_effect(name)
        parameters = effect_parameters(model, effect_names(model)[-1], fresh=True)
        origin = np.array([p.usual for p in parameters])
        for p in parameters:
            model.set(p.name, p.usual)
    reach = _reach(name, parameters, start)
    values = np.vstack([origin + SMALL * np.diag(reach), origin + reach])
    low, high = (np.array([getattr(p, k) for p in parameters]) for k in ("min", "max"))
    return (
        parameters,
        [p.name for p in parameters],
        _Points(model, np.clip(values, low, high), SMALL),
    )


def _promising(screened: list[Screened], settings: Settings) -> list[Screened]:
    """Those whose linear gain leaves a chance of acceptance, best first."""
    best = sorted(screened, key=lambda s: -s.gain)
    return [s for s in best if s.gain > settings.evidence / 2 and s.gain > 0.02 * best[0].gain]


def _pairs(before: Trial, screened: list[Screened], settings: Settings) -> list[tuple[str, str]]:
    """Pairs by what they explain together beyond the better one alone."""
    fit = before.fit
    top = sorted(screened, key=lambda s: -s.gain)[:10]
    if before.held_score < 1.0 or before.state.of_cameras:
        return []
    left, *_ = fit.whitened(range(len(fit.datasets)))
    worth = {}
    for a, b in combinations(top, 2):
        both = np.hstack([a.columns, b.columns])[: len(left)]
        gram = both.T @ both + 0.25 * np.eye(both.shape[1])
        moment = both.T @ left
        worth[a.name, b.name] = float(moment @ np.linalg.solve(gram, moment)) - max(a.gain, b.gain)
    best = sorted(worth, key=lambda pair: -worth[pair])
    return [p for p in best if worth[p] > settings.evidence][: settings.pairs]


# -- what is indistinguishable --------------------------------------------------------------------


def canonical_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Largest cosine between the smaller space and its image in the other: 1 if one imitates it.

    Smallest of the canonical correlations over the dimensions of the smaller space.
    """
    qa, qb = (_orthonormal(x) for x in (a, b))
    if not qa.shape[1] or not qb.shape[1]:
        return 0.0
    values = np.linalg.svd(qa.T @ qb, compute_uv=False)
    return float(values[: min(qa.shape[1], qb.shape[1])].min())


def _orthonormal(x: np.ndarray) -> np.ndarray:
    u, s, _ = np.linalg.svd(x, full_matrices=False)
    return u[:, s > 1e-6 * max(s[0], 1e-300)] if len(s) else u


def _tied(this: Round, settings: Settings) -> list[Trial]:
    """Other trials of the round that the data cannot tell from the accepted one."""
    accepted = this.accepted
    assert accepted is not None
    if len(accepted.names) > 1:
        return []
    if accepted.names[0] == REFIT:
        return _imitators(accepted, this.before, this.trials, settings)
    columns = {s.name: s.columns for s in this.screened}
    tied = []
    for trial in this.trials:
        if trial is accepted or len(trial.names) > 1 or trial.names[0] == REFIT:
            continue
        if _began_before(trial, trial.names[0]):
            continue
        apart, _, blocks_t = accepted.fit.against(trial.fit)
        apart += settings.each * (len(trial.fit.x) - len(accepted.fit.x))
        same = canonical_correlation(columns[accepted.names[0]], columns[trial.names[0]])
        below = max(accepted.held_score, trial.held_score) < 1.0  # differences there are no news
        close = apart < settings.tie and (blocks_t < 2.0 or below)
        rivals = close and in_common(this.before, accepted, trial) > settings.unlike
        if rivals or (same > settings.alike and apart < settings.evidence):
            tied.append((same, trial))
    nearest = sorted(tied, key=lambda pair: -pair[0])[: settings.group - 1]
    return [trial for _, trial in nearest]


def in_common(before: Trial, one: Trial, other: Trial) -> float:
    """Cosine between what two trials take of the errors: 0 if each explains something else."""
    rows = [t.fit.errors for t in (before, one, other)]
    first, second = rows[0] - rows[1], rows[0] - rows[2]
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / max(size, 1e-300)


def of_levels() -> list[str]:
    """Effects of the drive that only several levels of the command tell from other gains."""
    cards = {name: entry["identify"] for name, entry in catalogue().items()}
    return [n for n, own in cards.items() if "levels" in own and "arcs" not in own]


def _imitators(
    base: Trial, before: Trial, trials: Sequence[Trial], settings: Settings
) -> list[Trial]:
    """Trials of one effect of the levels that do what other numbers of the base do."""
    fall = before.held_score**2 - base.held_score**2
    if fall < settings.worth * before.held_score**2:  # robots' own gains took it all
        return []
    least = settings.imitates * fall
    levels = of_levels()
    alike = [
        t
        for t in trials
        if len(t.names) == 1
        and t.names[0] in levels
        and before.held_score**2 - t.held_score**2 > least
    ]
    return sorted(alike, key=lambda t: t.fit.held_cost)[: settings.group - 1]


def instead_of_drift(state: State, drifted: Trial, settings: Settings) -> list[str]:
    """Effects that do what gains do that were let drift, if the gains are held.

    Args:
        state: where a search starts, with gains that are free.
        drifted: the same fitted.
        settings: numbers that decide.
    """
    held = fitted(replace(state, free=()))
    trials = [cross_validate(held, (n,)) for n in of_levels() if n in candidates(held.state)]
    return [t.names[0] for t in _imitators(drifted, held, trials, settings)]


def _pruned(trial: Trial, names: list[str], settings: Settings) -> tuple[Trial, list[str]]:
    """Drops effects that the latest made needless."""
    gone = []
    for name in [n for n in names if n != REFIT and n not in trial.names]:
        less = without_effect(trial, name)
        if less is None:
            continue
        evidence, *_ = trial.fit.against(less.fit)
        if evidence < settings.evidence / 2:
            gone.append(name)
            trial = replace(less, names=trial.names)
    return trial, gone


def without_effect(trial: Trial, name: str) -> Trial | None:
    """The trial's state without an effect, refitted; None if it is not in the model."""
    names = effect_names(trial.state.model)
    own = [i for i, n in enumerate(names) if n.split("#")[0] == name]
    if not own:
        return None
    models = []
    for model in trial.state.models:
        model = model.copy()
        model.remove_effect(own[-1])
        models.append(model)
    free = tuple(p for p in trial.state.begun() if not p.name.startswith(f"{names[own[-1]]}."))
    return fitted(replace(trial.state, models=models, free=free))
