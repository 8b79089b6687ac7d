# SPDX-License-Identifier: Apache-2.0
"""Compares a model with measurements: how wrong it is, against the log's own floor, and where."""

from dataclasses import dataclass, replace

import numpy as np

from twinmill.data.log import LogError
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import Sheet
from twinmill.fitting.solve import solve
from twinmill.model.model_file import ModelFile
from twinmill.predict.detection_errors import BitComparison, compare_bits
from twinmill.predict.detections import bit_scenes
from twinmill.predict.floor import Floor, measure_floor
from twinmill.predict.problem import CLOCK, Scene
from twinmill.predict.regimes import Regime, where_it_fails
from twinmill.predict.windows import CHANNELS, HORIZONS_S, Windows, rms, score
from twinmill.steady.compare import SteadyComparison, compare_steady
from twinmill.steady.scene import SteadyScene

SHORT_S = 40.0  # so long a log must be for noise of its own
GOOD, MISSING, SUSPECT = (
    1.15,
    1.3,
    0.9,
)  # scores: stop; something is missing; floor wrong or data leaked


@dataclass(frozen=True)
class RobotComparison:
    """One robot in one log.

    Attributes:
        scene: measurement, model with the clock used, noise.
        windows: where predictions start and end.
        errors: (W, H, 3) measured less predicted, seen from the start; m, m, rad.
        floor: (H, 3) and its kind.
        where: regimes.
    """

    scene: Scene
    windows: Windows
    errors: np.ndarray
    floor: Floor
    where: list[Regime]

    @property
    def score(self) -> float:
        """Of this robot alone."""
        return score(self.errors, self.floor.rms)

    @property
    def size(self) -> int:
        """How many values were predicted: the largest of a comparison speaks for its errors."""
        return len(self.windows.starts)

    @property
    def time_offset_s(self) -> float:
        """Capture's clock less the robot's."""
        return self.scene.model.get(CLOCK)

    def error_rows(self) -> list[dict]:
        """errors[] of the interface: one row per channel and horizon."""
        found = rms(self.errors)
        return [
            {
                "channel": channel,
                "unit": unit,
                "horizon_s": horizon_s,
                "rms": float(found[h, c]),
                "floor": float(self.floor.rms[h, c]),
                "ratio": float(found[h, c] / self.floor.rms[h, c]),
            }
            for c, (channel, unit) in enumerate(CHANNELS)
            for h, horizon_s in enumerate(HORIZONS_S)
        ]

    def to_json(self) -> dict:
        """One entry of robots[]."""
        return {
            "robot_id": self.scene.measurement.track.robot_id,
            "log": self.scene.measurement.log_name,
            "score": self.score,
            "floor_kind": self.floor.kind,
            "noise": self.scene.noise.to_json(),
            "errors": self.error_rows(),
            "where": [r.to_json() for r in self.where],
            "time_offset_s": self.time_offset_s,
            "time_base": base.to_json() if (base := self.scene.measurement.time_base) else None,
        }


@dataclass(frozen=True)
class Comparison:
    """All robots of all logs and tables against one model; `bits`: of their cameras, or None."""

    model_name: str
    robots: list[RobotComparison | SteadyComparison]
    warnings: list[str]
    bits: BitComparison | None = None

    @property
    def score(self) -> float:
        """RMS over robots."""
        return float(np.sqrt(np.mean([r.score**2 for r in self.robots])))

    @property
    def main(self) -> RobotComparison | SteadyComparison:
        """The robot that speaks for the errors."""
        return max(self.robots, key=lambda r: r.size)

    @property
    def verdict(self) -> str:
        """What the score means, in a sentence."""
        if self.score < SUSPECT:
            return (
                "Better than the log's own noise allows: the floor is wrong, or the model was "
                "fitted to noise."
            )
        if self.score <= GOOD:
            return "As good as this log can tell: nothing is missing that it would show."
        if self.score <= MISSING:
            return (
                "Close to what this log can tell; a small effect may be missing, or parameters "
                "are stale."
            )
        return "Something is missing in the model, or its parameters are stale."

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "model": self.model_name,
            **self.main.to_json(),
            "score": self.score,
            "verdict": self.verdict,
            "robots": [r.to_json() for r in self.robots],
            "bits": self.bits.to_json() if self.bits else None,
            "warnings": self.warnings,
        }


def compare_robot(scene: Scene | SteadyScene) -> RobotComparison | SteadyComparison:
    """Compares one robot; the scene's model, clock and noise are taken as they are."""
    if isinstance(scene, SteadyScene):
        return compare_steady(scene)
    windows = Windows.of(scene.measurement.track)
    errors = windows.errors(scene)
    floor = measure_floor(scene, windows)
    return RobotComparison(
        scene, windows, errors, floor, where_it_fails(scene, windows, errors, floor.rms)
    )


def open_scenes(
    measurements: list[Measurement | Sheet], model_file: ModelFile
) -> list[Scene | SteadyScene]:
    """Scenes of the model as it is, each with its clock aligned.

    A clock offset that another log told is kept: only so can a delay be told from it. One that this
    very log told, with whatever model that was, is found anew. A robot whose own run does not tell
    it (one that saw nobody all the while has one command) takes that of the others in its log.

    Raises:
        LogError: no robot of a log tells the clock offset.
    """
    scenes: list[Scene | SteadyScene | None] = []
    mute: dict[int, LogError] = {}
    for i, measurement in enumerate(measurements):
        try:
            scenes.append(_open(measurement, model_file))
        except LogError as error:
            scenes.append(None)
            mute[i] = error
    for i, error in mute.items():
        log = measurements[i].log_sha256
        known = [s for s in scenes if isinstance(s, Scene) and s.measurement.log_sha256 == log]
        if not known:
            raise error
        offset_s = float(np.median([s.model.get(CLOCK) for s in known]))
        scenes[i] = _on_clock_of_others(measurements[i], model_file, offset_s)
    _lend_noise([s for s in scenes if isinstance(s, Scene)])
    return scenes


def _open(measurement: Measurement | Sheet, model_file: ModelFile) -> Scene | SteadyScene:
    if isinstance(measurement, Sheet):
        return SteadyScene.of(measurement, model_file.model)
    other = model_file.model.clock_known and measurement.log_sha256 not in model_file.clock_logs
    scene = Scene.of(measurement, model_file.model, clock_free=not other)
    if scene.clock_free:
        solve([scene], [])
        scene.settle_noise()
    return scene


def _on_clock_of_others(measurement: Measurement, model_file: ModelFile, offset_s: float) -> Scene:
    told = (
        f"its commands do not tell its clock offset; that of the log's other robots is taken "
        f"({offset_s:.3f} s)."
    )
    measurement = replace(measurement, warnings=[*measurement.warnings, told])
    return Scene.of(measurement, model_file.model, clock_free=False, offset_s=offset_s)


def _lend_noise(scenes: list[Scene]) -> None:
    """Short logs take the noise of the robot's longest log, if that is quieter.

    A short log cannot tell noise from what a model lacks: any response flexible enough to explain
    its motion is fitted to its noise. If it is truly noisier, its errors scatter more than the
    noise says, which all tests allow for.
    """
    for scene in scenes:
        track, period_s = scene.measurement.track, scene.grid.period_s
        same = [s for s in scenes if s.measurement.track.robot_id == track.robot_id]
        longest = max(same, key=lambda s: np.ptp(s.measurement.track.pose_t_s)).noise
        short = np.ptp(track.pose_t_s) < SHORT_S
        if short and longest.loudness(period_s) < scene.noise.loudness(period_s):
            scene.noise = longest


def comparison(model_file: ModelFile, scenes: list[Scene]) -> Comparison:
    """Of scenes as they stand."""
    warnings = [f"{s.measurement.label}: {w}" for s in scenes for w in s.measurement.warnings]
    return Comparison(model_file.path.name, [compare_robot(s) for s in scenes], warnings)


def compare(measurements: list[Measurement], model_file: ModelFile) -> Comparison:
    """Compares a model with every robot of every log.

    A clock offset that the model knows is used; else each log's own is estimated.
    """
    scenes = open_scenes(measurements, model_file)
    bits = compare_bits(bit_scenes(scenes), model_file.model)
    return replace(comparison(model_file, scenes), bits=bits)
