# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide the noise floor, and when a fit ends; reports and JSON output print them.

Which features a response may use, and the grids that are searched, stand where they are used.
"""

from dataclasses import dataclass

from twinmill.settings import Numbers, number


@dataclass(frozen=True)
class FloorSettings(Numbers):
    """Numbers of the noise floor, in the order in which it is found."""

    fewest_windows: int = number(40, "windows below which a log has no floor: 10 s")
    fewest_long: int = number(20, "the same of windows that have the longest horizon")

    # Disturbances: pushed, slipped, or a lost pose.
    bump: float = number(20.0, "times the median squared error: a window that is left out ...")
    bump_part: float = number(4.0, "... and so many times, of windows that overlap such a one ...")
    rare_bumps: float = number(0.1, "... if all these are less than this share of the windows")
    most_bumps: float = number(0.25, "share of bumped windows, beyond which none is left out")
    lasts_s: float = number(4.0, "what lasts so long is no bump, and is judged, if ...")
    least_way: float = number(0.3, "... so much of the way is gone all the time ...")
    uneven: float = number(0.3, "... and one share of the way leaves less than this of the miss")

    # The smooth response.
    ridge_worth: float = number(0.998, "a ridge is taken if it lowers the error to this share")
    group_worth: float = number(0.04, "share of the left-out error that a group must take ...")
    group_chance: float = number(4.0, "... or so many times ln(groups) / independent errors")
    most_groups: int = number(8, "groups that are added for the plane, and for turning")


FLOOR_SETTINGS = FloorSettings()


@dataclass(frozen=True)
class FitSettings(Numbers):
    """When a fit ends."""

    rounds: int = number(12, "steps of Levenberg and Marquardt, at most")
    tolerance: float = number(1e-2, "fall of the cost, of 100 independent errors, that ends a fit")


FIT_SETTINGS = FitSettings()
