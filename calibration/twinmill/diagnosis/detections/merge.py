# SPDX-License-Identifier: Apache-2.0
"""Puts what the camera's bits tell into a diagnosis of the motion."""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from twinmill.diagnosis.detections.robots import judge_cameras, odd_cameras
from twinmill.diagnosis.detections.search import DetectionSearch, Round, Trial, search_detections
from twinmill.diagnosis.finding import Ranked
from twinmill.model.model_file import ModelFile
from twinmill.predict.detection_errors import DetectionComparison, compare_detections
from twinmill.predict.detections import all_detections

ADEQUATE = ("model_adequate", "refit_enough", "cannot_tell")


def with_detections(
    diagnosis,
    logs: list,
    model_file: ModelFile,
    progress: Callable[[str], None],
    excluded: Collection[str] = (),
):
    """The diagnosis with the camera's effects in it; unchanged if no robot reported bits.

    Args:
        diagnosis: of the motion.
        logs: with their models and clocks, and tables.
        model_file: the model as given.
        progress: told in words what is being done.
        excluded: effects that are not to be thought of.
    """
    seen = all_detections(logs)
    if not seen:
        return diagnosis
    progress("comparing the camera's bits")
    bits = compare_detections(seen, model_file.model)
    out = odd_cameras(seen, model_file.model)
    alike, odd = ([s for s in seen if (s.robot_id in out) == o] for o in (False, True))
    done = search_detections(alike, model_file.model, progress, excluded)
    off = judge_cameras(alike, odd, done.rounds[-1].before.model, progress, excluded)
    group = max((r.group or 0 for r in diagnosis.ranking), default=0)
    ranking = rank_bits(done, group)
    tied = any(r.tied for r in done.rounds)
    verdict = diagnosis.verdict
    if done.found and verdict in (*ADEQUATE, "effect_missing"):
        verdict = "ambiguous" if tied else "effect_missing"
    return replace(
        diagnosis,
        verdict=verdict,
        sentence=_sentence(diagnosis, done),
        camera=tuple(done.found),
        ranking=[*ranking, *diagnosis.ranking] if done.found else [*diagnosis.ranking, *ranking],
        not_identifiable=[*diagnosis.not_identifiable, *done.hidden],
        notes=[*diagnosis.notes, *_notes(bits)],
        bits=bits,
        bits_after=compare_detections(alike, done.rounds[-1].before.model) if done.found else None,
        bit_steps=[(None, done.rounds[0].before.score), *_steps(done)],
        detection_estimates=done.estimates,
        robots_off=(*diagnosis.robots_off, *off),
    )


def _steps(done: DetectionSearch) -> list[tuple[str | None, float]]:
    """Each accepted effect and the bits' held-out score with it."""
    return [(r.accepted.fit.effect, r.accepted.fit.score) for r in done.rounds if r.accepted]


def rank_bits(done: DetectionSearch, group: int) -> list[Ranked]:
    """Accepted effects with those that do as well, then the first round's rest."""
    total = sum(r.accepted.evidence.gain for r in done.rounds if r.accepted)
    ranking = []
    for this in done.rounds:
        if this.accepted is None:
            continue
        number = None
        if this.tied:
            group += 1
            number = group
        ranking += [_entry(t, done, total, number) for t in (this.accepted, *this.tied)]
    named = {r.effect for r in ranking}
    rest = [t for t in done.rounds[0].trials if t.fit.effect not in named]
    return ranking + [_entry(t, done, total, None) for t in rest]


def _entry(trial: Trial, done: DetectionSearch, total: float, group: int | None) -> Ranked:
    return Ranked(
        effect=trial.fit.effect or "",
        score_heldout=trial.fit.score,
        share_explained=max(trial.evidence.gain, 0.0) / max(total, trial.evidence.gain, 1e-9),
        p_value=trial.evidence.p_value(len(done.candidates)),
        evidence=trial.evidence.worth,
        parameters=list(trial.fit.added),
        group=group,
    )


def _sentence(diagnosis, done: DetectionSearch) -> str:
    if not done.found:
        return diagnosis.sentence
    told = " ".join(_of_round(r) for r in done.rounds if r.accepted)
    if diagnosis.verdict == "refit_enough":
        told += " The base model's numbers are stale too; for the motion a refit is enough."
    return told if diagnosis.verdict in ADEQUATE else f"{diagnosis.sentence} {told}"


def _of_round(this: Round) -> str:
    assert this.accepted is not None
    if this.tied:
        names = " or ".join(str(t.fit.effect) for t in (this.accepted, *this.tied))
        return f"The camera's bits lack one of {names}; these logs cannot tell which."
    values = ", ".join(_value(e) for e in this.accepted.fit.added)
    return f"The camera's bits lack {this.accepted.fit.effect} ({values})."


def _value(estimate) -> str:
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    spread = f" ± {estimate.std:.1g}" if np.isfinite(estimate.std) else ""
    return f"{estimate.name.split('.')[1]} {estimate.value:.3g}{spread}{unit}"


def _notes(bits: DetectionComparison | None) -> list[str]:
    if bits and not bits.raw:
        return [
            "The logs keep the voted bits alone: misses blur into the vote, and what is named "
            "sensor_delay may be a longer vote. Raw bits in the telemetry would tell them apart."
        ]
    return []
