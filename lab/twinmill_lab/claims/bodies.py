# SPDX-License-Identifier: Apache-2.0
"""Phase diagram of the paper in MuJoCo, beside the planar plant: mass, slipping wheels, hulls."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.stats import fisher_exact

from twinmill.report.phase_figures import maps_figure
from twinmill.swarm.phase import phase_of
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import make_request
from twinmill_lab.claims.rows import Claim, Row, share
from twinmill_lab.claims.swarms import KINDS, MAP, Runs, place, run

PLANAR_SEEDS = 50
# Seeds of each cell that are run before the next kind, so that what is stopped has whole maps.
LAYER = 2
SECONDS = 120.0
SURE = 0.05  # of all cells together
TOLD = ("robot", "disc", "point")  # what is nearest to the robots first


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


def bodies(seeds: int, folder: Path) -> Claim:
    """Maps of all layers, which have run, beside those of the planar plant."""
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
        "The diagram with mass and wheels that slip",
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


def _percent(row: Row) -> str:
    return f"{100 * row.value:.0f} % ({100 * row.low:.0f} to {100 * row.high:.0f})"
