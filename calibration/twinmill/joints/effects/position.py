# SPDX-License-Identifier: Apache-2.0
"""Effects of a joint's position, and forces that always act."""

from collections.abc import Mapping

import numpy as np

from twinmill.joints.action import Action
from twinmill.joints.effects.effect import (
    Effect,
    JointEffect,
    Number,
)
from twinmill.joints.plant import SHARE, Plant


class ForceOffset(JointEffect):
    """A force that always acts: an amplifier's offset, a cable's pull."""

    kind = "force_offset"
    summary = "A constant force acts on the joint."
    equation = "force += offset"
    source = "Janot, Gautier, Brunot 2019, EMPS benchmark: offset of the amplifier"
    told_by = ("position",)
    held_in = "mjcf"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """The force."""
        return [Number("offset", self.unit, SHARE * self.load, -100 * self.load, 100 * self.load)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A force."""
        action.force[:, self.at] += values["offset"]

    def write(self, action: Action, values: Mapping[str, float]) -> None:
        """A bias of the joint's first actuator; of a joint without one MJCF cannot hold it."""
        own = np.flatnonzero(self.plant.mjcf.moves == self.at)
        for a in own[:1]:
            gear = float(action.model.actuator_gear[a, 0])
            action.model.actuator_biasprm[a, 0] += values["offset"] / gear


class EncoderOffset(JointEffect):
    """A joint whose zero is elsewhere than the encoder's."""

    kind = "encoder_offset"
    summary = "The encoder's zero is not the model's."
    equation = "measured position = position + offset"
    source = "Khalil and Dombre 2002, ch. 11: geometric calibration"
    told_by = ("position",)
    held_in = "mjcf"
    changes = "exact"

    @property
    def parameters(self) -> list[Number]:
        """The offset."""
        reach = float(self.plant.usual.reach[self.at])
        unit = self.plant.mjcf.units[self.at]
        return [Number("offset", unit, SHARE * reach / 2, -reach, reach)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """States are where the joint is; a servo holds what the encoder says."""
        action.q[:, self.at] -= values["offset"]
        own = (self.plant.mjcf.moves == self.at) & self.plant.mjcf.servo
        for a in np.flatnonzero(own):
            action.shapes.append((int(a), lambda u: u - values["offset"]))

    def write(self, action: Action, values: Mapping[str, float]) -> None:
        """The joint's ref: its position in the pose of the file."""
        action.model.qpos0[self.at] += values["offset"]


class Stiffness(JointEffect):
    """A spring at the joint: hoses, cables."""

    kind = "joint_stiffness"
    summary = "A spring pulls the joint towards the model's springref."
    equation = "force -= stiffness * (q - springref)"
    source = "MuJoCo, joint/stiffness"
    told_by = ("position",)
    held_in = "mjcf"

    @property
    def parameters(self) -> list[Number]:
        """The stiffness that is added."""
        own = float(self.plant.mjcf.model.jnt_stiffness[self.at])
        usual = 2 * self.load / float(self.plant.usual.reach[self.at])
        return [Number("stiffness", self.per_way, SHARE * usual, -own, 100 * usual)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.jnt_stiffness[self.at] += values["stiffness"]


class Tilt(Effect):
    """A base that does not stand level."""

    kind = "gravity_tilt"
    summary = "The robot's base is tilted against gravity."
    equation = "gravity += g * (about_y, -about_x, 0) for small angles, gravity along z"
    source = "MuJoCo, option/gravity"
    told_by = ("position",)
    held_in = "mjcf"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One, where there is gravity along z."""
        x, y, z = plant.mjcf.model.opt.gravity
        return [cls(plant, 0, "")] if z and not (x or y) else []

    @property
    def parameters(self) -> list[Number]:
        """Two small angles."""
        return [Number(key, "rad", SHARE / 2, -0.5, 0.5) for key in ("about_x", "about_y")]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own numbers."""
        g = float(action.model.opt.gravity[2])
        action.model.opt.gravity[:2] += g * values["about_y"], -g * values["about_x"]
