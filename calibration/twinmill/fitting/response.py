# SPDX-License-Identifier: Apache-2.0
"""A smooth response to the commands, found without the model under test.

The body's velocity is taken to be linear in a few hundred features: averages of each command over a
dozen delays, shapes of it, products, heading, place and time, and the velocity of the base model
refitted to this very log. A window's displacement is then linear in the same coefficients, so that
ridge regression on the windows of the score gives them. A ridge for each group of features is
chosen by the errors of left-out blocks (Hoerl and Kennard 1970; generalised to groups).

What that leaves on left-out blocks may depend on much else: a gain that wanders with time, place or
way, drift, a curve, what follows an event (see dependence.py). All together would be too many
features, so they are added by componentwise boosting (see boosting.py).
"""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import twinmill_native as native
from scipy.linalg import lapack

from twinmill.filters import filtered
from twinmill.fitting import wheel_angles
from twinmill.fitting.beat import HORIZONS as BEAT_HORIZONS
from twinmill.fitting.beat import beat_radps
from twinmill.fitting.boosting import Learner, Parts, boosted
from twinmill.fitting.dependence import Features, Motion
from twinmill.fitting.settings import FLOOR_SETTINGS
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import EVERY_S, difference, rms

# Edges of the averages, s before the motion; the coarse ones for poses slower than 10 Hz.
EDGES_S = np.array([0.0, 0.03, 0.07, 0.12, 0.18, 0.26, 0.36, 0.50, 0.70, 1.0, 1.5])
COARSE_S = np.array([0.0, 0.07, 0.18, 0.26, 0.36, 0.50, 0.70, 1.0, 1.5])
SLOW_POSES_S = 0.1
LEVELS = np.arange(0.05, 0.951, 0.05)  # peaks of the hats over the duty
HAT_LAGS = (0.5, 1.0, 1.8)  # times the base's lag
BASE_LAGS_S = (0.0, 0.1, 0.3)
SHORTEST_LAG_S = 0.03
NEAR_S = 0.3  # delays whose mean stands for the command in products
OUT = 1e5  # ridge over a group's mean square with which nothing of it is left
LADDER = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, OUT)
GROUPS = ("base", "own", "cross", "shape", "product", "room", "place")
FIRST_RIDGE = dict(base=1e-4, own=1e-2, cross=1e-2)
THIN_S = 0.03  # between points at which features are taken, beside those where windows end
GRID_S = 0.01
WIDE = 64  # features whose rows are made at once
CHOICE_EVERY = 2  # horizons: those between would choose the same groups
MEMORY_S = 0.3  # between errors that are independent
PLACE_SCALE_M = 2.0
MIXING = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]]) / 4  # of four mecanum wheels


# (F,) coefficients of all rows and (K, F) without each fold.
Coefficients = tuple[np.ndarray, np.ndarray]
# Number of a horizon, (W,) bool: windows that have it, and their (w, F) rows forward, left and of
# turning.
Rows = tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Fold:
    """Normal matrices of one left-out part: rows that touch it, and rows inside it."""

    touching: tuple[np.ndarray, np.ndarray]
    inside: tuple[np.ndarray, np.ndarray, float]


class Response:
    """The response of one robot in one log, fitted to its windows.

    Args:
        data: windows and measured displacements.
        base_mps: (N, 3) velocity of the base model at each pose, refitted to this log.
        lag_s: of that base.
        offset_s: capture's clock less the robot's.
    """

    def __init__(
        self, data: Trajectory, base_mps: np.ndarray, lag_s: float, offset_s: float
    ) -> None:
        self.data, self.offset_s = data, offset_s
        self.lag_s = max(SHORTEST_LAG_S, lag_s)
        self._choose_points()
        self.base_mps = base_mps[self.points]
        self.features, self.groups = self._features(self.base_mps)
        self._index_windows()
        self._fit(rms(data.measured), [None, None])
        self._fit(self.errors, self.ridges)
        self.unboosted = self.across

    def of_windows(self, keep: np.ndarray) -> "Response":
        """The same fitted to some windows alone, (W,) bool."""
        other = copy(self)
        measured = np.where(keep[:, None, None], self.data.measured, np.nan)
        other.data = replace(self.data, measured=measured)
        other._fit(self.errors, self.ridges)
        other.unboosted = np.where(keep[:, None, None], self.unboosted, np.nan)
        return other

    def thinned(self, every: int) -> "Response":
        """The same, as fitted, seen from every Nth start alone."""
        other = copy(self)
        other.data = self.data.thinned(every)
        for name in ("starts", "ends", "within", "across", "unboosted"):
            setattr(other, name, getattr(self, name)[::every])
        other._index_windows()
        return other

    # -- where features are taken ---------------------------------------------------------------

    def _choose_points(self) -> None:
        """Poses at windows' ends and some between: points, steps to each from the one before."""
        track, windows = self.data.measurement.track, self.data.windows
        wanted = [windows.starts, windows.ends[windows.ends >= 0]]
        usable = np.flatnonzero(track.segment >= 0)
        every = max(1, int(THIN_S / track.timing.pose_period_s))
        self.points = np.unique(np.concatenate([*wanted, usable[::every]]))
        t_s, segment = track.pose_t_s[self.points], track.segment[self.points]
        step_s = np.diff(t_s, prepend=t_s[0])
        step_s[np.r_[True, segment[1:] != segment[:-1]]] = 0.0
        self.step_s = step_s
        self.middle_s = t_s - step_s / 2 - self.offset_s  # robot's clock
        place = np.full(len(track.pose_t_s), -1)
        place[self.points] = np.arange(len(self.points))
        self.starts = place[windows.starts]
        self.ends = np.where(windows.ends >= 0, place[windows.ends], -1)
        heading = np.nan_to_num(track.heading_smooth[self.points])
        self.heading_rad = (heading + np.r_[heading[0], heading[:-1]]) / 2
        self.pose = np.nan_to_num(track.pose[self.points])

    # -- features -------------------------------------------------------------------------------

    def _features(self, base_mps: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Per body axis the (N, F) features and the (F,) number of their group."""
        linear, shapes, axes = self._commands()
        taps = self._averages(linear)
        shaped = self._shaped(shapes)
        near = self.edges_s[1:] <= NEAR_S
        soft = taps[:, near].mean(axis=1)
        base = self._lagged_base(base_mps)
        features, groups = [], []
        for axis in range(3):
            own = [k for k, a in enumerate(axes) if a in (axis, None)]
            cross = [k for k in range(linear.shape[1]) if k not in own]
            parts = {
                "base": base,
                "own": taps[:, :, own],
                "cross": taps[:, :, cross],
                "shape": shaped[:, :, own],
                "product": _products(soft),
                "room": self._room(axis, soft),
                "place": self._places(soft),
            }
            flat = {g: p.reshape(len(p), -1) for g, p in parts.items()}
            features.append(np.concatenate(list(flat.values()), axis=1))
            groups.append(np.repeat(np.arange(len(GROUPS)), [f.shape[1] for f in flat.values()]))
        return features, groups

    def _commands(self) -> tuple[np.ndarray, np.ndarray, list[int | None]]:
        """(M, n) linear commands over their largest, (M, n, k) shapes, body axis of each."""
        track = self.data.measurement.track
        command = track.command
        if track.command_kind == "duty":
            duty = command / max(np.abs(command).max(), 1e-9)
            level = np.abs(duty)
            nodes = np.r_[0.0, LEVELS, 1.0]
            hats = [
                np.interp(level, nodes, np.eye(len(nodes))[i]) for i in range(1, len(nodes) - 1)
            ]
            shapes = np.stack(
                [(np.sign(duty) * h) @ MIXING.T for h in hats] + [level @ MIXING.T], -1
            )
            return duty @ MIXING.T, shapes, [0, 1, 2]
        used = np.flatnonzero(command.any(axis=0))
        linear = command[:, used] / np.maximum(np.abs(command[:, used]).max(axis=0), 1e-9)
        shapes = np.stack([linear * np.abs(linear), np.tanh(6 * linear), np.abs(linear)], -1)
        axes = [int(k) for k in used] if track.command_kind == "twist" else [None] * len(used)
        return linear, shapes, axes

    @cached_property
    def edges_s(self) -> np.ndarray:
        """Edges of the intervals that velocity is averaged over: wider where poses are rare."""
        slow = self.data.measurement.track.timing.pose_period_s >= SLOW_POSES_S
        return COARSE_S if slow else EDGES_S

    def _averages(self, signal: np.ndarray) -> np.ndarray:
        """(M, n) held commands to (N, taps, n) means between each two edges before the middle."""
        t_s = self.data.measurement.track.command_t_s
        area = np.vstack(
            [np.zeros(signal.shape[1]), np.cumsum(signal[:-1] * np.diff(t_s)[:, None], 0)]
        )
        knots_s, areas = (
            np.append(t_s, t_s[-1] + 1e3),
            np.vstack([area, area[-1] + 1e3 * signal[-1]]),
        )
        at = self.middle_s[:, None] - self.edges_s
        value = np.stack([np.interp(at, knots_s, a) for a in areas.T], axis=-1)
        return (value[:, :-1] - value[:, 1:]) / np.diff(self.edges_s)[None, :, None]

    def _shaped(self, shapes: np.ndarray) -> np.ndarray:
        """(N, k, n) of (M, n, k) shapes: of duties through lags, of others averaged over delays."""
        track = self.data.measurement.track
        if track.command_kind != "duty":
            few = np.unique(np.linspace(0, len(self.edges_s) - 3, 5).astype(int))
            averaged = [self._averages(shapes[..., k])[:, few] for k in range(shapes.shape[2])]
            return np.concatenate(averaged, axis=1)
        held = self._held(shapes.reshape(len(shapes), -1))
        lagged = [self._low_pass(held, f * self.lag_s) for f in HAT_LAGS]
        at = np.stack([self._at(signal) for signal in lagged], axis=-1)
        curve = at.reshape(len(at), shapes.shape[1], -1).transpose(0, 2, 1)
        stopped = self._at((self._held(track.command) == 0).all(axis=1)[:, None].astype(float))
        duty = self._commands()[0]
        return np.concatenate([curve, stopped[:, :, None] * self._averages(duty)[:, :6]], axis=1)

    @cached_property
    def _grid_s(self) -> np.ndarray:
        t_s = self.data.measurement.track.command_t_s
        return np.arange(min(t_s[0], self.middle_s[0]), max(t_s[-1], self.middle_s[-1]), GRID_S)

    def _held(self, signal: np.ndarray) -> np.ndarray:
        """(M, c) commands held, on an even grid."""
        t_s = self.data.measurement.track.command_t_s
        k = np.searchsorted(t_s, self._grid_s, side="right") - 1
        return np.where((k >= 0)[:, None], signal[np.maximum(k, 0)], 0.0)

    def _at(self, signal: np.ndarray) -> np.ndarray:
        """(G, c) on the grid to (N, c) at the middles of the steps."""
        place = np.clip((self.middle_s - self._grid_s[0]) / GRID_S, 0, len(self._grid_s) - 1.001)
        k, part = place.astype(int), (place % 1)[:, None]
        return signal[k] * (1 - part) + signal[k + 1] * part

    @staticmethod
    def _low_pass(signal: np.ndarray, lag_s: float) -> np.ndarray:
        gain = 1 - np.exp(-GRID_S / lag_s)
        return filtered([gain], [1, gain - 1], signal, axis=0)

    def _lagged_base(self, base_mps: np.ndarray) -> np.ndarray:
        """(N, 3 lags) of each axis: the base's velocity, and late."""
        period_s = float(np.median(self.step_s[self.step_s > 0]))
        parts = [base_mps]
        for lag_s in BASE_LAGS_S[1:]:
            gain = 1 - np.exp(-period_s / lag_s)
            parts.append(filtered([gain], [1, gain - 1], base_mps, axis=0))
        return np.stack(parts, axis=1)

    def _room(self, axis: int, soft: np.ndarray) -> np.ndarray:
        """Creep along the room's axes while something is commanded."""
        moves = (np.abs(soft).max(axis=1) > 1e-6).astype(float)
        c, s = np.cos(self.heading_rad) * moves, np.sin(self.heading_rad) * moves
        return np.stack({0: [c, s], 1: [-s, c], 2: [moves]}[axis], axis=-1)

    def _places(self, soft: np.ndarray) -> np.ndarray:
        """Gains that depend on heading, place and time."""
        h = self.heading_rad
        away = (self.pose[:, :2] - np.median(self.pose[:, :2], axis=0)) / PLACE_SCALE_M
        time = (self.middle_s - self.middle_s.mean()) / max(np.ptp(self.middle_s), 1e-9)
        on = np.stack(
            [np.cos(h), np.sin(h), np.cos(2 * h), np.sin(2 * h), away[:, 0], away[:, 1], time], -1
        )
        return soft[:, :, None] * on[:, None, :]

    # -- windows --------------------------------------------------------------------------------

    def _index_windows(self) -> None:
        """Blocks and parts of windows, and the features' rows."""
        data = self.data
        start_s = data.start_s - data.start_s[0]
        length_s = float(start_s[-1])
        self.block_s = float(np.clip(length_s / 10, 3.0, 8.0))
        self.folds = int(np.clip(length_s / self.block_s, 3, 8))
        t_s = data.measurement.track.pose_t_s
        end_s = t_s[np.maximum(data.windows.ends, 0)] - data.start_s[0]
        self.fold = self._part(start_s)
        self.end_fold = self._part(end_s)
        self.tail_fold = self._part(start_s - 2.0)
        self.rows = self._rows([[f] for f in self.features])

    def _rows(self, features: Sequence[Sequence[np.ndarray]], every: int = 1) -> list[Rows]:
        """Of every Nth horizon; features of each axis stand side by side."""
        data = self.data
        c, s = np.cos(self.heading_rad) * self.step_s, np.sin(self.heading_rad) * self.step_s
        horizons = range(0, self.ends.shape[1], every)
        ends = np.ascontiguousarray(np.maximum(self.ends[:, horizons], 0))
        forward, left, turn = features
        sums = [
            native.sums_between(f, weight, self.starts, ends)
            for weight, f in ((c, forward), (s, forward), (c, left), (s, left), (self.step_s, turn))
        ]
        track = data.measurement.track
        heading = np.nan_to_num(track.heading_smooth[data.windows.starts])
        rows = []
        for k, h in enumerate(horizons):
            ok = (self.ends[:, h] >= 0) & np.isfinite(data.measured[:, h, :2]).all(axis=1)
            cx, sx, cy, sy, w = (q[ok, k] for q in sums)
            ch, sh = np.cos(heading[ok])[:, None], np.sin(heading[ok])[:, None]
            along = np.concatenate([ch * cx + sh * sx, -ch * sy + sh * cy], axis=1)
            across = np.concatenate([ch * sx - sh * cx, ch * cy + sh * sy], axis=1)
            rows.append((h, ok, along, across, w))
        return rows

    def _part(self, t_s: np.ndarray) -> np.ndarray:
        return np.floor(t_s / self.block_s).astype(int) % self.folds

    # -- regression -----------------------------------------------------------------------------

    def _fit(self, scale: np.ndarray, ridges: list[np.ndarray | None]) -> None:
        """Coefficients with the errors (H, 3) of another fit as weights."""
        first = np.array([FIRST_RIDGE.get(g, OUT) for g in GROUPS])
        begun = [first if ridge is None else ridge for ridge in ridges]
        groups = [np.concatenate(self.groups[:2]), self.groups[2]]
        self.coefficients, self.ridges = self._solved(
            self.rows,
            self.data.measured,
            scale,
            groups=groups,
            begun=begun,
            worth=FLOOR_SETTINGS.ridge_worth,
        )
        self._judge()

    @property
    def motion(self) -> Motion:
        """At each point, as fitted so far."""
        return Motion(
            velocity=self.velocity(None),
            base=self.base_mps,
            pose=self.pose,
            heading_rad=self.heading_rad,
            t_s=self.middle_s,
            step_s=self.step_s,
            moved=self.moved,
        )

    @property
    def moved(self) -> np.ndarray:
        """(N, 3) m, m, rad that the body was captured to move in its own axes, to each point."""
        heading = np.nan_to_num(self.data.measurement.track.heading_smooth[self.points])
        at = np.column_stack([self.pose[:, :2], heading])
        x, y, turn = np.diff(at, axis=0, prepend=at[:1]).T * (self.step_s > 0)
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)  # half way
        return np.column_stack([c * x + s * y, -s * x + c * y, turn])

    def find_wheels(self, model: native.Model) -> None:
        """The model's wheels, of the radius that this log's errors tell, if they do."""
        horizon, wheels = wheel_angles.HORIZON, wheel_angles.wheels_of(model)
        there = self.ends[:, horizon] >= 0
        errors = self.across[there, horizon] / np.maximum(self.errors[horizon], 1e-12)
        ends = np.column_stack([self.starts, self.ends[:, horizon]])[there]
        self.radius_ratio = wheel_angles.radius_ratio(wheels, self.moved, errors, ends)
        self.wheels = [wheel.larger(self.radius_ratio) for wheel in wheels]

    def find_beat(self) -> None:
        """At what rate errors of its gains, pushes along its axes or along the room's swing."""
        there = (self.ends[:, BEAT_HORIZONS] >= 0).all(axis=1)
        at = self.starts[there]
        swings, done = [], [*self.pose[at, :2].T]
        for horizon in BEAT_HORIZONS:
            errors, made = self._at_horizon(horizon, there)
            swings += _swings(errors, made, self.heading_rad[at])
            done += [*made, *np.abs(made)]
        moved = self.moved
        done += [wave for w in self.wheels for wave in w.waves(moved)[at].T]
        done += [f(n * self.heading_rad[at]) for f in (np.cos, np.sin) for n in (1, 2, 4)]
        self.beat_radps = beat_radps(self.data.start_s[there], swings, done)

    def _at_horizon(self, horizon: int, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3, W) errors over their size, and displacements that were predicted, of some windows."""
        errors = self.across[there, horizon] / np.maximum(self.errors[horizon], 1e-12)
        made = (self.data.measured - self.across)[there, horizon]
        return np.nan_to_num(errors).T, np.nan_to_num(made).T

    def boost(self, groups: Sequence[Features]) -> None:
        """Adds what is left and left-out blocks agree on, a group of features at a time."""
        scale = self.errors
        left, chosen = self._left(), []
        independent = len(self.starts) * EVERY_S / MEMORY_S
        for part in (0, 1):
            used = [_only(part, g) for g in groups]
            used = [g for g in used if sum(f.shape[1] for f in g)]
            learners, wanted = self._learners(part, used, _isotropic(scale), left)
            chosen += [(used[n], ridge) for n, ridge in boosted(learners, wanted, independent)]
        if chosen:
            self._fit_with(chosen, scale)

    def _fit_with(self, chosen: Sequence[tuple[Features, float]], scale: np.ndarray) -> None:
        """Fits the features so far and chosen groups together, each group at its own ridge."""
        axes, first = range(3), len(self.ridges[0])
        added = [[group[axis] for group, _ in chosen] for axis in axes]
        numbers = [[np.full(f.shape[1], first + k) for k, f in enumerate(own)] for own in added]
        self.features = [np.hstack([self.features[axis], *added[axis]]) for axis in axes]
        self.groups = [np.concatenate([self.groups[axis], *numbers[axis]]) for axis in axes]
        fresh = [ridge for _, ridge in chosen]
        self.rows = self._rows([[f] for f in self.features])
        self._fit(scale, [np.concatenate([own, fresh]) for own in self.ridges])

    def _learners(
        self, part: int, groups: Sequence[Features], scale: np.ndarray, left: np.ndarray
    ) -> tuple[list[Learner], np.ndarray]:
        """One of each group for the plane (0) or turning (1), and the (R,) values wanted."""
        learners, wanted = [], np.zeros(0)
        for some in _batches(groups):
            features = [[group[axis] for group in some] for axis in range(3)]
            pieces = self._weighted(part, scale, self._rows(features, CHOICE_EVERY), left)
            found = _in_order(pieces)
            if found is None:
                return [], wanted
            x, wanted, parts = found
            learners += Learner.each(x, parts, _columns(part, some))
        return learners, wanted

    def _solved(
        self,
        rows: list[Rows],
        wanted: np.ndarray,
        scale: np.ndarray,
        *,
        groups: Sequence[np.ndarray],
        begun: Sequence[np.ndarray],
        worth: float,
    ) -> tuple[list, list[np.ndarray]]:
        """Coefficients of the plane and of turning, None where nothing tells them; their ridges.

        Args:
            rows: of the features.
            wanted: (W, H, 3) what they are to make.
            scale: (H, 3) errors that count as one.
            groups: of the plane and of turning, (F,) number of each feature's group.
            begun: of both, the ridge of each group that the search begins at.
            worth: a ridge is taken if it lowers the left-out error to this share.
        """
        scale, coefficients, ridges = _isotropic(scale), [], list(begun)
        for part in (0, 1):
            equations = self._equations(part, scale, rows, wanted)
            if equations is None:
                coefficients.append(None)
                continue
            ridges[part], *found = _ridge(*equations, groups[part], ridge=begun[part], worth=worth)
            coefficients.append(found)
        return coefficients, ridges

    def _left(self) -> np.ndarray:
        """(W, H, 3) what the features so far, fitted to other blocks, leave of the rows."""
        left = self.data.measured.copy()
        plane, turn = self.coefficients
        for h, ok, along, across, w in self.rows:
            for channel, x, found in ((0, along, plane), (1, across, plane), (2, w, turn)):
                if found is not None:
                    left[ok, h, channel] -= np.sum(x * found[1][self.fold[ok]], axis=1)
        return left

    def _judge(self) -> None:
        """Errors of the stages so far: fitted to all, and to other blocks."""
        self.within = difference(self.data.measured, self.predict(None))
        self.across = difference(self.data.measured, self.predict(self.fold))

    @property
    def errors(self) -> np.ndarray:
        """(H, 3) between those of the fit to all, too small, and those on left-out parts."""
        return np.sqrt((rms(self.within) ** 2 + rms(self.across) ** 2) / 2)

    def _equations(
        self, part: int, scale: np.ndarray, rows: list[Rows], wanted: np.ndarray
    ) -> tuple[tuple[np.ndarray, np.ndarray], list[Fold]] | None:
        """Normal matrices of all rows of the plane (0) or of turning (1), and of each fold."""
        found = _in_order(self._weighted(part, scale, rows, wanted))
        if found is None:
            return None
        x, y, parts = found
        folds = []
        for own, beside in zip(parts.slices, parts.neighbours, strict=True):
            inside, push, near = x[own], y[own], x[beside]
            gram, moment = inside.T @ inside, inside.T @ push
            touching = gram + near.T @ near, moment + near.T @ y[beside]
            folds.append(Fold(touching, (gram, moment, float(push @ push))))
        total = (sum(fold.inside[k] for fold in folds) for k in (0, 1))
        return tuple(total), folds

    def _weighted(
        self, part: int, scale: np.ndarray, rows: list[Rows], wanted: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray, Parts]]:
        """Rows over their errors, wanted values and parts, of each horizon and channel of a part.

        Args:
            part: the plane (0) or turning (1).
            scale: (H, 3) errors that count as one.
            rows: of the features.
            wanted: (W, H, 3) what they are to make.
        """
        for h, ok, along, across, w in rows:
            chosen = ((0, along), (1, across)) if part == 0 else ((2, w),)
            for channel, x in chosen:
                size, y = scale[h, channel], wanted[ok, h, channel]
                known = np.isfinite(y)
                if not size > 1e-9 or not known.any():
                    continue
                weight = 1 / (size * np.sqrt(known.sum()))
                folds = (f[ok][known] for f in (self.fold, self.end_fold[:, h], self.tail_fold))
                yield x[known] * weight, y[known] * weight, Parts(*folds, self.folds)

    def velocity(self, fold: int | None) -> np.ndarray:
        """(N, 3) forward, left, turning at each point; of the fit without a fold."""
        found = np.zeros((len(self.points), 3))
        plane, turn = self.coefficients
        if plane is not None:
            beta = plane[0] if fold is None else plane[1][fold]
            width = self.features[0].shape[1]
            found[:, 0] = self.features[0] @ beta[:width]
            found[:, 1] = self.features[1] @ beta[width:]
        if turn is not None:
            found[:, 2] = self.features[2] @ (turn[0] if fold is None else turn[1][fold])
        return found

    def predict(self, fold: np.ndarray | None) -> np.ndarray:
        """(W, H, 3) displacements, the heading integrated by the response itself.

        Args:
            fold: (W,) each window is predicted without its part; None: by the fit to all.
        """
        out = np.full(self.data.measured.shape, np.nan)
        for k in range(self.folds) if fold is not None else [None]:
            own = np.flatnonzero(fold == k) if fold is not None else np.arange(len(self.starts))
            if not len(own):
                continue
            run = _integrate(self.velocity(k), self.step_s)
            start, ends = run[self.starts[own]], run[np.maximum(self.ends[own], 0)]
            out[own] = _seen_from(start, ends)
            out[own] = np.where((self.ends[own] >= 0)[..., None], out[own], np.nan)
        out[~np.isfinite(self.data.measured)] = np.nan
        return out


def _swings(errors: np.ndarray, made: np.ndarray, heading_rad: np.ndarray) -> list[np.ndarray]:
    """(W,) each: errors along the robot's axes, along the room's, and of its gains.

    Args:
        errors: (3, W).
        made: (3, W) displacements that were predicted.
        heading_rad: (W,).
    """
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    room = (c * errors[0] - s * errors[1], s * errors[0] + c * errors[1])
    gains = errors * made / np.maximum(made.std(axis=1, keepdims=True), 1e-12)
    return [*errors, *room, *gains, gains.sum(axis=0)]


def _only(part: int, group: Features) -> Features:
    """What of a group moves the plane (0) or turns (1)."""
    forward, left, turning = group
    none = np.zeros((len(turning), 0))
    return (forward, left, none) if part == 0 else (none, none, turning)


def _batches(groups: Sequence[Features]) -> Iterator[Sequence[Features]]:
    """Groups that together have about WIDE features: sums over time are quicker side by side."""
    ends = np.cumsum([sum(f.shape[1] for f in group) for group in groups]) // WIDE
    for number in np.unique(ends):
        own = np.flatnonzero(ends == number)
        yield groups[own[0] : own[-1] + 1]


def _in_order(
    pieces: Iterable[tuple[np.ndarray, np.ndarray, Parts]],
) -> tuple[np.ndarray, np.ndarray, Parts] | None:
    """Rows, wanted values and parts of all pieces, in order of the parts; None of no pieces."""
    pieces = list(pieces)
    if not pieces:
        return None
    xs, ys, every = zip(*pieces, strict=True)
    parts = Parts.joined(every)
    order = np.argsort(parts.inside, kind="stable")
    return np.concatenate(xs)[order], np.concatenate(ys)[order], parts.at(order)


def _columns(part: int, groups: Sequence[Features]) -> Iterator[np.ndarray]:
    """Of each group its columns among the rows of all: forward ones before left, or turning."""
    axes = (0, 1) if part == 0 else (2,)
    number = [np.full(group[axis].shape[1], k) for axis in axes for k, group in enumerate(groups)]
    owner = np.concatenate(number)
    return (np.flatnonzero(owner == k) for k in range(len(groups)))


def _isotropic(scale: np.ndarray) -> np.ndarray:
    """The same scale for forward and left: in the floor both are one plane."""
    scale = scale.copy()
    scale[:, :2] = np.sqrt(np.nanmean(scale[:, :2] ** 2, axis=1, keepdims=True))
    return scale


def _products(soft: np.ndarray) -> np.ndarray:
    pairs = [(i, j) for i in range(soft.shape[1]) for j in range(i + 1)]
    return np.stack([soft[:, i] * soft[:, j] for i, j in pairs], axis=-1)


def _integrate(velocity: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """(N, 3) poses of one run that starts at the origin."""
    turn = velocity[:, 2] * step_s
    heading = np.cumsum(turn)
    middle = heading - turn / 2
    c, s = np.cos(middle) * step_s, np.sin(middle) * step_s
    x = np.cumsum(c * velocity[:, 0] - s * velocity[:, 1])
    y = np.cumsum(s * velocity[:, 0] + c * velocity[:, 1])
    return np.column_stack([x, y, heading])


def _seen_from(start: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(W, 3), (W, H, 3) to (W, H, 3) displacements in the frame of the start."""
    step = ends - start[:, None]
    c, s = np.cos(start[:, None, 2]), np.sin(start[:, None, 2])
    return np.stack(
        [c * step[..., 0] + s * step[..., 1], c * step[..., 1] - s * step[..., 0], step[..., 2]], -1
    )


class _LeftOut:
    """Fits without each of K folds, and what they would be if the ridge of one group changed.

    Args:
        total: normal matrix (F, F) and moments (F,) of all rows.
        folds: the parts that are left out.
        mean: (F,) mean square of each feature's group.
        groups: (F,) number of each feature's group.
    """

    def __init__(
        self,
        total: tuple[np.ndarray, np.ndarray],
        folds: list[Fold],
        mean: np.ndarray,
        groups: np.ndarray,
    ) -> None:
        self.mean, self.groups = mean, groups
        self.grams = np.array([total[0] - f.touching[0] for f in folds])
        self.moments = np.array([total[1] - f.touching[1] for f in folds])
        self.inner = np.array([f.inside[0] for f in folds])
        self.push = np.array([f.inside[1] for f in folds])
        self.square = sum(f.inside[2] for f in folds)

    def at(self, ridge: np.ndarray) -> float:
        """Squared error at the ridge (G,) of each group, from which `trials` go on."""
        self.ridge = ridge
        self.inverse = _inverses(self.grams + np.diag(self.mean * ridge[self.groups]))
        self.beta = self.inverse @ self.moments[..., None]
        (error,) = self._errors(self.beta)
        return float(error)

    def _errors(self, beta: np.ndarray) -> np.ndarray:
        """(V,) squared error of (K, F, V) coefficients on the folds that they left out."""
        curved = self.inner @ beta
        return self.square + np.sum(beta * (curved - 2 * self.push[..., None]), axis=(0, 1))

    def trials(self, group: int, values: Sequence[float]) -> np.ndarray:
        """(V,) squared error with each of these ridges of one group: Woodbury's identity.

        A ridge that rises by s on the group's diagonal changes the coefficients b to
        b - B (I/s + B_g)^-1 b_g, with B the inverse's columns of the group.
        """
        own = np.flatnonzero(self.groups == group)
        columns, block = self.inverse[:, :, own], self.inverse[:, own[:, None], own]
        rise = self.mean[own[0]] * (np.array(values) - self.ridge[group])[:, None, None, None]
        less = np.linalg.solve(np.eye(len(own)) + rise * block, rise * self.beta[:, own])
        return self._errors(self.beta - columns @ less[..., 0].transpose(1, 2, 0))


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """(K, F, F) of symmetric positive ones, by Cholesky's factors: half the work of any others."""
    found = np.empty_like(matrices)
    for inverse, matrix in zip(found, matrices, strict=True):
        factor, _ = lapack.dpotrf(matrix, clean=False)
        upper = np.triu(lapack.dpotri(factor, overwrite_c=True)[0])
        inverse[:] = upper + np.triu(upper, 1).T
    return found


def _ridge(
    total: tuple[np.ndarray, np.ndarray],
    folds: list[Fold],
    groups: np.ndarray,
    *,
    ridge: np.ndarray,
    worth: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ridge of each group, coefficients (F,) of all rows, and (K, F) without each fold.

    Groups are searched one after the other, twice.
    """
    mean = np.diag(total[0]).copy()
    for g in np.unique(groups):
        mean[groups == g] = mean[groups == g].mean()
    mean += 1e-9 * mean.max() + 1e-30
    left_out = _LeftOut(total, folds, mean, groups)
    best = left_out.at(ridge)
    for _ in range(2):
        moved = False
        for g in np.unique(groups):
            trials = left_out.trials(g, LADDER)
            k = int(np.argmin(trials))
            if trials[k] < best * worth:
                ridge = np.where(np.arange(len(ridge)) == g, LADDER[k], ridge)
                best, moved = left_out.at(ridge), True
        if not moved:
            break
    each = left_out.beta[..., 0]
    every = np.linalg.solve(total[0] + np.diag(mean * ridge[groups]), total[1])
    return ridge, every, each
