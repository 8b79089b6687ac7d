# SPDX-License-Identifier: Apache-2.0
"""A model in MuJoCo's own format: opened, and its text changed in single attributes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from twinmill.foreign_text import first_line
from twinmill.joints.hook import Held, read_hook
from twinmill.model.model_file import ModelError

JOINTS = {int(mujoco.mjtJoint.mjJNT_HINGE): "rad", int(mujoco.mjtJoint.mjJNT_SLIDE): "m"}
DYNAMICS = {
    int(mujoco.mjtDyn.mjDYN_NONE): False,
    int(mujoco.mjtDyn.mjDYN_FILTER): True,
    int(mujoco.mjtDyn.mjDYN_FILTEREXACT): True,
}  # True: a lag of its first number in s
ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
TAG = re.compile(r"<!--.*?-->|<([A-Za-z]\w*)((?:\s+[\w:.-]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*)\s*/?>",
                 re.DOTALL)  # fmt: skip
INERTIAL, GAIN, GENERAL = "inertial.", "gain", "general"  # what needs more than an attribute


@dataclass(frozen=True)
class Edit:
    """One attribute of one element of an MJCF, to be written.

    Attributes:
        tags: kinds of elements that it may be.
        name: of the element; empty for the only one of its kind.
        attribute: of it.
        value: as text.
    """

    tags: tuple[str, ...]
    name: str
    attribute: str
    value: str


@dataclass(frozen=True)
class Mjcf:
    """A robot of hinges and slides that is held to the world.

    Attributes:
        path: of the file.
        text: of it.
        model: compiled; commands act at once and undelayed: `lag_s` and `delay_s` are applied to
            the commands instead.
        joints, bodies: names of joints, and of the body that each moves.
        units: of joints, "rad" or "m".
        actuators: names.
        moves: (U,) joint of each actuator.
        lag_s, delay_s: (U,) of the actuators.
        degrees: the text has its angles in degrees.
        hook: effects in the file beside it, with their numbers.
    """

    path: Path
    text: str = field(repr=False)
    model: Any = field(repr=False)
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    units: tuple[str, ...]
    actuators: tuple[str, ...]
    moves: np.ndarray
    lag_s: np.ndarray
    delay_s: np.ndarray
    degrees: bool
    hook: tuple[Held, ...]

    @classmethod
    def load(cls, path: Path | str) -> "Mjcf":
        """Opens a file, and the hook beside it.

        Raises:
            ModelError: MuJoCo cannot load it, or it holds what is not judged.
        """
        path = Path(path)
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            lag, delay = _made_instant(spec, path)
            model = spec.compile()
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            said = str(error).strip().splitlines()
            raise ModelError(
                f"{first_line(path)}: MuJoCo cannot load it ({said[0] if said else error})."
            ) from (error)
        _check(model, path)
        model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_EULER)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
        return cls(
            path,
            text,
            model,
            tuple(_name(model, mujoco.mjtObj.mjOBJ_JOINT, k) for k in range(model.njnt)),
            tuple(
                _name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.jnt_bodyid[k]))
                for k in range(model.njnt)
            ),
            tuple(JOINTS[int(kind)] for kind in model.jnt_type),
            tuple(_name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) for k in range(model.nu)),
            model.actuator_trnid[:, 0].astype(int),
            np.array(lag),
            np.array(delay),
            bool(spec.compiler.degree),
            read_hook(path),
        )

    @cached_property
    def servo(self) -> np.ndarray:
        """(U,) True of actuators that are told a position and hold it."""
        return np.asarray(self.model.actuator_biasprm[:, 1] < 0)

    @cached_property
    def told(self) -> tuple[str, ...]:
        """Kind of command of each actuator: "position", "velocity" or "effort"."""
        speed = (self.model.actuator_biasprm[:, 1] == 0) & (self.model.actuator_biasprm[:, 2] < 0)
        # a motor with damping of its own is told no speed: its gain is not that of the damping
        speed &= np.isclose(self.model.actuator_gainprm[:, 0], -self.model.actuator_biasprm[:, 2])
        both = zip(self.servo, speed, strict=True)
        return tuple("position" if p else "velocity" if v else "effort" for p, v in both)

    def edited(self, edits: Sequence[Edit]) -> str:
        """The text with other attributes, and nothing else changed.

        Raises:
            ModelError: an element does not stand in this file.
        """
        text = self.text
        for edit in edits:
            text = _edited(text, edit, self.path)
        return text


def _made_instant(spec: Any, path: Path) -> tuple[list[float], list[float]]:
    """Takes lags and delays of actuators out of a model, and returns these in s.

    Raises:
        ModelError: an actuator has a state of another kind.
    """
    lags, delays = [], []
    for actuator in spec.actuators:
        kind = int(actuator.dyntype)
        if kind not in DYNAMICS:
            raise ModelError(
                f"{path}: actuator '{actuator.name}' is a {mujoco.mjtDyn(kind).name[6:].lower()}; "
                "motors, servos and first-order lags are judged."
            )
        lags.append(float(actuator.dynprm[0]) if DYNAMICS[kind] else 0.0)
        delays.append(float(actuator.delay))
        actuator.dyntype, actuator.delay, actuator.nsample = mujoco.mjtDyn.mjDYN_NONE, 0.0, 0
        actuator.actlimited = 0
    return lags, delays


def _check(model: Any, path: Path) -> None:
    """Raises ModelError where a model holds what is not judged."""
    odd = [k for k, kind in enumerate(model.jnt_type) if int(kind) not in JOINTS]
    if odd:
        name = _name(model, mujoco.mjtObj.mjOBJ_JOINT, odd[0])
        raise ModelError(
            f"{path}: joint '{name}' is neither a hinge nor a slide; robots that are held to the "
            "world are judged: take a free joint out, and log with the base held."
        )
    if not model.njnt or not model.nu:
        raise ModelError(f"{path}: has no joint or no actuator, so that there is nothing to judge.")
    for k in range(model.nu):
        if int(model.actuator_trntype[k]) not in ON_JOINT:
            name = _name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k)
            raise ModelError(
                f"{path}: actuator '{name}' acts on no joint (but on a tendon, site or body); "
                "actuators of joints are judged."
            )
    for kind, count in ((mujoco.mjtObj.mjOBJ_JOINT, model.njnt),
                        (mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu)):  # fmt: skip
        if any(mujoco.mj_id2name(model, kind, k) is None for k in range(count)):
            what = "joint" if kind == mujoco.mjtObj.mjOBJ_JOINT else "actuator"
            raise ModelError(f"{path}: a {what} has no name; name all of them.")


def _name(model: Any, kind: Any, k: int) -> str:
    return str(mujoco.mj_id2name(model, kind, k) or f"{kind.name[6:].lower()}{k}")


def _edited(text: str, edit: Edit, path: Path) -> str:
    for found in TAG.finditer(text):
        if found[1] not in edit.tags:
            continue
        tag = found[0]
        if edit.name and _attribute(tag, "name") != edit.name:
            continue
        if edit.attribute.startswith(INERTIAL):
            return text[: found.end()] + _with_inertial(text[found.end() :], edit)
        new = _with_gain(tag, edit) if edit.attribute in (GAIN, GENERAL) else _with(tag, edit)
        return text[: found.start()] + new + text[found.end() :]
    raise ModelError(
        f"{path}: has no <{edit.tags[0]}> '{edit.name}' in its own text (a file that it includes "
        "may); write the model into one file with mj_saveLastXML."
    )


def _with_gain(tag: str, edit: Edit) -> str:
    """An actuator's tag with another gain, in the words of its kind, or as a general one.

    A motor's gain is in its gear, a servo's is kp, and kv behind it.
    """
    kind, name = re.match(r"<(\w+)", tag)[1], edit.name  # type: ignore[index]
    values = edit.value.split()
    if edit.attribute == GAIN and kind == "motor":
        gear = (_attribute(tag, "gear") or "1").split()
        scaled = f"{float(gear[0]) * float(values[0]):.6g}"
        return _with(tag, Edit((kind,), name, "gear", " ".join([scaled, *gear[1:]])))
    if edit.attribute == GAIN and kind == "position":
        tag = _without(tag, "dampratio")
        for key, value in zip(("kp", "kv"), values, strict=False):
            tag = _with(tag, Edit((kind,), name, key, value))
        return tag
    tag = f"<general{tag.removeprefix(f'<{kind}')}"
    for key in ("kp", "kv", "dampratio", "timeconst", "inheritrange"):
        tag = _without(tag, key)
    told = {"gaintype": "fixed", "gainprm": values[0]}
    if edit.attribute == GAIN and len(values) > 1:
        told |= {"biastype": "affine", "biasprm": f"0 -{values[0]} -{values[1]}"}
    for key, value in told.items():
        tag = _with(tag, Edit((kind,), name, key, value))
    return tag


def _without(tag: str, attribute: str) -> str:
    return re.sub(rf"\s{attribute}\s*=\s*(\"[^\"]*\"|'[^']*')", "", tag)


def _with_inertial(after: str, edit: Edit) -> str:
    """The text after a body's tag, with an attribute of the body's own inertial element set."""
    own = replace(edit, attribute=edit.attribute.removeprefix(INERTIAL))
    for found in TAG.finditer(after):
        if found[1] == "inertial":
            tag = _without(found[0], "fullinertia")
            return after[: found.start()] + _with(tag, own) + after[found.end() :]
        if found[1] == "body":
            break
    return f'\n<inertial {own.attribute}="{own.value}"/>' + after


def _attribute(tag: str, name: str) -> str | None:
    found = re.search(rf"\s{name}\s*=\s*(\"([^\"]*)\"|'([^']*)')", tag)
    return None if found is None else found[2] if found[2] is not None else found[3]


def _with(tag: str, edit: Edit) -> str:
    """A tag with an attribute set."""
    written = f'{edit.attribute}="{edit.value}"'
    if _attribute(tag, edit.attribute) is not None:
        return re.sub(
            rf"(\s){edit.attribute}\s*=\s*(\"[^\"]*\"|'[^']*')", lambda m: m[1] + written, tag
        )
    end = "/>" if tag.endswith("/>") else ">"
    return f"{tag.removesuffix(end).rstrip()} {written}{end}"
