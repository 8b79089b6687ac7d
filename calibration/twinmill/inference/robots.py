# SPDX-License-Identifier: Apache-2.0
"""Robots of one kind: what all of them lack, and what one lacks alone.

Each robot has a table of evidence of its own, with sizes of its own. What all lack, a set C of
effects and dependences, is there once in the prior; what a robot r lacks beside it, as if it were
alone:

    p(C | y)  ~  p(C) prod_r sum over S_r with C in S_r of  p(y_r | S_r) p(S_r without C)

A robot's posterior beliefs p(S_r | y_r) hold its evidence times p(S_r), so that they are weighed
anew by p(S_r without C) / p(S_r).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.special import softmax

from twinmill.inference.posterior import beliefs
from twinmill.inference.search import log_prior_of_effects
from twinmill.inference.settings import PRIORS
from twinmill.inference.table import BEYOND, Table

Things = frozenset[str]  # effects and dependences
WIDEST = 8  # things of which all sets compete as what all robots lack
LEAST = PRIORS.member  # probability, in one robot alone, of a thing that may be common


@dataclass(frozen=True)
class Shared:
    """Posterior of what robots lack together and each by itself.

    Attributes:
        sets: probability of each set that all robots lack.
        own: for each robot, probability of each thing that it lacks beside what all do.
        words: things that are dependences; the others are effects.
    """

    sets: dict[Things, float]
    own: list[dict[str, float]]
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
        """Field `shared` of `twinmill lab infer --json`."""
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
    sets = _possible(each)
    logs = np.array([[robot.log_given(things) for things in sets] for robot in each])
    prior = np.array([each[0].log_prior(things) for things in sets])
    p = softmax(prior + logs.sum(axis=0))
    own = [robot.beside(sets, p) for robot in each]
    return Shared(dict(zip(sets, p.tolist(), strict=True)), own, each[0].words)


@dataclass(frozen=True)
class _Robot:
    """Beliefs about one robot.

    Attributes:
        things: of each belief.
        p: (B,) their probabilities.
        words: dependences that compete.
        candidates: how many effects compete.
    """

    things: list[Things]
    p: np.ndarray
    words: Things
    candidates: int

    @classmethod
    def of(cls, table: Table) -> "_Robot":
        found = beliefs(table)
        things = [frozenset((*b.effects, *b.words)) for b in found]
        p = np.array([b.probability for b in found])
        return cls(things, p, frozenset(table.words), len(table.candidates))

    def log_prior(self, things: Things) -> float:
        """Log prior of what a robot lacks."""
        other = len(things & self.words)
        each = np.log(PRIORS.outside / len(self.words))
        of_words = other * each if other else np.log(1 - PRIORS.outside)
        return float(of_words) + log_prior_of_effects(len(things) - other, self.candidates)

    def given(self, common: Things) -> np.ndarray:
        """(B,) weights of the beliefs where all robots lack some things; 0 where one has them."""
        less = [self.log_prior(t - common) - self.log_prior(t) for t in self.things]
        there = np.array([common <= t for t in self.things])
        return self.p * np.where(there, np.exp(less), 0.0)

    def log_given(self, common: Things) -> float:
        """Log evidence that all lack some things, over that of this robot alone.

        What its search did not keep is as unlikely as what that leaves out.
        """
        return float(np.log(max(self.given(common).sum(), np.exp(-BEYOND))))

    def beside(self, sets: Sequence[Things], p: np.ndarray) -> dict[str, float]:
        """Probability of each thing that this robot lacks beside what all do, likeliest first."""
        found: list[tuple[float, Things]] = []
        for common, chance in zip(sets, p, strict=True):
            weights = self.given(common)
            weights *= chance / max(weights.sum(), np.exp(-BEYOND))
            rest = (things - common for things in self.things)
            found += zip(weights.tolist(), rest, strict=True)
        return _likeliest_first(found)


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
