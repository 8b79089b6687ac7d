# SPDX-License-Identifier: Apache-2.0
"""What is left over once the found effects are in the model: how much, how firm, depending on what.

How much: the squared score above 1. How firm: whether the smooth response of the noise floor
predicts left-out parts better than the model does, block by block. On what: ridge regression of
the errors on groups of velocity terms without physics names, each judged on parts that it was not
fitted to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.data.track import command_at
from twinmill.diagnosis.moments import Moment, moments_of
from twinmill.fitting.floor import body_velocity_at
from twinmill.fitting.opening import Opened
from twinmill.fitting.response import Response
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.parameters import words

FOLDS = 5
FLIPS = 499  # random signs of blocks that make the null distribution
BESIDE = 0.1  # share by which a group must raise what better groups bring
ALPHA = 0.01  # chance of naming anything if nothing is left, over all that is tested
AGAIN = 2.0  # times what the model left in other logs already: no news
FIRM_T = 3.0
STILL = (0.002, 0.002, 0.01)  # m/s, m/s, rad/s: below it an axis does not move; wheels differ
TYPICAL = (0.01, 0.01, 0.05)  # m/s, m/s, rad/s: what a term of full size may add
# Rates, voltage, history: not at hand in a body's formula.
NO_NAMES = {"dvx", "dvy", "domega", "V", "after_reversal"}
CHANNELS = ("vx_mps", "vy_mps", "omega_radps")
CHANGE = "change of the command"
MOMENTS = "single moments"
REVERSAL_S = 0.15  # how long a reversal is felt
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
    """A group of terms: the held-out fall of the cost that it brings, and whether chance could."""

    group: str
    gain: float
    sure: bool


@dataclass(frozen=True)
class Rest:
    """What is left over.

    Attributes:
        share: of the squared score above 1 that the model as given had.
        firm: the smooth response predicts left-out parts better, beyond doubt.
        depends_on: groups, the strongest first.
        term, coefficient: the best single formula, in its unit; None if no group helps.
        takes: share of what is left that the formula takes on left-out parts.
        left_over: fall of the cost per independent error by every group that brings any.
        old: groups that help no more than they did on other logs.
        moments: events that neither commands nor findings explain.
    """

    share: float
    firm: bool
    depends_on: list[str]
    term: Term | None = None
    coefficient: float = 0.0
    takes: float = 0.0
    left_over: Mapping[str, float] | None = None
    old: tuple[str, ...] = ()
    moments: tuple[Moment, ...] = ()

    @property
    def formula(self) -> str | None:
        """For people."""
        return f"{self.term.adds_to} += p0 * {self.term.formula}" if self.term else None

    @property
    def equation(self) -> dict[str, str] | None:
        """Texts of an effect `equation` that adds the best formula to a model; None if none can."""
        if not self.term or not self.term.addable:
            return None
        return {"adds_to": self.term.adds_to, "formula": f"p0*{self.term.formula}"}


def rest_of(
    opened: Sequence[Opened],
    fit: ScoreFit,
    first_score: float,
    last_score: float,
    known: Mapping[str, float],
) -> Rest:
    """Tests what a fit leaves.

    Args:
        opened: the fit's measurements, in its order.
        fit: of the final model.
        first_score: held out, of the model as given.
        last_score: held out, of the fit.
        known: what the model left in other logs already, as `left_over`.
    """
    excess = max(first_score**2 - 1, last_score**2 - 1, 1e-9)
    share = float(max(last_score**2 - 1, 0.0) / excess)
    logs = [(i, o) for i, o in enumerate(opened) if o.floor and o.floor.response]
    if not logs:
        return Rest(share, False, [])
    firm = _firm(logs, fit)
    found = _dependences(logs, fit, known)
    moments = moments_of([own for _, own in logs], [fit.models[i] for i, _ in logs])
    depends_on = [*found.depends_on, *([MOMENTS] if moments else [])]
    return replace(found, share=share, firm=firm, depends_on=depends_on, moments=tuple(moments))


def _firm(logs: list[tuple[int, Opened]], fit: ScoreFit) -> bool:
    """Whether the response predicts left-out blocks better than the model: t over blocks."""
    falls = []
    for i, own in logs:
        model = fit.block_squares[i]
        rows = (np.nan_to_num(own.floor.across) * own.data.weight).reshape(-1)
        response = np.bincount(own.data.block, rows**2, len(model))
        falls += list((model - response) / np.maximum(model + response, 1e-300))
    falls = np.array(falls)
    if len(falls) < 3:
        return False
    return bool(falls.mean() > FIRM_T * np.std(falls, ddof=1) / np.sqrt(len(falls)))


# -- the library --------------------------------------------------------------------------------


def _dependences(logs: list[tuple[int, Opened]], fit: ScoreFit, known: Mapping[str, float]) -> Rest:
    rows, _ = fit.state
    terms, sizes = _terms_of(logs, fit)
    left, free, blocks = fit.whitened([i for i, _ in logs])
    columns = np.concatenate(
        [
            np.sqrt(fit.weight(i, rows[i]))[:, None] * _columns(own, fit.models[i], values, sizes)
            for (i, own), values in zip(logs, terms, strict=True)
        ]
    )
    named = [Term(g, CHANNELS[a], f, s) for (g, f), s in sizes.items() for a in range(3)]
    before = np.linalg.norm(columns, axis=0)
    if free.shape[1]:
        basis = np.linalg.qr(free)[0]
        columns = columns - basis @ (basis.T @ columns)
    keep = np.linalg.norm(columns, axis=0) > LEFT_OVER * np.maximum(before, 1e-12)
    keep &= before > 1e-9
    named = [t for t, k in zip(named, keep, strict=True) if k]
    products = _Products(columns[:, keep], left, blocks)
    return _verdict(named, products, float(left @ left), known)


def _verdict(
    terms: list[Term], products: "_Products", total: float, known: Mapping[str, float]
) -> Rest:
    every = _tested(terms, products)
    left_over = {d.group: d.gain / total for d in every if d.gain > 0}
    news = [d for d in every if d.gain / total > AGAIN * known.get(d.group, 0.0)]
    sure = [d for d in news if d.sure]
    old = tuple(d.group for d in every if d.sure and d not in news)
    groups = _without_shadows(sure, terms, products)
    if not groups:
        return Rest(0.0, False, [], left_over=left_over, old=old)
    best, coefficient = _best_term(terms, products, groups[0].group)
    own = np.array([t == best for t in terms])
    takes = float(products.held_out(own)[0] / max(total, 1e-9))
    names = [d.group for d in groups]
    return Rest(0.0, False, names, best, coefficient, takes, left_over, old)


def _tested(terms: list[Term], products: "_Products") -> list[Dependence]:
    """What each group brings, as a whole or by one formula, and whether that is beyond chance.

    It is if it is more than the largest of all that is tested is under random signs of blocks, each
    over its own spread there, and if it is evidence enough for one of so many.
    """
    tested: list[tuple[str, np.ndarray]] = []
    for group in dict.fromkeys(t.group for t in terms):
        own = dict.fromkeys(t.formula for t in terms if t.group == group)
        tested.append((group, np.array([t.group == group for t in terms])))
        tested += [(group, np.array([t.formula == f for t in terms])) for f in own]
    if not tested:
        return []
    found = [products.held_out(own) for _, own in tested]
    spread = np.array([max(null.std(), 1e-12) for _, null in found])
    highest = np.max([null / s for (_, null), s in zip(found, spread, strict=True)], axis=0)
    least, least_gain = np.quantile(highest, 1 - ALPHA), 2 * np.log(len(tested) / ALPHA)
    best: dict[str, Dependence] = {}
    for (group, _), (gain, _), scale in zip(tested, found, spread, strict=True):
        this = Dependence(group, gain, bool(gain / scale > least and gain > least_gain))
        if group not in best or (this.sure, gain) > (best[group].sure, best[group].gain):
            best[group] = this
    return sorted(best.values(), key=lambda d: -d.gain)


def _without_shadows(
    groups: list[Dependence], terms: list[Term], products: "_Products"
) -> list[Dependence]:
    """Those groups that bring something beside the better ones."""
    kept: list[Dependence] = []
    gain = 0.0
    for group in groups:
        names = {d.group for d in [*kept, group]}
        together, _ = products.held_out(np.array([t.group in names for t in terms]))
        if not kept or together > (1 + BESIDE) * gain:
            kept, gain = [*kept, group], together
    return kept


def _best_term(terms: list[Term], products: "_Products", group: str) -> tuple[Term, float]:
    """The single term of a group that explains most, and its coefficient in its own unit."""
    own = [i for i, t in enumerate(terms) if t.group == group]
    moment = products.moments.sum(0)[own]
    energy = np.diag(products.grams.sum(0))[own] + 1.0
    best = int(np.argmax(moment**2 / energy))
    term = terms[own[best]]
    typical = TYPICAL[CHANNELS.index(term.adds_to)] / term.size
    return term, float(moment[best] / energy[best] * typical)


class _Products:
    """Products of the library's columns with each other and with the errors, block by block."""

    def __init__(self, columns: np.ndarray, left: np.ndarray, blocks: np.ndarray) -> None:
        order = np.argsort(blocks, kind="stable")
        edges = np.searchsorted(blocks[order], np.arange(blocks.max() + 2))
        parts = [order[a:b] for a, b in pairwise(edges)]
        self.grams = np.array([columns[p].T @ columns[p] for p in parts])
        self.moments = np.array([columns[p].T @ left[p] for p in parts])

    def held_out(self, own: np.ndarray) -> tuple[float, np.ndarray]:
        """Fall of the cost by these columns on blocks not fitted to, and (F,) what chance brings.

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


def _terms_of(
    logs: list[tuple[int, Opened]], fit: ScoreFit
) -> tuple[list[dict], dict[tuple[str, str], float]]:
    """Values (N,) of each term in each log, and one size of each term for all logs."""
    middles = _middles([own for _, own in logs])
    values = [_named_terms(own, fit.models[i], middles) for i, own in logs]
    sizes = {}
    for key in [k for k in values[0] if all(k in v for v in values)]:
        every = np.concatenate([v[key] for v in values])
        # What all but the largest are below; of rare ones, which that would call nothing, the RMS.
        large = float(np.percentile(np.abs(every), 95))
        sizes[key] = max(large, float(np.sqrt(np.mean(every**2))), 1e-9)
    return values, sizes


def _middles(opened: Sequence[Opened]) -> dict[str, float]:
    """Of place, time and voltage over all logs, to four digits, as a formula has them."""
    parts: dict[str, list[np.ndarray]] = {"x": [], "y": [], "t": [], "V": []}
    for own in opened:
        response = own.floor.response
        parts["x"].append(response.pose[:, 0])
        parts["y"].append(response.pose[:, 1])
        parts["t"].append(response.middle_s)
        parts["V"].append(np.nan_to_num(own.measurement.track.battery_V))
    return {name: float(f"{np.mean(np.concatenate(p)):.4g}") for name, p in parts.items()}


def _columns(own: Opened, model: native.Model, terms: dict, sizes: dict) -> np.ndarray:
    """(R, 3 T) change of the rows by each term at typical strength in each body axis."""
    response = own.floor.response
    velocity = body_velocity_at(own.data, model, response.points)
    values = np.stack([terms[key] / sizes[key] for key in sizes], axis=-1)
    parts = [
        _displaced(response, velocity, TYPICAL[axis] * values, axis) for axis in range(3)
    ]  # each (W, H, 3, T)
    columns = np.stack(parts, axis=-1) * np.nan_to_num(own.data.weight)[..., None, None]
    return columns.reshape(-1, values.shape[1] * 3)


def _displaced(
    response: Response, velocity: np.ndarray, values: np.ndarray, axis: int
) -> np.ndarray:
    """(W, H, 3, T) change of windows' displacements by (N, T) velocities in a body axis, linear."""
    step, heading = response.step_s[:, None], response.heading_rad
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    start, ends = response.starts, np.maximum(response.ends, 0)
    if axis < 2:
        along = (c, s) if axis == 0 else (-s, c)
        x, y = (np.cumsum(a * step * values, axis=0) for a in along)
        dx, dy = x[ends] - x[start][:, None], y[ends] - y[start][:, None]
        turn = np.zeros_like(dx)
    else:
        angle = np.cumsum(step * values, axis=0)
        middle = angle - step * values / 2
        wx = -(s[:, 0] * velocity[:, 0] + c[:, 0] * velocity[:, 1])[:, None] * step
        wy = (c[:, 0] * velocity[:, 0] - s[:, 0] * velocity[:, 1])[:, None] * step
        x, y = np.cumsum(middle * wx, axis=0), np.cumsum(middle * wy, axis=0)
        ox, oy = np.cumsum(wx, axis=0), np.cumsum(wy, axis=0)
        first = angle[start][:, None]
        dx = x[ends] - x[start][:, None] - first * (ox[ends] - ox[start][:, None])
        dy = y[ends] - y[start][:, None] - first * (oy[ends] - oy[start][:, None])
        turn = angle[ends] - first
    track = response.data.measurement.track
    at = np.nan_to_num(track.heading_smooth[response.data.windows.starts])
    ch, sh = np.cos(at)[:, None, None], np.sin(at)[:, None, None]
    return np.stack([ch * dx + sh * dy, -sh * dx + ch * dy, turn], axis=2)


def _named_terms(
    own: Opened, model: native.Model, middles: Mapping[str, float]
) -> dict[tuple[str, str], np.ndarray]:
    """(group, formula) to values (N,) at the response's points."""
    response, track = own.floor.response, own.measurement.track
    velocity = body_velocity_at(own.data, model, response.points)
    vx, vy, turn = np.where(np.abs(velocity) < STILL, 0.0, velocity).T
    theta, t_s = response.heading_rad, response.middle_s
    x, y = response.pose[:, 0], response.pose[:, 1]
    voltage = command_at(t_s, track.command_t_s, np.nan_to_num(track.battery_V)[:, None])[:, 0]
    moving = (np.hypot(vx, vy) + 0.1 * np.abs(turn) > 0.01) * 1.0
    change = [_rate(v, response.step_s) for v in (vx, vy, turn)]
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
    for name, values in speeds:
        term = _after_reversal(values, t_s)
        if term.any():
            terms["reversals", f"after_reversal({name})"] = term
    if np.ptp(theta) > 0.1:
        for n in (1, 2, 3):
            for name, wave in (("cos", np.cos(n * theta)), ("sin", np.sin(n * theta))):
                for carrier, values in (("moves", moving), *speeds):
                    terms["heading", f"{name}({n}*theta)*{carrier}"] = wave * values
    for group, name, values in (
        ("place", "x", x), ("place", "y", y), ("time", "t", t_s), ("battery voltage", "V", voltage)
    ):  # fmt: skip
        if np.ptp(values) <= 0:
            continue
        away = values - middles[name]
        text = f"({name} - {middles[name]:g})"
        for carrier, speed in speeds:
            terms[group, f"{text}*{carrier}"] = away * speed
            if group == "place":
                terms[group, f"{text}*{text}*{carrier}"] = away**2 * speed
    return terms


def _rate(values: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """Rate of change; zero where a stretch begins."""
    rate = np.diff(values, prepend=values[0]) / np.where(step_s > 0, step_s, np.inf)
    return rate


def _after_reversal(speed: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """Direction of a motion that was turned round, fading with the time since; 0 before any."""
    place = np.arange(len(speed))
    last = np.maximum.accumulate(np.where(speed != 0, place, 0))
    sign = np.sign(speed[last])
    turned = np.concatenate([[False], (sign[1:] * sign[:-1]) < 0])
    since_s = t_s - t_s[np.maximum.accumulate(np.where(turned, place, 0))]
    begun = np.cumsum(turned) > 0
    return np.where(begun, sign * np.exp(-since_s / REVERSAL_S), 0.0)
