# SPDX-License-Identifier: Apache-2.0
"""Where a frame of a tf tree is, in the frame at the root of the tree.

Poses are composed with what was told last of the frames between, as messages come in.
"""

import numpy as np

from twinmill.data.importers.ros_messages import Row
from twinmill.data.importers.series import multiply

DEEPEST = 50  # frames; deeper is a loop


class Frames:
    """The newest transform of each frame to its parent."""

    def __init__(self) -> None:
        self._parent: dict[str, tuple[str, np.ndarray, np.ndarray]] = {}

    def put(self, frame: str, parent: str, row: Row) -> None:
        """Args: row as ros_messages.transform_row."""
        self._parent[frame] = parent, np.array(row[:3]), np.array(row[3:])

    def place(self, frame: str) -> tuple[str, Row]:
        """The root of the tree, and the frame's pose in it."""
        parent, position, turn = self._parent[frame]
        for _ in range(DEEPEST):
            if parent not in self._parent:
                break
            parent, offset, own = self._parent[parent]
            position = offset + _turned(own, position)
            turn = multiply(own, turn)
        return parent, (*position.tolist(), *turn.tolist())


def _turned(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector turned by a unit quaternion, w first."""
    conjugate = quaternion * [1, -1, -1, -1]
    return multiply(multiply(quaternion, np.array([0, *vector])), conjugate)[1:]
