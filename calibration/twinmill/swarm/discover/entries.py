# SPDX-License-Identifier: Apache-2.0
"""Elites as named behaviours, and the files that hold them."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import twinmill_native as native

from twinmill.model.model_file import write_whole
from twinmill.swarm.behaviors import NAME
from twinmill.swarm.discover.genes import Mix, decode, table_text
from twinmill.swarm.discover.kinds import KIND_COLORS, MEASURES, kinds
from twinmill.swarm.discover.search import Elites, Hunt

MODEL = "model.toml"
SLUGS = {"bull's-eye": "bullseye"}


@dataclass
class Entry:
    """One elite.

    Attributes:
        name: of its table; the odd robots' has `_odd` after it.
        kind: what most of its runs are called.
        alike: 1 is the same whatever the seed.
        measures: in the order of MEASURES.
        share: of the runs that are of its kind; of fresh seeds once it is confirmed.
        confirmed: fresh runs that stand behind the share; 0: those that chose it.
    """

    name: str
    kind: str
    mix: Mix
    alike: float
    measures: list[float]
    share: float
    confirmed: int = 0

    @property
    def command(self) -> str:
        """What runs it."""
        behavior = self.mix.behavior(self.name)
        return f"twin_run --plant planar --model {MODEL} --n {self.mix.n} --behavior {behavior}"

    def to_json(self) -> dict:
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
            "confirmed_runs": self.confirmed,
            **dict(zip(MEASURES, self.measures, strict=True)),
        }


def _start_scatter_m2(hunt: Hunt) -> float:
    still = Mix([0, 0, 0, 0], [0, 0, 0, 0], hunt.n, 0)
    return float(np.mean(hunt.run([still], range(1, 33))[0, :, native.METRICS.index("scatter_m2")]))


def entries(hunt: Hunt, elites: Elites) -> tuple[list[Entry], float]:
    """All elites, by kind and then the most repeatable first; and the start's mean scatter."""
    start_m2, range_m = _start_scatter_m2(hunt), hunt.request.model.get("sensor.range_m")
    found = []
    for genes, alike, at, rows in zip(
        elites.genes, elites.alike, elites.measures, elites.rows, strict=True
    ):
        kind, count = Counter(kinds(rows, start_m2, range_m)).most_common(1)[0]
        share = count / len(rows)
        found.append(Entry("", kind, decode(genes, hunt.n), float(alike), at.tolist(), share))
    order = list(KIND_COLORS)
    found.sort(key=lambda entry: (order.index(entry.kind), -entry.share, -entry.alike))
    numbers: Counter = Counter()
    for entry in found:
        numbers[entry.kind] += 1
        entry.name = f"{SLUGS.get(entry.kind, entry.kind)}_{numbers[entry.kind]}"
    return found, start_m2


def confirm(hunt: Hunt, chosen: list[Entry], start_m2: float, runs: int) -> None:
    """Runs entries with seeds that the search has not seen, which sets their shares right."""
    first = hunt.request.first_seed + hunt.request.seeds
    rows = hunt.run([entry.mix for entry in chosen], range(first, first + runs))
    range_m = hunt.request.model.get("sensor.range_m")
    for entry, part in zip(chosen, rows, strict=True):
        entry.share = kinds(part, start_m2, range_m).count(entry.kind) / runs
        entry.confirmed = runs


def write_entries(folder: Path, hunt: Hunt, found: list[Entry]) -> None:
    """archive.parquet with everything; behaviors.toml and model.toml for twin_run."""
    write_whole(folder / MODEL, hunt.request.model_text)
    rows = [entry.to_json() for entry in found]
    fresh = folder / "archive.tmp"
    pq.write_table(pa.Table.from_pylist(rows), fresh, compression="zstd")
    fresh.replace(folder / "archive.parquet")
    lines = ["# Found by twinmill discover: speed and turn for nothing seen, then for seen."]
    for entry in found:
        lines += [f'{name} = "{table_text(row)}"' for name, row in entry.mix.tables(entry.name)]
    write_whole(folder / NAME, "\n".join(lines) + "\n")
