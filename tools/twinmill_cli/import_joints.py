# SPDX-License-Identifier: Apache-2.0
"""`twinmill import joints`: a log of joints from other people's files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver, say, telling

if working():  # not for --help
    import numpy as np

    from twinmill.files import replacing
    from twinmill.joints.files import SUFFIXES, write_joint_log
    from twinmill.joints.importers.import_joints import Topics
    from twinmill.joints.importers.import_joints import import_joints as read
    from twinmill.joints.importers.names import Given
    from twinmill.joints.mjcf import Mjcf
    from twinmill.report import joints as shown
    from twinmill.version import __version__
if TYPE_CHECKING:
    from twinmill.joints.importers.import_joints import ImportedJoints

ONE_AFTER_ANOTHER = "Names of columns that have none, in their order, with commas: of {}."


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("import-joints")(_import_joints)


def _import_joints(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            show_default=False,
            help="A CSV, npz, ROS bag or MCAP with JointState, or LeRobot's Parquet; or tables "
            "that are parts of one run.",
        ),
    ],
    *,
    model: Annotated[
        str, typer.Option("--model", "-m", metavar="M", show_default=False, help="The MJCF.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="LOG", show_default=False, help="The log (.mcap or .npz)."
        ),
    ],
    rename: Annotated[
        list[str] | None,
        typer.Option(
            "--rename",
            metavar="OLD=NEW",
            show_default=False,
            help="A column or name as t_s, qpos.JOINT, qvel.JOINT or ctrl.ACTUATOR; may be "
            "repeated.",
        ),
    ] = None,
    joints: Annotated[str, typer.Option(help=ONE_AFTER_ANOTHER.format("joints"))] = "",
    actuators: Annotated[str, typer.Option(help=ONE_AFTER_ANOTHER.format("actuators"))] = "",
    state: Annotated[str, typer.Option(metavar="TOPIC", help="Of a bag: positions.")] = "",
    command: Annotated[str, typer.Option(metavar="TOPIC", help="Of a bag: commands.")] = "",
    degrees: Annotated[
        bool,
        typer.Option(
            "--degrees", help="Angles without a unit in their names, and servos' commands, are."
        ),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace LOG if it exists.")] = False,
    as_json: AsJson = False,
) -> ImportedJoints:
    """Make a log of joints for an MJCF from a table, a ROS bag or a LeRobot data set.

    Names, units and stamps are checked against the model. Then compare, diagnose,
    explain and next take the log.

    Example: twinmill import joints run.csv --model arm.xml -o run.mcap
    """
    given = Given(_renames(rename or []), _names(joints), _names(actuators), degrees)
    if output.suffix not in SUFFIXES:
        raise ValueError(
            f"{output}: logs of joints are written as {' or '.join(SUFFIXES)}; end its name so."
        )
    words = ["twinmill", "import", "joints", *map(str, files), "--model", model, "-o", str(output)]
    words += [w for text in rename or () for w in ("--rename", text)]
    for name, value in (("joints", joints), ("actuators", actuators), ("state", state),
                        ("command", command)):  # fmt: skip
        words += [f"--{name}", value] if value else []
    line = shlex.join([*words, *(["--degrees"] if degrees else [])])
    with (
        telling(f"importing for {model}"),
        replacing(output, force, inputs=[Path(model), *files]) as place,
    ):
        found = read(files, Mjcf.load(model), given, Topics(state, command))
        told = {"command": line, "version": f"twinmill {__version__}"}
        write_joint_log(found.log, place, told, output.suffix)
    for note in found.notes:
        say(note)
    deliver({"output": str(output), **_told(found), **told}, shown.imported(found, output), as_json)
    return found


def _told(found: ImportedJoints) -> dict[str, Any]:
    """Fields of JSON."""
    log = found.log
    return {
        "samples": len(log.t_s),
        "runs": len(log.begins),
        "duration_s": float(sum(np.ptp(log.t_s[run]) for run in log.runs)),
        "joints": list(log.joints or ()),
        "actuators": list(log.actuators or ()),
        "warnings": list(found.notes),
    }


def _renames(given: list[str]) -> dict[str, str]:
    names = {}
    for text in given:
        old, equals, new = text.partition("=")
        if not equals or not old or not new:
            raise typer.BadParameter(
                f"{text} is no change of a name, as OLD=qpos.elbow is.", param_hint="'--rename'"
            )
        names[old] = new
    return names


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]
