# SPDX-License-Identifier: Apache-2.0
"""Wheel speeds in another unit, or of motors before a gear: told by how far the robot rolls."""

import numpy as np

from twinmill.arguments import option
from twinmill.data.checks.axle import FAINT
from twinmill.data.checks.finding import InputFinding
from twinmill.data.checks.settings import CHECKS
from twinmill.data.track import Track, command_at, local_line
from twinmill.data.units import UNITS

STEADY_S = (-0.5, -0.25, 0.0, 0.25, 0.5)  # about a pose: clocks and lags lie within
HALF_S = 0.15  # of the line that tells a speed
OF_WHEELS = (  # of a wheel's speed, in rad/s
    ("revolutions per second", 2 * np.pi),
    ("revolutions per minute", np.pi / 30),
    ("degrees per second", np.pi / 180),
    ("radians per minute", 1 / 60),
)
LENGTHS = {"inch": "inches", "cm": "centimetres", "mm": "millimetres"}  # of positions


def check_rolling(track: Track, label: str) -> list[InputFinding]:
    """A finding where no wheel rolls as far in a radian as the robot does, whatever the model."""
    if track.command_kind != "wheel_speed":
        return []
    rolled_m = _rolled_m(track)
    if rolled_m is None or CHECKS.least_wheel_m <= rolled_m <= CHECKS.most_wheel_m:
        return []
    units = [
        f"{unit}, on wheels of {1e3 * rolled_m / factor:.0f} mm ({_option(factor)})"
        for unit, factor in OF_WHEELS
        if CHECKS.least_wheel_m <= rolled_m / factor <= CHECKS.most_wheel_m
    ]
    units += [
        f"the positions in {name}, on wheels of {1e3 * rolled_m * UNITS[unit][1]:.0f} mm "
        f"({option('rename', {axis: f'{axis[0]}_{unit}' for axis in ('x_m', 'y_m')})})"
        for unit, name in LENGTHS.items()
        if CHECKS.least_wheel_m <= rolled_m * UNITS[unit][1] <= CHECKS.most_wheel_m
    ]
    if rolled_m < CHECKS.least_wheel_m:
        least, most = (m / rolled_m for m in (CHECKS.least_wheel_m, CHECKS.most_wheel_m))
        units.append(
            f"those of motors before a gear of 1:{least:.0f} to 1:{most:.0f} "
            f"({option('wheel_factor')} with "
            "1 over the gear's ratio, times that of the unit)"
        )
    return [
        InputFinding(
            "the wheel speeds are not the wheels' in rad/s, or the positions not in m",
            f"the robot rolls {1e3 * rolled_m:.2g} mm in a radian of them, which would be the "
            "radius of its wheels",
            f"they may be {', or '.join(units) or 'of another robot'}: import anew",
            True,
            label,
            track.robot_id,
        )
    ]


def _option(factor: float) -> str:
    return option("wheel_factor", float(f"{factor:.5g}"))


def factor_words(ratio: float) -> tuple[str, str] | None:
    """Names for the ratio by which the robot is slower or faster than told, and the remedy."""
    near = [(unit, f) for unit, f in OF_WHEELS if 1 / CHECKS.unit_off < ratio / f < CHECKS.unit_off]
    if near:
        names = " or ".join(unit for unit, _ in near)
        mend = " or ".join(_option(factor) for _, factor in near)
        return f"the wheel speeds are in {names}", f"import anew with {mend}"
    if ratio < CHECKS.geared:
        return (
            f"the wheel speeds are of motors before a gear of about 1:{1 / ratio:.0f}, or in "
            "another unit",
            f"import anew with {option('wheel_factor', float(f'{ratio:.3g}'))}, or with the gear's "
            "own ratio",
        )
    return None


def _rolled_m(track: Track) -> float | None:
    """How far the robot goes in a radian of its wheels, where all turn one way; None if unknown."""
    half_s = max(HALF_S, 1.5 * track.timing.pose_period_s)
    _, slope = local_line(track.pose_t_s, track.pose, track.segment, half_s)
    velocity_mps = slope[:, 0] + 1j * slope[:, 1]
    told = np.stack(
        [command_at(track.pose_t_s + s, track.command_t_s, track.command) for s in STEADY_S]
    )
    ahead = (told > 0).all(axis=(0, 2)) | (told < 0).all(axis=(0, 2))
    seen = ahead & (np.abs(velocity_mps) > CHECKS.least_mps)  # NaN compares false
    mean_radps, moved_mps = told.mean(axis=(0, 2))[seen], velocity_mps[seen]
    if track.has_heading:
        moved_mps *= np.exp(-1j * track.heading_smooth[seen])
        moved_mps = _of_axle(moved_mps, slope[seen, 2], mean_radps)
    moves = np.abs(moved_mps) > CHECKS.least_mps
    if np.count_nonzero(moves) < max(CHECKS.fewest_poses, np.count_nonzero(ahead) / 2):
        return None
    return float(np.median(np.abs(moved_mps / mean_radps)[moves]))


def _of_axle(point_mps: np.ndarray, turn_radps: np.ndarray, mean_radps: np.ndarray) -> np.ndarray:
    """(N,) complex velocity of the point that the robot turns about, ahead + i left, m/s.

    Turns lead a point off the axle round it, at any distance: what they explain of the velocity
    beside the wheels is taken out (Frisch and Waugh 1933).

    Args:
        point_mps: (N,) velocity of the tracked point, ahead + i left.
        turn_radps: (N,) rate of turning.
        mean_radps: (N,) mean of the wheels.
    """
    turns = np.stack([point_mps, mean_radps.astype(complex)])
    scale = (1 + FAINT) * np.sum(turn_radps**2) + 1e-12
    point, mean = turns - np.outer(turns @ turn_radps / scale, turn_radps)
    rolled_m = (point @ mean.real) / max(np.sum(mean.real**2), 1e-12)
    led_m = (point_mps - rolled_m * mean_radps) @ turn_radps / scale
    return point_mps - led_m * turn_radps
