# SPDX-License-Identifier: Apache-2.0
"""Names for what may have changed between two runs, each as a direction among the differences.

A change has the size that suits the differences best, weighted by their errors (generalised least
squares); its score is that size over its standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.chance import t_above, t_quantile
from twinmill.model.parameters import drives_sideways

SHARE_95 = 0.975  # quantile of both ends of a 95 % interval
RIVAL_CHI2 = t_quantile(SHARE_95, 1e6) ** 2  # a rival that explains this much less is ruled out
MOSTLY = 0.9  # of pairs of runs: the share in which a change is to show
AXIS_M = 1e-6  # a wheel so near an axis is to neither side of it
DRAWS = 20_000  # of runs without a change: a rate of 5 % is known to 0.15 %


@dataclass(frozen=True)
class Kind:
    """Change that may have happened, by name.

    Attributes:
        key: `wheel.fl`, `wheels.left`, `wheels.all`, `forward`, or that of a quantity.
        what: for people, with its verb: `the front left wheel is`.
        less, more: what it is then: `weaker`, `stronger`.
        unit: "1" of a share, or s.
        direction: (K,) differences per unit of it.
    """

    key: str
    what: str
    less: str
    more: str
    unit: str
    direction: np.ndarray


@dataclass(frozen=True)
class Change:
    """One kind with its size.

    Attributes:
        kind: by name.
        value: size in its unit.
        std: half of a 95 % interval over the quantile of Student's t.
        free: degrees of freedom of the interval.
        score: size over standard error, signed.
    """

    kind: Kind
    value: float
    std: float
    free: float
    score: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 %."""
        reach = t_quantile(SHARE_95, self.free) * self.std
        return self.value - reach, self.value + reach

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        low, high = self.interval
        return {
            "name": self.kind.key,
            "value": self.value,
            "std": self.std,
            "low": low,
            "high": high,
            "unit": self.kind.unit,
            "score": self.score,
        }


@dataclass(frozen=True)
class Judged:
    """Differences of a run from others, with all that they scatter by.

    Attributes:
        values: (K,) differences.
        scatter: (K, K) their covariance without a change.
        free: degrees of freedom of the standard errors.
        kinds: of the robot.
    """

    values: np.ndarray
    scatter: np.ndarray
    free: float
    kinds: Sequence[Kind]

    def changes(self, beside: Sequence[Kind] = ()) -> list[Change]:
        """Each kind alone, or beside some that are known to be there."""
        known = {k.key for k in beside}
        return [self.sized(k, beside) for k in self.kinds if k.key not in known]

    def sized(self, kind: Kind, beside: Sequence[Kind] = ()) -> Change:
        """The size of one kind, beside others of sizes of their own."""
        weights = self._weights(kind, beside)
        value = float(weights @ self.values)
        std = float(np.sqrt(weights @ self.scatter @ weights))
        return Change(kind, value, std, self.free, value / std if std > 0 else 0.0)

    def _weights(self, kind: Kind, beside: Sequence[Kind] = ()) -> np.ndarray:
        """(K,) of the differences in the size of a kind."""
        directions = np.column_stack([kind.direction, *(k.direction for k in beside)])
        weighted = np.linalg.pinv(self.scatter) @ directions
        return (np.linalg.pinv(directions.T @ weighted) @ weighted.T)[0]

    @property
    def score(self) -> float:
        """The largest of all kinds: how unlike the others the run is."""
        return max(abs(c.score) for c in self.changes())

    @cached_property
    def by_errors(self) -> np.ndarray:
        """(DRAWS,) ascending scores of runs without a change, by the standard errors alone.

        The largest of correlated variates of Student's t (Hothorn, Bretz and Westfall 2008).
        """
        weights = np.array([self._weights(k) for k in self.kinds])
        covariance = weights @ self.scatter @ weights.T
        std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        values, ways = np.linalg.eigh(covariance / np.outer(std, std))
        random = np.random.default_rng(0)
        normal = random.standard_normal((DRAWS, len(values))) * np.sqrt(np.maximum(values, 0.0))
        size = np.sqrt(random.chisquare(self.free, DRAWS) / self.free)
        return np.sort(np.abs(normal @ ways.T).max(axis=1) / size)

    def chance(self, score: float) -> float:
        """Probability of so large a score without a change, by the standard errors alone."""
        drawn = (1 + np.count_nonzero(self.by_errors >= score)) / (DRAWS + 1)
        return float(min(drawn, 2 * len(self.kinds) * t_above(score, self.free)))


def rivals(change: Change, changes: Sequence[Change]) -> list[Change]:
    """Others that explain the differences as well, best first; none of the same direction twice."""
    close = [
        c
        for c in changes
        if c.kind.key != change.kind.key and change.score**2 - c.score**2 < RIVAL_CHI2
    ]
    return sorted(close, key=lambda c: -abs(c.score))


def kinds_of(model: native.Model, keys: Sequence[str]) -> list[Kind]:
    """Possible changes of a robot whose differences have these keys."""

    def direction(**sizes: float) -> np.ndarray:
        return np.array([sizes.get(key, 0.0) for key in keys])

    words = ("weaker", "stronger") if model.drive == "duty" else ("slower", "faster")
    speed = ("lower", "higher")
    wheels = [w for w in model.wheels() if f"wheel.{w['name']}" in keys]
    found = []
    for name, what, own in _groups(wheels, not drives_sideways(model)):
        key = f"wheels.{name}" if len(own) > 1 else f"wheel.{name}"
        turns = direction(**{f"wheel.{w['name']}": 1.0 for w in own})
        found.append(Kind(key, what, *words, "1", turns))
    gains = {k: 1.0 for k in keys if k.endswith("_gain")}
    if "forward_gain" in keys:
        found.append(Kind("all_speeds", "all speeds are", *speed, "1", direction(**gains)))
        only = {"forward_gain": 1.0}
    else:
        only = {f"wheel.{w['name']}": 1.0 for w in wheels} | {k: -1.0 for k in gains}
    if gains and only:
        found.append(Kind("forward", "the forward speed is", *speed, "1", direction(**only)))
    for key, what, ways, unit in (
        ("sideways_gain", "the sideways speed is", speed, "1"),
        ("yaw_gain", "the rate of turn is", speed, "1"),
        ("lag_s", "the motors' lag is", ("shorter", "longer"), "s"),
        ("late_s", "the robot's response is", ("earlier", "later"), "s"),
    ):
        if key in keys:
            found.append(Kind(key, what, *ways, unit, direction(**{key: 1.0})))
    return found


def _groups(
    wheels: list[dict[str, Any]], one_to_a_side: bool
) -> list[tuple[str, str, list[dict[str, Any]]]]:
    """Wheels alone, by side and end, and all: name, words with their verb, wheels.

    Args:
        wheels: of the robot.
        one_to_a_side: those of a side cannot be told apart by how the robot moves.
    """
    found = [(w["name"], f"the {w['words']} is", [w]) for w in wheels]
    sides = {
        "left": [w for w in wheels if w["y_m"] > AXIS_M],
        "right": [w for w in wheels if w["y_m"] < -AXIS_M],
        "front": [w for w in wheels if w["x_m"] > AXIS_M],
        "rear": [w for w in wheels if w["x_m"] < -AXIS_M],
    }
    several = {n: own for n, own in sides.items() if 1 < len(own) < len(wheels)}
    if one_to_a_side:
        found, several = (
            found * (len(wheels) < 3),
            {n: several.get(n, []) for n in ("left", "right")},
        )
    found += [(n, f"the {n} wheels are", own) for n, own in several.items() if own]
    return [*found, ("all", "all wheels are", wheels)] if wheels else found
