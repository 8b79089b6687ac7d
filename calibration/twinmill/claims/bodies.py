# SPDX-License-Identifier: Apache-2.0
"""The same diagrams and swarms in MuJoCo, beside the planar plant: mass, slipping wheels, hulls."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.stats import fisher_exact

from twinmill.claims.rows import Claim, Row, share
from twinmill.claims.swarms import BODIES, KINDS, MAP, Runs, run
from twinmill.report import Figure
from twinmill.report.canvas import BEFORE, FLOOR, draw
from twinmill.report.phase_figures import maps_figure, paint_paths
from twinmill.swarm.phase import phase_of
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import make_request, run_missing

PLANAR_SEEDS = 50
# Seeds of each cell that are run before the next kind, so that what is stopped has whole maps.
LAYER = 2
SECONDS = 120.0
SURE = 0.05  # of all cells together
TOLD = ("robot", "disc", "point")  # what is nearest to the robots first
# Of the paper's last figure: name, behaviour, turn of the odd robot over the ring's, seconds.
LAST = (
    ("milling", "milling", 0.0, 120.0),
    ("diffusing", "diffusing", 0.0, 120.0),
    ("odd robot, -3 times", "milling:5,odd:1", -3.0, 180.0),
    ("odd robot, +3 times", "milling:5,odd:1", 3.0, 180.0),
)
PLANTS = {"planar": FLOOR, "mujoco": BEFORE}
ROBOTS = {"diffusing": 8}
TARGET = ["target_radius_m=0.1", "range_m=1.2", "theta_a=0", *BODIES]


def layers(seeds: int) -> list[tuple[str, Request]]:
    """Requests of all maps, a layer of seeds after the other; no two share seeds."""
    asked = []
    for first in range(0, seeds, LAYER):
        count = min(LAYER, seeds - first)
        for k, kind in enumerate(TOLD):
            request = make_request(
                "milling",
                "paper.toml",
                [*MAP, *KINDS[kind]],
                plant="mujoco",
                seeds=count,
                duration_s=SECONDS,
            )
            before = len(TOLD) * first + k * count  # seeds of a cell, those of other kinds included
            asked.append((kind, replace(request, first_seed=1 + before * len(request.points))))
    return asked


def run_layers(seeds: int, folder: Path, tell: Callable[[int, int], None]) -> None:
    """Runs what is missing; stopped half way, it goes on where it was.

    Args:
        seeds: of each cell.
        folder: of all layers.
        tell: is given how many worlds are done and how many there are.
    """
    asked = layers(seeds)
    total, done = sum(request.world_count for _, request in asked), 0

    def advance(worlds: int) -> None:
        nonlocal done
        done += worlds
        tell(done, total)

    for _, request in asked:
        run_missing(request, place(folder, request), advance)


def place(folder: Path, request: Request) -> Path:
    """Where a layer is kept: by what it depends on."""
    return folder / request.sha256[:16]


def bodies(seeds: int, folder: Path) -> Claim:
    """Maps of all layers, which have run, and the swarms of the last figure, in both plants."""
    rows, maps, apart = [], {}, {}
    for kind in TOLD:
        mujoco = _joined([r for k, r in layers(seeds) if k == kind], folder)
        planar = run([*MAP, *KINDS[kind]], seeds=PLANAR_SEEDS, duration_s=SECONDS)
        for plant, runs in (("planar", planar), ("MuJoCo", mujoco)):
            name = f"{kind}, {plant}, {runs.request.seeds} seeds"
            maps[name] = phase_of(runs.request, runs.table, "milling")
            rows.append(share(f"mill: {name}", runs["class"].ravel() == "milling", None))
        apart[kind] = _differ(planar, mujoco)
    told = "; ".join(
        f"{kind}: {cells} of {len(mujoco.request.points)} cells differ beyond chance, mills "
        f"{_percent(rows[2 * k])} and {_percent(rows[2 * k + 1])} of all runs"
        for k, (kind, cells) in enumerate(apart.items())
    )
    return Claim(
        "bodies",
        "The diagram and the last figure with mass and wheels that slip",
        "A planar twin stands for robots with bodies.",
        None,
        f"Planar and MuJoCo. {told}. In the planar plant points pass through each other and discs "
        "slide off; in MuJoCo all have the robot's hull, and those that meet head-on hold each "
        "other, which depends on the hull's shape, not on its friction or the motors' torque "
        "(bench_jams).",
        rows,
        [
            maps_figure(
                maps,
                "Speed and turn rate, planar and MuJoCo",
                "The most frequent class of each cell, and its share in percent. Hatched: no class "
                "has more than half of the runs beyond doubt (95 %), as with few seeds.",
            ),
            last_figure(),
        ],
    )


def _joined(requests: list[Request], folder: Path) -> Runs:
    """Layers as one sweep, cell by cell."""
    tables = [read_sweep(place(folder, r))[1].replace_schema_metadata() for r in requests]
    together = pa.concat_tables(tables)
    order = np.argsort(np.array(together["cell"]), kind="stable")
    seeds = sum(request.seeds for request in requests)
    return Runs(replace(requests[0], seeds=seeds), together.take(order))


def _differ(planar: Runs, mujoco: Runs) -> int:
    """Cells whose shares of mills differ beyond chance, all cells together (Fisher, Bonferroni)."""
    hits = [(runs["class"] == "milling").sum(axis=1) for runs in (planar, mujoco)]
    of = [runs.request.seeds for runs in (planar, mujoco)]
    p = [fisher_exact([[a, of[0] - a], [b, of[1] - b]]).pvalue for a, b in zip(*hits, strict=True)]
    return int(np.sum(np.array(p) < SURE / len(p)))


def last_figure() -> Figure:
    """Start and end of each swarm in both plants."""

    def paint(panels: np.ndarray) -> None:
        for column, (name, behavior, turn, seconds) in enumerate(LAST):
            for row, (plant, color) in enumerate(PLANTS.items()):
                axes = panels[row, column]
                request = make_request(
                    behavior,
                    "paper.toml",
                    TARGET,
                    tables=[f"odd=0,{turn * 0.5:g},100,0.5"],
                    n=ROBOTS.get(behavior, None if turn else 6),
                    plant=plant,
                    duration_s=seconds,
                )
                trace = Runs(request, pa.table({})).trace(seconds)
                paint_paths(axes, trace[-80:], color, odd=bool(turn))
                axes.plot(*trace[0, :, :2].T, "s", ms=3, mfc="none", mec="#999999")
                axes.set(**_around(trace[[0, *range(-80, 0)], :, :2]))
                axes.set_title(f"{name}\n{plant}", fontsize=7)

    return Figure(
        draw(3.6, paint, nrows=len(PLANTS), ncols=len(LAST), squeeze=False),
        "The swarms of the last figure, from start to end",
        "Squares: where the robots start, the same in both plants; lines: the last 8 of 120 s (180 "
        "with an odd robot, hollow); dots: the end. Six robots, eight that diffuse; whole bodies "
        "seen. The bar is 1 m.",
    )


def _around(points: np.ndarray) -> dict:
    """Limits of a square with all (T, n, 2) points in it."""
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    half = 0.54 * float((high - low).max())
    (x, y) = (low + high) / 2
    return {"xlim": (x - half, x + half), "ylim": (y - half, y + half)}


def _percent(row: Row) -> str:
    return f"{100 * row.value:.0f} % ({100 * row.low:.0f} to {100 * row.high:.0f})"
