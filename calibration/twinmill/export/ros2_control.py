# SPDX-License-Identifier: Apache-2.0
"""A model as parameters for the controllers of ros2_control; joints as in the URDF."""

from twinmill.arguments import option
from twinmill.export.carried import ALL, Left, RobotModel
from twinmill.export.drive import drive_of, wheel_gains
from twinmill.export.steady import TOPS, limits_of, top_speed_left
from twinmill.export.urdf import ROOT_LINK
from twinmill.extras import needing

TIMEOUT_S = 0.5  # without a command: stop


def ros2_control(robot: RobotModel) -> tuple[str, list[Left]]:
    """The file's text, and what it does not carry.

    Raises:
        ValueError: ros2_control has no controller for these wheels.
    """
    with needing("ros"):
        import yaml
    kind = robot.model.wheel_kind
    if kind not in CONTROLLERS:
        raise ValueError(
            f"{robot.file.path}: ros2_control drives {' and '.join(CONTROLLERS)} wheels here, not "
            f"'{kind}'; use {option('to', 'json')}."
        )
    plugin, parameters = CONTROLLERS[kind]
    name = plugin.split("/")[0]
    left = [
        *_base_left(robot),
        *robot.sensor_left("ros2_control moves the robot, and sees nothing"),
        *robot.left_effects("ros2_control", CARRIED[kind], _parts(robot), {}),
    ]
    data = {
        "controller_manager": {
            "ros__parameters": {
                "update_rate": round(1 / robot.get("base.control_period_s")),
                name: {"type": plugin},
            }
        },
        name: {"ros__parameters": parameters(robot)},
    }
    said = [f"Written by twinmill from {robot.file.path.name} (sha256 {robot.file.hash})."]
    said += [
        "Radius and distances undo the real robot's gains: it goes and turns as fast as told.",
        "A simulator without these gains needs the URDF's wheel radius and distances instead.",
        *HEADS.get(kind, ()),
        "Not carried:",
        *(f"- {item.sentence()}" for item in left),
    ]
    return "".join(f"# {s}\n" for s in said) + yaml.safe_dump(data, sort_keys=False), left


def _base_left(robot: RobotModel) -> list[Left]:
    """Abilities of the base that such controllers do not know."""
    why = "ros2_control has no place for it"
    left = robot.base_left(why, "ros2_control has its top speeds alone")
    known = limits_of(robot).body
    if missing := [way for way in _axes(robot).values() if way not in known]:
        so = f"the controller has no limit of speed ({', '.join(missing)})"
        left.append(top_speed_left(robot, so))
    share = f"{robot.get('base.sideways_gain') / robot.get('base.forward_gain'):.3g}"
    if share != "1" and robot.model.wheel_kind == "mecanum":
        why = (
            "ros2_control knows one wheel radius; sideways the real robot goes "
            f"{share} times as far as told"
        )
        left.append(Left("base.sideways_gain", why))
    return left


def _parts(robot: RobotModel) -> dict[str, str]:
    """Notes in the file on effects that it does not carry whole."""
    parts = {"wheel_limit": "the body's top speeds alone; the URDF's joints have the wheels' own"}
    if robot.model.wheel_kind == "mecanum":
        parts["speed_limit"] = "its axes are limited each alone, so aslant it is faster"
    if robot.model.drive == "duty":
        parts |= dict.fromkeys(TOPS, "ros2_control has only the top speeds that it leaves")
    return parts


def _axes(robot: RobotModel) -> dict[str, str]:
    """Ways that the robot can go by the controller's axes."""
    axes = {"linear.x": "ahead", "linear.y": "sideways", "angular.z": "turning"}
    return {axis: way for axis, way in axes.items() if way in robot.gains()}


def _limits(robot: RobotModel) -> dict[str, float]:
    """https://control.ros.org: what is not set is not limited; slowing down has limits below 0.

    They are of what the controller is told, which sideways is more than what the robot does of it.
    """
    limits, gains, told = limits_of(robot), robot.gains(), {}
    for axis, way in _axes(robot).items():
        scale = gains["ahead"] / gains[way] if way == "sideways" else 1.0
        if way in limits.body:
            lowest, highest = (_short(scale * top) for top in limits.body[way])
            told |= {f"{axis}.max_velocity": highest, f"{axis}.min_velocity": lowest}
        if way in limits.accelerations:
            most = _short(scale * limits.accelerations[way])
            told |= {f"{axis}.max_acceleration": most, f"{axis}.max_deceleration": -most}
    return told


def _mecanum(robot: RobotModel) -> dict:
    """https://control.ros.org, mecanum_drive_controller."""
    drive = drive_of(robot)
    lever_m = robot.get("robot.half_wheelbase_m") + robot.get("robot.half_track_m")
    words = {"fl": "front_left", "fr": "front_right", "rr": "rear_right", "rl": "rear_left"}
    joints = {f"{w}_wheel_command_joint_name": f"{k}_wheel_joint" for k, w in words.items()}
    return {
        "reference_timeout": TIMEOUT_S,
        **joints,
        "kinematics": {
            "base_frame_offset": {"x": 0.0, "y": 0.0, "theta": 0.0},
            "wheels_radius": _short(drive.radius_m),
            "sum_of_robot_center_projection_on_X_Y_axis": _short(drive.scale * lever_m),
        },
        "base_frame_id": ROOT_LINK,
        "odom_frame_id": "odom",
        **_limits(robot),
    }


def _differential(robot: RobotModel) -> dict:
    """https://control.ros.org, diff_drive_controller."""
    drive, wheels = drive_of(robot), robot.model.wheels()
    gains = wheel_gains(robot)
    sides = {}
    for side in ("left", "right"):
        own = [k for k, w in enumerate(wheels) if (w["y_m"] > 0) == (side == "left")]
        sides[f"{side}_wheel_names"] = [f"{wheels[k]['name']}_wheel_joint" for k in own]
        # Wheels of one side that differ slip, and drive as their mean does.
        sides[f"{side}_wheel_radius_multiplier"] = _short(gains[own].mean())
    return {
        **sides,
        "wheel_separation": _short(2 * drive.scale * robot.get("robot.half_track_m")),
        "wheel_radius": _short(drive.radius_m),
        "cmd_vel_timeout": TIMEOUT_S,
        "base_frame_id": ROOT_LINK,
        "odom_frame_id": "odom",
        **_limits(robot),
    }


def _short(value: float) -> float:
    return float(f"{value:.6g}")


CARRIED = {
    "mecanum": {"acceleration_limit": ALL},
    "differential": {"wheel_gain": ALL, "acceleration_limit": ALL, "speed_limit": ALL},
}
# https://github.com/ros-controls/ros2_controllers, by the changelogs and parameters of each branch.
HEADS = {
    "mecanum": [
        "mecanum_drive_controller obeys limits from 4.41 (Jazzy), 5.16 (Kilted) and 6.8 (Lyrical)",
        "on; Humble's obeys none.",
    ],
    "differential": [
        "Humble's diff_drive_controller obeys limits only where has_velocity_limits and",
        "has_acceleration_limits are set to true beside them, and has no max_deceleration.",
    ],
}
CONTROLLERS = {
    "mecanum": ("mecanum_drive_controller/MecanumDriveController", _mecanum),
    "differential": ("diff_drive_controller/DiffDriveController", _differential),
}
