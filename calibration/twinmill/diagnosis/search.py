# SPDX-License-Identifier: Apache-2.0
"""Searches for missing effects: one at a time, then pairs; drops what later ones replace."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from twinmill.diagnosis.candidates import candidates
from twinmill.diagnosis.evidence import State, Trial, attempt, fall, without
from twinmill.diagnosis.screen import Screening, screen
from twinmill.model.freedom import catalogue, effect_names

ALPHA = 0.01  # chance of accepting anything if nothing is missing, over all candidates
TRIED, PAIRED = 6, 8
SURE, BEHIND = 2, 0.2  # so many are tried in any case, others above this share of the best gain
CLOSE = 1.02  # held-out scores whose ratio is nearer to 1 are decided by chi2
TIE_CHI2 = 6.0  # difference of held-out chi2, over the excess scatter, that decides nothing
DELAY, CLOCK_OFF = "input_delay", "clock_offset"
SILENT = 0.5  # score below which the rest is arithmetic of who made the log, and no physics
MOST = 4
WORTH = 0.98  # each effect must lower the held-out score to this share: certain is not important


@dataclass(frozen=True)
class Judged:
    """A trial and what it is worth: log evidence against the state it started from."""

    trial: Trial
    evidence: float
    p_value: float


@dataclass
class Round:
    """One step of the search: what was screened, tried, and accepted (None: nothing)."""

    before: Trial
    screening: Screening
    judged: list[Judged]
    accepted: Judged | None = None


@dataclass
class Search:
    """The whole search."""

    rounds: list[Round] = field(default_factory=list)
    blind: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)


def search(
    state: State, say: Callable[[str], None], barred: Collection[str] = ()
) -> tuple[Search, State]:
    """Adds effects until none is worth it.

    Args:
        state: the refitted base.
        say: told in words what is being done.
        barred: effects that are not to be thought of.
    """
    done = Search()
    for number in range(MOST):
        say(f"round {number + 1}: screening the catalogue")
        found, blind = candidates(state.scenes, barred)
        done.blind = blind if number == 0 else done.blind
        screening = screen(state.scenes, state.free, found)
        before = attempt(state, ())
        limit = np.log(max(len(found), 1) / ALPHA)
        this = Round(before, screening, [])
        done.rounds.append(this)
        if before.score < SILENT:
            break
        for i in _worth_trying(screening, limit):
            say(f"round {number + 1}: trying {screening.found[i].candidate.effect}")
            this.judged.append(_judge(state, before, screening, (i,)))
        this.accepted = _best(before, this.judged, limit)
        if this.accepted is None or _only_tables(state):
            say(f"round {number + 1}: trying pairs")
            likely = _pairs(screening, 2 * limit)[:2]
            for pair in _drive_pairs(screening) if _only_tables(state) else likely:
                this.judged.append(_judge(state, before, screening, pair))
            this.accepted = _best(before, this.judged, limit + np.log(len(found)))
        this.accepted = _delay_for_clock(this)
        this.judged.sort(key=lambda j: j.trial.score)
        if this.accepted is None:
            break
        state = _settle(replace(state, scenes=this.accepted.trial.scenes))
        state = _prune(state, done, limit)
    return done, state


def _promising(screening: Screening, least: float) -> list[int]:
    """Candidates whose linear gain leaves a chance of acceptance, best first."""
    worth = [s.gain / s.excess for s in screening.found]
    return [i for i in np.argsort(worth)[::-1] if worth[i] > least]


def _worth_trying(screening: Screening, least: float) -> list[int]:
    """The best few, and of the next those that are not far behind."""
    top = _promising(screening, least)[:TRIED]
    worth = [screening.found[i].gain / screening.found[i].excess for i in top]
    return [i for k, i in enumerate(top) if k < SURE or worth[k] > BEHIND * worth[0]]


def _judge(state: State, before: Trial, screening: Screening, which: tuple[int, ...]) -> Judged:
    found = [screening.found[i] for i in which]
    trial = attempt(state, tuple(f.candidate.effect for f in found))
    excess = max(f.excess for f in found)
    evidence = fall(before, trial) / (2 * excess)
    return Judged(trial, evidence, min(f.p_value for f in found))


def _best(before: Trial, judged: list[Judged], limit: float) -> Judged | None:
    """Of those with enough evidence, and that matter, the one with the smallest held-out error."""
    good = [
        j
        for j in judged
        if j.evidence > limit and j.trial.score < WORTH ** len(j.trial.effects) * before.score
    ]
    if not good:
        return None
    smallest = min(j.trial.score for j in good)
    close = [j for j in good if j.trial.score <= CLOSE * smallest]
    return min(close, key=lambda j: j.trial.chi2)


def _delay_for_clock(this: Round) -> Judged | None:
    """A delay in place of a clock that is off, where both explain the same.

    The clock's offset is in question only if a calibration log told it: it is then the delay that
    is new.
    """
    if this.accepted is None or this.accepted.trial.effects != (CLOCK_OFF,):
        return this.accepted
    enough = this.accepted.evidence - TIE_CHI2 / 2
    delays = [j for j in this.judged if j.trial.effects == (DELAY,) and j.evidence > enough]
    return delays[0] if delays else this.accepted


def _pairs(screening: Screening, least: float) -> list[tuple[int, int]]:
    """Pairs of effects, by what they explain together beyond the better one alone."""
    top = _promising(screening, 0.0)[:PAIRED]
    worth = {}
    for i, j in combinations(top, 2):
        both = np.hstack([screening.signatures[i], screening.signatures[j]])
        gram, moment = both.T @ both, both.T @ screening.left
        gain = moment @ np.linalg.lstsq(gram, moment, rcond=1e-9)[0]
        alone = max(screening.found[i].gain, screening.found[j].gain)
        excess = max(screening.found[i].excess, screening.found[j].excess)
        worth[i, j] = (gain - alone) / excess
    return [p for p in sorted(worth, key=lambda pair: -worth[pair]) if worth[p] > least]


def _only_tables(state: State) -> bool:
    """Nothing but steady-state tables: a trial is cheap, and the drive's curve is all there is."""
    return all(s.noise is None for s in state.scenes)


def _drive_pairs(screening: Screening) -> list[tuple[int, int]]:
    """Pairs of effects between duty and wheel, which hide each other: dead zone and curve."""
    stages = {name: entry["stage"] for name, entry in catalogue().items()}
    drive = [
        i for i, s in enumerate(screening.found) if stages[s.candidate.effect] in ("duty", "wheel")
    ]
    return list(combinations(drive, 2))


def _settle(state: State) -> State:
    """Takes the noise that the richer model leaves."""
    for scene in state.scenes:
        scene.settle_noise()
    return state


def _prune(state: State, done: Search, limit: float) -> State:
    """Drops effects that the latest made needless."""
    names = effect_names(state.model)
    fresh = len(names) - len(done.rounds[-1].accepted.trial.effects)
    given = (
        fresh
        - sum(len(r.accepted.trial.effects) for r in done.rounds[:-1] if r.accepted)
        + len(done.dropped)
    )
    whole = attempt(state, ()) if fresh > given else None
    for index in range(fresh - 1, given - 1, -1):
        less = without(state, index)
        if fall(less, whole) / 2 < limit:
            done.dropped.append(names[index])
            state, whole = replace(state, scenes=less.scenes), less
    return state
