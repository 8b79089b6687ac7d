# SPDX-License-Identifier: Apache-2.0
"""What the model would reach that has the hidden effects at their true values."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from twinmill.challenge.cases import Hidden
from twinmill.diagnosis.evidence import State
from twinmill.fitting.heldout import HeldOut, held_out
from twinmill.fitting.solve import solve
from twinmill.model.freedom import effect_quantities
from twinmill.model.model_file import ModelFile
from twinmill.predict.windows import HORIZONS_S

AT = HORIZONS_S.index(2.0)


@dataclass(frozen=True)
class Truth:
    """What could be had.

    Attributes:
        score: held-out score of the true model, its base refitted.
        adds: for each hidden effect, how many floors it adds to the error at 2 s if it alone is
            left out and the base refitted: the largest over the channels.
    """

    score: float
    adds: tuple[float, ...]


def truth(state: State, base: ModelFile, hidden: Collection[Hidden]) -> Truth:
    """Refits the true model, and the true one without each of its hidden effects.

    Args:
        state: of the diagnosis: its scenes, noise and floors are used.
        base: the model that was given to the diagnosis.
        hidden: what is in the log.
    """
    whole = _refitted(state, base, hidden)
    adds = []
    for left_out in hidden:
        less = _refitted(state, base, [h for h in hidden if h is not left_out])
        more = [
            np.sqrt(np.clip(a[AT] ** 2 - b[AT] ** 2, 0, None)) / floor[AT]
            for a, b, floor in zip(less.parts, whole.parts, state.floors, strict=True)
        ]
        adds.append(float(np.nanmax(more)))
    return Truth(whole.score, tuple(adds))


def _refitted(state: State, base: ModelFile, hidden: Collection[Hidden]) -> HeldOut:
    model = base.model.copy()
    for number, h in enumerate(hidden):
        model.add_effect(h.effect, h.texts)
        same = sum(other.effect == h.effect for other in list(hidden)[:number])
        instance = h.effect if same == 0 else f"{h.effect}#{same + 1}"
        for name, value in h.parameters.items():
            model.set(f"{instance}.{name}", value)
    free = state.base + effect_quantities(base.model)
    scenes = [s.with_model(model) for s in state.scenes]
    solve(scenes, free)
    return held_out(scenes, free, state.floors)
