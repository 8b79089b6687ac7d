# SPDX-License-Identifier: Apache-2.0
"""Inputs that fix a sweep's result to the byte, and the cells that follow from them."""

import hashlib
import itertools
import json
import math
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.swarm.axes import QUANTITIES, Axis, set_speeds
from twinmill.swarm.model_text import with_values

MAX_ROBOTS = 1000
LEAST_SPREAD_M = 0.01  # as of twin_run
# Agent-steps in one part: about a second's work. The batched kernel is a hundred times faster, and
# in MuJoCo a world of two minutes is a part.
PART_BATCHED, PART_FULL, PART_MUJOCO = 50_000_000, 1_000_000, 5_000
PLANTS = ("planar", "mujoco")
OF_WORLD = ("world_name", "world_text")


@dataclass(frozen=True)
class Request:
    """All that a sweep's bytes depend on.

    Attributes:
        tables: own behaviours beside the firmware's: name, inputs (unseen speed, unseen turn,
            seen speed, seen turn, or so for each number of k bits; turns in thousandths).
        n: robots; None: what the behaviour says, or 6.
        first_seed, seeds: the first cell has so many seeds from the first on, the next cell the
            next ones: what is unlucky in one cell is not so in the others.
        full: every robot its firmware and plant, also where the batched kernel would serve.
        same_seeds: every cell has the seeds of the first, so that cells differ by their values
            alone: for differences between cells.
        plant: "planar" or "mujoco"; the latter runs every robot its firmware.
        world_name, world_text: file of the bodies that robots see and run into; empty: none.
    """

    behavior: str
    model_name: str
    model_text: str
    version: str
    axes: list[Axis]
    n: int | None = None
    seeds: int = 50
    first_seed: int = 1
    duration_s: float = 120.0
    start: str = "square"
    spread_m: float = 1.2
    target_radius_m: float | None = None
    tables: list[tuple[str, list[int]]] = field(default_factory=list)
    full: bool = False
    same_seeds: bool = False
    plant: str = "planar"
    world_name: str = ""
    world_text: str = ""

    def to_data(self) -> dict[str, Any]:
        """Plain values; of a world, only if there is one."""
        data = asdict(self)
        return data if self.world_text else {k: v for k, v in data.items() if k not in OF_WORLD}

    def to_json(self) -> str:
        """One line, the same for the same request; in MuJoCo with the physics that runs here."""
        data = self.to_data()
        if self.plant == "mujoco":
            data["physics"] = native.MUJOCO_PHYSICS
        return json.dumps(data, sort_keys=True, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> "Request":
        """The inverse of to_json, but for the physics: a request runs in those of the machine."""
        data = json.loads(text)
        data.pop("physics", None)
        data["axes"] = [Axis(axis["name"], tuple(axis["values"])) for axis in data["axes"]]
        data["tables"] = [(name, row) for name, row in data["tables"]]
        return cls(**data)

    @property
    def sha256(self) -> str:
        """Hash of everything in it, the model's text included."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    @property
    def model(self) -> native.Model:
        """The model of `model_text`, a new object each time."""
        return _read(self.model_text, self.model_name).copy()

    @property
    def points(self) -> list[tuple[float, ...]]:
        """Axis values of each cell, the first axis fastest."""
        grids = [axis.values for axis in reversed(self.axes)]
        return [tuple(reversed(point)) for point in itertools.product(*grids)]

    @property
    def world_count(self) -> int:
        """Number of simulations: cells times seeds."""
        return math.prod(len(axis.values) for axis in self.axes) * self.seeds

    def seed_of(self, worlds: np.ndarray) -> np.ndarray:
        """Seeds of worlds, which are numbered seed by seed within cell by cell."""
        return self.first_seed + (worlds % self.seeds if self.same_seeds else worlds)

    def species(self, n: int | None) -> tuple[list[list[int]], int]:
        """Tables of all robots, the ring's first, and how many of these there are.

        The ring is of the most frequent species, of equally many the first. Where a mix is given
        and `n` differs from its sum, the first species takes up the rest.
        """
        robots, ring = self._robots(n)
        return [row for _, row, _ in robots], ring

    def _robots(self, n: int | None) -> tuple[list[tuple[str, list[int], str]], int]:
        """Name, table and colour of each, in the order of species(), and how many are the ring."""
        named = native.species(self.behavior, None, self.tables)
        colours = native.colours(self.behavior)
        robots = [(name, row, colour) for (name, row), colour in zip(named, colours, strict=True)]
        first = [robot for robot in robots if robot[0] == robots[0][0]]
        others = [robot for robot in robots if robot[0] != robots[0][0]]
        wanted = len(robots) if n is None else n
        if not 1 <= wanted <= MAX_ROBOTS or wanted <= len(others):
            raise ValueError(
                f"{wanted} robots: from {len(others) + 1} to {MAX_ROBOTS} can run "
                f"'{self.behavior}'."
            )
        count = wanted - len(others)
        robots = (first + first[-1:] * count)[:count] + others
        order = Counter(name for name, _, _ in robots).most_common()  # of equally many the first
        names = [name for name, _ in order]
        return sorted(robots, key=lambda robot: names.index(robot[0])), order[0][1]

    def cell(self, point: tuple[float, ...]) -> native.Cell:
        """The swarm at these axis values.

        Raises:
            ValueError: a value is out of bounds.
        """
        at = self._at(point)
        robots, ring = self._robots(int(at["n"]) if "n" in at else self.n)
        spread_m = at.get("spread_m", self.spread_m)
        if spread_m < LEAST_SPREAD_M:
            raise ValueError(f"spread_m = {spread_m:g} m: must be {LEAST_SPREAD_M} m or more.")
        return native.Cell(
            self.cell_model(point),
            [row for _, row, _ in robots],
            ring,
            self.start,
            spread_m,
            colours=[colour for _, _, colour in robots],
            world=self.bodies,
        )

    @property
    def bodies(self) -> native.Bodies | None:
        """Bodies of the world's file; None: there is no world.

        Raises:
            ValueError: the file says what no world has.
        """
        return native.Bodies(self.world_text, self.world_name) if self.world_text else None

    @property
    def has_goals(self) -> bool:
        """True if the world has something that evaders can be kept out of."""
        return bool(self.bodies and self.bodies.goals)

    @property
    def outcomes(self) -> list[str]:
        """Names of what is measured of each world, in the order of `run_worlds`."""
        return [*native.OUTCOMES, *(native.DEFENCE if self.world_text else [])]

    def cell_model(self, point: tuple[float, ...]) -> native.Model:
        """The model at these axis values.

        Raises:
            ValueError: a value is out of bounds.
        """
        model, at = self.model, self._at(point)
        if self.target_radius_m is not None:
            model.set("sensor.target_radius_m", self.target_radius_m)
        tables, _ = self.species(int(at["n"]) if "n" in at else self.n)
        omega_degps = at.get("omega_degps")
        omega = None if omega_degps is None else math.radians(omega_degps)
        set_speeds(model, tables[0], at.get("v_mps"), omega)
        for name, value in at.items():
            if name not in QUANTITIES:
                model.set(name, value)
            elif setter := QUANTITIES[name].set:
                setter(model, value)
        return model

    def _at(self, point: tuple[float, ...]) -> dict[str, float]:
        return dict(zip((a.name for a in self.axes), point, strict=True))

    def robots(self, point: tuple[float, ...]) -> int:
        """How many there are in a cell."""
        at = self._at(point)
        return len(self.species(int(at["n"]) if "n" in at else self.n)[0])

    def steps(self, model: native.Model) -> float:
        """Control periods of one world."""
        return self.duration_s / model.get("base.control_period_s")

    def kernel(self, cell: native.Cell) -> str:
        """Engine that runs a cell: batched, full or mujoco."""
        if self.plant == "mujoco":
            return "mujoco"
        return "full" if self.full or cell.why_not_batched else "batched"

    def parts(self) -> list[range]:
        """Worlds in pieces that depend on the request alone."""
        kernels = {self.kernel(self.cell(point)) for point in (self.points[0], self.points[-1])}
        work = {"batched": PART_BATCHED, "full": PART_FULL, "mujoco": PART_MUJOCO}
        robots = max(self.robots(point) for point in (self.points[0], self.points[-1]))
        agent_steps = robots * self.steps(self.model)
        size = max(1, int(min(work[kernel] for kernel in kernels) / agent_steps))
        return [
            range(first, min(first + size, self.world_count))
            for first in range(0, self.world_count, size)
        ]


@lru_cache(maxsize=4)
def _read(text: str, name: str) -> native.Model:
    """A model, to be copied: that takes a hundredth of the time, which counts in each cell."""
    return native.Model.from_toml(text, name)


def run_part(request: Request, worlds: range) -> dict[str, list[Any]]:
    """Simulates some worlds, numbered seed by seed within cell by cell.

    Returns:
        The columns of the sweep's table.
    """
    numbers = np.array(worlds, dtype=np.int64)
    cell_of, seeds = numbers // request.seeds, request.seed_of(numbers)
    points = request.points
    used = list(range(cell_of[0], cell_of[-1] + 1))
    cells = [request.cell(points[c]) for c in used]
    rows = native.run_worlds(
        cells,
        cell_of - used[0],
        seeds.astype(np.uint64),
        request.duration_s,
        request.full,
        request.plant,
    )
    columns: dict[str, list[Any]] = {"cell": cell_of.tolist(), "seed": seeds.tolist()}
    for a, axis in enumerate(request.axes):
        kind = int if axis.whole else float
        columns[axis.name] = [kind(points[c][a]) for c in cell_of]
    columns["n"] = [request.robots(points[c]) for c in cell_of]
    for k, name in enumerate(request.outcomes):
        columns[name] = rows[:, k].tolist()
    columns["class"] = native.classify(rows)
    kernels = [request.kernel(cell) for cell in cells]
    columns["kernel"] = [kernels[c - used[0]] for c in cell_of]
    return columns


def without_axes(request: Request) -> Request:
    """Request with each single value of an axis written into the model.

    Raises:
        ValueError: an axis has several values, or is no quantity of the model file.
    """
    model = request.model
    before = {row["name"]: row["value"] for row in model.values()}
    for axis in request.axes:
        quantity = QUANTITIES.get(axis.name)
        if len(axis.values) > 1 or (quantity and not quantity.set):
            raise ValueError(
                f"{option('set', axis.name)}: takes one value of a quantity of the model, as in "
                "sensor.range_m=0.8."
            )
        _apply(model, axis.name, axis.values[0])
    after = {row["name"]: row["value"] for row in model.values()}
    changed = {name: value for name, value in after.items() if value != before[name]}
    text = with_values(request.model_text, request.model, changed)
    native.Model.from_toml(text, request.model_name)
    return replace(request, model_text=text, axes=[])


def _apply(model: native.Model, name: str, value: float) -> None:
    quantity = QUANTITIES.get(name)
    if quantity and quantity.set:
        quantity.set(model, value)
    else:
        model.set(name, value)
