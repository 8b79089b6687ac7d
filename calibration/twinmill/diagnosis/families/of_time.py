# SPDX-License-Identifier: Apache-2.0
"""What drifts with time: all that is captured moves or turns, or the robot veers."""

import numpy as np

from twinmill.diagnosis.families.family import Family, pushed
from twinmill.diagnosis.term import CHANNELS, TIME, TYPICAL, Term, moves
from twinmill.fitting.opening import Opened

PARTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the time of all logs: where something may have changed
DRIFTS = 5  # waves of a drift, the slowest over the whole log


def of_drift(t_s: np.ndarray) -> list[Family]:
    """Slow waves over the time of all logs, (N,) s."""
    longest_s = 1.1 * float(np.ptp(t_s))
    rates = [float(f"{2 * np.pi * k / longest_s:.4g}") for k in range(1, 1 + DRIFTS)]
    texts = [f"{wave}({rate:g}*t)" for wave in ("cos", "sin") for rate in rates]

    def swinging(own: Opened) -> np.ndarray:
        angle = own.floor.response.middle_s[:, None] * np.array(rates)
        return np.hstack([np.cos(angle), np.sin(angle)])

    def moving(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return pushed(own, swinging(own))

    def turning(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: TYPICAL["omega_radps"] * swinging(own)}

    def veering(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        return {2: TYPICAL["omega_radps"] * swinging(own) * moves(velocity)[:, None]}

    at_s = [float(f"{a:.4g}") for a in np.quantile(t_s, PARTS)]
    along = [f"drift({axis}, {t})" for axis in "xy" for t in texts]
    veers = [f"{t}*moves" for t in texts]
    return [
        Family([Term(TIME, CHANNELS[0], t, 1.0, "drift") for t in along], moving),
        Family([Term(TIME, CHANNELS[2], t, 1.0, "drift of heading") for t in texts], turning),
        Family([Term(TIME, CHANNELS[2], t, 1.0, "veers at times") for t in veers], veering),
        *(_veering_from(a) for a in at_s),
    ]


def _veering_from(at_s: float) -> Family:
    """It veers while it moves, before a moment in another way than after it."""

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        after = np.sign(own.floor.response.middle_s - at_s)
        return {
            2: TYPICAL["omega_radps"] * moves(velocity)[:, None] * np.stack([after**2, after], 1)
        }

    texts = (f"({at_s:g} > 0)*moves", f"sign(t - {at_s:g})*moves")
    return Family([Term(TIME, CHANNELS[2], t, 1.0, f"veers from {at_s:g}") for t in texts], values)
