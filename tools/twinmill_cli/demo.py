# SPDX-License-Identifier: Apache-2.0
"""Shows the whole loop: a swarm in the twin, then a robot's log and a model made to agree with it.

Prints each command as a user would type it, then its real output; all files go to demo/.
"""

import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from twinmill.model.model_file import ModelFile
from twinmill.predict.windows import HORIZONS_S, rms
from twinmill.report import (
    Section,
    added_section,
    comparison_section,
    fit_section,
    show,
    steps_section,
    tables,
    write_report,
)
from twinmill.report.tables import Cell, Table, number
from twinmill_cli import main as cli
from twinmill_cli.frame import provenance

ROOT = Path(__file__).resolve().parents[2]
FOLDER, LOG = Path("demo"), "demo/robot.lcmlog"
NOMINAL = "turbopi_nominal.toml"
CANDIDATES = ("speed_curve", "coasting", "lag_by_duty", "wheel_gain", "reverse_asymmetry")
SHOWN_S = (0.2, 0.5, 1.0)
# What the twin has and the user's model lacks, where no real log is at hand.
HIDDEN = """
[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.005
drive_radps = 0.03

[[effect]]
name = "speed_curve"
bend = 1.2

[[effect]]
name = "coasting"
deceleration_mps2 = 0.7
"""


@dataclass(frozen=True)
class Step:
    """Where the model stands after a step: score, and (H, 3) RMS errors on data not fitted to."""

    label: str
    score: float
    rms: np.ndarray


def main(
    programs: Annotated[Path, typer.Option("--bin", help="Folder of twin_run.")] = Path(
        "build/bin"
    ),
) -> None:
    """Entry point of `python -m twinmill_cli.demo`."""
    os.chdir(ROOT)
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir()
    twin_run = str(programs / "twin_run")
    _say("Eight robots in the twin")
    _shell(
        twin_run,
        "--mjcf",
        "turbopi.xml",
        "--n",
        "8",
        "--duration-s",
        "20",
        "--log",
        "demo/twin.lcmlog",
    )
    recordings = (
        Path(os.environ.get("TWINMILL_DATA", "../shared/data")) / "turbopi_optitrack_straight"
    )
    if recordings.is_dir():
        _say("A real robot's run, as motion capture and commands")
        _twinmill(
            "import",
            "--poses",
            str(recordings / "poses.csv"),
            "--commands",
            str(recordings / "commands.csv"),
            "--heading-offset-deg",
            "180",
            "-o",
            LOG,
        )
    else:
        _say("No recordings here: the twin plays a robot with effects that the model will not know")
        _make_hidden_log(twin_run)
    steps, sections = _calibrate()
    chain = [(s.label, s.score) for s in steps]
    summary = steps_section("What was gained", chain, _gain(steps))
    summary.tables[:] = [_summary(steps)]
    _say("What was gained")
    Console().print(show.table(_summary(steps)))
    Console().print(_gain(steps))
    source = provenance("python -m twinmill_cli.demo", ModelFile.load(NOMINAL))
    report = write_report(
        FOLDER / "report",
        "Twinmill demo: from a data sheet to a fitted model",
        source,
        [summary, *sections],
    )
    print(f"\nReport: {report.resolve()}")


def _calibrate() -> tuple[list[Step], list[Section]]:
    """Compares, fits, and adds each candidate that makes predictions of unseen data better."""
    _say("How good is the model from the data sheet?")
    compared = _twinmill("compare", LOG, "--model", NOMINAL)
    _say("Fit its numbers")
    model = "demo/fitted.toml"
    fitted = _twinmill("fit", LOG, "--model", NOMINAL, "-o", model)
    sections = [comparison_section(compared), fit_section(fitted)]
    steps = [Step("data sheet", fitted.before.score, rms(compared.worst.errors))]
    for effect in CANDIDATES:
        _say(f"Add {effect.replace('_', ' ')}")
        richer = f"demo/{effect}.toml"
        added = _twinmill("add", effect, LOG, "--model", model, "-o", richer)
        if len(steps) == 1:
            steps.append(Step("numbers fitted", fitted.after.score, added.heldout_refit.rms))
        if added.heldout_after.score >= added.heldout_refit.score:
            print(f"Left out: on data not fitted to, {effect} does not help.")
            continue
        model = richer
        steps.append(Step(f"+ {effect}", added.after.score, added.heldout_after.rms))
        sections.append(added_section(added))
    _say("Compare again")
    final = _twinmill("compare", LOG, "--model", model)
    return steps, [*sections, comparison_section(final)]


def _summary(steps: list[Step]) -> Table:
    """Scores with bars, and how far predictions of unseen data miss."""
    table = tables.steps([(s.label, s.score) for s in steps])
    at = [HORIZONS_S.index(horizon_s) for horizon_s in SHOWN_S]
    rows = [
        [*row, *(Cell(number(1000 * np.hypot(*step.rms[h, :2]))) for h in at)]
        for row, step in zip(table.rows, steps, strict=True)
    ]
    return Table(
        table.title,
        [*table.columns, *(f"{s:g} s\nmm" for s in SHOWN_S)],
        rows,
        table.note + " In mm: how far predictions of data not fitted to miss in position.",
    )


def _gain(steps: list[Step]) -> str:
    half_s = HORIZONS_S.index(0.5)
    first, last = (1000 * float(np.hypot(*s.rms[half_s, :2])) for s in (steps[0], steps[-1]))
    return (
        f"Half a second ahead, predictions of data not fitted to missed by {number(first)} mm "
        f"at first and miss by {number(last)} mm now."
    )


def _make_hidden_log(twin_run: str) -> None:
    """The twin with hidden effects plays steps and turns of many sizes."""
    nominal = ModelFile.load(NOMINAL).text
    (FOLDER / "hidden.toml").write_text(nominal + HIDDEN)
    rows, t_s = ["t_s,fl_pct,fr_pct,rl_pct,rr_pct"], 1.0
    for left, right in (
        (100, 100),
        (-100, -100),
        (80, 80),
        (-80, -80),
        (60, 60),
        (-60, -60),
        (45, 45),
        (-45, -45),
        (90, 50),
        (-90, -50),
        (50, 90),
        (-50, -90),
        (70, -70),
        (-70, 70),
    ):
        rows += [f"{t_s:g},{left},{right},{left},{right}", f"{t_s + 3:g},0,0,0,0"]
        t_s += 4.5
    (FOLDER / "script.csv").write_text(
        "\n".join([rows[0], "0,0,0,0,0", *rows[1:]]) + f"\n{t_s:g},0,0,0,0\n"
    )
    _shell(
        twin_run,
        "--plant",
        "planar",
        "--model",
        "demo/hidden.toml",
        "--n",
        "1",
        "--script",
        "demo/script.csv",
        "--log",
        LOG,
    )


def _say(text: str) -> None:
    Console().rule(f"[bold]{text}", align="left")


def _shell(*command: str) -> None:
    print(f"$ {shlex.join(command)}", flush=True)
    subprocess.run(command, check=True)


def _twinmill(*arguments: str) -> Any:
    print(f"$ twinmill {shlex.join(arguments)}", flush=True)
    return cli.run(list(arguments))


if __name__ == "__main__":
    try:
        typer.run(main)
    except (ValueError, OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"demo: {error}")
