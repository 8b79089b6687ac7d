# SPDX-License-Identifier: Apache-2.0
"""How well a model predicts what robots did in the last seconds, over and over."""

from dataclasses import dataclass, field

import numpy as np
import twinmill_native as native
from scipy.optimize import minimize_scalar

from twinmill.data.clock import estimate_offset
from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.multi_log import Actor
from twinmill.data.track import REST_S, Track, make_track
from twinmill.fitting.floor import NoiseFloor, noise_floor
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import CLOCK
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import Windows

WINDOW_S = 30.0  # of poses that are judged: less does not tell noise from motion
AHEAD_S = 2.0  # of the prediction that is shown
NEAR_S = 0.03  # how far the clock's offset is searched from where it was
OFFSETS = 21  # of which the median is used: clocks drift less in so many seconds
POINTS = 20  # of a prediction's line


@dataclass(frozen=True)
class Judgement:
    """One robot's last seconds.

    Attributes:
        score: as of `twinmill compare`, over the window; 1 is as good as noise allows.
        predicted: (K, 3) pose now and then, from the measured one AHEAD_S before the newest.
    """

    score: float
    predicted: np.ndarray


@dataclass
class Judge:
    """Judges one robot by its model again and again.

    The floor is that of the first whole window, as `twinmill compare` finds it.
    """

    model_file: ModelFile
    _offsets_s: list[float] = field(default_factory=list)
    _floor: NoiseFloor | None = None

    def judge(self, actor: Actor) -> Judgement | None:
        """None while poses and commands are too few, or the robot stands."""
        try:
            measurement = Measurement.live(make_track(actor.log))
            windows = _settled(measurement.track)
            drives = np.any(measurement.track.command != 0)
            if not drives or not (windows.ends[:, -1] >= 0).any():
                return None
            data = Trajectory.at(measurement, windows)
            model, known = self._own(measurement)
            if self._floor is None or self._floor.kind is None:
                self._floor = noise_floor(data, model, known)
            data = data.over(self._floor.rms)
            if not known:
                self._settle_clock(data, model)
        except (LogError, ValueError):
            return None
        return Judgement(data.score(model), _ahead(measurement, model))

    def _own(self, measurement: Measurement) -> tuple[native.Model, bool]:
        """The robot's model on its clock, and whether that clock is known."""
        own = self.model_file.model.for_robot(measurement.track.robot_id)
        known = own.clock_known or measurement.same_clock
        if not known:
            if not self._offsets_s:
                self._offsets_s.append(estimate_offset(measurement.track).offset_s)
            own.set(CLOCK, float(np.median(self._offsets_s)))
        return own, known

    def _settle_clock(self, data: Trajectory, model: native.Model) -> None:
        """Finds the offset at which this very model predicts best, near where it was."""
        middle_s = float(np.median(self._offsets_s))

        def loss(offset_s: float) -> float:
            return float(np.sum(data.rows(model, [CLOCK], np.array([[offset_s]])) ** 2))

        found = minimize_scalar(
            loss,
            bounds=(middle_s - NEAR_S, middle_s + NEAR_S),
            method="bounded",
            options={"xatol": 1e-3},
        )
        self._offsets_s = [*self._offsets_s[1 - OFFSETS :], float(found.x)]
        model.set(CLOCK, float(np.median(self._offsets_s)))


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
    path = native.windows(model, measurement.played, starts, ends[None])
    return np.vstack([track.pose[start], path[0]])
