# SPDX-License-Identifier: Apache-2.0
"""Cost against fidelity: what each thing that is added to a model costs and buys.

The true robot is a twin of the published measurements. From its data sheet on, one thing is added
after the other: numbers and effects by fits to one drive, the camera's errors and the differences
of robots as they were measured. Its cost is in numbers that somebody must measure. Each is judged
on the half that it was not fitted to, and by swarms.
"""

import subprocess
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from twinmill.data.measurement import load_measurements
from twinmill.fitting.add import add
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile
from twinmill.programs import find_program
from twinmill.report import Figure
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw
from twinmill.swarm.model_text import with_values
from twinmill.swarm.request import Request, run_part
from twinmill.swarm.sweep import make_request
from twinmill_lab.claims.rows import Claim, Row, mean

COASTING = '\n[[effect]]\nname = "coasting"\ndeceleration_mps2 = 1.5\n'
DRIVE_S, SWARM_S, SEEDS = 60.0, 60.0, 24
BEHAVIORS, ROBOTS = ("milling", "milling_cmaes"), "n=4:9:6"
EFFECTS = ("speed_curve", "lag_by_duty")
COMMAND = "twinmill lab claims"
# What no drive of one robot tells, as the true model has it.
CAMERA = {"sensor.false_negative_rate": 0.04, "sensor.false_positive_rate": 0.10}
DIFFERENCES = {"idiosyncrasy.theta_a1_std": 0.04, "idiosyncrasy.theta_a2_std": 0.04}


@dataclass(frozen=True)
class Level:
    """A model on the way.

    Attributes:
        added: what it has that the one before lacks.
        numbers: of it that were measured.
        score: of predictions on the half of the drive that was not fitted, over their floor.
        alike: (cells,) how far shares of classes agree with the true robots', 1 is wholly.
    """

    added: str
    numbers: int
    score: float
    alike: np.ndarray


def fidelity(_seeds: int) -> Claim:
    """All levels, and how far the true robots agree with themselves."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as name:
        levels, again = _levels(Path(name))
    rows = [row for k, level in enumerate(levels) for row in _rows(k, level)]
    rows.append(mean("classes alike, true robots with other seeds", again, None))
    first, last = levels[0], levels[-1]
    return Claim(
        "fidelity",
        "Cost against fidelity of models",
        "A model of more detail costs more; it comes nearer to one robot; and what swarms do may "
        "be told by one that is far from it.",
        None,
        f"Three curves. Cost: from the data sheet on, {len(levels) - 1} things are added, which "
        f"are {last.numbers} numbers to measure. One robot: the error on the half of a drive that "
        f"was not fitted falls from {first.score:.1f} to {last.score:.1f} times its floor. Swarms: "
        f"what they do agrees by {_percent(first.alike)} at first and by {_percent(last.alike)} at "
        f"the end, where true robots agree with themselves by {_percent(again)}. The last two "
        "things, the camera's errors and how robots differ, no drive of one robot shows: they "
        f"leave its error as it is, and take the swarms from {_percent(levels[-3].alike)} to "
        f"{_percent(last.alike)}.",
        rows,
        [_figure(levels, again)],
    )


def _levels(folder: Path) -> tuple[list[Level], np.ndarray]:
    truth = folder / "truth.toml"
    truth.write_text(ModelFile.load("turbopi.toml").text + COASTING)
    true_shares, again = (_shares(truth, first_seed) for first_seed in (1, 100_001))
    file = ModelFile.load("turbopi_nominal.toml")
    drive = load_measurements([_drive(folder, truth)], file.model)
    levels: list[Level] = []

    def judge(added: str, more: int, score: float) -> None:
        path = folder / f"level{len(levels)}.toml"
        path.write_text(file.text)
        numbers = more + (levels[-1].numbers if levels else 0)
        levels.append(Level(added, numbers, score, _alike(_shares(path, 1), true_shares)))

    added = add(EFFECTS[0], drive, file, out=folder / "first.toml", command=COMMAND)
    judge("data sheet", 0, added.heldout_before.score)
    base = fit(drive, file, folder / "fitted.toml", COMMAND)
    file = ModelFile.load(str(folder / "fitted.toml"))
    judge("numbers fitted", len(base.parameters), added.heldout_refit.score)
    for effect in EFFECTS:
        added = add(effect, drive, file, out=folder / f"{effect}.toml", command=COMMAND)
        file = ModelFile.load(str(folder / f"{effect}.toml"))
        own = sum(p.name.startswith(f"{effect}.") for p in added.parameters)
        judge(effect, own, added.heldout_after.score)
    for words, values in (("camera's errors", CAMERA), ("robots differ", DIFFERENCES)):
        path = folder / "measured.toml"
        path.write_text(with_values(file.text, file.model, values))
        file = ModelFile.load(str(path))
        judge(words, len(values), added.heldout_after.score)
    return levels, _alike(again, true_shares)


def _drive(folder: Path, model: Path) -> Path:
    """A log of one robot that plays straights, arcs and spins at random."""
    random, t_s = np.random.default_rng(1), 0.0
    lines = ["t_s,fl_pct,fr_pct,rl_pct,rr_pct"]
    while t_s < DRIVE_S:
        left, right = random.choice([-100, -80, -60, -45, 45, 60, 80, 100], 2)
        right = random.choice([left, -left, right, right])
        for duty, hold_s in (
            ((left, right), random.uniform(0.6, 1.4)),
            ((0, 0), random.uniform(0.3, 0.7)),
        ):
            lines.append(f"{t_s:.2f},{duty[0]},{duty[1]},{duty[0]},{duty[1]}")
            t_s += hold_s
    script, log = folder / "drive.csv", folder / "drive.lcmlog"
    script.write_text("\n".join([*lines, f"{t_s:.2f},0,0,0,0", ""]))
    words = [find_program("twin_run"), "--plant", "planar", "--model", model, "--n", 1]
    words += ["--duration-s", DRIVE_S + 2, "--script", script, "--log", log]
    subprocess.run([str(word) for word in words], check=True, capture_output=True)
    return log


def _shares(model: Path, first_seed: int) -> list[Counter]:
    """Runs of each class, by behaviour and number of robots."""
    found = []
    for behavior in BEHAVIORS:
        request: Request = make_request(
            behavior, str(model), [ROBOTS], seeds=SEEDS, duration_s=SWARM_S, full=True
        )
        request = replace(request, first_seed=first_seed)
        ended = run_part(request, range(request.world_count))["class"]
        found += [Counter(ended[k : k + SEEDS]) for k in range(0, len(ended), SEEDS)]
    return found


def _alike(shares: list[Counter], truth: list[Counter]) -> np.ndarray:
    """(cells,) what two distributions have in common: 1 less their total variation."""
    return np.array([(a & b).total() / SEEDS for a, b in zip(shares, truth, strict=True)])


def _rows(k: int, level: Level) -> list[Row]:
    what = f"{k}: {level.added}"
    cost = Row(f"numbers measured, {what}", *[level.numbers] * 3, None, None)
    error = Row(f"error over its floor, {what}", *[level.score] * 3, None, None)
    return [cost, error, mean(f"classes alike, {what}", level.alike, None)]


def _percent(alike: np.ndarray) -> str:
    return f"{100 * alike.mean():.0f} %"


def _figure(levels: list[Level], again: np.ndarray) -> Figure:
    at = np.arange(len(levels))

    def paint(panels: list[Axes]) -> None:
        cost, error, alike = panels
        cost.plot(at, [level.numbers for level in levels], "o-", ms=4, color=MEASURED)
        cost.set(ylabel="numbers measured", ylim=(0, None))
        error.plot(at, [level.score for level in levels], "o-", ms=4, color=PREDICTED)
        error.axhline(1, color=MEASURED, lw=0.8, ls="--")
        error.set(ylabel="error over its floor", yscale="log", xticks=at, xticklabels=[])
        means = [level.alike.mean() for level in levels]
        ends = [1.96 * level.alike.std(ddof=1) / np.sqrt(level.alike.size) for level in levels]
        alike.errorbar(at, means, ends, fmt="o-", ms=4, color=FLOOR)
        alike.axhline(again.mean(), color=MEASURED, lw=0.8, ls="--")
        alike.set(ylabel="classes alike", ylim=(0, 1.02), xticks=at)
        alike.set_xticklabels([level.added for level in levels], rotation=30, ha="right")

    return Figure(
        draw(5.6, paint, nrows=3, sharex=True),
        "Cost, error and agreement against what was added",
        "Above: numbers that somebody must measure. In the middle: predictions on the half that "
        "was not fitted; dashed is the log's own floor. Below: how far shares of classes agree "
        f"with the true robots', mean over {len(again)} sorts of swarm of {SEEDS} runs, with its "
        "95 % interval; dashed is how far true robots agree with themselves.",
    )
