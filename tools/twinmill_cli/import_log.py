# SPDX-License-Identifier: Apache-2.0
"""`twinmill import`: makes a log from motion capture exports and command tables of others."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import print_object
from twinmill_cli.spelling import typed

if working():  # not for --help
    from twinmill.counted import counted
    from twinmill.data.importers.columns import Guess, is_usual, to_toml
    from twinmill.data.importers.import_log import explain_columns, import_log
    from twinmill.data.importers.options import ImportOptions
    from twinmill.data.importers.plain import KNOWN
    from twinmill.data.importers.robot_files import files_of
    from twinmill.data.importers.ros_bag import Topic, guess_pairs, list_topics, numbering
    from twinmill.data.importers.ros_messages import ODOMETRY, STAND_IN, STEERED, roles_of
    from twinmill.data.log import LogError
    from twinmill.data.measurement_table import Table as TableFile
    from twinmill.data.measurement_table import is_number
    from twinmill.files import replacing
    from twinmill.report import show
    from twinmill.report.tables import Cell, Table
    from twinmill.terminal import PlainConsole

NAMELESS = re.compile(r"(Unnamed: \d+)?")  # as pandas writes its index, and then reads it
SHOWN = 10  # warnings in the terminal; --json has all
# Options that do something where columns are explained, and where a bag is listed.
EXPLAINED = {
    *("--explain-columns", "--poses", "--commands", "--pose", "--command"),
    *("--robot-id", "--force", "--out"),
}
LISTED = {"--bag", "--json", "--out"}


def _of_robots(option: str, given: list[str] | None) -> dict[int | None, float]:
    """Sums by robot; None stands for all of them."""
    sums: dict[int | None, float] = {}
    for text in given or []:
        robot, equals, number = text.rpartition("=")
        if not is_number(number) or (equals and _number_of(robot) is None):
            wrong = f"{text} is no number, and not that of one robot, as R02=0.4 is."
            raise typer.BadParameter(wrong, param_hint=f"'{option}'")
        if not math.isfinite(float(number)):
            raise typer.BadParameter(f"{text} is no finite number.", param_hint=f"'{option}'")
        key = _number_of(robot) if equals else None
        sums[key] = sums.get(key, 0.0) + float(number)
    return sums


def _number_of(robot: str) -> int | None:
    """Number of a robot written as R02 or 2; None for other words."""
    digits = robot.removeprefix("R")
    return int(digits) if digits.isdecimal() else None


def _flips(given: list[str]) -> dict[int | None, frozenset[str]]:
    """Columns by robot; None stands for all of them."""
    columns: dict[int | None, frozenset[str]] = {}
    for text in given:
        robot, equals, name = text.rpartition("=")
        key = _number_of(robot) if equals else None
        if equals and key is None:
            wrong = f"{text} is no column, and not that of one robot, as R02=y_m is."
            raise typer.BadParameter(wrong, param_hint="'--flip'")
        columns[key] = columns.get(key, frozenset()) | {name}
    return columns


def _renames(given: list[str]) -> tuple[dict[str, str], dict[int, dict[str, str]]]:
    """New names of columns of all robots, and those of single ones by number."""
    of_all: dict[str, str] = {}
    own_names: dict[int, dict[str, str]] = {}
    for text in given:
        old, new = _pair(text, "--rename OLD=NEW")
        robot, _, own = old.partition("=")
        key = _number_of(robot) if own else None
        if key is None:
            of_all[old] = new
        else:
            own_names.setdefault(key, {})[own] = new
    return of_all, own_names


def _two_robots(text: str) -> tuple[int, int]:
    first, second = map(_number_of, text.partition("=")[::2])
    if first is None or second is None or first == second:
        raise typer.BadParameter(
            f"{text} is no two robots, as R01=R02 is.", param_hint="'--exchange'"
        )
    return first, second


def register(app: typer.Typer) -> None:
    """Adds the command `import` to the application."""
    app.command("import", no_args_is_help=True)(_command)


def _command(
    context: typer.Context,
    beside: Annotated[list[str] | None, typer.Argument(hidden=True)] = None,
    *,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The log to write (.lcmlog).")
    ] = None,
    poses: Annotated[
        list[Path] | None,
        typer.Option(
            help=(
                "CSV: t_s, robot_id, x_m, y_m, theta_rad or qw, qx, qy, qz; optional z_m, valid. "
                "Without a heading only the position is judged. Where each robot has a file of "
                "its own, repeat it, or quote a pattern: 'poses_R*.csv'."
            )
        ),
    ] = None,
    motive: Annotated[
        Path | None,
        typer.Option(
            help="CSV export of OptiTrack Motive with rigid bodies in global coordinates."
        ),
    ] = None,
    vicon: Annotated[
        Path | None,
        typer.Option(help="CSV export of Vicon Tracker or Nexus with objects or segments."),
    ] = None,
    commands: Annotated[
        list[Path] | None,
        typer.Option(
            help=(
                "CSV: t_s, robot_id and fl_pct, fr_pct, rl_pct, rr_pct | speed_input, turn_input | "
                "w1_radps..w4_radps | vx_mps, vy_mps, omega_radps | vx_world_mps, vy_world_mps | "
                "speed_mps, steering_rad; held until the next row. As with poses one file or one "
                "for each robot. Without any the log is of poses alone."
            )
        ),
    ] = None,
    detections: Annotated[
        Path | None,
        typer.Option(
            help="CSV of what cameras saw: t_s (of the picture, the commands' clock), robot_id, "
            "seen (0 or 1); optional range_m, bearing_rad."
        ),
    ] = None,
    io_tsv: Annotated[
        list[Path] | None, typer.Option(help=("io.tsv of a robot; repeat for several."))
    ] = None,
    bag: Annotated[
        Path | None,
        typer.Option(help="ROS bag (rosbag1, rosbag2); without --pose and --command it is listed."),
    ] = None,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TOPIC",
            help="Poses of a robot in the bag; a frame of tf is /tf:FRAME, as in /tf:base_link. Of "
            "a table of several topics the one that is meant.",
        ),
    ] = None,
    command: Annotated[
        list[str] | None, typer.Option(metavar="TOPIC", help="Commands of that robot, likewise.")
    ] = None,
    receive_stamps: Annotated[
        bool, typer.Option("--receive-stamps", help="Times of receipt, not of the headers.")
    ] = False,
    wheelbase_m: Annotated[
        float | None,
        typer.Option(help="Distance of the axles, where commands are speed and steering angle."),
    ] = None,
    full_duty: Annotated[
        float | None,
        typer.Option(
            help="Number that is full duty in a bag's duties; else the least of 1, 100, 255 that "
            "all lie within."
        ),
    ] = None,
    wheel_factor: Annotated[
        float | None,
        typer.Option(
            help="Multiplies wheel speeds that are in another unit, or of motors before a gear: to "
            "rad/s of the wheels."
        ),
    ] = None,
    command_timeout_s: Annotated[
        float | None,
        typer.Option(
            help="Time after which the robot stops by itself if it gets no command, as "
            "ros2_control's do after 0.5 s; else each command holds until the next."
        ),
    ] = None,
    robot: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=ID",
            help="Number of a robot by its name: a rigid body, a word in the column "
            "robot_id, in the name of a robot's own file or in a bag's topics; else digits in it.",
        ),
    ] = None,
    robot_id: Annotated[int | None, typer.Option(help="For files of one robot.")] = None,
    rename: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]OLD=NEW",
            help="Read column OLD of the CSV files, or one of ours of any source, as NEW, as in "
            "yaw=theta_deg, or R02=x_m=y_m of one robot.",
        ),
    ] = None,
    exchange: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROBOT=ROBOT",
            help="Two robots of which each has the other's poses, as in R01=R02.",
        ),
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="TOML file that says which column is what.")
    ] = None,
    explain_columns_to: Annotated[
        Path | None,
        typer.Option(
            "--explain-columns",
            metavar="FILE",
            help="Say what each column looks like, and write that as a mapping to FILE.",
        ),
    ] = None,
    flip: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]COLUMN",
            help="Change the sign of one of our columns, as in y_m, or R02=y_m of one robot.",
        ),
    ] = None,
    up: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            help="Axis that is up in the poses, x, y or z; default: Motive's y, z of all others.",
        ),
    ] = None,
    pose_shift_s: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]SECONDS",
            help="Added to the times of poses: of all, or as R02=0.4 of one robot; what is given "
            "several times adds up.",
        ),
    ] = None,
    pose_clock_ppm: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]PPM",
            help="Rate of the poses' clock relative to the commands', to be removed; likewise.",
        ),
    ] = None,
    heading_offset_deg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]DEGREES",
            help="From the tracked body's x axis to the robot's front, left positive; likewise.",
        ),
    ] = None,
    path_heading: Annotated[
        bool,
        typer.Option(
            "--heading-from-path",
            help="For positions without heading: take it from the path while the robot is told "
            "to drive ahead or straight aside.",
        ),
    ] = False,
    same_clock: Annotated[
        bool,
        typer.Option(
            "--same-clock", help="One clock stamped poses and commands: no offset is estimated."
        ),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the output.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Make a log from motion capture exports and command tables, or of poses alone.

    Files may end in .gz. A Motive export that goes with io.tsv is placed in time
    by its capture start, read as UTC; use --pose-shift-s for another time zone.

    Example: twinmill import --poses poses.csv --commands commands.csv -o run.lcmlog
    """
    shifts_s = _of_robots("--pose-shift-s", pose_shift_s)
    gains_ppm = _of_robots("--pose-clock-ppm", pose_clock_ppm)
    turns_deg = _of_robots("--heading-offset-deg", heading_offset_deg)
    renames, own_renames = _renames(rename or [])
    if beside:
        raise LogError(
            f"{beside[0]}: stands alone; write the option before each file, or quote the "
            "pattern, as in --poses 'poses_R*.csv'."
        )
    if explain_columns_to:
        _refuse_others(context, "--explain-columns", EXPLAINED, "it only says what columns are")
        asked = {
            "poses": files_of(poses, "poses"),
            "commands": files_of(commands, "commands"),
        }
        explained = explain_columns(
            next(iter(asked["poses"]), None),
            next(iter(asked["commands"]), None),
            topics=(pose[0] if pose else None, command[0] if command else None),
        )
        log = str(out or "run.lcmlog")
        _explain(asked, explained, explain_columns_to, robot_id, log=log, force=force)
        return
    if bag and not pose and not command:
        _refuse_others(context, "--bag", LISTED, "without --pose and --command it is only listed")
        _list(bag, list_topics(bag), str(out or f"{bag.stem}.lcmlog"), as_json)
        return
    if out is None:
        raise LogError("--out is missing: name the log to write.")
    options = ImportOptions(
        mapping=mapping,
        flips=_flips(flip or []),
        pose_clock_ppm=gains_ppm,
        pose_topics=tuple(pose or []),
        command_topics=tuple(command or []),
        receive_stamps=receive_stamps,
        wheelbase_m=wheelbase_m,
        full_duty=full_duty,
        wheel_factor=wheel_factor,
        command_timeout_s=command_timeout_s,
        robot_id=robot_id,
        rename=renames,
        own_renames=own_renames,
        exchange=tuple(_two_robots(text) for text in exchange or []),
        robots={
            name: _number(number)
            for name, number in (_pair(text, "--robot NAME=ID") for text in robot or [])
        },
        up=up,
        pose_shift_s=shifts_s,
        path_heading=path_heading,
        same_clock=same_clock,
        force=force,
        heading_offset_rad={k: math.radians(deg) for k, deg in turns_deg.items()},
    )
    summary = import_log(
        poses,
        commands,
        out,
        motive=motive,
        vicon=vicon,
        io_tsv=tuple(io_tsv or ()),
        bag=bag,
        detections=detections,
        options=options,
    )
    if as_json:
        print_object(summary)
    else:
        _print(summary)


def _refuse_others(context: typer.Context, mode: str, used: set[str], why: str) -> None:
    """Raises LogError where an option was given that does nothing there."""
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name)
        if source and source.name == "COMMANDLINE" and parameter.opts[0] not in used:
            raise LogError(
                f"{parameter.opts[0]}: does nothing here, since {mode} was given and {why}; give "
                "it with what is printed then."
            )


def _list(bag: Path, topics: list[Topic], log: str, as_json: bool) -> None:
    """Lists a bag, and prints the command that imports what seems to belong together."""
    words, pairs = ["twinmill", "import", "--bag", str(bag)], guess_pairs(topics)
    for pose, command in pairs:
        words += ["--pose", pose, *(["--command", command] if command else [])]
    steered = {t.name for t in topics if t.kind in STEERED} & {command for _, command in pairs}
    words += shlex.split(typed(numbering(pairs), None)) + (
        ["--wheelbase-m", "METRES"] if steered else []
    )
    line = shlex.join([*words, "-o", log]) if pairs else None
    if as_json:
        print_object({"topics": [vars(t) for t in topics], "command": line})
        return
    rows = [
        [Cell(text) for text in (t.name, t.kind, f"{'about ' * t.about}{t.count}", _could_be(t))]
        for t in topics
    ]
    table = Table(str(bag), ["topic", "type", "messages", "could be"], rows, words=(0, 1, 3))
    PlainConsole().print(show.table(table))
    PlainConsole().print(f"Try: {line}" if line else _unpaired(topics), soft_wrap=True)
    if pairs and not any(command for _, command in pairs):
        PlainConsole().print("It has no commands that can be read: a log of poses alone.")
    for topic in topics:
        if topic.kind == ODOMETRY and topic.name in {command for _, command in pairs}:
            PlainConsole().print(f"{topic.name} {STAND_IN}.", soft_wrap=True)


def _could_be(topic: Topic) -> str:
    """All that its messages can be taken for."""
    return ", ".join(roles_of(topic.kind)) or topic.role or "-"


def _unpaired(topics: list[Topic]) -> str:
    """Reason why no pair of poses and commands can be guessed in a bag."""
    roles = {topic.role for topic in topics}
    lacking = [
        word for role, word in (("pose", "poses"), ("command", "commands")) if role not in roles
    ]
    if lacking:
        return f"It has no {' and no '.join(lacking)} that can be read; record them, too."
    return "Which poses and commands belong together is not clear; name them (--pose, --command)."


def _explain(
    asked: dict[str, tuple[Path, ...]],
    explained: dict[str, tuple[TableFile, list[Guess]]],
    out: Path,
    robot_id: int | None,
    *,
    log: str,
    force: bool,
) -> None:
    """Prints the meaning of each column, writes it as a mapping file, and says what to type."""
    if not explained:
        raise LogError("--explain-columns: give the tables with --poses and --commands.")
    guesses = {kind: columns for kind, (_, columns) in explained.items()}
    inputs = [path for paths in asked.values() for path in paths]
    with replacing(out, force, inputs=inputs) as temporary:
        temporary.write_text(to_toml(guesses), encoding="utf-8")
    for kind, (read, columns) in explained.items():
        for note in read.notes:
            PlainConsole().print(note, soft_wrap=True)
        rows = [[g.column, ", ".join(g.targets) or "-", g.why] for g in columns]
        table = Table(
            kind,
            ["column", "is", "because"],
            [[Cell(text) for text in row] for row in rows],
            words=(0, 1, 2),
        )
        PlainConsole().print(show.table(table))
    words = ["twinmill", "import"]
    for kind, paths in asked.items():
        for path in paths or [kind.upper()]:
            words += [f"--{kind}", str(path)]
    several = max(map(len, asked.values())) > 1
    if not several and not any("robot_id" in g.targets for g in guesses.get("poses", [])):
        words += ["--robot-id", str(1 if robot_id is None else robot_id)]
    line = shlex.join([*words, "--mapping", str(out), "-o", log])
    told = [word for kind, one in explained.items() for word in _lacking(kind, *one)]
    PlainConsole().print(f"Check {out}{''.join(told)}; then:\n  {line}", soft_wrap=True)


def _lacking(kind: str, table: TableFile, columns: list[Guess]) -> list[str]:
    """Entries that a person must write for a table in which no column was known."""
    known = {target for guess in columns for target in guess.targets} - {
        "t_s",
        "robot_id",
        "vy_mps",
    }
    if known:
        return []
    timed = any("t_s" in guess.targets for guess in columns)
    example = {"poses": "x_m", "commands": "vx_mps"}[kind] if timed else "t_s"
    strange = (
        guess.column
        for guess in columns
        if not (NAMELESS.fullmatch(guess.column) or is_usual(guess.column, KNOWN))
        and any(map(is_number, table.cells(guess.column)))
    )
    as_in = [f', as in {example} = {{ column = "{name}", factor = 1.0 }}' for name in strange]
    return [f", and write under [{kind}] what its columns hold", *as_in[:1]]


def _pair(text: str, form: str) -> tuple[str, str]:
    left, equals, right = text.rpartition("=")
    if not (left and equals and right):
        raise LogError(f"{form.split()[0]} {text}: must have the form {form.split()[1]}.")
    return left, right


def _number(text: str) -> int:
    if not (text.isascii() and text.isdecimal()):
        raise LogError(f"--robot: '{text}' is no robot number in 0..99.")
    return int(text)


def _print(summary: dict[str, Any]) -> None:
    columns = {
        "robot_id": "robot",
        "command_kind": "driven by",
        "command_rows": "commands",
        "command_changes": "changes",
        "poses": "poses",
        "poses_valid": "of them valid",
    }
    if any("detections" in robot for robot in summary["robots"]):
        columns["detections"] = "detections"
    table = Table(
        f"{summary['out']}: {counted(summary['messages'], 'message')}, "
        f"{summary['duration_s']:.1f} s",
        list(columns.values()),
        [
            [Cell("-" if robot.get(key) is None else str(robot[key])) for key in columns]
            for robot in summary["robots"]
        ],
        words=(1,),
    )
    console = PlainConsole()
    console.print(show.table(table))
    for text in summary["warnings"][:SHOWN]:
        console.print(f"! {text}", style="yellow")
    if len(summary["warnings"]) > SHOWN:
        console.print(f"and {len(summary['warnings']) - SHOWN} more (--json has all).")
