# SPDX-License-Identifier: Apache-2.0
"""Robots for the blind test: drawn, unlike any model file, with plants in formulas of their own."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Plant = Literal["planar", "mujoco", "rollers"]
KINDS = (  # plant, what is commanded, wheels
    ("planar", "duty", "mecanum"),
    ("mujoco", "duty", "mecanum"),
    ("planar", "wheel_speed", "omni3"),
    ("rollers", "duty", "mecanum"),
    ("planar", "duty", "differential"),
    ("planar", "twist", "none"),
)
OMNI3_RAD = np.radians([60.0, 180.0, 300.0])
NODES = np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0])  # of the owner's table of speeds


@dataclass(frozen=True)
class Robot:
    """A robot as it normally is.

    Attributes:
        plant: what moves it.
        drive: what its log holds: duty, wheel_speed or twist, as in a model file.
        wheels: mecanum, differential, omni3 or none.
        top_mps: of a wheel's rim at full duty; of the body, if it is driven by velocities.
        bend: how far its speeds saturate: v = top (1 - exp(-bend u)) / (1 - exp(-bend)).
        lag_s: of wheels or body, first order.
        gains: forward, sideways, turning: what the floor leaves of what the wheels say.
        control_hz, pose_hz: rows a second of commands and of poses.
        sensor_m, sensor_rad: white noise of a pose.
        drive_mps, drive_radps, drive_s: disturbance of the motion and its memory.
        offset_s: capture's clock less the robot's; 0 where one clock is declared.
    """

    plant: Plant
    drive: Literal["duty", "wheel_speed", "twist"]
    wheels: Literal["mecanum", "differential", "omni3", "none"]
    wheel_radius_m: float
    half_wheelbase_m: float
    half_track_m: float
    top_mps: float
    bend: float
    lag_s: float
    gains: tuple[float, float, float]
    mass_kg: float
    control_hz: float
    pose_hz: float
    sensor_m: float
    sensor_rad: float
    drive_mps: float
    drive_radps: float
    drive_s: float
    offset_s: float
    same_clock: bool

    @property
    def sideways(self) -> bool:
        """True if it can move to its left without turning."""
        return self.wheels != "differential"

    @property
    def to_wheels(self) -> np.ndarray:
        """(4 or 3, 3) rim speeds in m/s from forward, left in m/s and turn in rad/s."""
        if self.wheels == "omni3":
            lever = np.full(3, self.half_track_m)
            return np.column_stack([-np.sin(OMNI3_RAD), np.cos(OMNI3_RAD), lever])
        if self.wheels == "differential":
            t = self.half_track_m
            return np.array([[1, 0, -t], [1, 0, t], [1, 0, -t], [1, 0, t]])
        lever = self.half_wheelbase_m + self.half_track_m
        return np.array([[1, -1, -lever], [1, 1, lever], [1, 1, -lever], [1, -1, lever]])

    @property
    def to_body(self) -> np.ndarray:
        """(3, 4 or 3), the least-squares inverse of `to_wheels`."""
        return np.linalg.pinv(self.to_wheels)

    def speed_mps(self, duty: np.ndarray) -> np.ndarray:
        """Steady speed of a rim at a duty in -1..1."""
        rise = (1 - np.exp(-self.bend * np.abs(duty))) / (1 - np.exp(-self.bend))
        return np.sign(duty) * self.top_mps * rise

    def sheet(self, random: np.random.Generator) -> str:
        """Its model file as an owner writes it down: a few percent off."""

        def about(value: float, share: float) -> float:
            return round(float(value * (1 + share * random.standard_normal())), 5)

        table = [about(v, 0.02) for v in self.speed_mps(NODES)]
        lag_s = about(self.lag_s, 0.2) if self.drive != "wheel_speed" else 0
        lines = [
            *('name = "drawn"', "[robot]", f"wheel_radius_m = {self.wheel_radius_m:.5f}"),
            f"half_wheelbase_m = {self.half_wheelbase_m:.4f}",
            f"half_track_m = {self.half_track_m:.4f}",
            *("battery_nominal_V = 7.4", "[base]", f'drive = "{self.drive}"'),
            *(f'wheels = "{self.wheels}"', f"control_period_s = {1 / self.control_hz:.4f}"),
            f"motor_lag_s = {lag_s}",
        ]
        if self.drive == "duty":
            lines += [f"duty_pct = {[round(100 * float(n), 1) for n in NODES]}"]
            lines += [f"wheel_speed_mps = {table}"]
        else:
            lines += [f"forward_gain = {about(self.gains[0], 0.02)}"]
        lines += [f"sideways_gain = {about(self.gains[1], 0.03)}"] if self.sideways else []
        lines += [f"yaw_gain = {about(self.gains[2], 0.03)}"]
        lines += ["[clock]", "same = true"] if self.same_clock else []
        return "\n".join(lines) + "\n"


def draw_robot(number: int, random: np.random.Generator) -> Robot:
    """The robot of one of KINDS, in turn."""
    plant, drive, wheels = KINDS[number % len(KINDS)]
    small = plant != "planar"
    pose_hz = float(random.choice([20, 30, 50, 100, 120]))
    coarse = 3 if pose_hz < 40 else 1
    same_clock = bool(random.random() < 0.5)
    usual = (0.97, 0.95, 0.97) if plant == "mujoco" else (0.95, 0.87, 0.93)
    drawn = (1.0, random.uniform(0.85, 0.98), random.uniform(0.82, 1.04))
    return Robot(
        plant=plant,
        drive=drive,
        wheels=wheels,
        wheel_radius_m=float(random.uniform(0.03, 0.05 if small else 0.08)),
        half_wheelbase_m=float(random.uniform(0.05, 0.11 if small else 0.2)),
        half_track_m=float(random.uniform(0.06, 0.12 if small else 0.2)),
        top_mps=float(random.uniform(0.25, 0.45 if small else 0.7)),
        bend=float(random.uniform(0.5, 2.5)),
        lag_s=float(random.uniform(0.04, 0.15)) * (2 if drive == "twist" else 1),
        gains=usual if small else tuple(float(g) for g in drawn),
        mass_kg=float(random.uniform(0.9, 1.8)),
        control_hz=float(random.choice([20, 25, 45, 50])),
        pose_hz=pose_hz,
        sensor_m=float(coarse * random.uniform(1e-4, 6e-4)),
        sensor_rad=float(coarse * random.uniform(6e-4, 3e-3)),
        drive_mps=float(random.uniform(2e-3, 6e-3)),
        drive_radps=float(random.uniform(0.01, 0.035)),
        drive_s=float(random.uniform(0.08, 0.4)),
        offset_s=0.0 if same_clock else float(random.uniform(-0.15, 0.15)),
        same_clock=same_clock,
    )
