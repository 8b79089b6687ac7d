# SPDX-License-Identifier: Apache-2.0
"""Linear gain of effects beside a model, and where one acts best."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from scipy.special import log_ndtr, logsumexp

from twinmill.inference.candidate import Candidate, Limits
from twinmill.inference.evidence import Linear
from twinmill.inference.hypothesis import Hypothesis
from twinmill.inference.problem import Steps
from twinmill.inference.settings import PRIORS
from twinmill.model.parameters import DURATION, WHERE_OR_WHEN, key_of, newest_instance

CELL = 4  # reaches by which a place or a while is moved make a step of the grid, as ...
REACH_S, REACH = 0.5, 0.25  # ... they are of a moment, and of a place and its radius, over this
NEARER, NEAREST = 0.5, 0.2  # factor on the reach where no move is better, and the last
MOVES = 8  # at most
AT_ONCE = 0.5  # chance that a change is at once, and that it is gradual: none is the usual one
PLACES = 9  # decimals in which two points of a place or a while are the same
Whiten = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Screened:
    """An effect, were it linear.

    Attributes:
        gain: in log evidence, averaged over its grid of places, whiles or limits.
        starts: (S, P) best numbers; of what acts somewhere the best of each sign, since a loss at a
            place is nearly a gain everywhere else.
        grid: the gain less that of the grid's best point.
        white: (k, R) columns at that point, scaled by the standard deviation of the prior.
    """

    gain: float
    starts: np.ndarray
    grid: float
    white: np.ndarray = field(repr=False)


def screened(linear: Linear, columns: dict[str, Candidate], whiten: Whiten) -> dict[str, Screened]:
    """Gain of each effect beside a linear model."""
    each = {}
    for name, c in columns.items():
        if c.limits is None:
            each[name] = _by_size(c, linear, whiten)
        else:
            each[name] = _by_limits(c.limits, linear, whiten)
    return each


def gains_of_pairs(linear: Linear, white: dict[str, np.ndarray]) -> dict[tuple[str, str], float]:
    """Gain in log evidence by two effects together, for each pair of (k, R) white columns."""
    stacked = np.concatenate([np.zeros((0, len(linear.y))), *white.values()])
    parts: dict[str, np.ndarray] = {}
    for name, own in white.items():
        begin = sum(len(other) for other in parts.values())
        parts[name] = np.arange(begin, begin + len(own))
    gram, push = linear.projected(stacked, stacked @ stacked.T)
    found = {}
    for pair in combinations(parts, 2):
        at = np.concatenate([parts[name] for name in pair])
        own = gram[np.ix_(at, at)] + np.eye(len(at))
        gain = push[at] @ np.linalg.solve(own, push[at]) - np.linalg.slogdet(own)[1]
        found[pair] = 0.5 * float(gain)
    return found


def nearby(
    c: Candidate,
    starts: np.ndarray,
    h: Hypothesis,
    linear: Linear,
    *,
    steps: Steps,
    whiten: Whiten,
) -> tuple[np.ndarray, float]:
    """(P,) numbers of an effect with its place or while where it gains most, near some starts.

    And the log of the share of a cell of the grid in which it gains that much: the posterior of a
    place may be narrower than the grid (Laplace; MacKay 2003, Information Theory, ch. 28).

    Args:
        c: the effect.
        starts: (S, P) its numbers at points of the grid.
        h: without it.
        linear: the linear model of that; all its numbers are free.
        steps: of the logs.
        whiten: their noise.
    """
    model = h.model.copy()
    model.add_effect(c.name)
    instance = newest_instance(model, c.name)
    names = [f"{instance}.{key_of(p.name)}" for p in c.parameters]
    where = [k for k, p in enumerate(c.parameters) if p.role in WHERE_OR_WHEN]
    low, high = (np.array([getattr(c.parameters[k], end) for k in where]) for end in ("min", "max"))
    gradual = np.array([c.parameters[k].role == DURATION for k in where])
    ways = np.array(list(product((0, -1, 1), repeat=len(where))), float)  # the first stays

    usual = np.array([p.usual for p in c.parameters])
    nothing = steps.errors(model, names, usual[None])
    seen: dict[tuple[float, ...], tuple[float, np.ndarray]] = {}  # most moves meet known points

    def gains_at(tries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rounded = [tuple(point) for point in tries.round(PLACES)]
        fresh = {key: at for key, at in zip(rounded, tries, strict=True) if key not in seen}
        if fresh:
            points = np.tile(usual, (len(fresh), len(c.sizes), 1))
            points[:, :, where] = np.array(list(fresh.values()))[:, None]
            for n, k in enumerate(c.sizes):
                points[:, n, k] = c.parameters[k].value
            errors = steps.errors(model, names, points.reshape(-1, len(names)))
            white = PRIORS.size * whiten(nothing - errors).reshape(*points.shape[:2], -1)
            seen.update(
                zip(
                    fresh,
                    zip(*_gains(*_products(white, linear), c.one_sided), strict=True),
                    strict=True,
                )
            )
        gains, weights = zip(*map(seen.__getitem__, rounded), strict=True)
        return np.array(gains), np.array(weights)

    found = []
    for at in starts[:, where]:
        share = 1.0
        for _ in range(MOVES):
            reach = REACH * at[-1] if c.parameters[where[0]].role == "place" else REACH_S
            tries = np.clip(at + share * reach * ways, low, high)
            gains, weights = gains_at(tries)
            best = int(np.argmax(gains))
            if best == 0 and share < NEAREST:
                break
            at, share = tries[best], share if best else NEARER * share
        alone = np.abs(ways).sum(axis=1) == 1
        falls = [gains[0] - gains[alone & (ways[:, k] != 0)].mean() for k in range(len(where))]
        widths = share * np.sqrt(np.pi / np.maximum(falls, 1e-9)) / CELL
        shares = np.minimum(np.where(gradual & (at == low), 1, widths), 1)
        log_share = float(np.log(np.where(gradual, AT_ONCE, 1) * shares).sum())
        found.append((float(gains[best]), _start(c, weights[best], at, where), log_share))
    return max(found, key=lambda f: f[0] + f[2])[1:]


def _products(white: np.ndarray, linear: Linear) -> tuple[np.ndarray, np.ndarray]:
    """(G, k, k) Gram matrices of (G, k, R) white columns, and (G, k) products with what is left."""
    cross, push = linear.taken(white.reshape(-1, white.shape[-1]))
    cross = cross.reshape(*white.shape[:2], -1)
    gram = white @ white.swapaxes(1, 2) - cross @ cross.swapaxes(1, 2)
    return gram, push.reshape(white.shape[:2])


def _products_of_whiles(
    white: np.ndarray, ends: np.ndarray, linear: Linear
) -> tuple[np.ndarray, np.ndarray]:
    """`_products` of the differences of (M, k, R) white columns at (G, 2) ends."""
    count, sizes, _ = white.shape
    flat, (a, b) = white.reshape(count * sizes, -1), ends.T
    gram, push = linear.projected(flat, flat @ flat.T)
    gram, push = gram.reshape(count, sizes, count, sizes), push.reshape(count, sizes)
    across = gram[a, :, b]
    both = gram[a, :, a] + gram[b, :, b] - across - across.swapaxes(1, 2)
    return both, push[a] - push[b]


def _gains(
    gram: np.ndarray, push: np.ndarray, one_sided: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(G,) gains in log evidence, and (G, k) best weights, of columns with these products."""
    gram = gram + np.eye(gram.shape[1])
    solved = np.linalg.solve(gram, push[..., None])[..., 0]
    gains = 0.5 * (push * solved).sum(axis=1) - 0.5 * np.linalg.slogdet(gram)[1]
    if one_sided.any():
        spread = np.sqrt(np.diagonal(np.linalg.inv(gram), axis1=1, axis2=2))
        sided = np.log(2) + log_ndtr(solved / spread)
        gains = gains + np.where(one_sided, sided, 0.0).sum(axis=1)
    return gains, solved


def _by_size(c: Candidate, linear: Linear, whiten: Whiten) -> Screened:
    masks = np.ones((1, c.columns.shape[1])) if c.where is None else c.where.masks
    ends = None if c.where is None else c.where.ends
    white = PRIORS.size * np.stack([whiten(masks[:, :, None] * own) for own in c.columns], axis=1)
    if ends is None:
        gram, push = _products(white, linear)
    else:
        gram, push = _products_of_whiles(white, ends, linear)
    gains, solved = _gains(gram, push, c.one_sided)
    order, total = np.argsort(-gains), float(logsumexp(gains) - np.log(len(gains)))
    best = order[0]
    if c.where is None:
        starts = [_start(c, solved[best], np.zeros(0), [])]
    else:
        where = [k for k in range(len(c.parameters)) if k not in c.sizes]
        other = [k for k in order if solved[k, 0] * solved[best, 0] < 0][:1]
        starts = [_start(c, solved[k], c.where.at[k], where) for k in (best, *other)]
    columns = white[best] if ends is None else np.subtract(*white[ends[best]])
    return Screened(total, np.array(starts), total - float(gains[best]), columns)


def _start(c: Candidate, weights: np.ndarray, at: np.ndarray, where: list[int]) -> np.ndarray:
    """(P,) numbers of an effect, of weights of its sizes and where it acts."""
    start = np.array([p.usual for p in c.parameters], float)
    strength = np.array([p.value - p.usual for p in c.parameters])
    start[c.sizes] += PRIORS.size * weights * strength[c.sizes]
    start = np.clip(start, [p.min for p in c.parameters], [p.max for p in c.parameters])
    start[where] = at
    return start


def _by_limits(limits: Limits, linear: Linear, whiten: Whiten) -> Screened:
    """An effect of limits, which has no size."""
    white = whiten(limits.changes)
    cross, push = linear.taken(white)
    gains = push - 0.5 * ((white**2).sum(axis=1) - (cross**2).sum(axis=1))
    best, total = int(np.argmax(gains)), float(logsumexp(gains) - np.log(len(gains)))
    return Screened(total, limits.at[[best]], total - float(gains[best]), white[[best]])
