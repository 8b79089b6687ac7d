# SPDX-License-Identifier: Apache-2.0
"""Metrics over time of a swarm in a log, by the code that the twin uses for its own swarms.

`twin_run` samples and fits the poses that it publishes in the same way (recent_poses.cpp), so that
both say the same of a run.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.camera_frames import frames_of
from twinmill.data.log import Log, LogError, RobotLog
from twinmill.data.world_bodies import WorldBody

STEP_S = 0.05
SMOOTH = 9  # steps of the window in which velocities are fitted
LONGEST_GAP_S = 0.3  # without a valid pose
WINDOW_S = 10.0  # of the class
SHOWN = 5  # standard errors of a velocity from which on it tells which way the robot goes
STILL_RADPS = 0.03  # below this a measured turn is noise: the robot goes straight


@dataclass(frozen=True)
class SwarmSeries:
    """Metrics over time.

    Attributes:
        robots: ids, the ring's first.
        odd: ids of those that do not make the ring.
        t_s: (T,) since the log's t0; times at which all robots have poses.
        pose: (T, n, 3) x_m, y_m, theta_rad.
        values: (T, metrics) in the order of twinmill_native.METRICS.
        classes: (T,) of the mean of the last 10 s at each time; needs half of them.
        mean: (metrics,) over the last 10 s.
        final: class of that mean.
        bits: by robot whose camera was recorded, the share of frames of the last 10 s in which each
            of its bits was set.
        bodies: of the twin's world; they obey nobody, and no metric counts them.
    """

    robots: list[int]
    odd: list[int]
    t_s: np.ndarray
    pose: np.ndarray
    values: np.ndarray
    classes: list[str]
    mean: np.ndarray
    final: str
    bits: dict[int, list[float]]
    bodies: list[WorldBody]

    def to_json(self) -> dict[str, Any]:
        """Everything but the poses."""
        names = native.METRICS
        return {
            "class": self.final,
            "metrics": dict(zip(names, self.mean.tolist(), strict=True)),
            "robots": self.robots,
            "odd": self.odd,
            "bits": self.bits,
            "bodies": [body.name for body in self.bodies],
            "t_s": np.round(self.t_s, 3).tolist(),
            "series": {name: self.values[:, k].tolist() for k, name in enumerate(names)},
            "classes": self.classes,
        }


def swarm_metrics(
    log: Log, range_m: float, body_radius_m: float, odd: list[int] | None = None
) -> SwarmSeries:
    """Metrics of all robots of a log that have poses.

    Velocities come from the poses, so real robots and the twin's are treated alike. Robots that
    name another behaviour than most are odd, unless `odd` names them.

    Raises:
        LogError: there are not two robots with poses at the same time, or `odd` is not in the log.
    """
    robots = {i: robot for i, robot in log.robots.items() if robot.valid.sum() > SMOOTH}
    if len(robots) < 2:
        had = "one robot" if robots else "no robot"
        raise LogError(f"{log.path.name}: has poses of {had}; a swarm needs two.")
    odd = _odd(robots) if odd is None else odd
    strange = set(odd) - set(robots)
    if strange or len(odd) == len(robots):
        raise LogError(
            f"{log.path.name}: odd robots {sorted(odd)} cannot be: the log has poses of "
            f"{sorted(robots)}, and some must be left for the ring."
        )
    order = sorted(set(robots) - set(odd)) + sorted(odd)
    t_s = _times(robots)
    columns = [resample(robots[i], t_s) for i in order]
    pose, velocity = (np.stack(part, axis=1) for part in zip(*columns, strict=True))
    whole = np.isfinite(pose).all(axis=(1, 2)) & np.isfinite(velocity).all(axis=(1, 2))
    if not whole.any():
        raise LogError(f"{log.path.name}: at no time do all robots have poses.")
    t_s, pose, velocity = t_s[whole], pose[whole], velocity[whole]
    values = native.measure(
        np.ascontiguousarray(pose),
        np.ascontiguousarray(velocity),
        len(order) - len(odd),
        range_m,
        body_radius_m,
    )
    means = _moving_mean(t_s, values)
    classes = native.classify(np.ascontiguousarray(means))
    return SwarmSeries(
        robots=order,
        odd=sorted(odd),
        t_s=t_s,
        pose=pose,
        values=values,
        classes=classes,
        mean=means[-1],
        final=classes[-1],
        bits=_bits({i: robots[i] for i in order}, t_s[-1] - WINDOW_S),
        bodies=log.bodies,
    )


def _bits(robots: dict[int, RobotLog], since_s: float) -> dict[int, list[float]]:
    """As many of each robot as any of them set at any time."""
    found = {}
    for i, robot in robots.items():
        frames = frames_of(robot)
        if frames is not None and (late := frames.t_s >= since_s).any():
            found[i] = frames.told[late].mean(axis=0).tolist()
    count = max(map(len, found.values()), default=0)
    return {i: shares + [0.0] * (count - len(shares)) for i, shares in found.items()}


def _odd(robots: dict[int, RobotLog]) -> list[int]:
    names = [robots[i].behavior for i in sorted(robots) if robots[i].behavior]
    usual = max(names, key=names.count, default="")  # of equally many the first
    return [i for i, robot in robots.items() if robot.behavior not in ("", usual)]


def _times(robots: dict[int, RobotLog]) -> np.ndarray:
    first = max(robot.pose_t_s[robot.valid][0] for robot in robots.values())
    last = min(robot.pose_t_s[robot.valid][-1] for robot in robots.values())
    if last - first < SMOOTH * STEP_S:
        raise LogError("the robots' poses overlap for less than half a second: no swarm to see.")
    return np.arange(first, last, STEP_S)


def resample(robot: RobotLog, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 3) poses and (T, 3) body velocities; NaN in gaps.

    Of a robot whose positions alone were recorded the way of its path stands for its heading.
    """
    known_t_s, known = robot.pose_t_s[robot.valid], robot.pose[robot.valid]
    pose = np.column_stack([np.interp(t_s, known_t_s, known[:, k]) for k in range(3)])
    if not robot.has_heading:
        pose[:, 2] = _way_rad(pose[:, :2])
    velocity = body_velocity(pose)
    after = np.clip(np.searchsorted(known_t_s, t_s), 1, len(known_t_s) - 1)
    pose[known_t_s[after] - known_t_s[after - 1] > LONGEST_GAP_S] = np.nan
    return pose, velocity


def _way_rad(place_m: np.ndarray) -> np.ndarray:
    """(T,) direction of a path (T, 2) STEP_S apart; between times that tell it, in a line."""
    rate = _rate(place_m)
    offsets = np.arange(SMOOTH) - SMOOTH // 2
    noise_m = np.median(np.abs(np.diff(place_m, n=2, axis=0))) / 0.6745 / np.sqrt(6)
    error_mps = noise_m / STEP_S / np.sqrt(np.sum(offsets**2))  # of a slope by least squares
    told = np.flatnonzero(np.hypot(*rate.T) > SHOWN * error_mps)
    if not len(told):
        return np.zeros(len(place_m))
    way_rad = np.unwrap(np.arctan2(rate[told, 1], rate[told, 0]))
    return np.interp(np.arange(len(place_m)), told, way_rad)


def body_velocity(pose: np.ndarray) -> np.ndarray:
    """(T, ..., 3) forward, left, turn in m/s and rad/s, of poses STEP_S apart, angles unwrapped."""
    rate = _rate(pose)
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    omega = np.where(np.abs(rate[..., 2]) < STILL_RADPS, 0.0, rate[..., 2])
    ahead, left = c * rate[..., 0] + s * rate[..., 1], c * rate[..., 1] - s * rate[..., 0]
    return np.stack([ahead, left, omega], axis=-1)


def _rate(values: np.ndarray) -> np.ndarray:
    """Derivative over time of values STEP_S apart, by parabolas."""
    from scipy.signal import savgol_filter  # most commands judge no swarm

    return savgol_filter(values, SMOOTH, 2, deriv=1, delta=STEP_S, axis=0)


def _moving_mean(t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(T, metrics) mean over the last 10 s; NaN, so undefined, in the first half of that."""
    first = np.searchsorted(t_s, t_s - WINDOW_S + STEP_S / 2)  # whatever the times' last digits
    means = np.array([values[f : k + 1].mean(axis=0) for k, f in enumerate(first)])
    short = t_s - t_s[0] < min(WINDOW_S, t_s[-1] - t_s[0]) / 2
    means[short] = np.nan
    return means
