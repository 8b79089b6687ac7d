# SPDX-License-Identifier: Apache-2.0
"""`twinmill challenge`: the blind test from end to end."""

import hashlib
import json
import multiprocessing
import os
import shutil
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

from twinmill.challenge.cases import PLANTS, ROBOT, Case, draw, make_log, noise_seed_of, seal
from twinmill.challenge.scoring import scored, summary
from twinmill.challenge.script import write_rich_script
from twinmill.challenge.truth import truth
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.explain import explain
from twinmill.files import check_new_folder
from twinmill.fitting.fit import fit
from twinmill.model.freedom import effect_names
from twinmill.model.model_file import ModelFile, write_whole
from twinmill.programs import find_program
from twinmill.report import challenge as page
from twinmill_cli.output import AsJson, deliver

DONE = "done"  # folder of the cases that are done, while others are not
NOTHING = 9_999  # number of the logs with nothing hidden that the base models are fitted to


@dataclass(frozen=True)
class Setting:
    """What all cases share: the twin, the folder, the script, the base models by plant."""

    program: Path
    folder: Path
    script: Path
    bases: dict[str, Path]


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("challenge")(_challenge)


def _challenge(
    count: Annotated[int, typer.Option("--n", min=1, help="Cases.")] = 50,
    seed: Annotated[int, typer.Option(help="Same seed, same cases.")] = 1,
    duration_s: Annotated[float, typer.Option("--duration-s", min=30, help="Of each log.")] = 150,
    out: Annotated[Path, typer.Option("--out", help="Folder for answers and results.")] = Path(
        "challenge"
    ),
    program: Annotated[
        Path | None, typer.Option("--twin-run", help="The twin; else searched on the path.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cases at a time; as many as cores by default.")
    ] = None,
    as_json: AsJson = False,
) -> dict:
    """Draw effects at random, seal the answers, let the twin make logs, diagnose, unseal, score.

    Results go to the folder as results.json (the same bytes for the same seed), times.json and
    index.html. Stopped half way, the same command goes on where it was.

    Example: twinmill challenge --n 20 --out challenge
    """
    check_new_folder(out)
    twin_run = program or find_program("twin_run")
    (out / DONE).mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    script = out / "script.csv"
    write_rich_script(script, duration_s, seed)
    bases = {plant: _base(twin_run, out, plant, script, seed) for plant in PLANTS}
    setting = Setting(twin_run, out, script, bases)
    known = {p: effect_names(ModelFile.load(str(path)).model) for p, path in bases.items()}
    cases = [draw(number, seed, known) for number in range(count)]
    answers = seal(cases)
    console.print(f"sealed answers: sha256 {hashlib.sha256(answers.encode()).hexdigest()}")
    results, times_s = {}, {}
    for number, result, time_s in _all(setting, cases, workers or os.cpu_count() or 1, console):
        results[number], times_s[number] = result, time_s
    ordered = [results[case.number] for case in cases]
    found = {"seed": seed, "duration_s": duration_s, **summary(ordered), "cases": ordered}
    write_whole(out / "answers.json", answers)
    write_whole(out / "results.json", json.dumps(found, indent=1))
    write_whole(out / "times.json", json.dumps([times_s[case.number] for case in cases]))
    page.write(out, found, list(times_s.values()))
    shutil.rmtree(out / DONE)
    deliver(found, page.shown(found, list(times_s.values())), as_json)
    return found


def _base(program: Path, folder: Path, plant: str, script: Path, seed: int) -> Path:
    """A model of the robot with nothing hidden: fitted, and made adequate for that plant."""
    rough, fitted = folder / f"rough_{plant}.toml", folder / f"fitted_{plant}.toml"
    speeds = "wheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]"
    lines = [line for line in ROBOT.splitlines() if line.startswith(("[base]", "duty_pct"))]
    write_whole(rough, "\n".join([*lines, speeds]) + "\n")
    nothing = Case(NOTHING, noise_seed_of(NOTHING, seed), plant, "none", "medium")
    log = make_log(program, folder, f"calibration_{plant}", nothing, script)
    measured = load_measurements([log])
    fit(measured, ModelFile.load(str(rough)), fitted, "twinmill challenge")
    base = folder / f"base_{plant}.toml"
    explain(measured, ModelFile.load(str(fitted)), base, "twinmill challenge")
    for path in (log, rough, fitted):
        path.unlink()
    return base


def _all(
    setting: Setting, cases: list[Case], workers: int, console: Console
) -> Iterator[tuple[int, dict, float]]:
    """Every case as it is done: number, result, time; shows progress and the time left."""
    columns = (*Progress.get_default_columns()[:-1], MofNCompleteColumn(), TimeRemainingColumn())
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))
    with (
        Progress(*columns, console=console, disable=not console.is_terminal) as progress,
        pool as running,
    ):
        waiting = [running.submit(_one, setting, case) for case in cases]
        for done in progress.track(as_completed(waiting), len(cases), description="diagnosing"):
            yield done.result()


def _one(setting: Setting, case: Case) -> tuple[int, dict, float]:
    """Makes the log of a case, diagnoses it, and only then looks at the answer.

    Or takes what a challenge that was stopped found for the same case, base model and script.
    """
    base_path = setting.bases[case.plant]
    asked = [version("twinmill"), asdict(case), base_path.read_text(), setting.script.read_text()]
    name = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
    kept = setting.folder / DONE / f"{name}.json"
    if kept.exists():
        return case.number, *json.loads(kept.read_text())
    log = make_log(setting.program, setting.folder, f"case{case.number:03d}", case, setting.script)
    base = ModelFile.load(str(base_path))
    started = time.monotonic()
    found = diagnose(load_measurements([log]), base, barred=case.withheld)
    time_s = time.monotonic() - started
    log.unlink()
    result = scored(case, found, truth(found.state, base, case.hidden))
    write_whole(kept, json.dumps([result, time_s]))
    return case.number, result, time_s
