# SPDX-License-Identifier: Apache-2.0
"""Errors on parts of the data that were not fitted to, as people read them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from twinmill.estimation.detection_fit import DetectionFit
from twinmill.estimation.score_fit import ScoreFit
from twinmill.predict.datasets import Trajectory, total_score
from twinmill.predict.windows import CHANNELS, HORIZONS_S, rms


@dataclass(frozen=True)
class HeldOut:
    """Held-out errors.

    Attributes:
        scores: of each data set; of detections one of all together.
        errors: (W, H, 3) of each log: m, m, rad; none of tables and detections.
    """

    scores: np.ndarray
    errors: Sequence[np.ndarray]

    @classmethod
    def of(cls, fit: ScoreFit | DetectionFit) -> "HeldOut":
        """Scores on a fit's left-out parts."""
        if isinstance(fit, DetectionFit):
            return cls(fit.held_scores, [])
        errors = [
            d.as_errors(rows)
            for d, rows in zip(fit.datasets, fit.held_out, strict=True)
            if isinstance(d, Trajectory)
        ]
        return cls(fit.held_scores, errors)

    @property
    def score(self) -> float:
        """Held-out score of all data sets together, as `total_score`."""
        return total_score(self.scores.tolist())

    @property
    def rms(self) -> np.ndarray:
        """(H, 3) errors of all logs together; NaN where there is none."""
        if not self.errors:
            return np.full((len(HORIZONS_S), len(CHANNELS)), np.nan)
        return rms(np.concatenate(list(self.errors)))

    def rows(self) -> list[dict[str, Any]]:
        """One row per channel and horizon, over all logs; none without a log."""
        if not self.errors:
            return []
        found = self.rms
        return [
            {"channel": channel, "unit": unit, "horizon_s": horizon_s, "rms": float(found[h, c])}
            for c, (channel, unit) in enumerate(CHANNELS)
            for h, horizon_s in enumerate(HORIZONS_S)
        ]
