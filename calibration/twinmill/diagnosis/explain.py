# SPDX-License-Identifier: Apache-2.0
"""Diagnoses, adds what was found, and writes the model that has it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis.apart import middles, of_runs
from twinmill.diagnosis.diagnose import diagnose, thinned_to_search
from twinmill.diagnosis.formula import Formula
from twinmill.diagnosis.outliers import Outlier, anew
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.stopped import stopped
from twinmill.diagnosis.taking import EFFECT, Taken, taken
from twinmill.diagnosis.trials import REFIT, State, fitted, without_effect
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import common_clock, time_notes, unsteady_clocks
from twinmill.fitting.opening import Opened, judged, lag_is_kept, with_own_gains
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.child_file import Fitted, child_of
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    GAINS,
    LAG,
    LAG_EFFECT,
    Parameter,
    ParameterEstimate,
    base_lag_is_identifiable,
    base_parameters,
    catalogue_name,
    effect_parameters,
    is_local,
    late_part,
    newest_instance,
    phases,
    with_role,
)
from twinmill.predict.datasets import Dataset, total_score


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
    """

    diagnosis: Diagnosis
    after: Comparison
    parameters: list[ParameterEstimate]
    path: Path | None
    formula: Taken | None = None
    gained: bool = True

    @property
    def sentence(self) -> str:
        """What the model has now, where that is a formula, before what was missing."""
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
        """What was found and is not in the model, in a sentence; empty if nothing is."""
        gone = self.diagnosis.passing
        if not gone:
            return ""
        return (
            f"Not in the new model: {' and '.join(gone)}, which may be of this run alone; another "
            "log would be predicted worse by it."
        )

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
            "parameters": [e.to_json() for e in self.parameters],
            "model": str(self.path) if self.path else None,
        }


def explain(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    *,
    out: Path,
    command: str,
    progress: Callable[[str], None] = lambda _: None,
    formula: bool = True,
    stoppable: bool = False,
    force: bool = True,
) -> Explanation:
    """Adds what helps on left-out data until nothing more does, and writes the model.

    Args:
        measurements: one robot, or several of a kind.
        model_file: the model; see `diagnose`.
        out: the new model file.
        command: recorded in it.
        progress: told in words what is being done.
        formula: one that is proven for what no effect explains goes into the model as well.
        stoppable: see `diagnose`; the model then has what was found until then, as it was found.
        force: replace a file that has come to be there.

    Raises:
        LogError: no measurement can be judged.
        ModelError: the new file cannot be written.
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
            fit, beyond = _whole(diagnosis, formula)
            child, told = _made(diagnosis, model_file, fit, beyond, out=out, command=command)
            if not _gained(told, fit, beyond):
                child, told = _as_given(diagnosis, model_file, beyond, out=out, command=command)
            child.write(force)
            return told
        except KeyboardInterrupt:
            if not stoppable:
                raise
            diagnosis = stopped(diagnosis, "Stopped before all was fitted together.")
    if not (diagnosis.lasting or diagnosis.robots_off):
        return Explanation(diagnosis, diagnosis.before, [], None)
    fit = diagnosis.search.last.fit
    child, told = _made(diagnosis, model_file, fit, None, out=out, command=command)
    child.write(force)
    return told


def _with_stale_lag(diagnosis: Diagnosis) -> Diagnosis:
    """The same with the lag refitted, where effects that make the robot late stand for it alone."""
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


def _whole(diagnosis: Diagnosis, formula: bool) -> tuple[ScoreFit, Taken | None]:
    """All that was found fitted together, and a proven formula where that is asked for."""
    fit = _polished(diagnosis)
    proven = diagnosis.rest.proven if formula else None
    runs = len({own.measurement.log_sha256 for own in diagnosis.opened})
    beyond = _beyond(diagnosis, fit, proven, runs) if proven else None
    return (beyond.fit if beyond and beyond.kept else fit), beyond


def _gained(told: Explanation, fit: ScoreFit, beyond: Taken | None) -> bool:
    """Whether a new model predicts better than the model as given, left-out data too.

    The middle of runs that differ may suit fewer of them than the model as given. Numbers that were
    fitted though nothing was found must predict most blocks better: a few that follow no command
    pull them wherever they like. Where lateness changes within a log, and it is not known from its
    input how, a lag goes half of the way, and suits no other log.
    """
    diagnosis = told.diagnosis
    before = diagnosis.before.score
    if diagnosis.camera:
        return True  # what is new is not of the motion alone
    if told.after.score > before:
        return False
    if of_runs(diagnosis.apart):
        return True
    if len(diagnosis.robots) > 1:
        return _held_out(diagnosis, fit) <= before
    if diagnosis.found and not (diagnosis.lasting or (beyond and beyond.kept)):
        return False
    if diagnosis.rest.events.later and any(_is_of_time(p) for p in fit.shared):
        return False
    start = diagnosis.search.rounds[0].before.fit
    if not (diagnosis.findings or (beyond and beyond.kept)):
        falls = np.concatenate(
            [
                (old - new) / np.maximum(old + new, 1e-300)
                for old, new in zip(start.block_squares, fit.block_squares, strict=True)
            ]
        )
        pulled = diagnosis.verdict == "outside_catalogue" or _unsteady(diagnosis, fit)
        if pulled or np.median(falls) < 0:
            return False
    return total_score(fit.held_scores) <= total_score(start.held_scores)


def _held_out(diagnosis: Diagnosis, fit: ScoreFit) -> float:
    """Score of all robots on parts that were not fitted to, those that differ from the others too.

    Args:
        diagnosis: with what was found.
        fit: of the others.
    """
    off = [r.score_after for r in diagnosis.robots_off for _ in r.models]
    return total_score([*fit.held_scores, *off])


def _is_of_time(parameter: Parameter) -> bool:
    """Whether it says how late a robot is."""
    return parameter.name == LAG or parameter.role == "lateness"


def _as_given(
    diagnosis: Diagnosis,
    model_file: ModelFile,
    beyond: Taken | None,
    *,
    out: Path,
    command: str,
) -> tuple[ModelFile, Explanation]:
    """The model with the numbers that it had, and what the logs tell of clock and rest."""
    logs = {o.measurement.log_name: o.measurement.log_sha256 for o in diagnosis.opened}
    before = diagnosis.before
    told = Fitted(
        model=model_file.model.copy(),
        estimates=[],
        logs=logs,
        score_before=before.score,
        score_after=before.score,
        clock=_clock(diagnosis, diagnosis.search.rounds[0].before.fit),
        base_told=bool(model_file.known_from_other_logs(logs.values())),
        left_over=_left_over(diagnosis, beyond),
    )
    child = child_of(model_file, told, Path(out), command)
    return child, Explanation(diagnosis, before, [], child.path, beyond, gained=False)


def _made(
    diagnosis: Diagnosis,
    model_file: ModelFile,
    fit: ScoreFit,
    beyond: Taken | None,
    *,
    out: Path,
    command: str,
) -> tuple[ModelFile, Explanation]:
    """The new model, to be written last of all: Ctrl-C before leaves no file."""
    model = _with_found(diagnosis, model_file, beyond)
    kept = beyond if beyond and beyond.kept else None
    shared = kept.estimates if kept else fit.shared_estimates()
    middle = middles(fit, diagnosis.apart) if diagnosis.apart else []
    gone = {m.name for m in middle} | {e.name for e in shared if _passes(e, diagnosis)}
    others = [e for e in shared if e.name not in gone]
    estimates = [*others, *middle, *fit.first_phases, *diagnosis.detection_estimates]
    covariance = kept.covariance if kept else fit.shared_covariance()
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    diagnosis = diagnosis.with_robots_off(_anew(diagnosis, fit, model))
    logs = {o.measurement.log_name: o.measurement.log_sha256 for o in diagnosis.opened}
    noise = next((s.noise_at_speed for s in diagnosis.modelled if s.noise), None)
    told = Fitted(
        model=model,
        estimates=[e for e in estimates if e.seen],
        logs=logs,
        score_before=diagnosis.before.score,
        score_after=total_score(fit.held_scores),
        noise=noise,
        clock=_clock(diagnosis, fit),
        base_told=bool(model_file.known_from_other_logs(logs.values()) and not middle),
        left_over=_left_over(diagnosis, beyond),
        robots=_own_values(diagnosis, fit),
        covariance=_with_middles(covariance.of([e.name for e in others]), middle),
        shares={f.effect: f.share for f in diagnosis.findings},
    )
    child = child_of(model_file, told, Path(out), command)
    own = phases(child.model)
    opened = [(o.aligned if own else o.with_model)(child.model) for o in _on_own_clocks(diagnosis)]
    after = comparison(child, opened)
    if of_runs(diagnosis.apart):  # none of these has in the file what it had in the fit
        child = child_of(model_file, replace(told, score_after=after.score), Path(out), command)
    return child, Explanation(diagnosis, after, estimates, child.path, beyond)


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
            [o for o in logs if o.measurement.track.robot_id == off.robot_id],
            common,
            max(lags, default=0.0),
        )
        if off.models
        else off
        for off in diagnosis.robots_off
    ]


def _on_own_clocks(diagnosis: Diagnosis) -> list[Opened]:
    """All measurements, those of robots that differ on the clocks that suit their own numbers."""
    off = {r.robot_id: iter(r.models) for r in diagnosis.robots_off}
    opened = []
    for own in diagnosis.opened:
        logs = own.floor and own.data is not None
        models = off.get(own.measurement.track.robot_id) if logs else None
        model = next(models, own.model) if models else own.model
        opened.append(own.with_fitted(model))
    return opened


def _passes(estimate: ParameterEstimate, diagnosis: Diagnosis) -> bool:
    """Whether a number is of an effect that no other run has."""
    return catalogue_name(estimate.name) in diagnosis.passing


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


def _beyond(diagnosis: Diagnosis, fit: ScoreFit, proven: Formula, runs: int) -> Taken:
    """The formula in the model, beside what was found and is not in its place."""
    *_, (_, before) = diagnosis.steps
    own = [f for f in diagnosis.findings if f.effect not in (REFIT, *proven.instead_of)]
    doubtful = [f.effect for f in own if f.certainty == "doubtful"]
    return taken(
        fit,
        proven,
        before=before,
        beside=[f.effect for f in own if f.effect in doubtful or is_local(f.effect)],
        runs=runs,
        passing=[name for name in doubtful if with_role(name, "moment")],
        given=diagnosis.search.rounds[0].before.fit.held_square,
    )


def _with_found(diagnosis: Diagnosis, model_file: ModelFile, beyond: Taken | None) -> native.Model:
    """The model as given with all that was found, before its numbers."""
    model = model_file.model.copy()
    off = diagnosis.robots_off
    of_effects = [r for r in off if not r.by_gains]
    own_effects = [catalogue_name(e.name) for r in of_effects for e in r.parameters]
    moved = diagnosis.model.effects[len(model.effects) :]
    kept = beyond.formula if beyond and beyond.kept else None
    gone = (*(kept.instead_of if kept else ()), *diagnosis.passing)
    moved = [name for name in moved if catalogue_name(name) not in gone]
    for effect in dict.fromkeys([*moved, *(f.effect for f in diagnosis.camera), *own_effects]):
        model.add_effect(catalogue_name(effect))
    if kept:
        model.add_effect(EFFECT, kept.equation)
    return model


def _left_over(diagnosis: Diagnosis, beyond: Taken | None) -> dict[str, float]:
    """What the model still leaves, by what it depends on; a formula took its share of all."""
    left = 1 - beyond.share if beyond and beyond.kept else 1.0
    falls = diagnosis.rest.left_over or {}
    return {group: left * fall for group, fall in falls.items() if left > 0}


def _polished(diagnosis: Diagnosis) -> ScoreFit:
    """All found effects and the base fitted to the score; never to a worse one on held-out data.

    So that a later diagnosis knows what these logs told of the base, found stale or not.
    """
    last = diagnosis.search.last
    state = last.state
    known = {p.name for p in state.free}
    held = {p.name for d in state.datasets for p in d.own}
    held |= set() if base_lag_is_identifiable(state.model) else {LAG}
    base = [n for n in diagnosis.base_names if n not in known | held]
    free = [*state.begun(), *base_parameters(state.model, base)]
    whole = ScoreFit(state.datasets, state.models, free).fit()
    if total_score(whole.held_scores) <= last.held_score:
        return whole
    as_found = ScoreFit(_begun(state), state.models, free)
    as_found.store()
    return as_found


def _begun(state: State) -> list[Dataset]:
    """Its data sets with what each has of its own begun at what was found."""
    pairs = zip(state.datasets, state.models, strict=True)
    return [replace(d, own=tuple(p.at(m.get(p.name)) for p in d.own)) for d, m in pairs]


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
