# SPDX-License-Identifier: Apache-2.0
"""`twinmill guide`: from what you have to a plan, a model file to fill in and two scripts."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import AsJson, deliver

if working():  # not for --help
    import re
    import textwrap

    import numpy as np
    import twinmill_native as native
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from rich.console import Group
    from rich.prompt import Prompt
    from rich.text import Text

    from twinmill.data.checks.words import COLUMNS
    from twinmill.data.log import CommandKind
    from twinmill.experiment.drives import drive as plan
    from twinmill.experiment.wheel_signs import csv_text, drive_of, script
    from twinmill.export.script import TwistScript, write_publisher
    from twinmill.files import replacing_folder


class Poses(StrEnum):
    """Where they come from."""

    CAMERA = "camera"
    OPTITRACK = "optitrack"
    VICON = "vicon"
    ROS = "ros"
    CSV = "csv"


class Robot(StrEnum):
    """Programs that may drive the robot."""

    TURBOPI = "turbopi"
    ROS = "ros"
    OTHER = "other"
    TWIN = "twin"


class Drive(StrEnum):
    """Inputs of the drive."""

    DUTY = "duty"
    WHEEL_SPEED = "wheel_speed"
    TWIST = "twist"


class Wheels(StrEnum):
    """Wheels of the robot."""

    MECANUM = "mecanum"
    DIFFERENTIAL = "differential"
    OMNI3 = "omni3"
    ACKERMANN = "ackermann"
    NONE = "none"


class Clocks(StrEnum):
    """Who stamps poses and commands."""

    ONE = "one"
    TWO = "two"


QUESTIONS = {
    "robot": (Robot, "What drives it: our program, ROS, another program, or the twin to try this"),
    "poses": (Poses, "Where do the robot's poses come from"),
    "wheels": (Wheels, "What does it roll on"),
    "drive": (Drive, "How is it commanded: by duties, wheel speeds or velocities"),
    "clocks": (Clocks, "Does one computer stamp poses and commands (one), or do two"),
}
WIDTH = 72  # of a paragraph of the plan
TOLD = {"duty": "duties", "wheel_speed": "wheel speeds", "twist": "velocities of the body"}
ROLLS = {
    "mecanum": "four mecanum wheels",
    "differential": "plain wheels left and right",
    "omni3": "three omni wheels",
    "ackermann": "wheels that steer",
    "none": "wheels that the model leaves out",
}
SEEN = {
    "camera": "a camera on the ceiling",
    "optitrack": "OptiTrack",
    "vicon": "Vicon",
    "ros": "ROS topics",
    "csv": "a table",
}
ANSWERS = (
    (
        "score near 1",
        "on average it predicts as well as this log can tell; a small effect may be missing",
        "read the verdict",
    ),
    ("`model_adequate`", "nothing is missing that this log would show", "use the model"),
    ("`refit_enough`", "the numbers are stale, no effect is missing", "`fit`"),
    ("`effect_missing`", "one effect or more, each with its probability", "`explain`"),
    ("`ambiguous`, `group`", "this log cannot tell some effects apart", "`next`"),
    (
        "`outside_catalogue`",
        "something is missing that no effect explains; `rest` says what it depends on",
        "look there; `explain` adds a formula that holds, `add equation` one of your own",
    ),
    ("`cannot_tell`", "the log does not determine the answer", "`next`"),
    ("`bad_input`", "the log itself is wrong; `input` says what", "correct it, import again"),
)
DRIVE_S, SEED = 60.0, 1
FULL_MPS, FULL_RADPS = 0.3, 2.0  # of robots that are told velocities, in the first drive


@dataclass(frozen=True)
class Have:
    """Equipment at hand."""

    poses: str
    robot: str
    drive: CommandKind
    wheels: str
    clocks: str
    number: int


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("guide")(_guide)


def _guide(
    *,
    poses: Annotated[Poses | None, typer.Option("--poses", show_default=False)] = None,
    robot: Annotated[Robot | None, typer.Option("--robot", show_default=False)] = None,
    drive: Annotated[Drive | None, typer.Option("--drive", show_default=False)] = None,
    wheels: Annotated[Wheels | None, typer.Option("--wheels", show_default=False)] = None,
    clocks: Annotated[Clocks | None, typer.Option("--clocks", show_default=False)] = None,
    number: Annotated[int, typer.Option("--number", min=0, max=99, help="The robot's.")] = 3,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of the plan.")
    ] = Path("plan"),
    as_json: AsJson = False,
) -> Have:
    """Ask for your equipment, and write a plan from an unknown robot to a named effect.

    The folder holds plan.md, a model file to write your measures into, and two
    scripts: one wheel at a time, and the first drive. What an option says is
    not asked; without a terminal or with --json all must be said.

    Example: twinmill guide --robot twin -o plan
    """
    given = {"poses": poses, "robot": robot, "drive": drive, "wheels": wheels, "clocks": clocks}
    have = _have(given, number, not as_json and sys.stdin.isatty())
    with replacing_folder(output, force=None) as folder:
        folder.mkdir()
        text = _write(have, folder)
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    commands = [line for kind, block in blocks if not kind for line in block.splitlines()]
    data = {"have": asdict(have), "out": str(output), "commands": commands, "plan": text}
    words = Text(f"{text}\nWritten: {output}/plan.md", no_wrap=True, overflow="ignore")
    deliver(data, Group(words), as_json)
    return have


def _have(given: Mapping[str, StrEnum | None], number: int, asks: bool) -> Have:
    """Collects the equipment from options, from what follows from them, and from questions.

    Raises:
        ValueError: something is not said and nobody can be asked, or does not go together.
    """
    known = {name: answer for name, answer in given.items() if answer}
    for name, (kind, question) in QUESTIONS.items():
        answer = known.get(name) or _following(known).get(name)
        if answer is None and not asks:
            words = ", ".join(kind)
            raise ValueError(f"guide: --{name} is not said, and nobody can be asked; say {words}.")
        known[name] = answer or kind(Prompt.ask(question, choices=[word.value for word in kind]))
    for name, answer in _following(known).items():
        if known[name] != answer:
            makes = [f"--{k} {v}" for k, v in known.items() if name in _following({k: v})]
            raise ValueError(
                f"--{name} {known[name]}: with {' and '.join(makes)} it is {answer}; leave "
                f"--{name} out."
            )
    if (known["robot"], known["poses"]) == (Robot.TURBOPI, Poses.VICON):
        raise ValueError(
            "--poses vicon: our robot's drives are recorded with poses live on the bus, and of "
            "Vicon exports are read alone; bring its poses to ROS or to a table (--poses ros, csv)."
        )
    chosen: dict[str, Any] = {name: answer.value for name, answer in known.items()}
    return Have(**chosen, number=number)


def _following(known: dict[str, StrEnum]) -> dict[str, StrEnum]:
    """Equipment that follows from what is known."""
    robot, poses, wheels = (known.get(name) for name in ("robot", "poses", "wheels"))
    found: dict[str, StrEnum] = {}
    if robot in (Robot.TWIN, Robot.TURBOPI):
        found |= {"drive": Drive.DUTY, "wheels": Wheels.MECANUM}
    elif robot is Robot.ROS or wheels in (Wheels.ACKERMANN, Wheels.NONE):
        found["drive"] = Drive.TWIST
    if robot is Robot.TWIN:
        found |= {"poses": Poses.CSV, "clocks": Clocks.ONE}
    elif poses in (Poses.CAMERA, Poses.OPTITRACK, Poses.VICON):  # they count from their start
        found["clocks"] = Clocks.TWO
    return found


def _write(have: Have, folder: Path) -> str:
    """The plan, after all files of the folder."""
    model_text = _render("guide_model.toml.j2", have=have)
    (folder / "mine.toml").write_text(model_text)
    model = native.Model.from_toml(model_text, "mine.toml")
    suffix = "py" if have.robot == "ros" else "csv"
    signs = have.wheels != "ackermann"
    signs_s = _play(*script(model, 50), folder / f"wheels.{suffix}") if signs else 0.0
    drive_s = _play(*_first_drive(model), folder / f"drive.{suffix}")
    text = _render(
        "guide.md.j2",
        have=have,
        rolls=ROLLS[have.wheels],
        told=TOLD[have.drive],
        columns=COLUMNS[have.drive][:3],
        ruler=re.findall(r"^(\w+_m) =", model_text, re.MULTILINE),
        seen="the twin" if have.robot == "twin" else SEEN[have.poses],
        one_clock=have.clocks == "one",
        same_clock=" --same-clock" if have.clocks == "one" else "",
        wheels=f"wheels.{suffix}",
        drive=f"drive.{suffix}",
        signs=signs,
        signs_s=signs_s,
        drive_s=drive_s,
        answers=ANSWERS,
    )
    text = _wrapped(re.sub(r"\n{3,}", "\n\n", text))
    (folder / "plan.md").write_text(text)
    return text


def _wrapped(text: str) -> str:
    """Markdown with paragraphs of WIDTH; headings, tables and blocks of commands as they are."""
    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    parts[::2] = [re.sub(r"(?m)(^[^\n#|].*(\n|\Z))+", _filled, part) for part in parts[::2]]
    return "".join(parts)


def _filled(paragraph: re.Match[str]) -> str:
    text = textwrap.fill(paragraph[0], WIDTH, break_long_words=False, break_on_hyphens=False)
    return text + "\n"


def _render(template: str, **values: Any) -> str:
    environment = Environment(
        loader=PackageLoader("twinmill_cli", "."),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
    )
    return environment.get_template(template).render(**values)


def _play(names: list[str], rows: np.ndarray, path: Path) -> float:
    """Writes a script, as a table or as a publisher; returns how long it takes, s."""
    if path.suffix == ".py":
        command = f"twinmill guide, {path.name}"
        write_publisher(
            TwistScript(rows[:-1, 0], rows[:-1, 1:], rows[-1, 0]), path, False, command=command
        )
    else:
        path.write_text(csv_text(names, rows))
    return float(rows[-1, 0])


def _first_drive(model: native.Model) -> tuple[list[str], np.ndarray]:
    """Columns and rows, t_s first, of a drive that shows most effects."""
    legs = plan("mixed", DRIVE_S, True, np.random.default_rng(SEED))
    axes = _as_it_can(model.wheel_kind, np.array([leg[1] for leg in legs]))
    t_s = np.cumsum([0.0, *(leg[0] for leg in legs)])
    values = axes * [FULL_MPS, FULL_MPS, FULL_RADPS]
    if model.drive != "twist":
        speeds = np.array([model.wheel_speeds(*row) for row in values])
        if speeds.shape[1] == 2:  # left and right, told all wheels of a side
            speeds = np.tile(speeds, 2)
        speeds = np.pad(speeds, ((0, 0), (0, 4 - speeds.shape[1])))
        top = np.abs(speeds).max()
        values = np.rint(100 * speeds / top) if model.drive == "duty" else speeds
    names = [name for name in COLUMNS[drive_of(model)] if name]
    still = np.zeros(len(names))
    rows = [np.append(at_s, row) for at_s, row in zip(t_s, [*values, still], strict=True)]
    return names, np.round(rows, 3)


def _as_it_can(wheels: str, axes: np.ndarray) -> np.ndarray:
    """(N, 3) forward, left, turn: what it cannot do alone it does driving ahead, not standing."""
    if wheels in ("mecanum", "omni3", "none"):
        return axes
    ahead, left, turn = axes.T
    ahead = np.where(ahead == 0, left, ahead)
    if wheels == "ackermann":  # it does not turn on the spot
        ahead = np.where(ahead == 0, np.abs(turn), ahead)
        turn = turn * np.abs(ahead)
    return np.column_stack([ahead, 0 * left, turn])
