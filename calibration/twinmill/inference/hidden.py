# SPDX-License-Identifier: Apache-2.0
"""Effects that a base may always have lacked: the joint test of "always there" against "new".

In the base's own log each effect has a posterior, beside what was found there, and a Bayes factor
against its absence. Together with a later log two explanations of an effect compete: it is new, and
its numbers have the card's prior; or it always was there, and they have the posterior of the own
log, as has the base beside it. Products of columns are enough for that, whichever effects are asked
for (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63; Bishop 2006, ch. 3.3).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from twinmill.inference.candidate import Candidate
from twinmill.inference.evidence import Linear
from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import catalogue_name, key_of


@dataclass(frozen=True)
class Hidden:
    """Evidence in the base's own log on effects that were not found in it.

    Attributes:
        names: of their numbers, `effect.key`, M of them.
        unit: (M,) standard deviation of the prior of each.
        gram, push: (M, M), (M,) products of white columns, and with what is left, of numbers in
            these units, once the base has taken its part.
        shift: (N, M) change of the base's numbers with each of these in its unit.
    """

    names: tuple[str, ...]
    unit: np.ndarray = field(repr=False)
    gram: np.ndarray = field(repr=False)
    push: np.ndarray = field(repr=False)
    shift: np.ndarray = field(repr=False)

    @classmethod
    def of(
        cls,
        columns: dict[str, Candidate],
        linear: Linear,
        whiten: Callable[[np.ndarray], np.ndarray],
        root: np.ndarray,
    ) -> "Hidden":
        """Evidence from one's own log.

        Args:
            columns: effects, of which those count that act everywhere and have sizes alone.
            linear: the base's model with all that was found, N numbers.
            whiten: the noise.
            root: (N, N) Cholesky factor of the prior of these.
        """
        names, unit, white = [], [], [linear.x[:0]]
        for name, c in columns.items():
            if c.where is None and c.limits is None and len(c.columns):
                own = [c.parameters[k] for k in c.sizes]
                names += [f"{name}.{key_of(p.name)}" for p in own]
                unit += [PRIORS.size * (p.value - p.usual) for p in own]
                white.append(PRIORS.size * whiten(c.columns))
        stacked = np.concatenate(white)
        return cls(tuple(names), np.array(unit), *told_beside(linear, stacked, root))

    def knows(self, effects: Sequence[str]) -> bool:
        """True if the own log tells of all of these; of a second of a kind it does not."""
        return set(effects) <= set(map(catalogue_name, self.names))

    def explained(self, h: Any, effects: Sequence[str], known: np.ndarray) -> tuple[Any, float]:
        """A hypothesis with some effects always there, and their Bayes factor in the own log.

        Args:
            h: `Hypothesis` of a later log.
            effects: of it.
            known: (N,) places of the own log's numbers among its own; -1 where it has them not.
        """
        at = [k for k, name in enumerate(self.names) if catalogue_name(name) in effects]
        gram = self.gram[np.ix_(at, at)] + np.eye(len(at))
        inverse = np.linalg.inv(gram)
        mean, unit = inverse @ self.push[at], self.unit[at]
        log_factor = 0.5 * float(self.push[at] @ mean - np.linalg.slogdet(gram)[1])
        own = [_place(h, self.names[k]) for k in at]
        cov = inverse * np.outer(unit, unit) + np.diag((PRIORS.sheet * mean * unit) ** 2)
        slope = np.zeros((len(h.mean), len(at)))  # of all numbers, with these
        slope[known[known >= 0]] = self.shift[known >= 0][:, at] / unit
        slope[own] = np.eye(len(at))
        rest = h.cov.copy()
        rest[own], rest[:, own] = 0.0, 0.0
        told = replace(h, mean=h.mean + slope @ (mean * unit), cov=rest + slope @ cov @ slope.T)
        within = h.log_share(told.mean, told.cov) - h.log_share(h.mean, h.cov)
        return told, log_factor + within


def told_beside(
    linear: Linear, white: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Evidence of a log on columns beside a model, once its N numbers have taken their part.

    Args:
        linear: the model.
        white: (K, R) the columns.
        root: (N, N) Cholesky factor of the prior of its numbers.

    Returns:
        (K, K), (K,) products of the columns, and with what is left; (N, K) change of the numbers
        with a unit of each column.
    """
    gram, push = linear.projected(white, white @ white.T)
    return gram, push, -root @ linear.covariance @ (linear.x @ white.T)


def _place(h: Any, name: str) -> int:
    """Where a number of an effect that the hypothesis adds stands."""
    labels = [
        (catalogue_name(n), key_of(n)) if of_effect else None
        for n, of_effect in zip(h.labels, h.of_effects, strict=True)
    ]
    return labels.index((catalogue_name(name), key_of(name)))
