# SPDX-License-Identifier: Apache-2.0
"""Errors on the half of a log that was not fitted, both ways round."""

from dataclasses import dataclass, replace

import numpy as np

from twinmill.fitting.solve import System, huber
from twinmill.model.freedom import Free
from twinmill.predict.folds import halves, held_errors, step_mask
from twinmill.predict.problem import Scene
from twinmill.predict.windows import CHANNELS, HORIZONS_S, rms, score_of


@dataclass(frozen=True)
class HeldOut:
    """Held-out errors.

    Attributes:
        chi2: robust chi2 of the whitened steps, both ways.
        parts: (H, 3) RMS per scene.
        floors: (H, 3) per scene.
    """

    chi2: float
    parts: list[np.ndarray]
    floors: list[np.ndarray]

    @property
    def score(self) -> float:
        """Errors over floors."""
        return self.over(self.floors)

    def over(self, floors: list[np.ndarray]) -> float:
        """Errors over other floors."""
        return score_of(self.parts, floors)

    @property
    def rms(self) -> np.ndarray:
        """(H, 3) errors of all logs together; of the tables where there is no log."""
        ahead = [part for part in self.parts if len(part) == len(HORIZONS_S)] or self.parts
        return np.sqrt(np.nanmean(np.square(ahead), axis=0))

    def rows(self) -> list[dict]:
        """One row per channel and horizon, over all logs; none without a log."""
        if len(self.rms) != len(HORIZONS_S):
            return []
        return [
            {"channel": channel, "unit": unit, "horizon_s": horizon_s, "rms": float(self.rms[h, c])}
            for c, (channel, unit) in enumerate(CHANNELS)
            for h, horizon_s in enumerate(HORIZONS_S)
        ]


def held_out(scenes: list[Scene], free: list[Free], floors: list[np.ndarray]) -> HeldOut:
    """Fits each half and predicts the other.

    Args:
        scenes: measurements with a model that was fitted to the whole; left as they are. The fits
            to the halves start from there, and use the slopes found there.
        free: what was fitted; nothing if the model is judged as it is.
        floors: (H, 3) per scene.
    """
    tried = [replace(s, model=s.model.copy()) for s in scenes]
    halves_of = [halves(s) for s in scenes]
    system = System(tried, [replace(f, begin=tried[0].model.get(f.name)) for f in free])
    slopes = system.jacobian(system.start) if free else np.empty((0, 0))
    chi2, errors = 0.0, [[] for _ in scenes]
    for which in (0, 1):
        own, other = (
            [step_mask(s, h, w) for s, h in zip(scenes, halves_of, strict=True)]
            for w in (which, 1 - which)
        )
        if free:
            system.store(system.newton(slopes, own))
        for i, (scene, half) in enumerate(zip(tried, halves_of, strict=True)):
            chi2 += huber(scene.white_errors()[other[i]])
            errors[i].append(held_errors(scene, half, 1 - which))
    return HeldOut(chi2, [rms(np.concatenate(e)) for e in errors], floors)
