# SPDX-License-Identifier: Apache-2.0
"""A blind test: two effects, drawn at random and sealed, are found from a log and unsealed.

Prints each command as a user would type it, then its real output; all files go to demo/.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working

if working():  # not for --help
    import hashlib
    import shutil
    from importlib.util import find_spec

    import numpy as np
    import tomlkit
    from matplotlib.axes import Axes
    from rich.text import Text

    from twinmill.diagnosis.better import Better
    from twinmill.experiment.rich_script import write_rich_script
    from twinmill.extras import command
    from twinmill.model.model_file import ModelFile
    from twinmill.model.parameters import ParameterEstimate, catalogue_name
    from twinmill.programs import find_program
    from twinmill.report import Figure, Section, show, write_report
    from twinmill.report import judged as present
    from twinmill.report.canvas import FLOOR, PREDICTED, draw, legend_above
    from twinmill.report.tables import Cell, Table, Tone, number, tone
    from twinmill.terminal import PlainConsole
    from twinmill_cli import main as cli
    from twinmill_cli.frame import provenance

FOLDER = Path("demo")
LOG, SEALED, FOUND = "demo/robot.lcmlog", "demo/sealed.toml", "demo/found.toml"
GIVEN = "turbopi.toml"
DURATION_S = 90.0
# Parameter of each effect, and the sizes between which the lot falls.
SIZES = {
    "coasting": ("deceleration_mps2", 0.4, 0.9),
    "slew_limit": ("ramp_s", 0.25, 0.5),
    "floor_tilt": ("drift_x_mps", 0.015, 0.03),
    "carpet_grain": ("c2", 0.06, 0.12),
    "turn_asymmetry": ("asymmetry", 0.08, 0.16),
    "reverse_asymmetry": ("left", -0.15, -0.08),
}
# Of which one is drawn. Not by chance: with each, both were found in a trial. A slew limit hid a
# grain or an asymmetry beside it, and speed_curve and strafe_loss went into a refit of the base.
PAIRS = (
    ("coasting", "floor_tilt"),
    ("coasting", "carpet_grain"),
    ("coasting", "turn_asymmetry"),
    ("coasting", "reverse_asymmetry"),
    ("slew_limit", "floor_tilt"),
)
WITHIN_95 = 1.96
TONES: dict[str, tuple[Tone, str]] = {
    "right": ("good", "green"),
    "in part": ("warn", "yellow"),
    "wrong": ("bad", "red"),
}


@dataclass(frozen=True)
class Hidden:
    """One effect that the robot has and the model given does not know."""

    effect: str
    parameter: str
    value: float

    @property
    def name(self) -> str:
        """As estimates name it."""
        return f"{self.effect}.{self.parameter}"


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("demo")(_demo)


def _demo(
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Another number hides other effects.")
    ] = 1,
) -> None:
    """Blind test: find two effects that are hidden in a simulated robot.

    Shows each command with its output; all files go to demo/ here. A minute or
    two, most of it the diagnosis.
    """
    if FOLDER.exists() and not Path(SEALED).exists():
        raise ValueError(f"{FOLDER}: is there and of no earlier demo; do this in another folder.")
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir()
    digest = _hide(seed)
    _say("It drives for a minute and a half; commands and poses are logged")
    write_rich_script(FOLDER / "script.csv", DURATION_S, seed)
    robot = ["--plant", "planar", "--model", SEALED, "--n", "1", "--script", "demo/script.csv"]
    _simulate(*robot, "--seed", str(seed), "--log", LOG)
    _say("How large are the prediction errors of the model as given?")
    _twinmill("compare", LOG, "--model", GIVEN)
    _say("Which effects are missing, and how probable is each?")
    result = _twinmill("explain", LOG, "--model", GIVEN, "-o", FOUND)
    _say("The sealed answer")
    if _digest() != digest:
        raise ValueError(f"{SEALED}: was changed since it was sealed.")
    print(f"$ sha256sum {SEALED}\n{_digest()}  {SEALED}\nIt is the same file.")
    hidden = _unsealed()
    grade, words = judged(hidden, result)
    PlainConsole().print(show.table(_table(hidden, result)))
    PlainConsole().print(Text(words, f"bold {TONES[grade][1]}"))
    page = _section(hidden, result, words, grade)
    report = write_report(
        FOLDER / "report",
        page.title,
        provenance(f"twinmill demo --seed {seed}", ModelFile.load(GIVEN)),
        [page, present.section(present.Told(result.found, written=result))],
    )
    print(f"\nReport: {report.resolve()}")
    program = _as_typed(Path(sys.argv[0]))
    first = "" if find_spec("nicegui") else f"{command('workbench')} && "
    print(f"By hand, in the browser: {first}{program} open {LOG} --model {GIVEN}")
    print(f"Other effects:           {program} demo --seed {seed + 1}")


def _as_typed(program: Path) -> str:
    """A program as it is started here: by its name where it is on the path."""
    on_path = shutil.which(program.name)
    if on_path and os.path.samefile(on_path, program):
        return program.name
    return os.path.relpath(program)


def _hide(seed: int) -> str:
    """Draws two effects, writes the robot that has them, and tells the digest of its file."""
    random = np.random.default_rng(seed)
    text = ModelFile.load(GIVEN).text
    for effect in PAIRS[random.integers(len(PAIRS))]:
        parameter, low, high = SIZES[effect]
        value = round(float(random.uniform(low, high)), 3)
        text += f'\n[[effect]]\nname = "{effect}"\n{parameter} = {value}\n'
    Path(SEALED).write_text(text)
    _say("A blind test")
    print(
        f"One of {len(PAIRS)} pairs of effects, and their sizes, were drawn at random into a file\n"
        "that only the simulated robot reads until the end. All are identifiable in so short\n"
        "a log; `twinmill lab challenge` tests the others, too.\n"
        f"SHA-256: {_digest()}"
    )
    return _digest()


def _digest() -> str:
    return hashlib.sha256(Path(SEALED).read_bytes()).hexdigest()


def _unsealed() -> list[Hidden]:
    """Effects hidden in the file."""
    known = len(tomlkit.parse(ModelFile.load(GIVEN).text).get("effect", []))
    tables = tomlkit.parse(Path(SEALED).read_text())["effect"][known:]
    return [
        Hidden(str(table["name"]), key, float(value))
        for table in tables
        for key, value in table.items()
        if key != "name"
    ]


def judged(hidden: list[Hidden], result: Better) -> tuple[str, str]:
    """The answer in a word (`right`, `in part` or `wrong`), and in sentences."""
    names = {h.effect for h in hidden}
    named = list(map(catalogue_name, result.added))
    sure = [e for e in named if e in names]
    groups = {f.effect: set(f.group) for f in result.found.answer.findings}
    meant = {e: groups.get(e, set()) & names - set(sure) for e in named}
    among = {hidden: e for e, found in meant.items() for hidden in found if e not in names}
    missed = [h.effect for h in hidden if h.effect not in (*sure, *among)]
    wrong = [e for e in named if e not in names and not meant[e]]
    if not (missed or wrong or among):
        told = f"Right: {' and '.join(sure)} were hidden, both were found, and nothing else."
        return "right", f"{told} {_sizes(hidden, result)}"
    words = [f"{effect} was hidden and found" for effect in sure]
    words += [
        f"{effect} was hidden, and {e} was named, which this log cannot distinguish from it"
        for effect, e in among.items()
    ]
    words += [f"{effect} was hidden and not found" for effect in missed]
    words += [f"{effect} was found and not hidden" for effect in wrong]
    grade = "in part" if sure or among else "wrong"
    start = "In part right" if grade == "in part" else "Wrong"
    return grade, f"{start}: {'; '.join(words)}."


def _sizes(hidden: list[Hidden], result: Better) -> str:
    held = [h for h in hidden if _holds(_estimate(h, result), h)]
    count = {0: "Neither size", 1: "One of the two sizes", 2: "Both sizes"}[len(held)]
    return f"{count} lie{'' if len(held) == 2 else 's'} within the estimated 95 % interval."


def _estimate(hidden: Hidden, result: Better) -> ParameterEstimate | None:
    return next((e for e in result.estimates if e.name == hidden.name), None)


def _holds(estimate: ParameterEstimate | None, hidden: Hidden) -> bool:
    return estimate is not None and abs(estimate.value - hidden.value) <= WITHIN_95 * estimate.std


def _table(hidden: list[Hidden], result: Better) -> Table:
    """Hidden beside found."""
    rows = []
    for h in hidden:
        estimate = _estimate(h, result)
        told = "not found" if estimate is None else f"{estimate.value:.3g} ± {estimate.std:.1g}"
        rows.append([Cell(h.name), Cell(f"{h.value:g}"), Cell(told)])
    return Table(
        "The sealed answer", ["quantity", "hidden", "found"], rows, "Found: ± one standard error."
    )


def _section(hidden: list[Hidden], result: Better, words: str, grade: str) -> Section:
    before, after = result.before.score, result.after.score
    return Section(
        "A blind test",
        [
            ("answer", grade, TONES[grade][0]),
            ("score as given", number(before), tone(before)),
            ("with what was found", number(after), tone(after)),
        ],
        words,
        figures=[_answer_figure(hidden, result)],
        tables=[_table(hidden, result)],
    )


def _answer_figure(hidden: list[Hidden], result: Better) -> Figure:
    """Ratio of the found size to the sealed one."""

    def paint(axes: Axes) -> None:
        axes.axvline(1, color=FLOOR, lw=6, alpha=0.35, label="hidden")
        for row, h in enumerate(hidden):
            if (e := _estimate(h, result)) is not None:
                spread = abs(WITHIN_95 * e.std / h.value)
                axes.errorbar(
                    e.value / h.value, row, xerr=spread, fmt="o", color=PREDICTED, capsize=4,
                    label=None if row else "found, 95 % interval",
                )  # fmt: skip
        axes.set_yticks(range(len(hidden)), [h.name for h in hidden])
        axes.set(xlabel="estimated size over hidden size", ylim=(len(hidden) - 0.4, -0.6))
        axes.set_xlim(min(0.0, axes.get_xlim()[0]), max(1.7, axes.get_xlim()[1]))
        legend_above(axes, 2)

    return Figure(
        draw(1.9, paint),
        "Estimates over the hidden sizes",
        "The model as given has none of these effects. Dots: sizes estimated from the log alone, "
        "with 95 % intervals; green line: the sizes in the sealed file.",
    )


def _say(text: str) -> None:
    PlainConsole().rule(Text(text, "bold"), align="left")


def _simulate(*words: str) -> None:
    program = find_program("twin_run")
    print(f"$ {shlex.join([_as_typed(program), *words])}", flush=True)
    subprocess.run([program, *words], check=True, stdout=subprocess.DEVNULL)


def _twinmill(*arguments: str) -> Any:
    print(f"$ twinmill {shlex.join(arguments)}", flush=True)
    return cli.run(list(arguments))
