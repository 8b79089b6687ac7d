# SPDX-License-Identifier: Apache-2.0
"""What no effect of the catalogue explains: a library of velocity terms without physics names.

Its groups say what the rest depends on. Ridge regression of the whitened errors, judged on blocks
of 4 s that it was not fitted to.
"""

from dataclasses import dataclass

import numpy as np
from twinmill.calibration.diagnosis.screen import project_out
from twinmill.calibration.freedom import Free
from twinmill.calibration.problem import CLOCK, Scene
from twinmill.calibration.residual import body_velocity, rotate
from twinmill.calibration.solve import System
from twinmill.calibration.track import command_at

FOLDS = 5
SIGNIFICANT = 4.0  # standard errors of the held-out gain, over blocks
TYPICAL = (0.01, 0.01, 0.05)  # m/s, m/s, rad/s: what a term of full size may add
LEFT_OVER = 0.02  # share of a term's norm that must survive the projection


@dataclass(frozen=True)
class Term:
    """One candidate formula: adds p0 times `formula` to the velocity `channel` of the body."""

    group: str
    channel: str
    formula: str


@dataclass(frozen=True)
class Dependence:
    """A group of terms, the held-out fall of chi2 that it brings alone, its standard error."""

    group: str
    gain: float
    error: float


@dataclass(frozen=True)
class Omnibus:
    """What the library still explains.

    Attributes:
        gain, error: held-out fall of chi2 by all groups that help, and its standard error.
        groups: those that help significantly, best first.
        term: the best single formula and its coefficient; None if no group helps.
        coefficient: of that term, in its unit.
    """

    gain: float
    error: float
    groups: list[Dependence]
    term: Term | None
    coefficient: float

    @property
    def significant(self) -> bool:
        """Something outside the model is there."""
        return bool(self.groups)


NOTHING = Omnibus(0.0, 0.0, [], None, 0.0)


def unexplained(scenes: list[Scene], free: list[Free]) -> Omnibus:
    """Tests the library on what the scenes' models leave."""
    system = System(scenes, free)
    left, basis = project_out(system)
    rows = len(left) - len(system.unknowns)
    terms, columns = _library(scenes, rows)
    before = np.linalg.norm(columns, axis=0)
    columns = columns - basis[:rows] @ (basis[:rows].T @ columns)
    keep = np.linalg.norm(columns, axis=0) > LEFT_OVER * np.maximum(before, 1e-12)
    terms = [t for t, k in zip(terms, keep, strict=True) if k]
    columns, left, blocks = columns[:, keep], left[:rows], system.blocks()
    groups = []
    for group in dict.fromkeys(t.group for t in terms):
        own = np.array([t.group == group for t in terms])
        gain, error = _held_out(columns[:, own], left, blocks)
        if gain > SIGNIFICANT * error:
            groups.append(Dependence(group, gain, error))
    groups.sort(key=lambda g: -g.gain)
    helps = np.array([any(t.group == g.group for g in groups) for t in terms])
    if not groups:
        return NOTHING
    gain, error = _held_out(columns[:, helps], left, blocks)
    best, coefficient = _best_term(terms, columns, left, groups[0].group)
    return Omnibus(max(gain, groups[0].gain), error, groups, best, coefficient)


def _held_out(columns: np.ndarray, left: np.ndarray, blocks: np.ndarray) -> tuple[float, float]:
    """Fall of chi2 on blocks not fitted to, and its standard error over blocks."""
    count = blocks.max() + 1
    fold = np.arange(count) % FOLDS
    gain = np.zeros(count)
    for k in range(FOLDS):
        test = fold[blocks] == k
        x, y = columns[~test], left[~test]
        gram = x.T @ x + np.eye(x.shape[1])  # unit prior: columns are in typical strengths
        fitted = columns[test] @ np.linalg.solve(gram, x.T @ y)
        np.add.at(gain, blocks[test], left[test] ** 2 - (left[test] - fitted) ** 2)
    return float(gain.sum()), float(np.sqrt(count) * gain.std())


def _best_term(
    terms: list[Term], columns: np.ndarray, left: np.ndarray, group: str
) -> tuple[Term, float]:
    """The single term of a group that explains most, and its coefficient in its own unit."""
    own = [i for i, t in enumerate(terms) if t.group == group]
    moment = columns[:, own].T @ left
    energy = np.sum(columns[:, own] ** 2, axis=0) + 1.0
    best = int(np.argmax(moment**2 / energy))
    term = terms[own[best]]
    typical = TYPICAL[("forward", "left", "turn").index(term.channel)]
    return term, float(moment[best] / energy[best] * typical)


def _library(scenes: list[Scene], rows: int) -> tuple[list[Term], np.ndarray]:
    """All terms, and their whitened signatures at typical strength, (rows, T)."""
    parts, terms = [], []
    for scene in scenes:
        named = _named_terms(scene)
        terms, columns = [], []
        for (group, formula), values in named.items():
            size = max(np.percentile(np.abs(values), 95), 1e-9)
            for axis, channel in enumerate(("forward", "left", "turn")):
                terms.append(Term(group, channel, f"{formula} / {size:.3g}"))
                columns.append(_whitened(scene, values / size, axis))
        parts.append(np.stack(columns, -1).reshape(-1, len(terms)))
    stacked = np.concatenate(parts)
    if len(stacked) != rows:
        raise ValueError(f"library has {len(stacked)} rows where the errors have {rows}")
    return terms, stacked


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
    vx, vy, turn = body_velocity(scene.measurement, grid, scene.model).T
    theta = track.heading_smooth[grid.source]
    x, y = (track.pose[grid.source, k] - np.mean(track.pose[grid.source, k]) for k in (0, 1))
    t_s = grid.t_s - scene.model.get(CLOCK)
    hours = (t_s - t_s.mean()) / max(np.ptp(t_s), 1.0)
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
        ("change of the command", "dvx"): change[0],
        ("change of the command", "dvy"): change[1],
        ("change of the command", "domega"): change[2],
        ("change of the command", "abs(dvx)"): np.abs(change[0]),
        ("change of the command", "abs(domega)"): np.abs(change[2]),
        ("battery voltage", "(V-V0)*vx"): (voltage - voltage.mean()) * vx,
        ("battery voltage", "(V-V0)*vy"): (voltage - voltage.mean()) * vy,
        ("battery voltage", "(V-V0)*omega"): (voltage - voltage.mean()) * turn,
        ("time", "t*vx"): hours * vx,
        ("time", "t*vy"): hours * vy,
        ("time", "t*omega"): hours * turn,
    }
    for n in (1, 2):
        for name, wave in (("cos", np.cos(n * theta)), ("sin", np.sin(n * theta))):
            terms["heading", f"{name}({n}*theta)"] = wave * moving
            terms["heading", f"{name}({n}*theta)*vx"] = wave * vx
    for axis, at in (("x", x), ("y", y)):
        terms["place", f"{axis}*vx"] = at * vx
        terms["place", f"{axis}*vy"] = at * vy
        terms["place", f"{axis}*omega"] = at * turn
        terms["place", f"{axis}*{axis}*vx"] = (at**2 - np.mean(at**2)) * vx
    return {key: values for key, values in terms.items() if np.ptp(values) > 0}


def _rate(values: np.ndarray, grid) -> np.ndarray:
    """Rate of change within unbroken stretches."""
    rate = np.gradient(values) / grid.period_s
    for start in grid.starts:
        rate[max(start - 1, 0) : start + 1] = 0
    return rate
