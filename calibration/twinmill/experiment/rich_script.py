# SPDX-License-Identifier: Apache-2.0
"""An input script that shows every effect: steps, random duties on all axes, arcs, stops."""

import csv
from pathlib import Path

import numpy as np

LEVELS = (0.25, 0.5, 0.75, 0.9, 1.0)
# Forward, sideways and turn as duties of front-left, front-right, rear-left, rear-right.
AXES = np.array([[1, 1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1]])
REST_S = 1.5


def write_rich_script(path: Path, duration_s: float, seed: int) -> None:
    """Writes rows `t_s,fl_pct,fr_pct,rl_pct,rr_pct`, held until the next."""
    random = np.random.default_rng(seed)
    rows: list[tuple[float, np.ndarray]] = []
    t_s = 0.0
    parts = (_ladder, _random_axes, _arcs, _milling, _out_and_back, _random_axes)
    while t_s < duration_s:
        for part in parts:
            for hold_s, duty in [*part(random), (REST_S, np.zeros(4))]:
                rows.append((t_s, duty))
                t_s += hold_s
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t_s", "fl_pct", "fr_pct", "rl_pct", "rr_pct"])
        for at_s, duty in rows:
            if at_s < duration_s:
                writer.writerow([f"{at_s:.3f}", *np.rint(100 * np.clip(duty, -1, 1)).astype(int)])


def _ladder(random: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    """From rest to each level and back to rest, on changing axes."""
    steps = []
    for level in random.permutation(LEVELS):
        duty = level * random.choice([-1, 1]) * AXES[random.integers(3)]
        steps += [(0.9, duty), (0.7, np.zeros(4))]
    return steps


def _random_axes(random: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    """Random levels on all axes, held for random times."""
    steps = []
    for _ in range(40):
        mix = random.choice([-1, 0, 1], 3) * random.choice(LEVELS, 3)
        steps.append((float(random.uniform(0.15, 0.8)), np.clip(mix @ AXES, -1, 1)))
    return steps


def _arcs(random: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    return [
        (2.0, level * AXES[0] + turn * AXES[2])
        for level in (0.5, 0.8)
        for turn in random.permutation([-0.4, -0.15, 0.15, 0.4])
    ]


def _milling(random: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    return [
        (float(random.uniform(0.3, 1.5)), AXES[0] + 0.63 * side * AXES[2]) for side in [1, -1] * 6
    ]


def _out_and_back(random: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    return [(1.5, level * AXES[0]) for level in (0.5, -0.5, 1.0, -1.0)]
