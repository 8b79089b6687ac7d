# SPDX-License-Identifier: Apache-2.0
"""Spike and slab over half seconds: something else happens at few moments of a log."""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, expit

from twinmill.inference.evidence import Linear
from twinmill.inference.settings import PRIORS
from twinmill.inference.steps import Motion

MOMENTS = "moments"  # the word that an answer says
LENGTH_S = 0.5
MOST = 32  # moments that are let in, one by one: more are no moments
SPREAD = 10.0  # pseudo-observations behind the expected share of moments: known to a factor of two


@dataclass(frozen=True)
class Rate:
    """What is known of the share of moments at which something happens.

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
    """(B, k, W, 3) displacements by a gain or a push of usual size in each half second."""
    number = np.floor((m.t_s - m.t_s[0]) / LENGTH_S).astype(int)
    moves = m.moves[:, None] * m.usual
    ways = [
        m.moved * (1, 1, 0), m.moved * (0, 0, 1), moves * (0, 1, 0), moves * (0, 0, 1),
    ]  # fmt: skip
    bins = [(number == n)[:, None] for n in np.unique(number)]
    return PRIORS.sudden * np.array([[on * way for way in ways] for on in bins])


@dataclass(frozen=True)
class Found:
    """Moments let in, likeliest first.

    Attributes:
        gains: (n + 1,) gain in log evidence with the first so many on, chances left out.
        on: numbers of the moments.
        count: of all moments.
    """

    gains: np.ndarray
    on: tuple[int, ...]
    count: int

    def log_evidence(self, rate: Rate) -> float:
        """Gain in log evidence: the best number of moments, and the chance of these at a rate."""
        return float(self.by_number(rate).max())

    def likeliest(self, rate: Rate) -> int:
        """How many moments are on at that."""
        return int(self.by_number(rate).argmax())

    def after(self, there: float) -> Rate:
        """What the log tells of the rate, if something happens ever with that probability."""
        some = Rate()
        on, odds = self.likeliest(some), np.log(there / (1 - there)) + self.log_evidence(some)
        return Rate(float(expit(odds)), some.on + on, some.off + self.count - on)

    def by_number(self, rate: Rate) -> np.ndarray:
        """(n + 1,) gain in log evidence with so many on."""
        return self.gains + rate.log_chance(np.arange(len(self.gains)), self.count)


def find(linear: Linear, white: np.ndarray, gram: np.ndarray, worth: float) -> Found:
    """Greedy search for the moments, one more while it gains more than the chance of one costs.

    Args:
        linear: the model beside which they are.
        white: (B, k, R) whitened columns.
        gram: (B k, B k) their products.
        worth: least gain in log evidence of a further moment.
    """
    count, k = white.shape[:2]
    flat = white.reshape(count * k, -1)
    gram, push = linear.projected(flat, gram)
    place = np.arange(count)[:, None] * k + np.arange(k)
    gains, on, every = [0.0], [], np.arange(count)
    for _ in range(MOST):
        own = gram.reshape(count, k, count, k)[every, :, every] + np.eye(k)
        solved = np.linalg.solve(own, push[place][..., None])[..., 0]
        each = 0.5 * (push[place] * solved).sum(axis=1) - 0.5 * np.linalg.slogdet(own)[1]
        each[on] = -np.inf
        best = int(np.argmax(each))
        if each[best] < worth:
            break
        gains.append(gains[-1] + float(each[best]))
        on.append(best)
        column = gram[:, place[best]]
        inverse = np.linalg.inv(own[best])
        push = push - column @ (inverse @ push[place[best]])
        gram = gram - column @ inverse @ column.T
    return Found(np.array(gains), tuple(on), count)
