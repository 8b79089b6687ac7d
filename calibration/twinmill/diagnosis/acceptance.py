# SPDX-License-Identifier: Apache-2.0
"""When a trial is accepted: beyond doubt on held-out parts, in all blocks, and worth its words."""

import numpy as np

from twinmill.diagnosis.settings import Settings
from twinmill.diagnosis.trials import REFIT, Trial
from twinmill.fitting.score_fit import FAR
from twinmill.fitting.starts import MARGIN
from twinmill.model.parameters import (
    GAINS,
    NO_SIZE,
    catalogue_of,
    instance_of,
    is_local,
    making_late,
    newest_instance,
    with_role,
)
from twinmill.predict.datasets import Trajectory

NEARLY_NONE = 0.05  # of the excess of a squared score


def best_of(
    before: Trial, trials: list[Trial], first_excess: float, settings: Settings
) -> Trial | None:
    """Cheapest on held-out data of the trials that matter and have enough evidence.

    Of two that do as well, the one with fewer numbers; of two that are the same, see `rank`.
    """
    good = []
    for trial in trials:
        if trial.names == (REFIT,) and _is_common(before, trial, settings):
            good.append(trial)
            continue
        if not _matters(before, trial, first_excess, settings):
            continue
        at_nothing = all(_is_neutral(trial, n) or began_before(trial, n) for n in trial.names)
        if not at_nothing and proven(trial, before.held_score, settings):
            good.append(trial)
    if not good:
        return None
    best = min(good, key=lambda t: rank(t, settings))

    def first(refit: Trial) -> bool:
        as_good = refit.fit.held_cost - best.fit.held_cost < settings.tie
        return as_good or _was_far(before, refit)

    # Stale numbers of the base are more likely than an effect that does the same.
    return next((t for t in good if t.names == (REFIT,) and first(t)), best)


def _was_far(before: Trial, refit: Trial) -> bool:
    """True if the base was so far off that whatever moves all speeds takes nearly all."""
    left, first = (t.held_score**2 - 1 for t in (refit, before))
    return before.held_score > FAR and left < NEARLY_NONE * first


def began_before(trial: Trial, name: str) -> bool:
    """An effect no moment of which is within the logs: it is there all the time, or never."""
    if not with_role(name, "moment"):
        return False
    logs = [d for d in trial.state.datasets if isinstance(d, Trajectory)]
    times_s = np.concatenate([d.start_s for d in logs])
    low_s, high_s = np.quantile(times_s, (MARGIN, 1 - MARGIN))
    return not any(low_s < t_s < high_s for t_s in when_s(trial, name))


def when_s(trial: Trial, name: str) -> list[float]:
    """Moments at which an effect begins and ends, s since the first command."""
    model = trial.state.model
    instance = newest_instance(model, name)
    return [model.get(f"{instance}.{key}") for key in with_role(name, "moment")]


def _is_common(before: Trial, refit: Trial, settings: Settings) -> bool:
    """True if the base's numbers take as much as each robot's own gains took, and all took alike.

    That makes no prediction better; it is far more likely than as many robots that are no usual
    ones.
    """
    own = any(p.name in GAINS for d in before.state.datasets for p in d.own)
    as_good = refit.held_score < settings.common * before.held_score
    return own and as_good and refit.evidence > settings.evidence


def _matters(before: Trial, trial: Trial, first_excess: float, settings: Settings) -> bool:
    """True if the addition is worth its words, by the fall of the squared score or detections."""
    if before.state.of_cameras:
        return _changes_enough_bits(before, trial, settings)
    fall = before.held_score**2 - trial.held_score**2
    return fall > 0 and fall >= _least_fall(before, trial, first_excess, settings) * len(
        trial.names
    )


def _changes_enough_bits(before: Trial, trial: Trial, settings: Settings) -> bool:
    """True if it changes more detections than clock errors of a few ms and blurred poses do."""
    seen = before.fit.in_view
    least = min(settings.bits, settings.bits_in_view * min(seen, 1 - seen))
    own = [e for e in trial.fit.shared_estimates() if instance_of(e.name) in trial.names]
    by_clock = any(e.unit == "s" and abs(e.value) < settings.late_s for e in own)
    by_clock &= any(d.clock_free for d in trial.fit.datasets)
    return trial.fit.changed(before.fit) > least and not by_clock


def _least_fall(before: Trial, trial: Trial, first_excess: float, settings: Settings) -> float:
    """Least fall of the squared score that matters."""
    score = before.held_score
    if score >= 1.0:
        return min(settings.worth * first_excess, settings.enough)
    if proven(trial, score, settings.stricter(settings.strong)):
        return settings.least_strong * score**2
    least, most = settings.least_below * score**2, settings.most_below * score**2
    return float(np.clip(settings.below * first_excess, least, most))


def cost(trial: Trial, settings: Settings) -> float:
    """Held-out cost, and what its numbers cost."""
    return trial.fit.held_cost + settings.each * len(trial.fit.x)


def rank(trial: Trial, settings: Settings) -> tuple:
    """Key that sorts trials: cost, then, among equals, clocks last.

    A clock that is off and a robot that acts later shift the same poses, so that their costs differ
    by how a prediction is stepped.
    """
    of_clock = any(n in making_late("clock") for n in trial.names)
    return round(cost(trial, settings), 1), of_clock, trial.names


def proven(trial: Trial, score: float, settings: Settings) -> bool:
    """Enough evidence, and blocks that agree; near the noise agreement alone is not enough."""
    count = len(trial.names)
    enough, less = settings.evidence * count, settings.less_evidence * count
    if count == 1 and is_local(trial.names[0]):
        enough = less = settings.passing
    loud = trial.evidence >= enough
    somewhere = count == 1 and bool(with_role(trial.names[0], "place"))
    least = settings.without_visit if somewhere else settings.without_best
    spread = trial.without_best >= least * count
    agreed = (
        score >= settings.drowned and trial.evidence >= less and trial.blocks_t >= settings.blocks_t
    )
    return (loud and spread) or agreed


def _is_neutral(trial: Trial, name: str) -> bool:
    """An effect whose sizes are all where it does nothing explains nothing, wherever it is."""
    if name == REFIT:
        return False
    instance = newest_instance(trial.state.model, name)
    for p in catalogue_of(trial.state.model)[name]["parameters"]:
        if p["role"] in NO_SIZE:
            continue
        value = trial.state.model.get(f"{instance}.{p['name']}")
        if abs(value - p["neutral"]) > 1e-3 * abs(p["default"] - p["neutral"]):
            return False
    return True
