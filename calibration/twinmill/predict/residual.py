# SPDX-License-Identifier: Apache-2.0
"""One-step errors: measured pose less the pose predicted from the measured one before it."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement


@dataclass(frozen=True)
class StepGrid:
    """Steps between poses on an even time grid: a lost frame's step is shared out over two.

    Attributes:
        source: (S,) index of the pose that ends the step.
        origin: (S,) index of the pose that it starts from.
        share: (S,) 1 over the number of grid steps that this step spans.
        starts: (K,) grid index at which a new unbroken stretch begins.
        t_s: (S,) end of the step, capture's clock.
        period_s: of the grid.
    """

    source: np.ndarray
    origin: np.ndarray
    share: np.ndarray
    starts: np.ndarray
    t_s: np.ndarray
    period_s: float

    @classmethod
    def of(cls, measurement: Measurement) -> "StepGrid":
        """Lays the grid over a measurement's poses."""
        track = measurement.track
        usable = np.flatnonzero(track.segment >= 0)
        joined = np.diff(track.segment[usable]) == 0
        ends, begins = usable[1:][joined], usable[:-1][joined]
        period_s = track.timing.pose_period_s
        spans = np.maximum(1, np.rint((track.pose_t_s[ends] - track.pose_t_s[begins]) / period_s))
        source = np.repeat(ends, spans.astype(int))
        origin = np.repeat(begins, spans.astype(int))
        segment = track.segment[source]
        starts = np.flatnonzero(np.diff(segment, prepend=-1))
        return cls(
            source,
            origin,
            1 / np.repeat(spans, spans.astype(int)),
            starts,
            track.pose_t_s[source],
            period_s,
        )

    @cached_property
    def slices(self) -> list[slice]:
        """Unbroken stretches of the grid."""
        edges = [*self.starts, len(self.source)]
        return [slice(a, b) for a, b in pairwise(edges)]

    def errors(self, predicted: np.ndarray, measurement: Measurement) -> np.ndarray:
        """(..., N, 3) predictions to (..., S, 3) errors in W: x, y in m, heading in rad."""
        error = measurement.track.pose[self.source] - predicted[..., self.source, :]
        error[..., 2] = np.remainder(error[..., 2] + np.pi, 2 * np.pi) - np.pi
        return error * self.share[:, None]


def body_velocity(measurement: Measurement, grid: StepGrid, model: native.Model) -> np.ndarray:
    """(S, 3) predicted velocity in the body frame: forward, left in m/s, turn in rad/s.

    Each prediction is turned back by the very heading it started from, so that the noise of that
    heading does not come into the velocity.
    """
    track = measurement.track
    predicted = native.one_step(model, measurement.played)
    from_rad = track.heading_rad[grid.origin]
    turn_rad = predicted[grid.source, 2] - from_rad
    step = predicted[grid.source, :2] - track.pose[grid.origin, :2]
    middle_rad = from_rad + turn_rad / 2
    body = np.column_stack([*rotate(step[:, 0], step[:, 1], -middle_rad), turn_rad])
    return body * (grid.share / grid.period_s)[:, None]


def rotate(x: np.ndarray, y: np.ndarray, angle_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Components of vectors turned counter-clockwise by an angle; arrays that broadcast."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return c * x - s * y, s * x + c * y
