# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab discover`: looks for behaviours that nobody thought of."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import PER_GENERATION
from twinmill_cli.lazy import working
from twinmill_cli.options import World, repeated
from twinmill_cli.output import AsJson, busy, deliver

if working():  # not for --help
    import hashlib

    from rich.console import Group

    from twinmill.extras import needing
    from twinmill.files import check_report
    from twinmill.report import Provenance, write_report
    from twinmill.terminal import progress_bar, whole

    with needing("discover"):
        from twinmill.report.discover import section
        from twinmill.swarm.discover.entries import (
            Entry,
            confirm,
            confirm_in_mujoco,
            entries,
            offer,
            write_entries,
        )
        from twinmill.swarm.discover.kinds import KIND_COLORS
        from twinmill.swarm.discover.search import Hunt, search
        from twinmill.swarm.request import without_axes
        from twinmill.swarm.sweep import make_request

NOTE = (
    "A search by quality and diversity: of each sort of swarm it keeps the one that does the same "
    "whatever the start. Names are given after the search, which knows none of them."
)


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("discover")(_discover)


def _discover(
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", show_default=False, help="Folder of the archive."),
    ],
    *,
    model: Annotated[str, typer.Option("--model", "-m", metavar="M")] = "paper.toml",
    change: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Value of a model parameter, named as an axis of twin_sweep.",
        ),
    ] = None,
    n: Annotated[int, typer.Option("--n", min=2, max=100, help="Robots.")] = 6,
    generations: Annotated[
        int, typer.Option("--generations", min=1, help=f"Of {PER_GENERATION} swarms each.")
    ] = 100,
    seeds: Annotated[
        int, typer.Option("--seeds", min=2, max=10000, help="Runs of each swarm.")
    ] = 8,
    duration_s: Annotated[float, typer.Option("--duration-s", min=1)] = 120,
    start: Annotated[str, typer.Option("--start")] = "square",
    world: World = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed of the search.")] = 1,
    show: Annotated[
        int,
        typer.Option(
            "--show", min=1, help="Examples of each kind that are drawn and tried in MuJoCo."
        ),
    ] = 6,
    confirm_runs: Annotated[
        int, typer.Option("--confirm", min=1, help="Fresh runs of each, and with models drawn.")
    ] = 50,
    mujoco_runs: Annotated[
        int,
        typer.Option(
            "--mujoco", min=0, help="Runs in MuJoCo of each that is to be offered; 0: none."
        ),
    ] = 5,
    as_json: AsJson = False,
) -> list[Entry]:
    """Search controllers, and mixes of two, for new behaviours of the swarm.

    Stopped half way, or with more generations, the same command goes on where it
    was. DIR/behaviors.toml makes each runnable by name in twin_run.

    Example: twinmill lab discover --set robot.body_radius_m=0.1 --out found
    """
    request = make_request(
        "milling",
        model,
        change or [],
        n=n,
        seeds=seeds,
        duration_s=duration_s,
        start=start,
        world=world,
    )
    check_report(out)
    hunt = Hunt(without_axes(request), n, seed)
    with _progress(generations) as tell:
        elites = search(hunt, out, generations, tell)
    found, start_m2 = entries(hunt, elites)
    with progress_bar() as progress:
        task = progress.add_task("running all again, seeds and models fresh", total=None)
        confirm(
            hunt,
            found,
            start_m2,
            confirm_runs,
            tell=lambda done, planned: progress.update(task, completed=done, total=planned),
        )
    if mujoco_runs:
        with progress_bar() as progress:
            task = progress.add_task("behaviours tried in MuJoCo", total=None)
            confirm_in_mujoco(
                hunt,
                found,
                start_m2,
                mujoco_runs,
                enough=show,
                tell=lambda tried: progress.update(task, completed=tried),
            )
    with busy("drawing"):
        offered = offer(found, mujoco_runs > 0)
        if not offered:
            raise ValueError(
                f"none of {len(found)} behaviours held when it was run again; search longer "
                "(--generations), or judge each by more runs (--seeds)."
            )
        shown = _best(offered, show)
        write_entries(out, hunt, found)
        tried = generations * PER_GENERATION
        page = section(hunt, found, offered, shown=shown, tried=tried, cells=elites.cells)
        limits = {"generations": generations, "show": show, "confirm": confirm_runs}
        limits["mujoco"] = mujoco_runs
        source = _source(hunt, model, change or [], limits, world=world, out=out)
        report = write_report(out, page.title, source, [page], note=NOTE)
    data = {
        "tried": tried,
        "kept": len(found),
        "offered": len(offered),
        "cells": elites.cells,
        "sha256": hunt.sha256,
        "entries": [entry.to_json() for entry in found],
        **source.to_json(),
        "archive": str(out / "archive.parquet"),
        "behaviors": str(out / "behaviors.toml"),
        "report": str(report),
    }
    words = f"{page.verdict}\nReport: {report}\nRun one:"
    run_one = whole(f"cd {shlex.quote(str(out))} && {shown[0].command}")
    deliver(data, Group(words, run_one), as_json)
    return found


def _best(found: list[Entry], show: int) -> list[Entry]:
    return [
        entry
        for kind in KIND_COLORS
        for entry in [entry for entry in found if entry.kind == kind][:show]
    ]


def _source(
    hunt: Hunt,
    model: str,
    change: list[str],
    limits: dict[str, int],
    *,
    world: Path | None,
    out: Path,
) -> Provenance:
    request = hunt.request
    words = ["twinmill", "lab", "discover", "--model", model]
    words += repeated("--set", change)
    words += ["--world", str(world)] if world else []
    words += [word for name, limit in limits.items() for word in (f"--{name}", str(limit))]
    words += ["--n", str(hunt.n), "--seeds", str(request.seeds)]
    words += ["--duration-s", f"{request.duration_s:g}", "--start", request.start]
    words += ["--seed", str(hunt.seed), "--out", str(out)]
    return Provenance(
        shlex.join(words),
        f"twinmill {request.version}",
        hashlib.sha256(request.model_text.encode()).hexdigest(),
    )


@contextmanager
def _progress(generations: int) -> Iterator[Callable[[int, int], None]]:
    with progress_bar() as progress:
        task = progress.add_task("swarms", total=generations * PER_GENERATION)
        yield lambda tried, kept: progress.update(
            task, completed=tried, description=f"swarms tried, {kept} kept"
        )
