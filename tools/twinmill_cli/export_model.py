# SPDX-License-Identifier: Apache-2.0
"""`twinmill export-model`: a model for other simulators, and ranges of its numbers."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    from importlib.metadata import version

    from twinmill.export.carried import Left, RobotModel, open_robot
    from twinmill.export.mjcf import mjcf
    from twinmill.export.model_json import model_json
    from twinmill.export.ranges import as_json as ranges_json
    from twinmill.export.ranges import as_npz, as_yaml
    from twinmill.export.ros2_control import ros2_control
    from twinmill.export.sdf import sdf
    from twinmill.export.urdf import urdf
    from twinmill.files import check_new_file, plain, replacing
    from twinmill.model.ranges import Ranges, ranges
    from twinmill_cli.frame import open_model


class Target(StrEnum):
    """What can be written."""

    MJCF = "mjcf"
    SDF = "sdf"
    URDF = "urdf"
    ROS2_CONTROL = "ros2_control"
    JSON = "json"


SUFFIX = {Target.MJCF: "xml", Target.ROS2_CONTROL: "yaml"}
if working():
    WRITERS: dict[Target, Callable[[RobotModel], tuple[str, list[Left]]]] = {
        Target.MJCF: mjcf,
        Target.SDF: sdf,
        Target.URDF: urdf,
        Target.ROS2_CONTROL: ros2_control,
        Target.JSON: lambda robot: (json.dumps(plain(model_json(robot)), indent=1) + "\n", []),
    }


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
        Target | None, typer.Option("--to", show_default=False, help="What to write.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", show_default=False, help="Default: M's name, here."
        ),
    ] = None,
    robot: Annotated[
        int | None,
        typer.Option("--robot", min=0, max=99, help="With what the model states of this robot."),
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
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the samples.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
    as_json: AsJson = False,
) -> dict:
    """Write a model for other simulators, and name what their file cannot carry.

    The MJCF runs in MuJoCo as it is. SDF, URDF and ros2_control parameters have
    geometry, masses, wheels, camera and limits. JSON has all. --ranges writes
    95 % intervals and samples of all fitted numbers that go together.

    Example: twinmill export-model better.toml --to mjcf --ranges
    """
    if to is None and not with_ranges:
        raise ValueError(
            "--to: is missing; say mjcf, sdf, urdf, ros2_control or json, or --ranges."
        )
    source = open_robot(open_model(model, None), robot, diagnosis)
    stem = Path(model).stem
    texts: dict[Path, str | bytes] = {}
    left: list[Left] = []
    notes: list[str] = []
    if to is not None:
        text, left = WRITERS[to](source)
        default = Path(
            f"{stem}_control.yaml" if to is Target.ROS2_CONTROL else f"{stem}.{SUFFIX.get(to, to)}"
        )
        texts[out or default] = text
    if with_ranges:
        beside = out.with_suffix("") if out else Path(stem)
        found = ranges(source.file, source.model, samples, seed)
        texts |= _range_files(source, found, beside)
        notes = _truncated(found)
    _write(texts, force)
    data = {
        "files": [str(path) for path in texts],
        "warnings": notes,
        "not_carried": [item.to_json() for item in left],
        "command": shlex.join(["twinmill", "export-model", model, *(["--to", to] if to else [])]),
        "version": f"twinmill {version('twinmill')}",
        "model_sha256": source.file.hash,
    }
    lines = [f"Written: {', '.join(data['files'])}"]
    if left:
        lines += ["Not carried:", *(f"  {item.sentence()}" for item in left)]
    lines += [f"! {note}" for note in notes]
    deliver(data, "\n".join(lines), as_json)
    return data


def _range_files(source: RobotModel, found: Ranges, beside: Path) -> dict[Path, str | bytes]:
    """The three files by path."""
    data = {"model": source.name, "model_sha256": source.file.hash, **plain(found.to_json())}
    contents = {"yaml": as_yaml(data), "json": ranges_json(data), "npz": as_npz(found)}
    return {
        beside.with_name(f"{beside.name}_ranges.{suffix}"): content
        for suffix, content in contents.items()
    }


def _truncated(found: Ranges) -> list[str]:
    """A sentence for each quantity whose samples are no whole normal."""
    names = [q.name for q in found.quantities]
    told = []
    for q in found.truncated:
        drawn = found.samples[:, names.index(q.name)]
        told.append(
            f"{q.name} = {q.value:g} ± {q.std:g} is truncated: {100 * q.outside:.2g} % of its "
            f"normal lie outside {q.min:g} to {q.max:g}. The samples have mean {drawn.mean():.3g} "
            f"and std {drawn.std():.3g}, and what is correlated with it shifts, too."
        )
    return told


def _write(texts: dict[Path, str | bytes], force: bool) -> None:
    """All files, or none is new."""
    for path in texts:
        check_new_file(path, force)
    with ExitStack() as stack:
        for path, text in texts.items():
            temporary = stack.enter_context(replacing(path, force))
            temporary.write_bytes(text.encode() if isinstance(text, str) else text)
