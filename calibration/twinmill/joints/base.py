# SPDX-License-Identifier: Apache-2.0
"""Numbers of an MJCF that are never quite right, as factors on what the file says."""

from collections.abc import Mapping
from dataclasses import dataclass

from twinmill.joints.action import Action
from twinmill.joints.effects.effect import plain
from twinmill.joints.plant import Plant

ARRAYS = {"damping": "dof_damping", "frictionloss": "dof_frictionloss", "armature": "dof_armature"}


@dataclass(frozen=True)
class Factor:
    """A factor on one number of the model, or on several that go together.

    Attributes:
        arrays: of MuJoCo's model.
        at: row in these.
    """

    arrays: tuple[str, ...]
    at: int

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own numbers."""
        for array in self.arrays:
            getattr(action.model, array)[self.at] *= values["value"]


def base_numbers(plant: Plant) -> dict[str, Factor]:
    """Factors by name: `damping@elbow`; those of numbers that are zero are left out."""
    mjcf, found = plant.mjcf, {}
    for d, joint in enumerate(mjcf.joints):
        for key, array in ARRAYS.items():
            if getattr(mjcf.model, array)[d]:
                found[f"{key}@{plain(joint)}"] = Factor((array,), d)
    for b in dict.fromkeys(map(int, mjcf.model.jnt_bodyid)):
        if mjcf.model.body_mass[b]:
            name = mjcf.bodies[list(mjcf.model.jnt_bodyid).index(b)]
            found[f"mass@{plain(name)}"] = Factor(("body_mass", "body_inertia"), b)
    for a, actuator in enumerate(mjcf.actuators):
        arrays = ("actuator_gainprm", "actuator_biasprm")
        found[f"gain@{plain(actuator)}"] = Factor(arrays, a)
    return found
