# SPDX-License-Identifier: Apache-2.0
"""Errors on the half of a log that was not fitted, both ways round."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from twinmill.calibration.folds import halves, held_errors, step_mask
from twinmill.calibration.freedom import Free
from twinmill.calibration.problem import Scene
from twinmill.calibration.solve import solve
from twinmill.calibration.windows import CHANNELS, HORIZONS_S, rms


@dataclass(frozen=True)
class HeldOut:
    """Held-out errors of all scenes: (H, 3) RMS, and the score over the floor."""

    rms: np.ndarray
    score: float

    def rows(self) -> list[dict]:
        """One row per channel and horizon; none without a log."""
        if len(self.rms) != len(HORIZONS_S):
            return []
        return [
            {"channel": channel, "unit": unit, "horizon_s": horizon_s, "rms": float(self.rms[h, c])}
            for c, (channel, unit) in enumerate(CHANNELS)
            for h, horizon_s in enumerate(HORIZONS_S)
        ]


def held_out(
    scenes: list[Scene], model: native.Model, free: list[Free], floors: list[np.ndarray]
) -> HeldOut:
    """Fits on each half and predicts the other.

    Args:
        scenes: measurements with their noise and clocks; left as they are.
        model: whose quantities are fitted; as it is if `free` is empty.
        free: what to fit.
        floors: (H, 3) per scene.
    """
    halves_of = [halves(s) for s in scenes]
    errors = [[] for _ in scenes]
    for which in (0, 1):
        tried = [s.with_model(model) for s in scenes]
        if free:
            solve(
                tried, free, [step_mask(s, h, which) for s, h in zip(tried, halves_of, strict=True)]
            )
        for i, (scene, half) in enumerate(zip(tried, halves_of, strict=True)):
            errors[i].append(held_errors(scene, half, 1 - which))
    parts = [rms(np.concatenate(e)) for e in errors]
    ratios = [part / floor for part, floor in zip(parts, floors, strict=True)]
    # A log's errors are metres ahead in time; a table's have no horizon.
    ahead = [part for part in parts if len(part) == len(HORIZONS_S)] or parts
    squares = [np.nanmean(np.square(ratio)) for ratio in ratios]
    return HeldOut(np.sqrt(np.nanmean(np.square(ahead), axis=0)), float(np.sqrt(np.mean(squares))))
