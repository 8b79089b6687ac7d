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

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.filters import filtered
from twinmill.fitting import wheel_angles
from twinmill.fitting.beat import HORIZONS as BEAT_HORIZONS
from twinmill.fitting.beat import beat_radps
from twinmill.fitting.boosting import Learners, Parts, at_ridges, boosted, squares
from twinmill.fitting.dependence import Features, Group, Motion, Product, even_step_s, hats
from twinmill.fitting.independence import independent_shares
from twinmill.fitting.settings import FLOOR_SETTINGS
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import EVERY_S, difference, rms

# Edges of the averages, s before the motion; the coarse ones for poses slower than 10 Hz.
EDGES_S = np.array([0.0, 0.03, 0.07, 0.12, 0.18, 0.26, 0.36, 0.50, 0.70, 1.0, 1.5])
COARSE_S = np.array([0.0, 0.07, 0.18, 0.26, 0.36, 0.50, 0.70, 1.0, 1.5])
SLOW_POSES_S = 0.1
LEVELS = 21  # of the duty, even; each is the peak of a hat but the lowest and the highest
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
WIDE = 32  # features whose rows are made at once
AXES = ((0, 1), (2,))  # of the plane and of turning
CHOICE_EVERY = 2  # horizons: those between would choose the same groups
MEMORY_S = 0.3  # between errors that are independent
PLACE_SCALE_M = 2.0
MIXING = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]]) / 4  # of four mecanum wheels


@dataclass(frozen=True)
class Rows:
    """R errors of windows, of the plane or of turning, in order of their parts.

    Attributes:
        at: (3, R) window, horizon and channel of each.
        starts, ends: (R,) points.
        direction: (R, 2) in the room along which it is measured, times its weight; of turning that
            alone (R, 1).
        weight: (R,) one over its error.
        wanted: (R,) value, weighted.
        parts: which rows lie in each left-out part.
    """

    at: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    wanted: np.ndarray
    parts: Parts


@dataclass(frozen=True)
class Chosen:
    """A group that boosting added.

    Attributes:
        features: of each axis.
        ridge: over its mean square.
        axes: that it was chosen for, of the plane or of turning.
        times: how many times it takes what chance would bring if errors were independent.
    """

    features: Features
    ridge: float
    axes: Sequence[int]
    times: float


@dataclass(frozen=True)
class Equations:
    """Normal equations of all rows, and of the rows inside each of K parts or apart from it.

    Attributes:
        gram, moment: (F, F) and (F,) of all.
        others, inside: (K, F, F) and (K, F) of rows that do not touch each part, and inside it.
        square: of the wanted values of all.
    """

    gram: np.ndarray
    moment: np.ndarray
    others: tuple[np.ndarray, np.ndarray]
    inside: tuple[np.ndarray, np.ndarray]
    square: float

    @classmethod
    def of(cls, x: np.ndarray, rows: Rows) -> "Equations":
        """Normal equations for (R, F) features."""
        cells = rows.parts.cells
        moments = np.array([rows.wanted[k] @ x[k] for k in cells])
        sums = (rows.parts.summed(m) for m in (squares(x, cells), moments))
        inside, others = zip(*sums, strict=True)
        square = float(rows.wanted @ rows.wanted)
        gram, moment = (m.sum(axis=0) for m in inside)
        return cls(gram, moment, others, inside, square)


class Response:
    """The response of one robot in one log, fitted to its windows.

    Args:
        data: windows and measured displacements.
        base_mps: (N, 3) velocity of the base model at each pose, refitted to this log.
        lag_s: of that base.
        offset_s: capture's clock less the robot's.

    Attributes:
        velocities: (3, N, 1 + K) forward, left, turning at points: of the fit to all, and without
            each fold.
        features: of each group, which has a ridge of its own.
    """

    def __init__(
        self, data: Trajectory, base_mps: np.ndarray, lag_s: float, offset_s: float
    ) -> None:
        self.data, self.offset_s = data, offset_s
        self.lag_s = max(SHORTEST_LAG_S, lag_s)
        self._choose_points()
        self.base_mps = base_mps[self.points]
        self.features = self._features(self.base_mps)
        self._index_windows()
        self.velocities = np.zeros((3, len(self.points), 1 + self.folds))
        self._fit(rms(data.measured), [None, None])
        self._fit(self.errors, self.ridges)
        self.unboosted = self.across

    def of_windows(self, keep: np.ndarray) -> "Response":
        """Response refitted to some windows alone, (W,) bool."""
        other = copy(self)
        measured = np.where(keep[:, None, None], self.data.measured, np.nan)
        other.data = replace(self.data, measured=measured)
        other._fit(self.errors, self.ridges)
        other.unboosted = np.where(keep[:, None, None], self.unboosted, np.nan)
        return other

    def thinned(self, every: int) -> "Response":
        """Response as fitted, seen from every Nth start alone."""
        other = copy(self)
        other.data = self.data.thinned(every)
        for name in ("starts", "ends", "within", "across", "unboosted"):
            setattr(other, name, getattr(self, name)[::every])
        other._index_windows()
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Without the features, most of its memory, which a fit alone needs: it is over."""
        return {name: value for name, value in vars(self).items() if name != "features"}

    def __copy__(self) -> "Response":
        other = Response.__new__(Response)
        vars(other).update(vars(self))
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

    def _features(self, base_mps: np.ndarray) -> list[Features]:
        """Those of each of GROUPS."""
        linear, shapes, axes = self._commands()
        taps = self._averages(linear)
        shaped = self._shaped(shapes, taps)
        near = self.edges_s[1:] <= NEAR_S
        soft = taps[:, near].mean(axis=1)
        alike = {
            "base": self._lagged_base(base_mps),
            "product": _products(soft),
            "place": self._places(soft),
        }
        by_axis = []
        for axis in range(3):
            own = [k for k, a in enumerate(axes) if a in (axis, None)]
            cross = [k for k in range(linear.shape[1]) if k not in own]
            parts = alike | {
                "own": taps[:, :, own],
                "cross": taps[:, :, cross],
                "shape": shaped[:, own],
                "room": self._room(axis, soft),
            }
            by_axis.append([parts[group].reshape(len(soft), -1) for group in GROUPS])
        return list(zip(*by_axis, strict=True))

    def _commands(self) -> tuple[np.ndarray, np.ndarray, list[int | None]]:
        """(M, n) linear commands over their largest, (M, n, k) shapes, body axis of each."""
        track = self.data.measurement.track
        command = track.command
        if track.command_kind == "duty":
            duty = command / max(np.abs(command).max(), 1e-9)
            level = np.abs(duty)
            odd = np.sign(duty)[..., None] * hats(level, 0.0, 1.0, LEVELS)[..., 1:-1]
            return duty @ MIXING.T, MIXING @ np.concatenate([odd, level[..., None]], -1), [0, 1, 2]
        used = np.flatnonzero(command.any(axis=0))
        linear = command[:, used] / np.maximum(np.abs(command[:, used]).max(axis=0), 1e-9)
        shapes = np.stack([linear * np.abs(linear), np.tanh(6 * linear), np.abs(linear)], -1)
        is_twist = track.command_kind == "twist"
        return linear, shapes, [int(k) if is_twist else None for k in used]

    @cached_property
    def ahead(self) -> np.ndarray:
        """(N, 2) cosine and sine of the headings."""
        return np.column_stack([np.cos(self.heading_rad), np.sin(self.heading_rad)])

    @cached_property
    def edges_s(self) -> np.ndarray:
        """Edges of the intervals that velocity is averaged over: wider where poses are rare."""
        slow = self.data.measurement.track.timing.pose_period_s >= SLOW_POSES_S
        return COARSE_S if slow else EDGES_S

    def _averages(self, signal: np.ndarray) -> np.ndarray:
        """(M, n) held commands to (N, taps, n) means between each two edges before the middle."""
        t_s = self.data.measurement.track.command_t_s
        area = np.zeros_like(signal)
        np.cumsum(signal[:-1] * np.diff(t_s)[:, None], axis=0, out=area[1:])
        at_s = self.middle_s[:, None] - self.edges_s
        k = np.maximum(np.searchsorted(t_s, at_s, side="right") - 1, 0)
        value = area[k] + signal[k] * np.maximum(at_s - t_s[k], 0)[..., None]
        return (value[:, :-1] - value[:, 1:]) / np.diff(self.edges_s)[None, :, None]

    def _shaped(self, shapes: np.ndarray, taps: np.ndarray) -> np.ndarray:
        """(N, n, k) of (M, n, k) shapes: of duties through lags, of others averaged over delays.

        Of duties also (N, taps, n) averages of the commands while all wheels are told to stop.
        """
        track = self.data.measurement.track
        if track.command_kind != "duty":
            few = np.unique(np.linspace(0, len(self.edges_s) - 3, 5).astype(int))
            averaged = [self._averages(shapes[..., k])[:, few] for k in range(shapes.shape[2])]
            return np.concatenate(averaged, axis=1).swapaxes(1, 2)
        held = self._held(shapes.reshape(len(shapes), -1))
        lagged = [self._at(self._low_pass(held, f * self.lag_s)) for f in HAT_LAGS]
        curves = [at.reshape(len(at), *shapes.shape[1:]) for at in lagged]
        stopped = self._at((self._held(track.command) == 0).all(axis=1)[:, None].astype(float))
        late = stopped[:, :, None] * taps[:, :6]
        return np.concatenate([*curves, late.swapaxes(1, 2)], axis=2)

    @cached_property
    def _grid_s(self) -> np.ndarray:
        t_s = self.data.measurement.track.command_t_s
        return np.arange(min(t_s[0], self.middle_s[0]), max(t_s[-1], self.middle_s[-1]), GRID_S)

    def _held(self, signal: np.ndarray) -> np.ndarray:
        """(M, c) commands held, on an even grid."""
        t_s = self.data.measurement.track.command_t_s
        k = np.searchsorted(t_s, self._grid_s, side="right") - 1
        held = signal[np.maximum(k, 0)]
        held[k < 0] = 0.0
        return held

    def _at(self, signal: np.ndarray) -> np.ndarray:
        """(G, c) on the grid to (N, c) at the middles of the steps."""
        return native.read_at(signal, (self.middle_s - self._grid_s[0]) / GRID_S)

    @staticmethod
    def _low_pass(signal: np.ndarray, lag_s: float) -> np.ndarray:
        gain = 1 - np.exp(-GRID_S / lag_s)
        return filtered([gain], [1, gain - 1], signal, axis=0)

    def _lagged_base(self, base_mps: np.ndarray) -> np.ndarray:
        """(N, 3 lags) of each axis: the base's velocity, and late."""
        period_s = even_step_s(self.step_s)
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
        """Blocks and parts of windows."""
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

    def _rows(
        self, part: int, scale: np.ndarray, wanted: np.ndarray, every: int = 1
    ) -> Rows | None:
        """Rows of the plane (0) or of turning (1), at every Nth horizon; None where there is none.

        Args:
            part: which.
            scale: (H, 3) errors that count as one.
            wanted: (W, H, 3) what features are to make.
            every: so many horizons are one.
        """
        scale = _isotropic(scale)
        measured = np.isfinite(self.data.measured[..., :2]).all(axis=-1) & (self.ends >= 0)
        places, weights = [], []
        for h in range(0, self.ends.shape[1], every):
            for channel in (0, 1) if part == 0 else (2,):
                own = np.flatnonzero(measured[:, h] & np.isfinite(wanted[:, h, channel]))
                if scale[h, channel] > 1e-9 and len(own):
                    places.append((own, np.full(len(own), h), np.full(len(own), channel)))
                    weight = 1 / (scale[h, channel] * np.sqrt(len(own)))
                    weights.append(np.full(len(own), weight))
        if not places:
            return None
        at, weight = np.concatenate(places, axis=1), np.concatenate(weights)
        parts = Parts(
            self.fold[at[0]], self.end_fold[at[0], at[1]], self.tail_fold[at[0]], self.folds
        )
        order = parts.order
        window, horizon, channel = at = at[:, order]
        weight = weight[order]
        heading = np.nan_to_num(self.data.measurement.track.heading_smooth)
        along = heading[self.data.windows.starts[window]] + np.where(channel == 1, np.pi / 2, 0.0)
        ways = (np.cos(along), np.sin(along)) if part == 0 else (np.ones(len(along)),)
        return Rows(
            at=at,
            starts=self.starts[window],
            ends=self.ends[window, horizon],
            direction=np.stack(ways, axis=-1) * weight[:, None],
            weight=weight,
            wanted=wanted[window, horizon, channel] * weight,
            parts=parts.at(order),
        )

    def _led(self, part: int, rows: Rows, features: Sequence[Features]) -> np.ndarray:
        """(R, F) of features side by side, forward ones before left; or of turning."""
        alone = np.ones((len(self.step_s), 1))

        def factors(of: np.ndarray | Product) -> tuple[np.ndarray, np.ndarray]:
            return (of.gains, of.signals) if isinstance(of, Product) else (of, alone)

        columns = [[factors(f[axis]) for f in features] for axis in AXES[part]]
        forward, left = columns if part == 0 else (*columns, [])
        steps = self._steps[part]
        return native.led_between(forward, left, steps, rows.starts, rows.ends, rows.direction)

    @cached_property
    def _steps(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) length of each step times the direction in which the robot heads; (N, 1) alone."""
        return self.ahead * self.step_s[:, None], self.step_s[:, None].copy()

    def _part(self, t_s: np.ndarray) -> np.ndarray:
        return np.floor(t_s / self.block_s).astype(int) % self.folds

    # -- regression -----------------------------------------------------------------------------

    def _fit(
        self, scale: np.ndarray, ridges: Sequence[np.ndarray | None], parts: Sequence[int] = (0, 1)
    ) -> None:
        """Velocities with the errors (H, 3) of another fit as weights; 0 where nothing tells them.

        Those of a part of the motion, the plane or turning, that is not fitted stay.
        """
        first = np.array([FIRST_RIDGE.get(g, OUT) for g in GROUPS])
        self.ridges = [first if ridge is None else ridge for ridge in ridges]
        self.velocities = self.velocities.copy()
        for part in parts:
            self.velocities[list(AXES[part])] = 0.0
            rows = self._rows(part, scale, self.data.measured)
            if rows is not None:
                equations = Equations.of(self._led(part, rows, self.features), rows)
                widths = [[f[axis].shape[1] for f in self.features] for axis in AXES[part]]
                groups = np.concatenate([np.repeat(np.arange(len(w)), w) for w in widths])
                self.ridges[part], *found = _ridge(equations, groups, self.ridges[part])
                self._follow(part, np.vstack(found).T)
        self._judge()

    @property
    def motion(self) -> Motion:
        """At each point, as fitted so far."""
        return Motion(
            velocity=self.velocities[..., 0].T.copy(),
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
        there = np.all(self.ends[:, BEAT_HORIZONS] >= 0, axis=1)
        at = self.starts[there]
        errors, made = zip(*(self._at_horizon(h, there) for h in BEAT_HORIZONS), strict=True)
        swings = [
            swing
            for own, ways in zip(errors, made, strict=True)
            for swing in _swings(own, ways, self.heading_rad[at])
        ]
        self.beat_radps = beat_radps(self.data.start_s[there], swings, self._done(at, made))

    def _done(self, at: np.ndarray, made: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
        """(W,) each: what the robot did, from points (W,) on, with displacements (3, W) made."""
        yield from self.pose[at, :2].T
        for ways in made:
            yield from (*ways, *np.abs(ways))
        moved = self.moved
        for wheel in self.wheels:
            yield from wheel.waves(moved)[at].T
        yield from (f(n * self.heading_rad[at]) for f in (np.cos, np.sin) for n in (1, 2, 4))

    def _at_horizon(self, horizon: int, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3, W) errors over their size, and displacements that were predicted, of some windows."""
        errors = self.across[there, horizon] / np.maximum(self.errors[horizon], 1e-12)
        made = (self.data.measured - self.across)[there, horizon]
        return np.nan_to_num(errors).T, np.nan_to_num(made).T

    def boost(self, groups: Sequence[Group]) -> None:
        """Adds what is left and left-out blocks agree on, a group of features at a time.

        Where the errors that then remain are not independent, those groups go that chance may
        bring.
        """
        scale, before = self.errors, copy(self)
        chosen = self._chosen(groups, scale)
        if not chosen:
            return
        self._fit_with(chosen, scale)
        shares = independent_shares(self.across, self.data.start_s)
        sure = [c for c in chosen if c.times * shares[list(c.axes)].mean() >= 1]
        if len(sure) < len(chosen):
            vars(self).update(vars(before))
            if sure:
                self._fit_with(sure, scale)

    def _chosen(self, groups: Sequence[Group], scale: np.ndarray) -> list["Chosen"]:
        left, chosen = self._left(scale), []
        independent = len(self.starts) * EVERY_S / MEMORY_S
        for part, axes in enumerate(AXES):
            used = [g for g in groups if any(f[axis].shape[1] for f in g for axis in axes)]
            rows = self._rows(part, scale, left, CHOICE_EVERY)
            if rows is None:
                continue
            batches = (_beside(some, axes) for some in _batches(used, axes))
            learners = Learners(
                ((self._led(part, rows, pieces), own) for pieces, own in batches), rows.parts
            )
            for number, ridge, times in boosted(learners, rows.wanted, independent):
                chosen.append(Chosen(_only(axes, used[number]), ridge, axes, times))
        return chosen

    def _fit_with(self, chosen: Sequence["Chosen"], scale: np.ndarray) -> None:
        """Fits the features so far and chosen groups together, each group at its own ridge.

        A part of the motion that no group was chosen for is not fitted anew: it would gain other
        weights alone.
        """
        self.features = [*self.features, *(c.features for c in chosen)]
        ridges = [np.concatenate([own, [c.ridge for c in chosen]]) for own in self.ridges]
        parts = [k for k, axes in enumerate(AXES) if any(c.axes == axes for c in chosen)]
        self._fit(scale, ridges, parts)

    def _left(self, scale: np.ndarray) -> np.ndarray:
        """(W, H, 3) what the features so far, fitted to other blocks, leave of the rows.

        Args:
            scale: (H, 3) errors that count as one.
        """
        left = self.data.measured.copy()
        for part in range(len(AXES)):
            rows = self._rows(part, scale, left)
            if rows is not None:
                led = self._led(part, rows, [[*self.velocities]])
                of_axes = led.reshape(len(led), -1, self.velocities.shape[2])
                made = of_axes[np.arange(len(led)), :, 1 + rows.parts.inside].sum(axis=1)
                left[tuple(rows.at)] -= made / rows.weight
        return left

    def _judge(self) -> None:
        """Errors of the stages so far: fitted to all, and to other blocks."""
        whole, *without = self.velocities.transpose(2, 1, 0)
        everything = np.zeros(len(self.starts), int)
        self.within = difference(self.data.measured, self.predict([whole], everything))
        self.across = difference(self.data.measured, self.predict(without, self.fold))

    @property
    def errors(self) -> np.ndarray:
        """(H, 3) between those of the fit to all, too small, and those on left-out parts."""
        return np.sqrt((rms(self.within) ** 2 + rms(self.across) ** 2) / 2)

    def _follow(self, part: int, coefficients: np.ndarray) -> None:
        """Velocities of the plane or of turning, 0 so far, by (F, 1 + K) coefficients of features.

        Of all fits at once: one by one each goes through all features again.
        """
        each = [(axis, f[axis]) for axis in AXES[part] for f in self.features]
        edges = np.cumsum([f.shape[1] for _, f in each])
        for (axis, f), own in zip(each, np.split(coefficients, edges[:-1]), strict=True):
            if own.any():  # none of a group that is out
                self.velocities[axis] += f @ own

    def predict(self, velocities: Sequence[np.ndarray], which: np.ndarray) -> np.ndarray:
        """(W, H, 3) displacements, the heading integrated by the response itself.

        Args:
            velocities: (N, 3) each.
            which: (W,) of these predicts each window.
        """
        out = np.full(self.data.measured.shape, np.nan)
        for k, velocity in enumerate(velocities):
            own = np.flatnonzero(which == k)
            if not len(own):
                continue
            starts, ends = self.starts[own], np.maximum(self.ends[own], self.starts[own, None])
            points = _within(starts, ends.max(axis=1), len(self.points))
            run = _integrate(velocity[points], self.step_s[points])
            start, end = (run[np.searchsorted(points, at)] for at in (starts, ends))
            out[own] = np.where((self.ends[own] >= 0)[..., None], _seen_from(start, end), np.nan)
        out[~np.isfinite(self.data.measured)] = np.nan
        return out


def _within(starts: np.ndarray, ends: np.ndarray, count: int) -> np.ndarray:
    """Indices of the points in windows, from each start (W,) to its end."""
    opened, closed = (np.bincount(at, minlength=count + 1) for at in (starts, ends + 1))
    return np.flatnonzero(np.cumsum(opened - closed)[:count])


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


def _only(axes: Sequence[int], group: Group) -> Features:
    """A group's features of some axes, side by side."""
    none = [np.zeros((group[0][0].shape[0], 0))]
    return tuple(np.hstack([f[k] for f in group] if k in axes else none) for k in range(3))


def _batches(groups: Sequence[Group], axes: Sequence[int]) -> Iterator[Sequence[Group]]:
    """Groups that together have about WIDE features: sums over time are quicker side by side."""
    some: list[Group] = []
    width = 0
    for group in groups:
        known = {id(f) for other in some for f in other}
        width += sum(f[axis].shape[1] for f in group if id(f) not in known for axis in axes)
        some.append(group)
        if width >= WIDE:
            yield some
            some, width = [], 0
    if some:
        yield some


def _beside(
    groups: Sequence[Group], axes: Sequence[int]
) -> tuple[list[Features], list[np.ndarray]]:
    """Features of some groups, each once, and the columns of each group where all are in a row."""
    every = {id(f): f for group in groups for f in group}
    places: dict[int, list[np.ndarray]] = {k: [] for k in every}
    first = 0
    for axis in axes:
        for k, f in every.items():
            places[k].append(first + np.arange(f[axis].shape[1]))
            first += f[axis].shape[1]
    columns = [np.sort(np.concatenate([p for f in own for p in places[id(f)]])) for own in groups]
    return list(every.values()), columns


def _isotropic(scale: np.ndarray) -> np.ndarray:
    """Makes the scales of forward and left equal: in the floor both are one plane."""
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
        equations: of all rows and of each fold.
        mean: (F,) mean square of each feature's group.
        groups: (F,) number of each feature's group.
    """

    def __init__(self, equations: Equations, mean: np.ndarray, groups: np.ndarray) -> None:
        self.mean, self.groups = mean, groups
        self.grams, self.moments = equations.others
        self.inner, self.push = equations.inside
        self.square = equations.square

    def at(self, ridge: np.ndarray) -> float:
        """Squared error at the ridge (G,) of each group, from which `trials` go on.

        Of a group that is out nothing is left, so that it is left out of the equations.
        """
        self.ridge = ridge
        self.used = np.flatnonzero(ridge[self.groups] < OUT)
        grams = self.grams[:, self.used[:, None], self.used]
        np.einsum("kuu->ku", grams)[:] += (self.mean * ridge[self.groups])[self.used]
        self.inverse = np.linalg.inv(grams)
        return self._fitted()

    def moved(self, group: int, value: float) -> float:
        """Loss at another ridge of one group."""
        ridge = np.where(np.arange(len(self.ridge)) == group, value, self.ridge)
        if max(value, self.ridge[group]) >= OUT:
            return self.at(ridge)
        columns, block, rise = self._rise(np.flatnonzero(self.groups == group), [value])
        less = np.linalg.solve(np.eye(block.shape[-1]) + rise[0] * block, columns.swapaxes(1, 2))
        self.inverse -= rise[0] * columns @ less  # a fifth of the time of another inverse
        self.ridge = ridge
        return self._fitted()

    def _fitted(self) -> float:
        """Squared error of the coefficients that the inverse gives."""
        self.beta = np.zeros((*self.moments.shape, 1))
        self.beta[:, self.used] = self.inverse @ self.moments[:, self.used, None]
        (error,) = self._errors(self.beta)
        return float(error)

    def _errors(self, beta: np.ndarray) -> np.ndarray:
        """(V,) squared error of (K, F, V) coefficients on the folds that they left out."""
        curved = self.inner @ beta
        return self.square + np.sum(beta * (curved - 2 * self.push[..., None]), axis=(0, 1))

    def trials(self, group: int, values: Sequence[float]) -> np.ndarray:
        """(V,) squared error with each of these ridges of one group."""
        own = np.flatnonzero(self.groups == group)
        beta = np.repeat(self.beta, len(values), axis=2)
        if self.ridge[group] < OUT:
            beta[:, self.used] -= self._raised(own, values)
        else:
            moved, beta[:, own] = self._let_in(own, values)
            beta[:, self.used] -= moved
        return self._errors(beta)

    def _raised(self, own: np.ndarray, values: Sequence[float]) -> np.ndarray:
        """(K, U, V) fall of the coefficients used at other ridges of one group: Woodbury.

        A ridge that rises by s on the group's diagonal changes the coefficients b to
        b - B (I/s + B_g)^-1 b_g, with B the inverse's columns of the group.
        """
        columns, block, rise = self._rise(own, values)
        return columns @ at_ridges(block, 1 / rise, self.beta[:, own, 0]).swapaxes(1, 2)

    def _rise(
        self, own: np.ndarray, values: Sequence[float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """B, B_g and s (V,)."""
        at = np.searchsorted(self.used, own)
        more = np.array(values) - self.ridge[self.groups[own[0]]]
        return self.inverse[:, :, at], self.inverse[:, at[:, None], at], self.mean[own[0]] * more

    def _let_in(self, own: np.ndarray, values: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Criterion and (K, g, V) coefficients once a group that is out comes in."""
        across = self.grams[np.ix_(np.arange(len(self.grams)), self.used, own)]
        made = self.inverse @ across
        within = self.grams[:, own[:, None], own] - across.swapaxes(1, 2) @ made
        left = self.moments[:, own, None] - across.swapaxes(1, 2) @ self.beta[:, self.used]
        found = at_ridges(within, self.mean[own[0]] * np.array(values), left[..., 0]).swapaxes(1, 2)
        return made @ found, found


def _ridge(
    equations: Equations, groups: np.ndarray, ridge: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ridge of each group, coefficients (F,) of all rows, and (K, F) without each fold.

    Groups are searched one after the other, twice.

    Args:
        equations: of the features.
        groups: (F,) number of each feature's group.
        ridge: of each group, where the search begins.
    """
    mean = np.diag(equations.gram).copy()
    for g in np.unique(groups):
        mean[groups == g] = mean[groups == g].mean()
    mean += 1e-9 * mean.max() + 1e-30
    left_out = _LeftOut(equations, mean, groups)
    best, tried, each = left_out.at(ridge), 0, np.unique(groups)
    for g in [*each, *each]:
        if tried == len(each):  # since the last move
            break
        others = [value for value in LADDER if value != left_out.ridge[g]]
        trials = left_out.trials(g, others)
        k = int(np.argmin(trials))
        if trials[k] < best * FLOOR_SETTINGS.ridge_worth:
            best, tried = left_out.moved(g, others[k]), 0
        tried += 1
    ridge = left_out.ridge
    used, every = left_out.used, np.zeros(len(groups))
    gram = equations.gram[np.ix_(used, used)] + np.diag((mean * ridge[groups])[used])
    every[used] = np.linalg.solve(gram, equations.moment[used])
    return ridge, every, left_out.beta[..., 0]
