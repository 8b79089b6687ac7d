# SPDX-License-Identifier: Apache-2.0
"""Which joint or actuator of a model a signal belongs to, and in which unit it is.

A name is taken where it is the model's own, but for case, marks between words, a unit, and words
that say what is measured (`Elbow position [deg]`, `shoulder_pan.pos`). Nothing else is guessed.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

import numpy as np

from twinmill.arguments import option
from twinmill.data.lcm_log import LogError
from twinmill.data.units import UNITS, split_unit
from twinmill.joints.files import COMMAND, POSITION, TIME, VELOCITY
from twinmill.joints.importers.signals import KINDS, Recording, Signal
from twinmill.joints.mjcf import Mjcf

WORDS = {  # that say what a column is; where several do, the first of these kinds
    COMMAND: ("ctrl", "cmd", "command", "action", "target", "desired", "setpoint", "goal", "tau",
              "torque", "effort", "u"),
    VELOCITY: ("qvel", "qd", "dq", "vel", "velocity", "speed"),
    POSITION: ("qpos", "q", "pos", "position", "angle", "measured", "state", "actual"),
}  # fmt: skip
KIND_OF = {word: kind for kind, words in WORDS.items() for word in words}
CALLED = {POSITION: "positions", VELOCITY: "velocities", COMMAND: "commands"}
SHOWN = 8  # names in a sentence


@dataclass(frozen=True)
class Given:
    """Names and units that a person tells.

    Attributes:
        rename: new names by old ones: of a joint or an actuator, or with `qpos.` or `ctrl.` before.
        joints, actuators: names of columns without a name, in their order.
        degrees: angles without a unit, and commands to servos that hold them, are in degrees.
    """

    rename: Mapping[str, str] = field(default_factory=dict)
    joints: Sequence[str] = ()
    actuators: Sequence[str] = ()
    degrees: bool = False


def resolved(
    recording: Recording, mjcf: Mjcf, given: Given
) -> tuple[dict[str, Signal], tuple[str, ...]]:
    """Signals in the model's units, by `qpos.JOINT`, `qvel.JOINT`, `ctrl.ACTUATOR`; and notes.

    Raises:
        LogError: one of the model is missing or there twice, or a unit or a new name fits nothing.
    """
    file, found, left = recording.name, dict[str, Signal](), list[str]()
    for signal in _placed(recording, mjcf, given):
        label = given.rename.get(signal.source, given.rename.get(signal.name, signal.name))
        kind, name = _parted(signal.kind, label, mjcf)
        target = _target(kind, name, signal.says, mjcf)
        if target is None:
            left.append(signal.source)
        elif target in found:
            raise LogError(
                f"{file}: '{found[target].source}' and '{signal.source}' are both {target}; name "
                f"one otherwise with {option('rename', f'{signal.source}=unused')}."
            )
        else:
            joint, told = _of_model(kind, target.removeprefix(kind), mjcf)
            factor = _factor(signal, joint, mjcf, given) if told != "effort" else 1.0
            if factor is None:
                raise LogError(f"{file}: {_wrong_unit(signal, joint, mjcf)}")
            found[target] = replace(signal, values=signal.values * factor)
    _check_renames(recording, given)
    _check_all_there(found, left, mjcf, file)
    other = [f"{target} is '{s.source}'" for target, s in found.items() if s.source != target]
    notes = [f"read as {', '.join(other)}."] if other else []
    if left:
        notes.append(f"left out {', '.join(left[:SHOWN])}: the model has none of these.")
    return found, tuple(notes)


def _plain(name: str) -> str:
    """Letters and digits in small, with underscores for all between."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _placed(recording: Recording, mjcf: Mjcf, given: Given) -> list[Signal]:
    """Signals without a name under those of their places.

    Raises:
        LogError: there are others than names.
    """
    out = [s for s in recording.signals if s.name]
    for kind, names, own, argument in (
        (POSITION, given.joints, mjcf.joints, "joints"),
        (VELOCITY, given.joints, mjcf.joints, "joints"),
        (COMMAND, given.actuators, mjcf.actuators, "actuators"),
    ):
        nameless = [s for s in recording.signals if not s.name and s.kind == kind]
        names = names or own
        if nameless and len(nameless) != len(names):
            raise LogError(
                f"{recording.name}: has {len(nameless)} {CALLED[kind]} without names, and there "
                f"are {len(names)} {argument} ({', '.join(names)}); name all of them in their "
                f"order with {option(argument, 'a,b,c')}."
            )
        out += [replace(s, name=name) for s, name in zip(nameless, names, strict=False)]
    return out


def _parted(kind: str, label: str, mjcf: Mjcf) -> tuple[str, str]:
    """Kind and plain name of a signal."""
    for own in KINDS:
        if label.startswith(own):
            return own, _plain(label.removeprefix(own))
    joints, actuators = ({_plain(n) for n in names} for names in (mjcf.joints, mjcf.actuators))
    for name in (_plain(label), _plain(split_unit(label)[0])):
        if name in joints | actuators and (kind or name not in joints):
            return kind or COMMAND, name
    words = _plain(split_unit(label)[0]).split("_")
    said = [k for k in WORDS if k in {KIND_OF.get(word) for word in words}]
    rest = "_".join(word for word in words if word not in KIND_OF)
    return kind or (said[0] if said else ""), rest


def _target(kind: str, name: str, says: str, mjcf: Mjcf) -> str | None:
    """The column of a log that it is; None for none.

    A command may bear the name of the joint that one actuator alone moves.
    """
    if kind in (POSITION, VELOCITY):
        own = [joint for joint in mjcf.joints if _plain(joint) == name]
        return kind + own[0] if own else None
    if kind != COMMAND:
        return None
    acts = [a for a, actuator in enumerate(mjcf.actuators) if _plain(actuator) == name]
    if not acts:
        acts = [a for a, d in enumerate(mjcf.moves) if _plain(mjcf.joints[d]) == name]
    if len(acts) != 1 or (says and says != mjcf.told[acts[0]]):
        return None
    return kind + mjcf.actuators[acts[0]]


def _of_model(kind: str, name: str, mjcf: Mjcf) -> tuple[int, str]:
    """Joint of a column, and what it is: "position", "velocity" or "effort"."""
    if kind == COMMAND:
        a = mjcf.actuators.index(name)
        return int(mjcf.moves[a]), mjcf.told[a]
    return mjcf.joints.index(name), "position" if kind == POSITION else "velocity"


def _factor(signal: Signal, joint: int, mjcf: Mjcf, given: Given) -> float | None:
    """To the unit of a joint: by that in the signal's name, or degrees if these are said.

    None where the unit is one of something else.
    """
    own = _plain(signal.name) in {_plain(n) for n in (*mjcf.joints, *mjcf.actuators)}
    unit = "" if own else split_unit(signal.name)[1]
    if not unit:
        return np.pi / 180 if given.degrees and mjcf.units[joint] == "rad" else 1.0
    ours, factor = UNITS[unit]
    fits = ours.removesuffix("ps") == mjcf.units[joint] and np.isfinite(factor)
    return factor if fits else None


def _wrong_unit(signal: Signal, joint: int, mjcf: Mjcf) -> str:
    what, units = {"rad": ("hinge", "deg or rad"), "m": ("slide", "m or mm")}[mjcf.units[joint]]
    return (
        f"'{signal.source}' is in {split_unit(signal.name)[1]}, and joint '{mjcf.joints[joint]}' "
        f"is a {what}; give it in {units}."
    )


def _check_renames(recording: Recording, given: Given) -> None:
    """Raises LogError where a name to be changed is not there."""
    there = {n for s in recording.signals for n in (s.source, s.name)}
    for old, new in given.rename.items():
        if new != TIME and old not in there:
            near = get_close_matches(old, sorted(there), n=1, cutoff=0)
            raise LogError(
                f"{recording.name}: has no '{old}' to rename; the nearest is "
                f"'{near[0] if near else 'none'}'."
            )


def _check_all_there(found: Mapping[str, Signal], left: list[str], mjcf: Mjcf, file: str) -> None:
    """Raises LogError where a joint or an actuator of the model has no signal."""
    for kind, names, what in (
        (POSITION, mjcf.joints, "joint"),
        (COMMAND, mjcf.actuators, "actuator"),
    ):
        for name in names:
            if kind + name not in found:
                unused = ", ".join(f"'{s}'" for s in left[:SHOWN]) or "nothing"
                example = f"{left[0] if left else 'OLD'}={kind}{name}"
                raise LogError(
                    f"{file}: has no {CALLED[kind]} of {what} '{name}'; left over is {unused}: "
                    f"say which it is with {option('rename', example)}, or take the {what} out of "
                    "the model."
                )
