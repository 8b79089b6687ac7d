# SPDX-License-Identifier: Apache-2.0
"""Searches for what a model lacks, by the score on parts of the data that were not fitted to.

In each round every candidate is screened by what it would take away if all were linear; the best
are fitted. One is accepted if its held-out evidence is beyond doubt, blocks agree on it, and it
matters. Afterwards those that later ones made needless are dropped.
"""

from collections.abc import Callable
from dataclasses import replace

from twinmill.diagnosis.acceptance import began_before, best_of, cost, proven, rank, when_s
from twinmill.diagnosis.rounds import Round, Search
from twinmill.diagnosis.screening import Screened, candidates, likely_pairs, promising, screen
from twinmill.diagnosis.settings import SETTINGS, Settings
from twinmill.diagnosis.ties import ties_of
from twinmill.diagnosis.trials import (
    REFIT,
    State,
    Trial,
    cross_validate,
    fitted,
    nearer,
    without_effect,
)
from twinmill.fitting.starts import Starts
from twinmill.model.parameters import lasts_for_a_while, with_role

PAUSE_S = 2.0  # between the end of what lasts for a while and its next begin


def search(
    state: State,
    progress: Callable[[str], None] = lambda _: None,
    settings: Settings = SETTINGS,
    known: float = 1.0,
    *,
    begun: Callable[[Search], None] = lambda _: None,
) -> Search:
    """Adds what is missing until nothing is worth it.

    Args:
        state: where it starts.
        progress: told in words what is being done.
        settings: numbers that decide.
        known: score that the model has on the logs that it was fitted to; 0 where none is known.
            What it missed there it misses here, too, and in the same way over and over, so that
            evidence must be stronger where the score is no worse than that.
        begun: told the search as it begins; it grows, and is whole at any moment.
    """
    start = nearer(state)
    first = fitted(start)
    if first.held_score < settings.news * known:
        settings = settings.stricter(settings.usual * known)
    done = Search(start, [], first, [], settings)
    starts: dict[str, Starts] = {}
    begun(done)
    _forward(done, starts, progress)
    progress(f"{_told(done)}exchanging what was found for other effects")
    return _exchanged(done, starts)


def _forward(done: Search, starts: dict[str, Starts], progress: Callable[[str], None]) -> None:
    """Round after round, until one accepts nothing."""
    settings, first_excess = done.settings, max(done.last.held_score**2 - 1, 0.0)
    for number in range(settings.most):
        before, words = done.last, f"{_told(done)}round {number + 1}: "
        progress(f"{words}screening the catalogue")
        screened = screen(before, starts)
        this = Round(before, screened, [])
        done.rounds.append(this)
        for candidate in promising(screened, settings)[: settings.fitted]:
            progress(f"{words}trying {candidate.name}")
            this.trials.append(cross_validate(before, (candidate.name,), candidate.start))
        accepted = best_of(before, this.trials, first_excess, settings)
        if accepted is None:
            progress(f"{words}trying pairs")
            for pair in likely_pairs(before, screened, settings):
                this.trials.append(cross_validate(before, pair))
            accepted = best_of(before, this.trials, first_excess, settings)
        this.trials.sort(key=lambda t: t.fit.held_cost)
        if accepted is None:
            return
        last, gone = _pruned(accepted, [*done.found, *accepted.names], settings)
        this.accepted, done.last, done.dropped = accepted, last, [*done.dropped, *gone]
        this.tied = ties_of(this, settings)


def _told(done: Search) -> str:
    """Findings so far, in words for a person who waits."""
    return f"found {', '.join(done.found)}; " if done.found else ""


def comes_again(done: Search, name: str) -> tuple[float, float] | None:
    """When an effect that begins and ends comes a second time, s since the first command.

    None if it does not, or if the second time touches the first, which is another form of one.
    """
    if name not in done.found or not lasts_for_a_while(name):
        return None
    (again,) = screen(done.last, names=[name])
    trial = cross_validate(done.last, (name,), again.start)
    (begin_s, end_s), (again_s, over_s) = when_s(done.last, name), when_s(trial, name)
    apart_s = max(again_s - end_s, begin_s - over_s)
    fresh = proven(trial, done.last.held_score, done.settings) and not began_before(trial, name)
    return (again_s, over_s) if fresh and apart_s > PAUSE_S else None


def _exchanged(done: Search, starts: dict[str, Starts]) -> Search:
    """With each effect exchanged for another one, if that is better; an exchange is one more round.

    An effect was accepted beside what was known in its round; what came later may do a part of it,
    and leave a rest that another one takes as well or better (a forward search alone cannot see
    that; Miller 2002 calls this sequential replacement). What is as good is tied.
    """
    rounds, last, settings = list(done.rounds), done.last, done.settings
    kept = list(done.found)
    for name in [n for n in done.found if n != REFIT]:
        if name not in kept:
            continue
        base = without_effect(last, name)
        if base is None:
            continue
        others = _rivals(base, name, beside=len(kept) > 1, starts=starts, settings=settings)
        trials = [cross_validate(base, (s.name,), s.start) for s in others]
        close = [t for t in trials if cost(t, settings) < cost(last, settings) + settings.tie]
        if not close:
            continue
        stale = [t for t in close if t.names == (REFIT,)]
        best = min(stale or close, key=lambda t: rank(t, settings))
        if not stale and cost(best, settings) >= cost(last, settings):
            this = next(r for r in reversed(rounds) if r.accepted and name in r.accepted.names)
            known = {n for t in this.tied for n in t.names}
            this.tied += [t for t in close if t.names[0] not in known]
            continue
        same = [t for t in close if cost(t, settings) < cost(best, settings) + settings.tie]
        if cost(last, settings) < cost(best, settings) + settings.tie:
            same.append(replace(last, names=(name,)))
        tied = [t for t in same if t is not best]
        rounds.append(Round(base, rounds[-1].screened, trials, best, tied))
        kept = [n for n in kept if n != name]
        last, gone = _pruned(best, kept, settings)
        kept = [*(n for n in kept if n not in gone), *best.names]
    accepted = [n for r in rounds if r.accepted for n in r.accepted.names]
    return Search(done.start, rounds, last, [n for n in accepted if n not in kept], settings)


def _rivals(
    base: Trial, name: str, *, beside: bool, starts: dict[str, Starts], settings: Settings
) -> list[Screened]:
    """Candidates in the place of an effect, once all else that was found is there.

    Args:
        base: the last state without the effect.
        name: of the effect.
        starts: of effects whose start is searched.
        settings: numbers that decide.
        beside: whether something else was found; if not, the first round has compared them.
    """
    late = [n for n in candidates(base.state) if with_role(n, "lateness")]
    late = [n for n in late if n != name] if with_role(name, "lateness") else []
    if not beside:
        return screen(base, starts, late) if late else []
    screened = screen(base, starts)
    own = next((s.gain for s in screened if s.name == name), 0.0)
    likely = [s for s in promising(screened, settings) if s.gain > settings.rival * own]
    likely = [s for s in likely if s.name != name][: settings.exchanged]
    names = {s.name for s in likely}
    return likely + [s for s in screened if s.name in late and s.name not in names]


def _pruned(trial: Trial, names: list[str], settings: Settings) -> tuple[Trial, list[str]]:
    """Drops effects that the latest made needless."""
    gone = []
    for name in [n for n in names if n != REFIT and n not in trial.names]:
        less = without_effect(trial, name)
        if less is None:
            continue
        evidence, *_ = trial.fit.against(less.fit)
        if evidence < settings.evidence / 2:
            gone.append(name)
            trial = replace(less, names=trial.names)
    return trial, gone
