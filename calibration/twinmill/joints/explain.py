# SPDX-License-Identifier: Apache-2.0
"""The MJCF with what was found: single attributes of its text, and a hook for what it cannot hold.

The hook is a Python file beside the model that needs MuJoCo and numpy alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from twinmill.inference.answer import Named
from twinmill.joints.action import Action
from twinmill.joints.diagnose import JointDiagnosis, Logs, diagnose_joints
from twinmill.joints.effects.effect import Effect
from twinmill.joints.mjcf import INERTIAL, Edit, Mjcf
from twinmill.model.model_file import ModelError

DIGITS = 6
LIKELY = 0.5  # probability from which a model with an effect is the better bet
TOLD = 0.5  # of the prior's width, below which a log tells a number of the base
SAME = 1e-6  # relative: less is the rounding of text
ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder")
HOOK = '''# SPDX-License-Identifier: Apache-2.0
"""Forces that {model} lacks and MJCF cannot hold: call install() before the first mj_step."""

import mujoco
import numpy as np


def add_forces(model, data):
    """Adds them to the passive forces of a step."""
    t = data.time
{lines}


def install():
    """Lets MuJoCo call them in each step."""
    mujoco.set_mjcb_passive(add_forces)
'''
LINE = """    i = model.joint({joint!r}).dofadr[0]
    q, v, f = data.qpos[i], data.qvel[i], data.qfrc_actuator[i]
    data.qfrc_passive[i] += {force}  # {effect}"""


@dataclass(frozen=True)
class JointExplanation:
    """An MJCF with what was found.

    Attributes:
        diagnosis: of the log.
        text: of the new MJCF.
        hook: Python text for what MJCF cannot hold; empty where it holds all.
        added: effects that are in the one or the other.
        left_out: effects that are likely, and in neither: they are no force.
    """

    diagnosis: JointDiagnosis
    text: str
    hook: str
    added: tuple[Named, ...]
    left_out: tuple[Named, ...]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill explain --json` of an MJCF."""
        effects = self.diagnosis.problem.effects
        return {
            **self.diagnosis.to_json(),
            "added": [
                {"effect": n.effect, "in": "mjcf" if effects[n.effect].written else "hook"}
                for n in self.added
            ],
            "left_out": [n.effect for n in self.left_out],
        }


def explain_joints(
    log: Logs,
    model: Mjcf | Path | str,
    progress: Callable[[str], None] = lambda _: None,
) -> JointExplanation:
    """Diagnoses, and adds each effect that is likelier missing than not, the base fitted beside it.

    Of a group that cannot be told apart the likeliest is added.

    Args:
        log: arrays, or a file of them; or several of one machine.
        model: opened, or its path.
        progress: told in words what is being done.

    Raises:
        LogError: the log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded or is not judged, or its text is in several files.
    """
    found = diagnose_joints(log, model, progress)
    effects = found.problem.effects
    sure = [n for n in found.answer.findings if max(n.probability, _of_group(n)) > LIKELY]
    sure, base = _together(sure, found)
    written = [n for n in sure if effects[n.effect].written]
    hooked = [n for n in sure if not effects[n.effect].written and _hook(n, effects)]
    text = _written(found.mjcf, written, base, found)
    added = tuple(n for n in sure if n in written or n in hooked)
    return JointExplanation(
        found,
        text,
        _hooks(found.mjcf, hooked, effects),
        added,
        tuple(n for n in sure if n not in added),
    )


def _together(sure: list[Named], found: JointDiagnosis) -> tuple[list[Named], dict[str, float]]:
    """Effects with their numbers as of the fit of just these, and factors of the base beside them.

    Factors that the log tells no better than the file are left out.
    """
    every = {tuple(sorted(names)): e for names, e in found.fitted.items()}
    own = every.get(tuple(sorted(n.effect for n in sure)))
    if own is None:
        return sure, {}
    h = own.hypothesis
    told = np.sqrt(np.diag(h.posterior(own.linear)[1])) < TOLD * np.sqrt(np.diag(h.cov))
    value = dict(zip(h.labels, h.value.tolist(), strict=True))
    base = {n: value[n] for n, t in zip(h.labels, told, strict=True) if t and n.startswith("base.")}
    numbers = [
        {key: (value[f"{n.effect}.{key}"], std) for key, (_, std) in n.numbers.items()}
        for n in sure
    ]
    return [replace(n, numbers=own) for n, own in zip(sure, numbers, strict=True)], base


def _of_group(named: Named) -> float:
    return named.group_probability if named.certainty == "group" else 0.0


def _values(named: Named) -> dict[str, float]:
    return {key: value for key, (value, _) in named.numbers.items()}


def _hook(named: Named, effects: Mapping[str, Effect]) -> str:
    return effects[named.effect].hook(_values(named))


def _hooks(mjcf: Mjcf, found: list[Named], effects: Mapping[str, Effect]) -> str:
    if not found:
        return ""
    lines = [
        LINE.format(
            joint=mjcf.joints[effects[n.effect].joint], force=_hook(n, effects), effect=n.effect
        )
        for n in found
    ]
    return HOOK.format(model=mjcf.path.name, lines="\n".join(lines))


def _written(
    mjcf: Mjcf, found: list[Named], base: Mapping[str, float], diagnosis: JointDiagnosis
) -> str:
    """The text with what was found in MuJoCo's own numbers.

    Raises:
        ModelError: MuJoCo does not read back what was written.
    """
    action = diagnosis.problem.plant.begin(diagnosis.problem.plant.usual)
    for name, factor in base.items():
        diagnosis.problem.catalogue[name].act(action, {"value": factor})
    for named in found:
        diagnosis.problem.effects[named.effect].write(action, _values(named))
    text = mjcf.edited(edits(mjcf, action))
    try:
        mujoco.MjSpec.from_string(text, assets=_beside(mjcf.path))
    except ValueError as error:
        said = " ".join(str(error).split())
        raise ModelError(f"{mjcf.path}: cannot hold what was found ({said}).") from error
    return text


def _beside(path: Path) -> dict[str, bytes]:
    """Files of the model's folder, which it may name."""
    return {
        str(f.relative_to(path.parent)): f.read_bytes()
        for f in path.parent.rglob("*")
        if f.is_file() and f.suffix.lower() in (".stl", ".obj", ".msh", ".png", ".xml")
    }


def edits(mjcf: Mjcf, action: Action) -> list[Edit]:
    """Attributes in which changed numbers of MuJoCo differ from a file's."""
    old, new, found = mjcf.model, action.model, []
    for d, name in enumerate(mjcf.joints):
        for attribute, of in JOINT.items():
            if len(of(old, d)) != len(of(new, d)) or not _same(of(old, d), of(new, d)):
                turned = attribute == "ref" and mjcf.degrees and mjcf.units[d] == "rad"
                value = np.degrees(of(new, d)) if turned else of(new, d)
                found.append(Edit(("joint",), name, attribute, _text(value)))
    for d, name in enumerate(mjcf.bodies):
        b = int(old.jnt_bodyid[d])
        if not _same([old.body_mass[b]], [new.body_mass[b]]) and b not in old.jnt_bodyid[:d]:
            found += [
                Edit(("body",), name, f"{INERTIAL}{attribute}", _text(value))
                for attribute, value in (
                    ("pos", new.body_ipos[b]),
                    ("quat", new.body_iquat[b]),
                    ("mass", [new.body_mass[b]]),
                    ("diaginertia", new.body_inertia[b]),
                )
            ]
    for a, name in enumerate(mjcf.actuators):
        found += [Edit(ACTUATORS, name, key, value) for key, value in _actuator(mjcf, action, a)]
    if not _same(old.opt.gravity, new.opt.gravity):
        found.append(Edit(("option",), "", "gravity", _text(new.opt.gravity)))
    return found


JOINT: dict[str, Callable[[Any, int], Any]] = {
    "frictionloss": lambda m, d: [m.dof_frictionloss[d]],
    "damping": lambda m, d: np.trim_zeros([m.dof_damping[d], *m.dof_dampingpoly[d]], "b") or [0.0],
    "armature": lambda m, d: [m.dof_armature[d]],
    "stiffness": lambda m, d: [m.jnt_stiffness[d]],
    "ref": lambda m, d: [m.qpos0[d]],
}


def _actuator(mjcf: Mjcf, action: Action, a: int) -> list[tuple[str, str]]:
    """Attributes of an actuator that changed, which then becomes a general one."""
    old, new, told = mjcf.model, action.model, []
    late_s, lag_s = float(action.late_s[a]), float(action.lag_s[a])
    gain, bias = new.actuator_gainprm[a, 0], new.actuator_biasprm[a, :3]
    as_before = old.actuator_gainprm[a, 0], old.actuator_biasprm[a, :3]
    slow = not _same([mjcf.lag_s[a]], [lag_s])
    if slow or not _same(as_before[1][0], bias[0]):
        told += [("general", _text([gain])), ("biastype", "affine"), ("biasprm", _text(bias))]
    elif not _same([as_before[0], *as_before[1]], [gain, *bias]):
        told += [("gain", _text([gain, -bias[2]]) if bias.any() else _text([gain]))]
    if slow:
        told += [("dyntype", "filterexact"), ("dynprm", _text([lag_s]))]
    if not _same([mjcf.delay_s[a]], [late_s]):
        samples = int(np.ceil(late_s / float(old.opt.timestep))) + 1
        told += [("delay", _text([late_s])), ("nsample", str(samples))]
    if new.actuator_forcelimited[a] and not old.actuator_forcelimited[a]:
        told.append(("forcerange", _text(new.actuator_forcerange[a])))
    return told


def _same(one: Any, other: Any) -> bool:
    return bool(np.allclose(one, other, rtol=SAME, atol=0))


def _text(values: Any) -> str:
    """Numbers as an MJCF has them."""
    return " ".join(f"{v:.{DIGITS}g}" for v in values)
