# SPDX-License-Identifier: Apache-2.0
"""Other signs and other names for what a series holds, from whatever source it was read."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.columns import by_name, read_mapping
from twinmill.data.importers.mapped import names_in
from twinmill.data.importers.options import ImportOptions, Sources
from twinmill.data.importers.plain import INPUTS, KNOWN, OF_COMMANDS, OF_POSES, QUATERNION, VALUES
from twinmill.data.importers.plain import WORLD as OF_WORLD
from twinmill.data.importers.series import CommandSeries, PoseSeries, quaternion_from_heading
from twinmill.data.log import CommandKind, LogError, heading_rad
from twinmill.model.mixing import duties_from_inputs

POSITION = ("x_m", "y_m", "z_m")
WORLD = (*OF_WORLD, "omega_radps")
MIRRORED = np.array([1, -1, 1, -1])  # of a quaternion: turns about x and z, and so the heading
Series = TypeVar("Series", PoseSeries, CommandSeries)


def corrected(
    poses: list[PoseSeries], commands: list[CommandSeries], given: Sources, options: ImportOptions
) -> tuple[list[PoseSeries], list[CommandSeries]]:
    """Series with the names and signs that options give to what they hold.

    What a table calls otherwise was named when it was read; what follows from its columns is here.

    Raises:
        LogError: nothing holds what an option names, or what it says makes no sense.
    """
    every = dict(p for own in (options.rename, *options.own_renames.values()) for p in own.items())
    tables = (given.poses, given.commands)
    done = [names_in(paths, KNOWN, every) if every else set() for paths in tables]
    if options.mapping:
        read = [read_mapping(options.mapping, kind, KNOWN) for kind in ("poses", "commands")]
        done = [
            {*own, *(mapped if paths else ())}
            for own, mapped, paths in zip(done, read, tables, strict=True)
        ]
    _check_held("rename", _by_robot(options), [*poses, *commands], {*done[0], *done[1]})
    named = [
        [renamed(s, {k: v for k, v in _of_robot(s, options).items() if k not in own}) for s in kind]
        for kind, own in zip((poses, commands), done, strict=True)
    ]
    _check_held("flip", options.flips, [*named[0], *named[1]], set())
    poses, commands = (
        [
            flipped(s, {*options.flips.get(None, ()), *options.flips.get(s.robot_id, ())})
            for s in kind
        ]
        for kind in named
    )
    return poses, commands


def _by_robot(options: ImportOptions) -> dict[int | None, Collection[str]]:
    """Names that are given others, of all robots by None."""
    return {None: options.rename, **options.own_renames}


def _of_robot(series: PoseSeries | CommandSeries, options: ImportOptions) -> dict[str, str]:
    return {**options.rename, **options.own_renames.get(series.robot_id, {})}


def _check_held(
    name: str,
    names: Mapping[int | None, Collection[str]],
    every: list[PoseSeries | CommandSeries],
    done: Collection[str],
) -> None:
    """Raises LogError where nothing holds a column that an option names."""
    for number, own in names.items():
        of_robot = [s for s in every if number in (None, s.robot_id)]
        held = set(done).union(*map(columns_of, of_robot)) if own else set()
        if of_robot and (lacking := sorted({*own} - held)):
            raise LogError(
                f"{option(name, lacking[:1], number)}: nothing that was read holds {lacking[0]}; "
                "it holds "
                f"{', '.join(sorted(held))}."
            )


def columns_of(series: PoseSeries | CommandSeries) -> dict[str, np.ndarray]:
    """Columns of a series, by the names that our tables have for them."""
    if isinstance(series, PoseSeries):
        columns = dict(zip(POSITION, series.position_m.T, strict=True))
        if np.isfinite(series.orientation_wxyz).any():
            columns |= zip(QUATERNION, series.orientation_wxyz.T, strict=True)
            columns["theta_rad"] = heading_rad(series.orientation_wxyz)
        return columns
    columns = dict(zip(_names(series), series.value.T, strict=False))
    if np.isfinite(series.inputs).any():
        columns |= zip(INPUTS, series.inputs.T, strict=True)
    return columns


def _names(series: CommandSeries) -> tuple[str, ...]:
    return WORLD if series.world else VALUES[series.kind]


def flipped(series: Series, names: Collection[str]) -> Series:
    """With another sign in those of some columns that it holds."""
    columns = columns_of(series) if names else {}
    changed = {name: -columns[name] for name in names if name in columns}
    if isinstance(series, CommandSeries):
        return _with_commands(series, changed) if changed else series
    if "theta_rad" in changed:
        series = replace(series, orientation_wxyz=series.orientation_wxyz * MIRRORED)
    changed.pop("theta_rad", None)
    return _with_poses(series, columns_of(series) | changed) if changed else series


def renamed(series: Series, renames: Mapping[str, str]) -> Series:
    """With what it holds taken for other columns of ours, or in another unit.

    Raises:
        LogError: two columns would be one, or one that is needed would be missing.
    """
    columns = columns_of(series) if renames else {}
    changed = {}
    for old in set(renames) & set(columns):
        (name, *_), factor = by_name(renames[old], KNOWN)
        if name in columns and name not in renames:
            raise LogError(
                f"{option('rename', {old: renames[old]})}: there is a {name} already; say what "
                "that one is "
                f"as well, as in {option('rename', {name: old})}."
            )
        if name not in (OF_POSES if isinstance(series, PoseSeries) else OF_COMMANDS):
            raise LogError(
                f"{option('rename', {old: renames[old]})}: {old} cannot be {name}; correct it."
            )
        changed[name] = factor * columns[old]
    if not changed:
        return series
    left = {name: values for name, values in columns.items() if name not in renames} | changed
    if isinstance(series, CommandSeries):
        kind, world = _kind_of(left, series)
        series = replace(series, kind=kind, world=world, mixed=series.mixed and not _told(changed))
        return _with_commands(series, left)
    for name in POSITION[:2]:
        if name not in left:
            raise LogError(f"{option('rename')}: leaves no {name}; say which column that is.")
    if "theta_rad" in changed:
        left |= zip(QUATERNION, quaternion_from_heading(left["theta_rad"]).T, strict=True)
    return _with_poses(series, left)


def _kind_of(names: Collection[str], series: CommandSeries) -> tuple[CommandKind, bool]:
    """Kind of command that the columns hold, and True if along the axes of the room."""
    if set(OF_WORLD) <= set(names):
        return "twist", True
    kind = next((k for k, own in VALUES.items() if set(own) <= set(names)), None)
    if kind is None:
        lacking = next(name for name in _names(series) if name not in names)
        raise LogError(f"{option('rename')}: leaves no {lacking}; say which column that is.")
    return kind, False


def _told(names: Collection[str]) -> bool:
    """True if some columns are commands themselves, not inputs that commands follow from."""
    return bool({*names} - {*INPUTS})


def _with_commands(series: CommandSeries, changed: Mapping[str, np.ndarray]) -> CommandSeries:
    value, inputs = series.value.copy(), series.inputs.copy()
    for names, array in ((_names(series), value), (INPUTS, inputs)):
        for k, name in enumerate(names):
            if name in changed:
                array[:, k] = changed[name]
    if series.mixed and set(INPUTS) & set(changed):
        value = np.array([duties_from_inputs(*row) for row in inputs], float)
    return replace(series, value=value, inputs=inputs)


def _with_poses(series: PoseSeries, columns: Mapping[str, np.ndarray]) -> PoseSeries:
    position_m = np.column_stack([columns.get(name, series.position_m[:, 2]) for name in POSITION])
    orientation = series.orientation_wxyz
    if set(QUATERNION) <= set(columns):
        orientation = np.column_stack([columns[name] for name in QUATERNION])
    return replace(series, position_m=position_m, orientation_wxyz=orientation)
