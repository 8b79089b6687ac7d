# SPDX-License-Identifier: Apache-2.0
"""Elites as named behaviours, and the files that hold them."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import twinmill_native as native

from twinmill.files import replacing
from twinmill.model.model_file import write_whole
from twinmill.swarm.behaviors import NAME
from twinmill.swarm.discover.genes import Mix, decode, table_text
from twinmill.swarm.discover.kinds import KIND_COLORS, MEASURES, kinds
from twinmill.swarm.discover.search import Elites, Hunt
from twinmill.swarm.forecast.draws import drawn_models, knows_errors

MODEL, WORLD = "model.toml", "world.toml"
DRAWS = 10  # models drawn from the uncertainty
MUJOCO_ROUNDS = 2
MUJOCO_SEEDS_FROM = 1_000_000  # beyond those of all other runs
SLUGS = {"bull's-eye": "bullseye"}


@dataclass
class Entry:
    """One elite.

    Attributes:
        name: of its table; the odd robots' has `_odd` after it. Empty: it is not offered.
        kind: what most of the runs that chose it are called.
        alike: 1 is the same whatever the seed.
        measures: in the order of MEASURES.
        share: of fresh runs that are of its kind.
        drawn: the same of runs with models drawn from the uncertainty; None: the model knows none.
        confirmed: fresh runs behind each share; 0: it was not run again.
        mujoco: share in MuJoCo; None: it was not run there.
        kept_out: share of fresh runs in which no evader came into a goal untouched; None: there is
            no goal, or it was not run again.
        world: file with the bodies around it; empty: none.
    """

    name: str
    kind: str
    mix: Mix
    alike: float
    measures: list[float]
    share: float
    drawn: float | None = None
    confirmed: int = 0
    mujoco: float | None = None
    kept_out: float | None = None
    world: str = ""

    @property
    def holds(self) -> bool:
        """True if most runs are of its kind: again, in twins drawn, and in MuJoCo if it ran."""
        return self.least > 0.5

    @property
    def least(self) -> float:
        """Smallest share of runs of its kind: again, in twins drawn, in MuJoCo if it ran."""
        shares = (self.share, self.drawn, self.mujoco)
        return min(share for share in shares if share is not None)

    @property
    def command(self) -> str:
        """The command line of `twin_run` that plays the behaviour."""
        behavior = self.mix.behavior(self.name)
        world = f" --world {self.world}" if self.world else ""
        return (
            f"twin_run --plant planar --model {MODEL}{world} --n {self.mix.n} --behavior {behavior}"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "name": self.name,
            "kind": self.kind,
            "n": self.mix.n,
            "odd_count": self.mix.odd_count,
            "table": table_text(self.mix.ring),
            "odd_table": table_text(self.mix.odd) if self.mix.odd_count else "",
            "alike": self.alike,
            "share": self.share,
            "share_drawn": self.drawn,
            "share_mujoco": self.mujoco,
            **({} if self.kept_out is None else {"kept_out": self.kept_out}),
            "confirmed_runs": self.confirmed,
            "offered": bool(self.name),
            **dict(zip(MEASURES, self.measures, strict=True)),
        }


def _start_scatter_m2(hunt: Hunt) -> float:
    still = Mix([0] * 4, [0] * 4, hunt.n, 0)
    return float(np.mean(hunt.run([still], range(1, 33))[0, :, native.METRICS.index("scatter_m2")]))


def entries(hunt: Hunt, elites: Elites) -> tuple[list[Entry], float]:
    """All elites, without names; and the start's mean scatter."""
    start_m2, range_m = _start_scatter_m2(hunt), hunt.request.model.get("sensor.range_m")
    world = WORLD if hunt.request.world_text else ""
    found = []
    for genes, alike, at, rows in zip(
        elites.genes, elites.alike, elites.measures, elites.rows, strict=True
    ):
        kind, count = Counter(kinds(rows, start_m2, range_m)).most_common(1)[0]
        share = count / len(rows)
        mix = decode(genes, hunt.n, hunt.bits)
        found.append(Entry("", kind, mix, float(alike), at.tolist(), share, world=world))
    return found, start_m2


def confirm(
    hunt: Hunt,
    found: list[Entry],
    start_m2: float,
    runs: int,
    *,
    tell: Callable[[int, int], None] = lambda done, planned: None,
) -> None:
    """Runs entries again with seeds that the search has not seen, and in twins drawn.

    The search keeps the luckiest of many, so that its own runs flatter what it finds: what counts
    is runs that had no part in it.

    Args:
        hunt: what was searched.
        found: entries, whose shares are set.
        start_m2: mean scatter of the start.
        runs: of each, with fresh seeds, and again with models drawn, if the model knows its errors.
        tell: is given how many of all passes are done.
    """
    first = hunt.request.first_seed + hunt.request.seeds
    mixes = [entry.mix for entry in found]
    draws = min(DRAWS, runs) if knows_errors(hunt.request) else 0
    rows = hunt.run(mixes, range(first, first + runs))
    tell(1, 1 + draws)
    for entry, share in zip(found, _shares(hunt, found, rows, start_m2), strict=True):
        entry.share, entry.confirmed = float(share), runs
    if hunt.request.has_goals:
        free = np.isnan(rows[:, :, hunt.columns.index("reached_s")]).mean(axis=1)
        for entry, share in zip(found, free, strict=True):
            entry.kept_out = float(share)
    parts = []
    for k, text in enumerate(drawn_models(hunt.request, draws, hunt.seed) if draws else []):
        twin = replace(hunt, request=replace(hunt.request, model_text=text))
        seeds = range(first + runs * (k + 1), first + runs * (k + 1) + -(-runs // draws))
        parts.append(_shares(hunt, found, twin.run(mixes, seeds), start_m2))
        tell(2 + k, 1 + draws)
    for entry, share in zip(found, np.mean(parts, axis=0) if parts else [], strict=bool(parts)):
        entry.drawn = float(share)


def confirm_in_mujoco(
    hunt: Hunt,
    found: list[Entry],
    start_m2: float,
    runs: int,
    *,
    enough: int,
    tell: Callable[[int], None] = lambda tried: None,
) -> None:
    """Runs the surest of each kind in MuJoCo, until enough of them hold there.

    What a planar twin lets bodies do, as standing in one another, is an artefact and falls away.

    Args:
        hunt: what was searched.
        found: entries that were confirmed; of those that ran, `mujoco` is set.
        start_m2: mean scatter of the start.
        runs: of each, with seeds that it has not had.
        enough: of each kind; twice as many are tried at most.
        tell: is given how many were tried.
    """
    first = hunt.request.first_seed + MUJOCO_SEEDS_FROM
    waiting = {kind: [e for e in _surest(found) if e.kind == kind] for kind in KIND_COLORS}
    tried = 0
    for _ in range(MUJOCO_ROUNDS):
        batch = []
        for entries_of in waiting.values():
            lacking = enough - sum(e.holds for e in entries_of if e.mujoco is not None)
            batch += [e for e in entries_of if e.mujoco is None][:lacking]
        if not batch:
            return
        rows = hunt.run([e.mix for e in batch], range(first, first + runs), "mujoco")
        for entry, share in zip(batch, _shares(hunt, batch, rows, start_m2), strict=True):
            entry.mujoco = float(share)
        tried += len(batch)
        tell(tried)


def _surest(found: list[Entry]) -> list[Entry]:
    """Those that hold, the surest first."""
    return sorted((e for e in found if e.holds), key=lambda e: -e.least)


def _shares(hunt: Hunt, found: list[Entry], rows: np.ndarray, start_m2: float) -> np.ndarray:
    """(E,) of each entry's runs that are of its kind."""
    range_m = hunt.request.model.get("sensor.range_m")
    ended = [kinds(part, start_m2, range_m) for part in rows]
    return np.array(
        [names.count(e.kind) / len(names) for e, names in zip(found, ended, strict=True)]
    )


def offer(found: list[Entry], in_mujoco: bool) -> list[Entry]:
    """Behaviours that came out again in repeated runs, each with a name: `milling_1`.

    Args:
        found: all entries of the archive; the `name` of those that are offered is set.
        in_mujoco: take only those that were repeated in MuJoCo, too.

    Returns:
        Those that are offered, by kind of behaviour and within a kind the most reliable first.
    """
    order = list(KIND_COLORS)
    ran = [entry for entry in found if not in_mujoco or entry.mujoco is not None]
    offered = sorted(_surest(ran), key=lambda e: order.index(e.kind))
    numbers: Counter[str] = Counter()
    for entry in offered:
        numbers[entry.kind] += 1
        entry.name = f"{SLUGS.get(entry.kind, entry.kind)}_{numbers[entry.kind]}"
    return offered


def write_entries(folder: Path, hunt: Hunt, found: list[Entry]) -> None:
    """archive.parquet with everything; behaviors.toml, model.toml and world.toml for twin_run."""
    write_whole(folder / MODEL, hunt.request.model_text)
    if hunt.request.world_text:
        write_whole(folder / WORLD, hunt.request.world_text)
    rows = [entry.to_json() for entry in found]
    with replacing(folder / "archive.parquet", force=True) as fresh:
        pq.write_table(pa.Table.from_pylist(rows), fresh, compression="zstd")
    lines = [
        "# Found by twinmill lab discover: speed and turn for nothing seen, then for seen, "
        "or so for each number of the model's bits."
    ]
    for entry in filter(lambda entry: entry.name, found):
        lines += [f'{name} = "{table_text(row)}"' for name, row in entry.mix.tables(entry.name)]
    write_whole(folder / NAME, "\n".join(lines) + "\n")
