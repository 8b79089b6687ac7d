# SPDX-License-Identifier: Apache-2.0
"""Robots whose rigid bodies a tracker exchanges within a log: each goes on as the other.

All of them jump in one frame, each to where another one was; no two robots are in one place, so
that this is certain. Each body is given the name that it has for the longest time.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from twinmill.data.checks.finding import InputFinding
from twinmill.data.cuts import USUAL_MPS, USUAL_RADPS, Limits, longest_gap_s
from twinmill.data.log import RobotLog

OF_POSES = ("pose_t_s", "pose", "z_m", "valid")
Stretch = tuple[int, int, float, float]  # name, body, capture's clock from and to


@dataclass(frozen=True)
class _Jump:
    """One robot's step from one valid pose to the next that no robot makes."""

    robot_id: int
    t_s: tuple[float, float]
    pose: np.ndarray  # (2, 3)
    limits: Limits

    def apart_m(self, other: "_Jump") -> float:
        """From where it lands to where the other one was; infinite where none goes that far."""
        step = (self.pose[1] - other.pose[0])[None]
        far = self.limits.far(np.array([abs(self.t_s[1] - other.t_s[0])]), step)[0]
        return np.inf if far else float(np.hypot(*step[0, :2]))


@dataclass(frozen=True)
class _Exchange:
    """Each of some robots takes the name of another one.

    Attributes:
        at_s: between their poses, capture's clock.
        was: the name, before, of the body that has each name afterwards.
        within_m: of where it was.
    """

    at_s: float
    was: Mapping[int, int]
    within_m: float


def give_back(
    robots: Mapping[int, RobotLog], label: str
) -> tuple[dict[int, RobotLog], list[InputFinding]]:
    """Robots with the poses of their own bodies, and what was exchanged; as they are if nothing."""
    exchanges = _exchanges(robots)
    if not exchanges:
        return dict(robots), []
    starts_s = dict.fromkeys(robots, -np.inf)
    shown = {name: name for name in robots}  # body by name
    stretches: list[Stretch] = []
    for exchange in exchanges:
        for name in exchange.was:
            stretches.append((name, shown[name], starts_s[name], exchange.at_s))
            starts_s[name] = exchange.at_s
        shown = {**shown, **{name: shown[was] for name, was in exchange.was.items()}}
    stretches += [(name, shown[name], starts_s[name], np.inf) for name in robots]
    owner = _owners(robots, stretches)
    given = {}
    for name, robot in robots.items():
        own = [row for row in stretches if owner[row[1]] == name]
        given[name] = _joined(robot, [_part(robots[n], a, b) for n, _, a, b in own])
    within_m = max(e.within_m for e in exchanges)
    wrong = [(name, owner[body], a, b) for name, body, a, b in stretches if owner[body] != name]
    return given, _told(robots, wrong, within_m, label)


def _exchanges(robots: Mapping[int, RobotLog]) -> list[_Exchange]:
    """In their order."""
    if len(robots) < 2:
        return []
    jumps = sorted((j for r in robots.values() for j in _jumps(r)), key=lambda j: j.t_s)
    found: list[_Exchange] = []
    for k, first in enumerate(jumps):
        if found and found[-1].at_s > first.t_s[0]:
            continue
        group = {j.robot_id: j for j in jumps[k:] if j.t_s[0] < first.t_s[1]}
        if exchange := _exchange(group):
            found.append(exchange)
    return found


def _exchange(group: Mapping[int, _Jump]) -> _Exchange | None:
    """The exchange of those that jump at one time; None if they land elsewhere."""
    was, apart_m = {}, []
    for name, jump in group.items():
        others = {n: jump.apart_m(j) for n, j in group.items() if n != name}
        nearest = min(others, key=lambda n: others[n], default=None)
        if nearest is not None and np.isfinite(others[nearest]):
            was[name] = nearest
            apart_m.append(others[nearest])
    if not was or set(was) != set(was.values()):
        return None
    begin_s, end_s = np.array([group[name].t_s for name in was]).T
    return _Exchange((begin_s.max() + end_s.min()) / 2, was, max(apart_m))


def _jumps(robot: RobotLog) -> list[_Jump]:
    if np.count_nonzero(robot.valid) < 2:
        return []
    limits = Limits.of(robot, robot.valid, USUAL_MPS, USUAL_RADPS)
    t_s, pose = robot.pose_t_s[robot.valid], robot.pose[robot.valid]
    dt_s = np.diff(t_s)
    far = limits.far(dt_s, np.diff(pose, axis=0)) & (dt_s <= longest_gap_s(robot))
    return [
        _Jump(robot.robot_id, (float(t_s[k]), float(t_s[k + 1])), pose[k : k + 2], limits)
        for k in np.flatnonzero(far)
    ]


def _owners(robots: Mapping[int, RobotLog], stretches: list[Stretch]) -> dict[int, int]:
    """Name of each body: that which it has in most of its poses, by the body's first name."""
    from scipy.optimize import linear_sum_assignment  # few logs get here

    names = list(robots)
    count = np.eye(len(names)) / 2  # of as many, the first
    for name, body, begin_s, end_s in stretches:
        t_s = robots[name].pose_t_s
        count[names.index(body), names.index(name)] += np.sum((t_s > begin_s) & (t_s <= end_s))
    bodies, owners = linear_sum_assignment(-count)
    return {names[b]: names[o] for b, o in zip(bodies, owners, strict=True)}


def _part(robot: RobotLog, begin_s: float, end_s: float) -> dict[str, np.ndarray]:
    """Poses of a stretch of time."""
    within = (robot.pose_t_s > begin_s) & (robot.pose_t_s <= end_s)
    return {name: getattr(robot, name)[within] for name in OF_POSES}


def _joined(robot: RobotLog, parts: list[dict[str, np.ndarray]]) -> RobotLog:
    """The robot with these poses."""
    order = np.argsort(np.concatenate([part["pose_t_s"] for part in parts]), kind="stable")
    pose_t_s, pose, z_m, valid = (
        np.concatenate([part[name] for part in parts])[order] for name in OF_POSES
    )
    return replace(robot, pose_t_s=pose_t_s, pose=pose, z_m=z_m, valid=valid)


def _told(
    robots: Mapping[int, RobotLog], wrong: list[Stretch], within_m: float, label: str
) -> list[InputFinding]:
    """One finding on each two or more robots and each time."""
    first_s = min(robot.pose_t_s[0] for robot in robots.values())
    last_s = max(robot.pose_t_s[-1] for robot in robots.values())
    by_time: dict[tuple[float, float], list[Stretch]] = {}
    for row in wrong:
        by_time.setdefault(row[2:], []).append(row)
    found = []
    for (begin_s, end_s), rows in sorted(by_time.items()):
        names = [f"R{name:02d}" for name in sorted({n for row in rows for n in row[:2]})]
        who = f"{', '.join(names[:-1])} and {names[-1]}"
        found.append(
            InputFinding(
                f"{who} have each other's poses from "
                f"{max(begin_s, first_s):.1f} to {min(end_s, last_s):.1f} s",
                "they jump in one frame, each to where another one was, to "
                f"{1000 * within_m:.0f} mm",
                "they are judged with their own; give the tracker's bodies markers that are less "
                "alike",
                False,
                label,
            )
        )
    return found
