# SPDX-License-Identifier: Apache-2.0
"""Steady motion of a robot: rim speeds by duty, and its limits.

A robot told duties is as fast as its table. One told wheel speeds or velocities is as fast as its
effects `wheel_limit` and `speed_limit` say; without them no top speed is known.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.export.carried import Left, RobotModel

DUTIES_PCT = np.arange(-100, 101)
CURVES = ("dead_zone", "speed_curve")
STATIC = (*CURVES, "wheel_gain", "reverse_asymmetry")  # in the duty table
TOPS = ("dead_zone", "wheel_gain", "reverse_asymmetry")  # of these, what changes the top speed
WAYS = ("ahead", "sideways", "turning")
FAR = 1e9  # m/s, rad/s: told to find a limit
KNOWN = 1e3  # m/s, rad/s: no robot's top speed; what goes faster has no limit


@dataclass(frozen=True)
class Limits:
    """Speeds and accelerations that a robot does not exceed.

    Attributes:
        rims_mps: (K,) top speed of each wheel's rim; None where the model knows none.
        body: lowest and highest velocity (m/s, rad/s) by a key of WAYS, where known: of the body,
            so with the floor's gains.
        accelerations: of the body (m/s^2, rad/s^2) by a key of WAYS, where limited.
    """

    rims_mps: np.ndarray | None
    body: Mapping[str, tuple[float, float]]
    accelerations: Mapping[str, float]


def only(model: native.Model, effects: tuple[str, ...]) -> native.Model:
    """The model with these effects alone, on one clock."""
    kept = model.copy()
    for i in reversed(range(len(kept.effects))):
        if kept.effects[i] not in effects:
            kept.remove_effect(i)
    kept.set("clock.offset_s", 0.0)
    kept.set("clock.rate_ppm", 0.0)
    return kept


def rim_table(model: native.Model) -> np.ndarray:
    """(201, K) steady rim speed (m/s) of each wheel at duties -100..100 %, with STATIC effects."""
    commands = np.repeat(DUTIES_PCT[:, None] / 100.0, 4, axis=1)
    return _steady(only(model, STATIC), commands)[:, 3 : 3 + len(model.wheels())]


def limits_of(robot: RobotModel) -> Limits:
    """Top speeds and accelerations as far as the model knows them."""
    return Limits(_rims_mps(robot.model), _body(robot.model), _accelerations(robot))


def top_speed_left(robot: RobotModel, so: str) -> Left:
    """Lack of a model, its consequence for a file, and the numbers to put into the model."""
    if robot.model.drive == "steering":
        return Left("top speed", f"the model has no key for it, so {so}; set it in this file")
    return Left(
        "top speed",
        f"the model knows none, so {so}; append [[effect]], "
        'name = "wheel_limit", pace_s_per_m = 1 / (top speed of a rim in m/s) to the model file',
    )


def _rims_mps(model: native.Model) -> np.ndarray | None:
    if model.wheel_kind == "none" or model.drive == "steering":
        return None
    count = len(model.wheels())
    if model.drive == "duty":
        return np.abs(rim_table(model)).max(axis=0)
    ways = [_told(model, sign * np.eye(3)[i]) for sign in (-1, 1) for i in (0, 2)]
    limited = only(model, ("wheel_limit", "wheel_gain"))
    rims_mps = np.abs(_steady(limited, np.array(ways))[:, 3 : 3 + count]).max(axis=0)
    return rims_mps if np.all((rims_mps > 0) & (rims_mps < KNOWN)) else None


def _body(model: native.Model) -> dict[str, tuple[float, float]]:
    if model.drive == "steering":
        return {}
    limited = only(model, (*STATIC, "speed_limit", "wheel_limit"))
    found = {}
    for i, way in enumerate(WAYS):
        told = np.array([_told(model, sign * np.eye(3)[i]) for sign in (-1, 1)])
        lowest, highest = _steady(limited, told)[:, i]
        if -KNOWN < lowest < 0 < highest < KNOWN:
            found[way] = (float(lowest), float(highest))
    return found


def _told(model: native.Model, velocity: np.ndarray) -> np.ndarray:
    """(4,) command for as much as the robot can along a velocity of one part, 1 or -1."""
    command = np.zeros(4)
    if model.drive == "twist":
        command[:3] = FAR * velocity
        return command
    wheels = np.array(model.wheel_speeds(*velocity))
    wheels[np.abs(wheels) < 1e-9 * np.abs(wheels).max(initial=0)] = 0
    command[: len(wheels)] = np.sign(wheels) if model.drive == "duty" else FAR * wheels
    return command


def _steady(model: native.Model, commands: np.ndarray) -> np.ndarray:
    """(K, 7) steady velocity and rim speeds at (K, 4) commands; of no lag, which has none left."""
    still = model.copy()
    still.set("base.motor_lag_s", 0.0)
    return native.steady(still, commands, [], np.zeros((0, 0)))[0]


def _accelerations(robot: RobotModel) -> dict[str, float]:
    gains = robot.gains()
    paces = robot.values_of("acceleration_limit")
    found = {}
    for way in WAYS:
        key = "turn_pace_s2_per_rad" if way == "turning" else "pace_s2_per_m"
        pace = max((v[key] for v in paces), default=0.0)
        if pace > 0 and way in gains:
            found[way] = gains[way] / pace
    return found
