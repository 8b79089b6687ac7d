# SPDX-License-Identifier: Apache-2.0
"""Tests if a parameter that was found is one number, or changes with the robot's state.

An effect that stands in for other physics fits each kind of drive with another strength. Each
parameter gets a companion that is proportional to it and to what the robot was doing; a score test
asks whether that companion is zero (parameter constancy: Nyblom 1989; Zeileis and Hornik 2007).
"""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.data.track import command_at
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import Trial
from twinmill.formulas.term import PLACE, TIME
from twinmill.model.parameters import (
    Parameter,
    catalogue_name,
    effect_names,
    instance_of,
    key_of,
    needing,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
WHEELS = "wheel_gain"  # has a number of each wheel
RIM = "the speed of the wheel"
# Groups of a rest, by what a number changes with.
GROUPS = {"turning": "turning rate", "duty": "speed", RIM: "speed"}


@dataclass(frozen=True)
class Change:
    """A parameter that is not one number.

    Attributes:
        parameter: its name.
        on: what it changes with.
        relative: change per standard deviation of that, over the effect's distance from neutral.
        evidence: fall of the cost.
    """

    parameter: str
    on: str
    relative: float
    evidence: float

    @property
    def is_of_another_form(self) -> bool:
        """It is large, and not of the heading, over which a compass may err in many ways."""
        return self.on != "heading" and abs(self.relative) > SETTINGS.other_form

    @property
    def depends_on(self) -> str:
        """The group of what it changes with."""
        return GROUPS.get(self.on, self.on)

    @property
    def why(self) -> str:
        """Reason for the change, as a clause for reports."""
        way = "grows" if self.relative > 0 else "falls"
        way = "changes" if self.on in ("heading", PLACE) else way
        return (
            f"{self.parameter} {way} with {self.on} (by {100 * abs(self.relative):.0f} % for a "
            "usual difference): the same physics in another form, or another effect"
        )


@dataclass(frozen=True)
class OneHeading:
    """An error of the heading that was told along one heading alone."""

    why: str = (
        "the robot drove along one heading, where an error that changes with the heading looks "
        "the same"
    )


def changes_of(trial: Trial) -> dict[str, Change | OneHeading]:
    """The strongest change of each effect's instance that is not one number; logs alone tell.

    How late a robot is changes with its speed and load, on real robots always: of that, a change
    with the time alone is asked for.
    An error of the heading may change with it unseen where the robot drove along one.
    """
    fit = trial.fit
    logs = [i for i, d in enumerate(fit.datasets) if isinstance(d, Trajectory)]
    instances = set(effect_names(trial.state.model))
    named = [(instance_of(u.parameter.name), u.parameter.role) for u in fit.unknowns]
    sizes = {
        c: name
        for c, (name, role) in enumerate(named)
        if name in instances and role in ("size", "lateness")
    }
    if not logs or not sizes:
        return {}
    left, columns, blocks = fit.whitened(logs)
    basis = np.linalg.qr(np.vstack([columns, np.diag(1 / fit.std)]))[0]
    doing = [_doing(fit.datasets[i], fit.models[i]) for i in logs]
    found: dict[str, Change | OneHeading] = {}
    rows = [fit.datasets[i].measured[0].size for i in logs]

    def done(key: tuple[str, str]) -> np.ndarray:
        """(R,) what the robot was doing, for each row."""
        return np.concatenate([np.repeat(d[key], n) for d, n in zip(doing, rows, strict=True)])

    # Of turns alone, a turn that hangs on the heading looks the same.
    of_way = np.concatenate([fit.datasets[i].channel < 2 for i in logs])
    heading = done(("heading", "cos")) + 1j * done(("heading", "sin"))
    for c, instance in sizes.items():
        own = columns[:, c] ** 2 * of_way
        of_heading = catalogue_name(instance) in needing("heading")
        if of_heading and abs(own @ heading) > SETTINGS.one_heading * own.sum():
            found[instance] = OneHeading()
    for on, way in [key for key in doing[0] if all(key in d for d in doing)]:
        values = done((on, way))
        for c, instance in sizes.items():
            if not _may_change(fit.unknowns[c].parameter, on, way):
                continue
            change = _change(
                trial=trial,
                c=c,
                on=on,
                values=values,
                left=left,
                columns=columns,
                blocks=blocks,
                basis=basis,
            )
            if change and change.evidence > getattr(found.get(instance), "evidence", 0.0):
                found[instance] = change
    return found


def _may_change(parameter: Parameter, on: str, way: str) -> bool:
    """True if such a change of a number tells that it is not one number."""
    instance, key = instance_of(parameter.name), key_of(parameter.name)
    effect = catalogue_name(instance)
    if on == RIM:
        return (effect, key) == (WHEELS, way)
    if on == PLACE and effect in needing("places"):
        return False
    return on == TIME or not (parameter.role == "lateness" or effect in needing("clocks"))


def _doing(data: Trajectory, model: native.Model) -> dict[tuple[str, str], np.ndarray]:
    """(W,) of each thing that a parameter may change with, and of each way in which it may."""
    moved = np.nan_to_num(data.measured[:, HORIZON]) / HORIZONS_S[HORIZON]
    track = data.measurement.track
    heading_rad = np.nan_to_num(track.heading_smooth[data.windows.starts])
    found = {
        ("speed", ""): np.hypot(moved[:, 0], moved[:, 1]),
        ("turning", ""): np.abs(moved[:, 2]),
        (TIME, ""): data.start_s - data.start_s[0],
        ("heading", "cos"): np.cos(heading_rad),
        ("heading", "sin"): np.sin(heading_rad),
    }
    place_m = track.pose[data.windows.starts, :2]
    place_m = place_m - place_m.mean(axis=0)
    found[PLACE, "x"], found[PLACE, "y"] = place_m.T
    found[PLACE, "away"] = np.sum(place_m**2, axis=1)
    if track.command_kind == "duty":
        middle_s = data.start_s + HORIZONS_S[HORIZON] / 2
        found["duty", ""] = np.abs(command_at(middle_s, track.command_t_s, track.command)).max(
            axis=1
        )
    rates = np.array([model.wheel_speeds(*axis) for axis in np.eye(3)])
    for wheel, rim in zip(model.wheels(), np.abs(moved @ rates).T, strict=True):
        found[RIM, wheel["name"]] = rim  # as the captured motion rolls it, rad/s
    return found


def _change(
    trial: Trial,
    c: int,
    *,
    on: str,
    values: np.ndarray,
    left: np.ndarray,
    columns: np.ndarray,
    blocks: np.ndarray,
    basis: np.ndarray,
) -> Change | None:
    """The score test of one parameter's companion; None if the parameter is one number."""
    fit, own = trial.fit, columns[:, c]
    information = own**2 / max(float(own @ own), 1e-300)
    away = values - information @ values
    spread = float(np.sqrt(information @ away**2))
    parameter = fit.unknowns[c].parameter
    size = _size(trial, parameter)
    if spread < 1e-9 or size < 1e-9:
        return None
    companion = np.concatenate([own * away / spread, np.zeros(len(fit.x))])
    companion -= basis @ (basis.T @ companion)
    energy = float(companion @ companion) + 1e-12
    products = companion[: len(left)] * left
    total = float(products.sum())
    by_block = np.bincount(blocks, products)
    error = float(np.sqrt(np.sum((by_block - by_block.mean()) ** 2))) + 1e-12
    change = Change(parameter.name, on, -total / energy / size, total**2 / energy)
    proven = (
        change.evidence >= SETTINGS.companion_evidence
        and abs(total) >= SETTINGS.companion_t * error
    )
    return change if proven and abs(change.relative) >= SETTINGS.companion_change else None


def _size(trial: Trial, parameter: Parameter) -> float:
    """Distance from neutral of the effect's largest parameter of this unit."""
    instance, away = instance_of(parameter.name), []
    for u, value in zip(trial.fit.unknowns, trial.fit.x, strict=True):
        p = u.parameter
        alike = (p.role, p.unit) == (parameter.role, parameter.unit)
        if alike and instance_of(p.name) == instance:
            away.append(abs(value - p.usual))
    return max(away)
