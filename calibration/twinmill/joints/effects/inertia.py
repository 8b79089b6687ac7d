# SPDX-License-Identifier: Apache-2.0
"""Inertia of rotors and links."""

from collections.abc import Mapping

from twinmill.joints.action import Action
from twinmill.joints.effects.effect import Effect, JointEffect, Number
from twinmill.joints.plant import SHARE, Plant


class Armature(JointEffect):
    """Inertia of the rotor, seen through its gear."""

    kind = "armature"
    summary = "Inertia of motor and gear at the joint is other than the model's."
    equation = "inertia += armature"
    source = "MuJoCo, joint/armature; Featherstone 2008, ch. 9.6"
    told_by = ("past",)
    held_in = "mjcf"
    changes = "exact"

    @property
    def parameters(self) -> list[Number]:
        """The armature that is added."""
        own = float(self.plant.mjcf.model.dof_armature[self.at])
        usual = float(self.plant.inertia[:, self.at, self.at].mean())
        unit = "kg m²" if self.unit == "N m" else "kg"
        return [Number("armature", unit, SHARE * usual, -own, 100 * usual)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.dof_armature[self.at] += values["armature"]


class LinkMass(JointEffect):
    """Mass of the link that a joint moves, with its inertia."""

    kind = "link_mass"
    summary = "The link is heavier or lighter than the model's, its shape unchanged."
    equation = "mass *= 1 + more, inertia *= 1 + more"
    source = "MuJoCo, body/inertial; Featherstone 2008, ch. 2.13"
    told_by = ("position", "past")
    held_in = "mjcf"
    changes = "exact"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each link that has a joint, named by its first."""
        bodies = [int(b) for b in plant.mjcf.model.jnt_bodyid]
        first = [d for d, b in enumerate(bodies) if b not in bodies[:d]]
        return [cls(plant, d, plant.mjcf.bodies[d]) for d in first]

    @property
    def _body(self) -> int:
        return int(self.plant.mjcf.model.jnt_bodyid[self.at])

    @property
    def parameters(self) -> list[Number]:
        """The share by which it is heavier."""
        return [Number("more", "1", SHARE, -0.9, 10.0)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own numbers."""
        action.model.body_mass[self._body] *= 1 + values["more"]
        action.model.body_inertia[self._body] *= 1 + values["more"]
