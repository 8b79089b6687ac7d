# SPDX-License-Identifier: Apache-2.0
"""Errors at some angles of a wheel, as of one that is oval, or flat at a place."""

from collections.abc import Sequence

import numpy as np

from twinmill.diagnosis.families.family import MOST, Family, Humps
from twinmill.fitting.opening import Opened
from twinmill.fitting.wheel_angles import TIMES, Wheel
from twinmill.formulas.term import SWELL, TYPICAL, Term


def of_wheels(opened: Sequence[Opened]) -> list[Family]:
    """One for each of a single log: what others' angles are at their begin is not known."""
    return [_of_wheel(w) for w in opened[0].response.wheels] if len(opened) == 1 else []


def of_rims(opened: Sequence[Opened], velocities: Sequence[np.ndarray]) -> list[Family]:
    """All wheels alike are quicker or slower at some of their speeds.

    Args:
        opened: logs over their floors, of one kind of robot.
        velocities: (N, 3) of the body in each.
    """
    wheels = opened[0].response.wheels
    rims = [np.abs(v @ w.rate) for v in velocities for w in wheels]
    top_radps = max((float(np.quantile(r, MOST)) for r in rims), default=0.0)
    if top_radps <= 0:
        return []
    humps = Humps.over(0.0, top_radps)

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        turns = [(w, (velocity @ w.rate)[:, None]) for w in own.response.wheels]
        added = [(w, np.sign(r) * humps.of(np.abs(r))) for w, r in turns]
        return {k: SWELL * top_radps * sum(w.body[k] * a for w, a in added) for k in range(3)}

    texts = [f"sign(wheel_radps)*{text}" for text in humps.texts("abs(wheel_radps)")]
    return [Family([Term("speed", "rim_mps", t, 1.0, "at some rims") for t in texts], values)]


def _of_wheel(wheel: Wheel) -> Family:
    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        waves = SWELL * wheel.waves(own.response.moved) * (velocity @ wheel.rate)[:, None]
        return {axis: part * waves for axis, part in enumerate(wheel.body)}

    group, size = f"angle of the {wheel.words}", TYPICAL["rim_mps"] / SWELL
    texts = [f"{wave}({n}*wheel_rad)*rim" for wave in ("cos", "sin") for n in TIMES]
    return Family([Term(group, "rim_mps", t, size, "angle") for t in texts], values)
