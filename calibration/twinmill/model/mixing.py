# SPDX-License-Identifier: Apache-2.0
"""Robot inputs to wheel duties, for logs that hold only inputs.

fw_mix in firmware/core takes whole percents of speed alone; logs of other programs hold fractions.
At whole percents both give the same (tests). Duties in percent, order front-left, front-right,
rear-left, rear-right.
"""

import math

TURN_LEVER_PCT = 126  # a + b = 67 + 59 in the vendor's mecanum.py

Duties = tuple[int, int, int, int]


def duties_from_inputs(speed_input: float, turn_input: float) -> Duties:
    """Duties that our firmware sends; turn positive counter-clockwise. Thousandths, exact."""
    speed, turn = round(1000 * speed_input), TURN_LEVER_PCT * round(1000 * turn_input)
    left, right = _duty((speed - turn) / 1000), _duty((speed + turn) / 1000)
    return left, right, left, right


def duties_from_vendor_move(speed: float, direction_deg: float, turn: float) -> Duties:
    """Duties that the vendor's program sends for (v, d, w): d = 90 is forward, w clockwise.

    Its rounding is kept: (50, 270, 0) gives (-50, -49, -49, -50).
    """
    fl, fr, rl, rr = map(_duty, asked_by_vendor_move(speed, direction_deg, turn))
    return fl, fr, rl, rr


def asked_by_vendor_move(
    speed: float, direction_deg: float, turn: float
) -> tuple[float, float, float, float]:
    """Duties that such a move asks for, neither rounded nor cut at full duty."""
    vx = speed * math.cos(math.radians(direction_deg))
    vy = speed * math.sin(math.radians(direction_deg))
    vp = -turn * TURN_LEVER_PCT
    return vy + vx - vp, vy - vx + vp, vy - vx - vp, vy + vx + vp


def _duty(value: float) -> int:
    return max(-100, min(100, int(value)))
