# SPDX-License-Identifier: Apache-2.0
"""Effects that the data cannot tell from the accepted ones."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinmill.diagnosis.acceptance import began_before
from twinmill.diagnosis.rounds import Round
from twinmill.diagnosis.screening import candidates
from twinmill.diagnosis.settings import Settings
from twinmill.diagnosis.trials import REFIT, State, Trial, cross_validate, fitted
from twinmill.fitting.compare import GOOD
from twinmill.model.parameters import catalogue, needing
from twinmill.predict.datasets import Trajectory


def ties_of(this: Round, settings: Settings) -> list[Trial]:
    """Other trials of the round that the data cannot tell from the accepted one."""
    accepted = this.accepted
    assert accepted is not None
    if len(accepted.names) > 1:
        return []
    if accepted.names[0] == REFIT:
        return _imitators(accepted, this.before, this.trials, settings)
    columns = {s.name: s.columns for s in this.screened}
    tied = []
    for trial in this.trials:
        if trial is accepted or len(trial.names) > 1 or trial.names[0] == REFIT:
            continue
        if began_before(trial, trial.names[0]):
            continue
        apart, _, blocks_t = accepted.fit.against(trial.fit)
        apart += settings.each * (len(trial.fit.x) - len(accepted.fit.x))
        same = canonical_correlation(columns[accepted.names[0]], columns[trial.names[0]])
        below = max(accepted.held_score, trial.held_score) < 1.0  # differences there are no news
        close = apart < settings.tie and (blocks_t < 2.0 or below)
        close |= _is_as_good(accepted, trial, settings)
        rivals = close and in_common(this.before, accepted, trial) > settings.unlike
        told = _is_within_the_table(this.before, accepted, trial, settings)
        if rivals or told or (same > settings.alike and apart < settings.evidence):
            tied.append((same, trial))
    nearest = sorted(tied, key=lambda pair: -pair[0])[: settings.group - 1]
    return [trial for _, trial in nearest]


def _is_as_good(accepted: Trial, trial: Trial, settings: Settings) -> bool:
    """True if the poorer of a wheel's and a floor's effect leaves nothing either, and does most.

    How the push of wheels becomes motion over the floor no plant has quite right, so that on the
    robot it may be the better one.
    """
    if trial.held_score > GOOD:
        return False
    cards = catalogue()
    stages = {cards[t.names[0]]["stage"] for t in (accepted, trial)}
    if stages != {"wheel", "ground"}:
        return False
    return trial.evidence > settings.as_good * accepted.evidence


def _is_within_the_table(before: Trial, one: Trial, other: Trial, settings: Settings) -> bool:
    """True if the difference of two bends lies within the error of speeds that other logs told.

    Then the better one is better by an error of the table alone.
    """
    if not (before.state.told_speeds and bends_speed(one.names[0]) and bends_speed(other.names[0])):
        return False
    most = min(settings.told_speeds, settings.same_way * way_apart(before, one))
    return way_apart(one, other) < most


def canonical_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Largest cosine between the smaller space and its image in the other: 1 if one imitates it.

    Smallest of the canonical correlations over the dimensions of the smaller space.
    """
    qa, qb = (_orthonormal(x) for x in (a, b))
    if not qa.shape[1] or not qb.shape[1]:
        return 0.0
    values = np.linalg.svd(qa.T @ qb, compute_uv=False)
    return float(values[: min(qa.shape[1], qb.shape[1])].min())


def _orthonormal(x: np.ndarray) -> np.ndarray:
    u, s, _ = np.linalg.svd(x, full_matrices=False)
    return u[:, s > 1e-6 * max(s[0], 1e-300)] if len(s) else u


def in_common(before: Trial, one: Trial, other: Trial) -> float:
    """Cosine between what two trials take of the errors: 0 if each explains something else."""
    rows = [t.fit.errors for t in (before, one, other)]
    first, second = rows[0] - rows[1], rows[0] - rows[2]
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / max(size, 1e-300)


def way_apart(one: Trial, other: Trial) -> float:
    """How far apart predictions of two states are at the longest horizon, as a share of the way."""
    apart, way = 0.0, 0.0
    for data, first, second in zip(
        one.fit.datasets, one.fit.state[0], other.fit.state[0], strict=True
    ):
        if isinstance(data, Trajectory):
            moved = data.as_errors(first) - data.as_errors(second)
            apart += float(np.nansum(moved[:, -1, :2] ** 2))
            way += float(np.nansum(data.measured[:, -1, :2] ** 2))
    return float(np.sqrt(apart / max(way, 1e-12)))


def bends_speed(effect: str) -> bool:
    """True if it bends the steady speed over the command."""
    return effect in of_levels() and effect in needing("steady_speed")


def of_levels() -> list[str]:
    """Effects of the drive that only several levels of the command tell from other gains."""
    cards = {name: entry["identify"] for name, entry in catalogue().items()}
    return [n for n, own in cards.items() if "levels" in own and "arcs" not in own]


def _imitators(
    base: Trial, before: Trial, trials: Sequence[Trial], settings: Settings
) -> list[Trial]:
    """Trials of one effect of the levels that do what other numbers of the base do."""
    fall = before.held_score**2 - base.held_score**2
    if fall < settings.worth * before.held_score**2:  # robots' own gains took it all
        return []
    least = settings.imitates * fall
    levels = of_levels()
    alike = [
        t
        for t in trials
        if len(t.names) == 1
        and t.names[0] in levels
        and before.held_score**2 - t.held_score**2 > least
    ]
    return sorted(alike, key=lambda t: t.fit.held_cost)[: settings.group - 1]


def instead_of_drift(state: State, drifted: Trial, settings: Settings) -> list[str]:
    """Effects that do what gains do that were let drift, if the gains are held.

    Args:
        state: where a search starts, with gains that are free.
        drifted: the same fitted.
        settings: numbers that decide.
    """
    held = fitted(replace(state, free=()))
    trials = [cross_validate(held, (n,)) for n in of_levels() if n in candidates(held.state)]
    return [t.names[0] for t in _imitators(drifted, held, trials, settings)]
