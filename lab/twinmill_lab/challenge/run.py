# SPDX-License-Identifier: Apache-2.0
"""One drive of a drawn robot with something hidden, and the log that is made of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import turbopi

from twinmill.data.lcm_log import log_file
from twinmill.experiment.drives import Leg, sampled
from twinmill_lab.challenge.physics import STEP_S, Hidden, Signals, slow
from twinmill_lab.challenge.robots import Robot
from twinmill_lab.challenge.rollers import drive_by_forces

EPOCH_US = 1_700_000_000_000_000
ROBOT_ID = 1
KINDS = {"duty": 0, "wheel_speed": 1, "twist": 2}  # of drive_t
FULL_TURN_RADPS = 2.0  # of a robot driven by velocities
ROUNDS = 6  # until a path agrees with forces that depend on the place


@dataclass(frozen=True)
class Plan:
    """A drive of a robot, without what is hidden.

    Attributes:
        robot: who drives.
        legs: what it is told.
        seed: of disturbance, sensor and chance.
        full_V: of the battery when the drive begins.
    """

    robot: Robot
    legs: list[Leg]
    seed: int
    full_V: float = 8.3


@dataclass(frozen=True)
class Motion:
    """Driven run: steps of STEP_S, and the rows of the commands."""

    pose: np.ndarray
    rim_mps: np.ndarray
    battery_V: np.ndarray
    tick_s: np.ndarray
    command: np.ndarray


def play(plan: Plan, hidden: Sequence[Hidden] = (), forces: bool = False, calm: bool = False):
    """The motion under a plan.

    Args:
        plan: who drives, and how.
        hidden: what is hidden.
        forces: whether robots made of forces are; else their wheels roll as they are told.
        calm: without disturbance.
    """
    robot, random = plan.robot, np.random.default_rng(plan.seed)
    tick_s, axes = sampled(plan.legs, robot.control_hz)
    command = _commanded(robot, axes)
    t_s = np.arange(0, tick_s[-1], STEP_S)
    battery_V = plan.full_V - random.uniform(0.4, 1.1) * t_s / t_s[-1]
    noise = _disturbance(robot, len(t_s), random) * (not calm)
    at_s = _acted("command", tick_s, hidden, Signals(robot, command, battery_V, axes, random))
    row = np.clip(np.searchsorted(at_s, t_s + STEP_S / 2, side="right") - 1, 0, None)
    duty = _acted(
        "duty", command[row], hidden, Signals(robot, command[row], battery_V, axes, random)
    )
    seen = Signals(robot, duty, battery_V, np.zeros((len(t_s), 3)), random)
    rim = duty if robot.drive == "twist" else robot.speed_mps(duty)
    rim = _acted("target", rim, hidden, seen)
    by_forces = forces and robot.plant != "planar"
    if any(h.stage == "lag" for h in hidden):
        own = replace(robot, lag_s=STEP_S) if by_forces else robot
        rim = _acted("lag", rim, hidden, replace(seen, robot=own))
    elif not by_forces:
        rim = slow(rim, robot.lag_s)
    rolls = _acted("rolls", rim, hidden, seen)
    twist = _body(robot, rolls, by_forces)
    moves = (np.abs(duty).max(axis=1) > 0) | (np.abs(twist[:, 0]) > 0.01)
    pose = path_of(twist)
    for _ in range(ROUNDS):
        there = Signals(robot, duty, battery_V, pose, np.random.default_rng(plan.seed))
        pose = path_of(_acted("ground", twist, hidden, there) + noise * moves[:, None])
    pose = _acted("observe", pose, hidden, seen)
    return Motion(pose, rim, battery_V, tick_s, command)


def write_log(plan: Plan, motion: Motion, path: Path) -> None:
    """Writes the LCM log that robot and motion capture would have recorded."""
    robot, random = plan.robot, np.random.default_rng([plan.seed, 1])
    end_s = len(motion.pose) * STEP_S
    pose_s = np.arange(0.1, end_s - 0.1, 1 / robot.pose_hz)
    steps_s = np.arange(len(motion.pose)) * STEP_S
    pose = np.column_stack([np.interp(pose_s, steps_s, column) for column in motion.pose.T])
    sigma = [robot.sensor_m, robot.sensor_m, robot.sensor_rad]
    pose += random.standard_normal(pose.shape) * sigma
    events = [_command_event(robot, motion, k) for k in range(len(motion.tick_s))]
    events += [_pose_event(k, t, pose[k]) for k, t in enumerate(pose_s + robot.offset_s)]
    with log_file(path) as log:
        for utime_us, channel, message in sorted(events, key=lambda event: event[0]):
            log.write_event(utime_us, channel, message.encode())


def _commanded(robot: Robot, axes: np.ndarray) -> np.ndarray:
    """(N, 3) axes in -1..1 to duties in whole percent, or to velocities."""
    if robot.drive == "twist":
        return np.round(axes * [robot.top_mps, robot.top_mps, FULL_TURN_RADPS], 3)
    mix = np.sign(np.round(robot.to_wheels, 9))
    if robot.wheels == "omni3":
        mix = robot.to_wheels / [1, 1, robot.half_track_m]
    return np.round(np.clip(axes @ mix.T, -1, 1), 2)


def _acted(stage: str, signal: np.ndarray, hidden: Sequence[Hidden], seen: Signals) -> np.ndarray:
    for h in hidden:
        if h.stage == stage:
            signal = h.act(signal, h.values, seen)
    return signal


def _body(robot: Robot, rim: np.ndarray, by_forces: bool) -> np.ndarray:
    if by_forces:
        return drive_by_forces(robot, rim)
    twist = rim if robot.drive == "twist" else rim @ robot.to_body.T
    return twist * robot.gains


def path_of(twist: np.ndarray) -> np.ndarray:
    """(N, 3) pose in W from the velocity in B, by the midpoint rule from the origin."""
    heading = np.concatenate([[0.0], np.cumsum(twist[:-1, 2]) * STEP_S])
    middle = heading + 0.5 * STEP_S * twist[:, 2]
    c, s = np.cos(middle), np.sin(middle)
    step = STEP_S * np.column_stack(
        [c * twist[:, 0] - s * twist[:, 1], s * twist[:, 0] + c * twist[:, 1]]
    )
    place = np.vstack([np.zeros(2), np.cumsum(step[:-1], axis=0)])
    return np.column_stack([place, heading])


def _disturbance(robot: Robot, count: int, random: np.random.Generator) -> np.ndarray:
    """(count, 3) velocities that no model knows, with the robot's memory."""
    white = random.standard_normal((count, 3))
    coloured = slow(white, robot.drive_s) * np.sqrt(2 * robot.drive_s / STEP_S)
    return coloured * [robot.drive_mps, robot.drive_mps * robot.sideways, robot.drive_radps]


def _command_event(robot: Robot, motion: Motion, k: int) -> tuple[int, str, object]:
    utime_us = EPOCH_US + round(1e6 * motion.tick_s[k])
    if robot.drive == "duty":
        said = turbopi.telemetry_t()
        said.mode = turbopi.telemetry_t.MODE_SCRIPT
        said.wheel_duty_pct = [round(100 * d) for d in motion.command[k]]
        first = min(int(motion.tick_s[k] / STEP_S), len(motion.battery_V) - 1)
        said.battery_V = round(float(motion.battery_V[first]), 2)
        said.speed_input = said.turn_input = float("nan")
        said.seq, name = k, "TELEMETRY"
    else:
        said, name = turbopi.drive_t(), "DRIVE"
        said.kind = KINDS[robot.drive]
        said.value = _told(robot, motion, k)
    said.utime_us, said.robot_id = utime_us, ROBOT_ID
    return utime_us, f"R{ROBOT_ID:02d}_{name}", said


def _told(robot: Robot, motion: Motion, k: int) -> list[float]:
    """Velocities as commanded, or what encoders counted until the next row."""
    if robot.drive == "twist":
        return [*motion.command[k], 0.0]
    first = int(motion.tick_s[k] / STEP_S)
    rows = motion.rim_mps[first : first + round(1 / robot.control_hz / STEP_S)]
    mean = rows.mean(axis=0) if len(rows) else np.zeros(motion.rim_mps.shape[1])
    return [*(mean / robot.wheel_radius_m), *[0.0] * (4 - len(mean))]


def _pose_event(k: int, t_s: float, pose: np.ndarray) -> tuple[int, str, object]:
    said = turbopi.pose_t()
    said.utime_us, said.robot_id, said.seq, said.valid = EPOCH_US + round(1e6 * t_s), ROBOT_ID, k, 1
    said.position_m = [float(pose[0]), float(pose[1]), 0.0]
    said.orientation_wxyz = [float(np.cos(pose[2] / 2)), 0.0, 0.0, float(np.sin(pose[2] / 2))]
    return said.utime_us, f"R{ROBOT_ID:02d}_POSE", said
