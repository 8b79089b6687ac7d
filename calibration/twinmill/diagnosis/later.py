# SPDX-License-Identifier: Apache-2.0
"""Commands that act later, or sooner, from a moment on, as where a buffer fills or a link changes.

It shows at changes of the command alone, so that it looks like single moments; but it lasts.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.clock import place_of_least
from twinmill.fitting.opening import Opened
from twinmill.model.parameters import CLOCK

REACH_S, STEP_S = 0.5, 0.025
LEAST_S = 0.05  # two steps: a smaller change is no news
FEWEST = 20  # predictions on either side
LEAVES = 0.5  # of the squared error that one lateness of the whole log leaves: more is no change


@dataclass(frozen=True)
class Later:
    """When it changed in one log, and by how much.

    Attributes:
        from_s: capture's clock.
        later_s: of the commands' effect, against before; negative if sooner.
    """

    log: str
    robot_id: int
    from_s: float
    later_s: float

    def to_json(self) -> dict[str, Any]:
        """Fields of JSON output."""
        return vars(self)

    @property
    def sentence(self) -> str:
        """Sentence on the change, for people."""
        than = "later" if self.later_s > 0 else "sooner"
        return (
            f"From {self.from_s:.1f} s on the robot followed its commands "
            f"{abs(self.later_s):.2f} s {than} than before: look at what sent them, its buffers "
            "and its link."
        )


def later_from(own: Opened, model: native.Model) -> tuple[Later, np.ndarray] | None:
    """The change of lateness that explains a log best, and the (W, H, 3) errors with it.

    None where it changes by too little, or takes too little: an event that passes has a lateness
    that suits it best, too.
    """
    data = own.trajectory.over(own.trajectory.floor, np.ones(len(own.trajectory.keep), bool))
    clock_s = model.get(CLOCK)
    shifts_s = np.arange(-REACH_S, REACH_S + STEP_S / 2, STEP_S)
    rows = data.rows(model, [CLOCK], clock_s + shifts_s[:, None])
    squares = np.cumsum((rows.reshape(len(rows), len(data.keep), -1) ** 2).sum(axis=2), axis=1)
    before, after = squares.min(axis=0), (squares[:, -1:] - squares).min(axis=0)
    inside = slice(FEWEST, len(before) - FEWEST)
    if len(before) <= 2 * FEWEST:
        return None
    k = FEWEST + int((before + after)[inside].argmin())
    first_s = place_of_least(shifts_s, squares[:, k])
    then_s = place_of_least(shifts_s, squares[:, -1] - squares[:, k])
    later_s = then_s - first_s
    most = LEAVES * float(squares[:, -1].min())
    if abs(later_s) < LEAST_S or (before + after)[k] > most:
        return None
    late, errors = model.copy(), []
    for shift_s in (first_s, then_s):
        late.set(CLOCK, clock_s + shift_s)
        errors.append(data.errors(late))
    track = data.measurement.track
    found = Later(data.measurement.log_name, track.robot_id, float(data.start_s[k + 1]), later_s)
    return found, np.where(np.arange(len(before))[:, None, None] <= k, *errors)
