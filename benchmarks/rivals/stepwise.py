# SPDX-License-Identifier: Apache-2.0
"""Forward selection by F test over the catalogue: the textbook's way (Draper and Smith 1998)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy.stats import f as f_distribution

from rivals.protocol import DOCUMENTED, TUNED, Answer, Problem, Rival, predicted_by
from rivals.residual import scale
from twinmill.data.measurement import Measurement
from twinmill.model.parameters import (
    BASE_GAINS,
    MOTION_STAGES,
    Parameter,
    base_parameters,
    catalogue,
    catalogue_of,
    effect_names,
    effect_parameters,
    making_late,
    needing,
)
from twinmill.predict.windows import HORIZONS_S, Windows, difference

AHEAD_S = 0.5  # errors of windows that follow each other
REFINED = 5  # candidates that are fitted in each round: those that a straight line likes best
NEWTON_STEPS = 3
MOST = 4
ALPHA = {DOCUMENTED: 0.05, TUNED: 1e-6}  # see README
PLACES_M = (-0.3, 0.0, 0.3)  # where in the room an effect of a place is begun
NOT_MOTION = {"equation", "collision", "clock_rate"}
# What an effect depends on, by what its card says that it needs.
DEPENDS = {
    "room": ("place", "heading"),
    "heading": ("heading",),
    "changes": ("change", "past"),
    "history": ("time", "past"),
    "battery": ("battery", "time"),
    "wheel_angle": ("wheel angle",),
    "steady_speed": ("speed",),
    "poses": ("past",),
    "clocks": ("change",),
}


def answers(problem: Problem) -> dict[str, Answer]:
    """With both limits."""
    path = selected(problem, max(ALPHA.values()))
    return {s: _answer(problem, path, alpha) for s, alpha in ALPHA.items()}


@dataclass(frozen=True)
class Stage:
    """A model on the way, the effect that was added last, and the chance of its F by noise."""

    model: native.Model
    effect: str = ""
    p: float = 0.0


@dataclass
class Errors:
    """Whitened errors of a log's windows as functions of a model's numbers."""

    measurement: Measurement
    windows: Windows
    measured: np.ndarray
    by: np.ndarray

    @classmethod
    def of(cls, measurement: Measurement, model: native.Model) -> "Errors":
        """Windows of AHEAD_S that do not overlap."""
        every = Windows.of(measurement.track)
        h = HORIZONS_S.index(AHEAD_S)
        kept, last_s = [], -np.inf
        for k, start in enumerate(every.starts):
            if every.ends[k, h] >= 0 and measurement.track.pose_t_s[start] > last_s + AHEAD_S - 0.1:
                kept.append(k)
                last_s = measurement.track.pose_t_s[start]
        windows = Windows(every.starts[kept], np.ascontiguousarray(every.ends[kept][:, [h]]))
        measured = windows.measured(measurement)
        left = difference(measured, windows.predicted(measurement, model))[:, 0]
        return cls(measurement, windows, measured, scale(left))

    def __call__(self, model: native.Model) -> np.ndarray:
        """(3 W,) errors."""
        off = difference(self.measured, self.windows.predicted(self.measurement, model))
        return (off[:, 0] / self.by).ravel()

    def change(self, model: native.Model, parameter: Parameter, step: float) -> np.ndarray:
        """(3 W,) by which the errors change for each unit of a parameter."""
        moved = model.copy()
        value = float(np.clip(model.get(parameter.name) + step, parameter.min, parameter.max))
        if value == model.get(parameter.name):
            value = model.get(parameter.name) - step
        moved.set(parameter.name, value)
        return (self(moved) - self(model)) / (value - model.get(parameter.name))


def f_test(before: float, after: float, added: int, left: int) -> float:
    """Chance that noise lets the sum of squares fall so by so many added columns.

    Args:
        before: sum of squares.
        after: the same with the columns.
        added: columns.
        left: degrees of freedom that remain.
    """
    value = (before - after) / added / (after / left)
    return float(f_distribution.sf(max(value, 0.0), added, left))


def selected(problem: Problem, alpha: float) -> list[Stage]:
    """The stages of a forward selection, the first without an effect."""
    model = problem.model.copy()
    errors = Errors.of(problem.measurement, model)
    free = base_parameters(model, BASE_GAINS)
    model, square = _fitted(errors, model, free)
    path = [Stage(model)]
    for _ in range(MOST):
        tried = _candidates(problem.measurement, errors, path[-1].model, free)
        tried = [row for row in tried if row[1] not in {stage.effect for stage in path}]
        best: tuple[float, float, native.Model, str, list[Parameter]] | None = None
        for start, name, own in tried[:REFINED]:
            fitted, after = _fitted(errors, start, [*free, *own])
            left = errors.by.size * len(errors.measured) - len(free) - len(own)
            row = (f_test(square, after, len(own), left), after, fitted, name, own)
            best = row if best is None or row[:2] < best[:2] else best
        if best is None or best[0] >= alpha:
            break
        p, square, model, name, own = best
        free = [*free, *own]
        path.append(Stage(model, name, p))
    return path


def _candidates(
    measurement: Measurement, errors: Errors, model: native.Model, free: Sequence[Parameter]
) -> list[tuple[native.Model, str, list[Parameter]]]:
    """Models with one effect more at its default, the one whose straight line fits best first."""
    left = errors(model)
    known = np.column_stack([errors.change(model, p, p.step) for p in free])
    basis = np.linalg.qr(known)[0]
    left = left - basis @ (basis.T @ left)
    found = []
    for name in _names(measurement, model):
        for start, own in _begun(model, name):
            columns = np.column_stack([_secant(errors, model, start, p) for p in own])
            columns -= basis @ (basis.T @ columns)
            if np.linalg.norm(columns) < 1e-6:
                continue
            taken = columns @ np.linalg.lstsq(columns, left, rcond=1e-6)[0]
            after = np.square(left - taken).sum()
            p = f_test(np.square(left).sum(), after, len(own), len(left) - len(free) - len(own))
            found.append((p, after, start, name, own))
    found.sort(key=lambda row: row[:2])
    best_place = {name: row for row in reversed(found) for name in [row[3]]}
    ordered = sorted(best_place.values(), key=lambda row: row[:2])
    return [(start, name, own) for _, _, start, name, own in ordered]


def _names(measurement: Measurement, model: native.Model) -> list[str]:
    """Effects that the robot can have and that its log can show."""
    one_clock = measurement.same_clock or model.clock_same
    unseen = NOT_MOTION | set(making_late("clock") if one_clock else ())
    if measurement.track.has_heading is False:
        unseen |= set(needing("heading"))
    return [
        name
        for name, entry in catalogue_of(model).items()
        if entry["stage"] in MOTION_STAGES and name not in unseen
    ]


def _begun(model: native.Model, name: str):
    """The model with the effect at its default; one of a place at each of several places."""
    grown = model.copy()
    grown.add_effect(name)
    own = effect_parameters(grown, effect_names(grown)[-1], fresh=True)
    places = [p for p in own if p.role == "place"]
    spots = [(x, y) for x in PLACES_M for y in PLACES_M] if len(places) == 2 else [()]
    for spot in spots:
        start = grown.copy()
        for p in own:
            start.set(p.name, p.value)
        for p, at in zip(places, spot, strict=len(spot) > 0):
            start.set(p.name, at)
        yield start, own


def _secant(
    errors: Errors, model: native.Model, start: native.Model, parameter: Parameter
) -> np.ndarray:
    """(3 W,) change from no effect to its default, in this parameter alone."""
    if parameter.role == "place":
        return errors.change(start, parameter, parameter.step)
    only = start.copy()
    for p in effect_parameters(start, parameter.name.split(".")[0]):
        if p.role != "place" and p.name != parameter.name:
            only.set(p.name, p.usual)
    return errors(only) - errors(model)


def _fitted(
    errors: Errors, model: native.Model, free: Sequence[Parameter]
) -> tuple[native.Model, float]:
    """Gauss-Newton with halved steps; the model and its sum of squares."""
    left = errors(model)
    for _ in range(NEWTON_STEPS):
        columns = np.column_stack([errors.change(model, p, p.step) for p in free])
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
        step = -np.linalg.lstsq(columns / size, left, rcond=1e-4)[0] / size
        for _ in range(4):
            moved = model.copy()
            for p, by in zip(free, step, strict=True):
                moved.set(p.name, float(np.clip(model.get(p.name) + by, p.min, p.max)))
            new = errors(moved)
            if np.square(new).sum() < np.square(left).sum():
                model, left = moved, new
                break
            step = step / 2
        else:
            break
    return model, float(np.square(left).sum())


def _answer(problem: Problem, path: list[Stage], alpha: float) -> Answer:
    kept = [path[0]]
    for stage in path[1:]:
        if stage.p >= alpha:
            break
        kept.append(stage)
    names = tuple(s.effect for s in kept[1:])
    words = [w for n in names for w in DEPENDS.get(catalogue()[n]["needs"], ())]
    sure = -np.log10(max(path[1].p, 1e-300)) if len(path) > 1 else 0.0
    # Where nothing enters, its user keeps the model: gains that were let free are no finding.
    model = kept[-1].model if names else problem.model
    return Answer(bool(names), float(sure), predicted_by(model), names, tuple(dict.fromkeys(words)))


RIVAL = Rival(
    name="stepwise F test",
    source="textbook; effects and plant of Twinmill",
    settings={
        DOCUMENTED: "errors 0.5 s ahead, gains free; enters at p < 0.05",
        TUNED: f"enters at p < {ALPHA[TUNED]:g}",
    },
    answers=answers,
    once=True,
)
