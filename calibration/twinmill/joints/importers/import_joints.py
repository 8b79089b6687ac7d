# SPDX-License-Identifier: Apache-2.0
"""One log of joints from other people's files: checked against the model, on one clock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from twinmill.arguments import option
from twinmill.data.lcm_log import LogError
from twinmill.joints.checks import check_units, warnings_of
from twinmill.joints.files import COMMAND, POSITION, TIME, VELOCITY
from twinmill.joints.importers.bags import is_bag, read_bag
from twinmill.joints.importers.names import Given, resolved
from twinmill.joints.importers.signals import Recording, Signal
from twinmill.joints.importers.tables import read_table
from twinmill.joints.log import JointLog, joined
from twinmill.joints.mjcf import Mjcf

DEGREE_OFF = 0.25  # relative error of a ratio of 180 / pi that is taken for one; servos lag
TOO_LITTLE = 0.5  # share of the rows below which commands and positions are of other runs


@dataclass(frozen=True)
class ImportedJoints:
    """A log that fits a model.

    Attributes:
        log: with the model's names.
        mjcf: the model.
        notes: how it was read and what is odd about it, in sentences.
    """

    log: JointLog
    mjcf: Mjcf
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Topics:
    """Topics of a bag; empty for the only one that it may be."""

    state: str = ""
    command: str = ""


ANY, NOTHING_SAID = Topics(), Given()


def import_joints(
    files: Path | str | Sequence[Path | str],
    model: Mjcf | Path | str,
    given: Given = NOTHING_SAID,
    topics: Topics = ANY,
) -> ImportedJoints:
    """Reads files of one machine.

    Args:
        files: one recording, or tables that are parts of one, as positions and commands.
        model: opened, or its path; its joints and actuators are looked for.
        given: names and units that the files do not tell.
        topics: of a bag.

    Raises:
        LogError: a file cannot be read, or does not fit the model.
        MissingExtra: a package is not installed that this kind of file needs.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.
    """
    mjcf = model if isinstance(model, Mjcf) else Mjcf.load(model)
    paths = [Path(f) for f in ([files] if isinstance(files, Path | str) else files)]
    stamp = next((old for old, new in given.rename.items() if new == TIME), "")
    runs: list[Recording] = []
    for path in paths:
        bag = is_bag(path)
        runs += read_bag(path, topics.state, topics.command) if bag else read_table(path, stamp)
    if len(paths) > 1:
        if len(runs) > len(paths):
            raise LogError(
                f"{paths[0].name} and others: have several runs each; import one at a time, and "
                "give all logs to diagnose."
            )
        name = ", ".join(r.name for r in runs)
        notes = tuple(note for r in runs for note in r.notes)
        runs = [Recording(name, [s for r in runs for s in r.signals], notes)]
    told = dict.fromkeys(note for run in runs for note in run.notes)
    logs = []
    for run in runs:
        signals, notes = resolved(run, mjcf, given)
        log, more = _on_one_clock(signals, mjcf, run.name)
        told |= dict.fromkeys((*notes, *more))
        logs.append(log)
    log = joined(logs)
    check_units(log, mjcf)
    _check_servos(log, mjcf)
    return ImportedJoints(log, mjcf, (*told, *warnings_of(log, mjcf)))


def _on_one_clock(
    signals: Mapping[str, Signal], mjcf: Mjcf, name: str
) -> tuple[JointLog, list[str]]:
    """Positions at stamps of their own, and the mean command from each to the next.

    That keeps the integral of what was commanded, so that no command becomes later or earlier.
    """
    notes = []
    kept = {target: _finite(s) for target, s in signals.items()}
    lost = sum(len(s.values) for s in signals.values()) - sum(len(s.values) for s in kept.values())
    if lost:
        notes.append(f"{name}: {lost} values that are no numbers were left out.")
    q = [kept[POSITION + joint] for joint in mjcf.joints]
    u = [kept[COMMAND + actuator] for actuator in mjcf.actuators]
    for s in (*q, *u):
        _check_stamps(s, name)
    slowest = min(q, key=lambda s: len(s.t_s))
    t_s = slowest.t_s
    if any(not np.array_equal(s.t_s, t_s) for s in q):
        notes.append(f"{name}: joints have stamps of their own; they are interpolated to those of "
                     f"'{slowest.source}'.")  # fmt: skip
    t_s = t_s[_within(t_s, q, u, name)]
    if len(t_s) < len(slowest.t_s):
        notes.append(f"{name}: {len(slowest.t_s) - len(t_s)} of {len(slowest.t_s)} rows have no "
                     "command, and were left out.")  # fmt: skip
    v = [kept.get(VELOCITY + joint) for joint in mjcf.joints]
    speeds = [s for s in v if s is not None and len(s.t_s) > 1]
    begin_s = float(t_s[0])
    log = JointLog(
        t_s - begin_s,
        np.column_stack([_held(s, t_s) for s in u]),
        np.column_stack([_at(s, t_s) for s in q]),
        np.column_stack([_at(s, t_s) for s in speeds]) if len(speeds) == len(v) else None,
        mjcf.joints,
        mjcf.actuators,
        name=name,
    )
    return log, notes


def _finite(s: Signal) -> Signal:
    good = np.isfinite(s.values) & np.isfinite(s.t_s)
    return s if good.all() else Signal(s.source, s.kind, s.name, s.t_s[good], s.values[good])


def _check_stamps(s: Signal, name: str) -> None:
    """Raises LogError where stamps do not ascend."""
    if len(s.t_s) < 2:
        raise LogError(f"{name}: '{s.source}' has {len(s.t_s)} values; record for longer.")
    back = np.flatnonzero(~(np.diff(s.t_s) > 0))
    if len(back):
        k = int(back[0])
        raise LogError(
            f"{name}: stamps of '{s.source}' do not ascend in {len(back)} places, first in row "
            f"{k + 2}, {s.t_s[k + 1] - s.t_s[k]:.4g} s after the one before; sort the rows, and "
            "leave out what is there twice."
        )


def _within(t_s: np.ndarray, q: list[Signal], u: list[Signal], name: str) -> np.ndarray:
    """True of stamps at which all is known; a command holds for a period of its own.

    Raises:
        LogError: these are too few.
    """
    begin = max([s.t_s[0] for s in u] + [s.t_s[0] for s in q])
    end = min([s.t_s[-1] + np.median(np.diff(s.t_s)) for s in u] + [s.t_s[-1] for s in q])
    good = (t_s >= begin) & (t_s <= end)
    if good.mean() < TOO_LITTLE:
        raise LogError(
            f"{name}: positions go from {t_s[0]:.6g} to {t_s[-1]:.6g} s, and commands from "
            f"{u[0].t_s[0]:.6g} to {u[0].t_s[-1]:.6g} s, so that most have no command; give both "
            "by one clock, and of one run."
        )
    return np.asarray(good)


def _at(s: Signal, t_s: np.ndarray) -> np.ndarray:
    """A signal at some stamps: its own value where it has one then."""
    return np.interp(t_s, s.t_s, s.values)


def _held(s: Signal, t_s: np.ndarray) -> np.ndarray:
    """Mean of a held signal from each stamp to the next; its value at the last."""
    own = np.searchsorted(s.t_s, t_s, side="right") - 1
    at_once = s.values[np.clip(own, 0, None)]
    if len(np.setdiff1d(s.t_s[(s.t_s > t_s[0]) & (s.t_s < t_s[-1])], t_s)) == 0:
        return np.asarray(at_once)
    sums = np.r_[0.0, np.cumsum(np.diff(s.t_s) * s.values[:-1])]
    up_to = sums[own] + (t_s - s.t_s[own]) * at_once
    return np.r_[np.diff(up_to) / np.diff(t_s), at_once[-1:]]


def _check_servos(log: JointLog, mjcf: Mjcf) -> None:
    """Raises LogError where a servo's commands and its joint are in degrees and radians."""
    for a, d in enumerate(mjcf.moves):
        if mjcf.told[a] != "position" or mjcf.units[d] != "rad":
            continue
        moved, told = float(np.std(log.qpos[:, d])), float(np.std(log.ctrl[:, a]))
        for what, other, ratio in (
            ("commands", "positions", told / max(moved, 1e-12)),
            ("positions", "commands", moved / max(told, 1e-12)),
        ):
            if abs(np.log(ratio * np.pi / 180 + 1e-300)) < np.log1p(DEGREE_OFF):
                raise LogError(
                    f"{log.name}: {what} of '{mjcf.actuators[a]}' vary {ratio:.3g} times as much "
                    f"as the {other}: one is in degrees, the other in radians; give both in one "
                    f"unit ({option('degrees')} for degrees), or write it into the column's name, "
                    "as in 'elbow_deg'."
                )
