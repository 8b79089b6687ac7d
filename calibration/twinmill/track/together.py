# SPDX-License-Identifier: Apache-2.0
"""Several films of one floor as one: their clocks, from robots that two cameras see at once."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from twinmill.arguments import option
from twinmill.track.paths import RobotPath

STEP_S = 0.05  # of the search; a robot moves little meanwhile
OVERLAP_S = 2.0  # in which both see a robot
MOVES_M = 0.1  # so much at least, or the clocks cannot be aligned
LEVER_M = 0.1  # weighs turning against moving
FARTHEST_M, FARTHEST_RAD = 0.05, 0.1  # that two cameras may be apart on one floor
NEAR_S, SECOND = 0.5, 1.5  # another shift that fits nearly as well, this far away
HOLD_S = 0.1  # as long as a camera may lose its robot before another takes it

Paths = list[RobotPath]


@dataclass(frozen=True)
class Pair:
    """Two cameras where both see a robot.

    Attributes:
        shift_s: added to the second film's stamps.
        apart_m, apart_rad: RMS differences of the poses, its systematic part too.
        overlap_s: for how long.
    """

    shift_s: float
    apart_m: float
    apart_rad: float
    overlap_s: float


def clocks(films: list[Paths], names: list[str]) -> list[Pair | None]:
    """Shift of each film to the clock of the first, for which it is None.

    A film is compared with all that are placed already: neighbours overlap, not all with all.

    Raises:
        ValueError: a film overlaps with none, or where it does, nothing moves.
    """
    found: dict[int, Pair | None] = {0: None}
    placed = list(films[0])
    while len(found) < len(films):
        pairs = {k: _pair(placed, films[k]) for k in range(len(films)) if k not in found}
        k = next((k for k, pair in pairs.items() if pair), None)
        if k is None:
            raise ValueError(
                f"{names[next(iter(pairs))]}: when it began cannot be found from the other films: "
                f"no robot moves where two cameras see it at once; give {option('start_s')} for "
                "each film."
            )
        found[k] = pairs[k]
        placed += on_clock(films[k], pairs[k].shift_s)
    return [found[k] for k in range(len(films))]


def compared(a: Paths, b: Paths) -> Pair | None:
    """Two films on one clock."""
    return _apart(a, b, 0.0)


def on_clock(paths: Paths, shift_s: float) -> Paths:
    """Paths on another clock."""
    return [replace(path, t_s=path.t_s + shift_s) for path in paths]


def merged(films: list[Paths]) -> Paths:
    """Each robot once, as the camera saw it that follows it; another takes it when that loses it.

    Args:
        films: on one clock.
    """
    robots = sorted({path.robot_id for paths in films for path in paths})
    return [_one([p for paths in films for p in paths if p.robot_id == n]) for n in robots]


def _one(parts: Paths) -> RobotPath:
    camera = np.repeat(np.arange(len(parts)), [len(p.t_s) for p in parts])
    t_s, pose, error_px, scale = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("t_s", "pose", "error_px", "scale_px_per_m")
    )
    order = np.argsort(t_s, kind="stable")
    valid = np.isfinite(pose[:, 0])
    kept, holder, seen_s = [], int(camera[order[0]]), -np.inf
    for row in order:
        if camera[row] != holder and valid[row] and t_s[row] - seen_s > HOLD_S:
            holder = int(camera[row])
        if camera[row] == holder and (not kept or t_s[row] > t_s[kept[-1]]):
            kept.append(int(row))
            seen_s = t_s[row] if valid[row] else seen_s
    odd = sum(p.odd for p in parts)
    first = parts[0].robot_id
    return RobotPath(first, t_s[kept], pose[kept], error_px[kept], scale[kept], odd)


def _pair(a: Paths, b: Paths) -> Pair | None:
    """The shift of `b` by which robots that both see are at the same places; None if it is open."""
    first_s = min(p.t_s[0] for p in a) - max(p.t_s[-1] for p in b)
    last_s = max(p.t_s[-1] for p in a) - min(p.t_s[0] for p in b)
    shifts = np.arange(first_s, last_s, STEP_S)
    misses = np.array([_miss_m(a, b, shift) for shift in shifts])
    if not np.isfinite(misses).any():
        return None
    misses = np.where(np.isfinite(misses), misses, np.inf)
    best = int(np.argmin(misses))
    second_m = misses[np.abs(shifts - shifts[best]) > NEAR_S].min(initial=np.inf)
    fine = minimize_scalar(
        lambda shift: _miss_m(a, b, shift),
        bounds=(shifts[best] - STEP_S, shifts[best] + STEP_S),
        method="bounded",
        options={"xatol": 1e-5},
    )
    if not second_m > SECOND * fine.fun:
        return None
    return _apart(a, b, float(fine.x))


def _miss_m(a: Paths, b: Paths, shift_s: float) -> float:
    """RMS of the differences about their mean: what is off alike at all times is no matter of time.

    NaN where both see no robot for OVERLAP_S while it moves, or see it at different places.
    """
    total, count, moved_m = 0.0, 0, 0.0
    for difference, way_m in _differences(a, b, shift_s):
        middle = difference.mean(axis=0)
        if np.hypot(*middle[:2]) > FARTHEST_M or abs(middle[2]) > FARTHEST_RAD:
            return np.nan
        total += np.sum(((difference - middle) * [1, 1, LEVER_M]) ** 2)
        count += len(difference)
        moved_m += way_m
    enough = count and moved_m > MOVES_M
    return float(np.sqrt(total / count)) if enough else np.nan


def _apart(a: Paths, b: Paths, shift_s: float) -> Pair | None:
    both = [difference for difference, _ in _differences(a, b, shift_s)]
    if not both:
        return None
    rows = np.concatenate(both)
    step_s = float(np.median(np.concatenate([np.diff(p.t_s) for p in b])))
    return Pair(
        shift_s,
        float(np.sqrt(np.mean(np.sum(rows[:, :2] ** 2, axis=1)))),
        float(np.sqrt(np.mean(rows[:, 2] ** 2))),
        step_s * len(rows),
    )


def _differences(a: Paths, b: Paths, shift_s: float):
    """(N, 3) m, m, rad and way in m, of each pair of a robot's paths that overlap for long."""
    for one in a:
        good = one.valid
        for other in b:
            if other.robot_id != one.robot_id or np.count_nonzero(good) < 2:
                continue
            t_s, pose = other.t_s[other.valid] + shift_s, other.pose[other.valid]
            there = one.t_s[good]
            inside = (t_s >= there[0]) & (t_s <= there[-1])
            after = np.clip(np.searchsorted(there, t_s), 1, len(there) - 1)
            inside &= there[after] - there[after - 1] < HOLD_S
            if np.count_nonzero(inside) < 2 or np.ptp(t_s[inside]) < OVERLAP_S:
                continue
            turned = np.unwrap(one.pose[good, 2])
            straight = np.column_stack([one.pose[good, :2], turned])
            at = np.column_stack([np.interp(t_s[inside], there, c) for c in straight.T])
            difference = at - pose[inside]
            difference[:, 2] = np.angle(np.exp(1j * difference[:, 2]))
            way_m = float(np.linalg.norm(np.diff(pose[inside, :2], axis=0), axis=1).sum())
            yield difference, way_m
