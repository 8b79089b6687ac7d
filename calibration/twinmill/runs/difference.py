# SPDX-License-Identifier: Apache-2.0
"""How the numbers of one robot differ between two runs, from one fit to both.

All that a robot keeps from day to day (its table of speeds, its effects) is fitted to both runs
together; what may have changed is a number of the second run alone, or one of each run.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import twinmill_native as native

from twinmill.estimation.opened import Opened
from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.fit import base_names, effects_free
from twinmill.model.parameters import (
    BASE_GAINS,
    CLOCK,
    LAG,
    Parameter,
    base_parameters,
    begun_about,
    effect_names,
    effect_parameters,
    newest_instance,
)
from twinmill.predict.datasets import Trajectory
from twinmill.runs.white_step import white_step

MOUNTING = ("marker_offset", "heading_bias")  # effects of how the marker sits on the robot
BATTERY, WHEELS = "battery_sag", "wheel_gain"


@dataclass(frozen=True)
class Quantity:
    """A number that may differ between the runs.

    Attributes:
        key: `wheel.fl`, `sideways_gain`, `yaw_gain`, `forward_gain`, `lag_s`, `late_s`,
            `marker.x_m`, `marker.y_m` or `marker.bias_rad`.
        unit: of the difference; "1" where it is a share.
        name: in the model of the second run.
        paired: the first run has a number of that name, too; else what the second has is the
            difference.
    """

    key: str
    unit: str
    name: str
    paired: bool


@dataclass(frozen=True)
class Difference:
    """Second run less first run.

    Attributes:
        quantities: K of them.
        values: (K,) shares of the first run's value for gains, else in the unit.
        covariance: (K, K) by leaving out blocks of time.
        by_curvature: (K, K) covariance by the curvature of the cost: too wide as a whole, but it
            has an inverse where few blocks give none.
        contrast: (K, P) a unit of each unknown of the fit in them.
        fit: to both runs, the first one first.
    """

    quantities: tuple[Quantity, ...]
    values: np.ndarray
    covariance: np.ndarray
    by_curvature: np.ndarray
    contrast: np.ndarray
    fit: ScoreFit

    @cached_property
    def keys(self) -> list[str]:
        """Names of all quantities that are compared."""
        return [q.key for q in self.quantities]

    def only(self, keys: Collection[str]) -> "Difference":
        """Some quantities, whatever the others are."""
        kept = [k for k, key in enumerate(self.keys) if key in keys]
        block = np.ix_(kept, kept)
        return replace(
            self,
            quantities=tuple(self.quantities[k] for k in kept),
            values=self.values[kept],
            covariance=self.covariance[block],
            by_curvature=self.by_curvature[block],
            contrast=self.contrast[kept],
        )

    def precise(self) -> "Difference":
        """The most precise that both runs tell, with errors of their noise alone."""
        white = white_step(self.fit)
        return replace(
            self,
            values=self.values + self.contrast @ white.step,
            covariance=self.contrast @ white.covariance @ self.contrast.T,
            by_curvature=self.contrast @ white.by_curvature @ self.contrast.T,
        )


def difference(first: Opened, second: Opened) -> Difference:
    """Fits both runs together.

    Args:
        first: run of a robot, with a noise floor.
        second: another run of it, opened with the same model.
    """
    charged = charge_is_known(first, second)
    model, fresh = _with_changes(first.model, charged)
    quantities = _quantities(model, fresh, first)
    of_each = [q.name for q in quantities if q.paired and q.name != CLOCK]
    changed = [p for instance in fresh.values() for p in effect_parameters(model, instance)]
    changed = [_wide(replace(p, value=0.0)) for p in changed]
    late = [] if _clock_is_free(second) else [_wide(*base_parameters(second.model, [CLOCK]))]
    kept = {p.name for p in changed}
    opened = [o.with_fitted(_with_changes(o.model, charged)[0]) for o in (first, second)]
    own = [[_wide(p) for p in base_parameters(o.model, of_each)] for o in opened]
    own[1] += [*changed, *late]
    data = [
        replace(o.trajectory, own=(*o.trajectory.own, *more), by_run=True)
        for o, more in zip(opened, own, strict=True)
    ]
    names = [n for n in base_names(first.model, opened) if n not in of_each]
    effects = [p for p in effects_free(model, opened) if p.name not in kept]
    shared = [*base_parameters(model, names), *effects]
    return _found(quantities, _fitted(data, [o.model for o in opened], shared))


def charge_is_known(*runs: Opened) -> bool:
    """True if all runs recorded the battery's voltage, so that speeds may follow it."""
    return all(np.isfinite(mean_V(o)) for o in runs)


def mean_V(opened: Opened) -> float:
    """Mean voltage of the battery in a run; NaN where it was not recorded."""
    volts = opened.track.battery_V
    known = volts[np.isfinite(volts) & (volts > 0)]
    return float(known.mean()) if known.size else float("nan")


def follows_charge(model: native.Model) -> bool:
    """True if the battery's charge changes speeds; a controller that keeps them makes up for it."""
    return model.drive == "duty"


def _with_changes(model: native.Model, charged: bool) -> tuple[native.Model, dict[str, str]]:
    """The model with how wheels are and markers sit, and a fresh instance of each that may change.

    What it does not know of the robot, as that a wheel has always been weak, is of both runs.

    Args:
        model: of the robot.
        charged: with what the battery's voltage does, too.

    Returns:
        The model, and names of the fresh instances by effect.
    """
    model, fresh = model.copy(), {}
    own = (*([WHEELS] if model.wheel_kind != "none" else []), *MOUNTING)
    for effect in (*own, *([BATTERY] if charged and follows_charge(model) else [])):
        if effect not in effect_names(model):
            _add_neutral(model, effect)
    for effect in own:
        fresh[effect] = _add_neutral(model, effect)
    return model, fresh


def _add_neutral(model: native.Model, effect: str) -> str:
    """Adds an effect that does nothing yet, and gives its instance's name."""
    model.add_effect(effect)
    instance = newest_instance(model, effect)
    for p in effect_parameters(model, instance):
        model.set(p.name, p.usual)
    return instance


def _quantities(model: native.Model, fresh: dict[str, str], first: Opened) -> tuple[Quantity, ...]:
    gains = [n for n in base_names(model, [first]) if n in BASE_GAINS]
    if WHEELS in fresh:  # the mean of the wheels is the forward gain
        gains = [n for n in gains if n != BASE_GAINS[0]]
        wheels = [w["name"] for w in model.wheels()]
        acting = {p.name for p in effect_parameters(model, fresh[WHEELS])}
        named = [(w, f"{fresh[WHEELS]}.{w}") for w in wheels]
        found = [Quantity(f"wheel.{w}", "1", n, False) for w, n in named if n in acting]
    else:
        found = []
    found += [Quantity(n.removeprefix("base."), "1", n, True) for n in gains]
    if LAG in base_names(model, [first]):
        found.append(Quantity("lag_s", "s", LAG, True))
    found.append(Quantity("late_s", "s", CLOCK, _clock_is_free(first)))
    for effect in MOUNTING:
        own = effect_parameters(model, fresh[effect])
        found += [Quantity(f"marker.{p.name.split('.')[-1]}", p.unit, p.name, False) for p in own]
    return tuple(found)


def _clock_is_free(opened: Opened) -> bool:
    return any(p.name == CLOCK for p in opened.trajectory.own)


def _wide(p: Parameter) -> Parameter:
    """With a prior so wide that the data alone tell it, about where it is."""
    return replace(p, usual=p.value, std=(p.max - p.min) / 2)


def _fitted(
    data: Sequence[Trajectory], models: Sequence[native.Model], shared: Sequence[Parameter]
) -> ScoreFit:
    near = ScoreFit(data, models, shared).nearer()
    return ScoreFit(data, models, begun_about(shared, near)).fit()


def _found(quantities: tuple[Quantity, ...], fit: ScoreFit) -> Difference:
    contrast, values = np.zeros((len(quantities), len(fit.x))), np.zeros(len(quantities))
    for k, q in enumerate(quantities):
        (second,) = [c for c in fit.columns[1] if fit.unknowns[c].parameter.name == q.name]
        contrast[k, second] = 1.0
        before = fit.models[0].get(q.name)  # neutral where the first run has no number of its own
        if q.paired:
            (first,) = [c for c in fit.columns[0] if fit.unknowns[c].parameter.name == q.name]
            contrast[k, first] = -1.0
        if q.paired and q.unit == "1":
            contrast[k] /= before
        values[k] = contrast[k] @ fit.x - (0.0 if q.paired else before)
    _, slopes, _ = fit.whitened([0, 1])
    curvature = slopes.T @ slopes + np.diag(1 / fit.std**2)
    return Difference(
        quantities,
        values,
        contrast @ fit.covariance @ contrast.T,
        contrast @ np.linalg.pinv(curvature) @ contrast.T,
        contrast,
        fit,
    )
