# SPDX-License-Identifier: Apache-2.0
"""A camera's lens: pinhole with Brown's distortion (Brown 1966), as OpenCV has it; its file."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from twinmill.files import replacing

NUMBERS = ("focal_x_px", "focal_y_px", "centre_x_px", "centre_y_px")


@dataclass(frozen=True)
class Camera:
    """A lens, and how its picture's rows are exposed.

    Attributes:
        size_px: width and height of the picture.
        matrix: (3, 3) focal lengths and centre, px.
        distortion: (5,) k1, k2, p1, p2, k3.
        exposure_s: of each row.
        line_delay_s: from the start of one row to that of the next; 0 with a global shutter.
    """

    size_px: tuple[int, int]
    matrix: np.ndarray
    distortion: np.ndarray
    exposure_s: float = 0.0
    line_delay_s: float = 0.0

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """(N, 2) px to (N, 3) directions before the camera: x right, y down, z = 1 ahead."""
        points = np.ascontiguousarray(pixels, float).reshape(-1, 1, 2)
        limit = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
        ideal = cv2.undistortPoints(points, self.matrix, self.distortion, criteria=limit)
        return np.column_stack([ideal.reshape(-1, 2), np.ones(len(pixels))])

    def write(self, path: Path, notes: dict, force: bool) -> None:
        """Writes it as TOML.

        Args:
            path: the file.
            notes: how it was found, for people.
            force: replace a file.
        """
        matrix = self.matrix
        numbers = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
        data = {
            "lens": {
                "width_px": self.size_px[0],
                "height_px": self.size_px[1],
                **dict(zip(NUMBERS, map(float, numbers), strict=True)),
                "distortion": [float(k) for k in self.distortion],
            },
            "shutter": {"exposure_s": self.exposure_s, "line_delay_s": self.line_delay_s},
            "found": notes,
        }
        with replacing(path, force) as temporary:
            temporary.write_text(tomlkit.dumps(data))


def read_camera(path: Path) -> Camera:
    """Reads the file that Camera.write made.

    Raises:
        ValueError: it is none, or lacks a number.
    """
    try:
        data = tomlkit.parse(path.read_text()).unwrap()
        lens, shutter = data["lens"], data.get("shutter", {})
        fx, fy, cx, cy = (float(lens[name]) for name in NUMBERS)
        distortion = np.array(lens["distortion"], float)
        size_px = (int(lens["width_px"]), int(lens["height_px"]))
        times = [float(shutter.get(name, 0.0)) for name in ("exposure_s", "line_delay_s")]
    except (OSError, UnicodeDecodeError, TOMLKitError, TypeError, ValueError, KeyError) as error:
        raise ValueError(
            f"{path}: is no camera's file ({error}); make one with `twinmill track calibrate`."
        ) from error
    numbers = np.array([fx, fy, cx, cy, *distortion, *times])
    if distortion.shape != (5,) or not np.isfinite(numbers).all() or min(fx, fy) <= 0:
        raise ValueError(
            f"{path}: needs focal lengths above 0 and five numbers of distortion; make it anew "
            "with `twinmill track calibrate`."
        )
    if min(times) < 0:
        raise ValueError(f"{path}: exposure_s and line_delay_s must not be below 0.")
    return Camera(size_px, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]), distortion, *times)
