# SPDX-License-Identifier: Apache-2.0
"""Outlines of a robot and of what it looks over, for pictures."""

from dataclasses import dataclass

import numpy as np
import twinmill_native as native

SEES, BLIND = "#009e73", "#a0a0a0"  # of the view: a neighbour is seen, or not
STEPS = 24  # of an arc


@dataclass(frozen=True)
class Body:
    """Size and view of a robot; all outlines are (K, 2) m in the body frame, x forward.

    Attributes:
        radius_m: of the body.
        range_m, cone_rad, pan_rad: of the view; the cone is the whole angle.
    """

    radius_m: float
    range_m: float
    cone_rad: float
    pan_rad: float

    @classmethod
    def of(cls, model: native.Model) -> "Body":
        """The model's body and field of view."""
        camera = model.detection_model()
        return cls(
            model.get("robot.body_radius_m"),
            *(camera[k] for k in ("range_m", "cone_rad", "pan_rad")),
        )

    def outline(self) -> np.ndarray:
        """(K, 2) m: the body's circle, its first point again at the end."""
        return self.radius_m * _arc(0, 2 * np.pi)

    def nose(self) -> np.ndarray:
        """From the centre to the front."""
        return np.array([[0.0, 0.0], [self.radius_m, 0.0]])

    def view(self) -> np.ndarray:
        """The sector that the camera looks over, closed."""
        half = self.cone_rad / 2
        arc = self.range_m * _arc(self.pan_rad - half, self.pan_rad + half)
        return np.vstack([[0.0, 0.0], arc, [0.0, 0.0]])


def _arc(from_rad: float, to_rad: float) -> np.ndarray:
    angle = np.linspace(from_rad, to_rad, STEPS)
    return np.column_stack([np.cos(angle), np.sin(angle)])
