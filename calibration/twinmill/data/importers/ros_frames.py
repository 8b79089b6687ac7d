# SPDX-License-Identifier: Apache-2.0
"""Frames of poses: up a tf tree to its root, and from a camera over the floor onto the floor.

Poses of a tree are composed with what was told last of the frames between, as messages come in.
"""

import numpy as np

from twinmill.data.importers.ros_messages import Row
from twinmill.data.importers.series import multiply, quaternion_from_heading

DEEPEST = 50  # frames; deeper is a loop
FEWEST = 10
WIDE = 0.1  # of the way along a plane that goes across, so that its tilt can be told
FLAT = 0.1  # of the way across that sticks out of it


class Frames:
    """The newest transform of each frame to its parent."""

    def __init__(self) -> None:
        self._parent: dict[str, tuple[str, np.ndarray, np.ndarray]] = {}
        self.fixed: set[str] = set()  # frames that never move in their parents

    def put(self, frame: str, parent: str, row: Row, *, fixed: bool) -> None:
        """Places a frame in its parent.

        Args:
            frame: its name.
            parent: name of the frame that it is placed in.
            row: that of `ros_messages.transform_row`.
            fixed: the frame never moves in its parent.
        """
        self._parent[frame] = parent, np.array(row[:3]), np.array(row[3:])
        (self.fixed.add if fixed else self.fixed.discard)(frame)

    def carrier(self, frame: str) -> str:
        """The frame itself if it moves in its parent, else the next one above that does."""
        for _ in range(DEEPEST):
            if frame not in self.fixed:
                break
            frame = self._parent[frame][0]
        return frame

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


def on_floor(position_m: np.ndarray, turned_wxyz: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """Poses in a frame whose z goes from the floor to the camera and whose x is the picture's.

    A robot's places lie in a plane, from which the camera's tilt follows; where they lie on a line
    it is the tags' own plane. The heading is that of the tag's x axis.

    Args:
        position_m: (N, 3) in the camera's frame: x right, y down, z ahead.
        turned_wxyz: (N, 4) unit quaternions, of a tag that lies flat; its z may go in or out.

    Returns:
        (N, 3) m, (N, 4), and what was done, in words.
    """
    from scipy.spatial.transform import Rotation  # 28 MB, and few bags get here

    turned = Rotation.from_quat(turned_wxyz, scalar_first=True)
    up, by = _plane(position_m), "their places"
    if up is None:
        axes = turned.apply([0, 0, 1])
        up, by = np.mean(axes * np.sign(axes @ axes[0])[:, None], axis=0), "the tags"
        up = up / np.linalg.norm(up)
    up = up if up @ position_m.mean(axis=0) < 0 else -up  # towards the camera
    across = np.array([1.0, 0, 0]) - up[0] * up
    across /= np.linalg.norm(across)
    axes = np.array([across, np.cross(up, across), up])
    ahead = turned.apply([1, 0, 0]) @ axes.T
    tilt_deg = np.degrees(np.arccos(np.clip(-up[2], -1, 1)))
    return (
        position_m @ axes.T,
        quaternion_from_heading(np.arctan2(ahead[:, 1], ahead[:, 0])),
        f"its poses are in the camera's frame; they are put on the floor, from which it is tilted "
        f"by {tilt_deg:.1f} degrees by {by}; x is the picture's right, and the heading the tag's x",
    )


def _plane(position_m: np.ndarray) -> np.ndarray | None:
    """(3,) normal of the plane of (N, 3) places; None if they do not tell it."""
    if len(position_m) < FEWEST:
        return None
    _, way, axes = np.linalg.svd(position_m - position_m.mean(axis=0), full_matrices=False)
    return axes[2] if way[1] > WIDE * way[0] and way[2] < FLAT * way[1] else None
