# SPDX-License-Identifier: Apache-2.0
"""The robot whose files the other programs are given, and its numbers by hand."""

import math
from pathlib import Path

MASS_KG = 1.2  # what the library takes where a model states none
LAG_S, DELAY_S, FORWARD_GAIN = 0.06, 0.03, 0.97
BODY_RADIUS_M, WHEEL_RADIUS_M = 0.1, 0.0325
MARKER_M = (0.02, -0.01)
WHEELS = ("fl", "fr", "rl", "rr")
TOP_MPS = 0.36
TOP_RADPS = TOP_MPS / WHEEL_RADIUS_M
DRAKE = "drake==1.51.1"

TEXT = f"""
name = "robot"
[robot]
wheel_radius_m = {WHEEL_RADIUS_M}
half_wheelbase_m = 0.059
half_track_m = 0.067
body_radius_m = {BODY_RADIUS_M}
mass_kg = {MASS_KG}
[base]
drive = "duty"
wheels = "mecanum"
duty_pct = [0, 100]
wheel_speed_mps = [0, {TOP_MPS}]
motor_lag_s = {LAG_S}
control_period_s = 0.022
forward_gain = {FORWARD_GAIN}
[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
[[effect]]
name = "input_delay"
delay_s = {DELAY_S}
[[effect]]
name = "marker_offset"
x_m = {MARKER_M[0]}
y_m = {MARKER_M[1]}
"""


def write(folder: Path, to: str, text: str = TEXT) -> Path:
    """Its file in the format `to`."""
    import twinmill as tm

    (folder / "robot.toml").write_text(text)
    path = folder / f"robot.{to}"
    tm.Model.load(folder / "robot.toml").export(path, to=to)
    return path


def held_by_drake(path: Path) -> dict[str, bool]:
    """Facts in the plant that Drake makes of a file."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.001)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    joints = [plant.get_joint(k) for k in plant.GetJointIndices()]
    wheels = [joint for joint in joints if joint.type_name() == "revolute"]
    tops_radps = [joint.velocity_upper_limits()[0] for joint in wheels]
    wheel = plant.GetBodyByName("fl_wheel").default_spatial_inertia()
    axial_kgm2 = 0.5 * wheel.get_mass() * WHEEL_RADIUS_M**2
    return {
        "mass": math.isclose(plant.CalcTotalMass(plant.CreateDefaultContext()), MASS_KG),
        "wheels' joints": {joint.name() for joint in wheels}
        == {f"{w}_wheel_joint" for w in WHEELS},
        "top speed of wheels": all(abs(top / TOP_RADPS - 1) < 1e-4 for top in tops_radps),
        "inertia": math.isclose(wheel.CalcRotationalInertia().get_moments().max(), axial_kgm2),
        "free to move": plant.GetBodyByName("base_link").is_floating_base_body()
        or (
            plant.HasBodyNamed("base_footprint")
            and plant.GetBodyByName("base_footprint").is_floating_base_body()
        ),
        "motors of the wheels": plant.num_actuators() == len(WHEELS),
    }
