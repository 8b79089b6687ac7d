# SPDX-License-Identifier: Apache-2.0
"""Probabilities of the classes in each cell of a sweep, by models drawn from the uncertainty."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

import numpy as np
import pyarrow as pa

from twinmill.model.model_file import ModelFile
from twinmill.model.ranges import quantities, ranges
from twinmill.programs import available_cores
from twinmill.swarm.classes import COLORS
from twinmill.swarm.model_text import with_values
from twinmill.swarm.request import Request
from twinmill.swarm.store import read_sweep
from twinmill.swarm.sweep import run_missing

OUTCOMES = tuple(name for name in COLORS if name != "undefined")
UNSEEN = 0.5  # runs of each class that are added, so that nothing is impossible (Jeffreys 1946)


@dataclass(frozen=True)
class Forecast:
    """Expected outcomes in C cells.

    Attributes:
        points: (C, axes) axis values.
        swept: (C, K) probabilities of OUTCOMES by the sweep's own runs, one model.
        draws: (D, C, K) by each model drawn; one, the sweep's, where it knows no errors.
    """

    points: np.ndarray
    swept: np.ndarray
    draws: np.ndarray

    @property
    def share(self) -> np.ndarray:
        """(C, K) probabilities that are predicted: the mean over the models."""
        return self.draws.mean(axis=0)

    @property
    def base_rate(self) -> np.ndarray:
        """(K,) of the classes over all cells: what one knows who does not know the cell."""
        return self.swept.mean(axis=0)

    def cells(self, chosen: list[int]) -> "Forecast":
        """The forecast of these cells alone, by their numbers."""
        return Forecast(self.points[chosen], self.swept[chosen], self.draws[:, chosen])


def knows_errors(request: Request) -> bool:
    """True if the sweep's model says how well its numbers are known."""
    file = file_of(request)
    return any(q.source != "robots" for q in quantities(file, file.model))


def forecast(
    request: Request,
    table: pa.Table,
    count: int,
    seeds: int,
    *,
    seed: int,
    folder: Path,
    tell: Callable[[int, int], None] = lambda done, planned: None,
) -> Forecast:
    """Runs the sweep's cells with models drawn from the uncertainty of its numbers.

    Args:
        request: of the sweep.
        table: its rows.
        count: models.
        seeds: runs of each in each cell; none that the sweep has had.
        seed: of the draw.
        folder: where the runs are kept.
        tell: is given how many worlds are done and how many are planned.

    Raises:
        ValueError: nearly all models drawn are out of bounds.
    """
    points = np.array(request.points)
    swept = _smoothed(_counts(table, len(points)))
    if not knows_errors(request) or count == 0:
        return Forecast(points, swept, swept[None])
    done, planned = 0, count * len(points) * seeds

    def advance(worlds: int) -> None:
        nonlocal done
        with lock:
            done += worlds
            tell(done, planned)

    def counts_of(number: int, text: str) -> np.ndarray:
        first = request.first_seed + request.world_count + number * len(points) * seeds
        asked = replace(request, model_text=text, seeds=seeds, first_seed=first)
        place = folder / asked.sha256[:16]
        run_missing(asked, place, advance, workers=1)
        return _counts(read_sweep(place)[1], len(points))

    # A model's runs are one part or a few: models, not parts, go side by side.
    lock, texts = Lock(), drawn_models(request, count, seed)
    with ThreadPoolExecutor(available_cores()) as pool:
        counts = list(pool.map(counts_of, range(count), texts))
    return Forecast(points, swept, _shrunk(np.array(counts)))


def file_of(request: Request) -> ModelFile:
    """The model file of a request."""
    return ModelFile(Path(request.model_name), request.model_text, request.model)


def out_of_bounds(request: Request, count: int, seed: int) -> tuple[int, list[str]]:
    """How many draws were out of bounds and drawn anew, and the quantities whose bounds did that.

    Raises:
        ValueError: as drawn_models.
    """
    file = file_of(request)
    known = ranges(file, file.model, count, seed)
    return known.tried - count, [q.name for q in known.truncated]


def drawn_models(request: Request, count: int, seed: int) -> list[str]:
    """Texts of model files like the request's, their numbers drawn from its uncertainty.

    Raises:
        ValueError: it says nothing of the errors of its numbers, or hardly any draw is in bounds.
    """
    file = file_of(request)
    known = ranges(file, file.model, count, seed)
    kept = [(i, q.name) for i, q in enumerate(known.quantities) if q.source != "robots"]
    return [
        with_values(file.text, file.model, {name: sample[i] for i, name in kept})
        for sample in known.samples
    ]


def _counts(table: pa.Table, cells: int) -> np.ndarray:
    """(C, K) runs of each class; those of no class are left out."""
    ended = np.array(table["class"].to_pylist()).reshape(cells, -1)
    return np.stack([(ended == name).sum(axis=1) for name in OUTCOMES], axis=1)


def _smoothed(counts: np.ndarray) -> np.ndarray:
    return (counts + UNSEEN) / (counts + UNSEEN).sum(axis=-1, keepdims=True)


def _shrunk(counts: np.ndarray) -> np.ndarray:
    """(D, C, K) probabilities of models of few runs each.

    Models differ from their mean by chance, too. That part of the scatter is known, and is taken
    out in each cell: the differences are shortened to what is left (James and Stein 1961).
    """
    runs = counts.sum(axis=2, keepdims=True)
    share = counts / np.maximum(runs, 1)
    mean = share.mean(axis=0)
    scatter = share.var(axis=0, ddof=1).sum(axis=1) if len(share) > 1 else np.zeros(len(mean))
    noise = share * (1 - share) / np.maximum(runs - 1, 1)
    chance = noise.mean(axis=0).sum(axis=1)
    kept = np.sqrt(np.clip(1 - chance / np.maximum(scatter, 1e-12), 0, 1))
    # The smoothing of all models' runs together: a class that none of them had stays possible.
    total = counts.sum(axis=0)
    smooth = _smoothed(total)
    within = mean + kept[None, :, None] * (share - mean)
    weight = (total.sum(axis=1) / (total + UNSEEN).sum(axis=1))[None, :, None]
    return weight * within + (smooth - weight[0] * mean)[None]
