# SPDX-License-Identifier: Apache-2.0
"""Errors on the half of a log that was not fitted, both ways round."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from twinmill.calibration.folds import halves, step_mask, window_mask
from twinmill.calibration.freedom import Free
from twinmill.calibration.problem import Scene
from twinmill.calibration.solve import solve
from twinmill.calibration.windows import CHANNELS, HORIZONS_S, Windows, rms


@dataclass(frozen=True)
class HeldOut:
    """Held-out errors of all scenes: (H, 3) RMS, and the score over the floor."""

    rms: np.ndarray
    score: float

    def rows(self) -> list[dict]:
        """One row per channel and horizon."""
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
            windows = Windows.of(scene.measurement.track)
            other = window_mask(windows, half, 1 - which)
            errors[i].append(np.where(other[..., None], windows.errors(scene), np.nan))
    parts = [rms(np.concatenate(e)) for e in errors]
    ratios = [part / floor for part, floor in zip(parts, floors, strict=True)]
    return HeldOut(
        np.sqrt(np.nanmean(np.square(parts), axis=0)), float(np.sqrt(np.nanmean(np.square(ratios))))
    )
