# SPDX-License-Identifier: Apache-2.0
"""Draws what `build/bin/bench_scaling` prints: ... | python benchmarks/scaling.py docs."""

import sys
from io import StringIO
from pathlib import Path

import matplotlib
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#808080"


def draw(
    table: pd.DataFrame, labels: dict[str, tuple[str, str]], ylabel: str
) -> tuple[Figure, Axes]:
    """One line for each column but the first, both axes logarithmic."""
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, (label, color) in labels.items():
        axes.loglog(table["robots"], table[name], "o-", color=color, label=label, markersize=4)
    axes.set(xlabel="robots", ylabel=ylabel)
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(frameon=False)
    return figure, axes


def main() -> None:
    """Writes scaling.svg and cost.svg into the folder."""
    matplotlib.rcParams["svg.hashsalt"] = "scaling"
    folder = Path(sys.argv[1])
    scaling, cost = (pd.read_csv(StringIO(part)) for part in sys.stdin.read().strip().split("\n\n"))
    figure, _ = draw(
        scaling,
        {"all_pairs_us": ("all pairs", ORANGE), "grid_us": ("grid", BLUE)},
        "a robot's step, microseconds",
    )
    figure.savefig(folder / "scaling.svg", metadata={"Date": None})
    figure, axes = draw(
        cost,
        {
            "planar_times_real": ("planar plant", BLUE),
            "mujoco_times_real": ("MuJoCo, 2 ms", ORANGE),
        },
        "times real time, one thread",
    )
    axes.axhline(1, color=GREY, linewidth=0.8)
    figure.savefig(folder / "cost.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
