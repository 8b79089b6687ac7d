# SPDX-License-Identifier: Apache-2.0
"""An alternative in words: what is wrong, and the options of `twinmill import` that mend it."""

import re

import numpy as np

from twinmill.data.checks.alternatives import Alternative
from twinmill.data.checks.settings import CHECKS
from twinmill.data.log import CommandKind

OF_A_ROBOT = re.compile(r"(--flip|--rename|--heading-offset-deg|--pose-shift-s)[ =]")
COLUMNS: dict[CommandKind, tuple[str, ...]] = {
    "duty": ("fl_pct", "fr_pct", "rl_pct", "rr_pct"),
    "wheel_speed": ("w1_radps", "w2_radps", "w3_radps", "w4_radps"),
    "twist": ("vx_mps", "vy_mps", "omega_radps", ""),
}
SIDES = {
    (1, 0, 3, 2): "the left and the right wheels are swapped",
    (2, 3, 0, 1): "the front and the rear wheels are swapped",
}
FLIPS = {
    (-1, -1, -1, -1): "all wheels have the wrong sign",
    (-1, 1, -1, 1): "the left wheels have the wrong sign",
    (1, -1, 1, -1): "the right wheels have the wrong sign",
}


def described(
    a: Alternative, kind: CommandKind, turned_rad: float, own: str = ""
) -> tuple[str, str]:
    """What is wrong, a clause; and options that put it right.

    Args:
        a: what is wrong.
        kind: of the commands.
        turned_rad: angle that goes with it.
        own: before what an option says of one robot; empty: of all.
    """
    if a.of_poses:
        what, options = _of_poses(a, float(np.degrees(turned_rad)))
        return what, of_robot(options, own)
    names = COLUMNS[kind]
    what, options = [], []
    if a.place in SIDES and kind != "twist":
        what.append(SIDES[a.place])
    else:
        moved = [k for k, p in enumerate(a.place) if p != k]
        if len(moved) == 2:
            what.append(f"{names[moved[0]]} and {names[moved[1]]} are swapped")
        elif moved:
            order = ", ".join(f"{names[a.place[k]]} is {names[k]}" for k in moved)
            what.append(f"the columns are in another order ({order})")
    options += [f"--rename {names[p]}={names[k]}" for k, p in enumerate(a.place) if p != k]
    if a.sign in FLIPS and kind != "twist":
        what.append(FLIPS[a.sign])
    else:
        wrong = [names[k] for k, s in enumerate(a.sign) if s < 0]
        what += [f"{name} has the wrong sign" for name in wrong]
    options += [f"--flip {names[k]}" for k, s in enumerate(a.sign) if s < 0]
    return " and ".join(what), of_robot(" ".join(options), own)


def of_robot(options: str, own: str) -> str:
    """Options that hold for one robot alone, where there are others: `R02=`; else empty."""
    return OF_A_ROBOT.sub(rf"\g<1> {own}", options) if own else options


def of_all(remedy: str, own: str) -> str:
    """A remedy of one robot, as it is told where it is that of all."""
    for option, before in (("--heading-offset-deg", "="), ("--pose-shift-s", "="), ("", " ")):
        remedy = remedy.replace(f"{option} {own}", f"{option}{before}")
    return remedy


def _of_poses(a: Alternative, turned_deg: float) -> tuple[str, str]:
    turn = f"--heading-offset-deg={turned_deg:.0f}"
    side = "left" if turned_deg > 0 else "right"
    turned = f"the robot's front is {abs(turned_deg):.0f} degrees to the {side} of its heading"
    if a.heading_sign < 0 and a.mirrored:
        what, options = (
            "the poses are mirrored (y points to the right)",
            "--flip y_m --flip theta_rad",
        )
    elif a.heading_sign < 0:
        what, options = "the heading is counted clockwise", "--flip theta_rad"
    elif a.mirrored:
        return _mirrored_positions(turned_deg if a.turned else 0.0, turned, turn)
    else:
        return turned, turn
    if a.turned and abs(turned_deg) > CHECKS.right_angle_deg:
        return f"{what}, and {turned}", f"{options} {turn}"
    return what, options


def _mirrored_positions(turned_deg: float, turned: str, turn: str) -> tuple[str, str]:
    """The mirror axis follows from the angle that is left over."""
    axes = {
        0: ("y has the wrong sign", "--flip y_m"),
        180: ("x has the wrong sign", "--flip x_m"),
        -90: ("x and y are swapped", "--rename x_m=y_m --rename y_m=x_m"),
        90: (
            "x and y are swapped and have the wrong sign",
            "--rename x_m=y_m --rename y_m=x_m --flip x_m --flip y_m",
        ),
    }
    for angle_deg, words in axes.items():
        if abs((turned_deg - angle_deg + 180) % 360 - 180) < CHECKS.right_angle_deg:
            return words
    return f"the positions are mirrored, and {turned}", f"--flip y_m {turn}"
