# SPDX-License-Identifier: Apache-2.0
"""From a tag's four corners in the picture to where it is: a square on a plane over the floor."""

from dataclasses import dataclass

import numpy as np

from twinmill.track.floor import View

# Front left, front right, rear right, rear left; x to the front, y to the left, of side 1.
SQUARE = np.array([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]])


@dataclass(frozen=True)
class Squares:
    """Tags on the plane.

    Attributes:
        pose: (N, 3) x_m, y_m, theta_rad.
        side_m: (N,) as measured.
        error_px: (N,) RMS miss of the corners of a square of the size given.
        scale_px_per_m: (N,) of the picture there.
    """

    pose: np.ndarray
    side_m: np.ndarray
    error_px: np.ndarray
    scale_px_per_m: np.ndarray


def locate(view: View, corners_px: np.ndarray, size_m: float, height_m: float) -> Squares:
    """The squares that lie nearest to the corners, by least squares on the plane (Umeyama 1991).

    Args:
        view: the camera over the floor.
        corners_px: (N, 4, 2).
        size_m: side of a tag's black square.
        height_m: of the tags over the floor.
    """
    met = view.on_plane(corners_px.reshape(-1, 2), height_m).reshape(-1, 4, 2)
    return fit_squares(view, corners_px, met, size_m, height_m=height_m)


def fit_squares(
    view: View, corners_px: np.ndarray, met_m: np.ndarray, size_m: float, *, height_m: float
) -> Squares:
    """Squares fitted to (N, 4, 2) m, the corners on the plane."""
    middle = met_m.mean(axis=1)
    # As complex numbers the best turn is the angle of the sum of products, the best scale its size.
    arms = (met_m - middle[:, None]) @ [1, 1j]
    square = SQUARE @ [1, 1j]
    product = (arms * square.conj()).sum(axis=1) / np.sum(np.abs(square) ** 2)
    pose = np.column_stack([middle, np.angle(product)])
    fitted = square * size_m * np.exp(1j * pose[:, 2:]) + (middle @ [1, 1j])[:, None]
    points = np.stack([fitted.real, fitted.imag, np.full(fitted.shape, height_m)], axis=-1)
    again = view.project(points.reshape(-1, 3)).reshape(-1, 4, 2)
    error_px = np.sqrt(np.mean(np.sum((again - corners_px) ** 2, axis=2), axis=1))
    sides_px = np.linalg.norm(np.roll(again, -1, axis=1) - again, axis=2).mean(axis=1)
    return Squares(pose, np.abs(product), error_px, sides_px / size_m)
