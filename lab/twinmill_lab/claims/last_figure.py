# SPDX-License-Identifier: Apache-2.0
"""The swarms of the paper's last figure in both plants: how many end as published, one of each."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from twinmill.report import Figure
from twinmill.report.canvas import BEFORE, FLOOR, draw
from twinmill.report.phase_figures import around, paint_paths
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import make_request
from twinmill_lab.claims.rows import Claim, Row, median, share
from twinmill_lab.claims.swarms import BODIES, Runs, place


@dataclass(frozen=True)
class Swarm:
    """One of the figure.

    Attributes:
        name: in words.
        behavior: of `twin_run`.
        n: robots; None: those of the mix.
        turn: of the odd robot over the ring's; 0: none is odd.
    """

    name: str
    behavior: str
    n: int | None = None
    turn: float = 0.0

    @property
    def duration_s(self) -> float:
        """Seconds that a run of the figure lasts."""
        return 180.0 if self.turn else 120.0

    def request(self, plant: str, seeds: int) -> Request:
        """Its runs: robots all alike that see whole bodies; the same starts in both plants."""
        return make_request(
            self.behavior,
            "paper.toml",
            TARGET,
            tables=[f"odd=0,{self.turn * 0.5:g},100,0.5"],
            n=self.n,
            plant=plant,
            seeds=seeds,
            duration_s=self.duration_s,
        )


TARGET = ["target_radius_m=0.1", "range_m=1.2", "theta_a=0", *BODIES]
SWARMS = (
    Swarm("milling", "milling", n=6),
    Swarm("diffusing", "diffusing", n=8),
    Swarm("odd robot, -3 times", "milling:5,odd:1", turn=-3.0),
    Swarm("odd robot, +3 times", "milling:5,odd:1", turn=3.0),
)
# Of a bull's-eye, as the reference counts it: circliness, rotation, the odd robot's way out.
RING, TURNS, INSIDE = 0.5, 0.9, 0.8
PLANTS = {"planar": FLOOR, "mujoco": BEFORE}


def requests(seeds: int) -> list[Request]:
    """Runs to make for all swarms in both plants, in the order of the rows."""
    return [swarm.request(plant, seeds) for swarm in SWARMS for plant in PLANTS]


def last_figure(seeds: int, folder: Path) -> Claim:
    """Claim of the last figure, judged from the runs that are in the folder."""
    rows: list[Row] = []
    for swarm in SWARMS:
        for plant in PLANTS:
            request = swarm.request(plant, seeds)
            runs = Runs(request, read_sweep(place(folder, request))[1])
            rows.append(share(f"{swarm.name}, {plant}", _ended(swarm, runs), None))
            if swarm.turn:
                what = f"{swarm.name}, {plant}: its distance over the ring's radius"
                rows.append(median(what, runs["odd_ratio"][0], None, margin=0))
    told = "; ".join(f"{r.what} {_percent(r)}" for r in rows if r.unit == "%")
    return Claim(
        "last_figure",
        "The swarms of the last figure in both plants",
        "Six robots mill, eight diffuse, and with one odd robot of six a bull's-eye comes.",
        None,
        f"Runs that end so, of {seeds}: {told}. A bull's-eye is a ring that turns, circliness "
        "below 0.5, with the odd robot within 0.8 of its radius.",
        rows,
        [_figure()],
    )


def _ended(swarm: Swarm, runs: Runs) -> np.ndarray:
    """(seeds,) whether a run did what the figure shows."""
    if swarm.turn:
        ring = (runs["circliness"] < RING) & (np.abs(runs["rotation"]) > TURNS)
        return (ring & (runs["odd_ratio"] < INSIDE))[0]
    if swarm.behavior == "diffusing":
        return runs["least_diffusion"][0] > 1
    return runs["class"][0] == "milling"


def _figure() -> Figure:
    """Start and end of the first run of each swarm in both plants."""

    def paint(panels: np.ndarray) -> None:
        for column, swarm in enumerate(SWARMS):
            for axes, (plant, color) in zip(panels[:, column], PLANTS.items(), strict=True):
                runs = Runs(swarm.request(plant, 1), pa.table({}))
                trace = runs.trace(swarm.duration_s)
                paint_paths(axes, trace[-80:], color, odd=bool(swarm.turn))
                axes.plot(*trace[0, :, :2].T, "s", ms=3, mfc="none", mec="#999999")
                axes.set(**around(trace[[0, *range(-80, 0)], :, :2]))
                axes.set_title(f"{swarm.name}\n{plant}", fontsize=7)

    return Figure(
        draw(3.6, paint, nrows=len(PLANTS), ncols=len(SWARMS), squeeze=False),
        "One run of each, from start to end",
        "Squares: where the robots start, the same in both plants; lines: the last 8 of 120 s (180 "
        "with an odd robot, hollow); dots: the end. Six robots, eight that diffuse; whole bodies "
        "seen. The bar is 1 m.",
    )


def _percent(row: Row) -> str:
    return f"{100 * row.value:.0f} % ({100 * row.low:.0f} to {100 * row.high:.0f})"
