# SPDX-License-Identifier: Apache-2.0
"""The floor: how large prediction errors are when nothing is missing in the model."""

from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np
import twinmill_native as native

from twinmill.predict.problem import Scene
from twinmill.predict.repeats import repeated_starts
from twinmill.predict.windows import Windows, difference, rms

REPLICAS = 4


@dataclass(frozen=True)
class Floor:
    """(H, 3) RMS errors per horizon and channel, and where they come from."""

    rms: np.ndarray
    kind: str


@singledispatch
def floor_of(scene: Scene) -> Floor:
    """The floor of a scene's predictions."""
    return measure_floor(scene, Windows.of(scene.measurement.track))


def measure_floor(scene: Scene, windows: Windows) -> Floor:
    """Best first: repeated runs in the log, then the model scored against its own noisy replica."""
    track = scene.measurement.track
    pairs = repeated_starts(track, len(windows.starts))
    if pairs is not None:
        first, second = (Windows.at(track, starts).measured(scene) for starts in pairs.T)
        return Floor(rms(difference(first, second)) / np.sqrt(2), "repeat")
    return Floor(rms(np.concatenate(_replica_errors(scene, windows))), "bootstrap")


def _replica_errors(scene: Scene, windows: Windows) -> list[np.ndarray]:
    """The twin, with this log's noise, plays the commands; the model predicts that run."""
    noisy = scene.model.copy()
    for name, value in scene.noise.to_json().items():
        noisy.set(f"noise.{name}", value)
    errors = []
    for seed in range(1, REPLICAS + 1):
        pose = native.replica(noisy, scene.measurement.played, seed)
        replica = replace(scene, measurement=scene.measurement.with_pose(pose))
        errors.append(windows.errors(replica))
    return errors
