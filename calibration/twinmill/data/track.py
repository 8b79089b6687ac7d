# SPDX-License-Identifier: Apache-2.0
"""Cleans a robot's series for prediction: what is usable, where it rests, how regular it is."""

from dataclasses import dataclass, field

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.cuts import USUAL_MPS, USUAL_RADPS, find_segments
from twinmill.data.log import CommandKind, LogError, RobotLog
from twinmill.data.lost_commands import lost_commands, words

LIFT_M = 0.05  # height above the median that no driving robot has
PLANE_ROUNDS, PLANE_M = 20, 1e-4  # of a plane's fit; nearer than a tracker tells
SILENCE_S = 0.25  # telemetry comes every 22 ms: after this the duties are not known any more
HELD_S, HELDS = 2.0, 3  # a last command holds for this, or so many times the longest before it
STANDING_M = 0.05  # within which a robot that stands is seen
AFTER_S = 0.3  # for which a lag remembers commands that were lost
CLOCK_S = 0.3  # more than any offset between the clocks
FROZEN_S = 0.5  # a pose that keeps its very bits for longer while driven is no measurement
REST_S = 1.5  # coasting ends within 0.5 s; the rest is for lag and clocks
SMOOTH_S = 0.026  # half width of the heading's smoothing: three poses of 120 Hz to each side
ASTRAY_RAD = 0.35  # more than any heading bias: the marker body's axes are turned
ONE_ANGLE = 0.9  # share of the straight way that one angle must lead to where it went
SPIN_RAD = 0.2  # in a quarter of a second: on these wheels alike commands are no way straight ahead


@dataclass(frozen=True)
class Timing:
    """How regular the time base is.

    Attributes:
        pose_period_s, command_period_s: medians.
        pose_lost_share: part of the frames that segments span but that are missing or unusable.
    """

    pose_period_s: float
    command_period_s: float
    pose_lost_share: float


@dataclass(frozen=True)
class Track:
    """One robot's measurement, ready for prediction: M commands, N poses, times as in RobotLog.

    Attributes:
        robot_id: 0..99.
        command_kind, command_t_s, command: (M,), (M, 4) as in RobotLog; each held until the next.
        battery_V: (M,) interpolated where not measured; all NaN if never measured.
        pose_t_s: (N,).
        pose: (N, 3) x_m, y_m, theta_rad; the heading is continuous within a segment.
        segment: (N,) number of the unbroken stretch that a pose belongs to; -1 where unusable.
        heading_smooth: (N,) rad, local straight line over 50 ms; NaN where segment is -1. Only to
            turn vectors; errors of heading use `pose`. Zero where the heading was not recorded:
            the robot is then taken to hold it, and body and world are one frame.
        rest: (K, 2) s, start and end of stretches in which the robot stands, on either clock:
            all commands zero since 1.5 s before, and until 0.3 s after.
        timing: of both series.
        notes: sentences on each cut and on what looks wrong, with times.
        has_heading: false where the heading was not recorded: it is NaN in `pose`, and nothing
            about it can be judged.
        same_clock: the log says that one clock stamped commands and poses.
        telemetry: the robot told its commands at each control step: where it falls silent its
            watchdog stops it. Other commands are held for as long as it takes.
        lost_s: (K, 2) s, stretches without commands where the beat says that some were lost; with
            telemetry (0, 2), since silence has its own rule there.
        astray_rad: by which a robot that is driven straight moves to the left of its heading, where
            that is no bias; else 0.
    """

    robot_id: int
    command_kind: CommandKind
    command_t_s: np.ndarray
    command: np.ndarray
    battery_V: np.ndarray
    pose_t_s: np.ndarray
    pose: np.ndarray
    segment: np.ndarray
    heading_smooth: np.ndarray
    rest: np.ndarray
    timing: Timing
    notes: list[str]
    has_heading: bool = True
    same_clock: bool = False
    telemetry: bool = False
    astray_rad: float = 0.0
    lost_s: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def heading_rad(self) -> np.ndarray:
        """(N,) of `pose`; zero where the heading was not recorded."""
        return self.pose[:, 2] if self.has_heading else np.zeros(len(self.pose))


def make_track(
    robot: RobotLog, usual_mps: float = USUAL_MPS, usual_radps: float = USUAL_RADPS
) -> Track:
    """Cleans one robot's series.

    Args:
        robot: as read from the log.
        usual_mps: no step is a jump below this speed, four times a TurboPi's. Above it a step is
            one where it is far faster than the steps before and after it, as when the robot was
            picked up and put elsewhere: a car that drives at 4 m/s does not jump.
        usual_radps: the same for turning.

    Raises:
        LogError: without commands, or with fewer than two valid poses.
    """
    if not len(robot.command_t_s) or np.count_nonzero(robot.valid) < 2:
        why = f"{np.count_nonzero(robot.valid)} of its {len(robot.pose_t_s)} poses are valid"
        remedy = "record telemetry and motion capture together"
        if not len(robot.command_t_s):
            why = "the log has no commands of it"
            remedy += f", or import anew with what it was told ({option('commands')})"
        raise LogError(f"robot {robot.robot_id}: {why}, so nothing can be predicted; {remedy}.")
    notes: list[str] = []
    lost_s = np.empty((0, 2)) if len(robot.mode) else lost_commands(robot)
    usable = _trackable(robot, lost_s, notes)
    segment = find_segments(robot, usable, (usual_mps, usual_radps), notes)
    pose = continuous(robot.pose, segment)
    rest, astray_rad = _rest(robot, lost_s), 0.0
    _note_frozen(robot, notes)
    if robot.has_heading:
        heading_smooth, _ = local_line(robot.pose_t_s, pose[:, 2], segment, SMOOTH_S)
        astray_rad = _astray_rad(robot, pose, segment)
        if astray_rad:
            back = abs(astray_rad) > np.pi - ASTRAY_RAD
            unless = (
                f", unless all its commands have the wrong sign ({option('flip')}); tags drawn by "
                "AprilTag "
                "stand on their head against OpenCV's (`twinmill track` with "
                f"{option('family', 'tag36h11')})"
            )
            notes.append(
                f"driven ahead, the robot moves {np.degrees(astray_rad):.0f} degrees to the "
                "left of its heading; turn the poses by that (import with "
                f"{option('heading_offset_deg', round(np.degrees(astray_rad)), robot.robot_id)})"
                f"{unless if back else ''}."
            )
    else:
        heading_smooth = np.where(segment < 0, np.nan, 0.0)
        notes.append("the heading is not recorded: only the position is judged.")
    return Track(
        robot_id=robot.robot_id,
        command_kind=robot.command_kind,
        command_t_s=robot.command_t_s,
        command=robot.command,
        battery_V=_filled(robot.command_t_s, robot.battery_V),
        pose_t_s=robot.pose_t_s,
        pose=pose,
        segment=segment,
        heading_smooth=heading_smooth,
        rest=rest,
        timing=_timing(robot, segment),
        notes=notes,
        has_heading=robot.has_heading,
        same_clock=robot.same_clock,
        telemetry=len(robot.mode) > 0,
        astray_rad=astray_rad,
        lost_s=lost_s,
    )


def command_at(t_s: np.ndarray, command_t_s: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Commands in force at times on the robot's clock: (N,), (M,), (M, C) to (N, C).

    Zero before the first.
    """
    k = np.searchsorted(command_t_s, t_s, side="right") - 1
    return np.where((k >= 0)[:, None], command[np.maximum(k, 0)], 0)


def _trackable(robot: RobotLog, lost_s: np.ndarray, notes: list[str]) -> np.ndarray:
    """(N,) bool: poses that are valid, on the floor, and taken while commands are known."""
    lifted = np.abs(robot.z_m - np.nanmedian(robot.z_m)) > LIFT_M  # NaN compares false
    if lifted.any() and (floor := tilted_floor(robot)):
        lifted = np.abs(floor.height_m) > LIFT_M
        notes.append(
            f"the capture's z is tilted by {np.degrees(floor.tilt_rad):.1f} degrees against the "
            "floor on which the poses lie; heights are counted from that. Level its axes, for "
            "example with its calibration square."
        )
    if lifted.any():
        notes.append(
            f"{counted(np.count_nonzero(lifted), 'pose')} from {robot.pose_t_s[lifted][0]:.3f} s "
            "on off the floor; left out."
        )
    silent = _silent(robot)
    lost = np.zeros(len(silent), bool)
    for begin_s, end_s in lost_s:
        lost |= (robot.pose_t_s > begin_s) & (robot.pose_t_s < end_s + AFTER_S)
    if (lost & robot.valid).any():
        count = np.count_nonzero(lost & robot.valid)
        notes.append(f"{words(robot, lost_s)}; {counted(count, 'pose')} left out.")
    if (silent & robot.valid).any():
        first = robot.pose_t_s[silent & robot.valid][0]
        ended = f"; the last is at {robot.command_t_s[-1]:.3f} s" if silent[-1] else ""
        notes.append(
            f"{counted(np.count_nonzero(silent & robot.valid), 'pose')} from {first:.3f} s on, "
            f"taken while no commands are in the log{ended}; left out."
        )
    return robot.valid & ~lifted & ~silent & ~lost


@dataclass(frozen=True)
class TiltedFloor:
    """A plane on which a robot drove: its tilt, and (N,) heights of the poses over it."""

    tilt_rad: float
    height_m: np.ndarray


def tilted_floor(robot: RobotLog) -> TiltedFloor | None:
    """The plane through most of a robot's places; None where a level one fits as well.

    The least sum of distances, since a robot that is carried about is no part of it; found by
    weights of one over each distance (Schlossmacher 1973). A few poses that are carried far tilt
    such a plane, but then most lie worse on it than on a level one.
    """
    z_m = robot.z_m[robot.valid]
    across = np.column_stack([robot.pose[:, :2], np.ones(len(robot.pose))])
    on, weight = across[robot.valid], np.ones(len(z_m))
    for _ in range(PLANE_ROUNDS):
        root = np.sqrt(weight)
        plane, *_ = np.linalg.lstsq(on * root[:, None], z_m * root, rcond=None)
        weight = 1 / np.maximum(np.abs(z_m - on @ plane), PLANE_M)
    level_m = np.median(np.abs(z_m - np.median(z_m)))
    if np.median(np.abs(z_m - on @ plane)) > level_m / 2:
        return None
    return TiltedFloor(float(np.arctan(np.hypot(*plane[:2]))), robot.z_m - across @ plane)


def _silent(robot: RobotLog) -> np.ndarray:
    """(N,) bool: poses at times whose commands are not in the log, whatever the clock offset."""
    t, stamps = robot.pose_t_s, robot.command_t_s
    outside = (t < stamps[0] - CLOCK_S) | (t > stamps[-1] + CLOCK_S)
    if len(robot.mode) == 0:  # drive messages come when they change: held for as long as it takes
        return (t < stamps[0] - CLOCK_S) | _after_the_last(robot)
    for k in np.flatnonzero(np.diff(stamps) > SILENCE_S):
        outside |= (t > stamps[k] + CLOCK_S) & (t < stamps[k + 1] - CLOCK_S)
    return outside


def _after_the_last(robot: RobotLog) -> np.ndarray:
    """(N,) bool: poses after the last command, where they go on for longer than it can have held.

    One that is sent when it changes may hold for long, and so may the only one. After a last row of
    zeros a robot that stands goes on standing. What is left out begins as soon as a command was
    followed by another before.
    """
    t_s, end_s, held_s = robot.pose_t_s, robot.command_t_s[-1], np.diff(robot.command_t_s)
    if len(held_s) < 2 or t_s[-1] <= end_s + max(HELD_S, HELDS * held_s.max()):
        return np.zeros(len(t_s), bool)
    after = t_s > end_s + held_s.max()
    seen = robot.pose[after & robot.valid, :2]
    if not robot.command[-1].any() and len(seen):
        span_m = np.ptp(np.quantile(seen, (0.01, 0.99), axis=0), axis=0)
        return after & bool((span_m > STANDING_M).any())
    return after


def continuous(pose: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Poses with the heading unwrapped anew in each segment: outliers may have hidden a turn.

    NaN where unusable: what is left out must not count as way driven or as a place.
    """
    pose = np.where(segment[:, None] < 0, np.nan, pose)
    for number in range(segment.max() + 1):
        part = segment == number
        pose[part, 2] = np.unwrap(pose[part, 2])
    return pose


def local_line(
    t_s: np.ndarray, values: np.ndarray, segment: np.ndarray, half_width_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Straight line by least squares around each sample, within its segment.

    Args:
        t_s: (N,) ascending.
        values: (N,) one per time, or (N, C).
        segment: (N,) as in Track.
        half_width_s: of the window.

    Returns:
        Like values, its value at the sample and its slope per second; NaN where segment is -1,
        slope NaN too where the sample stands alone.
    """
    reach = int(np.ceil(half_width_s / np.median(np.diff(t_s))))
    columns = np.ascontiguousarray(values.reshape(len(t_s), -1))
    value, slope = native.local_lines(t_s, columns, segment, half_width_s, reach)
    return value.reshape(values.shape), slope.reshape(values.shape)


def _rest(robot: RobotLog, lost_s: np.ndarray) -> np.ndarray:
    """(K, 2) s as described in Track."""
    t = robot.command_t_s
    moving = (robot.command != 0).any(axis=1)
    if len(robot.mode):  # a stretch without telemetry is no rest
        moving[:-1] |= np.diff(t) > SILENCE_S
    moving |= np.isin(t, lost_s[:, 0])
    edge = np.flatnonzero(np.diff(np.concatenate([[1], moving, [1]])))
    starts, ends = t[edge[::2]], np.append(t, t[-1] + CLOCK_S)[edge[1::2]]
    rest = np.column_stack([starts + REST_S, ends - CLOCK_S])
    return rest[rest[:, 0] < rest[:, 1]]


def _filled(t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values)
    return np.interp(t_s, t_s[known], values[known]) if known.any() else values


def _timing(robot: RobotLog, segment: np.ndarray) -> Timing:
    pose_period_s = float(np.median(np.diff(robot.pose_t_s)))
    steps_s = np.diff(robot.command_t_s)
    spans_s = sum(
        np.ptp(robot.pose_t_s[segment == number]) + pose_period_s
        for number in range(segment.max() + 1)
    )
    lost = 1 - np.count_nonzero(segment >= 0) * pose_period_s / spans_s if spans_s else np.nan
    return Timing(
        pose_period_s=pose_period_s,
        command_period_s=float(np.median(steps_s)) if len(steps_s) else np.nan,
        pose_lost_share=max(0.0, float(lost)),
    )


def _note_frozen(robot: RobotLog, notes: list[str]) -> None:
    """Poses that keep their bits although the robot is driven all the while."""
    index = np.flatnonzero(robot.valid)
    t = robot.pose_t_s[index]
    moves = np.flatnonzero((np.diff(np.nan_to_num(robot.pose[index]), axis=0) != 0).any(axis=1))
    borders = np.concatenate([[-1], moves, [len(index) - 1]])
    starts, ends = borders[:-1] + 1, borders[1:]
    still = t[ends] - t[starts] > FROZEN_S
    for first, last in zip(starts[still], ends[still], strict=True):
        within = (robot.command_t_s >= t[first]) & (robot.command_t_s <= t[last])
        if within.any() and (robot.command[within] != 0).any(axis=1).all():
            notes.append(
                f"the pose is frozen from {t[first]:.3f} to {t[last]:.3f} s while the "
                "robot is driven; check the motion capture."
            )


def _astray_rad(robot: RobotLog, pose: np.ndarray, segment: np.ndarray) -> float:
    """As in Track: motion that points elsewhere than the heading of a robot driven straight.

    Where it is driven in arcs alone, motion that points backwards.
    """
    straight = _straight(robot.command, robot.command_kind)
    if angle_rad := _way_rad(robot, pose, segment, straight):
        return angle_rad
    angle_rad = _way_rad(robot, pose, segment, _arcs(robot), most_bend_rad=np.inf)
    return angle_rad if abs(angle_rad) > np.pi - ASTRAY_RAD else 0.0


def _way_rad(
    robot: RobotLog,
    pose: np.ndarray,
    segment: np.ndarray,
    command: np.ndarray,
    *,
    most_bend_rad: float = SPIN_RAD,
) -> float:
    """Angle from the heading to the way of a robot under (M,) commands ahead; 0 if it is small."""
    half = max(1, round(0.25 / float(np.median(np.diff(robot.pose_t_s)))))
    middle = np.arange(half, len(pose) - half)
    whole = (segment[middle - half] >= 0) & (segment[middle - half] == segment[middle + half])
    middle, ahead = middle[whole], np.sign(command[:, None]).astype(np.int8)
    signs = np.array(
        [
            command_at(robot.pose_t_s[middle] + shift, robot.command_t_s, ahead)
            for shift in (-0.5, -0.25, 0.0, 0.25, 0.5)
        ]
    )[:, :, 0]
    steady = (signs[0] != 0) & (signs == signs[0]).all(axis=0)
    if np.count_nonzero(steady) < half:
        return 0.0
    middle, sign = middle[steady], signs[0, steady]
    first, last = middle - half, middle + half
    if np.median(_bend_rad(pose, first, middle, last)) > most_bend_rad:
        return 0.0
    step = (pose[last, :2] - pose[first, :2]) * sign[:, None]
    turn = _one_turn(step[:, 0] + 1j * step[:, 1], pose[middle, 2])
    astray_rad = float(np.angle(turn))
    return astray_rad if abs(astray_rad) > ASTRAY_RAD else 0.0


def _one_turn(ahead_m: np.ndarray, heading_rad: np.ndarray) -> complex:
    """Mean of a robot's steps ahead, complex, seen from its heading; 0 if they show no one turn.

    A marker that is turned leads all of them astray by one angle. An axis that is mirrored leads
    each along another one, by twice its heading: the steps mirrored back then lie on the heading.
    """
    back = np.exp(-1j * heading_rad)
    way_m = np.sum(np.abs(ahead_m))
    if not way_m:
        return 0
    turn, flip = (np.sum(s * back) / way_m for s in (ahead_m, np.conj(ahead_m)))
    mirrored = 1 - abs(flip.real) < (1 - abs(turn)) / 2
    return 0 if abs(turn) < ONE_ANGLE or mirrored else turn


def _bend_rad(pose: np.ndarray, first: np.ndarray, middle: np.ndarray, last: np.ndarray):
    """(K,) by which the path turns from the one half of a step to the other."""
    x, y = pose[:, 0], pose[:, 1]
    one, other = (
        (x[end] - x[begin]) + 1j * (y[end] - y[begin])
        for begin, end in ((first, middle), (middle, last))
    )
    return np.abs(np.angle(other * np.conj(one)))


def _straight(command: np.ndarray, kind: CommandKind) -> np.ndarray:
    """(M,) forward command where it asks for straight motion, else 0."""
    if kind == "twist":
        return np.where((command[:, 1:3] == 0).all(axis=1), command[:, 0], 0.0)
    return np.where(np.ptp(command, axis=1) == 0, command[:, 0], 0.0)


def _arcs(robot: RobotLog) -> np.ndarray:
    """(M,) forward command where it asks for an arc, else 0."""
    command = robot.command
    if robot.command_kind == "twist":
        return np.where((command[:, 1] == 0) & (command[:, 2] != 0), command[:, 0], 0.0)
    left, right = command[:, 0], command[:, 1]
    sides = (left == command[:, 2]) & (right == command[:, 3]) & (left != right)
    return np.where(sides & (left * right > 0), left, 0.0)
