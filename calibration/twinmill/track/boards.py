# SPDX-License-Identifier: Apache-2.0
"""Boards that a lens is calibrated with: ChArUco, or a checkerboard without markers."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

FAMILY = cv2.aruco.DICT_5X5_100  # other than the robots'
MARKER_SHARE = 0.75  # of a square's side
Kind = Literal["charuco", "checkerboard"]
KINDS: tuple[Kind, ...] = ("charuco", "checkerboard")


@dataclass(frozen=True)
class Board:
    """A board.

    Attributes:
        kind: with markers in its white squares, or without.
        squares: across and down, all of them.
        square_m: side of a square.
    """

    kind: Kind = "charuco"
    squares: tuple[int, int] = (7, 5)
    square_m: float = 0.036

    @property
    def _charuco(self) -> cv2.aruco.CharucoBoard:
        book = cv2.aruco.getPredefinedDictionary(FAMILY)
        return cv2.aruco.CharucoBoard(
            self.squares, self.square_m, MARKER_SHARE * self.square_m, book
        )

    def drawn(self, square_px: int) -> np.ndarray:
        """(H, W) bytes of a ChArUco board."""
        return self._charuco.generateImage(tuple(square_px * n for n in self.squares))

    def find(self, grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K, 3) m on the board and (K, 2) px of its inner corners; none if it is not there."""
        if self.kind == "charuco":
            corners, numbers, _, _ = cv2.aruco.CharucoDetector(self._charuco).detectBoard(grey)
            if corners is None or len(corners) == 0:
                return np.empty((0, 3)), np.empty((0, 2))
            inner = self._charuco.getChessboardCorners()
            return np.array(inner)[np.ravel(numbers)], np.reshape(corners, (-1, 2))
        inner = (self.squares[0] - 1, self.squares[1] - 1)
        found, corners = cv2.findChessboardCornersSB(grey, inner)
        if not found:
            return np.empty((0, 3)), np.empty((0, 2))
        column, row = np.meshgrid(np.arange(inner[0]), np.arange(inner[1]))
        flat = np.column_stack([column.ravel(), row.ravel(), np.zeros(column.size)])
        return flat * self.square_m, np.reshape(corners, (-1, 2))
