# SPDX-License-Identifier: Apache-2.0
"""Fits what is scored: the score of all data sets with weak priors on the sizes of parameters.

Minimises  sum_i n_i ln S_i^2(theta) + sum_p ((theta_p - usual_p) / std_p)^2  with S_i the score of
data set i and n_i its number of independent errors: a Gaussian likelihood whose scale each data
set tells by itself, so that no disturbed log speaks for all. For evidence each channel of a data
set has a scale of its own: what the model lacks in one must not drown what the others show.
Levenberg and Marquardt, bounded; weights n_i / S_i^2 are renewed in each step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.chance import f_above, t_quantile
from twinmill.estimation.gaps import gaps_s, known_to_gap
from twinmill.estimation.settings import FIT_SETTINGS
from twinmill.model.covariance import Covariance
from twinmill.model.parameters import (
    ALIGNMENT,
    BASE_GAINS,
    NO_SIZE,
    NORMAL_95,
    PHASE,
    WHEEL_ANGLES,
    Parameter,
    ParameterEstimate,
    acting_by_wheel_angle,
    catalogue_name,
    duty_table,
    instance_of,
    is_local,
    lasts_for_a_while,
    phases,
    stated_names,
)
from twinmill.predict.datasets import FEWEST_BLOCKS, PARTS, ErrorDataset, Trajectory, errors_of

FEW_ROWS = 2000  # of all data sets: below it every part is fitted anew
LEAST_SQUARE = 0.25  # of a squared score: errors far below the floor tell nothing more
# Strengths at which a fit of something new may begin, times the usual, from where nothing happens.
STARTS = (1.0, 0.3, 0.1, -0.1, -0.3, -1.0, 3.0)
LIMIT_STARTS = (np.geomspace(1 / 8, 8, 37), np.geomspace(1 / 1.1, 1.1, 7))  # far, then near
ANGLES_RAD = np.radians(np.arange(-180.0, 180.0, 30.0))  # of wheels, where a fit may begin
PHASES_RAD = np.radians(np.arange(-180.0, 180.0, 15.0))  # of what recurs, likewise ...
NEAR_RAD = np.radians(np.arange(-12.0, 13.0, 3.0))  # ... and around the best of these
FAR = 3.0  # score from which on a fit of gains may begin elsewhere ...
FACTORS = (1.0, 0.5, 2.0, 0.25, 4.0)  # ... namely at so many times what they are
SEEN = 0.5  # times the prior's width: a wider estimate is the prior's
CHANCE = 0.05  # at which data sets disagree more than their blocks tell
PASSING_S = 3.0  # of blocks, where all of an effect may lie within a usual one


@dataclass(frozen=True)
class Unknown:
    """A parameter with its columns: the data sets that it acts on."""

    parameter: Parameter
    members: frozenset[int]


class _LeftOut:
    """A data set of which some rows count and others do not; all else is the whole's."""

    label: str
    robot_id: int
    block: np.ndarray
    own: Sequence[Parameter]
    by_run: bool
    part: np.ndarray
    channel: np.ndarray
    rows_by_part: Callable[[native.Model, list[str], np.ndarray], np.ndarray]

    def __init__(self, whole: ErrorDataset, kept: np.ndarray) -> None:
        self._whole, self._kept = whole, kept
        self.judged = whole.judged * kept
        self.n_eff = whole.n_eff * max(self.judged.sum() / whole.judged.sum(), 1e-9)

    def __getattr__(self, name: str) -> object:
        return getattr(self._whole, name)

    def rows(self, model: native.Model, names: list[str], values: np.ndarray) -> np.ndarray:
        return self._whole.rows(model, names, values) * self._kept


class ScoreFit:
    """A model fitted to data sets; `x` holds the values, the models have them.

    Args:
        datasets: over their floors.
        models: one for each data set (of its own robot).
        shared: parameters that all data sets share, but for what the model states of a robot.
        by_channel: each channel has a scale of its own, for evidence; else the score is minimised.
    """

    def __init__(
        self,
        datasets: Sequence[ErrorDataset],
        models: Sequence[native.Model],
        shared: Sequence[Parameter],
        by_channel: bool = False,
    ) -> None:
        self.by_channel = by_channel
        self.scales = [d.channel if by_channel else np.zeros_like(d.channel) for d in datasets]
        self.datasets, self.shared = list(datasets), list(shared)
        # (G,) share of each data set's score that each scale makes up.
        pairs = zip(self.scales, self.datasets, strict=True)
        self.judged = [np.bincount(scale, d.judged) for scale, d in pairs]
        # (G,) number of independent errors of each scale.
        self.counts = [d.n_eff if by_channel else d.n_eff.sum(keepdims=True) for d in datasets]
        self.models = [m.copy() for m in models]
        self.unknowns = self._unknowns()
        parts = [u.parameter for u in self.unknowns]
        self.low, self.high, self.usual, self.std, self.step = (
            np.array([getattr(p, k) for p in parts], float)
            for k in ("min", "max", "usual", "std", "step")
        )
        self.central = np.array([p.central for p in parts], bool)
        self.x = np.clip(np.array([p.value for p in parts], float), self.low, self.high)
        self.columns = [
            np.array([c for c, u in enumerate(self.unknowns) if i in u.members], int)
            for i in range(len(self.datasets))
        ]
        self.names = [[parts[c].name for c in own] for own in self.columns]
        self.passes = 0
        self.converged = False
        self._thinned: dict[int, ScoreFit] = {}
        # (P,) values at which the rows of each data set are known.
        self._known: tuple[np.ndarray, list[np.ndarray]] | None = None

    def _unknowns(self) -> list[Unknown]:
        stated = [
            stated_names(m, d.robot_id) for d, m in zip(self.datasets, self.models, strict=True)
        ]
        unknowns = []
        for p in self.shared:
            members = frozenset(i for i, s in enumerate(stated) if p.name not in s)
            if members:
                unknowns.append(Unknown(p, members))
        by_owner: dict[tuple[int, int | None, str], list[int]] = {}
        held = self._held_angles()
        for i, d in enumerate(self.datasets):
            there = {p.name for p in phases(self.models[i])}
            for p in d.own:
                if p.name in WHEEL_ANGLES or p.role == PHASE:
                    acts = p.name in there if p.role == PHASE else i not in held
                    if acts:
                        now = p.at(self.models[i].get(p.name))
                        unknowns.append(Unknown(now, frozenset([i])))
                elif p.name not in ALIGNMENT:  # of the robot, in all its logs, or of this run
                    owner = d.robot_id, i if d.by_run else None, p.name
                    by_owner.setdefault(owner, []).append(i)
                else:
                    unknowns.append(Unknown(p, frozenset([i])))
        for (*_, name), owned in by_owner.items():
            first = self.datasets[owned[0]]
            p = next(p for p in first.own if p.name == name)
            unknowns.append(Unknown(p, frozenset(owned)))
        return unknowns

    def _held_angles(self) -> set[int]:
        """Data sets whose wheels' starting angles are held, or tell nothing.

        Where sizes of an effect of these angles are free, they are counted from one data set's
        angles: to turn all angles is no other than to turn its cosines into sines.
        """
        held: set[int] = set()
        counted: set[int | None] = set()  # robots with sizes of their own; None: all
        shared = {instance_of(p.name) for p in self.shared}
        for i, (d, model) in enumerate(zip(self.datasets, self.models, strict=True)):
            acting = set(acting_by_wheel_angle(model))
            own = acting & {instance_of(p.name) for p in d.own}
            whose = None if acting & shared else d.robot_id
            first = bool(acting & shared or own) and whose not in counted
            if first or not acting:
                held.add(i)
            if first and isinstance(d, Trajectory):
                counted.add(whose)
        return held

    @property
    def trajectories(self) -> list[Trajectory]:
        """Data sets that are logs."""
        return [d for d in self.datasets if isinstance(d, Trajectory)]

    # -- errors ---------------------------------------------------------------------------------

    def batch(self, i: int, x: np.ndarray) -> np.ndarray:
        """(B, R) of data set i at (B, P) values."""
        own = x[:, self.columns[i]]
        if not own.shape[1]:
            self.passes += 1
            return np.repeat(errors_of(self.datasets[i], self.models[i])[None], len(x), axis=0)
        numbers: dict[bytes, int] = {}  # of distinct values: np.unique takes as long as a pass
        place = [numbers.setdefault(values.tobytes(), len(numbers)) for values in own]
        distinct = np.array([np.frombuffer(values) for values in numbers])
        self.passes += len(distinct)
        rows = self.datasets[i].rows(self.models[i], self.names[i], distinct)
        return rows if len(distinct) == len(own) else rows[place]

    def rows(self, x: np.ndarray) -> list[np.ndarray]:
        """(R,) rows of each data set at (P,) values."""
        return [self.batch(i, x[None])[0] for i in range(len(self.datasets))]

    def _slopes(self, x: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rows of each data set, and (R, P_i) slopes by its own columns."""
        at, known = self._known or (np.zeros(0), [])
        known = known if np.array_equal(at, x) else []
        up = np.where(x + self.step <= self.high, self.step, -self.step)
        both = self.central & (x + self.step <= self.high) & (x - self.step >= self.low)
        rows, slopes = [], []
        for i, own in enumerate(self.columns):
            points = [] if known and len(own) else [x]
            for c in own:
                for sign in (1, -1) if both[c] else (1,):
                    point = x.copy()
                    point[c] += sign * up[c]
                    points.append(point)
            values = iter(self.batch(i, np.array(points)))
            at_x = known[i] if known and len(own) else next(values)
            columns = np.empty((len(own), len(at_x)))
            for column, c in zip(columns, own, strict=True):
                beside = next(values)
                column[:] = beside - (next(values) if both[c] else at_x)
                column /= 2 * up[c] if both[c] else up[c]
            rows.append(at_x)
            slopes.append(columns.T)
        return rows, slopes

    # -- cost -----------------------------------------------------------------------------------

    @property
    def sizes(self) -> np.ndarray:
        """(D,) independent errors of each data set."""
        return np.array([n.sum() for n in self.counts])

    def cost(self, rows: list[np.ndarray], x: np.ndarray) -> float:
        """The cost that the module states: of (R,) rows of each data set, at (P,) values."""
        fit = sum(self._misfit(i, r) for i, r in enumerate(rows))
        return float(fit + np.sum(((x - self.usual) / self.std) ** 2))

    def _misfit(self, i: int, rows: np.ndarray) -> float:
        """Sum over scales of n ln S^2, with S^2 no less than LEAST_SQUARE."""
        square, n = self._squares(i, rows)
        return float(n @ np.log(square))

    def _squares(self, i: int, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(G,) squared score of each scale of data set i, and its number of independent errors."""
        scale = self.scales[i]
        judged = self.judged[i]
        square = np.bincount(scale, rows**2, len(judged))
        share = judged / max(judged.sum(), 1e-12)
        n = self.counts[i] * (judged > 0)
        square = np.where(judged > 0, square / np.where(judged > 0, share, 1), 1.0)
        return np.maximum(square, LEAST_SQUARE), n

    def _normal(
        self, rows: list[np.ndarray], slopes: list[np.ndarray], x: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        gram = np.diag(1 / self.std**2)
        pull = (x - self.usual) / self.std**2
        for i, (r, j) in enumerate(zip(rows, slopes, strict=True)):
            weighted = j * self.weight(i, r)[:, None]
            own = self.columns[i]
            gram[own[:, None], own] += weighted.T @ j
            pull[own] += weighted.T @ r
        return gram, pull

    def weight(self, i: int, rows: np.ndarray) -> np.ndarray:
        """(R,) weights with which squares of rows add up to the cost, near these rows."""
        square, n = self._squares(i, rows)
        judged = self.judged[i]
        share = np.where(judged > 0, judged / max(judged.sum(), 1e-12), 1.0)
        return (n / square / share)[self.scales[i]]

    def whitened(self, members: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows (R,), slopes (R, P) and blocks (R,) of some data sets, weighted as the cost is."""
        rows, slopes = self.state
        left, columns, blocks, first = [], [], [], 0
        for i in members:
            weight = np.sqrt(self.weight(i, rows[i]))
            whole = np.zeros((len(rows[i]), len(self.x)))
            whole[:, self.columns[i]] = weight[:, None] * slopes[i]
            left.append(weight * rows[i])
            columns.append(whole)
            blocks.append(self.datasets[i].block + first)
            first = blocks[-1].max() + 1
        return np.concatenate(left), np.concatenate(columns), np.concatenate(blocks)

    # -- fit ------------------------------------------------------------------------------------

    def _without_part(self, part: int, begin: np.ndarray) -> np.ndarray:
        """A whole fit without one part: where rows are few, one step is not enough."""
        datasets = [_LeftOut(d, d.part != part) for d in self.datasets]
        fit = ScoreFit(datasets, self.models, self.shared, self.by_channel)
        fit.x = begin
        return fit.fit().x

    def begin_at_best(self, fresh: Sequence[Parameter]) -> None:
        """Begins with what is new at the best of several strengths, or of several limits.

        What is a limit alone has no slope where nothing reaches it: a fit that begins there stays
        there.
        """
        if self._angles and any(instance_of(p.name) in self._by_angle for p in fresh):
            self._begin_with_one(fresh)
            return
        roles = {p.name: p.role for p in fresh if p.role not in NO_SIZE}
        new = np.array([u.parameter.name in roles for u in self.unknowns], bool)
        if {*roles.values()} == {"limit"}:
            for factors in LIMIT_STARTS:
                self._begin_at([np.where(new, f * self.x, self.x) for f in factors])
            return
        away = self.x - self.usual
        points = [np.where(new, self.usual + s * away, self.x) for s in STARTS]
        instances = {instance_of(p.name) for p in fresh}
        if any(instance_of(self.unknowns[c].parameter.name) in instances for c in self._phases):
            points = [self._with_best_phases(point) for point in points]
        self._begin_at(points)

    def nearer(self) -> dict[str, float]:
        """Values of the base's gains, by name, at the best of a few multiples, if any is far off.

        Far from all poses the cost hardly falls (it is their logarithm), and priors hold a fit.
        Where one is far off, what was known of the others was of another robot, too.
        What moves all of the robot is tried first, then each alone. That is all gains, or the
        speeds of duties where no gain that is free multiplies them.
        """
        gained = any(u.parameter.name == BASE_GAINS[0] for u in self.unknowns)
        all_of_it = {*BASE_GAINS} if gained else {*duty_table(self.models[0])}
        kinds = [all_of_it, *({gain} for gain in BASE_GAINS)]
        own = [np.array([u.parameter.name in kind for u in self.unknowns], bool) for kind in kinds]
        own = [columns for columns in own if columns.any()]
        if not own or self._score_at(self.x) < FAR:
            return {}
        x = self.x
        for columns in own:
            x = self._best_of([np.where(columns, f * x, x) for f in FACTORS])[0]
        gains = np.flatnonzero(np.any(own, axis=0)) if np.any(x != self.x) else ()
        return {self.unknowns[c].parameter.name: float(x[c]) for c in gains}

    def _score_at(self, x: np.ndarray) -> float:
        """Score of all data sets together, at (P,) values."""
        square = [rows @ rows for rows in self.rows(x)]
        return float(np.sqrt(np.average(square, weights=self.sizes)))

    @property
    def _angles(self) -> list[int]:
        """Columns of wheels' starting angles."""
        return [c for c, u in enumerate(self.unknowns) if u.parameter.name in WHEEL_ANGLES]

    @property
    def _by_angle(self) -> list[str]:
        """Effects that depend on these."""
        return acting_by_wheel_angle(self.models[0])

    def _begin_with_one(self, fresh: Sequence[Parameter]) -> None:
        """Begins as one data set tells what is new, the angles of the others as they suit that."""
        others = {i for c in self._angles for i in self.unknowns[c].members}
        one = next(i for i in range(len(self.datasets)) if i not in others)
        alone = ScoreFit([self.datasets[one]], [self.models[one]], self.shared, self.by_channel)
        alone.begin_at_best(fresh)
        alone.fit()
        told = dict(zip(alone.names[0], alone.x[alone.columns[0]], strict=True))
        for c, u in enumerate(self.unknowns):
            if one in u.members:
                self.x[c] = told[u.parameter.name]
        self.begin_at_best_start()

    def begin_at_best_start(self) -> None:
        """Begins with what is of each log's start at the best of a whole turn or period.

        Wheels' angles one after the other, twice; then formulas' phases.
        """
        for c in 2 * self._angles:
            self.x = self._with_best(c, self.x, ANGLES_RAD)
        self.x = self._with_best_phases(self.x)
        self.usual[self._phases] = self.x[self._phases]

    @property
    def _phases(self) -> list[int]:
        """Columns of formulas' phases."""
        return [c for c, u in enumerate(self.unknowns) if u.parameter.role == PHASE]

    def _with_best_phases(self, x: np.ndarray) -> np.ndarray:
        """(P,) values with the phases of each log at their best."""
        for c in self._phases:
            x = self._with_best(c, x, PHASES_RAD)
            x = self._with_best(c, x, x[c] + NEAR_RAD)
        return x

    def _with_best(self, c: int, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(P,) values with one of a single data set's own as it is, or at the best of others."""
        (i,) = self.unknowns[c].members
        points = _each_beside(x, c, values)
        missed = [self._misfit(i, rows) for rows in self.batch(i, points)]
        return points[int(np.argmin(missed))]

    def _begin_at(self, points: Sequence[np.ndarray]) -> None:
        """Begins at the one of some points (P,) that misses least."""
        self.x, rows = self._best_of(points)
        self._known = self.x, rows
        self.usual[self._phases] = self.x[self._phases]

    def _best_of(self, points: Sequence[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
        """The one of some points (P,) that misses least, and (R,) rows of each data set there."""
        within = np.clip(np.array(points), self.low, self.high)
        rows = [self.batch(i, within) for i in range(len(self.datasets))]
        cost = [sum(self._misfit(i, r[k]) for i, r in enumerate(rows)) for k in range(len(within))]
        best = int(np.argmin(cost))
        return within[best], [r[best] for r in rows]

    def fit(
        self, rounds: int = FIT_SETTINGS.rounds, tolerance: float = FIT_SETTINGS.tolerance
    ) -> "ScoreFit":
        """Minimises the cost and leaves the values in the models; see `FitSettings`."""
        x, damping = self.x, 1e-3
        self.converged = not len(x)
        self.__dict__.pop("state", None)
        self._thinned.clear()
        if len(x):
            rows, slopes = self._slopes(x)
            cost = self.cost(rows, x)
            for done in range(1, rounds + 1):
                gram, pull = self._normal(rows, slopes, x)
                moved = None
                for _ in range(6):
                    lifted = gram + damping * np.diag(np.diag(gram))
                    trial = self._stepped(lifted, pull, x)
                    then = self.rows(trial)
                    trial_cost = self.cost(then, trial)
                    if trial_cost < cost:
                        moved = trial
                        break
                    damping *= 10
                if moved is None:
                    self.converged = True
                    self.__dict__["state"] = (rows, slopes)
                    break
                fell = cost - trial_cost
                x, cost, damping = moved, trial_cost, max(damping / 10, 1e-9)
                self._known = x, then
                self.converged = fell < tolerance * max(1.0, self.sizes.sum() * 1e-2)
                if self.converged or done == rounds:  # slopes are found where they are asked for
                    break
                rows, slopes = self._slopes(x)
        self.x = x
        self.store()
        return self

    def _stepped(
        self, gram: np.ndarray, pull: np.ndarray, x: np.ndarray, held: np.ndarray | None = None
    ) -> np.ndarray:
        """Newton's step; what would leave its bounds stops there, and the rest adapts.

        What is `held` (P,) stays.
        """
        free, moved = np.ones(len(x), bool) if held is None else ~held, x.copy()
        while free.any():
            held = moved - x
            held[free] = 0.0
            own = gram[free]
            push = pull[free] + own[:, ~free] @ held[~free]
            moved[free] = x[free] - np.linalg.solve(own[:, free], push)
            outside = free & ((moved < self.low) | (moved > self.high))
            if not outside.any():
                break
            moved = np.clip(moved, self.low, self.high)
            free &= ~outside
        return moved

    def store(self) -> None:
        """Puts the values into the models."""
        for i, own in enumerate(self.columns):
            for name, c in zip(self.names[i], own, strict=True):
                self.models[i].set(name, float(self.x[c]))

    @cached_property
    def state(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rows and slopes at the values found."""
        return self._slopes(self.x)

    @property
    def scores(self) -> np.ndarray:
        """(D,) score of each data set."""
        return np.sqrt([r @ r for r in self.state[0]])

    def thinned(self, every: int) -> "ScoreFit":
        """Fit at its values, seen from every Nth start of the logs alone."""
        if every < 2:
            return self
        if every not in self._thinned:
            few = [d.thinned(every) if isinstance(d, Trajectory) else d for d in self.datasets]
            other = ScoreFit(few, self.models, self.shared, self.by_channel)
            other.x = self.x
            self._thinned[every] = other
        return self._thinned[every]

    # -- held out -------------------------------------------------------------------------------

    def _own_to(self, kind: Callable[[str], bool]) -> np.ndarray:
        """(P,) bool: of an effect of this kind."""
        instances = [instance_of(u.parameter.name) for u in self.unknowns]
        return np.array([kind(catalogue_name(i)) for i in instances], bool)

    @cached_property
    def held_out(self) -> list[np.ndarray]:
        """(R,) rows of each data set, each part predicted by a fit to the other five parts.

        One Newton step from the joint fit, with its slopes. An effect that lasts for a while, or is
        at a place, keeps its numbers: one part may hold all of it.
        """
        rows, slopes = self.state
        if not len(self.x):
            return rows
        gram, pull = self._normal(rows, slopes, self.x)
        weighted = [
            j * self.weight(i, r)[:, None]
            for i, (r, j) in enumerate(zip(rows, slopes, strict=True))
        ]
        points, local = [], self._own_to(is_local)
        for k in range(PARTS):
            g, p = gram.copy(), pull.copy()
            for i, (r, j) in enumerate(zip(rows, slopes, strict=True)):
                out, own = np.flatnonzero(self.datasets[i].part == k), self.columns[i]
                left_out = weighted[i][out].T
                g[own[:, None], own] -= left_out @ j[out]
                p[own] -= left_out @ r[out]
            points.append(self._stepped(g, p, self.x, local))
        self._find_phases_elsewhere(points)
        if sum(len(r) for r in rows) < FEW_ROWS:
            points = [self._without_part(k, x) for k, x in enumerate(points)]
        return [self._each_part(i, np.array(points)) for i in range(len(rows))]

    def _each_part(self, i: int, points: np.ndarray) -> np.ndarray:
        """(R,) of data set i, each part at its own one of (PARTS, P) values."""
        own = np.ascontiguousarray(points[:, self.columns[i]])
        if not own.shape[1]:
            return self.batch(i, points[:1])[0]
        self.passes += len(points)
        return self.datasets[i].rows_by_part(self.models[i], self.names[i], own)

    def _find_phases_elsewhere(self, points: Sequence[np.ndarray]) -> None:
        """Sets phases of (P,) values for each part to those that the other parts tell.

        Of a whole period: else the part would have had a say in which moment was chosen.
        """
        for c in self._phases:
            (i,) = self.unknowns[c].members
            tried = _each_beside(self.x, c, PHASES_RAD)
            rows = self.batch(i, tried)
            for k, point in enumerate(points):
                others = rows * (self.datasets[i].part != k)
                best = int(np.argmin([self._misfit(i, r) for r in others]))
                if best:
                    point[c] = tried[best, c]

    @cached_property
    def block_squares(self) -> list[np.ndarray]:
        """Squared held-out score of each data set, block by block."""
        return [
            np.bincount(d.block, h**2) for d, h in zip(self.datasets, self.held_out, strict=True)
        ]

    @cached_property
    def own_block_costs(self) -> np.ndarray:
        """(B,) the same as this fit weighs them."""
        return self.block_costs(self)

    def block_costs(self, like: "ScoreFit") -> np.ndarray:
        """(B,) held-out squares of all blocks, weighted as another fit weighs them."""
        parts = []
        for i, (d, held) in enumerate(zip(self.datasets, self.held_out, strict=True)):
            parts.append(np.bincount(d.block, like.weight(i, like.held_out[i]) * held**2))
        return np.concatenate(parts)

    @cached_property
    def without_own_blocks(self) -> np.ndarray:
        """(B,) held-out cost without each block of the data sets."""
        return self.without_blocks([d.block for d in self.datasets])

    def without_blocks(self, blocks: Sequence[np.ndarray]) -> np.ndarray:
        """(B,) held-out cost of the data without each block, the prior left aside.

        Args:
            blocks: (R,) of each data set, from 0.
        """
        costs = []
        whole = [self._misfit(i, r) for i, r in enumerate(self.held_out)]
        parts = zip(self.datasets, self.held_out, self.scales, blocks, strict=True)
        for i, (d, held, scale, block) in enumerate(parts):
            rest = sum(whole) - whole[i]
            shape = (block.max() + 1, scale.max() + 1)
            place = np.ravel_multi_index((block, scale), shape)
            squares, judged = (
                np.bincount(place, v, shape[0] * shape[1]).reshape(shape)
                for v in (held**2, d.judged)
            )
            left, share = squares.sum(0) - squares, judged.sum(0) - judged
            known = share > 1e-9
            n = self.counts[i] * share.sum(1, keepdims=True) / d.judged.sum()
            square = np.maximum(left / np.where(known, share, 1.0), LEAST_SQUARE)
            costs.append(rest + np.sum(np.where(known, n * np.log(square), 0.0), axis=1))
        return np.concatenate(costs)

    @property
    def held_scores(self) -> np.ndarray:
        """(D,) held-out score of each data set."""
        return np.sqrt([b.sum() for b in self.block_squares])

    @property
    def held_cost(self) -> float:
        """The cost on held-out parts."""
        return self.cost(self.held_out, self.x)

    @property
    def errors(self) -> np.ndarray:
        """(R,) rows of all data sets at the values found."""
        return np.concatenate(self.state[0])

    def against(self, less: "ScoreFit") -> tuple[float, float, float]:
        """Evidence for this fit against one of a poorer model.

        Returns:
            Fall of the held-out cost, the same without the block with the most evidence, and how
            well blocks agree: t of the relative fall.
        """
        a, b = less.own_block_costs, self.block_costs(less)
        falls = (a - b) / np.maximum(a + b, 1e-300)
        spread = np.std(falls, ddof=1) / np.sqrt(len(falls)) if len(falls) > 1 else np.inf
        least = self.least_against(less)
        return less.held_cost - self.held_cost, least, float(falls.mean() / max(spread, 1e-12))

    def least_against(self, less: "ScoreFit", blocks: Sequence[np.ndarray] | None = None) -> float:
        """Evidence against a poorer model's fit without the block with the most; see above."""
        if blocks is None:
            return float(np.min(less.without_own_blocks - self.without_own_blocks))
        return float(np.min(less.without_blocks(blocks) - self.without_blocks(blocks)))

    # -- uncertainty ----------------------------------------------------------------------------

    @cached_property
    def covariance(self) -> np.ndarray:
        """(P, P) by leaving out a block at a time, and what the prior adds.

        What the data leave undetermined is as wide as the prior. Fits for evidence are no surer
        than the curvature of the cost: their model is not whole yet, and of its base they hold what
        other logs told. Nor are those to tables, whose inputs are few.
        """
        told = self._scatter_covariance + self._prior_covariance
        if not self.by_channel and all(isinstance(d, Trajectory) for d in self.datasets):
            return told
        return _no_less(told, np.linalg.pinv(self._curvature))

    @cached_property
    def _curvature(self) -> np.ndarray:
        """(P, P) of half the cost, the prior included."""
        return self._normal(*self.state, self.x)[0]

    @cached_property
    def _prior_covariance(self) -> np.ndarray:
        """(P, P) covariance due to a prior of precision D: G^-1 D G^-1 with curvature G."""
        pull = np.linalg.pinv(self._curvature) / self.std
        return pull @ pull.T

    @cached_property
    def _scatter_covariance(self) -> np.ndarray:
        """(P, P) covariance due to what the data scatter.

        Of an effect that lasts for a while by shorter blocks: one whole block may hold all of it.
        What data sets tell together is as wide as they disagree, where that is no chance.
        """
        spread, passing = self._jackknife(None), self._own_to(lasts_for_a_while)
        if passing.any():
            own = np.ix_(passing, passing)
            short = self._jackknife(PASSING_S)[own]
            spread[passing] = spread[:, passing] = 0.0
            spread[own] = short
        wider = self._disagreement(np.diag(spread))
        return spread * np.outer(wider, wider)

    def _disagreement(self, within: np.ndarray) -> np.ndarray:
        """(P,) how many times wider than by blocks data sets scatter; 1 where that may be chance.

        Blocks of one run share what differs from run to run: then runs are what counts as
        independent (Cameron and Miller 2015, section II). By where each of them would be alone:
        left out, one that disagrees moves little, since it has little weight.

        Args:
            within: (P,) variances by leaving out blocks.
        """
        members = np.array([len(u.members) for u in self.unknowns], int)
        wider = np.ones(len(members))
        if max(members, default=0) < FEWEST_BLOCKS:
            return wider
        alone = (self._alone(i) ** 2 for i in range(len(self.datasets)))
        square = sum(alone, np.zeros(len(members)))
        for c in np.flatnonzero(members >= FEWEST_BLOCKS):
            count = int(members[c])
            ratio = square[c] / (count * (count - 1)) / max(within[c], 1e-300)
            if f_above(ratio, count - 1, self.blocks - 1) < CHANCE:
                wider[c] = np.sqrt(ratio)
        return wider

    def _alone(self, i: int) -> np.ndarray:
        """(P,) Newton's step of data set i by itself; what it does not tell stays."""
        rows, slopes, own = self.state[0][i], self.state[1][i], self.columns[i]
        weighted = slopes * self.weight(i, rows)[:, None]
        gram = weighted.T @ slopes + np.diag(1 / self.std[own] ** 2)
        step = np.zeros(len(self.x))
        step[own] = -np.linalg.lstsq(gram, weighted.T @ rows, rcond=None)[0]
        return step

    def _jackknife(self, block_s: float | None) -> np.ndarray:
        """(P, P) covariance by leaving out blocks of this length; None: as the data sets have them.

        Of a log the mean over two divisions into blocks, half a block apart, which scatters less
        itself (Künsch 1989, section 2).
        """
        spread, count = np.zeros_like(self._curvature), 0
        for i, data in enumerate(self.datasets):
            divisions = _divisions(data, block_s)
            count += len(np.unique(divisions[0]))
            for block in divisions:
                moved = self._moved_without_each(i, block)
                spread += moved.T @ moved / len(divisions)
        return spread * (count - 1) / max(count, 1)

    def _moved_without_each(self, i: int, block: np.ndarray) -> np.ndarray:
        """(B, P) Newton's steps without each block, (R,) of the rows of data set i."""
        rows, slopes, own = self.state[0][i], self.state[1][i], self.columns[i]
        order = np.argsort(block, kind="stable")
        edges = np.flatnonzero(np.diff(block[order], prepend=np.nan, append=np.nan))
        parts = [slice(a, b) for a, b in pairwise(edges.tolist())]
        weight, rows, slopes = self.weight(i, rows)[order], rows[order], slopes[order]
        weighted = (slopes * weight[:, None]).T
        less = np.repeat(self._curvature[None], len(parts), axis=0)
        less[:, own[:, None], own] -= [weighted[:, p] @ slopes[p] for p in parts]
        push = np.zeros((len(parts), len(self.x)))
        push[:, own] = [weighted[:, p] @ rows[p] for p in parts]
        try:
            moved = np.linalg.solve(less, push[..., None])[..., 0]
        except np.linalg.LinAlgError:
            moved = push @ np.linalg.pinv(self._curvature)
        # Without the block around a moment, only the prior says where in it the moment was.
        parameters = [u.parameter for u in self.unknowns]
        when = ("moment", PHASE)
        reach = np.array([p.std if p.role in when else np.inf for p in parameters])
        return np.clip(moved, -reach, reach)

    @property
    def blocks(self) -> int:
        """Number of blocks in all data sets together."""
        return int(sum(len(np.unique(d.block)) for d in self.datasets))

    @cached_property
    def _intervals(self) -> np.ndarray:
        """(P, P) the same, its scatter widened by Student's t for so few blocks.

        And by how far a usual prior pulled what came out far from it: G^-1 D (x - usual), to first
        order, by the curvature G and the prior's precision D. A prior that was given is no such
        guess but knowledge: its pull is no error, and what it tells is never less sure than it.
        """
        widening = t_quantile(0.975, max(self.blocks - 1, 1)) / NORMAL_95
        given = np.array([u.parameter.prior for u in self.unknowns], bool)
        away = np.where(given, 0.0, self.x - self.usual)
        pull = np.linalg.pinv(self._curvature) @ (away / self.std**2)
        wide = self.covariance + (widening**2 - 1) * self._scatter_covariance + np.outer(pull, pull)
        over = np.sqrt(np.diag(wide)) / self.std
        narrowed = np.where(given & (over > 1), 1 / np.maximum(over, 1e-300), 1.0)
        return wide * np.outer(narrowed, narrowed)

    @property
    def stds(self) -> np.ndarray:
        """(P,) half 95 % intervals over 1.96."""
        return np.sqrt(np.diag(self._intervals))

    @cached_property
    def estimates(self) -> list[ParameterEstimate]:
        """Estimates of all unknowns, shared ones first."""
        found, gaps = [], gaps_s(self.datasets)
        alone = 1 / np.sqrt(np.diag(np.linalg.pinv(self._intervals)))  # were the others known
        for u, value, std, rest in zip(self.unknowns, self.x, self.stds, alone, strict=True):
            p, seen = u.parameter, bool(std < SEEN * u.parameter.std)
            bounded = p.role != "moment"  # the end of time is none
            at_bound = bounded and not bool(p.min < value < p.max)
            estimate = ParameterEstimate(
                p.name,
                float(value),
                float(std),
                p.unit,
                at_bound,
                seen,
                not seen and bool(rest < SEEN * p.std),
                p.words,
                p.prior,
            )
            found.append(known_to_gap(estimate, gaps) if p.role == "moment" else estimate)
        return found

    @property
    def moved(self) -> dict[str, float]:
        """How far each quantity came from its usual value, in standard deviations, by name."""
        far = np.abs(self.x - self.usual) / np.maximum(self.stds, 1e-12)
        return {u.parameter.name: float(f) for u, f in zip(self.unknowns, far, strict=True)}

    @property
    def shared_values(self) -> list[Parameter]:
        """Quantities that all data sets share, at the values found."""
        count = sum(1 for u in self.unknowns if u.parameter in self.shared)
        return [
            u.parameter.at(float(v)) for u, v in zip(self.unknowns[:count], self.x, strict=False)
        ]

    def shared_estimates(self) -> list[ParameterEstimate]:
        """Estimates of the quantities that all data sets share."""
        return self.estimates[: sum(1 for u in self.unknowns if u.parameter in self.shared)]

    @property
    def whole_covariance(self) -> Covariance:
        """Covariance of the shared quantities, as wide as the stds."""
        shared = self.shared_estimates()
        values = self._intervals[: len(shared), : len(shared)]
        return Covariance(tuple(e.name for e in shared), values)

    def shared_covariance(self) -> Covariance:
        """Covariance of the shared quantities by these data, alone or together with others."""
        return self.whole_covariance.of([e.name for e in self.shared_estimates() if e.told])

    @property
    def log_likelihood(self) -> float:
        """Log likelihood of the errors over their floors, at each set's best scale, without priors.

        The cost is minus twice this, but for what is constant, and the priors' part.
        """
        misfit = sum(self._misfit(i, rows) for i, rows in enumerate(self.state[0]))
        return -0.5 * float(misfit + self.sizes.sum() * (1 + np.log(2 * np.pi)))

    @property
    def first_phases(self) -> list[ParameterEstimate]:
        """Phases of formulas in the first log that has such: a model's file has one log's alone."""
        own = (self.own_estimates(i) for i in range(len(self.datasets)))
        names = {self.unknowns[c].parameter.name for c in self._phases}
        found = ([e for name, e in every.items() if name in names] for every in own)
        return next((own for own in found if own), []) if names else []

    def own_estimates(self, i: int) -> dict[str, ParameterEstimate]:
        """Estimates of data set i alone: its clock and the parameters of its robot."""
        count = len(self.shared_estimates())
        return {self.estimates[c].name: self.estimates[c] for c in self.columns[i] if c >= count}


def _each_beside(x: np.ndarray, c: int, values: np.ndarray) -> np.ndarray:
    """(1 + V, P) some values as they are, and with each of V in the place of one."""
    points = np.repeat(x[None], 1 + len(values), axis=0)
    points[1:, c] = values
    return points


def _divisions(data: ErrorDataset, block_s: float | None) -> list[np.ndarray]:
    """(R,) blocks of a data set; of a log also those that begin half a block later."""
    if not isinstance(data, Trajectory):
        return [data.block]
    at = (data.start_s - data.start_s[0]) / (block_s or data.block_s)
    return [np.repeat(np.floor(at + k).astype(int), data.measured[0].size) for k in (0.0, 0.5)]


def _no_less(wide: np.ndarray, least: np.ndarray) -> np.ndarray:
    """(P, P) a covariance `wide`, raised to `least` in each direction in which that is wider."""
    scale = np.sqrt(np.diag(least))
    over = np.outer(scale, scale)
    root = np.linalg.cholesky(least / over)
    turned = np.linalg.solve(root, np.linalg.solve(root, wide / over).T)
    ratio, ways = np.linalg.eigh(turned)
    half = root @ ways * np.sqrt(np.maximum(ratio, 1.0))
    return half @ half.T * over
