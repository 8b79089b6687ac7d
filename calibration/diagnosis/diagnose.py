# SPDX-License-Identifier: Apache-2.0
"""Names what a model lacks, says so when nothing is missing, and when the log cannot tell."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from twinmill.calibration.bits.compare import BitComparison
from twinmill.calibration.bits.merge import with_bits
from twinmill.calibration.compare import GOOD, Comparison, comparison, open_scenes
from twinmill.calibration.diagnosis.alike import free_gains, search_alike
from twinmill.calibration.diagnosis.encoders import geometry_notes, time_base_notes
from twinmill.calibration.diagnosis.evidence import State
from twinmill.calibration.diagnosis.omnibus import NOTHING, Omnibus, unexplained
from twinmill.calibration.diagnosis.ranking import Ranked, groups_of, rank
from twinmill.calibration.diagnosis.robots import RobotOff, judge, sentence
from twinmill.calibration.diagnosis.search import ALPHA, Search
from twinmill.calibration.diagnosis.settled import Settled, Sum
from twinmill.calibration.fit import refit, share_noise
from twinmill.calibration.floor import floor_of
from twinmill.calibration.freedom import base_quantities, effect_names, effect_quantities
from twinmill.calibration.measurement import Measurement
from twinmill.calibration.model_file import ModelFile
from twinmill.calibration.solve import Estimate, excited
from twinmill.calibration.steady.limits import unseen_by_tables

HELPED = 0.95  # a refit that lowers the score below this share of it was worth it
NOISIER = 2.0  # drive noise over that of the model file, beyond which it is a finding
WORSE = 1.5  # score over that of the logs the model was fitted to, beyond which it is a finding
OUTSIDE = 0.1  # share of what could be explained that no effect does


@dataclass(frozen=True)
class Diagnosis:
    """The result.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous or outside_catalogue.
        sentence: the same for people.
        before: the model as given; score_refit: its base refitted.
        found: names of the missing effects, most important first.
        ranking: effects, best first.
        not_identifiable: effect and why.
        omnibus: what the found effects leave.
        share_unexplained: of all that could be explained.
        state: scenes with the model that has the found effects.
        notes: sentences on what to keep in mind.
        next_experiment: which run would settle what this log leaves open, or None.
        sums: of found effects that are firmer than their parts.
        bits: of the robots' cameras with the model as given, or None.
        bit_estimates: of all effects of the camera, with what was found.
        robots_off: those that differ from the others; `state` is without them.
    """

    verdict: str
    sentence: str
    before: Comparison
    score_refit: float
    found: list[str]
    ranking: list[Ranked]
    not_identifiable: list[tuple[str, str]]
    omnibus: Omnibus
    share_unexplained: float
    state: State
    steps: list[tuple[str | None, float]]
    notes: list[str]
    next_experiment: dict | None
    sums: list[Sum]
    bits: BitComparison | None = None
    bit_estimates: tuple[Estimate, ...] = ()
    robots_off: tuple[RobotOff, ...] = ()

    def to_json(self) -> dict:
        """The interface's object."""
        top = next((r.group for r in self.ranking if r.group is not None), None)
        same = [r.effect for r in self.ranking if r.group == top and top is not None]
        term = self.omnibus.term
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "score": self.before.score,
            "score_refit": self.score_refit,
            "found": self.found,
            "ranking": [r.to_json() for r in self.ranking],
            "confusable_with": [e for e in same if e not in self.found],
            "not_identifiable": [{"effect": e, "why": w} for e, w in self.not_identifiable],
            "unexplained": {
                "depends_on": [g.group for g in self.omnibus.groups],
                "share": self.share_unexplained,
                "formula": f"{term.adds_to} += p0 * {term.formula}" if term else None,
                "p0": self.omnibus.coefficient if term else None,
                "equation": self.omnibus.equation,
            },
            "steps": [{"effect": e, "score_heldout": s} for e, s in self.steps],
            "sums": [s.to_json() for s in self.sums],
            "next_experiment": self.next_experiment,
            "time_base": [
                {"log": r.scene.measurement.log_name, **r.scene.measurement.time_base.to_json()}
                for r in self.before.robots
                if r.scene.measurement.time_base
            ],
            "robots_off": [r.to_json() for r in self.robots_off],
            "bits": self.bits.to_json() if self.bits else None,
            "notes": self.notes,
        }


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
    hashes = [m.log_sha256 for m in measurements]
    told = model_file.told_by_others(hashes)
    given = open_scenes(measurements, model_file)
    known = effect_quantities(model_file.model)
    base = excited(given, base_quantities(model_file.model, told), known)
    scenes = free_gains([s.with_model(model_file.model) for s in given])
    refit(scenes, base + known)
    floors = [floor_of(s).rms for s in scenes]
    unseen = unseen_by_tables(measurements)
    hidden = {*barred, *unseen}
    common = search_alike(scenes, base + known, base, floors, say, hidden)
    done, final = common.done, common.state
    odd, scenes = [scenes[i] for i in common.odd], [scenes[i] for i in common.alike]
    for earlier in ([given[i] for i in common.alike], scenes):
        share_noise(final.scenes, earlier)
    before, fitted = comparison(model_file, given), comparison(model_file, scenes)
    floors = [r.floor.rms for r in fitted.robots]
    final = replace(final, floors=floors)
    off = judge(final, odd, say, hidden)
    say("looking for what no effect explains")
    omnibus = _rest(final, model_file.left_over(hashes))
    explained = done.rounds[0].before.chi2 - _last(done)
    share = omnibus.gain / max(omnibus.gain + explained, 1e-9) if omnibus.groups else 0.0
    names = effect_names(final.model)[len(model_file.model.effects) :]
    settled = Settled.of(final)
    ranking = settled.put_into(rank(done, names, explained + omnibus.gain, floors), names)
    noises = _noisier(model_file, final)
    told_apart = ["clock_rate"] if any(m.time_base for m in measurements) else []
    alike = float(np.sqrt(np.mean([before.robots[i].score ** 2 for i in common.alike])))
    steps = _steps(done, floors)
    left = steps[-1][1] > WORSE * model_file.usual_score(hashes)
    outside = share > OUTSIDE or left or (bool(noises) and not names)
    verdict = _verdict(alike, fitted.score, names, ranking, outside)
    of_motion = Diagnosis(
        verdict,
        _sentence(verdict, names, ranking, omnibus, noises),
        before,
        fitted.score,
        names,
        ranking,
        [*(e for e in _not_identifiable(done) if e[0] not in told_apart), *unseen.items()],
        omnibus,
        float(share),
        final,
        steps,
        settled.notes(names) + noises + _notes(final, omnibus),
        _next_experiment(verdict, ranking, done),
        settled.sums,
        robots_off=tuple(off),
    )
    whole = with_bits(of_motion, given, model_file, say, barred)
    return replace(whole, sentence=" ".join([whole.sentence, *map(sentence, whole.robots_off)]))


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


def _verdict(
    score: float,
    score_refit: float,
    names: list[str],
    ranking: list[Ranked],
    outside: bool,
) -> str:
    if outside:
        return "outside_catalogue"
    if names:
        tied = {r.group for r in ranking if r.effect in names and r.group is not None}
        return "ambiguous" if tied else "effect_missing"
    if score_refit < HELPED * score and score > GOOD:
        return "refit_enough"
    return "model_adequate"


def _noisier(model_file: ModelFile, state: State) -> list[str]:
    """A note for each scene whose drive noise is far above what another log told."""
    if model_file.model.get("noise.drive_mps") <= 0:
        return []
    notes = []
    usual = model_file.model.get("noise.drive_mps")
    for scene in state.scenes:
        if scene.noise is None:
            continue
        ratio = scene.noise.position.drive / usual
        if ratio > NOISIER:
            notes.append(
                f"{scene.measurement.label}: the random disturbance of the motion is {ratio:.1f} "
                "times what the model file says; no effect that follows from commands, place or "
                "time is like that (slipping wheels or a rough floor may be)."
            )
    return notes


def _clock_notes(state: State) -> list[str]:
    if any(s.clock_free for s in state.scenes):
        return [
            "The clock offset was found from this log itself, so a delay of the commands cannot be "
            "told from it; a calibration log on the same clocks would part them."
        ]
    return []


def _rest(state: State, left_before: dict[str, float]) -> Omnibus:
    """What the effects leave of the logs; tables have no such test."""
    logs = [s for s in state.scenes if s.noise]
    return unexplained(logs, state.free, left_before) if logs else NOTHING


def _notes(state: State, omnibus: Omnibus) -> list[str]:
    return [
        *time_base_notes(state.scenes),
        *geometry_notes(state.model),
        *_clock_notes(state),
        *_known_notes(omnibus),
    ]


def _known_notes(omnibus: Omnibus) -> list[str]:
    """What is left, and was left before."""
    if not omnibus.old:
        return []
    return [
        f"What still depends on {' and '.join(omnibus.old)} was left by this model before, in the "
        "log that it was fitted to."
    ]


def _not_identifiable(done: Search) -> list[tuple[str, str]]:
    """Effects that could be there and not be seen."""
    limit = 2 * np.log(max(len(done.rounds[0].screening.found), 1) / ALPHA)
    hidden = [(name, "the log has no drive on which it acts") for name in done.blind]
    for s in done.rounds[0].screening.found:
        if 9 * s.expected < limit * s.excess:
            hidden.append((s.candidate.effect, "three times its usual strength would not show"))
    return hidden


def _next_experiment(verdict: str, ranking: list[Ranked], done: Search) -> dict | None:
    """What to drive next, in words; the script itself is designed by `twinmill next`."""
    hidden = [name for name, _ in _not_identifiable(done)]
    if verdict == "ambiguous":
        group = next(r.group for r in ranking if r.group is not None)
        same = [r.effect for r in ranking if r.group == group]
        return {
            "script": None,
            "separates": same,
            "why": f"this log cannot tell {' from '.join(same)}: drive all three axes at five or "
            "more duties, from rest and through zero, on clocks tied by a calibration log",
        }
    if hidden:
        return {
            "script": None,
            "separates": hidden,
            "why": "these effects leave no trace in this log: drive sideways as well, and at five "
            "or more duties on all axes",
        }
    return None


def _sentence(
    verdict: str, names: list[str], ranking: list[Ranked], omnibus: Omnibus, noises: list[str]
) -> str:
    depends = " and ".join(g.group for g in omnibus.groups)
    if verdict == "model_adequate":
        return "Nothing is missing that these logs would show."
    if verdict == "refit_enough":
        return "No effect is missing; the base model's numbers were stale, and a refit is enough."
    if verdict == "effect_missing":
        return f"Missing: {' and '.join(names)}."
    if verdict == "ambiguous":
        same = groups_of(ranking, names)
        return f"Missing: one of {' or '.join(same)}; these logs cannot tell which."
    if not omnibus.groups and noises:
        return "Something random disturbs the motion that no effect of the catalogue describes."
    depends = f"it depends on {depends}" if depends else "no formula that was tried describes it"
    also = (
        f" {' and '.join(names)} explain{'s' if len(names) == 1 else ''} part of it."
        if names
        else ""
    )
    return f"Something outside the catalogue is there; {depends}.{also}"
