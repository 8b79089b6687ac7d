# SPDX-License-Identifier: Apache-2.0
"""Families of terms that are judged together, each of which acts in one narrow range.

A dip of the speed at one speed, a strip of floor that tilts, or a liquid that swings after each
change of the command has no form that is known before. A few humps over the speed, over the place,
or over the time since, take any of them; and a few slow waves take a capture that drifts.
"""

from collections.abc import Sequence

import numpy as np

from twinmill.diagnosis.families.family import Family
from twinmill.diagnosis.families.of_leaning import of_leaning
from twinmill.diagnosis.families.of_memory import of_memory
from twinmill.diagnosis.families.of_past import of_past
from twinmill.diagnosis.families.of_room import of_course, of_places, of_pushes
from twinmill.diagnosis.families.of_speed import across_axes, of_speed
from twinmill.diagnosis.families.of_time import beat_of, of_beat, of_drift
from twinmill.diagnosis.families.of_wheels import of_rims, of_wheels
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import STILL

COURSES = (1, 2, 4)  # times a turn


def families_of(opened: Sequence[Opened], velocities: Sequence[np.ndarray]) -> list[Family]:
    """Over the speeds, the places, the wheels and the past of all logs.

    Args:
        opened: logs over their floors.
        velocities: (N, 3) of the body in each, m/s and rad/s, at the points of its response.
    """
    moving = np.concatenate(velocities)
    axes = [k for k in range(3) if np.abs(moving[:, k]).max() > STILL[k]]
    pose = np.concatenate([own.response.pose for own in opened])
    return [
        *(of_speed(k, np.abs(moving[:, k])) for k in axes),
        *across_axes(moving),
        *(of_past(k, max(float(np.std(moving[:, k])), STILL[k])) for k in axes),
        *of_memory(opened, velocities),
        *of_leaning(opened, velocities),
        *of_places(pose[:, :2]),
        *of_pushes(),
        *(of_course(n) for n in COURSES),
        *of_drift(np.concatenate([own.response.middle_s for own in opened])),
        *of_beat(beat_of(opened)),
        *of_wheels(opened),
        *(of_rims(opened, velocities) if opened[0].model.drive == "twist" else ()),
    ]
