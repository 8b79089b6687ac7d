# SPDX-License-Identifier: Apache-2.0
"""Scores of sealed probabilities by what came of the runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import bootstrap, fisher_exact, mannwhitneyu, t

from twinmill.swarm.forecast.draws import OUTCOMES, Forecast

LABS = 2000  # imagined, of the models drawn
ALPHA = 0.05
FEWEST_RUNS, FEWEST_CELLS = 10, 5  # below either no interval of a score is told


@dataclass(frozen=True)
class Mean:
    """A mean over runs with its 95 % interval, or NaN; cells are what varies by chance."""

    value: float
    low: float
    high: float

    def to_json(self) -> dict[str, Any]:
        """Its fields."""
        return vars(self)


@dataclass(frozen=True)
class Rival:
    """A simpler prediction beside the sealed one.

    Attributes:
        log_score, brier: of its own.
        gain: of the sealed log score over its, in nats a run; above zero: the sealed one is better.
    """

    name: str
    log_score: Mean
    brier: Mean
    gain: Mean

    def to_json(self) -> dict[str, Any]:
        """Its fields."""
        parts = {k: getattr(self, k).to_json() for k in ("log_score", "brier", "gain")}
        return {"name": self.name, **parts}


@dataclass(frozen=True)
class Score:
    """How good the sealed probabilities were.

    Attributes:
        log_score: mean log probability of what was seen, in nats: 0 is best.
        brier: mean squared distance of probabilities from what was seen: 0 is best, 2 worst.
        expected: log score that the model expects of itself, with the range of 95 % of its worlds.
        p_value: chance of so bad a log score or worse if one of the models drawn were right.
        rivals: simpler predictions.
        hits: runs that ended in their most probable class.
        misses: what the runs that did not have in common, in sentences.
    """

    runs: int
    log_score: Mean
    brier: Mean
    expected: Mean
    p_value: float
    rivals: list[Rival]
    hits: int
    misses: list[str]


def score(
    expected: Forecast, cell: np.ndarray, seen: np.ndarray, *, axes: Sequence[str], seed: int
) -> Score:
    """Scores runs.

    Args:
        expected: in the cells of the plan.
        cell: (R,) cell of each run.
        seen: (R,) place in OUTCOMES of what it ended as.
        axes: names, for what misses have in common.
        seed: of the imagined laboratories.
    """
    share = expected.share
    logs, squares = np.log(share[cell, seen]), _brier(share, cell, seen)
    imagined = _imagined(expected, cell, seed)
    rivals = []
    base = np.broadcast_to(expected.base_rate, share.shape)
    even = np.full(share.shape, 1 / share.shape[1])
    for name, other in (
        ("the sweep's cell, without uncertainty", expected.swept),
        ("the base rate of the sweep", base),
        ("all classes alike", even),
    ):
        theirs = np.log(other[cell, seen])
        brier = _bounded(_brier(other, cell, seen), cell, seed)
        rivals.append(Rival(name, _bounded(theirs, cell, seed), brier, _mean(logs - theirs, cell)))
    missed = share[cell].argmax(axis=1) != seen
    return Score(
        runs=len(seen),
        log_score=_bounded(logs, cell, seed),
        brier=_bounded(squares, cell, seed),
        expected=Mean(float(imagined.mean()), *map(float, np.quantile(imagined, [0.025, 0.975]))),
        p_value=float((1 + np.sum(imagined <= logs.mean())) / (1 + LABS)),
        rivals=rivals,
        hits=int(np.sum(~missed)),
        misses=_common(expected, cell, seen, missed, axes=axes),
    )


def _brier(share: np.ndarray, cell: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(R,) of all classes (Brier 1950)."""
    return ((share[cell] - np.eye(share.shape[1])[seen]) ** 2).sum(axis=1)


def _mean(values: np.ndarray, cell: np.ndarray) -> Mean:
    """Runs of one cell err together, so the interval is that of the cells' sums (t)."""
    mean = float(values.mean())
    cells = np.unique(cell)
    if len(cells) < 2:
        return Mean(mean, np.nan, np.nan)
    off = np.array([np.sum(values[cell == c] - mean) for c in cells])
    n = len(cells)
    error = np.sqrt(n / (n - 1) * np.sum(off**2)) / len(values)
    half = float(t.ppf(0.975, n - 1) * error)
    return Mean(mean, mean - half, mean + half)


def _bounded(values: np.ndarray, cell: np.ndarray, seed: int) -> Mean:
    """Mean of a score that has ends: percentiles of bootstrapped cells stay within."""
    mean = float(values.mean())
    cells = np.unique(cell)
    if len(values) < FEWEST_RUNS or len(cells) < FEWEST_CELLS:
        return Mean(mean, np.nan, np.nan)
    sums = np.array([values[cell == c].sum() for c in cells])
    runs = np.array([np.sum(cell == c) for c in cells])
    found = bootstrap(
        (sums, runs),
        lambda s, n, axis: s.sum(axis=axis) / n.sum(axis=axis),
        paired=True,
        method="percentile",
        rng=seed,
    ).confidence_interval
    return Mean(mean, float(found.low), float(found.high))


def _imagined(expected: Forecast, cell: np.ndarray, seed: int) -> np.ndarray:
    """(LABS,) log scores of laboratories whose truth is one of the models drawn, each in turn."""
    random = np.random.default_rng(seed)
    of = expected.draws[np.arange(LABS) % len(expected.draws)][:, cell]  # (LABS, R, K)
    edge = of.cumsum(axis=2)
    ended = (random.random((*edge.shape[:2], 1)) * edge[..., -1:] > edge).sum(axis=2)
    return np.log(expected.share)[cell[None], ended].mean(axis=1)


def _common(
    expected: Forecast,
    cell: np.ndarray,
    seen: np.ndarray,
    missed: np.ndarray,
    *,
    axes: Sequence[str],
) -> list[str]:
    """Sentences: classes that are mistaken for each other, and where along the axes misses lie."""
    if not missed.any():
        return ["Every run ended in its most probable class."]
    told = []
    likely = expected.share[cell].argmax(axis=1)
    pairs = [(a, b) for a, b in zip(likely[missed], seen[missed], strict=True)]
    (a, b), count = max(((p, pairs.count(p)) for p in set(pairs)), key=lambda pc: (pc[1], pc[0]))
    told.append(
        f"{count} of {missed.sum()} misses ended '{OUTCOMES[b]}' where '{OUTCOMES[a]}' was most "
        "probable."
    )
    tests = []
    for k, name in enumerate(axes):
        values = expected.points[cell, k]
        if len(np.unique(values)) > 1 and not missed.all():
            p = mannwhitneyu(values[missed], values[~missed]).pvalue
            where = "high" if values[missed].mean() > values[~missed].mean() else "low"
            middle = np.median(values[missed])
            tests.append((p, f"Misses lie at {where} {name}: half of them at {middle:g} or beyond"))
    for k in sorted(set(likely)):
        table = [[np.sum(missed & (likely == k)), np.sum(missed & (likely != k))],
                 [np.sum(~missed & (likely == k)), np.sum(~missed & (likely != k))]]  # fmt: skip
        p = fisher_exact(table, alternative="greater").pvalue
        tests.append((p, f"Misses are where '{OUTCOMES[k]}' was most probable"))
    p, sentence = min(tests, default=(1.0, ""))
    if p * len(tests) < ALPHA:
        told.append(f"{sentence} (p = {p * len(tests):.2g}, {len(tests)} tests together).")
    else:
        told.append(
            f"Beyond that nothing sets the {missed.sum()} misses apart from the {np.sum(~missed)} "
            "hits that so many runs could show."
        )
    return told
