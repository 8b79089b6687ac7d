# SPDX-License-Identifier: Apache-2.0
"""State of a search, and trials of it with something added, ready to be fitted."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.detection_fit import DetectionFit
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.parameters import (
    CAMERA_STAGES,
    LAG,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    base_lag_is_identifiable,
    base_parameters,
    begun_about,
    begun_at,
    catalogue_name,
    effect_names,
    effect_parameters,
    is_local,
    needing,
    newest_instance,
)
from twinmill.predict.datasets import Dataset, Trajectory, total_score
from twinmill.predict.detections import Detections

REFIT = "refit"  # the base's numbers were stale: a candidate like any effect
REFIT_IN_WORDS = "stale numbers of the base"
SECONDS = 3.0  # of a log, in which what happened in a moment is seen


@dataclass(frozen=True)
class State:
    """Where a search stands: data sets, a model for each, and what is free in all of them.

    Attributes:
        base: names of the base's numbers that a refit sets free.
        excluded: effects that are no candidates.
        told_speeds: the speeds of the base's duties are held as other logs told them.
    """

    datasets: Sequence[Dataset]
    models: Sequence[native.Model]
    free: tuple[Parameter, ...]
    base: tuple[str, ...] = ()
    excluded: frozenset[str] = frozenset()
    told_speeds: bool = False

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
        """True if the data are detections."""
        return isinstance(self.datasets[0], Detections)

    def fit_of(self, free: Sequence[Parameter]) -> ScoreFit | DetectionFit:
        """Fit of these parameters to the data, by the kind of data."""
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
            while or is at a place without the 3 s with the most, if enough is left.
        blocks_t: t of the relative fall over blocks.
        less: the same refitted without an effect, by its name, as far as that was asked for.
    """

    names: tuple[str, ...]
    fit: ScoreFit | DetectionFit
    state: State
    evidence: float
    without_best: float
    blocks_t: float
    less: dict[str, "Trial | None"] = field(default_factory=dict, repr=False, compare=False)

    @property
    def held_score(self) -> float:
        """On parts that were not fitted to."""
        return total_score(self.fit.held_scores)


def estimates_of(trial: Trial, name: str) -> list[ParameterEstimate]:
    """Estimates of an effect of a trial, of several instances the newest one's; or of its base."""
    estimates = trial.fit.shared_estimates()
    if name == REFIT:
        return [e for e in estimates if e.name in trial.state.base]
    instance = newest_instance(trial.state.model, name)
    return [e for e in estimates if e.name.startswith(f"{instance}.")]


def fitted(state: State) -> Trial:
    """The state's free parameters fitted."""
    fit = state.fit_of(state.begun()).fit()
    return Trial((), fit, replace(state, models=fit.models), 0.0, 0.0, 0.0)


def fitted_from(state: State, last: Trial) -> Trial:
    """The state's free parameters fitted, begun where another trial has them."""
    values = {p.name: last.state.model.get(p.name) for p in last.state.free}
    models = []
    for model in state.models:
        model = model.copy()
        for p in state.free:
            model.set(p.name, values.get(p.name, p.value))
        models.append(model)
    return fitted(replace(state, models=models))


def on_base_of(first: State, last: Trial, names: Collection[str]) -> Trial:
    """A trial's effects refitted with these numbers of the base as another state has them."""
    models = []
    for model, given in zip(last.state.models, first.models, strict=True):
        model = model.copy()
        for name in names:
            model.set(name, given.get(name))
        models.append(model)
    free = tuple(p for p in last.state.begun() if p.name not in names)
    return fitted(replace(last.state, models=models, free=free))


def with_base(trial: Trial, names: Sequence[str]) -> tuple[ScoreFit, ScoreFit]:
    """All that a trial has fitted with these numbers of the base, and the fit that was held out.

    Never to a worse score held out than the trial's: then its values stand, with their errors.
    """
    state = trial.state
    held = {p.name for p in state.free} | {p.name for d in state.datasets for p in d.own}
    held |= set() if base_lag_is_identifiable(state.model) else {LAG}
    free = [*state.begun(), *base_parameters(state.model, [n for n in names if n not in held])]
    whole = ScoreFit(state.datasets, state.models, free).fit()
    if total_score(whole.held_scores) <= trial.held_score:
        return whole, whole
    pairs = zip(state.datasets, state.models, strict=True)
    begun = [replace(d, own=tuple(p.at(m.get(p.name)) for p in d.own)) for d, m in pairs]
    as_found = ScoreFit(begun, state.models, free)
    as_found.store()
    return as_found, trial.fit


def nearer(state: State) -> State:
    """The state with gains of the base that are far off nearer, where a fit of it finds the rest.

    What their priors said was of another robot.
    """
    if state.of_cameras:
        return state
    near = state.fit_of(state.begun()).nearer()
    models = [m.copy() for m in state.models] if near else state.models
    for model, (name, value) in product(models, near.items()):
        model.set(name, value)
    return replace(state, models=models, free=tuple(begun_about(state.free, near)))


def begun_nearer(given: State, start: State) -> bool:
    """True if gains of the base were far off, so that a search started elsewhere than given."""
    names = [p.name for p in given.free]
    pairs = zip(given.models, start.models, strict=True)
    return any(a.get(name) != b.get(name) for a, b in pairs for name in names)


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
        fresh = begun_at(fresh, start or {})
        for model in models:
            for p in fresh:
                model.set(p.name, p.value)
        free += fresh
    pairs = zip(state.datasets, models, strict=True)
    datasets = [d.with_own_start(m) if isinstance(d, Trajectory) else d for d, m in pairs]
    return replace(state, datasets=datasets, models=models, free=tuple(free))


def cross_validate(
    before: Trial, names: tuple[str, ...], start: dict[str, float] | None = None
) -> Trial:
    """A fit of the state before with something added, judged on held-out parts."""
    state = with_effects(before.state, names, start)
    if REFIT in names:
        state = nearer(state)
    fit = state.fit_of(state.begun())
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
    """Evidence for what is local, without the SECONDS with the most; 0 for all else.

    A while or a visit may lie within one block. What happened in a moment is seen for two seconds.
    """
    if len(names) > 1 or not is_local(names[0]):
        return 0.0
    logs = [d for d in state.datasets if isinstance(d, Trajectory)]
    least = []
    for shift in (0.0, 0.5):
        numbers = [((d.start_s - d.start_s[0]) / SECONDS + shift).astype(int) for d in logs]
        blocks = [np.repeat(p, d.measured[0].size) for p, d in zip(numbers, logs, strict=True)]
        least.append(fit.least_against(before.fit, blocks))
    return min(least)


def without_effect(trial: Trial, name: str) -> Trial | None:
    """The trial's state without an effect, refitted once; None if it is not in the model."""
    if name not in trial.less:
        trial.less[name] = _without_effect(trial, name)
    return trial.less[name]


def _without_effect(trial: Trial, name: str) -> Trial | None:
    names = effect_names(trial.state.model)
    own = [i for i, n in enumerate(names) if catalogue_name(n) == name]
    if not own:
        return None
    models = []
    for model in trial.state.models:
        model = model.copy()
        model.remove_effect(own[-1])
        models.append(model)
    free = tuple(p for p in trial.state.begun() if not p.name.startswith(f"{names[own[-1]]}."))
    return fitted(replace(trial.state, models=models, free=free))
