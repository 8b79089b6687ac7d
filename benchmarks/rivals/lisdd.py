# SPDX-License-Identifier: Apache-2.0
"""Where a model is wrong, and by which term: rebuilt after arXiv 2606.23215 (LISDD).

From its abstract and summaries; its full text could not be had, so that thresholds and the way in
which regions are laid are ours. The known physics is fitted on a clean regime; regions whose
residual energy is too large are flagged; in each the terms that predict held-out blocks best are
selected out of all that could be, and an F test on further blocks confirms them; the false
discovery rate is controlled over regions (Benjamini and Hochberg 1995).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from scipy.stats import chi2, false_discovery_control
from scipy.stats import f as f_distribution

from rivals.protocol import DOCUMENTED, TUNED, Answer, Problem, Rival, predicted_by
from rivals.residual import SPEED, Steps, corrected

AXES = ("forward", "left", "turn")
REGIONS = 5  # of each column, with equal numbers of steps
CLEAN = 0.5  # share of the regions that are clean: those of least energy
MOST_TERMS = 2
FEWEST = 12  # steps of a region in each of its three parts
FLAG = 0.05
DRIFT = 0.04  # of gains, as robots' do with battery and heat


@dataclass(frozen=True)
class Setting:
    """Numbers that decide; see README.

    Attributes:
        step_s: of the residual. Noise of neighbouring steps must be independent.
        rate: false discoveries among regions.
        whole: the whole space counts as a region.
    """

    step_s: float
    rate: float
    whole: bool


SETTINGS: Mapping[str, Setting] = {
    DOCUMENTED: Setting(0.1, 0.05, False),
    TUNED: Setting(0.5, 1e-6, True),
}


@dataclass(frozen=True)
class Region:
    """Steps whose value of one column is between two limits."""

    column: int
    low: float
    high: float

    def holds(self, features: np.ndarray) -> np.ndarray:
        """(N,) bool."""
        return (features[:, self.column] >= self.low) & (features[:, self.column] <= self.high)


@dataclass(frozen=True)
class Known:
    """The trusted physics of one channel, on the clean regime: gains of the three velocities.

    Attributes:
        gains: (3,).
        left: (N,) what they leave, over `spread`, that of the clean regime.
    """

    gains: np.ndarray
    left: np.ndarray
    spread: float


@dataclass(frozen=True)
class Found:
    """A confirmed term: in a region, for a channel, these columns and their factors."""

    region: Region
    channel: int
    terms: tuple[int, ...]
    factors: np.ndarray
    p: float
    known: Known


def answers(problem: Problem) -> dict[str, Answer]:
    """By both settings."""
    return {s: _answer(problem, setting) for s, setting in SETTINGS.items()}


def terms_of(features: np.ndarray) -> np.ndarray:
    """(N, T) library: 1, each column, and the squares of the velocities with their sign."""
    velocities = features[:, :3]
    return np.column_stack([np.ones(len(features)), features, velocities * np.abs(velocities)])


def discoveries(
    features: np.ndarray, missed: np.ndarray, block: np.ndarray, setting: Setting
) -> list[Found]:
    """Confirmed terms, the surest first.

    Args:
        features: (N, F).
        missed: (N, 3) m/s, m/s, rad/s.
        block: (N,) steps of one block stay together.
        setting: what decides.
    """
    mean, std = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-9)
    scaled = (features - mean) / std
    terms = terms_of(scaled)
    regions = _regions(scaled, setting.whole)
    inside = np.array([r.holds(scaled) for r in regions])
    tested: list[Found] = []
    for channel in range(missed.shape[1]):
        known = _known(features[:, :3], missed[:, channel], inside)
        for k in _flagged(known.left, inside):
            found = _tested(regions[k], channel, terms, known, block=block, own=inside[k])
            tested += [found] if found else []
    if not tested:
        return []
    adjusted = false_discovery_control([t.p for t in tested])
    kept = [t for t, p in zip(tested, adjusted, strict=True) if p < setting.rate]
    return sorted(kept, key=lambda t: (t.p, t.region.column, t.region.low))


def _regions(features: np.ndarray, whole: bool) -> list[Region]:
    found = [Region(0, -np.inf, np.inf)] if whole else []
    for column in range(features.shape[1]):
        edges = np.unique(np.quantile(features[:, column], np.linspace(0, 1, REGIONS + 1)))
        found += [Region(column, float(a), float(b)) for a, b in pairwise(edges)]
    return found


def _known(velocities: np.ndarray, y: np.ndarray, inside: np.ndarray) -> Known:
    """Gains fitted on the clean regime: the regions of least energy."""
    energy = np.array([np.mean(y[own] ** 2) if own.any() else np.inf for own in inside])
    quiet = energy <= np.quantile(energy, CLEAN)
    clean = inside[quiet].any(axis=0) & ~inside[energy > np.quantile(energy, 0.9)].any(axis=0)
    clean = clean if clean.sum() > 3 * FEWEST else np.ones(len(y), bool)
    v = velocities[clean]
    # Held near the base by what gains usually drift, since a clean regime may be rest alone.
    pull = np.eye(3) * np.var(y[clean]) / DRIFT**2
    gains = np.linalg.solve(v.T @ v + pull, v.T @ y[clean])
    left = y - velocities @ gains
    spread = max(float(np.std(left[clean])), 1e-9)
    return Known(gains, left / spread, spread)


def _flagged(y: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Regions whose energy is more than the clean regime's noise makes."""
    count = inside.sum(axis=1)
    p = chi2.sf([np.square(y[own]).sum() for own in inside], np.maximum(count, 1))
    flagged = false_discovery_control(p) < FLAG
    return np.flatnonzero(flagged & (count >= 3 * FEWEST))


def _tested(
    region: Region, channel: int, terms: np.ndarray, known: Known, *, block: np.ndarray, own
) -> Found | None:
    """Terms by held-out blocks of the region, and their F test on blocks that chose nothing."""
    y = known.left
    order = {b: i for i, b in enumerate(np.unique(block[own]))}
    part = np.array([order.get(b, 0) % 3 for b in block])
    fit, choose, test = (own & (part == k) for k in range(3))
    if min(fit.sum(), choose.sum(), test.sum()) < FEWEST:
        return None
    chosen = _selected(terms[fit], y[fit], terms[choose], y[choose])
    if not chosen:
        return None
    x = terms[test][:, chosen]
    left_count = int(test.sum()) - len(chosen)
    left = y[test] - x @ np.linalg.lstsq(x, y[test], rcond=1e-9)[0]
    fall = np.square(y[test]).sum() - np.square(left).sum()
    value = fall / len(chosen) / (np.square(left).sum() / left_count)
    p = float(f_distribution.sf(max(value, 0.0), len(chosen), left_count))
    factors = np.linalg.lstsq(terms[own][:, chosen], y[own], rcond=1e-9)[0]
    return Found(region, channel, chosen, factors * known.spread, p, known)


def _selected(
    x: np.ndarray, y: np.ndarray, x_held: np.ndarray, y_held: np.ndarray
) -> tuple[int, ...]:
    """The one or two terms whose fit predicts held-out steps best; none if nothing does."""
    gram, moment = x.T @ x, x.T @ y
    held, moment_held = x_held.T @ x_held, x_held.T @ y_held
    best, best_square = (), 0.0  # beside the sum of squares without any term
    for count in range(1, MOST_TERMS + 1):
        chosen = np.array(list(combinations(range(x.shape[1]), count)))
        rows, columns = chosen[:, :, None], chosen[:, None, :]
        own = gram[rows, columns]
        size = np.prod(np.diagonal(own, axis1=1, axis2=2), axis=1)
        apart = np.linalg.det(own) > 1e-6 * size
        chosen, own = chosen[apart], own[apart]
        b = np.linalg.solve(own, moment[chosen][..., None])[..., 0]
        taken = np.einsum("ki,kij,kj->k", b, held[rows[apart], columns[apart]], b)
        square = taken - 2 * np.sum(b * moment_held[chosen], axis=1)
        if len(square) and square.min() < best_square:
            best, best_square = tuple(map(int, chosen[square.argmin()])), float(square.min())
    return best


def _answer(problem: Problem, setting: Setting) -> Answer:
    steps = Steps.of(problem.measurement, problem.model, setting.step_s)
    features = steps.features
    found = discoveries(features, steps.missed, steps.block, setting)
    told = bool(found)
    sure = -np.log10(max(found[0].p, 1e-300)) if told else 0.0
    if not told:
        return Answer(False, 0.0, predicted_by(problem.model))
    own = [next((f for f in found if f.channel == c), None) for c in range(3)]
    mean, std = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-9)

    low, high = features.min(axis=0), features.max(axis=0)

    def missed(other: np.ndarray) -> np.ndarray:
        scaled = (np.clip(other, low, high) - mean) / std
        terms, out = terms_of(scaled), np.zeros((len(other), 3))
        for f in own:
            if f is not None:
                here = f.region.holds(scaled)
                out[:, f.channel] = other[:, :3] @ f.known.gains
                out[here, f.channel] += terms[here][:, f.terms] @ f.factors
        return out

    predict = corrected(problem.model, setting.step_s, missed)
    return Answer(True, float(sure), predict, depends_on=_words(found, steps))


def _words(found: Sequence[Found], steps: Steps) -> tuple[str, ...]:
    """Groups by how often the surest discoveries speak of them: a term counts more than a place."""
    groups = (*steps.groups, *[SPEED] * 3)
    weight: dict[str, float] = {}
    for rank, f in enumerate(found):
        here = [groups[t - 1] for t in f.terms if t > 0]
        if np.isfinite(f.region.low):
            here.append(steps.groups[f.region.column])
        for group in here:
            weight[group] = weight.get(group, 0.0) + 0.8**rank
    return tuple(sorted(weight, key=lambda g: -weight[g]))


RIVAL = Rival(
    name="LISDD",
    source="arXiv 2606.23215, rebuilt",
    settings={
        DOCUMENTED: "steps of 0.1 s; a fifth of each variable's range is a region; false "
        "discoveries 5 %",
        TUNED: "steps of 0.5 s, whose noise is independent; the whole space is a region, too; "
        "false discoveries 1e-6",
    },
    lacks=dict.fromkeys(("name", "wrong"), "a term of its library is no effect of a catalogue"),
    answers=answers,
)
