# SPDX-License-Identifier: Apache-2.0
"""Figure of the camera's bit: where it is seen and where the model sees it."""

import numpy as np

from twinmill.predict.detection_errors import DetectionComparison
from twinmill.report.canvas import draw
from twinmill.report.html import Figure

FEWEST = 10  # frames of a place that tell a share


def field_of_view(bits: DetectionComparison, title: str = "What the camera sees") -> Figure:
    """Share of frames that see, over range and bearing of the nearest robot."""
    cells = bits.cells()
    ranges = sorted({r for c in cells for r in c["range_m"]})
    bearings = np.degrees(sorted({b for c in cells for b in c["bearing_rad"]}))
    kinds = ("measured", "predicted")
    shares = {kind: np.full((len(ranges) - 1, len(bearings) - 1), np.nan) for kind in kinds}
    for cell in (c for c in cells if c["frames"] >= FEWEST):
        r = ranges.index(cell["range_m"][0])
        b = int(np.searchsorted(bearings, np.degrees(cell["bearing_rad"][0]) - 1e-6))
        for kind in kinds:
            shares[kind][r, b] = cell[f"{kind}_share"]

    def paint(panels) -> None:
        for axes, kind in zip(panels, kinds, strict=True):
            mesh = axes.pcolormesh(
                bearings, ranges, shares[kind], cmap="viridis", vmin=0, vmax=1, rasterized=False
            )
            half = min(np.degrees(bits.half_rad), 180)
            axes.plot(
                [-half, -half, half, half], [0, bits.reach_m, bits.reach_m, 0], color="#d55e00"
            )
            axes.set(title=kind, xlabel="bearing (°), left positive", xticks=[-90, 0, 90])
            axes.invert_xaxis()
            axes.grid(visible=False)
        panels[0].set_ylabel("range of the nearest robot (m)")
        panels[0].figure.colorbar(mesh, ax=panels, label="share of frames that see", shrink=0.8)

    return Figure(
        draw(3.0, paint, ncols=2, sharey=True),
        title,
        "Share of frames whose bit is 1, by where the nearest robot was. Inside the orange line "
        "the model's camera sees. Both pictures should be alike; light outside the line is a false "
        "or a farther robot's detection, dark inside a missed one. Places of fewer than "
        f"{FEWEST} frames are left white.",
    )
