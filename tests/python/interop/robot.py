# SPDX-License-Identifier: Apache-2.0
"""The robot whose files the other programs are given, and its numbers by hand."""

from pathlib import Path

MASS_KG = 1.2  # what the library takes where a model states none
LAG_S, DELAY_S, FORWARD_GAIN = 0.06, 0.03, 0.97
BODY_RADIUS_M, WHEEL_RADIUS_M = 0.1, 0.0325
MARKER_M = (0.02, -0.01)
WHEELS = ("fl", "fr", "rl", "rr")

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
wheel_speed_mps = [0, 0.36]
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
