# SPDX-License-Identifier: Apache-2.0
"""Numbers for a real robot's drive controller, which knows a radius and distances, and no gains.

They turn a wanted velocity into wheel speeds by  w_k = (vx -+ vy -+ (a + b) omega) / r. A robot
whose true velocity is (f vx, s vy, y omega) of the ideal one does what is wanted with r' = r f and
(a + b)' = (a + b) f / y; s other than f is what such a controller cannot know.
"""

from dataclasses import dataclass

import numpy as np

from twinmill.export.carried import RobotModel


@dataclass(frozen=True)
class Drive:
    """What a controller is told.

    Attributes:
        radius_m: of the wheels, gain of speed put in.
        scale: of the robot's half wheelbase and half track, so that it turns as fast as told.
        top_mps: highest speed forward; None where the model states none.
        top_radps: of turning on the spot.
    """

    radius_m: float
    scale: float
    top_mps: float | None
    top_radps: float | None


def drive_of(robot: RobotModel) -> Drive:
    """Of a robot with its gains."""
    forward = robot.get("base.forward_gain") * robot.get("theta_a1")
    yaw = robot.get("base.yaw_gain") * robot.get("theta_a2")
    top_mps = robot.top_rim_mps
    turning = None
    if top_mps:
        radius_m = robot.get("robot.wheel_radius_m")
        per_radps = max(abs(w) for w in robot.model.wheel_speeds(0, 0, 1)) * radius_m
        turning = yaw * top_mps / per_radps
    return Drive(
        robot.get("robot.wheel_radius_m") * forward,
        forward / yaw,
        forward * top_mps if top_mps else None,
        turning,
    )


def wheel_gains(robot: RobotModel) -> np.ndarray:
    """(K,) speed of each wheel over what it is told, by the effects `wheel_gain`."""
    found = [v for _, card, v in robot.effects() if card["name"] == "wheel_gain"]
    ones = np.ones(len(robot.model.wheels()))
    return np.prod([ones, *(1 + np.array([*v.values()])[: len(ones)] for v in found)], axis=0)
