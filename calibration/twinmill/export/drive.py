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
    """Drive system as a controller is told of it.

    Attributes:
        radius_m: of the wheels, gain of speed put in.
        scale: of the robot's half wheelbase and half track, so that it turns as fast as told.
    """

    radius_m: float
    scale: float


def drive_of(robot: RobotModel) -> Drive:
    """Numbers of a robot with its gains."""
    gains = robot.gains()
    radius_m = robot.get("robot.wheel_radius_m") * gains["ahead"]
    return Drive(radius_m, gains["ahead"] / gains["turning"])


def wheel_gains(robot: RobotModel) -> np.ndarray:
    """(K,) speed of each wheel over what it is told, by the effects `wheel_gain`."""
    found = robot.values_of("wheel_gain")
    ones = np.ones(len(robot.model.wheels()))
    return np.prod([ones, *(1 + np.array([*v.values()])[: len(ones)] for v in found)], axis=0)
