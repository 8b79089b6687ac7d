# SPDX-License-Identifier: Apache-2.0
"""How late the motion follows its commands, from a posterior of all numbers."""

import numpy as np

from twinmill.inference.table import Numbers
from twinmill.model.late import Late, late_parts
from twinmill.model.parameters import CLOCK


def lateness(numbers: Numbers, same_clock: bool) -> Late:
    """Lag, delay and clock of a set of effects; without one clock a delay is in the offset.

    Args:
        numbers: of the set.
        same_clock: the offset of the clocks is known.
    """
    parts = late_parts(numbers.model)
    if not same_clock:
        parts["clock"].append(CLOCK)
    known = dict(zip(numbers.labels, numbers.mean.tolist(), strict=True))
    value = {
        kind: sum(known.get(name, numbers.model.get(name)) for name in own)
        for kind, own in parts.items()
    }
    every = {name for own in parts.values() for name in own}
    mask = np.array([label in every for label in numbers.labels], float)
    return Late(
        sum(value.values()),
        float(np.sqrt(mask @ numbers.cov @ mask)) if mask.any() else None,
        value["delay"] if same_clock else None,
        value["lag"],
        value["clock"] if same_clock else None,
        parted=same_clock,
    )
