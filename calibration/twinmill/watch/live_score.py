# SPDX-License-Identifier: Apache-2.0
"""How well a model predicts what robots did in the last seconds, over and over."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.data.clock import estimate_offset
from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.multi_log import RecordedRobot
from twinmill.data.track import REST_S, Track, make_track
from twinmill.estimation.opened import NoiseFloor, Opened
from twinmill.inference.floor import noise_floor
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import CLOCK
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import Windows

WINDOW_S = 30.0  # of poses that are judged: less does not tell noise from motion
AHEAD_S = 2.0  # of the prediction that is shown
POINTS = 20  # of a prediction's line


@dataclass(frozen=True)
class LiveScore:
    """Score and prediction of one robot's last seconds.

    Attributes:
        score: as of `twinmill compare`, over the window; 1 is as good as noise allows.
        predicted: (K, 3) pose now and then, from the measured one AHEAD_S before the newest.
    """

    score: float
    predicted: np.ndarray


@dataclass
class LiveScorer:
    """Scores the predictions of one robot's model again and again.

    The floor is that of the first whole window, as `twinmill compare` finds it.
    """

    model_file: ModelFile
    _floor: NoiseFloor | None = None
    _offset_s: float | None = None  # of the clock, where the model predicted best last

    def score(self, recorded: RecordedRobot) -> LiveScore | None:
        """None while poses and commands are too few, or the robot stands."""
        try:
            measurement = Measurement.live(make_track(recorded.log))
            windows = _settled(measurement.track)
            drives = np.any(measurement.track.command != 0)
            if not drives or not (windows.ends[:, -1] >= 0).any():
                return None
            data = Trajectory.at(measurement, windows)
            model, same_clock = self._own(measurement)
            if self._floor is None or self._floor.kind is None:
                self._floor = noise_floor(measurement, self.model_file)
                if self._floor.kind is None:
                    return None
            data = data.over(self._floor.rms)
            own = Opened(measurement, data, model, self._floor, same_clock)
            own = own.aligned(self.model_file.model, self._offset_s)
            self._offset_s = own.model.get(CLOCK)
        except (LogError, ValueError):
            return None
        return LiveScore(own.score, _ahead(measurement, own.model))

    def _own(self, measurement: Measurement) -> tuple[native.Model, bool]:
        """The robot's model, and whether its clock is known."""
        own = self.model_file.model.for_robot(measurement.track.robot_id)
        known = own.clock_known or measurement.same_clock
        if not known:
            own.set(CLOCK, self._offset_s or estimate_offset(measurement.track).offset_s)
        return own, known


def _settled(track: Track) -> Windows:
    """Predictions that start late enough: commands before this window left no trace any more."""
    starts = Windows.of(track).starts
    return Windows.at(track, starts[track.pose_t_s[starts] > track.command_t_s[0] + REST_S])


def _ahead(measurement: Measurement, model: native.Model) -> np.ndarray:
    """The model's path from the pose AHEAD_S before the newest usable one."""
    track = measurement.track
    newest = np.flatnonzero(track.segment >= 0)[-1]
    same = np.flatnonzero(track.segment == track.segment[newest])
    start = same[np.searchsorted(track.pose_t_s[same], track.pose_t_s[newest] - AHEAD_S)]
    ends = np.unique(np.linspace(start + 1, newest, POINTS).astype(np.int64))
    if start >= newest:
        return track.pose[[start]]
    starts = np.array([start], np.int64)
    path = native.windows(model, measurement.started, starts, ends[None])
    return np.vstack([track.pose[start], path[0]])
