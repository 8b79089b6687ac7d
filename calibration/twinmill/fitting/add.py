# SPDX-License-Identifier: Apache-2.0
"""Adds an effect to a model: fitted together with the base, judged on data it was not fitted to."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import (
    base_names,
    common_clock,
    fitted,
    noise_of,
    with_estimates,
    without_held,
)
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import Opened, judged, open_measurements, wide_gains
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import Fitted, ModelError, ModelFile, write_child
from twinmill.model.parameters import (
    GAINS,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    base_parameters,
    effect_names,
    effect_parameters,
    stated_names,
)

OWN_GAINS = "gains"  # of one robot: its speed and its rate of turn


@dataclass(frozen=True)
class AddResult:
    """What adding an effect did.

    Attributes:
        effect: its name, with a number if the model had one already; or `OWN_GAINS`.
        before: comparison of the model as given; after: with the effect, all refitted.
        parameters: estimates of all that was fitted.
        heldout_before: the model as given.
        heldout_refit: its quantities refitted without the effect.
        heldout_after: refitted with it.
        path: of the new model.
        robot_id: of the robot that alone has it; None if all have.
    """

    effect: str
    before: Comparison
    after: Comparison
    parameters: list[ParameterEstimate]
    heldout_before: HeldOut
    heldout_refit: HeldOut
    heldout_after: HeldOut
    path: Path
    robot_id: int | None = None

    @property
    def label(self) -> str:
        """What was added, and to whom."""
        return self.effect if self.robot_id is None else f"{self.effect} of R{self.robot_id:02d}"

    @property
    def added(self) -> list[ParameterEstimate]:
        """Of the parameters, those that are new."""
        gains = GAINS if self.effect == OWN_GAINS else ()
        return [p for p in self.parameters if p.name in gains or _is_of(p.name, self.effect)]

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "effect": self.effect,
            "robot_id": self.robot_id,
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_before": self.heldout_before.score,
            "heldout_refit": self.heldout_refit.score,
            "heldout_after": self.heldout_after.score,
            "parameters": [e.to_json() for e in self.parameters],
            "heldout_errors_before": self.heldout_before.rows(),
            "heldout_errors_after": self.heldout_after.rows(),
        }


def add(
    effect: str,
    measurements: list[Measurement],
    model_file: ModelFile,
    out: Path,
    command: str,
    texts: dict[str, str] | None = None,
    held: Collection[str] = (),
    robot_id: int | None = None,
) -> AddResult:
    """Adds an effect and writes the new model.

    Args:
        effect: its name; of one robot also `OWN_GAINS`.
        measurements: what it is fitted to.
        model_file: the model that lacks it.
        out: the new model file.
        command: recorded in it.
        texts: the effect's formula and the like, by name.
        held: names of quantities that keep their values.
        robot_id: of the robot that alone has it; by default all have.

    Raises:
        ValueError: no such effect, it is made for another drive, or a text makes no sense.
        ModelError: the new file cannot be written, `held` names what is not fitted, or the robot
            is not in the logs or has such gains.
    """
    richer, name, fresh = with_effect(model_file.model, effect, texts or {}, robot_id)
    opened = open_measurements(measurements, model_file)
    logs = {m.log_name: m.log_sha256 for m in measurements}
    told = model_file.known_from_other_logs(logs.values())
    base = base_parameters(model_file.model, base_names(model_file.model, judged(opened), told))
    old = without_held([*base, *all_effect_parameters(model_file.model)], held)
    grown = [o.with_model(richer) for o in opened]
    if robot_id is None:
        moved, found = fitted(grown, [*old, *fresh], fresh)
    else:
        moved, found = fitted(with_own(grown, robot_id, fresh), old, fresh)
    held = [HeldOut.of(f) for f in (fitted(opened, [])[1], fitted(opened, old)[1], found)]
    before = comparison(model_file, opened)
    after = comparison(model_file, [o.realigned() for o in moved])
    estimates = found.shared_estimates()
    own = _own_estimates(found, fresh) if robot_id is not None else []
    write_child(
        model_file,
        Fitted(
            with_estimates(richer, estimates),
            [e for e in estimates if e.seen],
            logs,
            before.score,
            after.score,
            noise_of(after),
            common_clock(found),
            bool(told),
            robots={} if robot_id is None else {robot_id: own},
            covariance=found.shared_covariance(),
        ),
        out,
        command,
    )
    return AddResult(name, before, after, [*estimates, *own], *held, Path(out), robot_id)


def with_effect(
    model: native.Model, effect: str, texts: dict[str, str], robot_id: int | None
) -> tuple[native.Model, str, list[Parameter]]:
    """The model that can have it, the name that it has there, and what is to be fitted of it."""
    if effect == OWN_GAINS and robot_id is not None:
        if stated_names(model, robot_id) & set(GAINS):
            raise ModelError(f"R{robot_id:02d} has gains of its own in this model already.")
        return model, effect, list(wide_gains(model))
    richer = model.copy()
    richer.add_effect(effect, texts)
    name = effect_names(richer)[-1]
    return richer, name, effect_parameters(richer, name, fresh=True)


def with_own(opened: Sequence[Opened], robot_id: int, own: Sequence[Parameter]) -> list[Opened]:
    """The measurements, with more that is to be fitted of one robot alone.

    Raises:
        ModelError: it is in none of them.
    """
    known = {o.measurement.track.robot_id for o in opened if o.floor and o.data is not None}
    if robot_id not in known:
        names = ", ".join(f"R{i:02d}" for i in sorted(known))
        raise ModelError(f"R{robot_id:02d}: is not among the robots of these logs ({names}).")
    return [
        replace(o, data=replace(o.data, own=(*o.data.own, *own)))
        if o.floor and o.data is not None and o.measurement.track.robot_id == robot_id
        else o
        for o in opened
    ]


def _own_estimates(fit: ScoreFit, own: Sequence[Parameter]) -> list[ParameterEstimate]:
    names = {p.name for p in own}
    return [e for e in fit.estimates if e.name in names]


def _is_of(name: str, effect: str) -> bool:
    return name.startswith(f"{effect}.")
