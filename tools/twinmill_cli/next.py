# SPDX-License-Identifier: Apache-2.0
"""`twinmill next`: a script for the robot that tells apart what the logs so far cannot."""

from __future__ import annotations

import re
import shlex
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Logs, Model, Out, ScriptAs
from twinmill_cli.output import AsJson, telling

if working():  # not for --help
    import numpy as np

    from twinmill.diagnosis.diagnose import diagnose
    from twinmill.experiment.design import Limits, Plan, check, design
    from twinmill.experiment.script_file import csv_text
    from twinmill.export.script import TwistScript
    from twinmill.files import check_new_file
    from twinmill.model.model_file import write_whole
    from twinmill.report import next_run as present
    from twinmill_cli.frame import command_line, finish, load, open_model, provenance
    from twinmill_cli.ros_script import check_new_script, ros_path, write_script


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("next")(_next)


def _next(
    logs: Logs,
    model: Model = DEFAULT_MODEL,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="SCRIPT", help="The new script (.csv).")
    ] = Path("script.csv"),
    duration_s: Annotated[float, typer.Option("--duration-s", max=600, help="Longest run.")] = 30,
    floor_m: Annotated[
        str, typer.Option("--floor-m", metavar="LxW", help="Free floor, along and across.")
    ] = "2x2",
    max_duty_pct: Annotated[
        int, typer.Option("--max-duty-pct", min=20, max=100, help="Highest duty of a wheel.")
    ] = 100,
    force: Annotated[bool, typer.Option("--force", help="Replace SCRIPT if it exists.")] = False,
    script_as: ScriptAs = None,
    as_json: AsJson = False,
    out: Out = None,
) -> Plan:
    """Design the run that best tells apart what these logs cannot, and write its script.

    What is in question is what `diagnose` leaves open: effects that look alike,
    else effects that would not show. Play the script, log it, and diagnose
    the old and the new logs together.

    Example: twinmill next run.lcmlog --model fitted.toml -o script.csv
    """
    limits = Limits(duration_s, _sides(floor_m), max_duty_pct / 100)
    verb = f"next --duration-s {duration_s:g} --floor-m {floor_m} --max-duty-pct {max_duty_pct}"
    verb += f" --script-as {script_as}" if script_as else ""
    source = provenance(
        command_line(verb, logs, model, output), model_file := open_model(model, out)
    )
    check_new_file(output, force)
    if script_as:
        check_new_script(script_as, ros_path(script_as, output), force)
    with telling(f"designing a run with {model}") as say:
        measurements = load(logs, model_file, as_json)
        check(measurements, model_file, limits)
        plan = design(diagnose(measurements, model_file, say), model_file, limits, say)
    write_whole(output, csv_text(plan.rows))
    how = _how(plan, logs, model, output)
    data = {"script": str(output), **plan.to_json()}
    if script_as:
        data["script_as"] = str(ros_path(script_as, output))
        twists = TwistScript.of(model_file.model, plan.rows.t_s, plan.rows.duty, plan.rows.end_s)
        write_script(twists, script_as, Path(data["script_as"]), force, source.command)
    section = partial(present.section, plan, how)
    finish(data, present.terminal(plan, how), source, section, as_json, out)
    return plan


def _sides(text: str) -> tuple[float, float]:
    """`2x1.5` to its sides in m."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)", text)
    if not found:
        raise ValueError(
            f"--floor-m {text}: is no floor; give its length and width in m as in 2x1.5."
        )
    return float(found[1]), float(found[2])


def _how(plan: Plan, logs: list[Path], model: str, script: Path) -> present.How:
    """How to play the script and what to do then."""
    path, number = shlex.quote(str(script)), plan.robot_id
    cap_pct = round(100 * float(np.abs(plan.rows.duty).max()))
    robot = f"twinmill characterise --robot {number} --script {path} --cap-pct {cap_pct}"
    twin = f"twin_run --n 1 --model {shlex.quote(model)} --script {path}"
    return present.How(
        f"Written: {script}. Put the robot in the middle of the floor, its camera along the first "
        "side.",
        [
            ("On the robot:", f"{robot} --out next.lcmlog"),
            ("or in the twin:", f"{twin} --log next.lcmlog"),
            ("then:", command_line("diagnose", [*logs, Path("next.lcmlog")], model)),
        ],
    )
