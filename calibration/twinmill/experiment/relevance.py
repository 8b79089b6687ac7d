# SPDX-License-Identifier: Apache-2.0
"""How much an effect that the model lacks adds to the score: a diagnosis names what matters."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy.stats import norm

from twinmill.experiment.information import FisherInformation
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.windows import HORIZONS_S, Windows, difference, score

WORTH = 0.98  # an effect that is worth a name lowers the score to this share
ENOUGH = 1 / WORTH**2 - 1  # of the squared score that is left: what an effect must add to it


@dataclass(frozen=True)
class Relevance:
    """Errors that effects add to a model's predictions.

    Attributes:
        left2: squared score that is left with the effect in the model.
        added2: (T,) what each effect at its strength adds to it if it is not, the base refitted.
        windows: the longest predictions that do not overlap.
    """

    left2: float
    added2: np.ndarray
    windows: float

    def chance(self, strength: float) -> np.ndarray:
        """(T,) chance that each effect, so many times as strong, lowers the score enough.

        The cross term of what is left and what is added, at random signs, is its only scatter.
        """
        added2 = strength**2 * np.maximum(self.added2, 1e-12)
        scatter = 2 * np.sqrt(added2 * self.left2 / self.windows)
        return norm.cdf((added2 - ENOUGH * self.left2) / scatter)


def relevance(
    logs: list[ModelledLog],
    floors: list[np.ndarray],
    scores: list[float],
    fisher: FisherInformation,
    *,
    grams: np.ndarray,
    richer: dict[int, native.Model],
) -> Relevance:
    """Relevance of some effects, over logs and planned runs.

    Args:
        logs: with the model that lacks the effects.
        floors: (H, 3) per log.
        scores: that the model leaves in each log with the effect in it.
        fisher: of all effects.
        grams: (C, C) products of the logs.
        richer: by the place of an effect in the fisher the model with it.
    """
    windows = [Windows.of(s.measurement.track) for s in logs]
    shifts = fisher.shifts(grams)
    added2 = []
    for place, model in richer.items():
        refitted = logs[0].model.copy()
        for free, change in zip(fisher.free, shifts[place], strict=True):
            value = refitted.get(free.name) + change
            refitted.set(free.name, float(np.clip(value, free.min, free.max)))
        parts = [
            score(
                difference(
                    *(w.predicted(s.measurement, s.with_model(m).model) for m in (model, refitted))
                ),
                f,
            )
            for s, w, f in zip(logs, windows, floors, strict=True)
        ]
        added2.append(np.mean(np.square(parts)))
    length_s = sum(float(np.ptp(s.measurement.track.pose_t_s)) for s in logs)
    return Relevance(float(np.mean(np.square(scores))), np.array(added2), length_s / HORIZONS_S[-1])
