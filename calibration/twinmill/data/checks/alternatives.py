# SPDX-License-Identifier: Apache-2.0
"""The few simple mistakes of signs, columns and axes, and how well each would explain a log.

Commands through the wheels' geometry give the direction in which a robot should move; how fast is
left to one factor per channel. Each mistake gives another direction. All are fitted to every second
stretch of the log and judged on the others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations, product
from typing import TypeVar

import numpy as np
import twinmill_native as native

from twinmill.data.checks.motion import (
    EARLY_S,
    GRID_S,
    LAGS_S,
    LATE_S,
    STEP_S,
    Felt,
    Motion,
)
from twinmill.data.checks.settings import CHECKS
from twinmill.data.clock import place_of_least

Told = TypeVar("Told")
NEGLIGIBLE = 1e-4  # share of the largest channel's squared speed: no unit is told from it
LEVERS_M = (0.05, 0.3)  # turning (rad/s) is weighed against moving (m/s) by the wheels' lever
TWIST_LEVER_M = 0.2  # where there are no wheels
ONE_FLIP = ((-1, -1, -1, -1), (-1, 1, -1, 1), (1, -1, 1, -1))  # all, the left, the right wheels
POSE_SIGNS = ((1, False), (-1, True), (-1, False), (1, True))  # of headings; mirrored
TRIED = 4  # lags and shifts
TOGETHER = 32  # shifts whose sums are compared at once: all of them would be large
LATES_S = np.arange(EARLY_S, LATE_S + STEP_S / 2, STEP_S)
NEAR_S = np.arange(-0.06, 0.061, 0.03)  # about a shift that was found


@dataclass(frozen=True)
class Alternative:
    """One mistake, and what it makes of the columns.

    Attributes:
        place, sign: (4,) wheel k was really driven by sign[k] times column place[k].
        heading_sign, mirrored: as in Motion.body_mps.
        turned: the heading may be off by any constant.
    """

    place: tuple[int, ...] = (0, 1, 2, 3)
    sign: tuple[int, ...] = (1, 1, 1, 1)
    heading_sign: int = 1
    mirrored: bool = False
    turned: bool = False

    @property
    def of_poses(self) -> bool:
        """True if the mistake lies in the poses."""
        return self.turned or self.mirrored or self.heading_sign < 0

    @property
    def is_turn(self) -> bool:
        """True if the heading is off by a constant, and nothing else is wrong with the poses."""
        return self.turned and self.heading_sign > 0 and not self.mirrored

    @property
    def steps(self) -> float:
        """How many simple mistakes it takes: of two that explain as much, the simpler is true."""
        moved = sum(k != p for k, p in enumerate(self.place))
        sides = self.place in ((1, 0, 3, 2), (2, 3, 0, 1))
        flips = 1 if self.sign in ONE_FLIP else self.sign.count(-1)
        of_poses = 1.5 * self.of_poses + (self.turned and (self.mirrored or self.heading_sign < 0))
        return (1 if sides else moved // 2 + moved % 2) + flips + of_poses


OWN = Alternative()


def wheel_alternatives(used: int) -> list[Alternative]:
    """All orders and signs of the columns in use (3 or 4); the right one is left out."""
    rest, same = tuple(range(used, 4)), (1,) * (4 - used)
    found = [
        Alternative((*place, *rest), (*sign, *same))
        for place in permutations(range(used))
        for sign in product((1, -1), repeat=used)
    ]
    return [a for a in found if a != OWN]


def pose_alternatives() -> list[Alternative]:
    """Mirrored or turned positions, headings that turn the wrong way."""
    return [
        Alternative(heading_sign=sign, mirrored=mirrored, turned=turned)
        for sign, mirrored in POSE_SIGNS
        for turned in (False, True)
        if turned or sign < 0 or mirrored
    ]


def by_pose(
    alternatives: list[Alternative],
) -> list[tuple[tuple[int, bool, bool], list[Alternative]]]:
    """Those that make the same of the poses: sign of headings, mirrored, turned; and they."""
    groups: dict[tuple[int, bool, bool], list[Alternative]] = {}
    for a in alternatives:
        groups.setdefault((a.heading_sign, a.mirrored, a.turned), []).append(a)
    return list(groups.items())


@dataclass(frozen=True)
class Explained:
    """How well one alternative explains the motion.

    Attributes:
        left: share of the squared motion that it leaves, on stretches not fitted to.
        by_block: (B,) the same summed by stretch, over the whole motion.
        turned_rad: heading offset that went with it.
        gain: (2,) measured over predicted speed, of driving (on both axes together, as a unit
            scales both) and of turning; 0 where next to none is predicted.
        lag_s, late_s: at which it was found.
    """

    alternative: Alternative
    left: float
    by_block: np.ndarray
    turned_rad: float
    gain: np.ndarray
    lag_s: float
    late_s: float


def far_better(best: Explained, own: Explained) -> bool:
    """True if an alternative explains so much more that physics cannot be the reason."""
    if best.left > CHECKS.far_better * own.left or own.left - best.left < CHECKS.good:
        return False
    return surely_better(best, own)


def surely_better(best: Explained, own: Explained) -> bool:
    """True if one surely leaves less than another of the same motion.

    By the standard error of the ratio of what both leave, from leaving out one stretch after the
    other (the jackknife; Cochran 1977, Sampling Techniques, 6.17): that some stretches hold much
    motion and others none does not widen it, and a ratio that one stretch makes alone is not sure.
    """
    without = best.by_block.sum() - best.by_block, own.by_block.sum() - own.by_block
    ratios = without[0] / np.maximum(without[1], 1e-12)
    count = len(ratios)
    error = np.sqrt((count - 1) / count * np.sum((ratios - ratios.mean()) ** 2))
    return own.left - best.left > CHECKS.sure * own.left * error


def alike_left(left: list[float]) -> float:
    """Share up to which what an explanation leaves is as little as the least."""
    return CHECKS.alike * min(left) + CHECKS.alike_left


@dataclass(frozen=True)
class Jump:
    """The columns as they are, at one shift up to a time and at another one from there on.

    Attributes:
        t_s: of the jump, within a stretch.
        before_s, after_s: the shifts.
        explained: how well that explains the motion.
    """

    t_s: float
    before_s: float
    after_s: float
    explained: Explained

    @property
    def by_s(self) -> float:
        """How much later poses come from there on; negative if sooner."""
        return self.after_s - self.before_s


class Search:
    """Sums from which each alternative is judged, at every lag and shift in time."""

    def __init__(
        self,
        motion: Motion,
        wheels: np.ndarray,
        lates_s: np.ndarray = LATES_S,
        *,
        lags_s: Sequence[float] = LAGS_S,
        commands: Motion | None = None,
    ) -> None:
        """Sums of motion felt at a lag, which are large for a long log, are made on demand.

        Args:
            motion: of one robot.
            wheels: (3, 4) velocity of the body by command.
            lates_s: shifts.
            lags_s: lags.
            commands: of which these are; those of another robot, or its own.
        """
        self.motion, self.wheels = motion, wheels
        self.lates_s, self.lags_s = lates_s, lags_s
        self.commands = commands or motion
        forward, turn = np.abs(wheels[0]).max(), np.abs(wheels[2]).max()
        is_twist = np.array_equal(wheels[:2], np.eye(2, 4))
        self.lever_m = TWIST_LEVER_M if is_twist or not turn else forward / turn
        self.lever_m = float(np.clip(self.lever_m, *LEVERS_M))
        blocks = int(motion.block.max()) + 1
        self.fold = np.arange(blocks) % 2
        self.starts = np.searchsorted(motion.block, np.arange(blocks))
        self._own_key: list[tuple[float, float]] = []
        self._told: dict[Callable, object] = {}
        self._sums_by_shift: dict[float, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def of(
        self,
        motion: Motion | None = None,
        lates_s: np.ndarray | None = None,
        lags_s: Sequence[float] | None = None,
    ) -> "Search":
        """Search with these commands beside another motion, or at other shifts and lags."""
        return Search(
            motion or self.motion,
            self.wheels,
            self.lates_s if lates_s is None else lates_s,
            lags_s=lags_s or self.lags_s,
            commands=self.commands,
        )

    def felt(self, lag_s: float) -> Felt:
        """Commands at a lag."""
        return self.commands.felt(lag_s)

    def told(self, lag_s: float) -> Felt:
        """(G, SHAPES, 3) velocities of the body that they ask for, the columns as they are."""
        begin_s, shapes = self.felt(lag_s)
        return begin_s, shapes @ self.weighted(self.wheels).T

    def once(self, tell: Callable[["Search"], Told]) -> Told:
        """Result of `tell` for this search, computed once since several ask and it takes long."""
        if tell not in self._told:
            self._told[tell] = tell(self)
        return self._told[tell]

    def _by_block(self, rows: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(B, SHAPES, 4, n) sums over stretches of products of (K, SHAPES, 4) with (K, ..., n)."""
        product = rows[..., None] * other.reshape(len(other), -1, 1, other.shape[-1])
        return self._sums(product)

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """(B, ...) sums over stretches; a stretch without poses is zero."""
        ends = np.append(self.starts[1:], len(values))
        sums = np.zeros((len(self.starts), *values.shape[1:]))
        filled = ends > self.starts
        sums[filled] = np.add.reduceat(values, self.starts[filled])
        return sums

    @cached_property
    def _likely(self) -> dict[tuple[int, bool], list[tuple[float, float]]]:
        """Lags and shifts at which any mixture of the commands explains most, by pose signs.

        They do not depend on the order or the signs of the columns, nor on a constant angle.
        """
        speeds = [self.speeds(self.motion.body_mps(*signs), signs[0]) for signs in POSE_SIGNS]
        beside = np.hstack(speeds)  # (K, 3 of each)
        explained: list[dict[tuple[float, float], float]] = [{} for _ in POSE_SIGNS]
        for lag_s in self.lags_s:
            begin_s, shapes = self.felt(lag_s)
            for late_s in self.lates_s:
                rows = self.motion.at((begin_s, shapes[:, 1]), late_s)
                gram, moment = rows.T @ rows, rows.T @ beside
                ridge = 1e-6 * (np.trace(gram) + 1e-12) * np.eye(4)
                by_column = np.sum(moment * np.linalg.solve(gram + ridge, moment), axis=0)
                for of_signs, sums in zip(explained, by_column.reshape(-1, 3), strict=True):
                    of_signs[lag_s, late_s] = sums.sum()
        return {
            signs: sorted(of_signs, key=lambda at: of_signs[at], reverse=True)[:TRIED]
            for signs, of_signs in zip(POSE_SIGNS, explained, strict=True)
        }

    def own(self) -> Explained:
        """The columns as they are, at the lag and the shift where they explain most of all."""
        found: list[Explained] = []
        for lag_s in self.lags_s:
            left, gain = self._judged(*self.by_shift(lag_s))
            k = int(left.sum(axis=1).argmin())
            late_s = float(self.lates_s[k])
            found.append(
                Explained(
                    alternative=OWN,
                    left=float(left[k].sum()),
                    by_block=left[k],
                    turned_rad=0.0,
                    gain=gain[k],
                    lag_s=lag_s,
                    late_s=late_s,
                )
            )
        own = min(found, key=lambda e: e.left)
        self._own_key = [(own.lag_s, own.late_s)]
        return own

    def best_shift(self, lag_s: float) -> tuple[float, float]:
        """Shift, between those of the grid, at which the columns as they are leave least; that."""
        left = self._judged(*self.by_shift(lag_s))[0].sum(axis=1)
        return place_of_least(self.lates_s, left), float(left.min())

    def by_shift(self, lag_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sums over stretches for each bend, with the columns unchanged, at each of S shifts.

        Returns:
            (S, B, SHAPES, 3) told times itself and times measured, and (B,) measured squares.
        """
        if lag_s not in self._sums_by_shift:
            self._sums_by_shift[lag_s] = self.summed_by_shift(lag_s)
        return self._sums_by_shift[lag_s]

    def summed_by_shift(self, lag_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sums as of `by_shift`, of lags that are looked at once."""
        return *self._summed(lag_s, self.lates_s), self._total

    def _summed(self, lag_s: float, lates_s: np.ndarray, rate: float = 0.0) -> np.ndarray:
        """(2, S, B, SHAPES, 3) the same at other shifts, and at a rate of the clocks."""
        begin_s, told = self.told(lag_s)
        sums = native.sums_by_shift(
            told.reshape(len(told), -1),
            self.motion.places(begin_s, rate=rate),
            lates_s / GRID_S,
            self.speeds(self.motion.body_mps(), 1),
            self.starts,
        )
        return sums.reshape(*sums.shape[:3], *told.shape[1:])

    @cached_property
    def _total(self) -> np.ndarray:
        """(B,) measured squares, summed over stretches."""
        return self._sums(np.sum(self.speeds(self.motion.body_mps(), 1) ** 2, axis=1))

    def beside(self, own: Explained) -> tuple[np.ndarray, np.ndarray]:
        """(K, 3) measured and (K, SHAPES, 3) told velocities, of the columns as they are."""
        told = self.motion.at(self.told(own.lag_s), own.late_s)
        return self.speeds(self.motion.body_mps(), 1), told

    def jump(self, own: Explained, fewest: int) -> Jump:
        """The two shifts that explain most, with a jump between two stretches.

        Args:
            own: the columns as they are, at one shift.
            fewest: stretches before the jump, and after it.
        """
        counts = np.arange(fewest, len(self.starts) - fewest + 1)
        found: list[Jump] = []
        for lag_s in self.lags_s:
            sums = self.by_shift(lag_s)
            before = _left_by_first(sums, self.fold, counts)
            power, along, total = sums
            turned = power[:, ::-1], along[:, ::-1], total[::-1]
            after = _left_by_first(turned, self.fold[::-1], len(total) - counts)
            split = int(counts[np.argmin(before.min(axis=0) + after.min(axis=0))])
            found.append(self._jump(replace(own, lag_s=lag_s), sums, split))
        return min(found, key=lambda jump: jump.explained.left)

    def _jump(
        self, own: Explained, sums: tuple[np.ndarray, np.ndarray, np.ndarray], split: int
    ) -> Jump:
        """The best shift before a stretch, and the best from it on."""
        power, along, total = sums
        lefts, shifts_s = [], []
        for part in (slice(split), slice(split, None)):
            left, _ = self._judged(power[:, part], along[:, part], total[part])
            k = int(left.sum(axis=1).argmin())
            lefts.append(left[k] * total[part].sum() / total.sum())
            shifts_s.append(float(self.lates_s[k]))
        by_block = np.concatenate(lefts)
        explained = replace(own, left=float(by_block.sum()), by_block=by_block)
        return Jump(float(self.motion.t_s[self.starts[split]]), *shifts_s, explained)

    def jump_std_s(self, jump: Jump) -> float:
        """Standard error of a jump's size, of its two shifts by leaving out a stretch at a time."""
        power, along, total = self.by_shift(jump.explained.lag_s)
        split, variance = int(np.searchsorted(self.motion.t_s[self.starts], jump.t_s)), 0.0
        for part in (slice(split), slice(split, None)):
            left, _ = self._judged(power[:, part], along[:, part], total[part])
            left *= total[part].sum()
            without = [place_of_least(self.lates_s, left.sum(axis=1) - b) for b in left.T]
            variance += (len(without) - 1) * float(np.var(without))  # Efron and Stein 1981
        return float(np.sqrt(variance))

    def best(
        self, alternatives: list[Alternative], keys: list[tuple[float, float]] | None = None
    ) -> list[Explained]:
        """Each at the lag and shift where it explains most, of some; else of the likely ones."""
        found: list[Explained] = []
        for (sign, mirrored, turned), group in by_pose(alternatives):
            found += self._best_of(
                group,
                sign=sign,
                mirrored=mirrored,
                turned=turned,
                keys=keys or self.keys(sign, mirrored),
            )
        return found

    def without(self, e: Explained, lates_s: np.ndarray) -> "Search":
        """At other shifts, had the mistake that `e` tells of been put right."""
        a, (mixing,) = e.alternative, self.mixing([e.alternative])
        motion = self.motion.mended(a.heading_sign, a.mirrored, e.turned_rad)
        return Search(motion, mixing, lates_s, lags_s=self.lags_s, commands=self.commands)

    def keys(self, sign: int, mirrored: bool) -> list[tuple[float, float]]:
        """Lags and shifts that are tried where the poses have such signs."""
        return [*self._likely[sign, mirrored], *self._own_key]

    def mixing(self, group: list[Alternative]) -> np.ndarray:
        """(A, 3, 4): velocity by column under each alternative."""
        return np.stack(
            [self.wheels[:, _inverse(a.place)] * np.array(a.sign)[_inverse(a.place)] for a in group]
        )

    def at_rate(self, own: Explained, rate: float, near_s: np.ndarray = NEAR_S) -> Explained:
        """The columns as they are, with clocks that run apart by `rate` (seconds per second).

        Args:
            own: the columns at one shift, which is that of the middle of the log.
            rate: of the clocks.
            near_s: shifts about that one, which are tried.
        """
        middle_s = rate * float(np.ptp(self.motion.t_s)) / 2
        lates_s = own.late_s - middle_s + near_s
        power, along = self._summed(own.lag_s, lates_s, rate)
        linear_p, linear_m = power[:, :, 1].sum(axis=1), along[:, :, 1].sum(axis=1)
        explained = np.maximum(linear_m, 0) ** 2 / np.maximum(linear_p, 1e-12)
        k = [int(explained.sum(axis=1).argmax())]
        left, gain = self._judged(power[k], along[k], self._total)
        return Explained(
            alternative=OWN,
            left=float(left.sum()),
            by_block=left[0],
            turned_rad=0.0,
            gain=gain[0],
            lag_s=own.lag_s,
            late_s=float(lates_s[k[0]]),
        )

    def _best_of(
        self,
        group: list[Alternative],
        *,
        sign: int,
        mirrored: bool,
        turned: bool,
        keys: list[tuple[float, float]],
    ) -> list[Explained]:
        body = self.motion.body_mps(sign, mirrored)
        mixing = self.mixing(group)
        least = np.full(len(group), np.inf)
        places: list = [None] * len(group)
        for key in keys:
            rows = self.motion.at(self.felt(key[0]), key[1])
            gram = self._by_block(rows, rows)
            angle = self._angle(rows, body) if turned else 0.0
            speeds = self.speeds(body * np.exp(-1j * angle), sign)
            moment = self._by_block(rows, speeds)
            total = self._sums(np.sum(speeds**2, axis=1))
            left, gain = self._left(mixing, gram, moment, total)
            better = left.sum(axis=1) < least
            for i in np.flatnonzero(better):
                least[i] = left[i].sum()
                places[i] = (left[i], angle, gain[i], *key)
        return [Explained(a, float(least[i]), *places[i]) for i, a in enumerate(group) if places[i]]

    def speeds(self, body: np.ndarray, sign: int) -> np.ndarray:
        """(K, 3) forward, left, lever_m * turn."""
        return np.column_stack([body.real, body.imag, self.lever_m * sign * self.motion.turn_radps])

    def _angle(self, rows: np.ndarray, body: np.ndarray) -> float:
        """Heading offset at which the body moves where its commands say, on the whole."""
        told = rows[:, 1] @ self.wheels[:2].T
        return float(np.angle(np.sum(body * np.conj(told[:, 0] + 1j * told[:, 1]))))

    def weighted(self, mixing: np.ndarray) -> np.ndarray:
        """(..., 3, 4) with the turn as fast as the wheels that make it."""
        return mixing * np.array([1, 1, self.lever_m])[:, None]

    def _left(
        self, mixing: np.ndarray, gram: np.ndarray, moment: np.ndarray, total: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(A, B) share left by stretch; (A, 2) gains; of (B, SHAPES, 4, 4 or 3) sums."""
        weighted = self.weighted(mixing)
        power = np.einsum("aci,bsij,acj->absc", weighted, gram, weighted, optimize=True)
        along = np.einsum("aci,bsic->absc", weighted, moment, optimize=True)
        return self._judged(power, along, total)

    def _judged(
        self, power: np.ndarray, along: np.ndarray, total: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(A, B) share left by stretch, judged by fits to the other half; (A, 2) gains.

        Args: power, along (A, B, SHAPES, 3): told times itself and times measured. total (B,).
        """
        left = np.zeros(power.shape[:2])
        each, channel = np.ogrid[: len(power), : power.shape[3]]
        for half in (0, 1):
            p, m = (sums[:, 1 - half :: 2].sum(axis=1) for sums in (power, along))
            gain = np.maximum(m, 0) / np.maximum(p, 1e-12)  # (A, SHAPES, C)
            shape = np.argmax(gain * m, axis=1)  # that which explains most
            best = gain[each, shape, channel][:, :, None]
            p, m = (sums[:, half::2][each, :, shape, channel] for sums in (power, along))
            left[:, half::2] = (best**2 * p - 2 * best * m).sum(axis=1)
        left = (left + total) / max(total.sum(), 1e-12)
        linear_p, linear_m = (_lengths_and_turn(s[:, :, 1].sum(axis=1)) for s in (power, along))
        moves = linear_p > NEGLIGIBLE * linear_p.max(axis=1, keepdims=True)
        return left, np.where(moves, linear_m / np.maximum(linear_p, 1e-12), 0.0)


def _lengths_and_turn(sums: np.ndarray) -> np.ndarray:
    """(A, 2) of (A, 3) sums: forward and left together, and turning."""
    return np.column_stack([sums[:, 0] + sums[:, 1], sums[:, 2]])


def _left_by_first(
    sums: tuple[np.ndarray, np.ndarray, np.ndarray], fold: np.ndarray, counts: np.ndarray
) -> np.ndarray:
    """(A, K) squares left of the first `counts` (K,) stretches, judged as by `Search._judged`.

    Args: sums of stretches, as there; fold (B,) half that each stretch belongs to.
    """
    power, along, total = sums
    left = np.cumsum(total)[counts - 1]
    halves = np.arange(2) == fold[:, None]  # (B, 2)
    found = np.empty((len(power), len(counts)))
    for some in np.array_split(np.arange(len(power)), len(power) // TOGETHER + 1):
        (p, other_p), (m, other_m) = (
            np.moveaxis(
                np.cumsum(s[some, None] * halves.T[:, :, None, None], axis=2)[:, :, counts - 1],
                1,
                0,
            )
            for s in (power, along)
        )
        found[some] = left
        for here_p, here_m, of_p, of_m in ((p, m, other_p, other_m), (other_p, other_m, p, m)):
            gain = np.maximum(of_m, 0) / np.maximum(of_p, 1e-12)
            shape = np.argmax(gain * of_m, axis=2)[:, :, None]  # (A, K, 1, C)
            best, own_p, own_m = (
                np.take_along_axis(v, shape, axis=2)[:, :, 0] for v in (gain, here_p, here_m)
            )
            found[some] += (best**2 * own_p - 2 * best * own_m).sum(axis=2)
    return found


def _inverse(place: tuple[int, ...]) -> list[int]:
    """Column to wheel from wheel to column."""
    inverse = [0] * len(place)
    for wheel, column in enumerate(place):
        inverse[column] = wheel
    return inverse
