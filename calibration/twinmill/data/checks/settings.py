# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide the checks of the input, in one record: reports and JSON output print it.

Grids that are searched, and the units that a ratio may stand for, stay where they are used.
"""

from dataclasses import dataclass

import numpy as np

from twinmill.settings import Numbers, number


@dataclass(frozen=True)
class CheckSettings(Numbers):
    """Numbers of the checks; `left` is the share of the squared motion that stays unexplained."""

    # Signs, columns, axes and clocks: commands against poses.
    good: float = number(0.03, "left at which no mistake is looked for")
    far_better: float = number(0.5, "times what is left: a mistake explains so much more ...")
    sure: float = number(4.0, "... and surely: standard errors over stretches of the log")
    alike: float = number(1.3, "times what the best mistake leaves: another is as good ...")
    alike_left: float = number(0.003, "... and so much beside it")
    steps: float = number(0.6, "simple mistakes more: an alternative is no less simple")
    explained: float = number(0.5, "left beyond which nothing is said of units")
    unrelated: float = number(0.85, "left at which commands and poses belong to other runs")
    poor: float = number(0.25, "left from which clocks far apart are looked for")
    turned_rad: float = number(0.35, "heading offset that is no effect of physics")
    right_angle_deg: float = number(25.0, "an axis that is nearer than this to another is that one")
    least_mps: float = number(0.01, "RMS speed below which nothing is said ...")
    least_radps: float = number(0.2, "... if the robot turns no faster than this")
    least_wheel_m: float = number(0.008, "radius of a robot's wheel, at least ...")
    most_wheel_m: float = number(0.17, "... and at most: beyond, wheel speeds are in another unit")
    unit_off: float = number(1.4, "times that a model's wheels may be off where a unit is told ...")
    geared: float = number(0.06, "... and share of the speed below which a gear is looked for")
    turns: float = number(0.05, "share of the time with turns, from which a heading is needed")
    fewest_poses: int = number(20, "poses below which nothing is said")
    fewest_blocks: int = number(8, "stretches of 3 s below which nothing is said")
    one_clock_s: float = number(
        0.03, "and half a frame: by which poses and commands of one clock are apart, if told"
    )
    least_jump_s: float = number(0.15, "step of a clock: less may be two delays")
    drift_left: float = number(0.3, "left up to which a drift of clocks is looked for ...")
    drift_span_s: float = number(30.0, "... in logs of this length at least")
    least_ppm: float = number(870.0, "drift of clocks: less is for fits, robots imitate it ...")
    drift_sure: float = number(7.0, "... and so many standard errors")
    most_ppm: float = number(1500.0, "drift beyond which steps may be behind it as well")
    step_sure: float = number(2.0, "standard errors by which a step explains more than a drift")
    least_step_s: float = number(0.04, "step of lateness: less may be how the robot is driven ...")
    step_leaves: float = number(0.5, "... times what is left without it, or by lags, at most, ...")
    step_seen: float = number(8.0, "... and as sure as this: its standard errors")
    speaks: float = number(0.5, "times a usual rest: by so much a stretch speaks for a shift ...")
    speakers: int = number(3, "... at least so many do on either side of a step, ...")
    against: float = number(0.1, "... times what speaks for it: less speaks against it, ...")
    alone: float = number(0.9, "... and none has more of it than this share")
    reach_s: float = number(0.3, "a stretch whose shift is off by more counts as off by so much")
    shape_sure: float = number(6.0, "by which the cost of a shape of lateness is less than others'")
    back_share: float = number(0.25, "of a step: a second one that ends so near is back")
    skips: float = number(0.5, "of a step missing in the beat of stamps: their clock was set")
    acting_later_s: float = number(0.5, "a longer step of what the commands do no diagnosis tells")

    # A while in which the motion has nothing to do with the commands.
    foreign: float = number(0.7, "left by any share of the commands: they are not the motion's ...")
    foreign_loses: float = number(0.5, "... left by the commands as elsewhere, in such a while ...")
    foreign_moves: float = number(0.3, "... with so much of the squared motion that is told ...")
    foreign_commands: int = number(6, "... and so many changes of the command ...")
    foreign_s: float = number(6.0, "... in so long: a bump or a slip is shorter")
    foreign_most: int = number(4, "whiles that are looked at")

    # Poses alone: axes, units, headings that are none, how much there is.
    leap_m: float = number(0.1, "from pose to pose, and soon back to a fifth of it ...")
    leaps: float = number(0.2, "... in so many of all: two robots under one number")
    back: float = number(0.6, "share of commands that leap and are soon back: those of two robots")
    back_s: float = number(0.3, "for two of them: slower ones are driven to and fro")
    fastest_mps: float = number(25.0, "usual top speed over half a second: units are wrong ...")
    mm_mps: float = number(100.0, "... and from here they are mm: cm would make it 1 m/s")
    flat_m: float = number(0.05, "range of a height over a floor")
    lies_share: float = number(0.2, "of the longer side: a flat coordinate is smaller")
    up_m: float = number(0.3, "range of z from which another axis is up")
    noisy_rad: float = number(float(np.radians(3)), "noise of headings that is worth a sentence")
    nonsense_rad: float = number(float(np.radians(20)), "noise of headings that are none")
    lost: float = number(0.2, "share of lost frames that is worth a sentence")
    slow_s: float = number(0.15, "time between poses that is worth a sentence")
    short_s: float = number(13.0, "usable poses, below which a log is short")
    still_rad: float = number(1e-6, "range of a heading that was not measured")
    absurd: float = number(100.0, "times all other commands: one is a mistake of the record")
    driven_s: float = number(3.0, "strong commands that must move the robot, in all ...")
    driven: float = number(0.05, "... and as a share of the time")


CHECKS = CheckSettings()
