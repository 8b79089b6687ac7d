# SPDX-License-Identifier: Apache-2.0
"""Quality-diversity search: the most repeatable swarm of each sort, by CMA-ME and MAP-Elites.

Fontaine et al. 2020 (arXiv 1912.02400) and Mouret and Clune 2015 (arXiv 1504.04909), by pyribs.
"""

import hashlib
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import twinmill_native as native
from ribs.archives import GridArchive
from ribs.emitters import EmitterBase, EvolutionStrategyEmitter, GaussianEmitter
from ribs.schedulers import Scheduler

from twinmill.arguments import option
from twinmill.defaults import BATCH, PER_GENERATION
from twinmill.files import alone_in, made_folder, replacing
from twinmill.model.model_file import write_whole
from twinmill.programs import available_cores
from twinmill.swarm.discover.genes import Mix, decode, gene_count
from twinmill.swarm.discover.kinds import MEASURES, measures
from twinmill.swarm.request import Request

STEP = 0.2  # first standard deviation of genes


@dataclass(frozen=True)
class Hunt:
    """All that the archive depends on but the number of generations.

    Attributes:
        request: model, start, seeds and duration of each candidate's runs; without axes.
        seed: of the search.
    """

    request: Request
    n: int
    seed: int

    @property
    def sha256(self) -> str:
        """Hash of the whole question: a stored search goes on only with an equal one."""
        return hashlib.sha256(json.dumps(self.to_data(), sort_keys=True).encode()).hexdigest()

    def to_data(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self) | {"request": self.request.to_data()}

    @property
    def columns(self) -> list[str]:
        """Names of what is measured of each run."""
        return self.request.outcomes

    @property
    def bits(self) -> int:
        """That the model sees: tables of 2^bits rows are searched."""
        return len(self.request.model.bits)

    def cell(self, mix: Mix) -> native.Cell:
        """The swarm of a mix."""
        tables = mix.tables("mix")
        named = replace(self.request, behavior=mix.behavior("mix"), n=self.n, tables=tables)
        return named.cell(())

    def run(self, mixes: list[Mix], seeds: range, plant: str = "planar") -> np.ndarray:
        """(mixes, seeds, columns) metrics of the last 10 s."""
        count = available_cores()
        chunks = [mixes[k::count] for k in range(min(count, len(mixes)))]
        rows = np.empty((len(mixes), len(seeds), len(self.columns)))
        with ThreadPoolExecutor(count) as pool:
            for k, part in enumerate(
                pool.map(lambda chunk: self._run(chunk, seeds, plant), chunks)
            ):
                rows[k::count] = part
        return rows

    def _run(self, mixes: list[Mix], seeds: range, plant: str) -> np.ndarray:
        cells = [self.cell(mix) for mix in mixes]
        flat = native.run_worlds(
            cells,
            np.repeat(np.arange(len(cells)), len(seeds)),
            np.tile(np.array(seeds, dtype=np.uint64), len(cells)),
            self.request.duration_s,
            self.request.full,
            plant,
        )
        return flat.reshape(len(mixes), len(seeds), len(self.columns))


@dataclass(frozen=True)
class Elites:
    """The archive, best first within each cell's place. (E, ...) arrays."""

    genes: np.ndarray
    alike: np.ndarray
    measures: np.ndarray
    rows: np.ndarray
    cells: int


def _scheduler(seed: int, genes: int) -> tuple[Scheduler, GridArchive]:
    bounds = list(MEASURES.values())
    archive = GridArchive(
        solution_dim=genes,
        dims=[cells for _, _, cells in bounds],
        ranges=[(low, high) for low, high, _ in bounds],
        extra_fields={"place": ((), np.int64)},
        seed=seed,
    )
    bounded, middle = [(0.0, 1.0)] * genes, np.full(genes, 0.5)
    emitters: list[EmitterBase] = [
        EvolutionStrategyEmitter(
            archive, sigma0=STEP, seed=seed + k, bounds=bounded, batch_size=BATCH, x0=middle
        )
        for k in (1, 2)
    ]
    emitters.append(
        GaussianEmitter(
            archive, sigma=STEP, seed=seed + 3, bounds=bounded, batch_size=BATCH, x0=middle
        )
    )
    return Scheduler(archive, emitters), archive


class GenerationStore:
    """Results of each generation, one file each: a search that goes on reads them again."""

    def __init__(self, folder: Path, hunt: Hunt) -> None:
        """Makes the folder, or opens one of the same hunt.

        Raises:
            ValueError: it holds something else.
        """
        self._parts, manifest = folder / "generations", folder / "manifest.json"
        if manifest.exists():
            if json.loads(manifest.read_text())["sha256"] != hunt.sha256:
                raise ValueError(
                    f"{folder}: holds a search with other parameters, another model or version; "
                    f"choose another {option('out')}, or remove it."
                )
        elif folder.exists() and any(folder.iterdir()):
            raise ValueError(
                f"{folder}: is not empty and holds no search; choose another {option('out')}."
            )
        self._columns = hunt.columns
        about = {"sha256": hunt.sha256, "hunt": hunt.to_data()}
        text = json.dumps(about, indent=1, sort_keys=True)
        write_whole(manifest, text)
        self._parts.mkdir(exist_ok=True)

    def rows(self, generation: int, genes: np.ndarray, run: Callable[[], np.ndarray]) -> np.ndarray:
        """Stored results of these candidates; missing ones are run now, then kept."""
        path = self._parts / f"{generation:06d}.parquet"
        digest = hashlib.sha256(genes.tobytes()).hexdigest().encode()
        if path.exists():
            table = pq.read_table(path)
            if table.schema.metadata.get(b"genes") == digest:
                return np.stack(
                    [table[name].to_numpy() for name in self._columns], axis=-1
                ).reshape(len(genes), -1, len(self._columns))
        rows = run()
        columns = {name: rows[..., k].ravel() for k, name in enumerate(self._columns)}
        with replacing(path, force=True) as fresh:
            pq.write_table(pa.table(columns).replace_schema_metadata({"genes": digest}), fresh)
        return rows


def search(hunt: Hunt, folder: Path, generations: int, tell: Callable[[int, int], None]) -> Elites:
    """Searches, or goes on where it was stopped.

    Args:
        hunt: what is searched.
        folder: of the generations that are kept.
        generations: in all, those that are kept included.
        tell: is given candidates tried and cells found after each.

    Raises:
        ValueError: the folder holds something else, or another search is at work in it.
    """
    with made_folder(folder), alone_in(folder):
        return _searched(hunt, GenerationStore(folder, hunt), generations, tell)


def _searched(
    hunt: Hunt, store: GenerationStore, generations: int, tell: Callable[[int, int], None]
) -> Elites:
    scheduler, archive = _scheduler(hunt.seed, gene_count(hunt.bits))
    kept: list[np.ndarray] = []
    seeds = range(hunt.request.first_seed, hunt.request.first_seed + hunt.request.seeds)
    for generation in range(generations):
        genes = scheduler.ask()
        mixes = [decode(one, hunt.n, hunt.bits) for one in genes]
        rows = store.rows(generation, genes, partial(hunt.run, mixes, seeds))
        found, alike = measures(rows)
        scheduler.tell(alike, found, place=len(kept) * PER_GENERATION + np.arange(len(genes)))
        kept.append(rows)
        tell((generation + 1) * PER_GENERATION, len(archive))
    data = archive.data()
    order = np.lexsort((data["index"], -data["objective"]))
    return Elites(
        data["solution"][order],
        data["objective"][order],
        data["measures"][order],
        np.concatenate(kept)[data["place"][order]],
        int(archive.cells),
    )
