# SPDX-License-Identifier: Apache-2.0
"""Looks for the camera effects that a model lacks, judged on bits that were not fitted to.

An effect is accepted if the held-out likelihood ratio is beyond what any of the candidates reaches
by chance, and if it changes enough bits to matter.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.detections.evidence import ALPHA, Evidence, weigh
from twinmill.fitting.detection_fit import (
    DetectionFit,
    Likelihood,
    estimates,
    fit_detections,
    start,
)
from twinmill.model.parameters import (
    CAMERA_STAGES,
    ParameterEstimate,
    all_effect_parameters,
    catalogue,
    effect_parameters,
    is_of_camera,
    needing,
)
from twinmill.predict.detections import Detections

MATTERS = 0.005  # share of the bits that an effect must change,
RARE = 0.02  # or of the frames with a robot in view (or without), if that is less
SCREEN = 2.0  # log likelihood that an effect must gain before it is judged
MOST = 4  # effects of one search
CLOCK_S = 0.025  # delays below it may be a wrong clock offset, if the log told that itself
TIE = 3.0  # log likelihood over its excess that decides nothing between two effects


@dataclass(frozen=True)
class Trial:
    """A fit with one effect more, and what speaks for it.

    Attributes:
        fit: to all frames and to each half.
        evidence: against the fit before.
        changed: share of the bits that the effect changes.
    """

    fit: DetectionFit
    evidence: Evidence
    changed: float


@dataclass(frozen=True)
class Round:
    """The model before, all trials best first, what was accepted and what does as well."""

    before: DetectionFit
    trials: list[Trial]
    accepted: Trial | None
    tied: list[Trial]


@dataclass(frozen=True)
class DetectionSearch:
    """What was found.

    Attributes:
        rounds: in the order of acceptance, the last without one.
        candidates: names of all that were thought of.
        hidden: effect and why it could be there and not show.
        estimates: of all camera effects of the final model.
    """

    rounds: list[Round]
    candidates: list[str]
    hidden: list[tuple[str, str]]
    estimates: tuple[ParameterEstimate, ...]

    @property
    def found(self) -> list[str]:
        """Effects in the order of acceptance."""
        return [r.accepted.fit.effect for r in self.rounds if r.accepted]


def search_detections(
    cameras: list[Detections],
    model: native.Model,
    progress: Callable[[str], None] = lambda _: None,
    excluded: Collection[str] = (),
) -> DetectionSearch:
    """Adds camera effects one by one while they help.

    Args:
        cameras: frames with poses; at least one.
        model: of all robots.
        progress: told in words what is being done.
        excluded: effects that are not to be thought of.
    """
    known = {*excluded, *model.effects}
    names = [n for n in catalogue() if is_of_camera(n) and n not in known]
    raw = all(s.frames.has_raw for s in cameras)
    if not raw:
        names = [n for n in names if n not in needing("raw_frames")]
    rounds: list[Round] = []
    state = fit_detections(cameras, model)
    hidden = _hidden(cameras, state.model, names)
    while True:
        this = _round(cameras, state, names, len(names), progress)
        rounds.append(this)
        if this.accepted is None:
            break
        state = fit_detections(cameras, this.accepted.fit.model)
        if len(rounds) == MOST:
            rounds.append(Round(state, [], None, []))
            break
    if not raw:
        why = "the log has no raw bits, only those after the vote"
        hidden += [(n, why) for n in needing("raw_frames") if n not in excluded]
    likelihood = Likelihood(cameras, state.model, all_effect_parameters(state.model, CAMERA_STAGES))
    return DetectionSearch(rounds, names, hidden, tuple(estimates(likelihood, state.values)))


def _round(
    cameras: list[Detections],
    state: DetectionFit,
    names: list[str],
    count: int,
    progress: Callable[[str], None],
) -> Round:
    trials = []
    for name in names:
        if name in state.model.effects:
            continue
        if _promise(cameras, state.model, name) < SCREEN:
            continue
        progress(f"trying {name} on the camera's bits")
        trials.append(_judged(cameras, state, fit_detections(cameras, state.model, name)))
    trials.sort(key=lambda t: -t.evidence.gain)
    least = _least(cameras, state.model)
    passing = [t for t in trials if _passes(cameras, t, count, least)]
    accepted = passing[0] if passing else None
    tied = [t for t in passing[1:] if _ties(cameras, accepted, t)]
    return Round(state, trials, accepted, tied)


def _promise(cameras: list[Detections], model: native.Model, effect: str) -> float:
    """What the best of a grid of the effect's values gains, in log likelihood."""
    richer = model.copy()
    richer.add_effect(effect)
    fresh = effect_parameters(richer, effect)
    likelihood = Likelihood(cameras, richer, fresh)
    neutral = np.array([p.usual for p in fresh])
    return likelihood.total(start(likelihood, fresh, neutral)) - likelihood.total(neutral)


def _judged(cameras: list[Detections], before: DetectionFit, fit: DetectionFit) -> Trial:
    evidence = weigh(cameras, fit.heldout, before.heldout)
    return Trial(fit, evidence, _changed(cameras, before.model, fit.model))


def _changed(cameras: list[Detections], before: native.Model, after: native.Model) -> float:
    """Share of the bits, raw or voted, that the models' difference changes."""
    raw, voted, count = 0.0, 0.0, 0
    for camera in cameras:
        a, b = before.for_robot(camera.robot_id), after.for_robot(camera.robot_id)
        raw += float(np.abs(camera.chance(a) - camera.chance(b))[camera.usable].sum())
        frames = [int(m.detection_model()["vote_frames"]) for m in (a, b)]
        if camera.frames.has_raw and frames[0] != frames[1]:
            voted += float(
                (camera.voted(frames[0]) != camera.voted(frames[1]))[camera.usable].sum()
            )
        count += int(camera.usable.sum())
    return max(raw, voted) / count


def _passes(cameras: list[Detections], trial: Trial, count: int, least: float) -> bool:
    late_s = next(
        (abs(e.value) for e in trial.fit.added if e.name == "sensor_delay.delay_s"), np.inf
    )
    return (
        trial.evidence.p_value(count) < ALPHA
        and trial.changed > least
        and not (late_s < CLOCK_S and any(s.clock_free for s in cameras))
    )


def _least(cameras: list[Detections], model: native.Model) -> float:
    """Share of the bits that an effect must change.

    Half a percent, or where few frames have a robot in view 2 % of those: poses, blurred as
    they are, and a clock that is a few ms wrong change as many.
    """
    view = [s.view(model.for_robot(s.robot_id))[s.usable] for s in cameras]
    share = float(np.mean(np.concatenate(view)))
    return min(MATTERS, RARE * min(share, 1 - share))


def _ties(cameras: list[Detections], best: Trial, other: Trial) -> bool:
    """Whether the frames do not tell which of two effects is the better."""
    between = weigh(cameras, best.fit.heldout, other.fit.heldout)
    return between.apart < TIE * between.excess


def _hidden(
    cameras: list[Detections], model: native.Model, names: list[str]
) -> list[tuple[str, str]]:
    """Effects of three times their usual strength that these bits would not show."""
    limit = 2 * np.log(max(len(names), 1) / ALPHA)
    hidden = []
    for name in names:
        richer = model.copy()
        richer.add_effect(name)
        fresh = effect_parameters(richer, name)
        told = 0.0
        for sign in (-1, 1):
            for p in fresh:
                far = p.usual + 3 * sign * p.strength
                richer.set(p.name, float(np.clip(far, p.min, p.max)))
            told = max(told, _divergence(cameras, model, richer))
        if told < limit:
            hidden.append((name, "three times its usual strength would not show in these bits"))
    return hidden


def _divergence(cameras: list[Detections], model: native.Model, other: native.Model) -> float:
    """Expected log likelihood ratio were the other true (Kullback and Leibler 1951)."""
    told = 0.0
    for camera in cameras:
        a, b = model.for_robot(camera.robot_id), other.for_robot(camera.robot_id)
        p, q = camera.chance(b)[camera.usable], camera.chance(a)[camera.usable]
        told += float(np.sum(p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))
        frames = [int(m.detection_model()["vote_frames"]) for m in (a, b)]
        if camera.frames.has_raw and frames[0] != frames[1]:
            told += 4.6 * float(np.sum(camera.voted(frames[0]) != camera.voted(frames[1])))
    return told
