# SPDX-License-Identifier: Apache-2.0
"""Adds an effect to a model, fits it, and judges it on data that it was not fitted to.

An effect on motion is fitted together with the base; one of the camera to detections, together with
the model's other effects of the camera.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import twinmill_native as native

from twinmill.arguments import option
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.estimation.detection_fit import DetectionFit
from twinmill.estimation.equations import check_states
from twinmill.estimation.opened import Opened
from twinmill.estimation.score_fit import ScoreFit
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import (
    Choice,
    base_names,
    common_clock,
    effects_free,
    fitted,
    noise_of,
    time_notes,
    unsteady_clocks,
    with_estimates,
)
from twinmill.fitting.formula_start import sized, with_time_constants
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import (
    judged,
    lag_is_kept,
    lateness_changes,
    open_measurements,
    untold_parts,
    wide_gains,
)
from twinmill.fitting.starts import Left, projected, starts_of
from twinmill.model.child_file import Fitted, child_of
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import (
    CAMERA_STAGES,
    GAINS,
    LEVER_EFFECT,
    WHERE_OR_WHEN,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    base_parameters,
    begun_at,
    card_of,
    catalogue_name,
    effect_names,
    effect_parameters,
    is_of_camera,
    late_part,
    numbers_of,
    stated_names,
    with_role,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.detection_errors import DetectionComparison, compared
from twinmill.predict.detections import all_detections

WORSE = 1.02  # times the held-out score; less is chance ...
AGREE_T = 2.0  # ... unless blocks agree on it by this t
OWN_GAINS = "gains"  # of one robot: its speed and its rate of turn


@dataclass(frozen=True)
class AddResult:
    """Scores before and after an effect was added, with its estimates.

    Attributes:
        effect: its name, with a number if the model had one already; or `OWN_GAINS`.
        model_name: of the model as given.
        before: comparison of the model as given; after: with the effect, all refitted. Of an effect
            of the camera, both compare detections.
        parameters: estimates of all that was fitted.
        heldout_before: the model as given.
        heldout_refit: its quantities refitted without the effect.
        heldout_after: refitted with it.
        child: the new model.
        blocks_t: how well left-out blocks agree that it predicts them better, as a t.
        robot_id: of the robot that alone has it; None if all have.
        time_notes: a sentence where numbers of time are not fitted.
    """

    effect: str
    model_name: str
    before: Comparison | DetectionComparison
    after: Comparison | DetectionComparison
    parameters: list[ParameterEstimate]
    heldout_before: HeldOut
    heldout_refit: HeldOut
    heldout_after: HeldOut
    child: ModelFile
    blocks_t: float
    robot_id: int | None = None
    time_notes: Sequence[str] = ()

    @property
    def path(self) -> Path:
        """Path of the new model."""
        return self.child.path

    @property
    def of_camera(self) -> bool:
        """True if the effect is of the camera, so that all scores are those of detections."""
        return isinstance(self.after, DetectionComparison)

    @property
    def of_motion(self) -> tuple[Comparison, Comparison] | None:
        """Comparisons of motion before and after; None of an effect of the camera."""
        before, after = self.before, self.after
        if isinstance(before, DetectionComparison) or isinstance(after, DetectionComparison):
            return None
        return before, after

    @property
    def of_detections(self) -> DetectionComparison:
        """Comparison of detections after; an effect on motion has none."""
        if not isinstance(self.after, DetectionComparison):
            raise TypeError(f"{self.effect}: acts on the motion, and is judged by poses.")
        return self.after

    @property
    def label(self) -> str:
        """Name of the added effect and of its robot."""
        return self.effect if self.robot_id is None else f"{self.effect} of R{self.robot_id:02d}"

    @property
    def notes(self) -> list[str]:
        """Sentences where left-out data gain nothing by it, or numbers of time are not fitted."""
        told = list(self.time_notes)
        without, after = self.heldout_refit.score, self.heldout_after.score
        if without > WORSE * after or (self.blocks_t > AGREE_T and after < without):
            return told
        how = "worse" if after > WORSE * without else "no better"
        return [
            *told,
            f"Held-out predictions are {how} with it ({without:.3g} to {after:.3g}): leave it out; "
            "or, if its fit began too far off, put better values into the new model with "
            "`twinmill twin set` and fit that again with `twinmill fit`.",
        ]

    @property
    def added(self) -> list[ParameterEstimate]:
        """Estimates of the parameters that are new."""
        gains = GAINS if self.effect == OWN_GAINS else ()
        return [p for p in self.parameters if p.name in gains or _is_of(p.name, self.effect)]

    def to_json(self) -> dict[str, Any]:
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
            "notes": self.notes,
            "heldout_errors_before": self.heldout_before.rows(),
            "heldout_errors_after": self.heldout_after.rows(),
            **({"bits": self.after.to_json()} if self.of_camera else {}),
        }


def add(
    effect: str,
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    *,
    out: Path,
    force: bool = True,
    **options: Any,
) -> AddResult:
    """Adds an effect and writes the new model.

    Args:
        effect: its name; of one robot also `OWN_GAINS`.
        measurements: what it is fitted to.
        model_file: the model that lacks it.
        out: the new model file.
        force: replace a file that has come to be there.
        options: as of `add_to_model`.

    Raises:
        ValueError: as of `add_to_model`.
        ModelError: likewise, or the new file cannot be written.
    """
    result = add_to_model(effect, measurements, model_file, path=Path(out), **options)
    result.child.write(force)
    return result


@np.errstate(over="ignore", invalid="ignore")  # a state may grow at some numbers that are tried
def add_to_model(
    effect: str,
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    *,
    path: Path,
    command: str,
    texts: dict[str, str] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    held: Collection[str] = (),
    robot_id: int | None = None,
) -> AddResult:
    """Adds an effect; nothing is written.

    Args:
        effect: its name; of one robot also `OWN_GAINS`.
        measurements: what it is fitted to.
        model_file: the model that lacks it.
        path: where the new model may be written.
        command: recorded in it.
        texts: the effect's formula and the like, by name.
        priors: mean and standard deviation of its parameters, by name, where they are known.
        bounds: of its parameters, by name, where they are narrower than the catalogue's.
        held: names of quantities that keep their values; beside an effect of the camera all of the
            motion do.
        robot_id: of the robot that alone has it; by default all have.

    Raises:
        ValueError: no such effect, it is made for another drive, or a text makes no sense; of the
            camera: the model has it, no log has detections, or one robot is to have it.
        ModelError: `held` names no quantity, or the robot is not in the logs or has such gains.
    """
    if is_of_camera(effect):
        if robot_id is not None:
            raise ValueError(f"{effect}: is of the camera, and is added to all robots alike.")
        return _add_to_camera(effect, measurements, model_file, path, command=command, held=held)
    richer, name, fresh = with_effect(model_file.model, effect, texts or {}, robot_id)
    if bounds:
        richer = _narrowed(model_file, richer, bounds)
        fresh = effect_parameters(richer, name, fresh=True)
    opened = open_measurements(measurements, model_file)
    logs = {m.log_name: m.log_sha256 for m in measurements}
    told = model_file.known_from_other_logs(logs.values())
    _check_told(effect, judged(opened), told)
    base = base_parameters(model_file.model, base_names(model_file.model, judged(opened), told))
    _check_not_new(held, fresh)
    usual = [*base, *effects_free(model_file.model, judged(opened))]
    old = Choice(held).of(usual, model_file.model)
    without = fitted(opened, old)[1]
    fresh = begun_at_best(effect, fresh, without, robot_id)
    enlarged = [o.with_model(richer) for o in opened]
    if texts:
        fresh = with_time_constants(fresh, texts, enlarged)
        for one in judged(enlarged):
            check_states(one.data, _begun(one.model, fresh))
        fresh = sized(fresh, enlarged)
    known = {f"{name}.{own}": prior for own, prior in (priors or {}).items()}
    fresh = Choice(priors=known).of(fresh, richer)
    if robot_id is None:
        unknown = [p for p in fresh if p.name not in known]
        moved, found = fitted(enlarged, [*old, *fresh], unknown, informed=known)
    else:
        moved, found = fitted(with_own(enlarged, robot_id, fresh), old, fresh)
    _check_acts(found, fresh, texts or {})
    given, refit, kept_out = map(HeldOut.of, (fitted(opened, [])[1], without, found))
    before = comparison(model_file, opened)
    after = comparison(model_file, [o.realigned() for o in moved], path.name)
    after = replace(after, about=robot_id)
    estimates = [*found.shared_estimates(), *found.first_phases]
    own = _own_estimates(found, fresh) if robot_id is not None else []
    kept = lag_is_kept(judged(opened), told)
    news = Fitted(
        model=with_estimates(richer, estimates),
        estimates=[e for e in estimates if e.seen],
        logs=logs,
        score_before=before.score,
        score_after=after.score,
        noise=noise_of(after),
        clock=common_clock(found),
        base_told=bool(told),
        robots={} if robot_id is None else {robot_id: own},
        covariance=found.shared_covariance(),
        shares={name: _takes(given, refit, kept_out)},
    )
    child = child_of(model_file, news, path, command)
    estimates += own
    return AddResult(
        name,
        before.model_name,
        before,
        after,
        estimates,
        given,
        refit,
        kept_out,
        child,
        blocks_t=found.against(without)[2],
        robot_id=robot_id,
        time_notes=time_notes(judged(opened), unsteady_clocks(found), kept),
    )


def _takes(given: HeldOut, without: HeldOut, found: HeldOut) -> float:
    """Share of the squared held-out error that is an effect's, not the refit's beside it."""
    return max(0.0, without.score**2 - found.score**2) / max(given.score**2, 1e-12)


def _check_told(effect: str, opened: Sequence[Opened], told: Collection[str]) -> None:
    """Raises ValueError for an effect that makes late, where no log tells by how much."""
    late = effect != OWN_GAINS and late_part(effect)
    if late and late[0] in untold_parts(opened, told):
        within = ", ".join(lateness_changes(opened))
        raise ValueError(
            f"effect '{effect}': makes the robot late, and how late it follows its commands "
            f"changes within {within}, so that no size of it holds for another log; give a log in "
            "which that does not change."
        )


def _add_to_camera(
    effect: str,
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    path: Path,
    *,
    command: str,
    held: Collection[str],
) -> AddResult:
    if effect in model_file.model.effects:
        raise ValueError(
            f"effect '{effect}': {model_file.path.name} has it already; remove its [[effect]]."
        )
    cameras = all_detections([o.modelled() for o in open_measurements(measurements, model_file)])
    if not cameras:
        raise ValueError(
            f"effect '{effect}': acts on the camera's bit, and no log has bits of a robot and the "
            "poses of another one beside it; record telemetry and poses of two robots or more."
        )
    model = model_file.model
    richer, _, fresh = with_effect(model, effect, {}, None)
    old = [p for p in all_effect_parameters(model, CAMERA_STAGES) if p.name not in held]
    as_given, without, found = (
        DetectionFit(cameras, [m.for_robot(c.robot_id) for c in cameras], free)
        for m, free in ((model, []), (model, old), (richer, [*old, *fresh]))
    )
    found.begin_at_best(fresh)
    given, refit, kept_out = (HeldOut.of(fit.fit()) for fit in (as_given, without, found))
    fitted_model = with_estimates(richer, found.estimates)
    before, after = (compared(cameras, m) for m in (model, fitted_model))
    logs = {m.log_name: m.log_sha256 for m in measurements}
    shares = {effect: _takes(given, refit, kept_out)}
    told = Fitted(fitted_model, found.estimates, logs, before.score, after.score, shares=shares)
    child = child_of(model_file, told, path, command)
    name = model_file.path.name
    return AddResult(
        effect,
        name,
        before,
        after,
        found.estimates,
        given,
        refit,
        kept_out,
        child,
        blocks_t=found.against(without)[2],
    )


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
    name, text = effect_names(richer)[-1], texts.get("formula", "")
    fresh = effect_parameters(richer, name, fresh=True)
    if text and not fresh:
        raise ValueError(
            f"formula '{text}': names none of {texts.get('numbers') or 'p0 to p3'}, so nothing of "
            f"it can be fitted; write one before it, as in '{numbers_of(texts)[0]}*({text})'."
        )
    return richer, name, fresh


def _narrowed(
    file: ModelFile, richer: native.Model, bounds: Mapping[str, tuple[float, float]]
) -> native.Model:
    """The model of a file and its newest effect, that one's numbers within these bounds."""
    name = effect_names(richer)[-1]
    texts = {key: text for key, text in richer.texts[-1].items() if text}
    table: dict[str, Any] = {"name": catalogue_name(name), **texts, "bounds": {}}
    for p in card_of(richer, name)["parameters"]:
        least, most = bounds.get(p["name"], (p["min"], p["max"]))
        ends = [max(p["min"], least), min(p["max"], most)]
        table["bounds"][p["name"]] = ends
        table[p["name"]] = float(np.clip(richer.get(f"{name}.{p['name']}"), *ends))
    document = tomlkit.parse(file.text)
    document.setdefault("effect", tomlkit.aot()).append(tomlkit.item(table))
    return ModelFile.of(file.path, tomlkit.dumps(document)).model


def begun_at_best(
    effect: str, fresh: Sequence[Parameter], without: ScoreFit, robot_id: int | None
) -> list[Parameter]:
    """New parameters whose place, moments or lever begin where they take most of the rest.

    Args:
        effect: its name.
        fresh: what is to be fitted of it.
        without: a fit that lacks it, finished or not; what is free in it may take its share.
        robot_id: of the robot that alone has it; None if all have.
    """
    members = [
        i
        for i, d in enumerate(without.datasets)
        if isinstance(d, Trajectory) and robot_id in (None, d.robot_id)
    ]
    searched = effect == LEVER_EFFECT or any(with_role(effect, role) for role in WHERE_OR_WHEN)
    if not members or not searched:
        return list(fresh)
    models, datasets = [without.models[i] for i in members], [without.datasets[i] for i in members]
    starts = starts_of(effect, models, datasets, [without.state[0][i] for i in members])
    if starts is None:
        return list(fresh)
    return begun_at(fresh, starts.best(Left.of(without, *projected(without)).at(members)))


def _begun(model: native.Model, fresh: Sequence[Parameter]) -> native.Model:
    """A copy with what is new where its fit begins."""
    begun = model.copy()
    for p in fresh:
        begun.set(p.name, p.value)
    return begun


def _check_not_new(held: Collection[str], fresh: Sequence[Parameter]) -> None:
    """Raises ModelError where a number of what is added is to be held."""
    if name := next((p.name for p in fresh if p.name in held), None):
        raise ModelError(
            f"{name}: is of what is added, and has no value yet that could be held; add it, put a "
            f"value in with `twinmill twin set`, and hold that in a fit ({option('hold')})."
        )


def _check_acts(found: ScoreFit, fresh: Sequence[Parameter], texts: dict[str, str]) -> None:
    """Raises ValueError where a formula changes no prediction, whatever its numbers."""
    names = {p.name for p in fresh}
    own = [k for k, u in enumerate(found.unknowns) if u.parameter.name in names]
    if "formula" in texts and not any(np.any(slopes[:, own]) for slopes in found.state[1]):
        raise ValueError(
            f"formula '{texts['formula']}': changes no prediction of these logs, since it has no "
            "finite value in them, or is always zero; write another."
        )


def with_own(opened: Sequence[Opened], robot_id: int, own: Sequence[Parameter]) -> list[Opened]:
    """The measurements, with more that is to be fitted of one robot alone.

    Raises:
        ModelError: it is in none of them.
    """
    known = {o.track.robot_id for o in opened if o.floor and o.data is not None}
    if robot_id not in known:
        names = ", ".join(f"R{i:02d}" for i in sorted(known))
        raise ModelError(f"R{robot_id:02d}: is not among the robots of these logs ({names}).")
    return [
        replace(o, data=replace(o.data, own=(*o.data.own, *own)))
        if o.floor and o.data is not None and o.track.robot_id == robot_id
        else o
        for o in opened
    ]


def _own_estimates(fit: ScoreFit, own: Sequence[Parameter]) -> list[ParameterEstimate]:
    names = {p.name for p in own}
    return [e for e in fit.estimates if e.name in names]


def _is_of(name: str, effect: str) -> bool:
    return name.startswith(f"{effect}.")
