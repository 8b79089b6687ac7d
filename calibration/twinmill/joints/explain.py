# SPDX-License-Identifier: Apache-2.0
"""The MJCF with what was found: single attributes of its text; what it cannot hold is in a hook."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from twinmill.joints.action import Action
from twinmill.joints.diagnose import JointDiagnosis, Logs, diagnose_joints
from twinmill.joints.effects.effect import Effect
from twinmill.joints.hook import hook_text
from twinmill.joints.mjcf import INERTIAL, Edit, Mjcf
from twinmill.model.model_file import ModelError
from twinmill.model.parameters import catalogue_name, effect_names, instance_of

DIGITS = 6
SAME = 1e-6  # relative: less is the rounding of text
ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder")


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
    added: tuple[str, ...]
    left_out: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill explain --json` of an MJCF."""
        effects = self.diagnosis.problem.effects
        return {
            **self.diagnosis.to_json(),
            "added": [{"effect": name, "in": effects[name].held_in} for name in self.added],
            "left_out": list(self.left_out),
        }


def explain_joints(
    log: Logs,
    model: Mjcf | Path | str,
    progress: Callable[[str], None] = lambda _: None,
    *,
    own: Logs | None = None,
) -> JointExplanation:
    """Diagnoses, and writes the likeliest model: what is missing, the base's numbers beside it.

    What the model always lacked is missing, too. Of a group that cannot be told apart the likeliest
    is added.

    Args:
        log: arrays, or a file of them; or several of one machine.
        model: opened, or its path.
        progress: told in words what is being done.
        own: as of `diagnose_joints`.

    Raises:
        LogError: a log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded or is not judged, or its text is in several files.
    """
    found = diagnose_joints(log, model, progress, own=own)
    mjcf, of = found.mjcf, found.problem.effects
    numbers, base = _likeliest(found)
    each = [(of[catalogue_name(instance)], own) for instance, own in numbers.items()]
    forces = [
        ([mjcf.joints[d] for d in card.joints], (card.name, own), card.hook(own))
        for card, own in each
        if card.held_in == "hook"
    ]
    new = dict.fromkeys([*(found.always.effects if found.always else ()), *found.answer.added])
    return JointExplanation(
        found,
        _written(found, [(card, own) for card, own in each if card.held_in == "mjcf"], base),
        hook_text(mjcf.path.name, forces),
        tuple(n for n in new if of[n].held_in),
        tuple(n for n in new if not of[n].held_in),
    )


def _likeliest(found: JointDiagnosis) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Numbers of each instance of an effect in the likeliest model, and factors of its base.

    They are those of a model without the errors of its equations that were looked at beside it.
    """
    numbers, problem = found.answer.numbers, found.problem
    known = effect_names(problem.base.model)
    mean = numbers.alone @ numbers.mean
    value = dict(zip(numbers.labels, mean.tolist(), strict=True))
    effects = {}
    for instance in effect_names(numbers.model):
        kind = catalogue_name(instance)
        if instance in known or kind in found.answer.added:
            effects[instance] = {
                n.key: float(np.clip(value[f"{instance}.{n.key}"], n.low, n.high))
                for n in problem.effects[kind].parameters
            }
    bounds = zip(problem.prior.names, problem.prior.low, problem.prior.high, strict=True)
    base = {
        name: float(np.clip(value[name], low, high))
        for name, low, high in bounds
        if instance_of(name) == "base"
    }
    return effects, base


def _written(
    found: JointDiagnosis,
    effects: list[tuple[Effect, dict[str, float]]],
    base: Mapping[str, float],
) -> str:
    """The text with what was found in MuJoCo's own numbers.

    Raises:
        ModelError: MuJoCo does not read back what was written.
    """
    plant, mjcf = found.problem.plant, found.mjcf
    action = plant.begin(plant.usual)
    for name, factor in base.items():
        found.problem.catalogue[name].act(action, {"value": factor})
    for effect, values in effects:
        effect.write(action, values)
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
