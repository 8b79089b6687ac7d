# SPDX-License-Identifier: Apache-2.0
"""Diagnoses, adds what was found, and writes the model that has it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis.apart import middles, of_runs
from twinmill.diagnosis.diagnose import diagnose, thinned_to_search
from twinmill.diagnosis.outliers import Outlier, anew
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.stopped import stopped
from twinmill.diagnosis.taking import EFFECT, Taken
from twinmill.diagnosis.trials import REFIT, fitted, without_effect
from twinmill.diagnosis.written import Candidate, Candidates, best_of
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import common_clock, time_notes, unsteady_clocks
from twinmill.fitting.opening import judged, lag_is_kept, with_own_gains
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.child_file import Fitted, child_of
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    GAINS,
    LAG,
    LAG_EFFECT,
    ParameterEstimate,
    base_lag_is_identifiable,
    base_parameters,
    catalogue_name,
    effect_parameters,
    late_part,
    newest_instance,
)


@dataclass(frozen=True)
class Explanation:
    """A model with the effects that were found, and the diagnosis behind it.

    Attributes:
        diagnosis: with its steps on held-out data.
        after: comparison of the new model.
        parameters: all that was fitted.
        path: of the new model; None if it was stopped before anything was found, and none written.
        formula: that was proven for what is left, refitted with all; None if none was, or if it
            was not asked for.
        gained: the new model predicts left-out data better than the given one; else it has the
            numbers that were given.
        lacks: effects that were found, without which left-out data are predicted better.
    """

    diagnosis: Diagnosis
    after: Comparison
    parameters: list[ParameterEstimate]
    child: ModelFile | None
    formula: Taken | None = None
    gained: bool = True
    lacks: tuple[str, ...] = ()

    @property
    def path(self) -> Path | None:
        """Path of the new model; None if there is none."""
        return self.child and self.child.path

    @property
    def sentence(self) -> str:
        """Model's content if that is a formula, as a sentence before the one on the lack."""
        missing = self.diagnosis.sentence
        return f"{self.now} Without it: {missing}" if self.now else missing

    @property
    def now(self) -> str:
        """The formula that the model has now, and what it takes; empty if it has none."""
        if not (self.formula and self.formula.kept):
            return ""
        own = self.formula
        now = (
            f"The model now has the formula {own.added.equals}, which takes "
            f"{100 * own.share:.0f} % of what was left (held-out score {own.before:.2f} without "
            f"it, {own.after:.2f} with it)."
        )
        return f"{now} {own.note}".rstrip()

    @property
    def left_out(self) -> str:
        """Findings that are not in the model, in a sentence; empty if all are."""
        whys = (
            (
                self.diagnosis.passing,
                "which may be of this run alone; another log would be predicted worse by it",
            ),
            (self.lacks, "without which data that were not fitted to are predicted better"),
        )
        told = [f"Not in the new model: {' and '.join(of)}, {why}." for of, why in whys if of]
        return " ".join(told)

    @property
    def steps(self) -> list[tuple[str | None, float]]:
        """Those of the diagnosis, and the formula if the model has it."""
        own = self.diagnosis.steps
        kept = self.formula and self.formula.kept
        return [*own, (EFFECT, self.formula.after)] if kept else own

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            **self.diagnosis.to_json(),
            "sentence": self.sentence,
            "steps": [{"effect": name, "score_heldout": score} for name, score in self.steps],
            "formula": self.formula.to_json() if self.formula else None,
            "score_after": self.after.score,
            "gained": self.gained,
            "passing": self.diagnosis.passing,
            "lacks": list(self.lacks),
            "parameters": [e.to_json() for e in self.parameters],
            "model": str(self.path) if self.path else None,
        }


def explain(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    *,
    out: Path,
    force: bool = True,
    **options: Any,
) -> Explanation:
    """Adds what helps on left-out data until nothing more does, and writes the model.

    Args:
        measurements: one robot, or several of a kind.
        model_file: the model; see `diagnose`.
        out: the new model file.
        force: replace a file that has come to be there.
        options: as of `explain_model`.

    Raises:
        LogError: no measurement can be judged.
        ModelError: the new file cannot be written.
    """
    told = explain_model(measurements, model_file, path=Path(out), **options)
    if told.child:
        told.child.write(force)
    return told


def explain_model(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    *,
    path: Path,
    command: str,
    progress: Callable[[str], None] = lambda _: None,
    formula: bool = True,
    stoppable: bool = False,
) -> Explanation:
    """Adds what helps on left-out data until nothing more does; nothing is written.

    Args:
        measurements: one robot, or several of a kind.
        model_file: the model; see `diagnose`.
        path: where the new model may be written.
        command: recorded in it.
        progress: told in words what is being done.
        formula: one that is proven for what no effect explains goes into the model as well.
        stoppable: see `diagnose`; the model then has what was found until then, as it was found.

    Raises:
        LogError: no measurement can be judged.
    """
    diagnosis = diagnose(measurements, model_file, progress, stoppable=stoppable)
    unsteady = _unsteady(diagnosis, diagnosis.search.last.fit)
    own, hashes = judged(diagnosis.opened), [m.log_sha256 for m in measurements]
    kept = lag_is_kept(own, model_file.known_from_other_logs(hashes))
    notes = [*diagnosis.notes, *time_notes(own, unsteady, kept)]
    diagnosis = replace(diagnosis, notes=notes)
    if not diagnosis.search.stopped:
        try:
            diagnosis = _with_stale_lag(diagnosis)
            progress("weighing the models that may be written")
            best, beyond = _best(diagnosis, model_file, formula)
            told = _made(diagnosis, model_file, best, beyond, out=path, command=command)
            if of_runs(diagnosis.apart) and told.after.score > diagnosis.before.score:
                # The middle of runs that differ was fitted to none of them: it is judged as it is.
                given = Candidates(diagnosis, model_file).given
                told = _made(diagnosis, model_file, given, beyond, out=path, command=command)
            return told
        except KeyboardInterrupt:
            if not stoppable:
                raise
            diagnosis = stopped(diagnosis, "Stopped before all was fitted together.")
    if not (diagnosis.lasting or diagnosis.robots_off):
        return Explanation(diagnosis, diagnosis.before, [], None)
    so_far = Candidates(diagnosis, model_file).as_found
    return _made(diagnosis, model_file, so_far, None, out=path, command=command)


def _with_stale_lag(diagnosis: Diagnosis) -> Diagnosis:
    """Diagnosis with the lag refitted, where effects that delay the robot replace it."""
    stale = next((f for f in diagnosis.findings if f.effect == REFIT), None)
    if stale is None or LAG not in {p.name for p in stale.parameters}:
        return diagnosis
    last, named = diagnosis.search.last, {f.effect for f in diagnosis.findings}
    for name in [n for n in diagnosis.search.found if n not in named]:
        is_new = "#" not in newest_instance(last.state.model, name)
        if is_new or late_part(name):
            last = without_effect(last, name) or last
    model = last.state.model
    told = base_lag_is_identifiable(model)
    lag = base_parameters(model, [LAG]) if told else effect_parameters(model, LAG_EFFECT)
    known = {p.name for p in last.state.free}
    free = [*last.state.begun(), *(p for p in lag if p.name not in known)]
    last = fitted(replace(last.state, free=tuple(free)))
    return replace(diagnosis, search=replace(diagnosis.search, last=last))


def _best(
    diagnosis: Diagnosis, model_file: ModelFile, formula: bool
) -> tuple[Candidate, Taken | None]:
    """The model that left-out data know best, and what became of a formula that was proven."""
    all_of = Candidates(diagnosis, model_file)
    found = all_of.of(diagnosis.search.last)
    alone = [all_of.refitted()] if found.effects else []
    best = best_of([all_of.given, *alone, found, *all_of.others_of_groups()])
    proven = diagnosis.rest.proven if formula else None
    if not proven:
        return best, None
    with_it = all_of.with_formula(found if best.as_given else best, proven)
    given = replace(all_of, gone=with_it.beyond.formula.instead_of).given
    beyond = replace(with_it.beyond, outdone=not with_it.outdoes(given))
    return (replace(with_it, beyond=beyond) if beyond.kept else best), beyond


def _made(
    diagnosis: Diagnosis,
    model_file: ModelFile,
    own: Candidate,
    beyond: Taken | None,
    *,
    out: Path,
    command: str,
) -> Explanation:
    """With the new model, to be written last of all: Ctrl-C before leaves no file."""
    fit, kept = own.fit, own.beyond
    model = _with_effects(diagnosis, model_file, own)
    shared = kept.estimates if kept else fit.shared_estimates()
    apart = None if own.as_given else diagnosis.apart
    middle = middles(fit, apart) if apart else []
    gone = {m.name for m in middle} | {e.name for e in shared if _passes(e, diagnosis)}
    others = [e for e in shared if e.name not in gone]
    phases = [] if own.as_given else fit.first_phases
    estimates = [*others, *middle, *phases, *diagnosis.detection_estimates]
    covariance = kept.covariance if kept else fit.shared_covariance()
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    if not own.as_given:
        diagnosis = diagnosis.with_robots_off(_anew(diagnosis, fit, model))
    logs = {o.measurement.log_name: o.measurement.log_sha256 for o in diagnosis.opened}
    noise = next((s.noise_at_speed for s in diagnosis.modelled if s.noise), None)
    told = Fitted(
        model=model,
        estimates=[e for e in estimates if e.seen],
        logs=logs,
        score_before=diagnosis.before.score,
        score_after=own.score,
        noise=None if own.as_given else noise,
        clock=_clock(diagnosis, fit),
        base_told=bool(model_file.known_from_other_logs(logs.values()) and not middle),
        left_over=_left_over(diagnosis, kept),
        robots={} if own.as_given else _own_values(diagnosis, fit),
        covariance=_with_middles(covariance.of([e.name for e in others]), middle),
        shares={f.effect: f.share for f in diagnosis.findings},
    )
    child = child_of(model_file, told, Path(out), command)
    after = comparison(child, [o.aligned(child.model) for o in diagnosis.opened])
    if of_runs(apart):  # none of these has in the file what it had in the fit
        child = child_of(model_file, replace(told, score_after=after.score), Path(out), command)
    instead = kept.formula.instead_of if kept else ()
    told_of = {*own.effects, *diagnosis.passing, *instead}
    lacks = tuple(n for n in diagnosis.motion if n not in told_of)
    gained = bool(diagnosis.camera) or not own.as_given
    return Explanation(diagnosis, after, estimates, child, beyond, gained=gained, lacks=lacks)


def _anew(diagnosis: Diagnosis, fit: ScoreFit, common: native.Model) -> list[Outlier]:
    """Robots that differ, with their numbers beside the new model of all; cameras as they are."""
    if not diagnosis.robots_off:
        return []
    lags = [p.std for d in fit.datasets for p in d.own if p.name == LAG and not d.by_run]
    opened = thinned_to_search(with_own_gains(judged(diagnosis.opened)))
    logs = [o for o in opened if o.floor]
    return [
        anew(
            off,
            [o for o in logs if o.track.robot_id == off.robot_id],
            common,
            max(lags, default=0.0),
        )
        if off.models
        else off
        for off in diagnosis.robots_off
    ]


def _passes(estimate: ParameterEstimate, diagnosis: Diagnosis) -> bool:
    """True if a number is of this run alone: of an effect that passes, or of changing lateness."""
    late = bool(diagnosis.rest.events.later) and estimate.name == LAG
    return late or catalogue_name(estimate.name) in diagnosis.passing


def _with_middles(told: Covariance, middle: Sequence[ParameterEstimate]) -> Covariance:
    """With what stands for numbers that differ, each by itself."""
    names = tuple(e.name for e in middle)
    return told.replaced_by(Covariance(names, np.diag([e.std**2 for e in middle])))


def _clock(diagnosis: Diagnosis, fit: ScoreFit) -> dict[str, ParameterEstimate]:
    """Offset and rate that the logs share; empty where one of them changes within its log."""
    return {} if _unsteady(diagnosis, fit) else common_clock(fit)


def _unsteady(diagnosis: Diagnosis, fit: ScoreFit) -> list[str]:
    """Labels of logs whose offset changes within them, by their input or by what was found."""
    later = [f"{c.log} R{c.robot_id:02d}" for c in diagnosis.rest.events.later]
    return list(dict.fromkeys([*unsteady_clocks(fit), *later]))


def _with_effects(diagnosis: Diagnosis, model_file: ModelFile, own: Candidate) -> native.Model:
    """The model as given with all that is to be written, before its numbers."""
    model = model_file.model.copy()
    off = [] if own.as_given else [r for r in diagnosis.robots_off if not r.by_gains]
    own_effects = [catalogue_name(e.name) for r in off for e in r.parameters]
    camera = [f.effect for f in diagnosis.camera]
    for effect in dict.fromkeys([*own.effects, *camera, *own_effects]):
        model.add_effect(effect)
    if own.beyond:
        model.add_effect(EFFECT, own.beyond.formula.equation)
    return model


def _left_over(diagnosis: Diagnosis, kept: Taken | None) -> dict[str, float]:
    """Errors that the model still leaves, by dependence, less the share that a formula took."""
    left = 1 - kept.share if kept else 1.0
    falls = diagnosis.rest.left_over or {}
    return {group: left * fall for group, fall in falls.items() if left > 0}


def _own_values(diagnosis: Diagnosis, fit: ScoreFit) -> dict[int, list[ParameterEstimate]]:
    """By robot, what [robots.Rnn] states: its gains and lag, and the effects that only it has."""
    values: dict[int, dict[str, ParameterEstimate]] = {}
    for i, data in enumerate([] if of_runs(diagnosis.apart) else fit.datasets):
        own = {n: e for n, e in fit.own_estimates(i).items() if n in (*GAINS, LAG)}
        if own:
            values.setdefault(data.robot_id, {}).update(own)
    for robot in diagnosis.robots_off:
        own = {e.name: e for e in [*robot.beside, *robot.parameters]}
        values.setdefault(robot.robot_id, {}).update(own)
    return {robot_id: list(own.values()) for robot_id, own in values.items()}
