# SPDX-License-Identifier: Apache-2.0
"""The heading of a robot of which positions alone were recorded, where its path shows it.

A robot that is told to drive ahead, or straight to a side, and has followed for a while moves along
one of its axes: the heading is the way of its path, less that axis. It stays the same over starts,
stops and ways back on a straight line.
"""

from dataclasses import dataclass, replace

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.series import CommandSeries, PoseSeries, quaternion_from_heading
from twinmill.data.log import LogError
from twinmill.data.track import local_line

AXIS = 0.05  # share of the other axis that a command along one may have
SETTLED_S, BEFORE_S = 0.6, 0.25  # after a command and before the next: lags, and two clocks
AROUND_S = 0.15  # over which the path's way is taken
SLOWEST_MPS = 0.03  # below it noise is the way
TOLD_S = 0.3  # of path that tells the heading beside a gap
STRAIGHT_RAD = 0.1  # change of heading over a gap of a straight line
FEWEST = 0.2  # share of the poses
STILL = 1e-6  # by which a quaternion changes at most that nobody measured


@dataclass(frozen=True)
class _CommandedMotion:
    """Motion that the commands ask for.

    Attributes:
        axes: beginning and end in s, and the complex unit along which the body is to move; 0 for
            none.
        turns: (K, 2) s, from when to when it is to turn.
    """

    axes: list[tuple[float, float, complex]]
    turns: np.ndarray


def with_path_heading(poses: PoseSeries, commands: CommandSeries) -> PoseSeries:
    """The poses with headings; those whose heading the path does not show are not valid.

    Raises:
        LogError: the heading was measured, three wheels tell no axes, or little shows it.
    """
    who = f"robot {poses.robot_id}"
    recorded = poses.orientation_wxyz[np.isfinite(poses.orientation_wxyz).all(axis=1)]
    if len(recorded) and np.ptp(recorded, axis=0).max() > STILL:
        raise LogError(
            f"{option('heading_from_path', True)}: {who} has headings; leave the option out."
        )
    t_s = poses.utime_us * 1e-6
    heading_rad, told = np.full(len(t_s), np.nan), _told(commands, t_s[-1], who)
    way = _way_mps(t_s, poses)
    stretches = []
    for begin_s, end_s, axis in told.axes:
        inside = (t_s >= begin_s + SETTLED_S) & (t_s <= end_s - BEFORE_S)
        rows = np.flatnonzero(inside & (np.abs(way) > SLOWEST_MPS) & (axis != 0))
        heading_rad[rows] = np.angle(way[rows] / axis)
        stretches += [rows] if len(rows) else []
    _fill_straights(t_s, heading_rad, stretches, told)
    known = np.isfinite(heading_rad) & poses.valid
    if known.mean() < FEWEST:
        raise LogError(
            f"{option('heading_from_path', True)}: the path shows the heading of {who} in "
            f"{100 * known.mean():.0f} "
            "% of the poses; drive ahead for two seconds at a time, or record the heading."
        )
    note = (
        f"{who}: the heading is that of its path in {100 * known.mean():.0f} % of the poses, if "
        "the tracked point is the middle between the wheels; turns on the spot and beginnings of "
        "curves are left out, and what only turns the motion in the body is not seen "
        "(heading_bias, marker_offset, lateral_slip)."
    )
    return replace(
        poses,
        position_m=np.where(known[:, None], poses.position_m, np.nan),
        orientation_wxyz=quaternion_from_heading(np.where(known, heading_rad, np.nan)),
        valid=known,
        warnings=[*poses.warnings, note],
    )


def _told(commands: CommandSeries, last_s: float, who: str) -> _CommandedMotion:
    """By the commands, each held until the next."""
    value = commands.value
    if commands.kind == "twist":
        body = value[:, 0] + 1j * value[:, 1]
        turn = value[:, 2]
    elif commands.kind == "wheel_speed" and not value[:, 3].any():
        raise LogError(
            f"{option('heading_from_path', True)}: {who} has three wheels, whose commands tell no "
            "axis without a "
            "model; record the heading."
        )
    else:  # front left, front right, rear left, rear right
        body = value @ (np.array([1, 1, 1, 1]) + 1j * np.array([-1, 1, 1, -1])) / 4
        turn = value @ np.array([-1, 1, -1, 1]) / 4
    axis = np.zeros(len(body), complex)
    ahead, aside = np.abs(body.real), np.abs(body.imag)
    moves = np.maximum(ahead, aside) > 1e-3 * max(np.abs(body).max(), 1e-9)
    axis[moves & (aside <= AXIS * ahead)] = 1
    axis[moves & (ahead <= AXIS * aside)] = 1j
    axis *= np.where(np.where(axis == 1, body.real, body.imag) < 0, -1, 1)
    turns = np.abs(turn) > 1e-3 * max(np.abs(turn).max(), 1e-9)
    begin_s = commands.utime_us * 1e-6
    end_s = np.append(begin_s[1:], max(last_s, begin_s[-1]) + BEFORE_S)
    first = np.flatnonzero(np.append(True, np.diff(axis) != 0))
    last = np.append(first[1:], len(axis)) - 1
    return _CommandedMotion(
        list(zip(begin_s[first], end_s[last], axis[first], strict=True)),
        np.column_stack([begin_s, end_s])[turns],
    )


def _way_mps(t_s: np.ndarray, poses: PoseSeries) -> np.ndarray:
    """(N,) complex velocity in W; NaN where a pose is lost."""
    segment = np.where(poses.valid, 0, -1)
    place = np.where(poses.valid[:, None], poses.position_m, 0.0)
    _, slope = local_line(t_s, place, segment, AROUND_S)
    return slope[:, 0] + 1j * slope[:, 1]


def _fill_straights(
    t_s: np.ndarray, heading_rad: np.ndarray, stretches: list[np.ndarray], told: _CommandedMotion
) -> None:
    """Puts the heading into gaps in which the robot was not told to turn."""
    for before, after in zip([None, *stretches], [*stretches, None], strict=True):
        if before is None and after is None:
            return
        gap = slice(0 if before is None else before[-1] + 1, None if after is None else after[0])
        begin_s = -np.inf if before is None else t_s[before[-1]]
        end_s = np.inf if after is None else t_s[after[0]]
        if np.any((told.turns[:, 0] < end_s) & (told.turns[:, 1] + SETTLED_S > begin_s)):
            continue
        ends = [
            _mean_rad(heading_rad[rows[np.abs(t_s[rows] - t_s[rows[k]]) <= TOLD_S]])
            for rows, k in ((before, -1), (after, 0))
            if rows is not None
        ]
        turned = np.angle(np.exp(1j * (ends[-1] - ends[0])))
        if abs(turned) < STRAIGHT_RAD:
            share = (t_s[gap] - begin_s) / (end_s - begin_s) if len(ends) > 1 else 0.0
            heading_rad[gap] = ends[0] + turned * share


def _mean_rad(angles_rad: np.ndarray) -> float:
    return float(np.angle(np.exp(1j * angles_rad).mean()))
