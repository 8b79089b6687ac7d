# SPDX-License-Identifier: Apache-2.0
"""An alternative in words: what is wrong, and the options of an import that mend it."""

from typing import Any

import numpy as np

from twinmill.data.checks.alternatives import Alternative
from twinmill.data.checks.settings import CHECKS
from twinmill.data.log import CommandKind

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


Mend = dict[str, Any]  # options of an import


def described(a: Alternative, kind: CommandKind, turned_rad: float) -> tuple[str, Mend]:
    """Fault as a clause, with the options that put it right.

    Args:
        a: what is wrong.
        kind: of the commands.
        turned_rad: angle that goes with it.
    """
    if a.of_poses:
        return _of_poses(a, float(np.degrees(turned_rad)))
    names = COLUMNS[kind]
    what: list[str] = []
    if a.place in SIDES and kind != "twist":
        what.append(SIDES[a.place])
    else:
        moved = [k for k, p in enumerate(a.place) if p != k]
        if len(moved) == 2:
            what.append(f"{names[moved[0]]} and {names[moved[1]]} are swapped")
        elif moved:
            order = ", ".join(f"{names[a.place[k]]} is {names[k]}" for k in moved)
            what.append(f"the columns are in another order ({order})")
    renames = {names[p]: names[k] for k, p in enumerate(a.place) if p != k}
    flips = [names[k] for k, s in enumerate(a.sign) if s < 0]
    if a.sign in FLIPS and kind != "twist":
        what.append(FLIPS[a.sign])
    else:
        what += [f"{name} has the wrong sign" for name in flips]
    mend = {"rename": renames, "flip": flips}
    return " and ".join(what), {name: value for name, value in mend.items() if value}


def _of_poses(a: Alternative, turned_deg: float) -> tuple[str, Mend]:
    turn = {"heading_offset_deg": round(turned_deg)}
    side = "left" if turned_deg > 0 else "right"
    turned = f"the robot's front is {abs(turned_deg):.0f} degrees to the {side} of its heading"
    if a.heading_sign < 0 and a.mirrored:
        what = "the poses are mirrored (y points to the right)"
        mend: Mend = {"flip": ["y_m", "theta_rad"]}
    elif a.heading_sign < 0:
        what, mend = "the heading is counted clockwise", {"flip": ["theta_rad"]}
    elif a.mirrored:
        return _mirrored_positions(turned_deg if a.turned else 0.0, turned, turn)
    else:
        return turned, turn
    if a.turned and abs(turned_deg) > CHECKS.right_angle_deg:
        return f"{what}, and {turned}", {**mend, **turn}
    return what, mend


def _mirrored_positions(turned_deg: float, turned: str, turn: Mend) -> tuple[str, Mend]:
    """The mirror axis follows from the angle that is left over."""
    swap = {"rename": {"x_m": "y_m", "y_m": "x_m"}}
    axes: dict[int, tuple[str, Mend]] = {
        0: ("y has the wrong sign", {"flip": ["y_m"]}),
        180: ("x has the wrong sign", {"flip": ["x_m"]}),
        -90: ("x and y are swapped", swap),
        90: ("x and y are swapped and have the wrong sign", {**swap, "flip": ["x_m", "y_m"]}),
    }
    for angle_deg, words in axes.items():
        if abs((turned_deg - angle_deg + 180) % 360 - 180) < CHECKS.right_angle_deg:
            return words
    return f"the positions are mirrored, and {turned}", {"flip": ["y_m"], **turn}
