# SPDX-License-Identifier: Apache-2.0
"""`make rivals`: all rivals on the same sealed cases; a table, results.json and index.html.

Stopped half way, the same command goes on where it was: an answer is kept until what gave it
changes, be that the case, the base model, or a file of the library or of the rivals.
"""

import argparse
import hashlib
import json
import os
import sys
import time
from pathlib import Path

import sysid_fit
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

import twinmill
import twinmill_lab
from rivals import (
    exam,
    lisdd,
    mujoco_sysid,
    page,
    protocol,
    recordings,
    residual,
    scoring,
    sindy,
    stepwise,
    trees,
    twinmill_diagnosis,
)
from rivals.protocol import DOCUMENTED, Answer, Problem, Rival, predicted_by
from rivals.scoring import judged, middle, row
from twinmill.files import check_new_folder
from twinmill.model.model_file import write_whole
from twinmill_lab.challenge.cases import CASES, Case, draw, draw_robots, make_log, seal
from twinmill_lab.challenge.command import base_of

RESERVED = {1, *range(100, 121), *range(901, 921)}  # seeds on which Twinmill was developed


# What predictions are worth without any diagnosis.
UNCHANGED = Rival(
    "the base model",
    "as its owner has it",
    {DOCUMENTED: "predicts, and says nothing"},
    lambda problem: {DOCUMENTED: Answer(False, 0.0, predicted_by(problem.model))},
    dict.fromkeys(("told", "alarm", "name", "depends", "wrong"), "it is only a model"),
)
MODULES = (twinmill_diagnosis, mujoco_sysid, sindy, trees, stepwise, lisdd)
RIVALS = (*(module.RIVAL for module in MODULES), UNCHANGED)


def _texts(*files: Path) -> str:
    return "".join(path.read_text() for path in files)


# What answers come of, as it was when this began.
SHARED = _texts(
    *(Path(m.__file__) for m in (exam, protocol, residual, scoring)),
    *(f for p in (twinmill, twinmill_lab) for f in sorted(Path(p.__file__).parent.rglob("*.py"))),
)
OWN = {m.RIVAL.name: _texts(Path(m.__file__)) for m in MODULES} | {UNCHANGED.name: ""}
OWN[mujoco_sysid.RIVAL.name] += _texts(Path(sysid_fit.__file__))


def main() -> int:
    """Runs what is not done yet, and shows all."""
    asked = _asked()
    console = Console(stderr=True)
    check_new_folder(asked.out)
    (asked.out / "done").mkdir(parents=True, exist_ok=True)
    robots = draw_robots(asked.seed)
    wanted = [n for n in range(asked.n) if CASES[n % len(CASES)] in asked.kinds]
    cases = [draw(n, asked.seed, robots, asked.duration_s) for n in wanted]
    answers = seal(cases)
    console.print(f"sealed answers: sha256 {hashlib.sha256(answers.encode()).hexdigest()}")
    results = []
    columns = (*Progress.get_default_columns()[:-1], MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        for case in progress.track(cases, description="cases"):
            robot = robots[case.robot]
            base = base_of(
                asked.out, case.robot, robot, seed=asked.seed, duration_s=asked.duration_s
            )
            results.append(_case(asked.out, base, case, asked.seed))
            if not console.is_terminal:
                console.print(f"case {case.number + 1} of {asked.n}")
    write_whole(asked.out / "answers.json", answers)
    real = _recordings(asked.out, console) if asked.real else []
    found = _found(asked, results, real)
    times_s = {name: [c["times_s"][name] for c in results] for name in results[0]["times_s"]}
    timed = {name: middle(own) for name, own in times_s.items()}
    write_whole(asked.out / "results.json", json.dumps(found, indent=1))
    write_whole(asked.out / "times.json", json.dumps(timed, indent=1))
    page.write(asked.out, found, timed)
    if asked.json:
        print(json.dumps(found | {"times_s": timed}, indent=1))
    else:
        Console().print(page.shown(found, timed))
    return 0


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make rivals", description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=60, help="cases")
    parser.add_argument("--seed", type=int, default=2026, help="same seed, same cases")
    parser.add_argument("--duration-s", type=float, default=90, help="of a log; differs by 30 %%")
    parser.add_argument("--out", type=Path, default=Path("build/rivals"), help="folder")
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=sorted({*CASES}),
        default=sorted({*CASES}),
        help="of the cases, only those where this is hidden",
    )
    parser.add_argument("--json", action="store_true", help="prints results as JSON")
    parser.add_argument(
        "--real", action=argparse.BooleanOptionalAction, default=True, help="recordings, too"
    )
    asked = parser.parse_args()
    if asked.n < 1 or asked.duration_s < 30:
        parser.error(f"--n {asked.n} and --duration-s {asked.duration_s:g}: at least 1 and 30")
    if asked.n <= min(CASES.index(kind) for kind in asked.kinds):
        parser.error(f"--n {asked.n}: has no case of --kinds {' '.join(asked.kinds)}; take more")
    if asked.seed in RESERVED:
        parser.error(f"--seed {asked.seed}: Twinmill was developed on it; take another")
    return asked


def _case(out: Path, base: Path, case: Case, seed: int) -> dict:
    """All rivals' answers to a case."""
    folder = out / "logs" / f"{case.number:03d}"
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "log.lcmlog"
    parts = [case.to_json(), case.plan.seed, seed, base.read_text()]
    kept = {rival.name: _kept(out, rival, parts) for rival in RIVALS}
    if not all(path.exists() for path in kept.values()):
        if not log.exists():
            partly = log.with_suffix(f".{os.getpid()}")
            make_log(case, partly)
            partly.rename(log)
        unseen = exam.unseen(case, seed, folder)
        for rival in RIVALS:
            if not kept[rival.name].exists():
                problem = Problem(log, base)
                _ = problem.measurement, problem.model
                started_s = time.process_time()
                answers = rival.answers(problem)
                time_s = time.process_time() - started_s
                said = {s: judged(case, a, unseen) for s, a in answers.items()}
                write_whole(kept[rival.name], json.dumps([said, time_s]))
    result = case.to_json() | {"rivals": {}, "times_s": {}}
    for rival in RIVALS:
        said, time_s = json.loads(kept[rival.name].read_text())
        result["rivals"][rival.name] = said
        result["times_s"][rival.name] = time_s / (1 if rival.once else len(said))
    return result


def _recordings(out: Path, console: Console) -> list[dict]:
    """Answers of each rival for each recording; none, with the reason, where none are there."""
    rows = []
    try:
        for recording in recordings.recordings(out / "recordings"):
            for rival in RIVALS[:-1]:
                kept = _kept(out, rival, [recording.name, recording.problem.base.read_text()])
                if not kept.exists():
                    answers = rival.answers(recording.problem)
                    told = {s: recordings.told(recording, a) for s, a in answers.items()}
                    write_whole(kept, json.dumps(told))
                rows += [
                    {
                        "log": recording.name,
                        "missing": recording.effect,
                        "rival": rival.name,
                        "setting": setting,
                        "said": words,
                        "right": right,
                    }
                    for setting, (words, right) in json.loads(kept.read_text()).items()
                ]
            console.print(recording.name)
    except FileNotFoundError as error:
        console.print(f"recordings are left out: {error}")
    return rows


def _kept(out: Path, rival: Rival, parts: list) -> Path:
    """Where an answer is kept: by all that it came of."""
    asked = [*parts, rival.name, OWN[rival.name], SHARED]
    name = hashlib.sha256(json.dumps(asked).encode()).hexdigest()
    return out / "done" / f"{name}.json"


def _found(asked: argparse.Namespace, results: list[dict], real: list[dict]) -> dict:
    """JSON output: rows of the table, then every case; equal seeds give equal bytes."""
    rows = [
        {
            "rival": rival.name,
            "setting": setting,
            "source": rival.source,
            "how": rival.settings[setting],
            "lacks": dict(rival.lacks),
            **row({"kind": c["kind"], **c["rivals"][rival.name][setting]} for c in results),
        }
        for rival in RIVALS
        for setting in rival.settings
    ]
    cases = [{k: v for k, v in c.items() if k != "times_s"} for c in results]
    return {
        "seed": asked.seed,
        "duration_s": asked.duration_s,
        "kinds": asked.kinds,
        "rows": rows,
        "recordings": real,
        "cases": cases,
    }


if __name__ == "__main__":
    sys.exit(main())
