# SPDX-License-Identifier: Apache-2.0
"""How many robots, how fast, how good their sensors, how alike: the questions and their curves."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from twinmill.defaults import Question
from twinmill.swarm.axes import Axis
from twinmill.swarm.classes import interval, reached
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import run_missing

SENSOR_AXES = [
    "range_m=0.3:1.7:8",
    "cone_deg=10:100:10",
    "miss_rate=0:0.9:10",
    "false_rate=0:0.45:10",
    "delay_s=0:0.15:7",
]


@dataclass(frozen=True)
class Curve:
    """The probability of the goal along one quantity, with 95 % intervals (Wilson 1927)."""

    axis: Axis
    probability: list[float]
    low: list[float]
    high: list[float]
    seeds: int

    @property
    def best(self) -> int:
        """Place of the value that surely reaches the goal most often, the first of several."""
        return max(range(len(self.low)), key=lambda k: (self.low[k], -k))

    def sentence(self, goal: str, at_least: float) -> str:
        """Which values serve, and which serves best."""
        values, best = self.axis.values, self.best
        tell = (
            f"best at {values[best]:g} ({100 * self.probability[best]:.0f} %, interval "
            f"{100 * self.low[best]:.0f} to {100 * self.high[best]:.0f} %)"
        )
        good = [k for k in range(len(values)) if self.probability[k] >= at_least]
        wanted = f"'{goal}' in at least {100 * at_least:.0f} % of runs"
        if not good:
            return f"{self.axis.label}: no value tried gives {wanted}; {tell}."
        runs = _spans(good)
        spans = " and ".join(
            f"{values[a]:g}" if a == b else f"{values[a]:g} to {values[b]:g}" for a, b in runs
        )
        outside = [k for k in (runs[-1][1] + 1, runs[0][0] - 1) if 0 <= k < len(values)]
        edge = "".join(
            f"; at {values[k]:g} it is {100 * self.probability[k]:.0f} %" for k in outside
        )
        return f"{self.axis.label}: {spans} gives {wanted}, {tell}{edge}."

    def to_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "axis": self.axis.name,
            "label": self.axis.label,
            "values": list(self.axis.values),
            "probability": self.probability,
            "low": self.low,
            "high": self.high,
        }


def _spans(places: list[int]) -> list[tuple[int, int]]:
    """Runs of neighbours."""
    spans = [(places[0], places[0])]
    for k in places[1:]:
        if k == spans[-1][1] + 1:
            spans[-1] = (spans[-1][0], k)
        else:
            spans.append((k, k))
    return spans


def axes_for(question: Question, drive: str) -> list[str]:
    """Axes to vary for an answer."""
    if question is Question.HOW_MANY:
        return ["n=3:14:12"]
    if question is Question.HOW_FAST:
        return ["v_mps=0.05:0.5:10"] if drive == "twist" else ["base.forward_gain=0.2:2:10"]
    return SENSOR_AXES if question is Question.HOW_GOOD else ["theta_a=0:0.2:11"]


def curve_of(request: Request, goal: str) -> Curve:
    """Simulates along the request's only axis."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as folder:
        run_missing(request, Path(folder) / "sweep", lambda worlds: None)
        _, table = read_sweep(Path(folder) / "sweep")
    hits = reached(table, goal).reshape(-1, request.seeds).sum(axis=1)
    bounds = [interval(hit, request.seeds) for hit in hits]
    return Curve(
        request.axes[0],
        (hits / request.seeds).tolist(),
        [low for low, _ in bounds],
        [high for _, high in bounds],
        request.seeds,
    )
