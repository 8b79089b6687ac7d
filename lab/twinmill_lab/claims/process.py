# SPDX-License-Identifier: Apache-2.0
"""The paper's process, from robots to a swarm that does it: each step as it is typed.

The commands run in a folder of their own, and stand on the page with what they printed. The robots
are twins that coast longer than the model given knows; in the last step MuJoCo is the laboratory.
"""

import os
import shlex
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import tomlkit

from twinmill.experiment.rich_script import write_rich_script
from twinmill.model.model_file import ModelFile
from twinmill.programs import find_program
from twinmill.swarm.axes import Axis
from twinmill.swarm.forecast.plan import FORM, read_plan
from twinmill.swarm.request import run_part
from twinmill_lab.claims.rows import SIGMAS, Claim, Row

DRIVE_S, DECELERATION_MPS2 = 60.0, 0.6
COASTING = f'\n[[effect]]\nname = "coasting"\ndeceleration_mps2 = {DECELERATION_MPS2}\n'
GIVEN, TRUTH = "turbopi.toml", "truth.toml"
COLUMNS = "80"
LABORATORY_SEED = 1_000_000  # no run of the sweep or of the plan has had it, nor those after it
STEPS = {
    "1. Robots are measured": [
        "twinmill import --poses measured/pose.csv --commands measured/telemetry.csv -o run.lcmlog"
    ],
    "2. The simulation is made to agree with them": [
        f"twinmill compare run.lcmlog --model {GIVEN}",
        f"twinmill explain run.lcmlog --model {GIVEN} -o explained.toml",
    ],
    "3. What swarms of them do is looked for": [
        "twin_sweep --model explained.toml --x n=4:9:6 --y range_m=0.7,0.9,1.1 --seeds 20 "
        "--duration-s 60 --out sweep",
        "twinmill swarm phase sweep",
    ],
    "4. Robots do it, or not": [
        "twinmill lab predict sweep --cells 6 --repeats 2 --draws 20 -o plan",
        f"twinmill lab score plan plan/{FORM}",
    ],
}


def process(_seeds: int) -> Claim:
    """All steps, and whether they find what the robots have."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as name:
        folder = Path(name)
        _drive(folder)
        transcript = []
        for step, lines in STEPS.items():
            printed = []
            for line in lines:
                if FORM in line:
                    ran = _laboratory(folder)
                printed.append(f"$ {line}\n{_typed(line, folder)}")
            transcript.append((step, "\n".join(printed)))
        found = _found(folder / "explained.toml")
    return Claim(
        "process",
        "The four steps, as they are typed",
        "Robots are measured, a simulation is made of it, behaviours are looked for in that, and "
        "robots do them.",
        None,
        f"{sum(map(len, STEPS.values()))} commands. From a drive of {DRIVE_S:g} s the deceleration "
        f"of coasting robots is {_words(found)} ({DECELERATION_MPS2:g} is true); {ran} runs in "
        "MuJoCo, which stands for the laboratory, are set against what was said before.",
        [found],
        [],
        transcript,
    )


def _drive(folder: Path) -> None:
    """Measurements of a laboratory: poses and commands of one robot, as CSV."""
    (folder / TRUTH).write_text(ModelFile.load(GIVEN).text + COASTING)
    write_rich_script(folder / "drive.csv", DRIVE_S, 1)
    words = ["twin_run", "--plant", "planar", "--model", TRUTH, "--n", "1", "--script", "drive.csv"]
    _typed(shlex.join([*words, "--log", "drive.lcmlog"]), folder)
    _typed("twinmill export drive.lcmlog --to csv -o measured", folder)


def _laboratory(folder: Path) -> int:
    """Makes the runs of the plan with the true robots in MuJoCo, and writes down their classes."""
    plan, _ = read_plan(folder / "plan", None)
    seen = []
    for number, cell in enumerate(plan.order):
        point = zip(plan.names, plan.expected.points[cell], strict=True)
        request = replace(
            plan.request,
            model_text=(folder / TRUTH).read_text(),
            axes=[Axis(name, (float(value),)) for name, value in point],
            seeds=1,
            first_seed=LABORATORY_SEED + number,
            plant="mujoco",
        )
        seen.append(run_part(request, range(1))["class"][0])
    form = folder / "plan" / FORM
    table = pd.read_csv(form, dtype=str, keep_default_na=False)
    table.assign(**{"class": seen}).to_csv(form, index=False)
    return len(table)


def _typed(line: str, folder: Path) -> str:
    """Output of a command that is typed in the folder."""
    program, *words = shlex.split(line)
    own = [sys.executable, "-m", "twinmill_cli.main"]
    ended = subprocess.run(
        [*(own if program == "twinmill" else [str(find_program(program))]), *words],
        cwd=folder,
        env={**os.environ, "COLUMNS": COLUMNS},
        capture_output=True,
        text=True,
    )
    if ended.returncode:
        raise ValueError(f"{line}: {ended.stderr.strip() or ended.stdout.strip()}")
    return "\n".join(text.rstrip() for text in ended.stdout.splitlines())


def _words(found: Row) -> str:
    if np.isnan(found.value):
        return "not found"
    return f"{found.value:.2f} ({found.low:.2f} to {found.high:.2f}) m/s²"


def _found(model: Path) -> Row:
    """Coasting by the model that was made, and that of the robots."""
    effects = tomlkit.parse(model.read_text()).unwrap().get("effect", [])
    what, true = "deceleration of coasting robots", (DECELERATION_MPS2,) * 2
    for effect in effects:
        if effect["name"] == "coasting":
            value, std = effect["deceleration_mps2"], effect["std"]["deceleration_mps2"]
            off = (value - DECELERATION_MPS2) / std
            ends = value - 1.96 * std, value + 1.96 * std
            rule = f"{off:+.1f} standard deviations"
            return Row(what, value, *ends, true, abs(off) < SIGMAS, rule, "m/s²")
    return Row(what, float("nan"), float("nan"), float("nan"), true, False, "not found", "m/s²")
