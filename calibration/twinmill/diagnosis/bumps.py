# SPDX-License-Identifier: Apache-2.0
"""Stretches in which a robot was bumped or pushed: what happened to it then is no trait of it."""

import numpy as np

from twinmill.data.measurement import Measurement
from twinmill.fitting.solve import solve
from twinmill.predict.problem import Scene
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import HORIZONS_S, Windows

HORIZON = 2  # of HORIZONS_S: long enough to stand out of the noise, short enough to tell when
STANDS_OUT = 8.0  # times the median error: of 1000 normal errors the largest is 5 times it
MARGIN_S = 0.25  # the wheels' lag, beside the stretch
RARE = 0.15  # share of the time: what comes more often is a trait


def bumps(scene: Scene) -> list[tuple[float, float]]:
    """Stretches, s of capture's clock, in which errors stand out of the robot's own; none if many.

    Args:
        scene: with a model fitted to it.
    """
    track = scene.measurement.track
    windows = Windows.of(track)
    size = np.abs(windows.errors(scene)[:, HORIZON])
    size = size / np.nanmedian(size, axis=0)
    out = np.any(size > STANDS_OUT, axis=1)  # NaN compares false
    found: list[tuple[float, float]] = []
    for start_s in track.pose_t_s[windows.starts[out]]:
        begin_s, end_s = start_s - MARGIN_S, start_s + HORIZONS_S[HORIZON] + MARGIN_S
        if found and begin_s <= found[-1][1]:
            begin_s = found.pop()[0]
        found.append((float(begin_s), float(end_s)))
    usable_s = np.count_nonzero(track.segment >= 0) * track.timing.pose_period_s
    return found if sum(e - b for b, e in found) < RARE * usable_s else []


def spared(scene: Scene) -> Scene:
    """The scene without its bumps, its own gains fitted anew, a warning for each of them."""
    found = bumps(scene)
    if not found:
        return scene
    times = ", ".join(f"{b:.1f} to {e:.1f} s" for b, e in found)
    told = f"moved as by no command at {times} (bumped, pushed or held?); left out."
    measurement = scene.measurement.without(found, told)
    calm = Scene(
        measurement,
        scene.model.copy(),
        StepGrid.of(measurement),
        scene.clock_free,
        scene.noise,
        scene.gains_free,
    )
    solve([calm], [])
    calm.settle_noise()
    return calm


def bump_notes(measurements: list[Measurement], before: list[Measurement]) -> list[str]:
    """What was left out of measurements that were given whole."""
    pairs = zip(measurements, before, strict=True)
    return [f"{m.label}: {m.warnings[-1]}" for m, b in pairs if m is not b]
