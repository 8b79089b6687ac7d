# SPDX-License-Identifier: Apache-2.0
"""Picture of the robot's sight with the old limits and with the new ones."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from twinmill.threshold.box import SURE_OUTSIDE, Ball, PictureResult
from twinmill.threshold.pictures import Picture

SHOWN = 4
HIT, MISS, FALSE = (60, 190, 75), (0, 110, 220), (230, 30, 30)


def draw(
    path: Path,
    pictures: list[Picture],
    balls: list[Ball],
    *,
    before: list[PictureResult],
    after: list[PictureResult],
) -> None:
    """Writes a figure that compares two colour thresholds on some photographs of a ball.

    Each row is one picture: the photograph with the ball's outline, then the pixels that the limits
    before and after take for the ball. Hits, misses and false pixels differ in colour.

    Args:
        path: of the new figure.
        pictures: photographs; the first few are shown.
        balls: where the ball is in each, px.
        before: result of the old limits on each.
        after: result of the new ones.
    """
    rows = range(min(SHOWN, len(pictures)))
    figure = Figure(figsize=(12, 3.3 * len(rows)), layout="constrained")
    for row in rows:
        axes = [figure.add_subplot(len(rows), 3, 3 * row + k + 1) for k in range(3)]
        picture, ball = pictures[row], balls[row]
        axes[0].imshow(picture.rgb)
        ring = Circle((ball.x_px, ball.y_px), ball.radius_px, fill=False, ec="white", lw=1.2)
        ring.set_path_effects([withStroke(linewidth=3.5, foreground="black")])  # on any colour
        axes[0].add_patch(ring)
        axes[0].set_title(picture.name)
        for axis, seen, words in ((axes[1], before[row], "before"), (axes[2], after[row], "after")):
            axis.imshow(_coloured(picture, ball, seen))
            axis.set_title(
                f"{words}: {100 * seen.hit_frac:.0f} % of the ball, {seen.false_px} false px",
            )
        for axis in axes:
            axis.set_axis_off()
    figure.suptitle("green: ball, found   blue: ball, missed   red: found, but not the ball")
    figure.savefig(path, dpi=90)


def _coloured(picture: Picture, ball: Ball, seen: PictureResult) -> np.ndarray:
    shown = np.repeat(picture.yuv[..., :1] // 2 + 80, 3, axis=2)
    distance = ball.distance(seen.mask.shape)
    shown[(distance < 1) & ~seen.mask] = MISS
    shown[(distance <= SURE_OUTSIDE) & seen.mask] = HIT
    shown[(distance > SURE_OUTSIDE) & seen.mask] = FALSE
    return shown
