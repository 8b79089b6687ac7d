# SPDX-License-Identifier: Apache-2.0
"""Time base of measured wheel speeds: how long a second of the log really lasted.

Rows of an encoder log are often stamped by counting them, and a row then lasts longer than it says,
by another factor in turns than on straights if the loop has more to do there. The robot's clock is
found as capture time = offset + integral of (straight + (turning - straight) share) over the log's
time; `share` is 0 on straights and 1 in turns on the spot. As in `clock.py`, velocities are
regressed on the commands, so that neither the wheels nor their geometry need be known.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinmill.data.log import RobotLog

SMOOTH_S = 0.15
GRID_S, COARSE_S = 0.02, 0.1
RATES = np.arange(0.8, 1.25, 0.01)  # seconds of capture in one of the log
OFFSETS_S = 0.25  # step of the coarse search
OWN_OFFSETS_S = np.arange(-0.3, 0.31, 0.02)  # of a log whose stamps are times
FAR_OFFSETS_S = np.arange(-12.0, 12.1, OFFSETS_S)  # and of one that was begun at another time
PARTS = 60  # of a log, between which its offset may change
LEVER_M = 0.1  # weighs turning (rad/s) against moving (m/s), as in clock.py
CREEP_MPS = 0.005
CRYSTAL = 0.002  # no clock that counts time is off by so much
SINGULAR = 1e-6  # of commands that always come together
WORTH = 0.7  # times what stays unexplained otherwise: less is not worth a new time base
LEAST_EXPLAINED = 0.8


@dataclass(frozen=True)
class TimeBase:
    """Length of the log's second in seconds of capture, and the log's begin.

    `explained` is the share of the motion that the commands explain with it.
    """

    offset_s: float
    straight: float
    turning: float
    explained: float

    def to_json(self) -> dict:
        """Fields of JSON output."""
        return vars(self)

    def __str__(self) -> str:
        return (
            f"a second of its clock lasted {self.straight:.3f} s on straights and "
            f"{self.turning:.3f} s in turns by capture's clock"
        )


def find_time_base(robot: RobotLog) -> TimeBase | None:
    """The time base of measured wheel speeds; None if the log's own will do, or nothing tells.

    A robot that follows later from some time on has a time base that suits it, too: one of
    `checks/clocks.py` then tells the step, if that explains more.
    """
    if robot.same_clock:
        return None
    if robot.command_kind != "wheel_speed" or len(robot.command_t_s) < 100:
        return None
    if np.count_nonzero(robot.valid) < 100 or not robot.has_heading:
        return None
    problem, coarse = _Regression(robot, GRID_S), _Regression(robot, COARSE_S)
    if not problem.moves:
        return None
    far_s = min(FAR_OFFSETS_S, key=lambda offset_s: coarse.loss((offset_s, 1.0, 1.0)))
    own_s = np.concatenate([OWN_OFFSETS_S, far_s + OWN_OFFSETS_S])
    own = min(problem.loss((offset_s, 1.0, 1.0)) for offset_s in own_s)
    reach_s = coarse.reach_s()
    _, offset_s, rate = min(
        (coarse.loss((offset_s, rate, rate)), offset_s, rate)
        for rate in RATES
        for offset_s in np.arange(-reach_s, reach_s, OFFSETS_S)
    )
    problem.settle((offset_s, rate, rate))
    corners = np.array([(offset_s, rate, rate)] * 4) + np.vstack(
        [np.zeros(3), np.diag([OFFSETS_S, 0.01, -0.03])]
    )
    from scipy.optimize import minimize  # few logs get here

    found = minimize(
        problem.loss, corners[0], method="Nelder-Mead", options={"initial_simplex": corners}
    )
    offset_s, straight, turning = (float(v) for v in found.x)
    usual = max(abs(straight - 1), abs(turning - 1)) < CRYSTAL
    if found.fun > WORTH * own or usual or 1 - found.fun < LEAST_EXPLAINED:
        return None
    if problem.stepped_loss(OWN_OFFSETS_S) < found.fun:
        return None
    return TimeBase(offset_s, straight, turning, 1 - float(found.fun))


def retimed(robot: RobotLog, base: TimeBase) -> RobotLog:
    """The robot with its commands on capture's clock."""
    problem = _Regression(robot, GRID_S)
    problem.settle((base.offset_s, base.straight, base.straight))
    at_grid = problem.time_s((base.offset_s, base.straight, base.turning))
    t_s = robot.command_t_s
    rate = (at_grid[-1] - at_grid[0]) / (problem.grid_s[-1] - problem.grid_s[0])
    stamps = np.interp(t_s, problem.grid_s, at_grid)
    late = np.maximum(t_s - problem.grid_s[-1], 0)
    return replace(robot, command_t_s=stamps + rate * late)


class _Regression:
    """Measured velocities regressed on the commands that a time base puts beside them."""

    def __init__(self, robot: RobotLog, step_s: float):
        t_s = robot.command_t_s
        fine_s = np.arange(t_s[0], t_s[-1], GRID_S)
        every = round(step_s / GRID_S)
        self.step_s, self.grid_s = step_s, fine_s[::every]
        held = np.searchsorted(t_s, fine_s, side="right") - 1
        self.command = _smoothed(robot.command[held])[::every]
        self.pose_s, self.velocity = _velocity(robot)
        self.share = np.zeros(len(self.grid_s))
        self.moves = bool(np.any(self.command)) and bool(np.any(self.velocity))

    def reach_s(self) -> float:
        """How far the log may begin from capture: the longer of both lasts less a quarter."""
        spans = np.ptp(self.grid_s), np.ptp(self.pose_s)
        return float(min(abs(spans[1] - spans[0]) + 2.0, 30.0))

    def time_s(self, base: tuple[float, float, float]) -> np.ndarray:
        """(G,) capture's clock at the grid."""
        passed_s = np.cumsum(np.append(0, self._rate(base)[:-1])) * self.step_s
        return self.grid_s[0] + base[0] + passed_s

    def _rate(self, base: tuple[float, float, float]) -> np.ndarray:
        """(G,) seconds of capture in one of the log."""
        return base[1] + (base[2] - base[1]) * self.share

    def loss(self, base: tuple[float, float, float]) -> float:
        """Share of the motion that stays unexplained."""
        measured = self._measured(base)
        rate = np.maximum(self._rate(base), 0)  # each instant of capture counts alike
        if np.ptp(rate) == 0:  # of one rate in all: thousands are tried
            moment = self.command.T @ measured
            explained = rate[0] * np.sum(moment * (self._inverse @ moment))
        else:
            weighted = self.command * rate[:, None]
            gram, moment = weighted.T @ self.command, weighted.T @ measured
            explained = np.sum(moment * (np.linalg.pinv(gram, rcond=SINGULAR) @ moment))
        share = explained * self.step_s / GRID_S / max(np.sum(self.velocity**2), 1e-12)
        return float(1 - share)

    def stepped_loss(self, offsets_s: np.ndarray) -> float:
        """Loss if the log's own seconds had one offset up to a time, and another from it."""
        edges = np.arange(PARTS) * len(self.grid_s) // PARTS
        moments = np.array(
            [
                np.add.reduceat(self.command[:, :, None] * measured[:, None], edges)
                for measured in (self._measured((offset_s, 1.0, 1.0)) for offset_s in offsets_s)
            ]
        )  # (offsets, PARTS, columns, 3)
        before = np.cumsum(moments, axis=1)
        after = before[:, -1:] - before
        beside = before[:, None, :-1] + after[None, :, :-1]
        explained = np.einsum("abpij,ik,abpkj->abp", beside, self._inverse, beside, optimize=True)
        share = explained.max() * self.step_s / GRID_S / max(np.sum(self.velocity**2), 1e-12)
        return float(1 - share)

    @cached_property
    def _inverse(self) -> np.ndarray:
        return np.linalg.pinv(self.command.T @ self.command, rcond=SINGULAR)

    def settle(self, base: tuple[float, float, float]) -> None:
        """Takes what part of the motion is turning from the regression at this time base."""
        gain = np.linalg.lstsq(self.command, self._measured(base), rcond=1e-3)[0]
        moving, turning = (np.sum((self.command @ gain)[:, k] ** 2, axis=1) for k in ([0, 1], [2]))
        self.share = turning / (turning + moving / 4 + CREEP_MPS**2)

    def _measured(self, base: tuple[float, float, float]) -> np.ndarray:
        """(G, 3) velocities at the grid's times; zero where there is no capture."""
        t_s = self.time_s(base)
        return np.column_stack(
            [np.interp(t_s, self.pose_s, v, left=0.0, right=0.0) for v in self.velocity.T]
        )


def _smoothed(signal: np.ndarray) -> np.ndarray:
    """(K, n) on the grid, averaged over SMOOTH_S; beyond its ends it is mirrored."""
    count = max(1, round(SMOOTH_S / GRID_S))
    around = ((count // 2, (count - 1) // 2), (0, 0))
    total = np.cumsum(np.pad(signal, around, mode="symmetric"), axis=0)
    before = np.vstack([np.zeros_like(total[:1]), total[:-count]])
    return (total[count - 1 :] - before) / count


def _velocity(robot: RobotLog) -> tuple[np.ndarray, np.ndarray]:
    """(K,) s and (K, 3) forward, left, LEVER_M * turning; m/s, smoothed twice; gaps bridged."""
    index = np.flatnonzero(robot.valid)
    t_s = np.arange(robot.pose_t_s[index[0]], robot.pose_t_s[index[-1]], GRID_S)
    pose = np.column_stack(
        [np.interp(t_s, robot.pose_t_s[index], robot.pose[index, k]) for k in range(3)]
    )
    x, y, heading = _smoothed(pose).T
    rate = np.gradient(np.column_stack([x, y, heading]), GRID_S, axis=0)
    c, s = np.cos(heading), np.sin(heading)
    body = np.column_stack(
        [
            c * rate[:, 0] + s * rate[:, 1],
            c * rate[:, 1] - s * rate[:, 0],
            LEVER_M * rate[:, 2],
        ]
    )
    return t_s, _smoothed(body)
