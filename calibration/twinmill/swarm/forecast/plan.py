# SPDX-License-Identifier: Apache-2.0
"""The laboratory's plan, and the sealed file of probabilities that goes with it."""

import csv
import gzip
import hashlib
import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.counted import counted
from twinmill.data.log import read_log
from twinmill.data.unpacking import Gunzip, unpack
from twinmill.files import replacing
from twinmill.model.model_file import write_whole
from twinmill.swarm.forecast.draws import OUTCOMES, Forecast
from twinmill.swarm.metrics import swarm_metrics
from twinmill.swarm.request import Request

SEALED, PLAN, FORM, STARTS, MODEL = (
    "probabilities.sealed",
    "plan.md",
    "outcomes.csv",
    "starts.csv",
    "model.toml",
)
DIGITS = 6
SHORT_S = 1.0  # that a log of a whole run may lack
CLASSES = """\
| class | mean over the last 10 s |
|---|---|
| milling | circliness below 0.2, turning together (rotation beyond 0.9), bodies apart |
| jammed | circliness below 0.2, but not so |
| ellipsoidal | circliness 0.2 to 1 |
| cluster | circliness above 1, all in one group (closer than the view range) |
| separated | circliness above 1, several groups |
"""


@dataclass(frozen=True)
class Plan:
    """Cells to predict, and the runs that it takes.

    Attributes:
        request: of the sweep.
        cells: numbers of the chosen cells in the sweep.
        expected: of the chosen cells.
        bits: information of the outcomes of all cells up to each.
        repeats: runs of each cell.
        order: (R,) place in `cells` of each run, as they are to be made.
        seed: of the order and the starts.
    """

    request: Request
    cells: list[int]
    expected: Forecast
    bits: list[float]
    repeats: int
    order: list[int]
    seed: int

    @property
    def names(self) -> list[str]:
        """Names of the axes, in the order of the columns."""
        return [axis.name for axis in self.request.axes]

    def to_bytes(self) -> bytes:
        """The sealed file: the same plan gives the same bytes."""
        data = {
            "request": json.loads(self.request.to_json()),
            "cells": self.cells,
            "outcomes": OUTCOMES,
            "points": self.expected.points.tolist(),
            "swept": self.expected.swept.round(DIGITS).tolist(),
            "draws": self.expected.draws.round(DIGITS).tolist(),
            "bits": self.bits,
            "repeats": self.repeats,
            "order": self.order,
            "seed": self.seed,
        }
        text = json.dumps(data, sort_keys=True, allow_nan=False)
        return gzip.compress(text.encode(), mtime=0)

    @classmethod
    def from_bytes(cls, sealed: bytes) -> "Plan":
        """The inverse.

        Raises:
            ValueError: it is no sealed file, as the end of a sentence.
        """
        try:
            data = json.loads(unpack(Gunzip, sealed))
            points, swept, draws = (np.array(data[k]) for k in ("points", "swept", "draws"))
            request = Request.from_json(json.dumps(data["request"]))
            rest = {k: data[k] for k in ("cells", "bits", "repeats", "order", "seed")}
        except (OSError, EOFError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise ValueError("is no file of sealed probabilities, or not a whole one.") from error
        return cls(request=request, expected=Forecast(points, swept, draws), **rest)


def in_random_order(cells: int, repeats: int, seed: int) -> list[int]:
    """Cells of all runs: what drifts from run to run falls on all cells alike."""
    return np.random.default_rng(seed).permutation(np.repeat(np.arange(cells), repeats)).tolist()


def write_plan(plan: Plan, folder: Path) -> str:
    """Writes all files of a plan.

    Returns:
        SHA-256 of the sealed one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    sealed = plan.to_bytes()
    digest = hashlib.sha256(sealed).hexdigest()
    with replacing(folder / SEALED, force=None) as fresh:
        fresh.write_bytes(sealed)
    write_whole(folder / MODEL, plan.request.model_text)
    write_whole(folder / STARTS, _starts(plan))
    write_whole(folder / FORM, _form(plan))
    write_whole(folder / PLAN, _text(plan, digest, folder))
    return digest


def read_plan(folder: Path, digest: str | None) -> tuple[Plan, str]:
    """The plan, if its sealed file is the one that was sealed.

    Args:
        folder: of the plan.
        digest: SHA-256 as it was published; None: as plan.md has it.

    Returns:
        The plan and the hash of its file.

    Raises:
        ValueError: it is another, or none.
    """
    path = folder / SEALED
    if not path.exists():
        raise ValueError(f"{folder}: holds no {SEALED}; make a plan with twinmill lab predict.")
    sealed = path.read_bytes()
    found = hashlib.sha256(sealed).hexdigest()
    text = (folder / PLAN).read_text() if (folder / PLAN).exists() else ""
    if digest not in (None, found) or (digest is None and found not in text):
        said = f"the one in {folder / PLAN}" if digest is None else f"'{digest}'"
        raise ValueError(
            f"{path}: its SHA-256 is {found}, not {said}: the probabilities were changed after "
            "they were sealed, or belong to another plan; nothing is scored."
        )
    try:
        return Plan.from_bytes(sealed), found
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def read_outcomes(path: Path, plan: Plan) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Outcomes of runs, as classes or as logs.

    Returns:
        (R,) cells, (R,) places in OUTCOMES, and numbers of runs that have no outcome.

    Raises:
        ValueError: in one sentence, with the line.
    """
    seen: dict[int, int] = {}
    logs: dict[Path, int] = {}
    for line, row in _rows(path):
        try:
            number = _run_number(row["run"], plan, seen)
            _check_cell(row, plan, plan.order[number - 1])
            _check_log_is_new(row, path, number, logs)
            if (ended := _outcome(row, path, plan, plan.order[number - 1])) is not None:
                seen[number] = ended
        except ValueError as error:
            raise ValueError(f"{path}, line {line}: {error}") from None
    if not seen:
        raise ValueError(
            f"{path}: no run has a class or a log; write one of them into the row of each run that "
            "was made."
        )
    missing = [k for k in range(1, len(plan.order) + 1) if k not in seen]
    numbers = sorted(seen)
    cells = np.array([plan.order[k - 1] for k in numbers])
    return cells, np.array([seen[k] for k in numbers]), missing


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Rows of a filled form, each with its line."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            names = list(reader.fieldnames or [])
            rows = [(reader.line_num, row) for row in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: is no CSV file in UTF-8 ({error}); fill in {FORM}.") from error
    if "run" not in names or not {"class", "log"} & set(names):
        raise ValueError(
            f"{path}: has no column 'run', or neither 'class' nor 'log'; fill in {FORM}."
        )
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"{path}: has more than one column '{twice[0]}'; leave one.")
    return rows


def _run_number(text: str | None, plan: Plan, seen: dict[int, int]) -> int:
    most = len(plan.order)
    if not (text or "").strip().isdecimal() or not 1 <= int(text or "") <= most:
        raise ValueError(f"run '{text}' is not one of the plan's, 1 to {most}.")
    if int(text or "") in seen:
        raise ValueError(f"run {text} is there twice.")
    return int(text or "")


def _check_cell(row: dict[str, str], plan: Plan, cell: int) -> None:
    """Axis values that stand in the row are the plan's, to the digits of the form."""
    for name, value in zip(plan.names, plan.expected.points[cell], strict=True):
        text = (row.get(name) or "").strip()
        try:
            right = not text or np.isclose(float(text), value, rtol=1e-4, atol=1e-9)
        except ValueError:
            right = False
        if not right:
            raise ValueError(
                f"{name} is '{text}', but the plan's run {row['run']} has {value:g}; score the run "
                "under its own number, or leave the plan's columns as they are."
            )


def _check_log_is_new(row: dict[str, str], path: Path, number: int, logs: dict[Path, int]) -> None:
    """Each run has a log of its own."""
    log = (row.get("log") or "").strip()
    if not log:
        return
    first = logs.setdefault((path.parent / log).resolve(), number)
    if first != number:
        raise ValueError(f"log '{log}' is that of run {first} already; give run {number}'s own.")


def _outcome(row: dict[str, str], path: Path, plan: Plan, cell: int) -> int | None:
    name, log = (row.get("class") or "").strip(), (row.get("log") or "").strip()
    if log:
        place = path.parent / log
        if not place.exists():
            raise ValueError(f"log '{log}' is not there: {place.resolve()} does not exist.")
        ended = _class_of_log(place, log, plan, tuple(plan.expected.points[cell]))
        if name and name != ended:
            raise ValueError(f"class is '{name}', but the log '{log}' ended '{ended}'; keep one.")
        name = ended
    if not name:
        return None
    if name not in OUTCOMES:
        raise ValueError(f"'{name}' is no class; the classes are {', '.join(OUTCOMES)}.")
    return OUTCOMES.index(name)


def _class_of_log(place: Path, log: str, plan: Plan, point: tuple[float, ...]) -> str:
    """The class of a log that may be the run: as many robots, and as long."""
    model = plan.request.cell_model(point)
    scale = model.get("sensor.range_m"), model.get("robot.body_radius_m")
    found = swarm_metrics(read_log(place), *scale)
    wanted = plan.request.robots(point)
    if len(found.robots) != wanted:
        raise ValueError(
            f"log '{log}' has {counted(len(found.robots), 'robot')}, but the plan's run has "
            f"{wanted}; give the log of that run."
        )
    seconds = float(found.t_s[-1] - found.t_s[0])
    if seconds < plan.request.duration_s - SHORT_S:
        raise ValueError(
            f"log '{log}' sees all robots for {seconds:.1f} s, but the plan's runs last "
            f"{plan.request.duration_s:g} s; make the run again, or leave it without a log."
        )
    return found.final


def _form(plan: Plan) -> str:
    """To be filled in."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["run", *plan.names, "class", "log", "note"])
    for number, cell in enumerate(plan.order, 1):
        point = [f"{value:g}" for value in plan.expected.points[cell]]
        writer.writerow([number, *point, "", "", ""])
    return text.getvalue()


def _starts(plan: Plan) -> str:
    """Where each robot is put in each run: drawn as the sweep draws them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["run", "robot", "x_m", "y_m", "heading_deg"])
    for number, cell in enumerate(plan.order, 1):
        swarm = plan.request.cell(tuple(plan.expected.points[cell]))
        poses = native.trace_world(swarm, plan.seed + number, swarm.period_s, 1.0)[0]
        for robot, (x_m, y_m, theta_rad) in enumerate(poses):
            degrees = np.degrees(theta_rad)
            writer.writerow([number, robot, f"{x_m:.3f}", f"{y_m:.3f}", f"{degrees:.0f}"])
    return text.getvalue()


def _text(plan: Plan, digest: str, folder: Path) -> str:
    """plan.md: the runs in the order to make them, and what to do; no prediction is in it."""
    request = plan.request
    runs = "\n".join(
        f"| {number} | {' | '.join(f'{v:g}' for v in plan.expected.points[cell])} |"
        for number, cell in enumerate(plan.order, 1)
    )
    labels = " | ".join(axis.label for axis in request.axes)
    return f"""\
# Plan of {len(plan.order)} runs

What {request.behavior} does in {len(plan.cells)} cells of a sweep was predicted before any of these
runs: the probability of each class, in `{SEALED}`. Its SHA-256 is

    {digest}

Publish that line first, where it keeps a date: in a repository, or by mail to somebody. Do not open
the file before all runs are made. Nothing in this plan says what is expected.

## Runs

In this order, which is random, so that the battery, the floor and the day fall on all cells alike.

| run | {labels} |
|---|{"---|" * len(plan.names)}
{runs}

- **Start**: put each robot as `{STARTS}` says, to 5 cm and 10 degrees: x, y in m from the middle of
  the arena, heading in degrees counter-clockwise from x. They were drawn as the sweep draws its own
  ({request.start}, {request.spread_m:g} m).
- **Go**: all robots at one instant, {_go(request.behavior)}, {request.duration_s:g} s long.
- **Record**: poses of all robots by motion capture, 20 a second or more, from before the start to
  the end; battery voltage before the run; in `note` whatever was unusual.
- **Again**: a run in which a robot fails, is touched by a person, or is lost by motion capture for
  more than a second in the last 10 s is made again from the same start. Say so in `note`. No other
  run is made again or left out.

## The class of a run

`twinmill lab score` tells it from the log, with the view range of the run's cell:

{CLASSES}
## Afterwards

Write into `{FORM}` for each run its class, or the path of its log. Then:

    twinmill lab score {folder} {folder / FORM} --sha256 {digest}
"""


def _go(behavior: str) -> str:
    if ":" in behavior:
        return f"robots and tables as `{behavior}` has them"
    return f"`twinmill swarm start --behavior {behavior}`"
