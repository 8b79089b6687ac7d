# SPDX-License-Identifier: Apache-2.0
"""A marker that leans with the body, or on its mast, out of curves and back as the robot speeds up.

It stands off by a length in proportion to the acceleration: there is no velocity of its own, but as
long as the acceleration changes.
"""

from collections.abc import Callable, Sequence

import numpy as np

from twinmill.diagnosis.families.family import MOST, Family
from twinmill.fitting.dependence import in_curves, led_by, while_speeding_up
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANGE, CHANNELS, COUPLING, TYPICAL, Term

# From (N, 3) velocities and (N,) lengths of steps to (N, 2) m/s^2.
Lean = Callable[[np.ndarray, np.ndarray], np.ndarray]


def of_leaning(opened: Sequence[Opened], velocities: Sequence[np.ndarray]) -> list[Family]:
    """In curves, and while the speed changes.

    Args:
        opened: logs over their floors.
        velocities: (N, 3) of the body in each, m/s and rad/s, at the points of its response.
    """
    kinds = ((COUPLING, "lean(omega*v)", in_curves), (CHANGE, "lean(dv)", while_speeding_up))
    found = []
    for group, text, lean in kinds:
        moved = [_moved(lean, o, v) for o, v in zip(opened, velocities, strict=True)]
        size = float(np.quantile(np.abs(np.concatenate(moved)), MOST))
        if size > 1e-9:
            found.append(_leaning(Term(group, CHANNELS[1], text, size, text), lean))
    return found


def _moved(lean: Lean, own: Opened, velocity: np.ndarray) -> np.ndarray:
    """(N, 2) velocity of a marker that leans by a metre for each m/s^2."""
    step_s = own.response.step_s
    return led_by(lean(velocity, step_s), velocity, step_s)


def _leaning(term: Term, lean: Lean) -> Family:
    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        moved = TYPICAL[term.adds_to] / term.size * _moved(lean, own, velocity)
        return {0: moved[:, [0]], 1: moved[:, [1]]}

    return Family([term], values)
