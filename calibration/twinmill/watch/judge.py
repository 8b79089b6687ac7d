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
from twinmill.model.model_file import DEFAULT_MODEL, ModelFile
from twinmill.predict.floor import Floor, measure_floor
from twinmill.predict.noise import ChannelNoise, Noise
from twinmill.predict.problem import CLOCK, Scene
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import Windows, score

WINDOW_S = 12.0  # of poses that are judged
AHEAD_S = 2.0  # of the prediction that is shown
NEAR_S = 0.03  # how far the clock's offset is searched from where it was
OFFSETS = 21  # of which the median is used: clocks drift less in so many seconds
NOISE = (("sensor_m", "drive_mps", "drive_s"), ("sensor_rad", "drive_radps", "drive_turn_s"))
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

    The floor is that of the model's own noise, of turbopi.toml's where it names none, in the first
    window: a log's noise takes longer to fit than a window lasts.
    """

    model_file: ModelFile
    _offsets_s: list[float] = field(default_factory=list)
    _floor: Floor | None = None

    def judge(self, actor: Actor) -> Judgement | None:
        """None while poses and commands are too few, or the robot stands."""
        try:
            measurement = Measurement.live(make_track(actor.log))
            scene = self._scene(measurement)
            windows = _settled(measurement.track)
            drives = np.any(measurement.track.command != 0)
            if not drives or not (windows.ends[:, -1] >= 0).any():
                return None
            self._settle_clock(scene, windows)
        except (LogError, ValueError):
            return None
        if self._floor is None:
            self._floor = measure_floor(scene, windows)
        return Judgement(score(windows.errors(scene), self._floor.rms), _ahead(scene))

    def _scene(self, measurement: Measurement) -> Scene:
        own = self.model_file.model.for_robot(measurement.track.robot_id)
        if not own.clock_known:
            if not self._offsets_s:
                self._offsets_s.append(estimate_offset(measurement.track).offset_s)
            own.set(CLOCK, float(np.median(self._offsets_s)))
        grid = StepGrid.of(measurement)
        return Scene(measurement, own, grid, not own.clock_known, _noise_of(own))

    def _settle_clock(self, scene: Scene, windows: Windows) -> None:
        """Finds the offset at which this very model predicts best, near where it was."""
        if not scene.clock_free:
            return

        def loss(offset_s: float) -> float:
            scene.model.set(CLOCK, offset_s)
            return float(np.nanmean(windows.errors(scene)[..., 0] ** 2))

        middle_s = float(np.median(self._offsets_s))
        found = minimize_scalar(
            loss,
            bounds=(middle_s - NEAR_S, middle_s + NEAR_S),
            method="bounded",
            options={"xatol": 1e-3},
        )
        self._offsets_s = [*self._offsets_s[1 - OFFSETS :], float(found.x)]
        scene.model.set(CLOCK, float(np.median(self._offsets_s)))


def _settled(track: Track) -> Windows:
    """Predictions that start late enough: commands before this window left no trace any more."""
    starts = Windows.of(track).starts
    return Windows.at(track, starts[track.pose_t_s[starts] > track.command_t_s[0] + REST_S])


def _noise_of(model: native.Model) -> Noise:
    if model.get("noise.sensor_m") == 0:
        model = ModelFile.load(DEFAULT_MODEL).model
    return Noise(*(ChannelNoise(*(model.get(f"noise.{n}") for n in names)) for names in NOISE))


def _ahead(scene: Scene) -> np.ndarray:
    """The model's path from the pose AHEAD_S before the newest usable one."""
    track = scene.measurement.track
    newest = np.flatnonzero(track.segment >= 0)[-1]
    same = np.flatnonzero(track.segment == track.segment[newest])
    start = same[np.searchsorted(track.pose_t_s[same], track.pose_t_s[newest] - AHEAD_S)]
    ends = np.unique(np.linspace(start + 1, newest, POINTS).astype(np.int64))
    if start >= newest:
        return track.pose[[start]]
    starts = np.array([start], np.int64)
    path = native.windows(scene.model, scene.measurement.played, starts, ends[None])
    return np.vstack([track.pose[start], path[0]])
