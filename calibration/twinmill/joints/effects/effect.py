# SPDX-License-Identifier: Apache-2.0
"""Base class of effects: a card, the change in MuJoCo, and how an MJCF holds it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from twinmill.joints.action import SLOW, Action
from twinmill.joints.plant import Plant

HeldIn = Literal["mjcf", "hook"] | None  # stock MuJoCo's file, Python beside it, or neither


@dataclass(frozen=True)
class Number:
    """One number of an effect; it does nothing at 0 unless its role says otherwise.

    Attributes:
        key, unit: its name within the effect.
        value: at the effect's default strength.
        low, high: bounds.
        role: "size", "limit" (acts or not) or "radius" (a shape, no strength).
        step: of finite differences; 0 for the usual share of the value.
    """

    key: str
    unit: str
    value: float
    low: float
    high: float
    role: str = "size"
    step: float = 0.0


@dataclass(frozen=True)
class Effect(ABC):
    """One effect at one place of a robot.

    Attributes:
        plant: the robot in a log.
        at: number of the joint or actuator; 0 for the whole robot.
        place: its name; empty for the whole robot.
    """

    plant: Plant
    at: int
    place: str

    kind: ClassVar[str]
    summary: ClassVar[str]
    equation: ClassVar[str]
    source: ClassVar[str]
    told_by: ClassVar[tuple[str, ...]]  # dependences for which it may be mistaken
    held_in: ClassVar[HeldIn]
    changes: ClassVar[str] = "linear"  # or "force" (adds one, or several), or "exact" (all else)

    @classmethod
    @abstractmethod
    def all_of(cls, plant: Plant) -> list["Effect"]:
        """One for each place at which a robot may have it."""

    @property
    @abstractmethod
    def parameters(self) -> list[Number]:
        """Its numbers."""

    @abstractmethod
    def act(self, action: Action, values: Mapping[str, float]) -> None:
        """Changes what is put into MuJoCo."""

    def write(self, action: Action, values: Mapping[str, float]) -> None:
        """Changes MuJoCo's own numbers, as an MJCF can hold them; where these hold it."""
        self.act(action, values)

    def hook(self, values: Mapping[str, float]) -> str:
        """Force on each joint as a Python expression of q, v, t, and f, its actuators' force.

        Raises:
            NotImplementedError: a hook does not hold the effect.
        """
        raise NotImplementedError(self.name)

    @property
    def name(self) -> str:
        """Kind and place, as answers say them."""
        return f"{self.kind}@{plain(self.place)}" if self.place else self.kind

    @property
    def joint(self) -> int:
        """The joint that it acts on; the first for the whole robot."""
        return self.at

    @property
    def joints(self) -> list[int]:
        """All joints that it acts on."""
        return [self.joint]

    @property
    def unit(self) -> str:
        """Unit of a force on the joint: N of a slide, N m of a hinge."""
        return "N m" if self.plant.mjcf.units[self.joint] == "rad" else "N"

    @property
    def per_speed(self) -> str:
        """Unit of a force over a speed."""
        return "N m s/rad" if self.plant.mjcf.units[self.joint] == "rad" else "N s/m"

    @property
    def per_way(self) -> str:
        """Unit of a force over a way."""
        return "N m/rad" if self.plant.mjcf.units[self.joint] == "rad" else "N/m"

    def words(self) -> tuple[str, ...]:
        """Dependences for which it may be mistaken, with the joints."""
        names = [plain(self.plant.mjcf.joints[d]) for d in self.joints]
        return tuple(f"{word} of {name}" for word in self.told_by for name in names)


class JointEffect(Effect):
    """An effect that each joint may have."""

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each joint."""
        return [cls(plant, d, name) for d, name in enumerate(plant.mjcf.joints)]

    @property
    def load(self) -> float:
        """Usual force on the joint."""
        return float(self.plant.usual.load[self.at])

    @property
    def speed(self) -> float:
        """Usual speed of the joint."""
        return float(self.plant.usual.speed[self.at])

    @property
    def sign(self) -> str:
        """Direction of motion in Python, soft as in `Usual.sign`."""
        return f"np.tanh(v / {SLOW * self.speed:.6g})"


class ActuatorEffect(Effect):
    """An effect that each actuator may have."""

    @classmethod
    def all_of(cls, plant: Plant) -> list[Effect]:
        """One for each actuator."""
        return [cls(plant, a, name) for a, name in enumerate(plant.mjcf.actuators)]

    @property
    def joint(self) -> int:
        """The joint that the actuator moves."""
        return int(self.plant.mjcf.moves[self.at])

    @property
    def command(self) -> float:
        """Usual command, about the position of a servo."""
        return float(self.plant.usual.command[self.at])

    @property
    def servo(self) -> bool:
        """True if it is told a position."""
        return bool(self.plant.mjcf.servo[self.at])


def plain(name: str) -> str:
    """A place's name without the marks that names of numbers are taken apart at."""
    return name.replace(".", "_").replace("#", "_").replace("@", "_")
