# SPDX-License-Identifier: Apache-2.0
"""Hook for effects that MJCF cannot hold: Python beside the model, for MuJoCo and numpy alone.

It says its effects twice: as forces, which stock MuJoCo calls, and with their numbers, so that they
are part of the model when that is judged again.
"""

import ast
from collections.abc import Mapping, Sequence
from pathlib import Path

from twinmill.model.model_file import ModelError

EFFECTS = "EFFECTS"
TEXT = '''# SPDX-License-Identifier: Apache-2.0
"""Forces that {model} lacks and MJCF cannot hold: call install() before the first mj_step."""

import mujoco
import numpy as np

# what these forces are, for Twinmill: it judges the model with them
EFFECTS = [
{effects}
]


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

Held = tuple[str, Mapping[str, float]]  # an effect and its numbers


def hook_beside(model: Path | str) -> Path:
    """Where the hook of an MJCF is, if it has one."""
    path = Path(model)
    return path.with_name(f"{path.stem}_hook.py")


def read_hook(model: Path | str) -> tuple[Held, ...]:
    """Effects in the hook of an MJCF, with their numbers; none without a hook.

    Raises:
        ModelError: there is one, and it does not say its effects.
    """
    path = hook_beside(model)
    if not path.is_file():
        return ()
    try:
        (said,) = (
            ast.literal_eval(node.value)
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == EFFECTS
        )
        return tuple((str(n), {str(k): float(v) for k, v in own.items()}) for n, own in said)
    except (OSError, SyntaxError, ValueError, TypeError, AttributeError) as error:
        raise ModelError(
            f"{path}: says no {EFFECTS}, so that it is not known what its forces are ({error}); "
            "let `twinmill explain` write it again, or move it away."
        ) from error


def hook_text(model: str, forces: Sequence[tuple[Sequence[str], Held, str]]) -> str:
    """The file; empty without any force.

    Args:
        model: name of the MJCF.
        forces: joints, effect, and its force on each as a Python expression of q, v, t, and f.
    """
    if not forces:
        return ""
    lines = [
        LINE.format(joint=joint, force=force, effect=held[0])
        for joints, held, force in forces
        for joint in joints
    ]
    effects = [f"    ({name!r}, {dict(own)!r})," for _, (name, own), _ in forces]
    return TEXT.format(model=model, effects="\n".join(effects), lines="\n".join(lines))
