# SPDX-License-Identifier: Apache-2.0
"""Robots of one kind: what all of them lack, and what one lacks alone.

Each robot has a table of evidence of its own, with sizes of its own. What all lack, a set C of
effects and dependences, is there once in the prior, and so is what their base always lacked, a set
A, with what the base's own log y_0 says of it; what a robot r lacks beside, as if it were alone:

    p(C, A | y)  ~  p(C, A) p(y_0 | A) prod_r sum over S_r with C in S_r of
                    p(y_r | S_r, A) p(S_r without C)

A robot's posterior beliefs p(S_r, A | y_r) hold its evidence times p(S_r, A) p(y_0 | A), so that
they are weighed anew by p(S_r without C) / p(S_r, A) / p(y_0 | A).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.special import softmax

from twinmill.inference.answer import summed
from twinmill.inference.posterior import Belief, beliefs
from twinmill.inference.search import log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import BEYOND, Table

Things = frozenset[str]  # effects and dependences
Common = tuple[Things, Things]  # what all lack, and what their base always lacked
WIDEST = 8  # things of which all sets compete as what all robots lack
LEAST = PRIORS.member  # probability, in one robot alone, of a thing that may be common


@dataclass(frozen=True)
class Shared:
    """Posterior of what robots lack together and each by itself.

    Attributes:
        sets: probability of each set that all robots lack.
        own: for each robot, probability of each thing that it lacks beside what all do.
        beliefs: for each robot, all hypotheses with their probabilities in the light of the others.
        words: things that are dependences; the others are effects.
    """

    sets: dict[Things, float]
    own: list[dict[str, float]]
    beliefs: list[list[Belief]]
    words: Things

    @property
    def nothing(self) -> float:
        """Probability that there is nothing that all robots lack."""
        return self.sets.get(frozenset(), 0.0)

    @property
    def things(self) -> dict[str, float]:
        """Probability of each thing that all robots lack it, likeliest first."""
        return _likeliest_first((p, things) for things, p in self.sets.items())

    def to_json(self) -> dict[str, Any]:
        """Field `shared` of `twinmill diagnose --json`."""
        return {
            "nothing": self.nothing,
            **self._by_kind(self.things),
            "own": [self._by_kind(own) for own in self.own],
        }

    def _by_kind(self, things: dict[str, float]) -> dict[str, dict[str, float]]:
        kinds: dict[str, dict[str, float]] = {"effects": {}, "depends_on": {}}
        for name, p in things.items():
            if p >= LEAST:
                kinds["depends_on" if name in self.words else "effects"][name] = p
        return kinds


def shared(tables: Sequence[Table]) -> Shared:
    """Posterior of what robots lack together, from a table of evidence of each, two at least."""
    each = [_Robot.of(table) for table in tables]
    every = [(things, always) for always in _always(each) for things in _possible(each)]
    logs = np.array([[robot.log_given(common) for common in every] for robot in each])
    prior = np.array([_log_before(each, common) for common in every])
    p = softmax(prior + logs.sum(axis=0))
    own = [robot.beside(every, p) for robot in each]
    told = [robot.in_their_light(every, p) for robot in each]
    sets: dict[Things, float] = {}
    for (things, _), chance in zip(every, p.tolist(), strict=True):
        sets[things] = sets.get(things, 0.0) + chance
    return Shared(sets, own, told, each[0].words)


@dataclass(frozen=True)
class _Robot:
    """Beliefs about one robot.

    Attributes:
        found: B beliefs of this robot alone.
        things: of each of them.
        always: what the base always lacked, of each of them.
        log_own: (B,) log evidence of that in the base's own log.
        p: (B,) their probabilities.
        words: dependences that compete.
        candidates: how many effects compete.
    """

    found: list[Belief]
    things: list[Things]
    always: list[Things]
    log_own: np.ndarray
    p: np.ndarray
    words: Things
    candidates: int

    @classmethod
    def of(cls, table: Table) -> "_Robot":
        found = beliefs(table)
        things = [frozenset((*b.effects, *b.words)) for b in found]
        always = [frozenset(b.always) for b in found]
        p, log_own = (np.array([getattr(b, k) for b in found]) for k in ("probability", "log_own"))
        words = frozenset(table.words)
        return cls(found, things, always, log_own, p, words, len(table.candidates))

    def log_prior(self, things: Things) -> float:
        """Log prior of what a robot lacks."""
        other = len(things & self.words)
        each = np.log(PRIORS.outside / len(self.words))
        of_words = other * each if other else np.log(1 - PRIORS.outside)
        return float(of_words) + log_prior_of_effects(len(things) - other, self.candidates)

    def given(self, common: Common) -> np.ndarray:
        """(B,) weights of the beliefs where all robots lack some things; 0 where one has them."""
        lack, lacked = common
        less = [
            self.log_prior(t - lack) - self.log_prior(t | a) - own
            for t, a, own in zip(self.things, self.always, self.log_own, strict=True)
        ]
        rows = zip(self.things, self.always, strict=True)
        there = np.array([lack <= t and lacked == a for t, a in rows])
        return self.p * np.where(there, np.exp(less), 0.0)

    def log_given(self, common: Common) -> float:
        """Log evidence that all lack some things, over that of this robot alone.

        What its search did not keep is as unlikely as what that leaves out.
        """
        return float(np.log(max(self.given(common).sum(), np.exp(-BEYOND))))

    def beside(self, every: Sequence[Common], p: np.ndarray) -> dict[str, float]:
        """Probability of each thing that this robot lacks beside what all do, likeliest first."""
        found: list[tuple[float, Things]] = []
        for (lack, _), weights in zip(every, self._joint(every, p), strict=True):
            rest = (things - lack for things in self.things)
            found += zip(weights.tolist(), rest, strict=True)
        return _likeliest_first(found)

    def in_their_light(self, every: Sequence[Common], p: np.ndarray) -> list[Belief]:
        """Beliefs with the probabilities that they have where robots lack some things together."""
        weights = self._joint(every, p).sum(axis=0)
        rows = zip(self.found, (weights / weights.sum()).tolist(), strict=True)
        return [replace(belief, probability=chance) for belief, chance in rows]

    def _joint(self, every: Sequence[Common], p: np.ndarray) -> np.ndarray:
        """(S, B) probabilities of what all robots lack, and of a belief on this one."""
        weights = np.array([self.given(common) for common in every])
        sums = np.maximum(weights.sum(axis=1, keepdims=True), np.exp(-BEYOND))
        return weights * p[:, None] / sums


def _likeliest_first(rows: Iterable[tuple[float, Things]]) -> dict[str, float]:
    """Probability of each thing, of sets of them with theirs."""
    total: dict[str, float] = {}
    for p, things in rows:
        for name in things:
            total[name] = total.get(name, 0.0) + p
    return dict(sorted(total.items(), key=lambda item: (-item[1], item[0])))


def _possible(each: Sequence[_Robot]) -> list[Things]:
    """Sets that all robots may lack: of the things that are likeliest in most."""
    rows = [row for robot in each for row in zip(robot.p.tolist(), robot.things, strict=True)]
    names = [name for name, p in _likeliest_first(rows).items() if p >= LEAST][:WIDEST]
    return [frozenset(own) for k in range(len(names) + 1) for own in combinations(names, k)]


def _always(each: Sequence[_Robot]) -> list[Things]:
    """Sets that their base may always have lacked, nothing among them."""
    rows = [row for robot in each for row in zip(robot.always, robot.p.tolist(), strict=True)]
    return [own for own, p in summed(rows).items() if p >= LEAST or not own]


def _log_before(each: Sequence[_Robot], common: Common) -> float:
    """Log prior of what all lack and their base always lacked, and what its own log says."""
    lack, lacked = common
    rows = [row for r in each for row in zip(r.always, r.log_own.tolist(), strict=True)]
    own = next(log_own for always, log_own in rows if always == lacked)
    return each[0].log_prior(lack | lacked) + own
