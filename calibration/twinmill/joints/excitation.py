# SPDX-License-Identifier: Apache-2.0
"""Random smooth motions of a robot, run in MuJoCo, and kept where they stay within limits."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.series import Series

MARGIN = 0.05  # of a joint's range, at either end, that is left free
SHORTEST_S, LONGEST_S = 0.5, 8.0  # of a sine or a way between two poses
RISE_S = 1.0  # in which a motion sets in from rest, and ends
FOLLOW_RADPS = 15.0  # bandwidth of the controller that follows with motors: a usual one
SHARES = 0.3, 1.0  # of the limits that a joint's motion is scaled to


@dataclass(frozen=True)
class Limits:
    """Bounds of a motion: of the model, or else what the logs reached.

    Attributes:
        low, high: (J,) positions.
        speed: (J,) of joints.
        force: (U,) of actuators.
        ctrl: (U, 2) commands.
    """

    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    ctrl: np.ndarray

    @classmethod
    def of(cls, mjcf: Mjcf, series: Series, times_speed: float = 1.0) -> "Limits":
        """Limits of a model in the light of a log.

        Args:
            mjcf: the model.
            series: of the log.
            times_speed: highest speed, over that of the log.
        """
        model, log = mjcf.model, series.log
        limited = model.jnt_limited.astype(bool)
        room = MARGIN * np.ptp(model.jnt_range, axis=1)
        low, high = log.qpos.min(axis=0), log.qpos.max(axis=0)
        force = np.abs(_forces(mjcf, series)).max(axis=0)
        held = np.abs(model.actuator_forcerange).max(axis=1)
        ctrl = np.column_stack([log.ctrl.min(axis=0), log.ctrl.max(axis=0)])
        told = model.actuator_ctrllimited.astype(bool)
        position = np.array([word == "position" for word in mjcf.told])
        ctrl[position] = -np.inf, np.inf  # the joint's range limits these
        ctrl[told] = model.actuator_ctrlrange[told]
        return cls(
            np.where(limited, model.jnt_range[:, 0] + room, low),
            np.where(limited, model.jnt_range[:, 1] - room, high),
            times_speed * np.abs(series.v).max(axis=0),
            np.where(model.actuator_forcelimited.astype(bool), held, force),
            ctrl,
        )


@dataclass(frozen=True)
class Motion:
    """One run in MuJoCo.

    Attributes:
        log: stamps, commands and positions.
        exceeds: why it may not be run on the robot; empty if it may.
    """

    log: JointLog
    exceeds: str


def motion(
    mjcf: Mjcf, stock: Any, limits: Limits, begin: np.ndarray, *, t_s: np.ndarray, seed: int
) -> Motion:
    """A random motion that begins and ends at rest.

    Servos are told the motion; a controller with the model's inverse dynamics follows it with
    motors, as some controller must on the robot.

    Args:
        mjcf: the model.
        stock: compiled by MuJoCo as it stands in its file.
        limits: that it keeps.
        begin: (J,) pose.
        t_s: stamps of commands.
        seed: of its random numbers.
    """
    random = np.random.default_rng(seed)
    wanted = np.column_stack(
        [_course(random, limits, begin, d=d, t_s=t_s) for d in range(len(begin))]
    )
    speed, data = np.gradient(wanted, t_s, axis=0), mujoco.MjData(stock)
    acceleration = np.gradient(speed, t_s, axis=0)
    data.qpos[:] = wanted[0]
    q, ctrl, exceeds = np.zeros_like(wanted), np.zeros((len(t_s), stock.nu)), ""
    told = _teller(mjcf, stock)
    for k, now_s in enumerate(t_s):
        q[k] = data.qpos
        ctrl[k] = data.ctrl[:] = told(data, wanted[k], speed[k], acceleration[k])
        if not exceeds:
            mujoco.mj_forward(stock, data)
        exceeds = exceeds or _exceeds(mjcf, stock, data, limits)
        while data.time + stock.opt.timestep / 2 < now_s - t_s[0] + (t_s[1] - t_s[0]):
            mujoco.mj_step(stock, data)
    log = JointLog(t_s, ctrl, q, None, mjcf.joints, mjcf.actuators, name="excitation")
    return Motion(log, exceeds)


def _course(
    random: np.random.Generator, limits: Limits, begin: np.ndarray, *, d: int, t_s: np.ndarray
) -> np.ndarray:
    """A joint's wanted position: sines, or ways between random poses at a constant speed."""
    low, high = limits.low[d], limits.high[d]
    lasts_s = float(t_s[-1] - t_s[0])
    times = np.exp(random.uniform(np.log(SHORTEST_S), np.log(LONGEST_S), 5))
    if random.random() < 0.5:
        phases = random.uniform(0, 2 * np.pi, len(times))
        waves = np.sin(2 * np.pi * (t_s[:, None] - t_s[0]) / times + phases)
        own = waves @ random.dirichlet(np.ones(len(times)))
    else:
        knots = np.arange(0, lasts_s + times[0], times[0])
        own = np.interp(t_s - t_s[0], knots, random.uniform(-1, 1, len(knots)))
        own = np.convolve(np.pad(own, 25, "edge"), np.ones(51) / 51, "valid")  # no jerks
    since, until = t_s - t_s[0], t_s[-1] - t_s
    fade = np.clip(np.minimum(since, until) / RISE_S, 0, 1)
    own *= fade**2 * (3 - 2 * fade)
    share = random.uniform(*SHARES)
    place = np.clip(begin[d], low, high)
    fastest = np.abs(np.gradient(own, t_s)).max()
    scale = share * min(
        (high - place) / max(own.max(), 1e-9),
        (place - low) / max(-own.min(), 1e-9),
        limits.speed[d] / max(fastest, 1e-9),
    )
    return np.asarray(place + scale * own)


def _teller(mjcf: Mjcf, stock: Any) -> Callable[..., np.ndarray]:
    """Commands of a state and a wanted position, speed and acceleration."""
    ghost = mujoco.MjData(stock)
    first = {int(d): a for a, d in reversed(list(enumerate(mjcf.moves)))}
    gear = stock.actuator_gear[:, 0]

    def told(data: Any, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        out, error = np.zeros(stock.nu), q - data.qpos
        follow = a + 2 * FOLLOW_RADPS * (v - data.qvel) + FOLLOW_RADPS**2 * error
        ghost.qpos[:], ghost.qvel[:], ghost.qacc[:] = data.qpos, data.qvel, follow
        mujoco.mj_inverse(stock, ghost)
        for d, act in first.items():
            if mjcf.told[act] == "position":
                out[act] = gear[act] * q[d]
            elif mjcf.told[act] == "velocity":
                out[act] = gear[act] * (v[d] + error[d])
            else:
                moment = gear[act] * stock.actuator_gainprm[act, 0]
                out[act] = ghost.qfrc_inverse[d] / (moment if moment else 1.0)
        return out

    return told


def _exceeds(mjcf: Mjcf, stock: Any, data: Any, limits: Limits) -> str:
    """A sentence's part on the first limit that a state exceeds; empty if none."""
    if data.ncon and data.contact.dist.min() < 0:
        names = [stock.geom(int(g)).name or f"geom {g}" for g in data.contact.geom[0]]
        return f"'{names[0]}' would touch '{names[1]}'"
    for d, name in enumerate(mjcf.joints):
        unit = mjcf.units[d]
        if not limits.low[d] - 1e-6 <= data.qpos[d] <= limits.high[d] + 1e-6:
            return (f"joint '{name}' would reach {data.qpos[d]:.3g} {unit}, beyond "
                    f"{limits.low[d]:.3g} to {limits.high[d]:.3g}")  # fmt: skip
        if abs(data.qvel[d]) > limits.speed[d]:
            return (f"joint '{name}' would move at {abs(data.qvel[d]):.3g} {unit}/s, beyond "
                    f"{limits.speed[d]:.3g}")  # fmt: skip
    for a, name in enumerate(mjcf.actuators):
        if not limits.ctrl[a, 0] <= data.ctrl[a] <= limits.ctrl[a, 1]:
            return (f"actuator '{name}' would be told {data.ctrl[a]:.3g}, beyond "
                    f"{limits.ctrl[a, 0]:.3g} to {limits.ctrl[a, 1]:.3g}")  # fmt: skip
        if abs(data.actuator_force[a]) > limits.force[a]:
            return (f"actuator '{name}' would exert {abs(data.actuator_force[a]):.3g}, beyond "
                    f"{limits.force[a]:.3g}")  # fmt: skip
    return ""


def _forces(mjcf: Mjcf, series: Series) -> np.ndarray:
    """(n, U) forces of actuators at the states of a log."""
    data, ctrl = mujoco.MjData(mjcf.model), series.commands(mjcf.delay_s)
    out = np.empty_like(ctrl)
    for k in range(len(series.q)):
        data.qpos[:], data.qvel[:], data.ctrl[:] = series.q[k], series.v[k], ctrl[k]
        mujoco.mj_forward(mjcf.model, data)
        out[k] = data.actuator_force
    return out
