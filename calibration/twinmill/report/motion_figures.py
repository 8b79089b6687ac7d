# SPDX-License-Identifier: Apache-2.0
"""Figure of motion: where on the floor it differs from what was predicted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from twinmill.fitting.compare import RobotComparison
from twinmill.predict.regimes import HORIZON
from twinmill.predict.residual import rotate
from twinmill.predict.windows import HORIZONS_S
from twinmill.report.canvas import PREDICTED, draw
from twinmill.report.html import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELLS = 9  # of the floor map along its longer side


def floor_map(robot: RobotComparison) -> Figure:
    """Mean signed error of predictions half a second ahead, by place."""
    track, starts = robot.measurement.track, robot.windows.starts
    heading_rad = track.heading_smooth[starts]
    error = robot.errors[:, HORIZON]
    world = np.column_stack(rotate(error[:, 0], error[:, 1], heading_rad))
    known = np.isfinite(world).all(axis=1)
    place, mean, count = _cells(track.pose[starts[known], :2], world[known])
    length = np.hypot(*mean.T)
    largest = max(float(length.max(initial=0)), 1e-9)
    span = max(float(np.ptp(place, axis=0).max(initial=0)), 0.2)
    scale = 0.9 * span / CELLS / largest

    def paint(axes: Axes) -> None:
        from matplotlib.ticker import MaxNLocator  # see canvas: only where something is drawn

        tip = place + scale * mean
        axes.scatter(place[:, 0], place[:, 1], s=4 + 2 * np.sqrt(count), color="#bbbbbb", zorder=2)
        axes.quiver(
            *place.T,
            *(tip - place).T,
            angles="xy",
            scale_units="xy",
            scale=1,
            color=PREDICTED,
            width=0.006,
            zorder=3,
        )
        axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", adjustable="datalim")
        axes.margins(0.15)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.set_title(f"longest arrow: {1000 * largest:.3g} mm", loc="left", color=PREDICTED)

    return Figure(
        draw(4.4, paint),
        "Where on the floor it fails",
        f"An arrow shows which way, on average, the robot ended up from its prediction "
        f"{HORIZONS_S[HORIZON]:g} s ahead. Arrows that all point one way are a tilted or grained "
        "floor; arrows in one corner are a patch; arrows that point anywhere are noise.",
    )


def _cells(place: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean place, mean error and count of windows in square cells of the floor."""
    size_m = max(float(np.ptp(place, axis=0).max(initial=0)), 0.2) / CELLS
    _, cell = np.unique(np.floor((place - place.min(0)) / size_m), axis=0, return_inverse=True)
    count = np.bincount(cell.ravel())
    mean = [np.bincount(cell.ravel(), values) / count for values in (*place.T, *error.T)]
    return np.column_stack(mean[:2]), np.column_stack(mean[2:]), count
