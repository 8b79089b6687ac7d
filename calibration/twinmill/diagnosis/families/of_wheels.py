# SPDX-License-Identifier: Apache-2.0
"""What a wheel does at some of its angles, as one that is oval, or flat at a place."""

from collections.abc import Sequence

import numpy as np

from twinmill.diagnosis.families.family import Family
from twinmill.diagnosis.term import SWELL, TYPICAL, Term
from twinmill.fitting.opening import Opened
from twinmill.fitting.wheel_angles import TIMES, Wheel


def of_wheels(opened: Sequence[Opened]) -> list[Family]:
    """One for each of a single log: what others' angles are at their begin is not known."""
    return [_of_wheel(w) for w in opened[0].floor.response.wheels] if len(opened) == 1 else []


def _of_wheel(wheel: Wheel) -> Family:
    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        waves = SWELL * wheel.waves(own.floor.response.moved) * (velocity @ wheel.rate)[:, None]
        return {axis: part * waves for axis, part in enumerate(wheel.body)}

    group, size = f"angle of the {wheel.words}", TYPICAL["rim_mps"] / SWELL
    texts = [f"{wave}({n}*wheel_rad)*rim" for wave in ("cos", "sin") for n in TIMES]
    return Family([Term(group, "rim_mps", t, size, "angle") for t in texts], values)
