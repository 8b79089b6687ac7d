# SPDX-License-Identifier: Apache-2.0
"""Friction of a joint: constant, with speed, by direction, with load, and near standstill."""

from collections.abc import Mapping

import numpy as np

from twinmill.joints.action import Action
from twinmill.joints.effects.effect import JointEffect, Number
from twinmill.joints.plant import SHARE


class Coulomb(JointEffect):
    """Friction that does not depend on speed; less than the model's where negative."""

    kind = "coulomb_friction"
    summary = "Constant friction of the joint is other than the model's."
    equation = "force -= friction * sign(v)"
    source = "MuJoCo, joint/frictionloss; Olsson et al. 1998, Eur. J. Control 4, ch. 3"
    told_by = ("speed",)
    held_in = "mjcf"
    changes = "exact"  # it decides what is held

    @property
    def parameters(self) -> list[Number]:
        """The friction that is added."""
        own = float(self.plant.mjcf.model.dof_frictionloss[self.at])
        return [Number("friction", self.unit, SHARE * self.load, -own, 100 * self.load)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.dof_frictionloss[self.at] += values["friction"]


class CoulombByDirection(JointEffect):
    """Constant friction that is larger one way than the other."""

    kind = "coulomb_friction_by_direction"
    summary = "Constant friction differs between the two directions of motion."
    equation = "force -= half * |sign(v)|, half = (forward - back) / 2"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30, sec. 3"
    told_by = ("speed", "position")
    held_in = "hook"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """Half of the difference, forward less back."""
        return [Number("half_difference", self.unit, SHARE * self.load, -100 * self.load,
                       100 * self.load)]  # fmt: skip

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A force while the joint moves."""
        sign = self.plant.usual.sign(action.v, self.at)
        action.force[:, self.at] -= values["half_difference"] * np.abs(sign)

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['half_difference']:.6g} * abs({self.sign})"


class Viscous(JointEffect):
    """Friction in proportion to speed."""

    kind = "viscous_friction"
    summary = "Friction with speed is other than the model's."
    equation = "force -= damping * v"
    source = "MuJoCo, joint/damping; Olsson et al. 1998, Eur. J. Control 4, ch. 3"
    told_by = ("speed",)
    held_in = "mjcf"

    @property
    def parameters(self) -> list[Number]:
        """The damping that is added."""
        own, usual = float(self.plant.mjcf.model.dof_damping[self.at]), self.load / self.speed
        return [Number("damping", self.per_speed, SHARE * usual, -own, 100 * usual)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.dof_damping[self.at] += values["damping"]


class ViscousByDirection(JointEffect):
    """Friction with speed that is larger one way than the other."""

    kind = "viscous_friction_by_direction"
    summary = "Friction with speed differs between the two directions of motion."
    equation = "force -= half * |v|, half = (forward - back) / 2"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30, sec. 3"
    told_by = ("speed",)
    held_in = "hook"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """Half of the difference, forward less back."""
        usual = self.load / self.speed
        return [Number("half_difference", self.per_speed, SHARE * usual, -100 * usual,
                       100 * usual)]  # fmt: skip

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A force in proportion to how fast the joint moves, either way."""
        action.force[:, self.at] -= values["half_difference"] * np.abs(action.v[:, self.at])

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['half_difference']:.6g} * abs(v)"


class Drag(JointEffect):
    """Friction with the square of speed."""

    kind = "drag"
    summary = "Friction grows with the square of speed."
    equation = "force -= drag * v * |v|"
    source = "MuJoCo, joint/damping, second number; Swevers et al. 2007, IEEE Control Syst. 27"
    told_by = ("speed",)
    held_in = "mjcf"

    @property
    def parameters(self) -> list[Number]:
        """The drag that is added."""
        own = float(self.plant.mjcf.model.dof_dampingpoly[self.at, 0])
        usual, unit = self.load / self.speed**2, self.per_speed.replace(" s/", " s²/")
        return [Number("drag", f"{unit}²", SHARE * usual, -own, 100 * usual)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.dof_dampingpoly[self.at, 0] += values["drag"]


class Stribeck(JointEffect):
    """Friction that is larger near standstill."""

    kind = "stribeck_friction"
    summary = "Friction is larger when the joint moves slowly."
    equation = "force -= extra * exp(-(v / speed)^2) * sign(v)"
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30, eq. 3"
    told_by = ("speed",)
    held_in = "hook"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """The extra friction, and the speed up to which it acts."""
        slow, unit = SHARE * self.speed, "rad/s" if self.unit == "N m" else "m/s"
        return [
            Number("extra", self.unit, SHARE * self.load, 0.0, 100 * self.load),
            Number("speed", unit, 2 * slow, slow / 2, 10 * slow, "radius"),
        ]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A force that fades with speed."""
        v = action.v[:, self.at]
        near = np.exp(-((v / values["speed"]) ** 2))
        sign = self.plant.usual.sign(action.v, self.at)
        action.force[:, self.at] -= values["extra"] * near * sign

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['extra']:.6g} * np.exp(-((v / {values['speed']:.6g}) ** 2)) * {self.sign}"


class LoadFriction(JointEffect):
    """Friction in proportion to the force that the gear passes on."""

    kind = "load_friction"
    summary = "Friction grows with the force that the actuator exerts, as gears have it."
    equation = "force -= share * |actuator force| * sign(v)"
    source = "Hamon, Gautier, Garrec 2010, IROS: dry friction models with load dependence"
    told_by = ("command", "speed")
    held_in = "hook"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """The share of the force."""
        return [Number("share", "1", SHARE, 0.0, 1.0)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A friction with the base's actuator force."""
        load = np.abs(self.plant.usual.torque[:, self.at])
        sign = self.plant.usual.sign(action.v, self.at)
        action.force[:, self.at] -= values["share"] * load * sign

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['share']:.6g} * abs(f) * {self.sign}"


class FrictionByPosition(JointEffect):
    """Friction that grows along the way of the joint: a guide that is not straight, a preload."""

    kind = "friction_by_position"
    summary = "Constant friction grows from one end of the joint's way to the other."
    equation = "force -= slope * (q - middle) * sign(v)"
    source = "Altintas et al. 2011, CIRP Annals 60: friction of feed drives along the way"
    told_by = ("position",)
    held_in = "hook"
    changes = "force"

    @property
    def parameters(self) -> list[Number]:
        """The slope."""
        usual = 2 * self.load / float(self.plant.usual.reach[self.at])
        return [Number("slope", self.per_way, SHARE * usual, -100 * usual, 100 * usual)]

    @property
    def _middle(self) -> float:
        q = self.plant.series.q[:, self.at]
        return float((q.min() + q.max()) / 2)

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A friction with the way."""
        away = action.q[:, self.at] - self._middle
        sign = self.plant.usual.sign(action.v, self.at)
        action.force[:, self.at] -= values["slope"] * away * sign

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['slope']:.6g} * (q - {self._middle:.6g}) * {self.sign}"
