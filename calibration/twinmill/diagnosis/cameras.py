# SPDX-License-Identifier: Apache-2.0
"""Puts what the cameras' detections tell into a diagnosis of the motion.

The search is that of the motion, over other data: see `search.camera_state`.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from twinmill.diagnosis.camera_outliers import judge_cameras, odd_cameras
from twinmill.diagnosis.finding import Finding, Ranked
from twinmill.diagnosis.findings import ranking_of
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.search import search
from twinmill.diagnosis.trials import camera_state
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import ParameterEstimate, needing, newest_instance
from twinmill.predict.detection_errors import DetectionComparison, compare_detections
from twinmill.predict.detections import Detections, all_detections

ADEQUATE = ("model_adequate", "refit_enough", "cannot_tell")


def with_detections(
    diagnosis: Diagnosis,
    model_file: ModelFile,
    progress: Callable[[str], None],
    excluded: Collection[str] = (),
) -> Diagnosis:
    """The diagnosis with the camera's effects in it; unchanged if no robot reported detections.

    Args:
        diagnosis: of the motion.
        model_file: the model as given.
        progress: told in words what is being done.
        excluded: effects that are not considered.
    """
    cameras = all_detections([r.modelled for r in diagnosis.before.robots])
    if not cameras:
        return diagnosis
    progress("comparing detections")
    before = compare_detections(cameras, model_file.model)
    out = odd_cameras(cameras, model_file.model)
    alike, odd = ([c for c in cameras if (c.robot_id in out) == o] for o in (False, True))

    def tell(text: str) -> None:
        progress(f"cameras, {text}")

    done = search(camera_state(alike, model_file.model, excluded), tell, known=0.0)
    found, model = camera_findings(done), done.last.state.model
    off = judge_cameras(alike, odd, model, progress=progress, excluded=excluded)
    ranking = _ranked_by_likelihood(done, found, diagnosis.ranking)
    verdict = diagnosis.verdict
    if found and verdict in (*ADEQUATE, "effect_missing"):
        verdict = "ambiguous" if any(f.group for f in found) else "effect_missing"
    return replace(
        diagnosis,
        verdict=verdict,
        sentence=_sentence(diagnosis, found),
        camera=tuple(found),
        ranking=[*ranking, *diagnosis.ranking] if found else [*diagnosis.ranking, *ranking],
        not_identifiable=[*diagnosis.not_identifiable, *not_shown(done, alike, excluded)],
        notes=[*diagnosis.notes, *_notes(before)],
        detections=before,
        detections_after=compare_detections(alike, model) if found else None,
        detection_steps=_steps(done),
        detection_estimates=tuple(done.last.fit.estimates),
        robots_off=(*diagnosis.robots_off, *off),
    )


def camera_findings(done: Search) -> list[Finding]:
    """Effects of the camera that a search accepted, each with those that do as well."""
    found = []
    gains = {name: done.round_of(name).accepted.evidence for name in done.found}
    for name in done.found:
        instance = newest_instance(done.last.state.model, name)
        own = [e for e in done.last.fit.estimates if e.name.startswith(f"{instance}.")]
        tied = [n for t in done.round_of(name).tied for n in t.names]
        group = (name, *tied) if tied else None
        share = gains[name] / sum(gains.values())
        found.append(Finding(name, group, own, share, "group" if group else "sure"))
    return found


def not_shown(
    done: Search, cameras: Sequence[Detections], excluded: Collection[str] = ()
) -> list[tuple[str, str]]:
    """Effects of the camera that could be there and not be seen, and why."""
    if all(c.frames.has_raw for c in cameras):
        return done.faint
    why = "the log has no raw detections, only those after the vote"
    return [*done.faint, *((n, why) for n in needing("raw_frames") if n not in excluded)]


def _ranked_by_likelihood(
    done: Search, found: Sequence[Finding], motion: Sequence[Ranked]
) -> list[Ranked]:
    """The ranking; its groups are numbered after the motion's, and its shares are of evidence.

    The score cannot share: a vote changes the reported bit and no chance of a frame.
    """
    first = max((r.group or 0 for r in motion), default=0)
    total = sum(done.round_of(f.effect).accepted.evidence / 2 for f in found)
    return [
        replace(
            r,
            share_explained=max(r.evidence, 0.0) / max(total, r.evidence, 1e-9),
            group=None if r.group is None else r.group + first,
        )
        for r in ranking_of(done, found)
    ]


def _steps(done: Search) -> list[tuple[str | None, float]]:
    """Each accepted effect and the detections' held-out score with it."""
    steps = [(name, done.round_of(name).accepted.held_score) for name in done.found]
    return [(None, done.rounds[0].before.held_score), *steps]


def _sentence(diagnosis: Diagnosis, found: Sequence[Finding]) -> str:
    if not found:
        return diagnosis.sentence
    told = " ".join(_of_one(f) for f in found)
    if diagnosis.verdict == "refit_enough":
        told += " The base model's numbers are stale too; for the motion a refit is enough."
    return told if diagnosis.verdict in ADEQUATE else f"{diagnosis.sentence} {told}"


def _of_one(finding: Finding) -> str:
    if finding.group:
        names = " or ".join(finding.group)
        return f"The camera's detections lack one of {names}; these logs cannot tell which."
    values = ", ".join(_value(e) for e in finding.parameters)
    return f"The camera's detections lack {finding.effect} ({values})."


def _value(estimate: ParameterEstimate) -> str:
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    spread = f" ± {estimate.std:.1g}" if np.isfinite(estimate.std) else ""
    return f"{estimate.name.split('.')[1]} {estimate.value:.3g}{spread}{unit}"


def _notes(detections: DetectionComparison | None) -> list[str]:
    if detections and not detections.raw:
        return [
            "The logs keep the voted detections alone: misses blur into the vote, and what is "
            "named sensor_delay may be a longer vote. Raw detections in the telemetry would tell "
            "them apart."
        ]
    return []
