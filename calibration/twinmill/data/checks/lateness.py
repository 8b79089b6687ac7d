# SPDX-License-Identifier: Apache-2.0
"""How late a robot follows its commands, over one log: by steps, for a while, or more and more.

Stretch by stretch, each shift of the commands and each lag leaves something of the motion. Where
some shifts, one after the other, leave far less than one, the lateness changed; unless lags that
change leave as little, or the shift goes by stretch as it likes, as where a lag depends on the
command. Shares of the speed are free in each stretch, so that a battery that sags is no lateness.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from twinmill.data.checks.alternatives import Search
from twinmill.data.checks.motion import SHAPES, Motion
from twinmill.data.checks.settings import CHECKS
from twinmill.data.clock import place_of_least

STRETCH_S = 1.5
STEP_S = 0.03
SHIFTS_S = np.arange(-0.9, 1.2 + STEP_S / 2, STEP_S)
LAGS_S = tuple(np.geomspace(0.02, 0.5, 9))
FEW_LAGS_S = LAGS_S[1::3]  # which are tried first: most logs show no change by these
SHRUNK = 0.3  # of a usual stretch's power: so much counts the gain of the whole log in each
MOST_STEPS = 5
HEAVIEST = 2.0  # times the usual weight of a stretch
FEWEST = 2  # stretches between two steps
JUST_AFTER_S = 1e-6

Shape = Literal["step", "while", "steps", "drift", "changes"]


@dataclass(frozen=True)
class Lateness:
    """How much later than at the begin of a log its robot follows the commands; sooner: negative.

    Attributes:
        shape: a step; a while; several steps; a drift; or that it changes, where none is sure.
        t_s: (K,) capture's clock.
        late_s: (K,) at these times, and on straight lines between them.
        shift_s: of the poses against the commands' stamps at the begin, a clock's offset included.
    """

    shape: Shape
    t_s: tuple[float, ...]
    late_s: tuple[float, ...]
    shift_s: float

    def at(self, t_s: np.ndarray) -> np.ndarray:
        """(N,) s, at times of capture's clock."""
        return np.interp(t_s, self.t_s, self.late_s)

    def acting_s(self, command_t_s: np.ndarray) -> np.ndarray:
        """(M,) stamps of commands, moved as if all came as late as the first; in their order."""
        reached_s = command_t_s + self.shift_s
        for _ in range(3):  # when it acts decides how late it was
            late_s = self.at(reached_s)
            reached_s = command_t_s + self.shift_s + late_s
        return np.maximum.accumulate(command_t_s + late_s)

    @property
    def what(self) -> str:
        """In a clause."""
        last_s = self.late_s[-1]
        if self.shape == "drift":
            pace = abs(last_s) / (self.t_s[-1] - self.t_s[0])
            return (
                f"the robot follows its commands {_than(last_s)} and {_than(last_s)}, by "
                f"{60e3 * pace:.0f} ms a minute"
            )
        if self.shape == "changes":
            by_s = float(np.ptp(self.late_s))
            return f"how late the robot follows its commands changes, by up to {by_s:.2f} s"
        at = [k for k in range(1, len(self.t_s)) if self.late_s[k] != self.late_s[k - 1]]
        if self.shape == "while":
            first, last = (self.t_s[k] for k in at)
            by_s = self.late_s[at[0]]
            return (
                f"the robot follows its commands {_than(by_s)} from about {first:.0f} to {last:.0f}"
                f" s, by {abs(by_s):.2f} s"
            )
        told = [
            f"{_than(self.late_s[k])} from about {self.t_s[k]:.0f} s on, by "
            f"{abs(self.late_s[k]):.2f} s"
            for k in at
        ]
        return f"the robot follows its commands {', and '.join(told)}"


def _than(by_s: float) -> str:
    return "later" if by_s > 0 else "sooner"


@dataclass(frozen=True)
class _Path:
    """Shifts over the log, and what they leave.

    Attributes:
        edges: (K + 1,) stretches at which pieces begin, and their number; of a drift its ends.
        at_s: (K,) shift of each piece; of a drift at both ends.
        left: by all stretches, each over what is usual in it.
        parameters: so many numbers it has.
    """

    edges: tuple[int, ...]
    at_s: tuple[float, ...]
    left: float
    parameters: int

    @property
    def pieces(self) -> int:
        """How many it has."""
        return len(self.edges) - 1

    @property
    def straight(self) -> bool:
        """True if lateness changes along a straight line, as a drift does."""
        return len(self.at_s) > self.pieces

    def cost(self, stretches: int) -> float:
        """Schwarz's criterion (1978), of so many stretches."""
        return stretches * np.log(self.left / stretches) + self.parameters * np.log(stretches)


def lateness_of(whole: Search) -> Lateness | None:
    """How the lateness of a robot changes in its log; None where it may well be one.

    Args:
        whole: of its motion, the columns as they are right.
    """
    motion = whole.motion.in_stretches(STRETCH_S)
    for lags_s in (FEW_LAGS_S, LAGS_S):
        left = _normal(*_left_by_stretch(whole.of(motion, SHIFTS_S, lags_s)))
        by_shift = left[left.min(axis=1).sum(axis=1).argmin()]
        found = _best(by_shift)
        if found is None:
            return None
        path, shape = found
    by_lag = left[:, left.min(axis=0).sum(axis=1).argmin()]
    logs = np.log(LAGS_S)
    of_lags = _stepwise(by_lag, logs)
    rival = _drift(by_lag, logs, 1.0) if path.straight else of_lags[path.pieces - 1]
    least = float(left.min(axis=(0, 1)).sum())  # by any shift and lag of each stretch
    if path.left - least > CHECKS.step_leaves * (min(of_lags[0].left, rival.left) - least):
        return None
    return _in_time(path, shape, motion)


def _best(left: np.ndarray) -> tuple[_Path, Shape] | None:
    """The path of shifts that explains (S, B) best and surely, and its kind; None: one shift."""
    paths, count = _stepwise(left, SHIFTS_S), left.shape[1]
    best = min((p for p in paths if _is_sure(p, left)), key=lambda p: p.cost(count))
    drift = _drift(left, SHIFTS_S, CHECKS.least_step_s)
    if not _drifts_surely(drift, left) or drift.cost(count) > best.cost(count):
        if best.pieces == 1:
            return None
        alone = drift.cost(count) - best.cost(count) > CHECKS.shape_sure
        return best, _of_steps(best) if alone else "changes"
    finest = min(paths, key=lambda p: p.cost(count))
    gained = finest.cost(count) - drift.cost(count)
    if gained < -CHECKS.shape_sure:
        return finest, "changes"
    return drift, "drift" if gained > CHECKS.shape_sure else "changes"


def _left_by_stretch(search: Search) -> tuple[np.ndarray, np.ndarray]:
    """(L, S, B) squares that lags and shifts leave, by the best bend; (B,) those of the motion.

    Lag by lag, as what is summed for one is large.
    """
    at_lags = [_left_at(search, lag_s) for lag_s in search.lags_s]
    by_bend = list(zip(*(left for left, _ in at_lags), strict=True))
    least = [min(left.min(axis=0).sum() for left in of_lags) for of_lags in by_bend]
    return np.array(by_bend[int(np.argmin(least))]), at_lags[0][1]


def _left_at(search: Search, lag_s: float) -> tuple[list[np.ndarray], np.ndarray]:
    """(S, B) squares that shifts leave at one lag, by each bend; (B,) those of the motion."""
    power, along, total = search.summed_by_shift(lag_s)
    found = []
    for bend in range(SHAPES):
        p, m = power[:, :, bend], along[:, :, bend]
        gain = np.maximum(m.sum(1), 0) / np.maximum(p.sum(1), 1e-12)
        usual = SHRUNK * p.mean(1, keepdims=True)
        own = np.maximum(m + usual * gain[:, None], 0) / np.maximum(p + usual, 1e-12)
        found.append(total + (own**2 * p - 2 * own * m).sum(axis=-1))
    return found, total


def _normal(left: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Squares left in each stretch, over those that the best of all leaves there, and usually.

    Where the robot stands, or does something else than it is told, a stretch says nothing.
    """
    least = np.maximum(left.min(axis=(0, 1)), 0.0)
    over = left / (least + np.median(least) + 1e-12)
    told = least < CHECKS.drift_left * total
    return np.where(told, over, over.min(axis=(0, 1)))


def _stepwise(left: np.ndarray, places: np.ndarray) -> list[_Path]:
    """The best paths of 1, 2, ... pieces, by (S, B) left; by dynamic programming."""
    count = left.shape[1]
    sums = np.concatenate([np.zeros((len(left), 1)), np.cumsum(left, axis=1)], axis=1)
    costs = np.full((MOST_STEPS + 1, count + 1), np.inf)  # of paths up to a stretch, by steps
    came = np.zeros((MOST_STEPS, count + 1), int)  # where their last pieces begin
    for i in range(count):  # at which all is known of what ends there
        piece = (sums[:, i + 1 :] - sums[:, [i]]).min(axis=0)
        piece[: FEWEST - 1] = np.inf
        if not i:
            costs[0, 1:] = piece
        step = costs[:-1, i, None] + piece
        better = step < costs[1:, i + 1 :]
        costs[1:, i + 1 :][better] = step[better]
        came[:, i + 1 :][better] = i
    found = []
    for pieces in range(1, len(costs) + 1):
        edges = [count]
        for back in came[pieces - 2 :: -1] if pieces > 1 else []:
            edges.insert(0, int(back[edges[0]]))
        edges.insert(0, 0)
        own = [sums[:, b] - sums[:, a] for a, b in pairwise(edges)]
        at = tuple(place_of_least(places, o) for o in own)
        fine = sum(_value(o, places, a) for o, a in zip(own, at, strict=True))
        found.append(_Path(tuple(edges), at, float(fine), 2 * pieces - 1))
    return found


def _value(left: np.ndarray, places: np.ndarray, at: np.ndarray | float) -> np.ndarray:
    """(S, ...) at places between those of the grid, by the parabola through the three nearest."""
    step = places[1] - places[0]
    k = np.clip(np.round((np.asarray(at) - places[0]) / step).astype(int), 1, len(places) - 2)
    if left.ndim == 2:
        below, here, above = (left[k + d, np.arange(left.shape[1])] for d in (-1, 0, 1))
    else:
        below, here, above = left[k - 1], left[k], left[k + 1]
    x = (at - places[k]) / step
    return here + x * (above - below) / 2 + x**2 * (above - 2 * here + below) / 2


def _timing(left: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(B,) place that suits each stretch best, and its weight: no stretch speaks for many."""
    step = places[1] - places[0]
    k = np.clip(left.argmin(axis=0), 1, len(left) - 2)
    below, here, above = (left[k + d, np.arange(left.shape[1])] for d in (-1, 0, 1))
    bend = np.maximum(below - 2 * here + above, 1e-9)
    own = places[k] + step * np.clip((below - above) / bend / 2, -1, 1)
    return own, np.minimum(bend, HEAVIEST * np.median(bend))


def _drift(left: np.ndarray, places: np.ndarray, reach: float) -> _Path:
    """A straight line over the log, by the places of stretches; those off by more count less."""
    place, weight = _timing(left, places)
    at = np.arange(len(place)) + 0.5
    near = np.ones(len(at))
    for _ in range(10):  # Huber's weights (1964)
        slope, begin = np.polyfit(at, place, 1, w=np.sqrt(weight * near))
        off = np.abs(place - begin - slope * at)
        near = np.minimum(1.0, reach / np.maximum(off, 1e-9))
    line = np.clip(begin + slope * at, places[0], places[-1])
    ends = (float(begin), float(begin + slope * len(at)))
    return _Path((0, len(at)), ends, float(_value(left, places, line).sum()), 2)


def _drifts_surely(drift: _Path, left: np.ndarray) -> bool:
    """True if shifts of stretches scatter far less about a line than it rises."""
    shift_s, weight = _timing(left, SHIFTS_S)
    line = np.linspace(drift.at_s[0], drift.at_s[-1], len(shift_s))
    weight = weight / max(weight.sum(), 1e-12)
    in_effect = 1 / np.sum(weight**2)
    off = np.clip(shift_s - line, -CHECKS.reach_s, CHECKS.reach_s)
    std_s = np.sqrt(12 * np.sum(weight * off**2) / max(in_effect - 1, 1e-3))
    by_s = abs(drift.at_s[1] - drift.at_s[0])
    least_s = max(CHECKS.least_step_s, CHECKS.step_seen * std_s)
    return bool(in_effect > CHECKS.fewest_blocks and by_s > least_s)


def _is_sure(path: _Path, left: np.ndarray) -> bool:
    """True if on both sides of each step hardly any stretch speaks for the shift of the other."""
    parts = [slice(a, b) for a, b in pairwise(path.edges)]
    sides = [(k, k + d) for k in range(len(parts)) for d in (-1, 1) if 0 <= k + d < len(parts)]
    within = SHIFTS_S[1] < min(path.at_s) and max(path.at_s) < SHIFTS_S[-2]
    steps = np.abs(np.diff(path.at_s)) > CHECKS.least_step_s
    return bool(
        np.all(steps)
        and (within or not sides)
        and all(_holds(left[:, parts[k]], path.at_s[k], path.at_s[other]) for k, other in sides)
    )


def _holds(left: np.ndarray, own_s: float, other_s: float) -> bool:
    """True if stretches (S, B) favour one shift over another, and not one of them alone."""
    gained = _value(left, SHIFTS_S, other_s) - _value(left, SHIFTS_S, own_s)
    speak = np.maximum(gained, 0)
    against = float(np.maximum(-gained, 0).sum())
    return bool(
        np.count_nonzero(speak > CHECKS.speaks) >= CHECKS.speakers
        and against < CHECKS.against * speak.sum()
        and speak.max() < CHECKS.alone * speak.sum()
    )


def _of_steps(path: _Path) -> Shape:
    """Classifies steps of lateness by the kind of change."""
    if path.pieces == 2:
        return "step"
    if path.pieces > 3:
        return "changes"
    first, middle, last = path.at_s
    back = abs(last - first) < max(CHECKS.back_share * abs(middle - first), STEP_S / 2)
    return "while" if back else "steps"


def _in_time(path: _Path, shape: Shape, motion: Motion) -> Lateness:
    """A path in the time of its log."""
    begin_s, end_s = (float(t) for t in motion.t_s[[0, -1]])
    first_s = path.at_s[0]
    if path.straight:
        return Lateness(shape, (begin_s, end_s), (0.0, path.at_s[1] - first_s), first_s)
    at, late_s = [begin_s], [0.0]
    for edge, (before_s, after_s) in zip(path.edges[1:-1], pairwise(path.at_s), strict=True):
        step_s = begin_s + motion.block_s * edge
        at += [step_s, step_s + JUST_AFTER_S]
        late_s += [before_s - first_s, after_s - first_s]
    return Lateness(shape, (*at, end_s), (*late_s, late_s[-1]), first_s)
