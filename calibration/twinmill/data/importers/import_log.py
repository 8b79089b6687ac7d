# SPDX-License-Identifier: Apache-2.0
"""Makes a log from motion capture exports and command tables of others."""

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import tomlkit

from twinmill.arguments import option
from twinmill.data.checks import (
    InputFinding,
    check_changes,
    check_commanded,
    check_driven,
    check_poses,
    check_recorded,
    check_stamps,
    of_all_robots,
    own_option,
)
from twinmill.data.checks.bodies import give_back
from twinmill.data.importers.columns import Guess, explain, read_mapping
from twinmill.data.importers.corrections import corrected
from twinmill.data.importers.io_tsv import read_io_tsv
from twinmill.data.importers.log_writer import log_parts
from twinmill.data.importers.mapped import check_renames, names_in, read_columns
from twinmill.data.importers.motive import read_motive
from twinmill.data.importers.options import (
    Flips,
    ImportOptions,
    OfRobots,
    Sources,
    check_numbered,
    check_sources,
    named_robots,
)
from twinmill.data.importers.path_heading import with_path_heading
from twinmill.data.importers.plain import (
    KNOWN,
    OF_COMMANDS,
    OF_DETECTIONS,
    OF_POSES,
    Columns,
    read_commands,
    read_detections,
    read_poses,
)
from twinmill.data.importers.robot_files import Given, Series, files_of, read_each, robot_numbers
from twinmill.data.importers.ros_bag import BagOptions, read_bag
from twinmill.data.importers.series import (
    CommandSeries,
    DetectionSeries,
    PoseSeries,
    in_body_frame,
    multiply,
    stopped_when_silent,
)
from twinmill.data.log import Log, LogError, RobotLog, read_log
from twinmill.data.measurement_table import Table
from twinmill.data.track import make_track
from twinmill.files import check_new_file, replacing

TIME_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9}  # of which a second has so many
SAME_LENGTH = 0.1  # share by which poses and commands of one run differ in length
SLOWEST_S, FEWEST_POSES = 2.0, 5  # from pose to pose; which tell it
MOST_PPM = 1e5  # by which one clock gains on another
OF_KINDS = ("poses", "commands")  # tables of a mapping file
LONGEST_HOLD_S = 3600  # a command held for longer is a mix-up of clocks


def import_log(
    poses: Given,
    commands: Given,
    out: Path,
    *,
    motive: Path | None = None,
    vicon: Path | None = None,
    io_tsv: tuple[Path, ...] = (),
    bag: Path | None = None,
    detections: Path | None = None,
    options: ImportOptions | None = None,
) -> dict:
    """Makes a log from one source of poses and one of commands; or of poses alone.

    Args:
        poses: plain CSV, several where each robot has its own, or None with `motive` or `vicon`.
        commands: plain CSV, several where each robot has its own, or None with `io_tsv`.
        out: the log to write; nothing is there until all went well.
        motive: export of OptiTrack Motive.
        vicon: export of Vicon Tracker or Nexus.
        io_tsv: one per robot.
        bag: ROS bag with both, in place of all others.
        detections: plain CSV of what cameras saw, beside any kind of command.
        options: how to read them.

    Returns:
        out, robots[] {robot_id, command_kind, commands, command_rows, command_changes, poses,
        poses_valid}, messages (commands and poses), duration_s, warnings[]. A row of duties may be
        many commands, since it is repeated while it is held.

    Raises:
        LogError: one sentence on what is wrong; nothing was written.
    """
    options = options or ImportOptions()
    poses, commands = files_of(poses, "poses"), files_of(commands, "commands")
    given = Sources(poses, commands, motive, vicon, tuple(io_tsv), bag, detections)
    check_sources(given, options)
    _check_renames(options, [*poses, *commands], detections)
    _check_wheelbase(options, commands)
    inputs = [*given.files, bag, options.mapping]
    check_new_file(out, options.force, inputs)
    parts, rows, warnings = _log_of(given, options)
    with replacing(out, options.force, inputs=inputs) as temporary:
        with temporary.open("wb") as file:
            file.writelines(parts)  # which holds all that was read until its end
        return _summary(read_log(temporary), out, warnings, rows)


def _log_of(
    given: Sources, options: ImportOptions
) -> tuple[Iterator[bytes], dict[int, int], list[str]]:
    """Content of the log, rows of commands by robot, and what is to be said of the sources."""
    pose_series, command_series = _read(given, options)
    _check_names(options, given, [*pose_series, *command_series])
    pose_series = _exchanged(pose_series, options.exchange)
    pose_series = [
        replace(series, utime_us=_on_our_clock(series, options)) for series in pose_series
    ]
    left_out = _of_no_run(pose_series, command_series, given, options)
    pose_series, command_series = (
        [own for own in series if own.robot_id not in left_out]
        for series in (pose_series, command_series)
    )
    rows = {own.robot_id: len(own.utime_us) for own in command_series}
    if options.path_heading:
        pose_series = _headed(pose_series, command_series)
    pose_series = _turned(pose_series, options)
    by_robot = {series.robot_id: series for series in pose_series}
    command_series = [
        in_body_frame(series, by_robot.get(series.robot_id)) if series.world else series
        for series in command_series
    ]
    seen = _detections(given.detections, options, by_robot, left_out) if given.detections else []
    provenance = _provenance(given.files, options)
    parts = log_parts(pose_series, command_series, config_toml=provenance, detections=seen)
    warnings = [f"Left out: {why}" for why in left_out.values()]
    warnings += [w for own in (*pose_series, *command_series, *seen) for w in own.warnings]
    if not command_series:
        warnings.append(
            "no commands are given: swarm metrics, swarm plot, swarm compare and export need none; "
            "compare, diagnose, fit and explain do: import anew with "
            f"{option('commands')} (of a bag with {option('command')})."
        )
    return parts, rows, warnings


def _read(given: Sources, options: ImportOptions) -> tuple[list[PoseSeries], list[CommandSeries]]:
    """Series of all robots, their signs and names put right."""
    if given.bag:
        how = BagOptions(
            options.robot_id,
            options.robots,
            options.receive_stamps,
            options.wheelbase_m,
            options.full_duty,
            options.up,
        )
        topics = list(options.pose_topics), list(options.command_topics)
        poses, commands = read_bag(given.bag, *topics, how)
    else:
        of_files = robot_numbers(given.poses, given.commands, options.robots)
        poses = (
            _read_tables(given.poses, "poses", options, of_files)
            if given.poses
            else _read_capture(given, options)
        )
        poses = _numbered(poses, options)
        commands = _numbered(
            _read_commands(given, options, of_files=of_files, poses=poses), options
        )
    if options.wheel_factor is not None:
        commands = _geared(commands, options.wheel_factor)
    if options.command_timeout_s is not None:
        commands = _with_timeout(commands, options.command_timeout_s)
    check_numbered(options, poses, commands)
    return corrected(poses, commands, given, options)


def _numbered(series: list[Series], options: ImportOptions) -> list[Series]:
    """Those of the one robot of a source, under the number that was given."""
    if len(series) != 1 or options.robot_id is None:
        return series
    return [replace(series[0], robot_id=options.robot_id)]


def _read_capture(given: Sources, options: ImportOptions) -> list[PoseSeries]:
    """Series of the one that is given; stamps since the epoch, or since the capture's start."""
    if given.motive:
        up, absolute = options.up or "y", bool(given.io_tsv)
        return read_motive(
            given.motive, options.robots, up, absolute=absolute, only=options.robot_id
        )
    from twinmill.data.importers.vicon import read_vicon  # with SciPy's geometry, 28 MB

    return read_vicon(given.vicon, options.robots, options.up or "z", options.robot_id)


def _read_commands(
    given: Sources,
    options: ImportOptions,
    *,
    of_files: dict[Path, int],
    poses: list[PoseSeries],
) -> list[CommandSeries]:
    """Series of the kind that is given; one table without robots is of the only one with poses."""
    if not given.commands:
        return [read_io_tsv(path, options.robot_id) for path in given.io_tsv]
    numbers = {series.robot_id for series in poses}
    if len(given.commands) == len(numbers) == 1 and options.robot_id is None:
        options = replace(options, robot_id=numbers.pop())
    return _read_tables(given.commands, "commands", options, of_files)


def _read_tables(
    paths: tuple[Path, ...], kind: str, options: ImportOptions, of_files: dict[Path, int]
) -> list:
    """Series of poses or of commands in plain CSV, of all files.

    Args:
        paths: the files.
        kind: `poses` or `commands`.
        options: how to read them.
        of_files: robot_id by file, where its name tells it.
    """
    columns, read = _columns(options, kind), read_poses if kind == "poses" else read_commands
    lacks = columns.lacks_robot
    if len(paths) > 1:
        names = {path.name.split(".")[0]: k for k, path in enumerate(paths, 1)}
        lacks = f"number the files, whose names do not tell their robots: {option('robot', names)}"

    def of(path: Path) -> list:
        number = of_files.get(path, options.robot_id)
        return read(path, replace(columns, robot_id=number, lacks_robot=lacks))

    return read_each(paths, of_files, of, kind)


def _with_timeout(commands: list[CommandSeries], timeout_s: float) -> list[CommandSeries]:
    """Commands that end by themselves, of each robot."""
    if not (np.isfinite(timeout_s) and timeout_s > 0):
        raise LogError(f"{option('command_timeout_s', timeout_s)}: must be a time above 0 s.")
    return [stopped_when_silent(own, timeout_s) for own in commands]


def _geared(commands: list[CommandSeries], factor: float) -> list[CommandSeries]:
    """Wheel speeds multiplied, of each robot that has them."""
    if not (np.isfinite(factor) and factor):
        raise LogError(f"{option('wheel_factor', factor)}: must be a number other than 0.")
    if not any(series.kind == "wheel_speed" for series in commands):
        raise LogError(
            f"{option('wheel_factor', factor)}: does nothing, since the commands are no wheel "
            "speeds; "
            "leave it out."
        )
    return [
        replace(own, value=factor * own.value) if own.kind == "wheel_speed" else own
        for own in commands
    ]


def _detections(
    path: Path,
    options: ImportOptions,
    poses: dict[int, PoseSeries],
    left_out: Collection[int],
) -> list[DetectionSeries]:
    """Detections of robots with known poses, at the time of the poses; none of those left out."""
    read = read_detections(
        path, Columns(options.rename, robot_id=options.robot_id, robots=options.robots)
    )
    series = [own for own in read if own.robot_id not in left_out]
    for own in series:
        where = f"{path.name}: robot {own.robot_id}"
        if own.robot_id not in poses:
            raise LogError(
                f"{where}: has no poses; number robots alike in all files ({option('robot_id')}, "
                f"{option('robot')})."
            )
        pose_us = poses[own.robot_id].utime_us
        if own.utime_us[-1] < pose_us[0] or own.utime_us[0] > pose_us[-1]:
            raise LogError(
                f"{where}: detections from {own.utime_us[0] / 1e6:.3f} s to "
                f"{own.utime_us[-1] / 1e6:.3f} s do not overlap its poses; stamp them with the "
                "clock of the commands."
            )
    return series


def _columns(options: ImportOptions, kind: str) -> Columns:
    """How to read the table of poses, or that of commands."""
    mapping = read_mapping(options.mapping, kind, KNOWN) if options.mapping else None
    topics = options.pose_topics if kind == "poses" else options.command_topics
    return Columns(
        rename=options.rename,
        mapping=mapping,
        topic=topics[0] if topics else None,
        own_renames=options.own_renames,
        robot_id=options.robot_id,
        robots=options.robots,
        up=options.up or "z",
        wheelbase_m=options.wheelbase_m,
    )


def _check_renames(options: ImportOptions, tables: list[Path], detections: Path | None) -> None:
    """Raises LogError where a new name of a column makes no sense, of all robots or of one."""
    mapped: set[str] = set()
    if options.mapping:
        mapped = {k for kind in OF_KINDS for k in read_mapping(options.mapping, kind, KNOWN)}
        tables = []
    for own in (options.rename, *options.own_renames.values()):
        names = {**options.rename, **own}
        if options.mapping and not detections and names.keys() - mapped - KNOWN:
            raise LogError(
                f"{option('rename')}: does nothing beside {option('mapping')}; write it into that "
                "file."
            )
        files = tables + ([detections] if detections else [])
        check_renames(names, files, KNOWN | OF_DETECTIONS, mapped | KNOWN)


def _check_wheelbase(options: ImportOptions, commands: tuple[Path, ...]) -> None:
    """Raises LogError where a wheelbase is given for tables without a steering angle."""
    if options.wheelbase_m is None or not commands:
        return
    mapped = read_mapping(options.mapping, "commands", KNOWN) if options.mapping else ()
    if "steering_rad" not in {*mapped, *names_in(commands, KNOWN, options.rename)}:
        raise LogError(
            f"{option('wheelbase_m')}: no column of the commands is known as a steering angle, "
            "which it is for; say which holds it "
            f"({option('rename', {'COLUMN': 'steering_rad'})}), or leave the option out."
        )


def _exchanged(poses: list[PoseSeries], pairs: Sequence[tuple[int, int]]) -> list[PoseSeries]:
    """Poses under the numbers of the robots that they are of."""
    ids = {series.robot_id: series.robot_id for series in poses}
    for a, b in pairs:
        if unknown := {a, b} - set(ids):
            raise _unknown_robot("exchange", min(unknown), list(ids))
        ids = {k: {a: b, b: a}.get(number, number) for k, number in ids.items()}
    return [replace(series, robot_id=ids[series.robot_id]) for series in poses]


def explain_columns(
    poses: Path | None,
    commands: Path | None,
    topics: tuple[str | None, str | None] = (None, None),
) -> dict[str, tuple[Table, list[Guess]]]:
    """Both tables and what their columns look like, by `poses` and `commands`."""
    given = (("poses", poses, OF_POSES), ("commands", commands, OF_COMMANDS))
    tables = [(*one, topic) for one, topic in zip(given, topics, strict=True) if one[1]]
    read = [(kind, read_columns(path, known), known, topic) for kind, path, known, topic in tables]
    return {kind: (table, explain(table, known, {}, topic)) for kind, table, known, topic in read}


def _check_names(
    options: ImportOptions, given: Sources, series: Sequence[PoseSeries | CommandSeries]
) -> None:
    """Raises LogError where an option names a robot that nothing in the files is of."""
    ids, names = [own.robot_id for own in series], given.names(options, series)
    for name, number in options.robots.items():
        if number not in ids or name not in names:
            known = f" (names are {', '.join(sorted(names))})" if names else ""
            raise LogError(
                f"{option('robot', {name: number})}: no robot in the files has that name{known}; "
                "correct it."
            )
    of_poses = {
        "pose_shift_s": options.pose_shift_s,
        "pose_clock_ppm": options.pose_clock_ppm,
        "heading_offset_deg": options.heading_offset_rad,
        "flip": options.flips,
        "rename": options.own_renames,
    }
    for name, own in of_poses.items():
        named = set(own) - {None} if isinstance(own, Mapping) else set()
        if unknown := named - set(ids):
            raise _unknown_robot(name, min(unknown), ids)


def _unknown_robot(name: str, robot_id: int, ids: Collection[int]) -> LogError:
    return LogError(
        f"{option(name)}: no robot in the files is R{robot_id:02d}, they are "
        f"{', '.join(f'R{k:02d}' for k in sorted(set(ids)))}; correct it."
    )


def _turned(poses: list[PoseSeries], options: ImportOptions) -> list[PoseSeries]:
    """Poses of the bodies whose x axes are the robots' fronts."""
    for number in named_robots(options.heading_offset_rad):
        own = [p for p in poses if number in (None, p.robot_id)]
        if own and not any(np.isfinite(p.orientation_wxyz).any() for p in own):
            raise LogError(
                f"{option('heading_offset_deg')}: no heading was recorded that could be turned; "
                "leave the "
                "option out."
            )
    halves = [_of(p.robot_id, options.heading_offset_rad) / 2 for p in poses]
    turns = [np.array([np.cos(half), 0, 0, np.sin(half)]) for half in halves]
    return [
        replace(p, orientation_wxyz=multiply(p.orientation_wxyz, turn))
        for p, turn in zip(poses, turns, strict=True)
    ]


def _headed(poses: list[PoseSeries], commands: list[CommandSeries]) -> list[PoseSeries]:
    """Poses with the headings of their paths, of robots whose commands are known."""
    told = {series.robot_id: series for series in commands}
    if any(series.world for series in commands):
        raise LogError(
            f"{option('heading_from_path', True)}: world-frame velocities do not tell along which "
            "axis the robot "
            "goes; leave the option out."
        )
    return [
        with_path_heading(series, told[series.robot_id]) if series.robot_id in told else series
        for series in poses
    ]


def _on_our_clock(series: PoseSeries, options: ImportOptions) -> np.ndarray:
    """Stamps without the drift, counted from the first, and shifted."""
    first_us, number = series.utime_us[0], series.robot_id
    gains_ppm = _of(number, options.pose_clock_ppm)
    if not abs(gains_ppm) <= MOST_PPM:
        raise LogError(
            f"{option('pose_clock_ppm', gains_ppm)}: no clock gains or loses more than "
            f"{MOST_PPM:g} ppm, "
            "a tenth of its time; give parts per million."
        )
    gains = 1 + 1e-6 * gains_ppm
    since_us = np.round((series.utime_us - first_us) / gains).astype(np.int64)
    return first_us + since_us + round(1e6 * _of(number, options.pose_shift_s))


def _of(robot_id: int, given: OfRobots) -> float:
    """Option's value for a robot: the one for all plus its own, so that remedies add up."""
    if isinstance(given, Mapping):
        return given.get(None, 0.0) + given.get(robot_id, 0.0)
    return given


def _of_no_run(
    poses: list[PoseSeries],
    commands: list[CommandSeries],
    given: Sources,
    options: ImportOptions,
) -> dict[int, LogError]:
    """Robots whose poses and commands are of no one run, and why, where others' are.

    The remedy is a shift of the poses, or the times at which a bag's messages were received.

    Raises:
        LogError: no robot has both, at the same time, without absurd holds; or two sources of
            commands are for one robot.
    """
    if not commands:
        for p in poses:
            _check_rate(p, bool(given.poses))
        return {}
    ids = [series.robot_id for series in commands]
    if len(set(ids)) < len(ids):
        raise LogError(
            f"two sources of commands are for robot {max(ids, key=ids.count)}; name the "
            "folders by the robots' numbers."
        )
    pairs = [(p, c) for p in poses for c in commands if p.robot_id == c.robot_id]
    if not pairs:
        raise LogError(
            f"poses are of robots {[p.robot_id for p in poses]}, commands of {ids}: no "
            f"robot has both; number them alike, for example with "
            f"{option('robot', {str(ids[0]): poses[0].robot_id})}."
        )
    shift = not given.bag or options.receive_stamps
    wrong = _wrong_times(pairs, given, shift, own=True)
    if len(wrong) == len(pairs):
        raise next(iter(_wrong_times(pairs, given, shift, own=False).values()))
    return wrong


def _wrong_times(
    pairs: list[tuple[PoseSeries, CommandSeries]], given: Sources, shift: bool, own: bool
) -> dict[int, LogError]:
    """Errors of `_check_times` by robot."""
    wrong = {}
    for p, c in pairs:
        try:
            _check_times(p, c, given, shift=shift, own=own)
        except LogError as error:
            wrong[p.robot_id] = error
    return wrong


def _check_times(
    p: PoseSeries, c: CommandSeries, given: Sources, *, shift: bool, own: bool
) -> None:
    """Raises LogError unless poses and commands of a robot are of one time, without long holds.

    Args:
        p: poses of one robot.
        c: its commands.
        given: where they are from.
        shift: the remedy is a shift of the poses ...
        own: ... of this robot alone, since others' are right as they are.
    """
    first_s, last_s = p.utime_us[[0, -1]] / 1e6
    start_s, end_s = c.utime_us[[0, -1]] / 1e6
    _check_unit_of_time(p.robot_id, last_s - first_s, end_s - start_s, given)
    _check_rate(p, bool(given.poses and given.commands))
    if last_s < start_s or (not (c.repeat and shift) and first_s > end_s):
        remedy = (
            "shift the poses, for example so that both start together: "
            + option(
                "pose_shift_s", round(float(start_s - first_s), 3), p.robot_id if own else None
            )
            if shift
            else f"take the times of receipt of both: {option('receive_stamps', True)}"
        )
        raise LogError(
            f"robot {p.robot_id}: poses from {first_s:.3f} to {last_s:.3f} s and commands from "
            f"{start_s:.3f} to {end_s:.3f} s do not overlap; {remedy}."
        )
    hold_s = np.diff(np.append(c.utime_us / 1e6, max(last_s, end_s))).max()
    if hold_s > LONGEST_HOLD_S:
        raise LogError(
            f"robot {p.robot_id}: a command would be held for {hold_s:.0f} s; the "
            "times of commands and poses are not of one run, or mixed up."
        )


def _check_unit_of_time(robot_id: int, poses_s: float, commands_s: float, given: Sources) -> None:
    """Raises LogError where a table lasts a thousand times as long as the other, or more."""
    (short_s, short), (long_s, long) = sorted([(poses_s, "poses"), (commands_s, "commands")])
    for unit, times in TIME_UNITS.items():
        alike = short_s > 0 and abs(long_s / short_s / times - 1) < SAME_LENGTH
        if alike and getattr(given, long):
            raise LogError(
                f"robot {robot_id}: the {long} last {long_s:.0f} s, the {short} {short_s:.1f} s; "
                f"the times of the {long} are in {unit}, so name that column t_{unit}; unless "
                f"those of the {short} are called so and are in s: then name theirs t_s."
            )


def _check_rate(poses: PoseSeries, in_tables: bool) -> None:
    """Raises LogError where poses are so far apart that they tell nothing of a drive.

    Args:
        poses: of one robot.
        in_tables: all stamps are those of tables, whose unit may be another one.
    """
    if len(poses.utime_us) == 1:
        raise LogError(
            f"robot {poses.robot_id}: has one pose, at {poses.utime_us[0] / 1e6:.3f} s, which "
            "tells no motion; record its poses all the time while it drives."
        )
    if len(poses.utime_us) < FEWEST_POSES:
        return
    step_s = float(np.median(np.diff(poses.utime_us))) * 1e-6
    if step_s > SLOWEST_S:
        unit = next((u for u, times in TIME_UNITS.items() if step_s / times < SLOWEST_S), "ns")
        remedy = (
            f"if the times are in {unit}, name that column t_{unit} in all files, or import anew "
            f"with {option('rename', {'t_s': f't_{unit}'})}"
            if in_tables
            else "record them at 10 Hz or more"
        )
        raise LogError(
            f"robot {poses.robot_id}: its poses are {step_s:g} s apart, too far to tell of a "
            f"drive; {remedy}."
        )


def _provenance(sources: list[Path], options: ImportOptions) -> str:
    """TOML for run_t: files with their hashes, and what was changed on the way."""
    files = []
    for path in sources:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        files.append({"name": path.name, "sha256": digest})
    return tomlkit.dumps(
        {
            "import": {
                "files": files,
                "up": options.up or "",
                "path_heading": options.path_heading,
                "same_clock": options.same_clock,
                "pose_shift_s": _in_toml(options.pose_shift_s),
                "pose_clock_ppm": _in_toml(options.pose_clock_ppm),
                "pose_topics": list(options.pose_topics),
                "command_topics": list(options.command_topics),
                "wheelbase_m": options.wheelbase_m or 0.0,
                "full_duty": options.full_duty or 0.0,
                "wheel_factor": 1.0 if options.wheel_factor is None else options.wheel_factor,
                "command_timeout_s": options.command_timeout_s or 0.0,
                "mapping": options.mapping.read_text() if options.mapping else "",
                "flips": _flips_in_toml(options.flips),
                "heading_offset_rad": _in_toml(options.heading_offset_rad),
                "rename": options.rename,
                "own_renames": {f"R{k:02d}": own for k, own in options.own_renames.items()},
                "exchange": [f"R{a:02d}=R{b:02d}" for a, b in options.exchange],
            }
        }
    )


def _in_toml(given: OfRobots) -> float | dict[str, float]:
    """A number, or by robot where one has its own."""
    if not isinstance(given, Mapping) or {*given} <= {None}:
        return _of(0, given)
    return {"all" if k is None else f"R{k:02d}": value for k, value in given.items()}


def _flips_in_toml(flips: Flips) -> list[str]:
    """Names, those of one robot behind its number."""
    return sorted(
        name if k is None else f"R{k:02d}={name}" for k, names in flips.items() for name in names
    )


def _summary(log: Log, out: Path, warnings: list[str], rows: dict[int, int]) -> dict:
    """Result of import_log, gathered by reading the log as everybody else will.

    Args:
        log: as it was written.
        out: where it will be.
        warnings: of the sources.
        rows: of commands in the sources, by robot.
    """
    warnings = warnings + log.warnings
    robots, judged, end_s = [], [], 0.0
    for robot in log.robots.values():
        series = [t for t in (robot.command_t_s, robot.pose_t_s) if len(t)]
        end_s = max(end_s, *(float(t[-1]) for t in series))
        robots.append(
            {
                "robot_id": robot.robot_id,
                "command_kind": robot.command_kind,
                "commands": len(robot.command_t_s),
                "command_rows": rows.get(robot.robot_id, 0),
                "command_changes": int(np.diff(robot.command, axis=0).any(axis=1).sum()),
                "poses": len(robot.pose_t_s),
                "poses_valid": int(robot.valid.sum()),
                **({"detections": len(robot.seen)} if len(robot.seen) else {}),
            }
        )
        if len(robot.pose_t_s) and robot.valid.sum() > 1:
            judged.append(robot)
        elif len(robot.pose_t_s):
            warnings.append(
                f"robot {robot.robot_id}: {robot.valid.sum()} of its {len(robot.pose_t_s)} poses "
                "are valid; nothing of it can be judged, and it is left out there."
            )
    return {
        "out": str(out),
        "robots": robots,
        "messages": sum(robot["commands"] + robot["poses"] for robot in robots),
        "duration_s": end_s,
        "warnings": warnings + _told_of(judged),
    }


def _told_of(robots: Sequence[RobotLog]) -> list[str]:
    """Remarks on cuts and on wrong poses or velocities; a mistake stands alone.

    Cuts and a heading that seems turned may follow from a mistake. Duties and wheel speeds need a
    model to be judged by.
    """
    own_bodies, exchanged = give_back({robot.robot_id: robot for robot in robots}, "")
    robots = list(own_bodies.values())
    found: dict[int, list[InputFinding]] = {robot.robot_id: [] for robot in robots}

    def add(findings: list[InputFinding]) -> None:
        for finding in findings:
            found[finding.robot_id].append(finding)

    of_series = []
    for robot in robots:
        own = own_option(robot.robot_id, len(robots))
        of_one = check_commanded(robot, "") or check_poses(robot, "", own)
        of_series += of_one or check_stamps(robot, None, "", own)
    add(of_all_robots(of_series, {"": len(robots)}))
    sound = [r for r in robots if len(r.command_t_s) and not found[r.robot_id]]
    cleaned = {r.robot_id: ("", make_track(r)) for r in sound}
    add([f for f in check_recorded(list(cleaned.values()), None) if f.fatal])
    add(check_driven([t for k, t in cleaned.items() if not found[k]], None))
    said = [str(f) for f in exchanged]
    for robot in robots:
        number, own, notes = robot.robot_id, found[robot.robot_id], []
        if number in cleaned:
            own = [*own, *check_changes(robot, "")]
            notes = [] if any(f.fatal for f in own) else cleaned[number][1].notes
        words = (*notes, *(f"{f.what}: {f.evidence}; {f.remedy}." for f in own))
        said += [f"robot {number}: {word}" for word in words]
    return said
