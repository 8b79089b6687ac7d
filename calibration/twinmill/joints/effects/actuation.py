# SPDX-License-Identifier: Apache-2.0
"""Effects between command and force: gains, delays, lags, dead zones, play, limits, supplies."""

from collections.abc import Mapping

import numpy as np

from twinmill.joints.action import Action
from twinmill.joints.effects.effect import (
    ActuatorEffect,
    Effect,
    Number,
)
from twinmill.joints.plant import SHARE, Plant

LATE_S = 0.01  # default of a delay or a lag: some periods of a control loop
LONGEST_S = 0.5


class Gain(ActuatorEffect):
    """A motor's constant or a gear that is not the model's; of a servo all its gains."""

    kind = "actuator_gain"
    summary = "The actuator exerts more or less force than the model's for the same command."
    equation = "force *= 1 + more"
    source = "MuJoCo, actuator gainprm and biasprm"
    told_by = ("command",)
    held_in = "mjcf"
    changes = "exact"

    @property
    def parameters(self) -> list[Number]:
        """The share by which it is stronger."""
        return [Number("more", "1", SHARE, -0.99, 10.0)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own numbers."""
        action.model.actuator_gainprm[self.at] *= 1 + values["more"]
        action.model.actuator_biasprm[self.at] *= 1 + values["more"]


class ServoStiffness(ActuatorEffect):
    """The gain of a servo on its position error, apart from that on speed."""

    kind = "servo_stiffness"
    summary = "The servo's gain on its position error (kp) is not the model's."
    equation = "force += kp * more * (command - q)"
    source = "MuJoCo, position/kp"
    told_by = ("command", "position")
    held_in = "mjcf"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each servo with a gain on speed; of others it is `actuator_gain`."""
        speed = plant.mjcf.model.actuator_biasprm[:, 2]
        return [e for e in super().all_of(plant) if plant.mjcf.servo[e.at] and speed[e.at]]

    @property
    def parameters(self) -> list[Number]:
        """The share by which it is larger."""
        return [Number("more", "1", SHARE, -0.99, 10.0)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own numbers."""
        action.model.actuator_gainprm[self.at, 0] *= 1 + values["more"]
        action.model.actuator_biasprm[self.at, 1] *= 1 + values["more"]


class ServoDamping(ActuatorEffect):
    """The gain of a servo on speed."""

    kind = "servo_damping"
    summary = "The servo's gain on speed (kv) is not the model's."
    equation = "force -= more * v"
    source = "MuJoCo, position/kv"
    told_by = ("speed",)
    held_in = "mjcf"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each servo."""
        return [e for e in super().all_of(plant) if plant.mjcf.servo[e.at]]

    @property
    def parameters(self) -> list[Number]:
        """The gain that is added."""
        own = -float(self.plant.mjcf.model.actuator_biasprm[self.at, 2])
        usual = float(self.plant.usual.load[self.joint] / self.plant.usual.speed[self.joint])
        usual = max(usual, own)  # a stiff servo's gain is larger than what its loads ask for
        return [Number("more", self.per_speed, SHARE * usual, -own, 100 * usual)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.actuator_biasprm[self.at, 2] -= values["more"]


class CommandDelay(ActuatorEffect):
    """Commands that act later."""

    kind = "command_delay"
    summary = "Commands act later than in the model."
    equation = "command(t) -> command(t - delay)"
    source = "MuJoCo, actuator delay; Hwangbo et al. 2019, Sci. Robot. 4: latency of actuators"
    told_by = ("past",)
    held_in = "mjcf"
    changes = "exact"

    @property
    def parameters(self) -> list[Number]:
        """The delay that is added."""
        low = -float(self.plant.mjcf.delay_s[self.at])
        return [Number("delay_s", "s", LATE_S, low, LONGEST_S)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """On the command."""
        action.late_s[self.at] += values["delay_s"]


class CommandLag(ActuatorEffect):
    """Commands that are followed with a first-order lag."""

    kind = "command_lag"
    summary = "The actuator follows its command with a first-order lag."
    equation = "lag * dx/dt = command - x"
    source = "MuJoCo, actuator dyntype filterexact"
    told_by = ("past",)
    held_in = "mjcf"
    changes = "exact"

    @property
    def parameters(self) -> list[Number]:
        """The time constant that is added."""
        low = -float(self.plant.mjcf.lag_s[self.at])
        return [Number("lag_s", "s", LATE_S, low, LONGEST_S)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """On the command."""
        action.lag_s[self.at] += values["lag_s"]


class CommandDeadZone(ActuatorEffect):
    """Commands to which a motor does not answer."""

    kind = "command_dead_zone"
    summary = "Small commands do nothing, and larger ones are less by as much."
    equation = "command -> command - clip(command, -width, width)"
    source = "Tao and Kokotovic 1994, IEEE Trans. Autom. Control 39: dead zones"
    told_by = ("command",)
    held_in = None
    changes = "exact"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each motor."""
        return [e for e in super().all_of(plant) if not plant.mjcf.servo[e.at]]

    @property
    def parameters(self) -> list[Number]:
        """Half of its width."""
        return [Number("width", "ctrl", SHARE * self.command, 0.0, 10 * self.command)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """On the command."""
        w = values["width"]
        action.shapes.append((self.at, lambda u: u - np.clip(u, -w, w)))


class CommandPlay(ActuatorEffect):
    """A servo whose gear has play: it turns back only once the play is through."""

    kind = "backlash"
    summary = "The servo's gear has play: after each reversal some of the way is lost."
    equation = "command -> play(command), of half width `width`"
    source = "Nordin and Gutman 2002, Automatica 38: backlash"
    told_by = ("past", "position")
    held_in = None
    changes = "exact"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each servo."""
        return [e for e in super().all_of(plant) if plant.mjcf.servo[e.at]]

    @property
    def parameters(self) -> list[Number]:
        """Half of its width."""
        reach = float(self.plant.usual.reach[self.joint])
        unit = self.plant.mjcf.units[self.joint]
        return [Number("width", unit, SHARE / 5 * reach, 0.0, reach)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """On the command."""
        action.shapes.append((self.at, lambda u: _play(u, values["width"])))


class Saturation(ActuatorEffect):
    """A limit of an actuator's force that the model lacks."""

    kind = "force_limit"
    summary = "The actuator's force has a limit that the model lacks."
    equation = "force -> clip(force, -limit, limit)"
    source = "MuJoCo, actuator forcerange"
    told_by = ("command",)
    held_in = "mjcf"
    changes = "exact"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each actuator that has no limit."""
        limited = plant.mjcf.model.actuator_forcelimited
        return [e for e in super().all_of(plant) if not limited[e.at]]

    @property
    def parameters(self) -> list[Number]:
        """The limit."""
        gear = abs(float(self.plant.mjcf.model.actuator_gear[self.at, 0]))
        usual = float(self.plant.usual.load[self.joint]) / max(gear, 1e-9)
        return [Number("limit", "force", usual, 0.0, 1e3 * usual, "limit")]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """In MuJoCo's own number."""
        action.model.actuator_forcelimited[self.at] = 1
        action.model.actuator_forcerange[self.at] = -values["limit"], values["limit"]


class SupplyDrift(ActuatorEffect):
    """A supply that falls over a log, of one actuator or all alike, or a motor that warms up."""

    kind = "supply_drift"
    summary = "The named actuator, or all alike, becomes weaker over the log, as time goes on."
    equation = "force *= 1 - loss * t / duration"
    source = "Maxon 2023, Motor data and operating ranges: torque constant and voltage"
    told_by = ("time",)
    held_in = "hook"
    changes = "force"

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each actuator, and one for all of several: robots mostly have one supply."""
        each = super().all_of(plant)
        return [*each, cls(plant, 0, "")] if len(each) > 1 else each

    @property
    def joints(self) -> list[int]:
        """Those whose actuators it weakens."""
        return super().joints if self.place else np.unique(self.plant.mjcf.moves).tolist()

    @property
    def parameters(self) -> list[Number]:
        """The share that is lost at the end."""
        return [Number("loss", "1", SHARE, -1.0, 1.0)]

    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """A force that takes away what is lost."""
        since_s = action.series.since_s
        share = since_s / max(since_s.max(), 1e-9)
        own = self.plant.usual.torque[:, self.joints]
        action.force[:, self.joints] -= values["loss"] * share[:, None] * own

    def hook(self, values: Mapping[str, float]) -> str:
        """Python source of that force, from the joint's state and command."""
        return f"{-values['loss']:.6g} * f * min(t / {self.plant.series.since_s.max():.6g}, 1.0)"


def _play(u: np.ndarray, width: float) -> np.ndarray:
    """(n,) what follows a command within a play of so much to either side."""
    out, at = np.empty_like(u), float(u[0])
    for k, value in enumerate(u):
        at = min(max(at, value - width), value + width)
        out[k] = at
    return out
