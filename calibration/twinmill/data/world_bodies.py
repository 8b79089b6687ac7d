# SPDX-License-Identifier: Apache-2.0
"""Bodies of a twin's world in a log: obstacles, walls, goals, evaders."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import turbopi

CHANNEL = "TWIN_BODY"
ARC = 16  # points of each half circle


@dataclass(frozen=True)
class WorldBody:
    """One body: what is nearer than radius_m to the segment between two points.

    Attributes:
        name: as the world's file has it.
        colour: for cameras; empty: none sees it.
        solid: it stops robots and hides what is behind it.
        t_s: (T,) since the log's t0.
        from_m, to_m: (T, 2) the segment's ends in W; of a disc they are the same.
        radius_m: of a disc, or half the thickness of a wall.
    """

    name: str
    colour: str
    solid: bool
    t_s: np.ndarray
    from_m: np.ndarray
    to_m: np.ndarray
    radius_m: float

    @property
    def moves(self) -> bool:
        """Tells evaders from what stands."""
        return bool(np.ptp(self.from_m, axis=0).any())

    def outline(self, row: int = -1) -> np.ndarray:
        """(2 ARC, 2) points around it at one of its times, the last unless told."""
        start, end = self.from_m[row], self.to_m[row]
        along_rad = np.arctan2(*(end - start)[::-1])
        half = np.linspace(-np.pi / 2, np.pi / 2, ARC) + along_rad
        arc = self.radius_m * np.column_stack([np.cos(half), np.sin(half)])
        return np.vstack([end + arc, start - arc])


def world_bodies(payloads: Sequence[bytes], t0_utime_us: int) -> list[WorldBody]:
    """Bodies by name, in the order in which the log names them first.

    Args:
        payloads: of the messages on CHANNEL.
        t0_utime_us: time 0.
    """
    by_name: dict[str, list[turbopi.body_t]] = {}
    for message in map(turbopi.body_t.decode, payloads):
        by_name.setdefault(message.name, []).append(message)
    return [
        WorldBody(
            name,
            said[-1].colour,
            bool(said[-1].solid),
            np.array([(m.utime_us - t0_utime_us) / 1e6 for m in said]),
            np.array([m.from_m for m in said]),
            np.array([m.to_m for m in said]),
            said[-1].radius_m,
        )
        for name, said in by_name.items()
    ]
