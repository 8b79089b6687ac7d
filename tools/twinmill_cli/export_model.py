# SPDX-License-Identifier: Apache-2.0
"""`twinmill twin export`: a model for other simulators, and ranges of its numbers."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill.defaults import ModelFormat
from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from twinmill.export.carried import open_robot
    from twinmill.export.model_files import ExportedModel, default_name, export_model
    from twinmill.version import __version__
    from twinmill_cli.frame import open_model


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("export-model")(_export_model)


def _export_model(
    model: Annotated[
        str,
        typer.Argument(
            metavar="M", show_default=False, help="Model file, here or among the installed models."
        ),
    ],
    *,
    to: Annotated[
        ModelFormat | None, typer.Option("--to", show_default=False, help="Format to write.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="FILE",
            show_default=False,
            help="Default: M's name, here; turbopi_mjcf.xml of turbopi.toml.",
        ),
    ] = None,
    robot: Annotated[
        int | None,
        typer.Option("--robot", min=0, max=99, help="Robot whose own parameters are used."),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="JSON",
            help="Output of diagnose --json, for the share of the error of what is not carried.",
        ),
    ] = None,
    with_ranges: Annotated[
        bool,
        typer.Option(
            "--ranges", help="Write intervals and samples, too: NAME_ranges.yaml, .json, .npz."
        ),
    ] = False,
    samples: Annotated[int, typer.Option("--samples", min=1, max=100_000)] = 100,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed of the samples.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Export a model to other simulators, and list what their format cannot represent.

    The MJCF runs in MuJoCo as it is. SDF, URDF and ros2_control parameters have
    geometry, masses, wheels, camera and limits. JSON has all. --ranges writes
    95 % intervals and samples of all fitted numbers that go together.

    Example: twinmill twin export better.toml --to mjcf --ranges
    """
    if to is None and not with_ranges:
        raise ValueError(
            "--to: is missing; say mjcf, sdf, urdf, ros2_control or json, or --ranges."
        )
    source = open_robot(open_model(model, None), robot, diagnosis)
    stem = out.with_suffix("") if out else Path(Path(model).stem)
    done = export_model(
        *(source, to, out or (default_name(model, to) if to else stem)),
        ranges_stem=stem if with_ranges else None,
        samples=samples,
        seed=seed,
        force=force,
    )
    data = {
        **done.to_json(),
        "command": shlex.join(["twinmill", "twin", "export", model, *(["--to", to] if to else [])]),
        "version": f"twinmill {__version__}",
        "model_sha256": source.file.hash,
    }
    deliver(data, _text(done), as_json)
    return data


def _text(done: ExportedModel) -> str:
    lines = [f"Written: {', '.join(map(str, done.files))}"]
    if done.left:
        lines += ["Not carried:", *(f"  {item.sentence()}" for item in done.left)]
    return "\n".join([*lines, *(f"! {note}" for note in done.warnings)])
