# SPDX-License-Identifier: Apache-2.0
"""Whether what happens after a command's change depends on the kind of change.

Delay, lag, slew, backlash and coasting all hold a response back, and one of them imitates another
well on steps of one kind. So each of the two simplest, a lag and a shift in time, is let differ
between small and large changes, those through zero, from rest and to rest. What then still helps is
not the one that was accepted.
"""

import numpy as np

from twinmill.data.track import command_at
from twinmill.predict.problem import CLOCK, Scene

LAG = "base.motor_lag_s"
SHAPES = {"lag": (LAG, 0.01), "shift": (CLOCK, 0.005)}  # quantity and typical strength, s
BACK_S = 0.25  # a change is the command now against that so long ago
KINDS = ("size", "through_zero", "from_rest", "to_rest")


def change_columns(scene: Scene) -> tuple[list[str], np.ndarray]:
    """Names, and (3 S, F) whitened signatures at typical strength; dependences only.

    What the two shapes explain that does not depend on the kind of change is projected out.
    """
    kinds = _kinds(scene)
    names, shapes, columns = [], [], []
    for shape, (quantity, strength) in SHAPES.items():
        here = scene.model.get(quantity)
        white = scene.whitened([quantity], np.array([[here], [here + strength]]))
        signature = white[0] - white[1]
        shapes.append(signature.ravel())
        for kind, values in zip(KINDS, kinds.T, strict=True):
            names.append(f"{shape}*{kind}")
            columns.append((signature * values[:, None]).ravel())
    plain, stacked = np.column_stack(shapes), np.column_stack(columns)
    alike = np.linalg.lstsq(plain, stacked, rcond=None)[0]
    return names, stacked - plain @ alike


def _kinds(scene: Scene) -> np.ndarray:
    """(S, 4) of the latest change at each step: its size over the largest command, and 0 or 1."""
    track = scene.measurement.track
    t_s = scene.grid.t_s - scene.model.get(CLOCK)
    now, before = (
        command_at(at_s, track.command_t_s, track.command) for at_s in (t_s, t_s - BACK_S)
    )
    size = np.abs(now - before).max(axis=1) / max(float(np.abs(track.command).max()), 1e-9)
    moves, moved = now.any(axis=1), before.any(axis=1)
    through = (now * before < 0).any(axis=1)
    return np.column_stack([size, through, moves & ~moved, moved & ~moves]).astype(float)
