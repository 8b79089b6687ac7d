# SPDX-License-Identifier: Apache-2.0
"""Prediction errors that a person can read: from measured states, some time ahead."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import Track
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.residual import rotate

HORIZONS_S = (0.1, 0.2, 0.5, 1.0, 2.0)
CHANNELS = (("forward", "m"), ("left", "m"), ("heading", "rad"))
EVERY_S = 0.25


@dataclass(frozen=True)
class Windows:
    """Where predictions start and end on one track.

    Attributes:
        starts: (W,) index of the pose that a prediction starts from.
        ends: (W, H) index of the pose it is compared with at each horizon; -1 where the track ends.
    """

    starts: np.ndarray
    ends: np.ndarray

    @classmethod
    def of(cls, track: Track) -> "Windows":
        """A start every 0.25 s of every unbroken stretch."""
        starts = []
        for number in np.unique(track.segment[track.segment >= 0]):
            index = np.flatnonzero(track.segment == number)
            t_s = track.pose_t_s[index]
            half_s = track.timing.pose_period_s / 2
            starts.append(index[np.searchsorted(t_s, np.arange(t_s[0], t_s[-1], EVERY_S) - half_s)])
        return cls.at(track, np.concatenate(starts))

    @classmethod
    def at(cls, track: Track, starts: np.ndarray) -> "Windows":
        """Windows that start at these poses."""
        half_s = track.timing.pose_period_s / 2
        wanted_s = track.pose_t_s[starts][:, None] + np.array(HORIZONS_S) - half_s
        ends = np.searchsorted(track.pose_t_s, wanted_s)
        inside = ends < len(track.pose_t_s)
        ends = np.where(inside, ends, 0)
        late = track.pose_t_s[ends] - wanted_s > 2 * track.timing.pose_period_s
        broken = track.segment[ends] != track.segment[starts][:, None]
        ends[~inside | broken | late] = -1
        # Predictions go on from one horizon to the next, so all shorter ones must be there.
        ends[np.cumsum(ends < 0, axis=1) > 0] = -1
        return cls(starts.astype(np.int64), ends.astype(np.int64))

    def thinned(self, every: int) -> "Windows":
        """Every Nth of them."""
        return Windows(self.starts[::every], self.ends[::every])

    def measured(self, measurement: Measurement) -> np.ndarray:
        """(W, H, 3) displacement forward, left (m) and turn (rad), seen from the start.

        The turn is from reading to reading: a smoothed heading is late where a turn begins or ends.
        """
        track = measurement.track
        found = self.seen(track, track.pose[self.ends])
        found[..., 2] += (track.heading_smooth - track.heading_rad)[self.starts, None]
        return found

    def predicted(self, measurement: Measurement, model: native.Model) -> np.ndarray:
        """(W, H, 3) the same as a model predicts it."""
        ahead = native.windows(model, measurement.started, self.starts, self.ends)
        return self.seen(measurement.track, ahead)

    def seen_from(self, track: Track) -> np.ndarray:
        """(W, 3) poses at the starts, with smoothed headings."""
        return np.column_stack([track.pose[self.starts, :2], track.heading_smooth[self.starts]])

    def seen(self, track: Track, end: np.ndarray) -> np.ndarray:
        """(..., W, H, 3) poses at the ends to displacements, seen from the smoothed start."""
        start = self.seen_from(track)
        step = end - start[:, None]
        turned = rotate(step[..., 0], step[..., 1], -start[:, None, 2])
        seen = np.stack([*turned, step[..., 2]], -1)
        seen[..., self.ends < 0, :] = np.nan
        return seen

    def errors(self, modelled: ModelledLog) -> np.ndarray:
        """(W, H, 3) measured less predicted; NaN where the track ends before the horizon."""
        predicted = self.predicted(modelled.measurement, modelled.model)
        return difference(self.measured(modelled.measurement), predicted)


def difference(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) displacements a less b, headings the short way round."""
    apart = a - b
    apart[..., 2] = np.remainder(apart[..., 2] + np.pi, 2 * np.pi) - np.pi
    return apart


def rms(errors: np.ndarray) -> np.ndarray:
    """(W, H, 3) to (H, 3); NaN ignored, and NaN where there is nothing else."""
    count = np.count_nonzero(np.isfinite(errors), axis=0)
    return np.sqrt(np.nansum(errors**2, axis=0) / np.where(count, count, np.nan))


def score(errors: np.ndarray, floor: np.ndarray) -> float:
    """RMS over horizons and channels of error over floor: 1 is as good as the log can tell."""
    return float(np.sqrt(np.nanmean((rms(errors) / floor) ** 2)))
