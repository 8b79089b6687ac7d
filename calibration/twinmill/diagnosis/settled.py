# SPDX-License-Identifier: Apache-2.0
"""Estimates of the final model, and what to keep in mind of them."""

from dataclasses import dataclass, replace

import numpy as np

from twinmill.diagnosis.evidence import State
from twinmill.diagnosis.ranking import Ranked
from twinmill.fitting.solve import System
from twinmill.model.freedom import Estimate, catalogue

# A delay, a clock and a lag all hold a response back: a log tells their sum before their parts.
LATE = ("input_delay.delay_s", "clock_offset.offset_s", "motor_lag.extra_s")
LAG = "base.motor_lag_s"
NEUTRAL = 1e-3  # so far from where an effect does nothing a bound is one


@dataclass(frozen=True)
class Sum:
    """Quantities whose sum is firmer than its parts."""

    of: tuple[str, ...]
    value: float
    std: float
    unit: str

    def to_json(self) -> dict:
        """Fields of the interface."""
        return {**vars(self), "of": list(self.of)}

    def __str__(self) -> str:
        parts = [name for name in self.of if name != LAG]
        return (
            f"Delay and lag together are {self.value:.3f} ± {self.std:.1g} s; that is firmer than "
            f"the share of {' and '.join(parts)} in it."
        )


@dataclass(frozen=True)
class Settled:
    """All free quantities of the final model, fitted together.

    Attributes:
        estimates: by name.
        sums: where parts may be confused.
    """

    estimates: dict[str, Estimate]
    sums: list[Sum]

    @classmethod
    def of(cls, state: State) -> "Settled":
        """Of the state that a search ended in."""
        system = System(state.scenes, state.free)
        found = system.solution(system.start)
        names = [f.name for f in state.free]
        late = tuple(name for name in LATE if name in names)
        sums = []
        if late and not any(s.clock_free for s in state.scenes):
            jacobian = system.jacobian(system.start)
            covariance = np.linalg.pinv(jacobian.T @ jacobian) * max(1.0, found.chi2)
            own = np.array([u.name in (LAG, *late) for u in system.unknowns], float)
            value = sum(state.model.get(name) for name in (LAG, *late))
            sums.append(Sum((LAG, *late), value, float(np.sqrt(own @ covariance @ own)), "s"))
        return cls({e.name: e for e in found.estimates}, sums)

    def put_into(self, ranking: list[Ranked], names: list[str]) -> list[Ranked]:
        """The ranking, found effects with what they are beside those that were found later."""
        return [
            replace(r, parameters=[self.estimates.get(e.name, e) for e in r.parameters])
            if r.effect in names
            else r
            for r in ranking
        ]

    def at_bound(self, names: list[str]) -> list[Estimate]:
        """Those of the found effects that are at a bound, unless it is where nothing happens."""
        neutral = {
            f"{name}.{p['name']}": p["neutral"]
            for name in names
            for p in catalogue()[name.split("#")[0]]["parameters"]
        }
        return [
            e
            for e in self.estimates.values()
            if e.at_bound and abs(e.value - neutral.get(e.name, e.value)) > NEUTRAL
        ]

    def notes(self, names: list[str]) -> list[str]:
        """Sentences on sums, and on found effects whose estimate is worth little."""
        bound = [
            f"{e.name} is at its bound ({e.value:.3g} {e.unit}): the effect may stand for another."
            for e in self.at_bound(names)
        ]
        return [*(str(s) for s in self.sums), *bound]
