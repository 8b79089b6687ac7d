# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot wheels`: one wheel at a time, and whether each does what its column says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Model, ScriptAs
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import numpy as np
    import twinmill_native as native
    from rich.console import Group, RenderableType
    from rich.text import Text

    from twinmill.data.log import read_log
    from twinmill.experiment.played import Rows
    from twinmill.experiment.wheel_signs import (
        Column,
        WheelSigns,
        columns_that_act,
        csv_text,
        drive_of,
        read_signs,
        script,
    )
    from twinmill.export.script import TwistScript
    from twinmill.files import replacing
    from twinmill.report import show
    from twinmill.report.tables import Cell, Table
    from twinmill_cli.frame import open_model
    from twinmill_cli.ros_script import check_new_script, write_script

SCRIPT = Path("wheels.csv")


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("wheels")(_wheels)


def _wheels(
    *,
    log: Annotated[
        Path | None, typer.Argument(metavar="[LOG]", show_default=False, help="Log of the script.")
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="SCRIPT", help="The script to write.")
    ] = SCRIPT,
    model: Model = DEFAULT_MODEL,
    duty_pct: Annotated[int, typer.Option("--duty-pct", min=10, max=100)] = 50,
    script_as: ScriptAs = None,
    force: Annotated[bool, typer.Option("--force", help="Replace SCRIPT if it exists.")] = False,
    as_json: AsJson = False,
) -> int:
    """Write a script that drives one wheel at a time; with its LOG, say what each wheel did.

    Plain wheels turn side by side: left, right. Robots that are told
    velocities drive forward, to the left, and turn instead. The answer is
    read from the poses: signs that are wrong, cables that are exchanged,
    wheels that stand, poses that are mirrored or turned.
    Exit code 1 says that something is wrong.

    Example: twinmill robot wheels -o wheels.csv; twinmill robot wheels wheels.lcmlog
    """
    model_file = open_model(model, None)
    robot_model = model_file.model
    if log is None:
        check_new_script(script_as, output, force, [model_file.path])
        return _write(robot_model, output, duty_pct, script_as, force=force, as_json=as_json)
    found = [read_signs(robot, robot_model, log.name) for robot in read_log(log).robots.values()]
    right = all(signs.right for signs in found)
    data = {"log": str(log), "right": right, "robots": [signs.to_json() for signs in found]}
    deliver(data, Group(*(part for signs in found for part in _shown(signs))), as_json)
    return 0 if right else 1


def _write(
    model: native.Model, output: Path, duty_pct: int, form: ScriptAs, *, force: bool, as_json: bool
) -> int:
    names, rows = script(model, duty_pct)
    if form:
        twists = _twists(model, rows[:-1, 0], rows[:-1, 1:], float(rows[-1, 0]))
        command = f"twinmill robot wheels --script-as {form}"
        write_script(twists, form, output, force, command=command)
    else:
        with replacing(output, force) as temporary:
            temporary.write_text(csv_text(names, rows))
    data = {"script": str(output), "columns": names, "duration_s": float(rows[-1, 0])}
    each = ", ".join(columns_that_act(model, drive_of(model)))
    text = f"Written: {output}, {rows[-1, 0]:g} s, one of {each} at a time."
    deliver(data, text, as_json)
    return 0


def _twists(model: native.Model, t_s: np.ndarray, values: np.ndarray, end_s: float) -> TwistScript:
    """Velocities as they are; those that duties lead to."""
    if model.drive == "twist":
        return TwistScript(t_s, values, end_s)
    return TwistScript.of(model, Rows(t_s, values / 100, end_s))


def _shown(signs: WheelSigns) -> list[RenderableType]:
    rows = [
        [Cell(c.name), *map(Cell, _speeds(c)), Cell(c.verdict, "good" if c.right else "bad")]
        for c in signs.columns
    ]
    titles = ["driven forward", "forward mm/s", "left mm/s", "turn °/s", "so"]
    table = show.table(Table(f"robot {signs.robot_id}", titles, rows, words=(0, 4)))
    if signs.right:
        return [table, Text("Each does what it should.")]
    words = [str(finding) for finding in signs.findings] or [
        "What stands, look at; what is exchanged or backward, put right in the robot's program "
        "or in the table of commands, not in the model; then play the script again."
    ]
    return [table, *map(Text, words)]


def _speeds(c: Column) -> list[str]:
    shown = (1e3 * c.body[0], 1e3 * c.body[1], math.degrees(c.body[2]))
    return [f"{value:+.0f}" if c.driven else "-" for value in shown]
