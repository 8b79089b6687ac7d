# SPDX-License-Identifier: Apache-2.0
"""What is searched: two tables and how many robots play the second."""

from dataclasses import dataclass

import numpy as np

GENES = 9  # ring's table, share of odd robots, odd table; all within 0..1
Row = list[int]


@dataclass(frozen=True)
class Mix:
    """Robots of one table, and odd ones of another.

    Attributes:
        ring, odd: inputs unseen speed, unseen turn, seen speed, seen turn; turns in thousandths.
        n, odd_count: robots, and how many of them are odd: at most half.
    """

    ring: Row
    odd: Row
    n: int
    odd_count: int

    def tables(self, name: str) -> list[tuple[str, Row]]:
        """Name and table of each species, the ring's first."""
        return [(name, self.ring), *([(f"{name}_odd", self.odd)] if self.odd_count else [])]

    def behavior(self, name: str) -> str:
        """What --behavior takes to run the mix by these names."""
        if not self.odd_count:
            return name
        return f"{name}:{self.n - self.odd_count},{name}_odd:{self.odd_count}"


def _row(genes: np.ndarray) -> Row:
    """The firmware's steps: whole percent of speed, thousandths of turn."""
    speeds, turns = np.rint(200 * genes[::2] - 100), np.rint(4000 * genes[1::2] - 2000)
    return [int(speeds[0]), int(turns[0]), int(speeds[1]), int(turns[1])]


def decode(genes: np.ndarray, n: int) -> Mix:
    """From (GENES,) numbers within 0..1."""
    odd_count = min(int(genes[4] * (n // 2 + 1)), n // 2)
    return Mix(_row(genes[:4]), _row(genes[5:]), n, odd_count)


def table_text(row: Row) -> str:
    """As --table and behaviors.toml write it."""
    return f"{row[0]},{row[1] / 1000:g},{row[2]},{row[3] / 1000:g}"
