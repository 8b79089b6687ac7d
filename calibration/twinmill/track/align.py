# SPDX-License-Identifier: Apache-2.0
"""When a film began on the commands' clock: where robots move when they are told to.

A start value for the estimate of the clocks' offset, which needs it within some tenths of a second.
"""

import numpy as np
from scipy.signal import correlate

from twinmill.arguments import option
from twinmill.data.importers.series import CommandSeries
from twinmill.track.paths import RobotPath

STEP_S = 0.02
LEVER_M = 0.1  # weighs turning (rad/s) against moving (m/s)
SMOOTH_S = 0.1
OVERLAP = 0.5  # of the shorter: less fits by chance
LIKE = 0.5
SECOND, NEAR_S = 0.9, 0.5  # another place that fits nearly as well, this far away


def align(paths: list[RobotPath], commands: list[CommandSeries]) -> float:
    """Seconds to add to the film's stamps, to about 0.1 s, by correlation of who moves when.

    Raises:
        ValueError: no robot has both, or no place fits, or two do.
    """
    by_robot = {series.robot_id: series for series in commands}
    pairs = [(path, by_robot[path.robot_id]) for path in paths if path.robot_id in by_robot]
    if not pairs:
        raise ValueError(
            f"{option('commands')}: are of robots "
            f"{', '.join(map(str, sorted(by_robot)))}, the film shows "
            f"{', '.join(str(path.robot_id) for path in paths)}; none is in both."
        )
    film_s = min(path.t_s[0] for path, _ in pairs)
    table_s = min(series.utime_us[0] for _, series in pairs) / 1e6
    likeness, shifts = _likeness(pairs, film_s, table_s)
    best = int(np.argmax(likeness))
    far = np.abs(shifts - shifts[best]) > NEAR_S
    second = likeness[far].max(initial=-1.0)
    if likeness[best] < LIKE or second > SECOND * likeness[best]:
        raise ValueError(
            f"{option('commands')}: where the film begins in them cannot be found (likeness "
            f"{likeness[best]:.2f}, elsewhere {second:.2f}); give {option('start_s')}, or drive "
            "with stops "
            "of different lengths."
        )
    return float(shifts[best] + table_s - film_s)


def _likeness(
    pairs: list[tuple[RobotPath, CommandSeries]], film_s: float, table_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """(K,) correlations and (K,) s, the film's start after the table's."""
    moved = [_motion(path, film_s) for path, _ in pairs]
    told = [_orders(series, table_s) for _, series in pairs]
    total, power_a, power_b = 0.0, 0.0, 0.0
    length, others = (max(map(len, rows)) for rows in (moved, told))
    for a, b in zip(moved, told, strict=True):
        a, known_a = _centred(a, length)
        b, known_b = _centred(b, others)
        total = total + correlate(b, a, "full", "fft")
        power_a = power_a + correlate(known_b, a**2, "full", "fft")
        power_b = power_b + correlate(b**2, known_a, "full", "fft")
    overlap = correlate(np.ones(others), np.ones(length), "full", "fft")
    with np.errstate(divide="ignore", invalid="ignore"):
        likeness = total / np.sqrt(np.maximum(power_a, 0) * np.maximum(power_b, 0))
    enough = overlap >= OVERLAP * min(length, others)
    likeness = np.where(enough & np.isfinite(likeness), likeness, -1.0)
    return likeness, (np.arange(len(likeness)) - (length - 1)) * STEP_S


def _centred(values: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Values about their mean, and where they are known, both filled up with zeros."""
    known = np.isfinite(values)
    middle = values[known].mean() if known.any() else 0.0
    fill = length - len(values)
    return (
        np.pad(np.where(known, values - middle, 0.0), (0, fill)),
        np.pad(known.astype(float), (0, fill)),
    )


def _motion(path: RobotPath, start_s: float) -> np.ndarray:
    """How fast it moves, on the grid; NaN where it was not seen for long."""
    good = path.valid
    grid_s = np.arange(start_s, path.t_s[-1], STEP_S)
    if np.count_nonzero(good) < 3:
        return np.full(len(grid_s), np.nan)
    straight = np.column_stack([path.pose[good, :2], np.unwrap(path.pose[good, 2]) * LEVER_M])
    t_s = path.t_s[good]
    ahead = np.column_stack([np.interp(grid_s + SMOOTH_S, t_s, c) for c in straight.T])
    behind = np.column_stack([np.interp(grid_s - SMOOTH_S, t_s, c) for c in straight.T])
    return np.linalg.norm(ahead - behind, axis=1) / (2 * SMOOTH_S)


def _orders(series: CommandSeries, start_s: float) -> np.ndarray:
    """How much is asked of it, on the grid; in m/s where velocities are told."""
    t_s = series.utime_us / 1e6 - start_s
    grid_s = np.arange(0, max(t_s[-1], STEP_S), STEP_S)
    row = np.searchsorted(t_s, grid_s, side="right") - 1
    turn = LEVER_M if series.kind == "twist" else 1.0
    size = np.linalg.norm(series.value * [1.0, 1.0, turn, 1.0], axis=1)
    return np.where(row >= 0, size[np.maximum(row, 0)], 0.0)
