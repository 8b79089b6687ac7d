# SPDX-License-Identifier: Apache-2.0
"""What no effect of the catalogue explains: a library of velocity terms without physics names.

Its groups say what the rest depends on. Ridge regression of the whitened errors, judged on blocks
of 4 s that it was not fitted to.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from twinmill.data.track import command_at
from twinmill.diagnosis.changes import change_columns
from twinmill.diagnosis.screen import project_out
from twinmill.fitting.solve import System
from twinmill.model.freedom import Free, words
from twinmill.predict.problem import CLOCK, Scene
from twinmill.predict.residual import body_velocity, rotate

CHANGE = "change of the command"
NO_VELOCITY = ""  # what a term adds to that only tells of a dependence
FOLDS = 5
AGAIN = 2.0  # times what was left elsewhere that is no news
FLIPS = 499  # random signs of blocks that make the null distribution
BESIDE = 0.1  # share by which a group must raise what better groups bring
ALPHA = 0.01  # chance of naming anything if nothing is left, over all that is tested
STILL = (0.002, 0.002, 0.01)  # m/s, m/s, rad/s: below it an axis does not move; wheels differ
TYPICAL = (0.01, 0.01, 0.05)  # m/s, m/s, rad/s: what a term of full size may add
NO_NAMES = {"dvx", "dvy", "domega", "V"}  # rates and voltage: not at hand in a body's formula
CHANNELS = ("vx_mps", "vy_mps", "omega_radps")
LEFT_OVER = 0.02  # share of a term's norm that must survive the projection


@dataclass(frozen=True)
class Term:
    """One candidate formula: adds p0 times `formula` to a velocity of the body.

    Attributes:
        group: what it depends on.
        adds_to, formula: as the effect `equation` takes them, but for names in NO_NAMES.
        size: of the formula's values, 95th percentile.
    """

    group: str
    adds_to: str
    formula: str
    size: float

    @property
    def addable(self) -> bool:
        """The effect `equation` knows all its names."""
        return not words(self.formula) & NO_NAMES


@dataclass(frozen=True)
class Dependence:
    """A group of terms.

    Attributes:
        gain: held-out fall of chi2 that it brings alone.
        excess: that over its spread by chance.
        sure: more than chance would bring.
    """

    group: str
    gain: float
    excess: float
    sure: bool


@dataclass(frozen=True)
class Omnibus:
    """What the library still explains.

    Attributes:
        gain: held-out fall of chi2 by all groups that help.
        groups: those that help significantly, best first.
        term: the best single formula and its coefficient; None if no group helps.
        coefficient: of that term, in its unit.
        left_over: fall of chi2 per step by every group that brings any, known or not.
        old: groups that help beyond chance, but no more than they did elsewhere.
    """

    gain: float
    groups: list[Dependence]
    term: Term | None
    coefficient: float
    left_over: dict[str, float]
    old: tuple[str, ...] = ()

    @property
    def equation(self) -> dict[str, str] | None:
        """Texts of an effect `equation` that adds the best formula to a model; None if none can."""
        if not self.term or not self.term.addable:
            return None
        return {"adds_to": self.term.adds_to, "formula": f"p0*{self.term.formula}"}

    @property
    def significant(self) -> bool:
        """Something outside the model is there."""
        return bool(self.groups)


NOTHING = Omnibus(0.0, [], None, 0.0, {})


def unexplained(
    scenes: list[Scene], free: list[Free], known: Mapping[str, float] | None = None
) -> Omnibus:
    """Tests the library on what the scenes' models leave.

    Args:
        scenes: measurements with their models.
        free: what was fitted.
        known: fall of chi2 per step by group that the models left in other logs already: what is no
            more than a few times that is not counted again.
    """
    system = System(scenes, free)
    left, basis = project_out(system)
    rows = len(left) - len(system.unknowns)
    terms, columns = _library(scenes, rows)
    before = np.linalg.norm(columns, axis=0)
    columns = columns - basis[:rows] @ (basis[:rows].T @ columns)
    keep = np.linalg.norm(columns, axis=0) > LEFT_OVER * np.maximum(before, 1e-12)
    terms = [t for t, k in zip(terms, keep, strict=True) if k]
    products = _Products(columns[:, keep], left[:rows], system.blocks())
    every = _dependences(terms, products)
    left_over = {g.group: 3 * g.gain / rows for g in every if g.gain > 0}
    news = [g for g in every if 3 * g.gain / rows > AGAIN * (known or {}).get(g.group, 0.0)]
    groups = [g for g in news if g.sure]
    old = tuple(g.group for g in every if g.sure and g not in news)
    if not groups:
        return replace(NOTHING, left_over=left_over, old=old)
    groups, gain = _without_shadows(groups, terms, products)
    best, coefficient = _best_term(terms, products, groups[0].group)
    return Omnibus(max(gain, groups[0].gain), groups, best, coefficient, left_over, old)


def _without_shadows(
    groups: list[Dependence], terms: list[Term], products: "_Products"
) -> tuple[list[Dependence], float]:
    """Those groups that bring something beside the better ones, and what they bring together."""
    kept, gain = [], 0.0
    for group in groups:
        names = {g.group for g in [*kept, group]}
        together, _ = products.held_out(np.array([t.group in names for t in terms]))
        if not kept or together > (1 + BESIDE) * gain:
            kept, gain = [*kept, group], together
    return kept, gain


def _dependences(terms: list[Term], products: "_Products") -> list[Dependence]:
    """What each group brings, as a whole or by one formula, and whether that is beyond chance.

    It is if it is more than the largest of all that is tested is under random signs of blocks, each
    over its own spread there, and if it is evidence enough for one of so many (as of an effect).
    """
    tested: list[tuple[str, np.ndarray]] = []
    for group in dict.fromkeys(t.group for t in terms):
        own = dict.fromkeys(t.formula for t in terms if t.group == group)
        tested.append((group, np.array([t.group == group for t in terms])))
        tested += [(group, np.array([t.formula == f for t in terms])) for f in own]
    found = [products.held_out(own) for _, own in tested]
    spread = np.array([null.std() for _, null in found])
    highest = np.max([null / s for (_, null), s in zip(found, spread, strict=True)], axis=0)
    least, least_gain = np.quantile(highest, 1 - ALPHA), 2 * np.log(len(tested) / ALPHA)
    best: dict[str, Dependence] = {}
    for (group, _), (gain, _), scale in zip(tested, found, spread, strict=True):
        sure = bool(gain / scale > least and gain > least_gain)
        this = Dependence(group, gain, float(gain / scale), sure)
        if group not in best or (this.sure, gain) > (best[group].sure, best[group].gain):
            best[group] = this
    return sorted(best.values(), key=lambda g: -g.gain)


class _Products:
    """Products of the library's columns with each other and with the errors, block by block."""

    def __init__(self, columns: np.ndarray, left: np.ndarray, blocks: np.ndarray) -> None:
        order = np.argsort(blocks, kind="stable")
        edges = np.searchsorted(blocks[order], np.arange(blocks.max() + 2))
        parts = [order[a:b] for a, b in pairwise(edges)]
        self.grams = np.array([columns[p].T @ columns[p] for p in parts])
        self.moments = np.array([columns[p].T @ left[p] for p in parts])

    def held_out(self, own: np.ndarray) -> tuple[float, np.ndarray]:
        """Fall of chi2 by these columns on blocks not fitted to, and (F,) that chance would bring.

        Chance: random signs of what each block still scatters after the columns are fitted to all.
        """
        grams, moments = self.grams[:, own][:, :, own], self.moments[:, own]
        signs = np.random.default_rng(1).choice([-1.0, 1.0], (FLIPS, len(grams), 1))
        prior = np.eye(own.sum())  # columns are in typical strengths
        scatter = moments - grams @ np.linalg.solve(grams.sum(0) + prior, moments.sum(0))
        moments = np.concatenate([moments[None], signs * scatter])
        fold = np.arange(len(grams)) % FOLDS
        gain = np.zeros(1 + FLIPS)
        for k in range(FOLDS):
            test = fold == k
            gram = grams[~test].sum(0) + prior
            fitted = np.linalg.solve(gram, moments[:, ~test].sum(1).T).T
            gain += 2 * np.sum(moments[:, test].sum(1) * fitted, axis=1)
            gain -= np.sum(fitted @ grams[test].sum(0) * fitted, axis=1)
        return float(gain[0]), gain[1:]


def _best_term(terms: list[Term], products: _Products, group: str) -> tuple[Term, float]:
    """The single term of a group that explains most, and its coefficient in its own unit."""
    own = [i for i, t in enumerate(terms) if t.group == group and t.adds_to != NO_VELOCITY]
    moment = products.moments.sum(0)[own]
    energy = np.diag(products.grams.sum(0))[own] + 1.0
    best = int(np.argmax(moment**2 / energy))
    term = terms[own[best]]
    typical = TYPICAL[CHANNELS.index(term.adds_to)] / term.size
    return term, float(moment[best] / energy[best] * typical)


def _library(scenes: list[Scene], rows: int) -> tuple[list[Term], np.ndarray]:
    """All terms, and their whitened signatures at typical strength, (rows, T).

    One size for all: a robot that never changes its command has none of its own. Numbers in a
    formula are those of the last scene.
    """
    terms, parts = [], [[] for _ in scenes]
    named = [_named_terms(scene) for scene in scenes]
    for (group, formula), values in zip(named[-1], zip(*(n.values() for n in named), strict=True),
                                        strict=True):  # fmt: skip
        if not any(np.ptp(v) > 0 for v in values):
            continue
        size = _size(np.concatenate(values))
        for axis, channel in enumerate(CHANNELS):
            terms.append(Term(group, channel, formula, size))
            for scene, own, v in zip(scenes, parts, values, strict=True):
                own.append(_whitened(scene, v / size, axis).ravel())
    changes = [change_columns(scene) for scene in scenes]
    terms += [Term(CHANGE, NO_VELOCITY, kind, 1.0) for kind in changes[-1][0]]
    parts = [np.column_stack([*own, more]) for own, (_, more) in zip(parts, changes, strict=True)]
    stacked = np.concatenate(parts)
    if len(stacked) != rows:
        raise ValueError(f"library has {len(stacked)} rows where the errors have {rows}")
    return terms, stacked


def _size(values: np.ndarray) -> float:
    """What all but the largest are below; of rare ones, which that would call nothing, the RMS."""
    return max(float(np.percentile(np.abs(values), 95)), float(np.sqrt(np.mean(values**2))), 1e-9)


def _whitened(scene: Scene, values: np.ndarray, axis: int) -> np.ndarray:
    """(S, 3) whitened one-step errors that a velocity of `values` in one body axis makes."""
    grid = scene.grid
    step = TYPICAL[axis] * values * grid.period_s * grid.share
    heading_rad = scene.measurement.track.heading_smooth[grid.source]
    errors = np.zeros((len(values), 3))
    if axis == 2:
        errors[:, 2] = step
    else:
        along = (step, np.zeros_like(step)) if axis == 0 else (np.zeros_like(step), step)
        errors[:, 0], errors[:, 1] = rotate(*along, heading_rad)
    return scene.noise.whiten(errors, grid)


def _named_terms(scene: Scene) -> dict[tuple[str, str], np.ndarray]:
    """(group, formula) to values (S,) over time."""
    track, grid = scene.measurement.track, scene.grid
    velocity = body_velocity(scene.measurement, grid, scene.model)
    vx, vy, turn = np.where(np.abs(velocity) < STILL, 0.0, velocity).T
    theta = track.heading_smooth[grid.source]
    x, y = (track.pose[grid.source, k] for k in (0, 1))
    t_s = grid.t_s - scene.model.get(CLOCK)
    voltage = command_at(t_s, track.command_t_s, np.nan_to_num(track.battery_V)[:, None])[:, 0]
    moving = (np.hypot(vx, vy) + 0.1 * np.abs(turn) > 0.01) * 1.0
    change = [_rate(v, grid) for v in (vx, vy, turn)]
    terms = {
        ("direction of rotation", "abs(vx)"): np.abs(vx),
        ("direction of rotation", "abs(vy)"): np.abs(vy),
        ("direction of rotation", "abs(omega)"): np.abs(turn),
        ("speed", "vx*abs(vx)"): vx * np.abs(vx),
        ("speed", "vy*abs(vy)"): vy * np.abs(vy),
        ("speed", "omega*abs(omega)"): turn * np.abs(turn),
        ("speed", "sign(vx)"): np.tanh(vx / 0.02),
        ("speed", "sign(vy)"): np.tanh(vy / 0.02),
        ("speed", "sign(omega)"): np.tanh(turn / 0.1),
        ("coupling of the axes", "vx*omega"): vx * turn,
        ("coupling of the axes", "vy*omega"): vy * turn,
        ("coupling of the axes", "vx*vy"): vx * vy,
        ("coupling of the axes", "vx*abs(omega)"): vx * np.abs(turn),
        ("coupling of the axes", "vx*abs(vy)"): vx * np.abs(vy),
        ("coupling of the axes", "vy*abs(vx)"): vy * np.abs(vx),
        ("coupling of the axes", "vy*abs(omega)"): vy * np.abs(turn),
        ("coupling of the axes", "omega*abs(vx)"): turn * np.abs(vx),
        ("coupling of the axes", "omega*abs(vy)"): turn * np.abs(vy),
        (CHANGE, "dvx"): change[0],
        (CHANGE, "dvy"): change[1],
        (CHANGE, "domega"): change[2],
        (CHANGE, "abs(dvx)"): np.abs(change[0]),
        (CHANGE, "abs(dvy)"): np.abs(change[1]),
        (CHANGE, "abs(domega)"): np.abs(change[2]),
    }
    speeds = (("vx", vx), ("vy", vy), ("omega", turn))
    for n in (1, 2, 3):
        for name, wave in (("cos", np.cos(n * theta)), ("sin", np.sin(n * theta))):
            for carrier, values in (("moves", moving), *speeds):
                terms["heading", f"{name}({n}*theta)*{carrier}"] = wave * values
    for group, name, values in (
        ("place", "x", x), ("place", "y", y), ("time", "t", t_s), ("battery voltage", "V", voltage)
    ):  # fmt: skip
        middle = float(f"{np.mean(values):.4g}")
        away = values - middle
        text = f"({name} - {middle:g})"
        for carrier, speed in speeds:
            terms[group, f"{text}*{carrier}"] = away * speed
            if group == "place":
                terms[group, f"{text}*{text}*{carrier}"] = away**2 * speed
    return terms


def _rate(values: np.ndarray, grid) -> np.ndarray:
    """Rate of change within unbroken stretches."""
    rate = np.gradient(values) / grid.period_s
    for start in grid.starts:
        rate[max(start - 1, 0) : start + 1] = 0
    return rate
