# SPDX-License-Identifier: Apache-2.0
"""Spike and slab over short stretches of time: something else happens at few moments of a log."""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, expit

from twinmill.inference.evidence import Bank, Linear
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion

MOMENTS = "moments"  # the word that an answer says
BIN_S = 0.5
LENGTHS = (1, 2, 4)  # bins that a moment may last
WAYS = 2  # all gains alike, or each number by itself
MOST = 32  # moments that are let in, one by one: more are no moments
SPREAD = 10.0  # pseudo-observations behind the expected share of moments: known to a factor of two


@dataclass(frozen=True)
class Rate:
    """Belief on the share of moments at which something happens.

    Attributes:
        there: probability that anything ever happens.
        on, off: of the beta distribution of its share, if so.
    """

    there: float = 1.0
    on: float = PRIORS.moments * SPREAD
    off: float = (1 - PRIORS.moments) * SPREAD

    def log_chance(self, on: np.ndarray, count: int) -> np.ndarray:
        """Log probability that just these moments are on, so many of `count`."""
        share = betaln(self.on + on, self.off + count - on) - betaln(self.on, self.off)
        never = np.where(np.equal(on, 0), 1 - self.there, 0.0)
        with np.errstate(divide="ignore"):
            return np.logaddexp(np.log(never), np.log(self.there) + share)


def columns(m: Motion) -> np.ndarray:
    """(B + 1, 4, W, 3) displacements by a gain or a push of usual size up to each of the bins.

    A moment's columns are the difference of two of these.
    """
    number = np.floor((m.t_s - m.t_s[0]) / BIN_S).astype(int)
    moves = m.moves[:, None] * m.usual
    ways = PRIORS.sudden * np.array([
        m.moved * (1, 1, 0), m.moved * (0, 0, 1), moves * (0, 1, 0), moves * (0, 0, 1),
    ])  # fmt: skip
    bins = np.unique(number)
    before = number[None] < np.r_[bins, bins[-1] + 1][:, None]
    return before[:, None, :, None] * ways


@dataclass(frozen=True)
class Moment:
    """One moment that was let in.

    Attributes:
        begin, end: numbers of its first bin and of the bin after it.
        white: (k, R) whitened columns.
    """

    begin: int
    end: int
    white: np.ndarray


@dataclass(frozen=True)
class Found:
    """Transients of a log, as a greedy search found them beside one linear model.

    A moment is a transient of 0.5, 1 or 2 s, in which all motion is scaled, or in which travel,
    turning and two additive velocities change each by itself. In each round of the search the one
    that raises the evidence most is taken, so the first k of them are the best k that it knows.

    Attributes:
        gains: (n + 1,) log evidence (natural logarithm) with the first 0, 1, .. n moments, less
            that without any; their sizes are integrated out, and the prior probability that they
            happen at all is not in it: `log_chance` has that.
        on: the n moments, in the order in which they were taken.
        count: bins of 0.5 s in the log, each of which may begin one.
    """

    gains: np.ndarray
    on: tuple[Moment, ...]
    count: int

    def log_evidence(self, rate: Rate) -> float:
        """Gain in log evidence over no moment, prior included, at the best number of moments.

        Args:
            rate: belief on how often moments happen.
        """
        return float(self.by_number(rate).max())

    def likeliest(self, rate: Rate) -> int:
        """Number of moments at which `log_evidence` has its maximum."""
        return int(self.by_number(rate).argmax())

    def after(self, there: float) -> Rate:
        """Belief on the rate of moments in later logs, by what this one has.

        Args:
            there: probability before this log that moments ever happen to this robot.
        """
        some = Rate()
        on, odds = self.likeliest(some), np.log(there / (1 - there)) + self.log_evidence(some)
        return Rate(float(expit(odds)), some.on + on, some.off + self.count - on)

    def by_number(self, rate: Rate) -> np.ndarray:
        """(n + 1,) gain in log evidence with so many on."""
        return self.gains + self.log_chance(rate)

    def log_chance(self, rate: Rate) -> np.ndarray:
        """(n + 1,) log prior of just the first so many, each of its length and in its way."""
        on = np.arange(len(self.gains))
        return rate.log_chance(on, self.count) - on * np.log(len(LENGTHS) * WAYS)


def find(linear: Linear, bank: Bank, gram: np.ndarray, worth: float) -> Found:
    """Greedy search for the moments, one more while it gains more than the chance of one costs.

    Args:
        linear: the model beside which they are.
        bank: (B + 1, N, R) whitened columns, as of `columns`, of which the first half are gains.
        gram: (N (B + 1), N (B + 1)) their products.
        worth: least gain in log evidence of a further moment.
    """
    white = bank.columns
    nodes, numbers = white.shape[:2]
    ways = np.repeat([[1.0], [0.0]], numbers // 2, axis=0), np.eye(numbers)
    cross, push = linear.taken(bank)
    gram, push = gram.reshape(nodes, numbers, nodes, numbers), push.reshape(nodes, numbers)
    cross = cross.reshape(nodes, numbers, -1)
    # products of nodes that a moment may lie between, by how far these are apart
    near = {
        n: gram[range(nodes - n), :, range(n, nodes)]
        - cross[: nodes - n] @ cross[n:].swapaxes(1, 2)
        for n in (0, *(length for length in LENGTHS if length < nodes))
    }
    gains, on = [0.0], []
    done: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(MOST if len(near) > 1 else 0):
        each = [
            (*_best(near, push, length, way), length, way)
            for length in near
            if length
            for way in ways
        ]
        gain, begin, length, way = max(each, key=lambda e: e[0])
        if gain - np.log(len(LENGTHS) * WAYS) < worth:
            break
        end = begin + length
        gains.append(gains[-1] + gain)
        on.append(Moment(begin, end, way.T @ (white[end] - white[begin])))
        column = gram[:, :, end] - gram[:, :, begin] - cross @ (cross[end] - cross[begin]).T
        column = (column - sum(s @ (c[end] - c[begin]).T for s, c in done)) @ way
        own = way.T @ (column[end] - column[begin]) + np.eye(way.shape[1])
        spread = column @ np.linalg.inv(own)
        push = push - spread @ (way.T @ (push[end] - push[begin]))
        for n, products in near.items():
            products -= spread[: nodes - n] @ column[n:].swapaxes(1, 2)
        done.append((spread, column))
    return Found(np.array(gains), tuple(on), nodes - 1)


def _best(
    near: dict[int, np.ndarray], push: np.ndarray, length: int, way: np.ndarray
) -> tuple[float, int]:
    """Gain in log evidence by the best moment of a length, and its first bin."""
    across = near[length]
    own = near[0][length:] - across - across.swapaxes(1, 2) + near[0][:-length]
    own = way.T @ own @ way + np.eye(way.shape[1])
    pushed = (push[length:] - push[:-length]) @ way
    solved = np.linalg.solve(own, pushed[..., None])[..., 0]
    gains = 0.5 * (pushed * solved).sum(axis=1) - 0.5 * np.linalg.slogdet(own)[1]
    best = int(np.argmax(gains))
    return float(gains[best]), best
