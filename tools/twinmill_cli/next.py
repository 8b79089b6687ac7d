# SPDX-License-Identifier: Apache-2.0
"""`twinmill next`: a script for the robot that tells apart what the logs so far cannot."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Logs, Model, Out, Own, ScriptAs, ScriptForm
from twinmill_cli.output import AsJson, deliver, telling

if working():  # not for --help
    import numpy as np

    from twinmill.data.measurement import Measurements
    from twinmill.experiment.design import Limits, Plan, plan_run
    from twinmill.experiment.played import csv_text
    from twinmill.export.script import TwistScript
    from twinmill.files import check_new_file
    from twinmill.model.model_file import ModelFile, write_whole
    from twinmill.report import next_run as present
    from twinmill.terminal import progress_bar
    from twinmill_cli.frame import (
        command_line,
        finish,
        is_mjcf,
        load,
        open_model,
        provenance,
        told,
        with_own,
    )
    from twinmill_cli.ros_script import check_new_script, ros_path, write_script

if TYPE_CHECKING:
    from twinmill.joints.next import Excitation
    from twinmill.swarm.narrowing import Narrowing
    from twinmill.swarm.request import Request


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("next")(_next)


def _next(
    logs: Logs,
    *,
    model: Model = DEFAULT_MODEL,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="SCRIPT", help="The new script (.csv).")
    ] = Path("script.csv"),
    duration_s: Annotated[
        float, typer.Option("--duration-s", max=600, help="Longest duration of the run.")
    ] = 30,
    floor_m: Annotated[
        str,
        typer.Option(
            "--floor-m",
            metavar="LxW",
            help="Free area, along and across the robot at its start, m.",
        ),
    ] = "2x2",
    max_duty_pct: Annotated[
        int,
        typer.Option(
            "--max-duty-pct",
            min=20,
            max=100,
            help="Highest duty of a wheel; for velocity commands, percent of the highest in the "
            "logs.",
        ),
    ] = 100,
    behavior: Annotated[
        str,
        typer.Option(
            "--for",
            metavar="BEHAVIOR",
            help="Reduce the uncertainty of what a swarm with this behaviour does, as milling.",
        ),
    ] = "",
    n: Annotated[int, typer.Option("--n", min=2, help="Robots of that swarm.")] = 6,
    draws: Annotated[int, typer.Option("--draws", min=4, help="Models that are drawn.")] = 40,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Runs of each model.")] = 20,
    swarm_s: Annotated[float, typer.Option("--swarm-s", min=10, help="Length of each run.")] = 120,
    times_speed: Annotated[
        float,
        typer.Option(
            "--times-speed",
            min=0.1,
            max=5,
            help="Of an MJCF: highest speed of each joint, over that in the logs.",
        ),
    ] = 1.0,
    own: Own = None,
    force: Annotated[bool, typer.Option("--force", help="Replace SCRIPT if it exists.")] = False,
    script_as: ScriptAs = None,
    as_json: AsJson = False,
    out: Out = None,
) -> Plan | Narrowing | Excitation:
    """Design the run that best discriminates what these logs cannot, and write its script.

    In question are the effects that `diagnose` neither calls sure nor rules out;
    of several robots those that it cannot distinguish, else those that are not
    identifiable in these logs. Play the script, record it, and diagnose the old
    and the new logs together.

    With --for the run reduces the uncertainty of a swarm's predicted success:
    models drawn from the uncertainty of the fits are run as swarms, and the
    script determines the parameters on which their outcomes depend most.

    Example: twinmill next run.lcmlog --model fitted.toml -o script.csv

    Of an MJCF:
    twinmill next run.mcap --model arm.xml -o excitation.csv
    """
    if is_mjcf(model):
        from twinmill_cli.joints import designed  # MuJoCo's Python is slow to import

        return designed(
            *(logs, model, output),
            own=own or [],
            duration_s=duration_s,
            times_speed=times_speed,
            force=force,
            as_json=as_json,
            out=out,
        )
    if own and behavior:
        raise ValueError(
            "next: --for draws models from the uncertainty of the fits, to which --own adds "
            "nothing; leave --own away."
        )
    limits = Limits(duration_s, _sides(floor_m), max_duty_pct / 100)
    verb = f"next --duration-s {duration_s:g} --floor-m {floor_m} --max-duty-pct {max_duty_pct}"
    verb += f" --script-as {script_as}" if script_as else ""
    verb = with_own(verb, own or [])
    source = provenance(
        command_line(verb, logs, model, output), model_file := open_model(model, out)
    )
    check_new_file(output, force, [model_file.path, *logs, *(own or [])])
    if script_as:
        check_new_script(script_as, ros_path(script_as, output), force)
    if behavior:
        from twinmill.swarm.sweep import make_request  # needs more packages than `make demo` has

        swarm = make_request(behavior, model, [], n=n, seeds=seeds, duration_s=swarm_s, full=True)
        narrowing = _narrowing(load(logs, model_file), model_file, limits, swarm, draws=draws)
        write_whole(output, csv_text(narrowing.rows), force)
        how = _how(narrowing, logs, model, output, form=script_as)
        data = {"script": str(output), **narrowing.to_json(), **source.to_json()}
        if script_as:
            twists = TwistScript.of(model_file.model, narrowing.rows)
            path = ros_path(script_as, output)
            write_script(twists, script_as, path, force, command=source.command)
            data["script_as"] = str(path)
        deliver(data, present.narrowing_terminal(narrowing, how), as_json)
        return narrowing
    with telling(f"designing a run with {model}") as progress:
        measurements = load(logs, model_file)
        before = load(own, model_file) if own else ()
        plan = plan_run(measurements, model_file, limits, progress, own=before)
    write_whole(output, csv_text(plan.rows), force)
    how = _how(plan, logs, model, output, form=script_as, own=own or [])
    data = {"script": str(output), **plan.to_json(), **told(measurements)}
    if script_as:
        twists = TwistScript.of(model_file.model, plan.rows)
        write_script(twists, script_as, ros_path(script_as, output), force, command=source.command)
        data["script_as"] = str(ros_path(script_as, output))
    section = partial(present.section, plan, how)
    text = present.terminal(plan, how)
    finish(data, text, source, section=section, as_json=as_json, out=out, scored=False)
    return plan


def _narrowing(
    measurements: Measurements, model_file: ModelFile, limits: Limits, swarm: Request, *, draws: int
) -> Narrowing:
    """The run that narrows the swarm's prediction, with the share of models that were run."""
    from twinmill.swarm.narrowing import narrow

    with progress_bar() as progress:
        task = progress.add_task("swarms of models drawn", total=draws)
        return narrow(
            *(measurements, model_file, limits, swarm),
            draws=draws,
            tell=lambda: progress.advance(task),
        )


def _sides(text: str) -> tuple[float, float]:
    """`2x1.5` to its sides in m."""
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)x([0-9]+(?:\.[0-9]+)?)", text)
    if not found:
        raise ValueError(
            f"--floor-m {text}: is no floor; give its length and width in m as in 2x1.5."
        )
    return float(found[1]), float(found[2])


def _how(
    plan: Plan | Narrowing,
    logs: list[Path],
    model: str,
    script: Path,
    *,
    form: ScriptForm | None = None,
    own: Sequence[Path] = (),
) -> present.How:
    """How to play the script, or what was written of it for ROS, and what to do then."""
    path, number = shlex.quote(str(script)), plan.robot_id
    written = f"{script}, and for ROS {ros_path(form, script)}" if form else f"{script}"
    first = (
        f"Written: {written}. Put the robot in the middle of the floor, its camera along the first "
        "side."
    )
    then = command_line(with_own("diagnose", [*own]), [*logs, Path("next.lcmlog")], model)
    if form:
        player = "ros2 bag play" if form is ScriptForm.BAG else "python3"
        steps = [
            ("On the robot:", f"{player} {shlex.quote(str(ros_path(form, script)))}"),
            ("then, what it sent and its poses imported:", then),
        ]
        return present.How(first, steps)
    robot = f"twinmill robot characterise --robot {number} --script {path}"
    if plan.rows.kind == "twist":
        program = shlex.quote(str(script.with_suffix(".py")))
        steps = [
            ("As a program for ROS 2:", f"{robot} --script-as publisher --out {program}"),
            ("on the robot:", f"python3 {program}"),
            ("then, what it sent and its poses imported:", then),
        ]
        return present.How(first, steps)
    cap_pct = round(100 * float(np.abs(plan.rows.command).max()))
    twin = f"twin_run --n 1 --model {shlex.quote(model)} --script {path}"
    steps = [
        ("On the robot:", f"{robot} --cap-pct {cap_pct} --out next.lcmlog"),
        ("or in the twin:", f"{twin} --log next.lcmlog"),
        ("then:", then),
    ]
    return present.How(first, steps)
