# SPDX-License-Identifier: Apache-2.0
"""`twinmill challenge`: the blind test from end to end."""

import hashlib
import json
import shutil
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console, RenderableType
from rich.progress import track
from twinmill.calibration import show
from twinmill.calibration.diagnosis.diagnose import Diagnosis, diagnose
from twinmill.calibration.fit import fit
from twinmill.calibration.measurement import load_measurements
from twinmill.calibration.model_file import ModelFile
from twinmill.calibration.tables import Cell, Table
from twinmill.tools.challenge.cases import PLANTS, ROBOT, Case, draw, make_log, seal
from twinmill.tools.challenge.script import write_rich_script
from twinmill.tools.output import AsJson, deliver

BASE = "rough.toml"


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("challenge")(_challenge)


def _challenge(
    count: Annotated[int, typer.Option("--n", min=1, help="Cases.")] = 50,
    seed: Annotated[int, typer.Option(help="Same seed, same cases.")] = 1,
    duration_s: Annotated[float, typer.Option("--duration-s", min=30, help="Of each log.")] = 150,
    out: Annotated[Path, typer.Option("--out", help="Folder for logs and answers.")] = Path(
        "challenge"
    ),
    program: Annotated[
        Path | None, typer.Option("--twin-run", help="The twin; else searched on the path.")
    ] = None,
    as_json: AsJson = False,
) -> dict:
    """Draw effects at random, seal the answers, let the twin make logs, diagnose, unseal, score.

    Example: twinmill challenge --n 20 --out challenge
    """
    twin_run = program or _find_program()
    out.mkdir(parents=True, exist_ok=True)
    cases = [draw(number, seed) for number in range(count)]
    answers = seal(cases)
    console = Console(stderr=True)
    console.print(f"sealed answers: sha256 {hashlib.sha256(answers.encode()).hexdigest()}")
    script = out / "script.csv"
    write_rich_script(script, duration_s, seed)
    models = {plant: _calibrate(twin_run, out, plant, script) for plant in PLANTS}
    results = []
    for case in track(cases, "diagnosing", console=console, disable=not console.is_terminal):
        name = f"case{case.number:03d}"
        log = make_log(twin_run, out, name, case, script)
        barred = tuple(case.hidden) if case.kind == "outside" else ()
        started = time.monotonic()
        found = diagnose(load_measurements([log]), models[case.plant], barred=barred)
        results.append(_scored(case, found, time.monotonic() - started))
        (out / f"{name}.hidden.toml").unlink()
        log.unlink()
    (out / "answers.json").write_text(answers)
    (out / "results.json").write_text(json.dumps(results, indent=1))
    summary = {"seed": seed, "cases": results, **_summary(results)}
    deliver(summary, _shown(summary), as_json)
    return summary


def _find_program() -> Path:
    found = shutil.which("twin_run") or Path(__file__).resolve().parents[2] / "build/bin/twin_run"
    if not Path(found).exists():
        raise ValueError("twin_run: not found; build it, or name it with --twin-run.")
    return Path(found)


def _calibrate(program: Path, folder: Path, plant: str, script: Path) -> ModelFile:
    """The base model, fitted to a log of the same robot with nothing hidden."""
    rough = folder / BASE
    speeds = "wheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]"
    lines = [line for line in ROBOT.splitlines() if line.startswith(("[base]", "duty_pct"))]
    rough.write_text("\n".join([*lines, speeds]) + "\n")
    nothing = Case(9_999, plant, "none", "medium", {})
    log = make_log(program, folder, f"calibration_{plant}", nothing, script)
    fitted = folder / f"base_{plant}.toml"
    fit(load_measurements([log]), ModelFile.load(str(rough)), fitted, "twinmill challenge")
    log.unlink()
    return ModelFile.load(str(fitted))


def _scored(case: Case, found: Diagnosis, seconds: float) -> dict:
    """What was hidden, what was said, and whether that was right."""
    groups = {r.group for r in found.ranking if r.effect in found.found and r.group is not None}
    named = {r.effect for r in found.ranking if r.effect in found.found or r.group in groups}
    hidden = set(case.hidden)
    first = {r.effect for r in found.ranking[:1]} | {
        r.effect for r in found.ranking if r.group is not None and r.group == found.ranking[0].group
    }
    right = {
        "none": not found.found and found.verdict == "model_adequate",
        "one": bool(hidden & first) and bool(found.found),
        "two": hidden <= named,
        "outside": found.verdict == "outside_catalogue",
    }[case.kind]
    return {
        "case": case.number, "plant": case.plant, "kind": case.kind, "strength": case.strength,
        "hidden": sorted(hidden), "found": found.found, "verdict": found.verdict, "right": right,
        "score_before": found.score_refit, "score_after": found.steps[-1][1], "time_s": seconds,
    }  # fmt: skip


def _summary(results: list[dict]) -> dict:
    nothing = [r for r in results if r["kind"] == "none"]
    alarms = [r for r in nothing if r["found"] or r["verdict"] != "model_adequate"]
    confusion = Counter(
        (" + ".join(r["hidden"]) or "nothing", " + ".join(r["found"]) or r["verdict"])
        for r in results
    )
    power = {}
    for kind in dict.fromkeys(r["kind"] for r in results):
        for strength in dict.fromkeys(r["strength"] for r in results):
            own = [r for r in results if r["kind"] == kind and r["strength"] == strength]
            if own:
                power[f"{kind}, {strength}"] = [sum(r["right"] for r in own), len(own)]
    return {
        "false_alarms": [len(alarms), len(nothing)],
        "power": power,
        "confusion": [{"hidden": h, "said": s, "cases": n} for (h, s), n in confusion.items()],
        "time_s_mean": sum(r["time_s"] for r in results) / len(results),
    }


def _shown(summary: dict) -> RenderableType:
    rows = [
        [Cell(c["hidden"]), Cell(c["said"], "good" if c["hidden"] == c["said"] else ""),
         Cell(str(c["cases"]))]
        for c in sorted(summary["confusion"], key=lambda c: c["hidden"])
    ]  # fmt: skip
    alarms, nothing = summary["false_alarms"]
    power = "; ".join(
        f"{kind}: {right}/{total}" for kind, (right, total) in summary["power"].items()
    )
    note = (
        f"False alarms {alarms} of {nothing}. Right: {power}. "
        f"{summary['time_s_mean']:.1f} s per log."
    )
    return show.table(
        Table("Hidden, and what was said", ["hidden", "said", "cases"], rows, note, words=(0, 1))
    )
