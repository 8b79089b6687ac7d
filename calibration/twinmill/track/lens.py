# SPDX-License-Identifier: Apache-2.0
"""A lens from a film of a board that is held before it in many places (Zhang 2000)."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from twinmill.arguments import option
from twinmill.track.boards import Board
from twinmill.track.camera import Camera

CORNERS = 8  # of a view that is used
APART = 0.04  # of the picture's width, between views that are used
VIEWS_MAX, VIEWS_MIN = 60, 8
WORST = 3.0  # a view this many times as bad as the median is blurred
CELLS = 5  # the picture is cut into so many by so many
COVERED = 0.7
STEEP = 0.03  # of the focal length: its standard error


@dataclass(frozen=True)
class Calibration:
    """Lens that a calibration found.

    Attributes:
        camera: the lens.
        error_px: RMS miss of the corners.
        views: used.
        focal_std_px: standard error of the focal length.
        covered: share of the picture's cells in which a corner was seen.
        advice: sentences.
    """

    camera: Camera
    error_px: float
    views: int
    focal_std_px: float
    covered: float
    advice: list[str]

    def to_json(self) -> dict:
        """Focal lengths and centre in px, distortion, error and advice, as `--json` prints them."""
        return {
            "focal_px": [float(self.camera.matrix[0, 0]), float(self.camera.matrix[1, 1])],
            "centre_px": [float(self.camera.matrix[0, 2]), float(self.camera.matrix[1, 2])],
            "distortion": [float(k) for k in self.camera.distortion],
            **self.notes(),
            "advice": self.advice,
        }

    def notes(self) -> dict:
        """Remarks that its file keeps with it."""
        return {
            "error_px": self.error_px,
            "views": self.views,
            "focal_std_px": self.focal_std_px,
            "covered": self.covered,
        }


View = tuple[np.ndarray, np.ndarray]  # (K, 3) m on the board, (K, 2) px


def pick_views(pictures: Iterable[np.ndarray], board: Board) -> tuple[list[View], int]:
    """Views of the board that differ, and how many pictures were looked at."""
    views: list[View] = []
    last, looked = np.full(2, np.inf), 0
    for picture in pictures:
        looked += 1
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        places, pixels = board.find(grey)
        if len(pixels) < CORNERS:
            continue
        here = np.append(pixels.mean(axis=0), 3 * pixels.std(axis=0))
        if np.size(last) == 4 and np.abs(here - last).max() < APART * grey.shape[1]:
            continue
        views.append((places.astype(np.float32), pixels.astype(np.float32)))
        last = here
    if len(views) > VIEWS_MAX:
        views = [views[k] for k in np.linspace(0, len(views) - 1, VIEWS_MAX).astype(int)]
    return views, looked


def calibrate(
    views: list[View], size_px: tuple[int, int], exposure_s: float = 0.0, line_delay_s: float = 0.0
) -> Calibration:
    """The lens that fits the views best; blurred ones are left out once.

    Raises:
        ValueError: there are too few, or they do not fix the lens.
    """
    if len(views) < VIEWS_MIN:
        raise ValueError(
            f"the board was found in {len(views)} different places, and {VIEWS_MIN} are needed; "
            f"move it about slowly, tilted too, and give {option('board')}, {option('squares')} "
            f"and {option('square')} as it is."
        )
    found = _solve(views, size_px)
    errors = found[-1].ravel()
    kept = [v for v, e in zip(views, errors, strict=True) if e < WORST * np.median(errors)]
    if VIEWS_MIN <= len(kept) < len(views):
        found = _solve(kept, size_px)
    error_px, matrix, distortion, _, _, deviation, _, _ = found
    used = len(found[-1])
    std_px = float(deviation.ravel()[0])
    if not np.isfinite(matrix).all() or not std_px < STEEP * matrix[0, 0]:
        raise ValueError(
            f"the focal length is only known to {std_px:.0f} px of {matrix[0, 0]:.0f}; show the "
            "board tilted by 30 to 45 degrees, to all sides."
        )
    covered = _covered(views, size_px)
    advice = []
    if covered < COVERED:
        advice.append(
            f"The board was seen in {100 * covered:.0f} % of the picture; show it in the corners, "
            "where lenses bend most."
        )
    if error_px > 1.0:
        advice.append(f"Corners miss by {error_px:.1f} px; move the board slower and keep it flat.")
    camera = Camera(size_px, matrix, np.ravel(distortion)[:5], exposure_s, line_delay_s)
    return Calibration(camera, float(error_px), used, std_px, covered, advice)


def _solve(views: list[View], size_px: tuple[int, int]) -> tuple:
    places, pixels = zip(*views, strict=True)
    return cv2.calibrateCameraExtended(places, pixels, size_px, None, None)


def _covered(views: list[View], size_px: tuple[int, int]) -> float:
    pixels = np.vstack([pixels for _, pixels in views])
    cells = np.clip((pixels / size_px * CELLS).astype(int), 0, CELLS - 1)
    return len(np.unique(cells, axis=0)) / CELLS**2
