# SPDX-License-Identifier: Apache-2.0
"""Probabilities of what cameras lack, from the bits that they reported: seen, or not.

Cameras of several robots are of one kind: what all lack has one set of numbers. Beside it each
robot's camera may lack something alone. A hypothesis is a set E of such effects, all of the
catalogue:

    p(E | y)  ~  p(E)  integral of  p(y | E, x)^(1/d)  p(x)  dx

The chance of each reported bit is `Detections.likelihood`'s, numbers x are as likely beforehand as
their cards say (`size`), and `laplace` integrates. The dispersion d is that of blocks of 4 s.
Where the offset of the clocks was found in the judged logs themselves, a delay of the robot's
commands is in it, and its pictures look as old as that: it competes by its own name.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import twinmill_native as native

from twinmill.defaults import Verdict
from twinmill.inference.answer import PASSES, Named, ranking
from twinmill.inference.camera_findings import OffCamera, findings_of, off_cameras, score_of
from twinmill.inference.camera_search import CameraSearch, Lacks
from twinmill.inference.camera_set import CameraFitter, CameraSet, Lack, acting
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    catalogue,
    is_of_camera,
    making_late,
    needing,
    newest_instance,
)
from twinmill.predict.detection_errors import DetectionComparison, compared
from twinmill.predict.detections import Detections, all_detections
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.steady_states import SteadyStates

NO_RAW = "the log has no raw detections, only those after the vote"
NO_VOTE = "the cameras do not vote"
BLURRED = (
    "The logs keep the voted detections alone: misses blur into the vote, and what is named "
    "sensor_delay may be a longer vote. Raw detections in the telemetry would tell them apart."
)


@dataclass(frozen=True)
class Cameras:
    """Verdict of reported bits on a model.

    Attributes:
        findings: effects that all cameras lack, surest first.
        off: robots whose camera lacks something alone.
        nothing: probability that there is nothing that all lack.
        effects: probability of each effect that all lack it, likeliest first.
        dispersion: by how much blocks of frames scatter more than a model says; at least 1.
        before: bits as the model as given predicts them.
        after: with the findings; None where there are none.
        model: of all robots, with the findings.
        steps: scores of all bits as given, and with one finding more each.
        not_shown: effects that these bits cannot show by their kind, and why.
        notes: sentences on what to keep in mind.
        search: all sets that were fitted.
    """

    findings: list[Named]
    off: list[OffCamera]
    nothing: float
    effects: dict[str, float]
    dispersion: float
    before: DetectionComparison
    after: DetectionComparison | None
    model: native.Model
    steps: tuple[tuple[str | None, float], ...]
    not_shown: dict[str, str]
    notes: tuple[str, ...]
    search: CameraSearch = field(repr=False)

    @property
    def added(self) -> tuple[str, ...]:
        """Effects that a better model gets; none if none is sure, and no bit is told better."""
        sure = any(f.certainty == "sure" for f in self.findings)
        better = self.after is not None and self.after.score < self.before.score
        names = tuple(f.effect for f in self.findings if is_of_camera(f.effect))
        return names if sure or better else ()

    def verdict(self, of_motion: Verdict) -> Verdict:
        """Verdict on motion and cameras together."""
        if not self.findings or of_motion not in (*PASSES, "cannot_tell", "effect_missing"):
            return of_motion
        grouped = any(f.certainty == "group" for f in self.findings)
        return "ambiguous" if grouped else "effect_missing"

    def joined(self, told: dict[str, Any]) -> dict[str, Any]:
        """Fields of the interface on motion, `told`, with those on cameras in them."""
        findings = [f.to_json() for f in self.findings]
        groups = 1 + max((row["group"] or 0 for row in told["ranking"]), default=0)
        unseen = [{"effect": e, "why": why} for e, why in self.not_shown.items()]
        return {
            **told,
            "verdict": self.verdict(told["verdict"]),
            "findings": [*told["findings"], *findings],
            "found": [*told["found"], *(f.effect for f in self.findings)],
            "ranking": [*told["ranking"], *ranking(self.effects, self.findings, groups)],
            "not_identifiable": [*told["not_identifiable"], *unseen],
            "robots_off": [*told["robots_off"], *(o.to_json() for o in self.off)],
            "warnings": [*told["warnings"], *self.notes],
            **self.to_json(),
        }

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface that are of cameras alone."""
        return {
            "camera": [f.to_json() for f in self.findings],
            "bits": self.before.to_json(),
            "bits_after": self.after.to_json() if self.after else None,
            "bit_steps": [{"effect": e, "score_heldout": score} for e, score in self.steps],
            "bit_probability": {
                "nothing": self.nothing,
                "effects": self.effects,
                "dispersion": self.dispersion,
            },
        }


def judge_cameras(
    logs: Sequence[ModelledLog | SteadyStates],
    model_file: ModelFile,
    progress: Callable[[str], None] = lambda _: None,
    without: Collection[str] = (),
) -> Cameras | None:
    """Probabilities of what cameras lack; None where no robot reported bits of another one.

    Args:
        logs: of one robot or several, on the clock and with the noise that were found; poses of the
            robots that are seen are among them.
        model_file: the model.
        progress: told in words what is being done.
        without: effects that do not compete.
    """
    cameras = all_detections(logs)
    return judge_detections(cameras, model_file, progress, without) if cameras else None


def judge_detections(
    cameras: Sequence[Detections],
    model_file: ModelFile,
    progress: Callable[[str], None] = lambda _: None,
    without: Collection[str] = (),
) -> Cameras:
    """`judge_cameras` of frames with the poses around them, of one camera at least."""
    hidden = {name: why for name, why in _not_shown(cameras).items() if name not in without}
    names = [n for n in catalogue() if is_of_camera(n) and n not in hidden]
    if any(camera.clock_free for camera in cameras):
        names += making_late("delay")
    robots = sorted({camera.robot_id for camera in cameras})
    whose = (None, *(robots if len(robots) > 1 else ()))
    candidates = [Lack(name, robot) for robot in whose for name in names if name not in without]
    fitter = CameraFitter(cameras, model_file)
    search = CameraSearch(fitter, candidates, lambda said: progress(f"cameras, {said}")).run()
    return _told(search, model_file, hidden)


def _not_shown(cameras: Sequence[Detections]) -> dict[str, str]:
    if not all(camera.frames.has_raw for camera in cameras):
        return dict.fromkeys(needing("raw_frames"), NO_RAW)
    if not any(camera.frames.has_vote for camera in cameras):
        return dict.fromkeys(needing("raw_frames"), NO_VOTE)
    return {}


def _told(search: CameraSearch, model_file: ModelFile, hidden: dict[str, str]) -> Cameras:
    cameras, dispersion = search.fitter.cameras, search.dispersion()
    found = findings_of(search, dispersion)
    model = _better(model_file, search.set_of(found.lacks), dispersion)
    before = compared(cameras, model_file.model)
    return Cameras(
        found.named,
        off_cameras(search, dispersion, found.lacks),
        found.nothing,
        found.effects,
        dispersion,
        before,
        after=compared(cameras, model) if found.named else None,
        model=model,
        steps=tuple(_steps(search, found.lacks)),
        not_shown=hidden,
        notes=() if before.raw else (BLURRED,),
        search=search,
    )


def _better(model_file: ModelFile, own: CameraSet, dispersion: float) -> native.Model:
    """The model of all robots with what a set has."""
    model, told = model_file.model.copy(), own.estimates(dispersion)
    instance = {}
    for lack in own.lacks:
        model.add_effect(acting(lack.effect))
        instance[lack] = newest_instance(model, acting(lack.effect))
    for number in own.numbers:
        whose, name = number.label
        model.set(f"{instance[whose]}.{name}" if whose else name, told[number.label][0])
    return model


def _steps(search: CameraSearch, lacks: Lacks) -> list[tuple[str | None, float]]:
    """Score of all bits as given, and with what was found, the likeliest first."""
    cameras, there = search.fitter.cameras, frozenset[Lack]()
    told: list[tuple[str | None, float]] = []
    everyone = [True] * len(cameras)
    told.append((None, score_of(cameras, search.set_of(there), everyone)))
    while rest := lacks - there:
        added = max(rest, key=lambda lack: search.set_of(there | {lack}).log_evidence())
        there |= {added}
        told.append((added.effect, score_of(cameras, search.set_of(there), everyone)))
    return told
