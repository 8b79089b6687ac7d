# SPDX-License-Identifier: Apache-2.0
"""One-at-a-time sensitivity analysis: runs a model and its changes with the same seeds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from twinmill.swarm.classes import interval, reached
from twinmill.swarm.matters.changes import Change, Factor
from twinmill.swarm.matters.differences import Difference, median_difference, share_difference
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import run_missing

LOOKS = (0.25, 0.5, 1.0)  # shares of the seeds after which what is clear is left alone
SURE = 0.05  # chance that anything at all is said to matter if nothing does
MATTERS, UNSURE, NOTHING = "matters", "unsure", "does not matter"
# What is told beside the share; the last two of runs that reach the goal.
METRICS = ("circliness", "radius_m", "settled_s")
OF_GOAL = ("radius_m", "settled_s")


@dataclass(frozen=True)
class Outcome:
    """Swarm's reaction to a change.

    Attributes:
        share: of runs that reach the goal.
        metrics: medians of METRICS, by name.
        sure: no chance makes this change of the share, all changes together.
        seeds: runs before and after it.
        turned: seed of a run that the change turns, as most that it turns; None: it turns none.
    """

    change: Change
    share: Difference
    metrics: dict[str, Difference]
    sure: bool
    seeds: int
    turned: int | None

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the model's text."""
        return {
            "what": self.change.what,
            "values": self.change.values,
            "share": self.share.to_json(),
            **{name: d.to_json() for name, d in self.metrics.items()},
            "sure": self.sure,
            "seeds": self.seeds,
        }


@dataclass(frozen=True)
class FactorResult:
    """A factor with what its changes do.

    Attributes:
        outcomes: of its changes, in their order.
        verdict: MATTERS, UNSURE or NOTHING.
    """

    factor: Factor
    outcomes: list[Outcome]
    verdict: str

    @property
    def worst(self) -> Outcome:
        """Outcome of the change that moves the share most."""
        return max(self.outcomes, key=lambda o: abs(o.share.change))

    @property
    def shares(self) -> tuple[float, float]:
        """Least and most, the model as it is included."""
        values = [self.outcomes[0].share.before, *(o.share.after for o in self.outcomes)]
        return min(values), max(values)


@dataclass(frozen=True)
class Sensitivity:
    """Results of all factors, what matters most first.

    Attributes:
        request: of the model as it is.
        goal: class that is wanted.
        margin: change of the share that would not matter.
        before: share that reaches the goal with its 95 % interval.
        medians: of METRICS.
        ranked: results.
        together: of all numbers drawn at once; None where the model knows no errors.
        left: what was left out, and why.
    """

    request: Request
    goal: str
    margin: float
    before: tuple[float, float, float]
    medians: dict[str, float]
    ranked: list[FactorResult]
    together: FactorResult | None
    left: list[tuple[str, str]]

    def of(self, *verdicts: str, kinds: Sequence[str] = ()) -> list[FactorResult]:
        """Results of these verdicts, of these kinds or of all."""
        return [
            j
            for j in self.ranked
            if j.verdict in verdicts and (not kinds or j.factor.kind in kinds)
        ]


def folder_of(request: Request, folder: Path) -> Path:
    """Folder of the runs of a request, named by the hash of all that their results depend on.

    A request that is made again finds its runs there.

    Args:
        request: model, cells, seeds and the like.
        folder: that holds such folders.
    """
    return folder / "runs" / request.sha256[:16]


def rank_factors(
    request: Request,
    factors: Sequence[Factor],
    left: list[tuple[str, str]],
    *,
    goal: str,
    margin: float,
    folder: Path,
    tell: Callable[[int, int], None] = lambda done, planned: None,
) -> Sensitivity:
    """Runs what is missing, and orders the factors by what they change.

    A quarter of the seeds comes first, then what is open after it has the second, then the rest.

    Args:
        request: of the model as it is, without axes, by the full kernel; with the most seeds.
        factors: what is asked about.
        left: what is not, and why.
        goal: class that is wanted.
        margin: change of the share that would not matter.
        folder: of the runs; those that are there are kept.
        tell: is given how many worlds are done and how many are planned.
    """
    bench = _Bench(request, folder, tell)
    asked = sum(len(s.changes) for s in factors if s.kind != "together")
    level = 1 - SURE / max(asked, 1) / len(LOOKS)
    results: dict[int, FactorResult] = {}
    for look, most in enumerate(LOOKS):
        going = [
            k
            for k, s in enumerate(factors)
            if k not in results or (results[k].verdict == UNSURE and s.kind != "together")
        ]
        bench.plan(look, [factors[k] for k in going])
        before = bench.runs(request.model_text, look)
        for k in going:
            outcomes = [
                _outcome(before, bench.runs(change.text, look), change, goal, level=level)
                for change in factors[k].changes
            ]
            results[k] = FactorResult(factors[k], outcomes, _verdict(outcomes, margin))
        if most == LOOKS[-1] or not any(results[k].verdict == UNSURE for k in going):
            break
    before = bench.runs(request.model_text, len(LOOKS) - 1)
    hits = reached(before, goal)
    order = (MATTERS, UNSURE, NOTHING)
    ranked = sorted(
        results.values(), key=lambda j: (order.index(j.verdict), -abs(j.worst.share.change))
    )
    return Sensitivity(
        request=request,
        goal=goal,
        margin=margin,
        before=(float(hits.mean()), *interval(hits.sum(), len(hits))),
        medians={name: _median(_values(before, name, hits)) for name in METRICS},
        ranked=[j for j in ranked if j.factor.kind != "together"],
        together=next((j for j in ranked if j.factor.kind == "together"), None),
        left=left,
    )


@dataclass
class _Bench:
    """Runs models with the same seeds, look after look."""

    request: Request
    folder: Path
    tell: Callable[[int, int], None]
    done: int = 0
    planned: int = 0

    def _part(self, text: str, look: int) -> Request:
        """The seeds that a look adds."""
        first, last = (int(share * self.request.seeds) for share in (0, *LOOKS)[look : look + 2])
        first_seed = self.request.first_seed + first
        return replace(self.request, model_text=text, first_seed=first_seed, seeds=last - first)

    def plan(self, look: int, factors: Sequence[Factor]) -> None:
        """Says how many runs a look adds."""
        changes = 1 + sum(len(s.changes) for s in factors)
        self.planned += changes * self._part("", look).seeds
        self.tell(self.done, self.planned)

    def runs(self, text: str, look: int) -> pa.Table:
        """Rows of all seeds up to a look."""
        tables = []
        for k in range(look + 1):
            part = self._part(text, k)
            place = folder_of(part, self.folder)
            if not (place / "sweep.parquet").exists():
                run_missing(part, place, self._advance)
            tables.append(read_sweep(place)[1])
        return pa.concat_tables([t.replace_schema_metadata() for t in tables])

    def _advance(self, worlds: int) -> None:
        self.done += worlds
        self.planned = max(self.planned, self.done)
        self.tell(self.done, self.planned)


def _outcome(
    before: pa.Table, after: pa.Table, change: Change, goal: str, *, level: float
) -> Outcome:
    was, now = reached(before, goal), reached(after, goal)
    metrics = {
        name: median_difference(_values(before, name, was), _values(after, name, now), seed=1)
        for name in METRICS
    }
    strict = share_difference(was, now, level)
    sure = bool(strict.low > 0 or strict.high < 0)
    plain = share_difference(was, now)
    turned = np.flatnonzero(was & ~now if plain.change <= 0 else ~was & now)
    seed = before["seed"].to_pylist()[turned[0]] if len(turned) else None
    return Outcome(change, plain, metrics, sure, len(was), seed)


def _values(table: pa.Table, name: str, hits: np.ndarray) -> np.ndarray:
    """(S,) of a metric, NaN where a run has none."""
    values = np.array(table[name].to_pylist(), dtype=float)
    return np.where(hits, values, np.nan) if name in OF_GOAL else values


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _verdict(outcomes: Sequence[Outcome], margin: float) -> str:
    """Sure and large of any change; small beyond doubt of all; or neither."""
    if any(o.sure and abs(o.share.change) >= margin for o in outcomes):
        return MATTERS
    small = all(-margin <= o.share.low and o.share.high <= margin for o in outcomes)
    return NOTHING if small else UNSURE
