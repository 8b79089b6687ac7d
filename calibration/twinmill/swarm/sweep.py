# SPDX-License-Identifier: Apache-2.0
"""Many swarms over a grid of parameters: asked for, run, joined and summed up."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import twinmill_native as native

from twinmill.arguments import option
from twinmill.files import alone_in, check_new_folder, made_folder
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names, words_of
from twinmill.swarm.axes import parse_axis
from twinmill.swarm.behaviors import parse_table
from twinmill.swarm.classes import KEPT_OUT, reached
from twinmill.swarm.request import PLANTS, Request
from twinmill.swarm.store import Store, read_sweep
from twinmill.swarm.workers import run_here, run_on_dask
from twinmill.terminal import progress_bar
from twinmill.version import __version__

MOST_WORLDS = 10_000_000  # a row of each is in memory at the end
MOST_SEEDS = 2**63 - 1  # of 64 bits with a sign


def make_request(
    behavior: str,
    model: str,
    axes: list[str],
    tables: list[str] | None = None,
    *,
    world: Path | None = None,
    **rest: Any,
) -> Request:
    """Checks everything before the long work.

    Args:
        behavior: name, or a mix as name:count,name:count.
        model: file, here or among the installed ones.
        axes: as name=from:to:count or name=value,value.
        tables: own behaviours, as name=speed,turn,speed,turn.
        world: file of bodies that robots see and run into.
        rest: as fields of Request.

    Raises:
        ValueError: in one sentence.
    """
    model_file = ModelFile.load(model)
    parsed = [parse_axis(text, model_file.model) for text in axes]
    names = [axis.name for axis in parsed]
    if len(set(names)) < len(names):
        raise ValueError(f"the axes {', '.join(names)}: each must be another quantity.")
    own = [parse_table(text) for text in tables or []]
    if twice := next((n for n, c in Counter(name for name, _ in own).items() if c > 1), None):
        raise ValueError(
            f"{option('table', twice)}: is given twice; give each behaviour one table."
        )
    request = Request(
        behavior=behavior,
        model_name=model_file.path.name,
        model_text=model_file.text,
        version=__version__,
        axes=parsed,
        tables=own,
        **_world(world),
        **rest,
    )
    if request.plant not in PLANTS:
        raise ValueError(f"{option('plant', request.plant)}: must be {' or '.join(PLANTS)}.")
    _check_size(request)
    unnamed = _unnamed(request.model)
    _check_radius(request)
    for point in request.points:
        request.cell(point)
        inert = unnamed | dict(request.cell_model(point).inert(request.plant))
        for name in set(names) & set(inert):
            raise ValueError(f"the axis {name}: changes nothing here: {inert[name]}.")
    return request


def _check_radius(request: Request) -> None:
    """Refuses points where hulls are what touches evaders."""
    if request.plant != "mujoco" or not request.has_goals:
        return
    for point in request.points:
        if request.cell_model(point).get("robot.body_radius_m") == 0:
            raise ValueError(
                "robot.body_radius_m = 0: robots have hulls in MuJoCo, and whether one touches an "
                "evader is judged by this radius; give it, as in "
                f"{option('z', 'robot.body_radius_m=0.1')}."
            )


def _world(path: Path | None) -> dict[str, Any]:
    """Name and text of the world's file, as fields of the request."""
    if path is None:
        return {}
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read as a world ({error}).") from error
    if not text.strip():
        raise ValueError(f"{path}: is empty; list each body of the world in it as [[body]].")
    return {"world_name": path.name, "world_text": text}


def _unnamed(model: native.Model) -> dict[str, str]:
    """Numbers of equations that their texts do not name, and why they are inert."""
    return {
        row["name"]: "its formula does not name it"
        for name, texts in zip(effect_names(model), model.texts, strict=True)
        for row in model.values()
        if texts
        and row["name"].rpartition(".")[0] == name
        and row["name"].rpartition(".")[2] not in words_of(texts)
    }


def _check_size(request: Request) -> None:
    if request.world_count > MOST_WORLDS:
        raise ValueError(
            f"{request.world_count // request.seeds} cells of {request.seeds} seeds are "
            f"{request.world_count} worlds, and a sweep holds at most {MOST_WORLDS}; take fewer "
            f"values or {option('seeds')}."
        )
    if request.first_seed + request.world_count > MOST_SEEDS:
        raise ValueError(
            f"{option('first_seed', request.first_seed)}: seeds end at {MOST_SEEDS}; take a "
            "smaller one."
        )


def sweep(
    request: Request, folder: Path, workers: int | None = None, dask: str | None = None
) -> dict[str, Any]:
    """Runs what is missing of a sweep and joins it.

    Returns:
        What the JSON says.
    """
    check_new_folder(folder)
    begin_s = time.monotonic()
    with progress_bar() as progress:
        task = progress.add_task("worlds", total=request.world_count)
        done = run_missing(request, folder, lambda n: progress.advance(task, n), workers, dask=dask)
    return {
        **_summary(request, folder, begin_s),
        "parts": len(request.parts()),
        "parts_kept_before": done,
    }


def run_missing(
    request: Request,
    folder: Path,
    tell: Callable[[int], None],
    workers: int | None = None,
    *,
    dask: str | None = None,
) -> int:
    """Runs the missing cells silently; returns how many.

    Args:
        request: the sweep.
        folder: of it.
        tell: is given how many worlds are done, those that were kept before first.
        workers: threads; None: all cores.
        dask: address of a cluster.

    Returns:
        How many parts were kept before.
    """
    store = Store(folder)
    with made_folder(folder), alone_in(folder):
        store.open(request)
        parts = request.parts()
        todo = {} if store.result.exists() else {k: parts[k] for k in store.missing(len(parts))}
        tell(request.world_count - sum(map(len, todo.values())))
        run = run_on_dask(request, todo, dask) if dask else run_here(request, todo, workers)
        try:
            for number, columns in run:
                store.keep(number, columns)
                tell(len(parts[number]))
        except Exception:  # its worlds cannot be run, or nothing can be written
            store.leave_empty()
            raise
        if not store.result.exists():
            store.finish(request, len(parts))
    return len(parts) - len(todo)


def _summary(request: Request, folder: Path, begin_s: float) -> dict[str, Any]:
    _, table = read_sweep(folder)
    wall_s = time.monotonic() - begin_s
    kernels = Counter(table["kernel"].to_pylist())
    planar = request.plant == "planar"
    reasons = {request.cell(point).why_not_batched for point in request.points if planar} - {""}
    return {
        "out": str(folder),
        "file": str(Store(folder).result),
        "sha256": request.sha256,
        "version": f"twinmill {request.version}",
        "axes": {axis.name: list(axis.values) for axis in request.axes},
        "cells": len(request.points),
        "worlds": table.num_rows,
        "classes": dict(sorted(Counter(table["class"].to_pylist()).items())),
        "kernels": dict(sorted(kernels.items())),
        "why_full": "asked for" if request.full else "; ".join(sorted(reasons)),
        "plant": request.plant,
        **({"kept_out": int(reached(table, KEPT_OUT).sum())} if request.has_goals else {}),
        "wall_s": wall_s,
    }
