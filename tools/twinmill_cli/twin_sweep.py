# SPDX-License-Identifier: Apache-2.0
"""The program twin_sweep. Python drives it, for tables, clusters and progress; C++ simulates."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

import twinmill_cli.typer_options  # noqa: F401 changes Typer's options
from twinmill.arguments import spelled
from twinmill.counted import counted
from twinmill.swarm.axes import ALIASES, QUANTITIES
from twinmill_cli import early
from twinmill_cli.ending import leave
from twinmill_cli.options import SpreadM, Start, World
from twinmill_cli.output import AsJson, busy, deliver
from twinmill_cli.spelling import typed

AXIS_HELP = "name=from:to:count or name=value,value,..."
app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _text(data: dict[str, Any]) -> str:
    classes = ", ".join(f"{name} {count}" for name, count in data["classes"].items())
    worlds = f"{counted(data['worlds'], 'world')} in {counted(data['cells'], 'cell')}"
    lines = [f"{worlds}, {data['wall_s']:.1f} s: {classes}"]
    if "kept_out" in data:
        lines.append(f"Kept out of the goal: in {data['kept_out']} of {data['worlds']} worlds.")
    if data["why_full"]:
        lines.append(f"Every robot ran its firmware and plant, slowly: {data['why_full']}.")
    lines.append(f"{data['file']}\nPicture: twinmill swarm phase {shlex.quote(str(data['out']))}")
    return "\n".join(lines)


@app.command(
    epilog=f"Axes: {', '.join(QUANTITIES)}, {', '.join(f'{a} = {b}' for a, b in ALIASES.items())}; "
    "or any quantity of the model file by its full name."
)
def _command(
    x: Annotated[str, typer.Option("--x", show_default=False, help=AXIS_HELP)],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", show_default=False, help="Folder of the sweep.")
    ],
    *,
    y: Annotated[str | None, typer.Option("--y", help=AXIS_HELP)] = None,
    z: Annotated[list[str] | None, typer.Option("--z", help="More axes.")] = None,
    behavior: Annotated[
        str, typer.Option("--behavior", help="One for all, or milling:5,self_centering:1.")
    ] = "milling",
    table: Annotated[
        list[str] | None,
        typer.Option("--table", help="Own behaviour: name=speed,turn,speed,turn, unseen first."),
    ] = None,
    n: Annotated[int | None, typer.Option("--n", help="Robots; default 6 or the mix's.")] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Runs of each cell.")] = 50,
    first_seed: Annotated[
        int, typer.Option("--first-seed", min=0, help="Cells take their seeds from here on.")
    ] = 1,
    same_seeds: Annotated[
        bool,
        typer.Option(
            "--same-seeds", help="Use the same seeds in every cell, so that only the cells differ."
        ),
    ] = False,
    duration_s: Annotated[
        float, typer.Option("--duration-s", min=0.1, help="Length of each run.")
    ] = 120,
    start: Start = "square",
    spread_m: SpreadM = 1.2,
    target_radius_m: Annotated[
        float | None,
        typer.Option(
            "--target-radius-m", help="Radius of the disc that is seen; default: the model's."
        ),
    ] = None,
    model: Annotated[str, typer.Option("--model", "-m", metavar="M")] = "paper.toml",
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Threads; default: all cores.")
    ] = None,
    dask: Annotated[
        str | None, typer.Option("--dask", help="Address of a Dask scheduler, tcp://host:port.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Each robot its firmware and plant, always.")
    ] = False,
    plant: Annotated[
        str,
        typer.Option(
            "--plant",
            help="planar, or mujoco: wheels that slip, bodies with mass; steps of 5 ms at most.",
        ),
    ] = "planar",
    world: World = None,
    as_json: AsJson = False,
) -> None:
    """Run swarms over a grid of parameters, with metrics and a class for each.

    Stopped half way, the same command goes on where it was.

    Example: twin_sweep --x v_mps=0.1:0.35:6 --y omega_degps=20:90:8 --out sweep
    """
    from twinmill.swarm.sweep import make_request, sweep  # not for --help

    with busy("checking the cells"):
        request = make_request(
            behavior,
            model,
            [axis for axis in (x, y, *(z or [])) if axis],
            table,
            n=n,
            seeds=seeds,
            first_seed=first_seed,
            duration_s=duration_s,
            start=start,
            spread_m=spread_m,
            target_radius_m=target_radius_m,
            full=full,
            same_seeds=same_seeds,
            plant=plant,
            world=world,
        )
    data = sweep(request, out, workers, dask)
    deliver(data, _text(data), as_json)


def main() -> None:
    """Entry point: leaves with the exit code."""
    leave("twin_sweep", _run, "stopped; the same command goes on from here.")


def _run(words: list[str]) -> int:
    early.end()
    with spelled(typed):
        return app(words, prog_name="twin_sweep", standalone_mode=False)


if __name__ == "__main__":
    main()
