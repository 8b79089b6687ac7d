# SPDX-License-Identifier: Apache-2.0
"""`twinmill lab challenge`: the blind test from end to end."""

from __future__ import annotations

import contextlib
import io
import json
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from twinmill_cli.exit_now import STOPPED
from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver, unstopped

if working():  # not for --help
    import hashlib
    import multiprocessing
    import shutil
    from concurrent.futures import ProcessPoolExecutor, as_completed

    import numpy as np
    from rich.console import Group
    from rich.text import Text

    import twinmill as tm
    from twinmill.files import alone_in, check_holds, check_report
    from twinmill.model.model_file import write_whole
    from twinmill.terminal import PlainConsole, progress_bar
    from twinmill.version import __version__
    from twinmill_cli.main import run
    from twinmill_lab.challenge import page
    from twinmill_lab.challenge.cases import Case, calibration, draw, draw_robots, make_log, seal
    from twinmill_lab.challenge.intervals import coverage, draw_known, errors
    from twinmill_lab.challenge.robots import Robot
    from twinmill_lab.challenge.run import play, write_log
    from twinmill_lab.challenge.scoring import scored, summary


DONE = "done"  # folder of the cases that are done, while others are not
WRITTEN = (  # in the folder of a challenge, whole or stopped half way
    *(DONE, "index.html", "answers.json", "results.json", "times.json", "intervals.json"),
    *("base_*.toml", "sheet_*.toml", "calibration_*.lcmlog", "case*.lcmlog", ".*"),
)


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("challenge")(_challenge)


def _challenge(
    *,
    count: Annotated[int, typer.Option("--n", min=1, help="Cases.")] = 60,
    seed: Annotated[int, typer.Option(help="Same seed, same cases.")] = 1,
    duration_s: Annotated[
        float,
        typer.Option("--duration-s", min=30, help="Mean length of a log; lengths differ by 30 %."),
    ] = 90,
    out: Annotated[Path, typer.Option("--out", help="Folder for answers and results.")] = Path(
        "challenge"
    ),
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cases at a time; as many as cores by default.")
    ] = None,
    intervals: Annotated[
        int | None,
        typer.Option(
            "--intervals",
            min=1,
            metavar="N",
            show_default=False,
            help="Instead of the tests: fit N drives with known parameters, and report how often "
            "each 95 % interval covers the truth.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> dict:
    """Blind tests: simulate robots with hidden effects, diagnose their logs, and score the answers.

    The robots move by formulas of their own, by forces in MuJoCo, and on wheels
    with free rollers; what is hidden is an effect of the catalogue, its cousin,
    two effects, something that no catalogue names, or nothing. Results go to the
    folder as results.json (the same bytes for the same seed), times.json and
    index.html. Stopped half way, the same command goes on where it was.

    Example: twinmill lab challenge --n 20 --out challenge
    """
    check_report(out)
    check_holds(out, WRITTEN)
    (out / DONE).mkdir(parents=True, exist_ok=True)
    workers = workers or os.cpu_count() or 1
    command = f"twinmill lab challenge --n {count} --seed {seed} --duration-s {duration_s:g}"
    how = {"seed": seed, "duration_s": duration_s, "workers": workers, "as_json": as_json}
    with alone_in(out):
        if intervals:
            return _intervals(out, intervals, command=f"{command} --intervals {intervals}", **how)
        return _exam(out, count, command=command, **how)


def _exam(
    out: Path,
    count: int,
    *,
    command: str,
    seed: int,
    duration_s: float,
    workers: int,
    as_json: bool,
) -> dict:
    """Draws cases, seals their answers, diagnoses their logs, and scores what was said."""
    robots = draw_robots(seed)
    cases = [draw(number, seed, robots, duration_s) for number in range(count)]
    answers = seal(cases)
    digest = hashlib.sha256(answers.encode()).hexdigest()
    PlainConsole(stderr=True).print(f"sealed answers: sha256 {digest}", soft_wrap=True)
    driven = sorted({case.robot for case in cases})
    how = {"seed": seed, "duration_s": duration_s}
    bases = {k: base_of(out, k, robots[k], **how) for k in driven}
    results, times_s = {}, {}
    for number, result, time_s in _all(bases, cases, workers):
        results[number], times_s[number] = result, time_s
    ordered = [results[case.number] for case in cases]
    found = {"command": command, "seed": seed, "duration_s": duration_s}
    found |= {**summary(ordered), "cases": ordered}
    write_whole(out / "answers.json", answers)
    write_whole(out / "results.json", json.dumps(found, indent=1))
    write_whole(out / "times.json", json.dumps([times_s[case.number] for case in cases]))
    report = page.write(out, found, list(times_s.values()))
    shutil.rmtree(out / DONE)
    shown = page.shown(found, list(times_s.values()))
    deliver(found, Group(shown, Text(f"Report: {report}")), as_json)
    return found


def base_of(folder: Path, number: int, robot: Robot, *, seed: int, duration_s: float) -> Path:
    """The model that a user of the robot has: its sheet, fitted to a log.

    Args:
        folder: where the model goes.
        number: of the robot.
        robot: who drives.
        seed: of the calibration log.
        duration_s: of that log.
    """
    log, sheet = folder / f"calibration_{number}.lcmlog", folder / f"sheet_{number}.toml"
    base = folder / f"base_{number}.toml"
    if base.exists():
        return base
    plan = calibration(robot, seed, duration_s)
    write_log(plan, play(plan, forces=True), log)
    write_whole(sheet, robot.sheet(np.random.default_rng([seed, 3, number])))
    with contextlib.redirect_stdout(io.StringIO()):
        code = run(["fit", str(log), "--model", str(sheet), "-o", str(base), "--json"])
    log.unlink()
    if code == STOPPED:
        base.unlink(missing_ok=True)
        raise KeyboardInterrupt
    return base


def diagnosed(base: Path, case: Case) -> tuple[dict, float]:
    """Makes the log of a case, diagnoses it, and only then looks at the answer.

    Args:
        base: model of the robot; the log is made beside it, and removed.
        case: sealed.

    Returns:
        The score of the case, and how many seconds the diagnosis took.
    """
    log = base.parent / f"case{case.number:03d}.lcmlog"
    make_log(case, log)
    started = time.monotonic()
    found = tm.diagnose(log, tm.Model.load(base)).to_json()
    time_s = time.monotonic() - started
    log.unlink()
    return scored(case, found), time_s


def _intervals(
    out: Path,
    count: int,
    *,
    command: str,
    seed: int,
    duration_s: float,
    workers: int,
    as_json: bool,
) -> dict:
    """Fits drives whose numbers are known, and counts how often intervals cover them."""
    calls = [(_fitted, out, number, seed, duration_s) for number in range(count)]
    rows = dict(_done(calls, "fitting", workers))
    found = {
        "command": command,
        "seed": seed,
        "duration_s": duration_s,
        "cases": count,
        "quantities": coverage([row for number in range(count) for row in rows[number]]),
    }
    write_whole(out / "intervals.json", json.dumps(found, indent=1))
    shutil.rmtree(out / DONE)
    deliver(found, page.intervals(found), as_json)
    return found


def _fitted(folder: Path, number: int, seed: int, duration_s: float) -> tuple[int, list[dict]]:
    """A drive's errors, or what a run that was stopped found for it."""
    known = draw_known(number, seed, duration_s)
    asked = [__version__, known.sheet, known.plan.seed, duration_s]
    name = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
    kept = folder / DONE / f"{name}.json"
    if kept.exists():
        return number, json.loads(kept.read_text())
    log, sheet = folder / DONE / f"{name}.lcmlog", folder / DONE / f"{name}.toml"
    write_log(known.plan, play(known.plan, known.hidden), log)
    write_whole(sheet, known.sheet)
    rows = errors(known, tm.fit(log, str(sheet)).to_json())
    log.unlink()
    write_whole(kept, json.dumps(rows))
    return number, rows


def _all(
    bases: dict[int, Path], cases: Sequence[Case], workers: int
) -> Iterator[tuple[int, dict, float]]:
    """Every case as it is done: number, result, time."""
    calls = [(_one, bases[case.robot], case) for case in cases]
    yield from _done(calls, "diagnosing", workers)


def _done(calls: Sequence[tuple], what: str, workers: int) -> Iterator:
    """Yields results of functions as each is done; shows progress and time left.

    Ctrl-C reaches all processes of a terminal. Workers do not hear it, from their start on: they
    are ended here, and what they had done before is kept.
    """
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"))
    with unstopped():
        waiting = [pool.submit(*call) for call in calls]
    try:
        with progress_bar() as progress:
            for done in progress.track(as_completed(waiting), len(calls), description=what):
                yield done.result()
    finally:
        if not all(future.done() for future in waiting):
            for worker in multiprocessing.active_children():
                worker.terminate()
        pool.shutdown(cancel_futures=True)


def _one(base: Path, case: Case) -> tuple[int, dict, float]:
    """A case, or what a challenge that was stopped found for the same case and base model."""
    asked = [__version__, case.to_json(), case.plan.seed, base.read_text()]
    name = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
    kept = base.parent / DONE / f"{name}.json"
    if kept.exists():
        return case.number, *json.loads(kept.read_text())
    result, time_s = diagnosed(base, case)
    write_whole(kept, json.dumps([result, time_s]))
    return case.number, result, time_s
