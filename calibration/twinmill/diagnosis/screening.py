# SPDX-License-Identifier: Apache-2.0
"""Linear estimate of the error that each effect of the catalogue would take away."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.settings import SETTINGS, Settings
from twinmill.diagnosis.trials import REFIT, State, Trial, with_effects
from twinmill.fitting.detection_fit import DetectionFit
from twinmill.fitting.score_fit import ScoreFit
from twinmill.fitting.starts import Left, Starts, projected, starts_of
from twinmill.model.parameters import (
    LAG,
    LAG_EFFECT,
    Parameter,
    base_lag_is_identifiable,
    base_parameters,
    catalogue_name,
    catalogue_of,
    effect_names,
    effect_parameters,
    making_late,
    needing,
    with_role,
)
from twinmill.predict.datasets import thinning

SMALL = 0.05
# Usual strengths, where a stronger effect, or one the other way, is not the same made larger ...
STRONGER = (3.0, 6.0, -3.0, -6.0)
BENT = 0.9  # ... as it is below this cosine of a small part of it and of the usual strength
MOST_APART = 8  # data sets with columns of their own: those of more would fill the memory
STALE = 0.3  # of the prior's width: a usual error of the base's numbers


@dataclass(frozen=True)
class Screened:
    """Result of the linear screening for one candidate.

    Attributes:
        columns: (R, k) of all data sets, weighted, what is free projected out.
        gain: expected fall of the cost where it is small.
        size: expected fall of the cost if it had its usual strength.
        start: values that the fit begins at, by name; a place, moment or limit is searched.
        rest: squares that are left to take away.
    """

    name: str
    columns: np.ndarray
    gain: float
    size: float
    start: dict[str, float] = field(default_factory=dict)
    rest: float = np.inf

    @property
    def fall(self) -> float:
        """Expected fall of the cost, which goes by the logarithm of what is left of the squares.

        Few data, as a table's, have few squares, and yet may lose all of them.
        """
        part = self.gain / self.rest
        return self.gain if part < 1e-6 else -self.rest * float(np.log1p(-min(part, 1 - 1e-6)))


def candidates(state: State) -> list[str]:
    """Effects that could be added to the model.

    An effect that the model has with numbers that are held can be there once more: they changed.
    """
    model = state.model
    moved = {catalogue_name(p.name) for p in state.free}
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

    Signatures are seen from few starts of predictions; when and where something may have begun is
    looked for from all: a few may be all that show it.

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
    left = Left.of(fit, *projected(fit))
    few = _on_few(fit)
    basis, rest = projected(few)
    of_few = dict(
        rows=few.state[0],
        weights=[np.sqrt(few.weight(i, r)) for i, r in enumerate(few.state[0])],
        basis=basis,
        rest=rest,
    )
    on_few = replace(state, datasets=few.datasets)
    found = []
    for name in candidates(state) if names is None else names:
        if name not in starts or with_role(name, "limit"):
            of = starts_of(name, state.models, state.datasets, rows)
            starts |= {name: of} if of else {}
        start = starts[name].best(left) if name in starts else {}
        found.append(_screened(name, on_few, **of_few, start=start))
    return found


def _on_few(fit: ScoreFit) -> ScoreFit:
    return fit.thinned(thinning(fit.datasets, SETTINGS.few_starts, SETTINGS.starts_apart_s))


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
    return np.array([start.get(p.name, p.value) - _origin(p, start) for p in parameters])


def _origin(p: Parameter, start: dict[str, float]) -> float:
    """Where nothing happens; a radius that is known stays there while sizes move."""
    return start.get(p.name, p.usual) if p.role == "radius" else p.usual


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
    """Slopes at neutral, or the way to the usual strength where these say nothing of it.

    Where a stronger effect is no multiple of a weak one, as of play in a gear, or the usual way is
    barred, as to a turn that comes sooner where it comes at once, it is the way to the strength
    that takes most.
    """
    parameters, small, whole = _signatures(name, state, rows=rows, weights=weights, start=start)

    def projected(columns: np.ndarray) -> np.ndarray:
        padded = np.vstack([columns, np.zeros((len(rest) - len(columns), columns.shape[1]))])
        return padded - basis @ (basis.T @ padded)

    small, whole = projected(small), projected(whole)
    linear = small.sum(axis=1)
    size, reached = np.linalg.norm(linear), np.linalg.norm(whole)
    agree = linear @ whole[:, 0] / max(size * reached, 1e-12)
    used = small if agree > 0.5 and 1 / 3 < size / max(reached, 1e-12) < 3 else whole
    # Columns are in default strengths, and the prior's width in these.
    times = used.shape[1] // len(parameters)
    widths = np.ones(1) if used is whole else np.tile(_widths(name, parameters, start), times)
    gram = used.T @ used + np.diag(1 / widths**2)
    moment = used.T @ rest
    gain = float(moment @ np.linalg.solve(gram, moment))
    if times > 1:  # so many more columns take so much more of the noise
        gain -= (1 - 1 / times) * float(np.trace(np.linalg.solve(gram, used.T @ used)))
    size = float((whole**2).sum())
    if used is small:  # half of the prior's width is a usual strength
        size = float(np.max((small**2).sum(axis=0) * widths**2)) / 4
    if agree < BENT and len(parameters) == 1 and parameters[0].role == "size":
        for column in projected(_stronger(name, state, rows, weights)).T:
            taken = max(float(column @ rest), 0.0) ** 2 / (float(column @ column) + 1)
            if taken > gain:
                used, gain = column[:, None], taken
    return Screened(name, used, gain, size, start, float(rest @ rest))


def _stronger(
    name: str, state: State, rows: list[np.ndarray], weights: list[np.ndarray]
) -> np.ndarray:
    """(R, k) change of the rows by an effect of one number at STRONGER strengths."""
    columns = []
    for dataset, given, row, weight in zip(
        state.datasets, state.models, rows, weights, strict=True
    ):
        (p,), own, points = _points(name, state, given, {})
        values = p.usual + np.array(STRONGER)[:, None] * _reach(name, [p], {})
        changed = dataset.rows(points.model, own, np.clip(values, p.min, p.max))
        columns.append(weight[:, None] * (row - changed).T)
    return np.concatenate(columns)


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
        (R, 1) change by the usual strength of all. Where it acts by the angles at which wheels
        begin, which are not the same in all logs, the k columns of each of some data sets stand
        beside each other.
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
    if name in needing("wheel_angle") and 1 < len(small) <= MOST_APART:
        return parameters, _each_alone(small), np.concatenate(whole)
    return parameters, np.concatenate(small), np.concatenate(whole)


def _each_alone(columns: Sequence[np.ndarray]) -> np.ndarray:
    """(R, K) of (r, k) columns, each 0 on the rows of others: to import SciPy's takes 0.2 s."""
    rows, width = np.cumsum([[0, 0], *(c.shape for c in columns)], axis=0).T
    apart = np.zeros((rows[-1], width[-1]))
    for k, own in enumerate(columns):
        apart[rows[k] : rows[k + 1], width[k] : width[k + 1]] = own
    return apart


@dataclass(frozen=True)
class _Points:
    model: native.Model
    values: np.ndarray
    share: float


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
        origin = np.array([_origin(p, start) for p in parameters])
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


def promising(screened: list[Screened], settings: Settings) -> list[Screened]:
    """Those whose linear gain leaves a chance of acceptance, best first.

    Numbers of the base that nobody told may be so far off that no linear gain tells of them.
    """
    best = sorted(screened, key=lambda s: -s.gain)
    stale = [s for s in best if s.name == REFIT]
    worth = [s for s in best if s.fall > settings.evidence / 2 and s.gain > 0.02 * best[0].gain]
    return [*stale, *(s for s in worth if s.name != REFIT)]


def likely_pairs(
    before: Trial, screened: list[Screened], settings: Settings
) -> list[tuple[str, str]]:
    """Pairs by what they explain together beyond the better one alone.

    Of two that hide each other, as a lag of the drive and one of turning the other way, either
    alone takes next to nothing: so of all.
    """
    if before.held_score < 1.0 or before.state.of_cameras or len(screened) < 2:
        return []
    fit = _on_few(before.fit)
    left, *_ = fit.whitened(range(len(fit.datasets)))
    whole = np.hstack([s.columns[: len(left)] for s in screened])
    gram, moment = whole.T @ whole + 0.25 * np.eye(whole.shape[1]), whole.T @ left
    ends = np.cumsum([s.columns.shape[1] for s in screened])
    places = np.split(np.arange(whole.shape[1]), ends[:-1])
    pairs = [*combinations(range(len(screened)), 2)]
    together = _taken([np.concatenate([places[a], places[b]]) for a, b in pairs], gram, moment)
    worth = {
        (screened[a].name, screened[b].name): float(taken) - max(screened[a].gain, screened[b].gain)
        for (a, b), taken in zip(pairs, together, strict=True)
    }
    best = sorted(worth, key=lambda pair: -worth[pair])
    return [p for p in best if worth[p] > settings.evidence][: settings.pairs]


def _taken(sets: Sequence[np.ndarray], gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """(S,) what each set of columns explains; those of one size are solved together."""
    taken = np.empty(len(sets))
    sizes = np.array([len(own) for own in sets])
    for size in np.unique(sizes):
        members = np.flatnonzero(sizes == size)
        own = np.array([sets[k] for k in members])
        pull = moment[own]
        square = gram[own[:, :, None], own[:, None, :]]
        taken[members] = np.sum(pull * np.linalg.solve(square, pull[..., None])[..., 0], axis=1)
    return taken
