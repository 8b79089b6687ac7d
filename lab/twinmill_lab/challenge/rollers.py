# SPDX-License-Identifier: Apache-2.0
"""Robots made of forces: MJCF with turned omni wheels, or with ten free rollers a wheel.

No model file contains these wheels. A mecanum wheel does kinematically what an omni wheel of
radius R / sqrt(2) does that is turned by 45 degrees: a short capsule that grips along its rolling
direction and slides along its axle.
"""

import sys

import mujoco
import numpy as np

from twinmill_lab.challenge.physics import STEP_S
from twinmill_lab.challenge.robots import Robot

SIDE, AHEAD, LEFT = (-1, 1, 1, -1), (1, 1, -1, -1), (1, -1, 1, -1)
ROTOR_KGM2 = 1.5e-4
GRIP = 0.8
ROLLERS = 10
# Friction along the axles, and of the rollers' bearings. It takes a constant speed away, as
# coulomb_friction does: here below 2 mm/s, so that where nothing is hidden nothing is there.
SLIDE = 0.001
BEARING_Nm = 2e-5

# By itself MuJoCo also writes warnings to MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(lambda text: print(f"mujoco: {text}", file=sys.stderr))


def drive_by_forces(robot: Robot, rim_mps: np.ndarray) -> np.ndarray:
    """Lets motors follow the speeds asked of the rims, and the floor do the rest.

    Args:
        robot: of plant mujoco or rollers.
        rim_mps: (N, 4), a row each STEP_S; the motors' own lag is not in it.

    Returns:
        (N, 3) velocity of the body: forward, left in m/s, turn in rad/s.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(robot))
    data = mujoco.MjData(model)
    twist = np.empty((len(rim_mps), 3))
    for k, asked in enumerate(rim_mps / robot.wheel_radius_m):
        data.ctrl[:] = asked
        mujoco.mj_step(model, data)
        w, _, _, z = data.qpos[3:7]
        heading = 2 * np.arctan2(z, w)
        c, s = np.cos(heading), np.sin(heading)
        x, y = data.qvel[:2]
        twist[k] = c * x + s * y, c * y - s * x, data.qvel[5]
    return twist


def mjcf(robot: Robot) -> str:
    """The robot on an endless floor; actuators front-left, front-right, rear-left, rear-right."""
    radius_m, mass_kg = robot.wheel_radius_m, robot.mass_kg
    servo_Nms = (mass_kg * radius_m**2 / 4 + ROTOR_KGM2) / robot.lag_s
    wheel = _roller_wheel if robot.plant == "rollers" else _omni_wheel
    bodies = "".join(wheel(robot, k) for k in range(4))
    pairs = "".join(
        f"<pair geom1='floor' geom2='g{k}' condim='3' solref='0.005 1' "
        f"friction='{SLIDE} {GRIP} 0.005 0.0001 0.0001'/>"
        for k in range(4)
    )
    motors = "".join(
        f"<velocity joint='w{k}' kv='{servo_Nms}' forcerange='-0.3 0.3'/>" for k in range(4)
    )
    return f"""<mujoco><compiler angle='radian'/>
    <option timestep='{STEP_S}' integrator='implicitfast' cone='elliptic' impratio='10'/>
    <worldbody><geom name='floor' type='plane' size='50 50 1' conaffinity='0'
    friction='{GRIP}' solref='0.005 1'/><body><freejoint/><inertial pos='0 0 {radius_m + 0.02}'
    mass='{mass_kg}' diaginertia='{2e-3 * mass_kg} {3e-3 * mass_kg} {4e-3 * mass_kg}'/>{bodies}
    </body></worldbody><contact>{pairs if robot.plant == "mujoco" else ""}</contact>
    <actuator>{motors}</actuator></mujoco>"""


def _place(robot: Robot, k: int, height_m: float) -> str:
    x, y = AHEAD[k] * robot.half_wheelbase_m, LEFT[k] * robot.half_track_m
    return f"<body pos='{x} {y} {height_m}'><inertial pos='0 0 0' mass='0.03' "


def _omni_wheel(robot: Robot, k: int) -> str:
    radius_m = robot.wheel_radius_m / np.sqrt(2)
    axle = f"{-SIDE[k]} 1 0"
    return (
        f"{_place(robot, k, radius_m)} diaginertia='8e-6 8e-6 8e-6'/><joint name='w{k}' "
        f"axis='{axle}' armature='{ROTOR_KGM2}'/><geom name='g{k}' type='capsule' mass='0' "
        f"size='{radius_m} 0.0005' zaxis='{axle}' contype='0' conaffinity='0'/></body>"
    )


def _roller_wheel(robot: Robot, k: int) -> str:
    """Barrels whose ellipsoids meet the rim in their middle and where the next takes over."""
    radius_m, roller_m = robot.wheel_radius_m, 0.2 * robot.wheel_radius_m
    hub_m = radius_m - roller_m
    reach_m = hub_m * np.tan(np.pi / ROLLERS) / np.sqrt(2)
    end_m = radius_m - np.sqrt(hub_m**2 + reach_m**2 / 2)
    half_m = reach_m / np.sqrt(1 - (end_m / roller_m) ** 2)
    axle = f"1 {SIDE[k]} 0"
    return (
        f"{_place(robot, k, radius_m)} diaginertia='8e-6 4e-6 8e-6'/><joint name='w{k}' "
        f"axis='0 1 0' armature='{ROTOR_KGM2}'/><replicate count='{ROLLERS}' "
        f"euler='0 {2 * np.pi / ROLLERS} 0'><body pos='0 0 {-hub_m}'><inertial pos='0 0 0' "
        f"mass='0.0015' diaginertia='5e-8 5e-8 5e-8'/><joint axis='{axle}' armature='2e-7' "
        f"damping='2e-6' frictionloss='{BEARING_Nm}'/><geom type='ellipsoid' zaxis='{axle}' "
        f"mass='0' size='{roller_m} {roller_m} {half_m}' friction='{GRIP}' contype='0' "
        "conaffinity='1' solref='0.005 1'/></body></replicate></body>"
    )
