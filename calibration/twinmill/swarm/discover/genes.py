# SPDX-License-Identifier: Apache-2.0
"""Genes of the search: two tables and the share of robots that play the second."""

from dataclasses import dataclass

import numpy as np

Row = list[int]


@dataclass(frozen=True)
class Mix:
    """Robots of one table, and odd ones of another.

    Attributes:
        ring, odd: inputs unseen speed, unseen turn, seen speed, seen turn, or so for each number of
            k bits; turns in thousandths.
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
        """Argument of --behavior that runs the mix by these names."""
        if not self.odd_count:
            return name
        return f"{name}:{self.n - self.odd_count},{name}_odd:{self.odd_count}"


def gene_count(bits: int) -> int:
    """Genes in the ring's table, the share of odd robots, and the odd table."""
    return 2 * _inputs(bits) + 1


def _inputs(bits: int) -> int:
    """Speed and turn of each row."""
    return 2 << bits


def _row(genes: np.ndarray) -> Row:
    """The firmware's steps: whole percent of speed, thousandths of turn."""
    row = np.empty(len(genes), int)
    row[::2], row[1::2] = np.rint(200 * genes[::2] - 100), np.rint(4000 * genes[1::2] - 2000)
    return row.tolist()


def decode(genes: np.ndarray, n: int, bits: int) -> Mix:
    """From (gene_count,) numbers within 0..1."""
    inputs = _inputs(bits)
    odd_count = min(int(genes[inputs] * (n // 2 + 1)), n // 2)
    return Mix(_row(genes[:inputs]), _row(genes[inputs + 1 :]), n, odd_count)


def table_text(row: Row) -> str:
    """As --table and behaviors.toml write it."""
    pairs = zip(row[::2], row[1::2], strict=True)
    return ",".join(f"{speed},{turn / 1000:g}" for speed, turn in pairs)
