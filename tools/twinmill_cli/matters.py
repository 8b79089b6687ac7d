# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm matters`: which effect and which number of a model the swarm feels."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Model, Out, SpreadM, Start, repeated
from twinmill_cli.output import AsJson, busy, deliver, say, telling

if working():  # not for --help
    import hashlib
    import json

    import pyarrow as pa
    from rich.console import Group, RenderableType
    from rich.progress import Progress
    from rich.text import Text

    from twinmill.data.log import read_bytes
    from twinmill.diagnosis.diagnose import diagnose
    from twinmill.files import check_report
    from twinmill.model.model_file import ModelFile, write_whole
    from twinmill.report import matters as present
    from twinmill.report import write_report
    from twinmill.swarm.classes import check_goal, goal_of
    from twinmill.swarm.matters.changes import factors
    from twinmill.swarm.matters.hidden import Hidden, hidden_effects, unseen_effects
    from twinmill.swarm.matters.maps import map_requests
    from twinmill.swarm.matters.sensitivity import (
        MATTERS,
        NOTHING,
        UNSURE,
        Sensitivity,
        folder_of,
        rank_factors,
    )
    from twinmill.swarm.matters.sentences import headline, next_step, sentence, to_json
    from twinmill.swarm.phase import phase_of
    from twinmill.swarm.request import Request
    from twinmill.swarm.store import read_sweep
    from twinmill.swarm.sweep import make_request, run_missing
    from twinmill.terminal import progress_bar
    from twinmill_cli.frame import load, provenance

SHOWN = 12  # sentences in the terminal


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("matters")(_matters)


def _matters(
    *,
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG", show_default=False, help="Logs that the model was fitted to"),
    ] = None,
    model: Model = DEFAULT_MODEL,
    behavior: Annotated[
        str, typer.Option("--behavior", help="One for all, or milling:5,self_centering:1.")
    ] = "milling",
    n: Annotated[int | None, typer.Option("--n", help="Robots; default 6 or the mix's.")] = None,
    goal: Annotated[
        str | None, typer.Option("--goal", help="Class that is wanted; default: the behaviour's.")
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=40, help="Most runs of each change.")] = 400,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0)] = 1,
    duration_s: Annotated[
        float, typer.Option("--duration-s", min=10, help="Length of each run.")
    ] = 120,
    start: Start = "square",
    spread_m: SpreadM = 1.2,
    margin: Annotated[
        float, typer.Option("--margin", min=0.001, max=0.5, help="Change that would not matter.")
    ] = 0.1,
    draws: Annotated[
        int, typer.Option("--draws", min=0, help="Models drawn from what the fits leave open.")
    ] = 20,
    x: Annotated[
        str, typer.Option("--x", help="Axis of the phase diagrams, as of twin_sweep.")
    ] = "n=4:8:5",
    y: Annotated[str, typer.Option("--y", help="The other axis.")] = "range_m=0.8:1.4:4",
    map_seeds: Annotated[
        int, typer.Option("--map-seeds", min=0, help="Runs of each of their cells; 0: none.")
    ] = 12,
    only: Annotated[
        list[str] | None, typer.Option("--only", help="An effect or number; else all are tried.")
    ] = None,
    as_json: AsJson = False,
    out: Out = None,
) -> Sensitivity:
    """Sensitivity analysis: which effects and parameters change what the swarm does.

    Each is changed alone: an effect is left out, a number goes to both ends of
    its interval, and what the logs do not exclude is put in. The same seeds
    run before and after. Stopped half way, the same command with --out goes on.

    Example: twinmill swarm matters run.lcmlog --model explained.toml --out matters
    """
    if out:
        check_report(out)
    request = make_request(
        behavior,
        model,
        [],
        n=n,
        seeds=seeds,
        first_seed=first_seed,
        duration_s=duration_s,
        start=start,
        spread_m=spread_m,
        full=True,
    )
    axes = make_request(behavior, model, [x, y], n=n, start=start, spread_m=spread_m).axes
    wanted = check_goal(goal) if goal else goal_of(request)
    model_file = ModelFile.load(model)
    source = provenance(_command_line(locals()), model_file)
    with TemporaryDirectory(prefix="twinmill.") as scratch, _stoppable(out):
        folder = out or Path(scratch)
        hidden = _hidden(logs or [], model_file, folder)
        with busy("writing the changed models"):
            asked, left = factors(model_file, hidden, drawn=draws, seed=first_seed, only=only or [])
        with progress_bar() as progress:
            task = progress.add_task("runs", total=None)
            found = rank_factors(
                request=request,
                factors=asked,
                left=left,
                goal=wanted,
                margin=margin,
                folder=folder,
                tell=lambda done, planned: progress.update(task, completed=done, total=planned),
            )
            asked_maps = map_requests(found, axes, map_seeds) if out else {}
            maps = {
                name: phase_of(asked, _table(asked, folder, progress), wanted)
                for name, asked in asked_maps.items()
            }
    report = None
    if out:
        section = present.section(found, maps)
        report = write_report(out, section.title, source, [section], note=present.NOTE)
    data = {**to_json(found), **source.to_json(), "report": str(report) if report else None}
    deliver(data, _terminal(found, report), as_json)
    return found


@contextmanager
def _stoppable(out: Path | None) -> Iterator[None]:
    """Says on Ctrl-C what is kept."""
    try:
        yield
    except KeyboardInterrupt:
        kept = (
            f"what is done is kept in {out}, and the same command goes on from there"
            if out
            else "with --out DIR what is done is kept"
        )
        say(f"stopped; {kept}.")
        raise


def _hidden(logs: list[Path], model_file: ModelFile, folder: Path) -> list[Hidden]:
    """Effects that the logs do not exclude, kept in the folder: the diagnosis takes a minute."""
    if not logs:
        return unseen_effects(model_file.model)
    kept = folder / "hidden.json"
    hashes = [hashlib.sha256(read_bytes(log)).hexdigest() for log in logs]
    key = {"model": model_file.hash, "logs": hashes}
    if kept.exists() and (known := json.loads(kept.read_text()))["of"] == key:
        return [Hidden(**one) for one in known["hidden"]]
    with telling("looking for what the logs do not exclude") as progress:
        measurements = load(logs, model_file)
        diagnosis = diagnose(measurements, model_file, progress=progress)
        found = hidden_effects(measurements, model_file, progress)
    if diagnosis.answer.added:
        say(
            f"these logs show that {model_file.path} lacks {', '.join(diagnosis.answer.added)}; "
            "twinmill explain adds it. What follows is of the model as it is."
        )
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(kept, json.dumps({"of": key, "hidden": [one.to_json() for one in found]}, indent=1))
    return found


def _table(request: Request, folder: Path, progress: Progress) -> pa.Table:
    """Rows of a sweep, with a bar of its own."""
    place = folder_of(request, folder)
    task = progress.add_task("phase diagrams", total=request.world_count)
    run_missing(request, place, lambda worlds: progress.advance(task, worlds))
    progress.remove_task(task)
    return read_sweep(place)[1]


def _command_line(given: dict[str, Any]) -> str:
    """The command that does this again."""
    words = ["twinmill", "swarm", "matters", *map(str, given["logs"] or [])]
    for name in ("model", "behavior", "goal", "n"):
        words += [f"--{name}", str(given[name])] if given[name] is not None else []
    for name in ("seeds", "first_seed", "duration_s", "spread_m", "margin", "draws", "map_seeds"):
        words += [f"--{name.replace('_', '-')}", f"{given[name]:g}"]
    words += ["--start", given["start"], "--x", given["x"], "--y", given["y"]]
    words += repeated("--only", given["only"] or [])
    return shlex.join(words)


def _terminal(found: Sensitivity, report: Path | None) -> RenderableType:
    styles = {MATTERS: "bold red", UNSURE: "yellow", NOTHING: ""}
    lines = [Text(headline(found)), Text()]
    lines += [Text(sentence(j), styles[j.verdict]) for j in found.ranked[:SHOWN]]
    if (more := len(found.ranked) - SHOWN) > 0:
        lines.append(Text(f"... and {more} more; --json and --out have all.", "dim"))
    lines += [Text(), Text(f"Next: {next_step(found)}")] if next_step(found) else []
    return Group(*lines, *([Text(f"Report: {report}")] if report else []))
