# SPDX-License-Identifier: Apache-2.0
"""What a steady-state table cannot show, and why."""

from collections.abc import Collection

from twinmill.data.steady_table import Sheet

UNSEEN = {
    "acts only while the speed changes, and a steady table has no starts and stops": (
        "coasting",
        "input_delay",
        "lag_by_duty",
        "motor_lag",
        "reversal_dead_time",
        "slew_limit",
    ),
    "a steady table has no clocks": ("clock_offset", "clock_rate"),
    "a steady table has no poses": ("heading_bias", "marker_offset"),
    "a steady table does not say where and in which direction of the room the robot drove": (
        "carpet_grain",
        "floor_patch",
        "floor_tilt",
        "gain_slope",
    ),
    "a steady table does not say how full the battery was": ("battery_sag",),
    "a steady table does not say how long the robot had been driving": ("heat_gain",),
    "a steady table gives means over many turns of the wheels": ("wheel_eccentricity",),
}


def unseen_by_tables(measurements: Collection[object]) -> dict[str, str]:
    """Effect to reason, if there is nothing but tables; else empty."""
    if not all(isinstance(m, Sheet) for m in measurements):
        return {}
    return {effect: why for why, effects in UNSEEN.items() for effect in effects}
