# SPDX-License-Identifier: Apache-2.0
"""Transients of an axis after each change of its speed, as of a liquid that swings."""

from itertools import pairwise

import numpy as np

from twinmill.diagnosis.families.family import Family
from twinmill.fitting.opening import Opened
from twinmill.formulas.term import CHANGE, CHANNELS, SPEEDS, TYPICAL, Term

AGO_S = (0.0, 0.15, 0.3, 0.5, 0.8, 1.2, 1.8)  # since the change: ends of ranges


def of_past(axis: int, size: float) -> Family:
    """Families of one axis, with a typical size of its changes."""
    name, to = SPEEDS[axis], CHANNELS[axis]
    texts = [f"ago({name}, {a:g}) - ago({name}, {b:g})" for a, b in pairwise(AGO_S)]

    def values(own: Opened, velocity: np.ndarray) -> dict[int, np.ndarray]:
        t_s = own.response.middle_s
        past = [np.interp(t_s - ago_s, t_s, velocity[:, axis]) for ago_s in AGO_S]
        return {axis: -TYPICAL[to] / size * np.diff(past, axis=0).T}

    return Family([Term(CHANGE, to, t, size, f"after changes of {name}") for t in texts], values)
