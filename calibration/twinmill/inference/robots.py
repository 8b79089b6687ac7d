# SPDX-License-Identifier: Apache-2.0
"""Robots of one kind: what all of them lack, and what one lacks alone.

Each robot has a table of evidence of its own, with sizes of its own. What all lack, a set C of
effects and dependences, is there once in the prior; what a robot r lacks beside it, as if it were
alone:

    p(C | y)  ~  p(C) prod_r sum over S_r with C in S_r of  p(y_r | S_r) p(S_r without C)

A robot's posterior beliefs p(S_r | y_r) hold its evidence times p(S_r), so that they are weighed
anew by p(S_r without C) / p(S_r).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import numpy as np
from scipy.special import softmax

from twinmill.inference.posterior import Belief, beliefs
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
        either: for each robot, probability that it lacks each thing, alone or as all do.
    """

    sets: dict[Things, float]
    own: list[dict[str, float]]
    either: list[dict[str, float]]

    @property
    def things(self) -> dict[str, float]:
        """Probability of each thing that all lack it, likeliest first."""
        names = sorted(reduce(frozenset.union, self.sets, frozenset()))
        p = {n: sum(v for things, v in self.sets.items() if n in things) for n in names}
        return dict(sorted(p.items(), key=lambda item: -item[1]))

    @property
    def likeliest(self) -> Things:
        """Set that all lack with the largest probability."""
        return max(self.sets, key=self.sets.__getitem__)


def shared(tables: Sequence[Table]) -> Shared:
    """What robots lack together, from a table of evidence of each."""
    each = [_Robot.of(table) for table in tables]
    sets = _possible(each)
    logs = np.array([[robot.log_given(things) for things in sets] for robot in each])
    prior = np.array([_log_prior(things, each[0]) for things in sets])
    p = softmax(prior + logs.sum(axis=0))
    own, either = zip(*(robot.weighed(sets, p) for robot in each), strict=True)
    return Shared(dict(zip(sets, p.tolist(), strict=True)), [*own], [*either])


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
        p = np.array([b.probability for b in found])
        return cls(list(map(_things, found)), p, frozenset(table.words), len(table.candidates))

    def log_prior(self, things: Things) -> float:
        """Log prior of what this robot lacks, were it alone."""
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
        """Log evidence that all lack some things, over that of the robot alone.

        What this robot's search did not keep is as unlikely as what it leaves out.
        """
        return float(np.log(max(self.given(common).sum(), np.exp(-BEYOND))))

    def weighed(
        self, sets: Sequence[Things], p: np.ndarray
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Probability of each thing that this robot lacks beside what all do, and at all."""
        own: dict[str, float] = {}
        either: dict[str, float] = {}
        for common, chance in zip(sets, p, strict=True):
            weights = self.given(common)
            weights = weights / max(weights.sum(), 1e-300) * chance
            for things, weight in zip(self.things, weights, strict=True):
                for name in things | common:
                    either[name] = either.get(name, 0.0) + float(weight)
                for name in things - common:
                    own[name] = own.get(name, 0.0) + float(weight)
        return own, either


def _things(b: Belief) -> Things:
    return frozenset((*b.effects, *b.words))


def _log_prior(things: Things, robot: _Robot) -> float:
    return robot.log_prior(things)


def _possible(each: Sequence[_Robot]) -> list[Things]:
    """Sets that all robots may lack: of the things that are likeliest in most."""
    total: dict[str, float] = {}
    for robot in each:
        for things, p in zip(robot.things, robot.p, strict=True):
            for name in things:
                total[name] = total.get(name, 0.0) + float(p)
    names = sorted((n for n, p in total.items() if p >= LEAST), key=lambda n: -total[n])[:WIDEST]
    return [frozenset(own) for k in range(len(names) + 1) for own in combinations(names, k)]
