# SPDX-License-Identifier: Apache-2.0
"""What gains and time base say of a robot that is known by its measured wheel speeds."""

import numpy as np
import twinmill_native as native

from twinmill.predict.problem import Scene

NOTABLE = 0.01  # change of a gain that is worth a sentence


def time_base_notes(scenes: list[Scene]) -> list[str]:
    """A sentence if logs do not last as long as they say."""
    bases = [s.measurement.time_base for s in scenes if s.measurement.time_base]
    if not bases:
        return []
    straight, turning = (np.array([getattr(b, k) for b in bases]) for k in ("straight", "turning"))
    return [
        "clock_rate: the stamps of the wheel speeds are not times. A second of them lasts "
        f"{straight.mean():.3f} s on straights ({straight.min():.3f} to {straight.max():.3f} over "
        f"{len(bases)} logs) and {turning.mean():.3f} s in turns ({turning.min():.3f} to "
        f"{turning.max():.3f}); this was put right before anything else."
    ]


def geometry_notes(model: native.Model) -> list[str]:
    """Sentences on what gains mean where wheel speeds are measured: rolling and lever."""
    if model.drive != "wheel_speed":
        return []
    forward, sideways, yaw = (model.get(f"base.{k}_gain") for k in ("forward", "sideways", "yaw"))
    notes = []
    if abs(1 - sideways / forward) > NOTABLE:
        more = "less" if sideways < forward else "more"
        notes.append(
            f"Sideways the robot rolls {100 * abs(1 - sideways / forward):.1f} % {more} far than "
            f"forward at the same wheel speeds (gains {sideways:.3f} and {forward:.3f})."
        )
    if abs(1 - yaw) > NOTABLE:
        notes.append(
            f"It turns as if the wheels' lever (half wheelbase and half track) were {1 / yaw:.3f} "
            "times as long as the model says."
        )
    return notes
