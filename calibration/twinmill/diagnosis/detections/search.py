# SPDX-License-Identifier: Apache-2.0
"""Looks for the camera effects that a model lacks, judged on bits that were not fitted to.

An effect is accepted if the held-out likelihood ratio is beyond what any of the candidates reaches
by chance, and if it changes enough bits to matter.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.detections.evidence import ALPHA, Evidence, HeldOut, weigh
from twinmill.diagnosis.detections.fit import (
    Likelihood,
    camera_effects,
    camera_parameters,
    climb,
    estimates,
    start,
)
from twinmill.model.parameters import ParameterEstimate, effect_parameters, needing
from twinmill.predict.detection_errors import brier_ratio
from twinmill.predict.detections import Detections

MATTERS = 0.005  # share of the bits that an effect must change,
RARE = 0.02  # or of the frames with a robot in view (or without), if that is less
SCREEN = 2.0  # log likelihood that an effect must gain before it is judged
MOST = 4  # effects of one search
CLOCK_S = 0.025  # delays below it may be a wrong clock offset, if the log told that itself
TIE = 3.0  # log likelihood over its excess that decides nothing between two effects


@dataclass(frozen=True)
class Trial:
    """A model with one effect more (or none), fitted and judged.

    Attributes:
        effect: what was added; None if nothing.
        model: fitted to all frames.
        values: of all camera parameters.
        heldout: what fits to either half say of the other.
        score: of these.
        own: estimates of the added effect's quantities.
        evidence: against the model before.
        changed: share of the bits that the effect changes.
    """

    effect: str | None
    model: native.Model
    values: np.ndarray
    heldout: HeldOut
    score: float
    own: tuple[ParameterEstimate, ...]
    evidence: Evidence = field(default_factory=Evidence)
    changed: float = 0.0


@dataclass(frozen=True)
class Round:
    """The model before, all trials best first, what was accepted and what does as well."""

    before: Trial
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
        return [r.accepted.effect for r in self.rounds if r.accepted]


def search_detections(
    scenes: list[Detections],
    model: native.Model,
    say: Callable[[str], None] = lambda _: None,
    excluded: Collection[str] = (),
) -> DetectionSearch:
    """Adds camera effects one by one while they help.

    Args:
        scenes: frames with poses; at least one.
        model: of all robots.
        say: told in words what is being done.
        excluded: effects that are not to be thought of.
    """
    names = [n for n in camera_effects(model) if n not in excluded]
    raw = all(s.frames.has_raw for s in scenes)
    if not raw:
        names = [n for n in names if n not in needing("raw_frames")]
    rounds: list[Round] = []
    state = attempt(scenes, model, None)
    hidden = _hidden(scenes, state.model, names)
    while True:
        this = _round(scenes, state, names, len(names), say)
        rounds.append(this)
        if this.accepted is None:
            break
        state = attempt(scenes, this.accepted.model, None)
        if len(rounds) == MOST:
            rounds.append(Round(state, [], None, []))
            break
    if not raw:
        why = "the log has no raw bits, only those after the vote"
        hidden += [(n, why) for n in needing("raw_frames") if n not in excluded]
    likelihood = Likelihood(scenes, state.model, camera_parameters(state.model))
    return DetectionSearch(rounds, names, hidden, tuple(estimates(likelihood, state.values)))


def attempt(scenes: list[Detections], model: native.Model, effect: str | None) -> Trial:
    """Fits the model's camera effects and `effect`, which it has not; then judges it both ways."""
    richer = model.copy()
    fresh = []
    if effect:
        richer.add_effect(effect)
        fresh = effect_parameters(richer, effect)
    free = camera_parameters(richer)
    likelihood = Likelihood(scenes, richer, free)
    values = np.array([richer.get(k.name) for k in free])
    if fresh:
        values = start(likelihood, fresh, values)
    values = climb(likelihood, values) if free else values
    fits = [climb(likelihood, values, 1 - half) if free else values for half in (0, 1)]
    heldout = HeldOut.of(scenes, tuple(likelihood.set(own).copy() for own in fits))
    own = [e for e in estimates(likelihood, values) if effect and e.name.startswith(f"{effect}.")]
    model = likelihood.set(values)
    return Trial(effect, model, values, heldout, _score(scenes, heldout), tuple(own))


def _score(scenes: list[Detections], heldout: HeldOut) -> float:
    """Of the bits of all frames that count."""
    chance = [c[s.usable] for s, c in zip(scenes, heldout.chance, strict=True)]
    bits = [(s.frames.raw if s.frames.has_raw else s.frames.voted)[s.usable] for s in scenes]
    return brier_ratio(np.concatenate(chance), np.concatenate(bits))


def _round(
    scenes: list[Detections],
    state: Trial,
    names: list[str],
    count: int,
    say: Callable[[str], None],
) -> Round:
    trials = []
    for name in names:
        if name in state.model.effects:
            continue
        if _promise(scenes, state.model, name) < SCREEN:
            continue
        say(f"trying {name} on the camera's bits")
        trials.append(_judged(scenes, state, attempt(scenes, state.model, name)))
    trials.sort(key=lambda t: -t.evidence.gain)
    least = _least(scenes, state.model)
    passing = [t for t in trials if _passes(scenes, t, count, least)]
    accepted = passing[0] if passing else None
    tied = [t for t in passing[1:] if _ties(scenes, accepted, t)]
    return Round(state, trials, accepted, tied)


def _promise(scenes: list[Detections], model: native.Model, effect: str) -> float:
    """What the best of a grid of the effect's values gains, in log likelihood."""
    richer = model.copy()
    richer.add_effect(effect)
    fresh = effect_parameters(richer, effect)
    likelihood = Likelihood(scenes, richer, fresh)
    neutral = np.array([p.usual for p in fresh])
    return likelihood.total(start(likelihood, fresh, neutral)) - likelihood.total(neutral)


def _judged(scenes: list[Detections], before: Trial, trial: Trial) -> Trial:
    return replace(
        trial,
        evidence=weigh(scenes, trial.heldout, before.heldout),
        changed=_changed(scenes, before.model, trial.model),
    )


def _changed(scenes: list[Detections], before: native.Model, after: native.Model) -> float:
    """Share of the bits, raw or voted, that the models' difference changes."""
    raw, voted, count = 0.0, 0.0, 0
    for scene in scenes:
        a, b = before.for_robot(scene.robot_id), after.for_robot(scene.robot_id)
        raw += float(np.abs(scene.chance(a) - scene.chance(b))[scene.usable].sum())
        frames = [int(m.sight()["vote_frames"]) for m in (a, b)]
        if scene.frames.has_raw and frames[0] != frames[1]:
            voted += float((scene.voted(frames[0]) != scene.voted(frames[1]))[scene.usable].sum())
        count += int(scene.usable.sum())
    return max(raw, voted) / count


def _passes(scenes: list[Detections], trial: Trial, count: int, least: float) -> bool:
    late_s = next((abs(e.value) for e in trial.own if e.name == "sensor_delay.delay_s"), np.inf)
    return (
        trial.evidence.p_value(count) < ALPHA
        and trial.changed > least
        and not (late_s < CLOCK_S and any(s.clock_free for s in scenes))
    )


def _least(scenes: list[Detections], model: native.Model) -> float:
    """Share of the bits that an effect must change.

    Half a percent, or where few frames have a robot in view 2 % of those: poses, blurred as
    they are, and a clock that is a few ms wrong change as many.
    """
    view = [s.view(model.for_robot(s.robot_id))[s.usable] for s in scenes]
    share = float(np.mean(np.concatenate(view)))
    return min(MATTERS, RARE * min(share, 1 - share))


def _ties(scenes: list[Detections], best: Trial, other: Trial) -> bool:
    """Whether the frames do not tell which of two effects is the better."""
    between = weigh(scenes, best.heldout, other.heldout)
    return between.apart < TIE * between.excess


def _hidden(
    scenes: list[Detections], model: native.Model, names: list[str]
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
            told = max(told, _divergence(scenes, model, richer))
        if told < limit:
            hidden.append((name, "three times its usual strength would not show in these bits"))
    return hidden


def _divergence(scenes: list[Detections], model: native.Model, other: native.Model) -> float:
    """Expected log likelihood ratio were the other true (Kullback and Leibler 1951)."""
    told = 0.0
    for scene in scenes:
        a, b = model.for_robot(scene.robot_id), other.for_robot(scene.robot_id)
        p, q = scene.chance(b)[scene.usable], scene.chance(a)[scene.usable]
        told += float(np.sum(p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))
        frames = [int(m.sight()["vote_frames"]) for m in (a, b)]
        if scene.frames.has_raw and frames[0] != frames[1]:
            told += 4.6 * float(np.sum(scene.voted(frames[0]) != scene.voted(frames[1])))
    return told
