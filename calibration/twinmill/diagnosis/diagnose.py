# SPDX-License-Identifier: Apache-2.0
"""Names what a model lacks, says so when nothing is missing, and when the log cannot tell."""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from twinmill.data.measurement import Measurement
from twinmill.diagnosis.alike import Common, free_gains, search_alike
from twinmill.diagnosis.bumps import bump_notes
from twinmill.diagnosis.detections.merge import with_bits
from twinmill.diagnosis.evidence import State
from twinmill.diagnosis.omnibus import NOTHING, Omnibus, unexplained
from twinmill.diagnosis.ranking import rank
from twinmill.diagnosis.remarks import next_experiment, noisier, not_identifiable, notes_of
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.robots import judge, sentence
from twinmill.diagnosis.search import Search
from twinmill.diagnosis.settled import Settled
from twinmill.diagnosis.verdict import Weighed
from twinmill.fitting.compare import Comparison, comparison, open_scenes
from twinmill.fitting.fit import refit, share_noise
from twinmill.fitting.solve import excited
from twinmill.model.freedom import Free, base_quantities, effect_names, effect_quantities
from twinmill.model.model_file import ModelFile
from twinmill.predict.floor import floor_of
from twinmill.predict.problem import Scene
from twinmill.steady.limits import unseen_by_tables


def diagnose(
    measurements: list[Measurement],
    model_file: ModelFile,
    say: Callable[[str], None] = lambda _: None,
    barred: Collection[str] = (),
) -> Diagnosis:
    """Diagnoses all measurements with one model.

    Args:
        measurements: one robot, or several of a kind.
        model_file: the model; what other logs told of it is held, its gains are refitted.
        say: told in words what is being done.
        barred: effects that are not to be thought of.
    """
    say("refitting the base")
    given = open_scenes(measurements, model_file)
    scenes, base, known = _refitted(given, model_file)
    floors = [floor_of(s).rms for s in scenes]
    unseen = unseen_by_tables(measurements)
    hidden = {*barred, *unseen}
    common = search_alike(scenes, base + known, base, floors, say, hidden)
    bumped = bump_notes(*([s.measurement for s in part] for part in (common.scenes, scenes)))
    odd, alike = ([common.scenes[i] for i in which] for which in (common.odd, common.alike))
    for earlier in ([given[i] for i in common.alike], alike):
        share_noise(common.state.scenes, earlier)
    before, fitted = comparison(model_file, given), comparison(model_file, alike)
    final = replace(common.state, floors=[r.floor.rms for r in fitted.robots])
    off = judge(final, odd, say, hidden)
    say("looking for what no effect explains")
    found = _concluded(replace(common, state=final), model_file, before, fitted, unseen)
    found = replace(found, notes=[*found.notes, *bumped], robots_off=tuple(off))
    whole = with_bits(found, given, model_file, say, barred)
    return replace(whole, sentence=" ".join([whole.sentence, *map(sentence, whole.robots_off)]))


def _refitted(
    given: list[Scene], model_file: ModelFile
) -> tuple[list[Scene], list[Free], list[Free]]:
    """Scenes with the base refitted, and what of base and known effects is free in them."""
    told = model_file.told_by_others([s.measurement.log_sha256 for s in given])
    known = effect_quantities(model_file.model)
    base = excited(given, base_quantities(model_file.model, told), known)
    scenes = free_gains([s.with_model(model_file.model) for s in given])
    refit(scenes, base + known)
    return scenes, base, known


def _concluded(
    common: Common,
    model_file: ModelFile,
    before: Comparison,
    fitted: Comparison,
    unseen: dict[str, str],
) -> Diagnosis:
    """What the search of the motion tells, before cameras and odd robots are looked at.

    Args:
        common: of the search; floors as of the last noise.
        model_file: the model.
        before: of the model as given.
        fitted: of its base refitted.
        unseen: effects that no table shows, and why.
    """
    done, final = common.done, common.state
    hashes = [r.scene.measurement.log_sha256 for r in before.robots]
    omnibus = _rest(final, model_file.left_over(hashes))
    explained = done.rounds[0].before.chi2 - _last(done)
    share = float(omnibus.gain / max(omnibus.gain + explained, 1e-9)) if omnibus.groups else 0.0
    names = effect_names(final.model)[len(model_file.model.effects) :]
    settled, steps = Settled.of(final), _steps(done, final.floors)
    weighed = Weighed(
        float(np.sqrt(np.mean([before.robots[i].score ** 2 for i in common.alike]))),
        fitted.score,
        names,
        settled.put_into(rank(done, names, explained + omnibus.gain, final.floors), names),
        omnibus,
        share,
        steps[-1][1],
        model_file.usual_score(hashes),
        noisier(model_file, final),
        settled.at_bound(names),
    )
    blind = dict(not_identifiable(done))
    if any(r.scene.measurement.time_base for r in before.robots):
        blind.pop("clock_rate", None)
    return Diagnosis(
        weighed.verdict,
        weighed.sentence,
        before,
        fitted.score,
        names,
        weighed.ranking,
        [*blind.items(), *unseen.items()],
        omnibus,
        share,
        final,
        steps,
        settled.notes(names) + weighed.noises + notes_of(final, omnibus, names),
        next_experiment(weighed.verdict, weighed.ranking, done),
        settled.sums,
    )


def _rest(state: State, left_before: dict[str, float]) -> Omnibus:
    """What the effects leave of the logs; tables have no such test."""
    logs = [s for s in state.scenes if s.noise]
    return unexplained(logs, state.free, left_before) if logs else NOTHING


def _last(done: Search) -> float:
    """Held-out chi2 of the final model."""
    accepted = [r.accepted for r in done.rounds if r.accepted]
    return accepted[-1].trial.chi2 if accepted else done.rounds[0].before.chi2


def _steps(done: Search, floors: list[np.ndarray]) -> list[tuple[str | None, float]]:
    steps: list[tuple[str | None, float]] = [(None, done.rounds[0].before.held.over(floors))]
    for this in done.rounds:
        if this.accepted:
            trial = this.accepted.trial
            steps.append((" + ".join(trial.effects), trial.held.over(floors)))
    return steps
