# SPDX-License-Identifier: Apache-2.0
"""A model on its way into another simulator: its numbers, and what does not go along."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
import twinmill_native as native

from twinmill.arguments import option
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import card_of, effect_names

HULL_HEIGHT_M = 0.08  # of the body: no model file states it
WHEEL_SHARE = 0.03  # of the robot's mass, each, as in the twin's own MuJoCo robots
WHEEL_WIDTH = 0.8  # of its radius
OF_A_LOG = "clock"  # family of effects that say nothing of the robot
ALL = ("*",)  # parameters of an effect that a file carries whole


@dataclass(frozen=True)
class Left:
    """Something that a file for another simulator does not carry.

    Attributes:
        name: an effect's, or a quantity's.
        why: a clause.
        share: of the squared error that it explains, 0..1; None where nobody has told.
        together_with: other effects that were added at the same time, which the share counts too.
        partly: the file has a part of it, which `why` names.
    """

    name: str
    why: str
    share: float | None = None
    together_with: tuple[str, ...] = ()
    partly: bool = False

    def sentence(self) -> str:
        """Sentence on how the file carries the effect, or why not, with its share of the error."""
        if self.share is None:
            return f"{self.name}: {self.why}"
        others = f", with {' and '.join(self.together_with)}" if self.together_with else ""
        return f"{self.name} ({100 * self.share:.0f} % of the squared error{others}): {self.why}"

    def to_json(self) -> dict:
        """Its fields."""
        return {**vars(self), "together_with": list(self.together_with)}


@dataclass(frozen=True)
class RobotModel:
    """A model file as exporters see it.

    Attributes:
        file: the model file.
        model: of the robot wanted, its own numbers put in.
        shares: of the squared error by effect, as a diagnosis told them.
    """

    file: ModelFile
    model: native.Model
    shares: Mapping[str, float]

    @property
    def name(self) -> str:
        """As the file says, else the file's own; fit for identifiers."""
        text = str(tomlkit.parse(self.file.text).get("name", self.file.path.stem))
        word = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in text)
        return word if word[:1].isalpha() else f"robot_{word}"

    def get(self, name: str) -> float:
        """A number of the model."""
        return self.model.get(name)

    @property
    def wheel_mass_kg(self) -> float:
        """Mass of one wheel, a fixed share of the robot's: no model file states it."""
        return WHEEL_SHARE * self.get("robot.mass_kg")

    @property
    def hull_mass_kg(self) -> float:
        """Mass of the robot without its wheels."""
        return self.get("robot.mass_kg") - len(self.model.wheels()) * self.wheel_mass_kg

    def hull_inertia_kgm2(self) -> tuple[float, float, float]:
        """Moments of a full cylinder about its middle, x, y, z."""
        return _cylinder(self.hull_mass_kg, self.get("robot.body_radius_m"), HULL_HEIGHT_M)

    def wheel_inertia_kgm2(self) -> tuple[float, float, float]:
        """Moments of one wheel, a full cylinder with its axle along z."""
        radius_m = self.get("robot.wheel_radius_m")
        return _cylinder(self.wheel_mass_kg, radius_m, WHEEL_WIDTH * radius_m)

    @property
    def touch_radius_m(self) -> float:
        """Radius at which the hull touches others, by the effects `collision`; never 0."""
        more_m = sum(v["radius_m"] for v in self.values_of("collision"))
        return max(0.001, self.get("robot.body_radius_m") + more_m)

    @property
    def rubbing(self) -> float:
        """Coulomb's coefficient of the hull against others, by the effects `collision`."""
        return sum(v["friction"] for v in self.values_of("collision"))

    def tracked(self) -> tuple[float, float, float]:
        """Place (m) and turn (rad) in the robot's frame of what motion capture sees of it."""
        x_m, y_m = (sum(v[k] for v in self.values_of("marker_offset")) for k in ("x_m", "y_m"))
        return x_m, y_m, sum(v["bias_rad"] for v in self.values_of("heading_bias"))

    def gains(self) -> dict[str, float]:
        """How far it goes of what its wheels make of a command, by the ways that it can go."""
        gains = {
            "ahead": self.get("base.forward_gain") * self.get("theta_a1"),
            "sideways": self.get("base.sideways_gain") * self.get("theta_a1"),
            "turning": self.get("base.yaw_gain") * self.get("theta_a2"),
        }
        if self.model.wheel_kind in ("differential", "ackermann"):
            del gains["sideways"]
        return gains

    def support_radius_m(self) -> float:
        """A ball between the hull's underside, which is at the axles' height, and the floor."""
        return self.get("robot.wheel_radius_m") / 2

    def supports_x_m(self) -> dict[str, float]:
        """Place ahead by name of the balls that hold wheels on one axle level; else none."""
        wheels = self.model.wheels()
        if not wheels or any(wheel["x_m"] for wheel in wheels):
            return {}
        x_m = self.get("robot.body_radius_m") - self.support_radius_m()
        return {"front_support": x_m, "rear_support": -x_m}

    def effects(self) -> list[tuple[str, dict, dict[str, float]]]:
        """Instance name, card and values by parameter of each effect."""
        found = []
        for instance in effect_names(self.model):
            card = card_of(self.model, instance)
            values = {
                p["name"]: self.model.get(f"{instance}.{p['name']}") for p in card["parameters"]
            }
            found.append((instance, card, values))
        return found

    def values_of(self, effect: str) -> list[dict[str, float]]:
        """Parameters of every effect of that name."""
        return [values for _, card, values in self.effects() if card["name"] == effect]

    def base_left(self, why: str, duties: str) -> list[Left]:
        """Duty table, lag and noise of the base, as far as the model has them.

        Args:
            why: none of them is carried.
            duties: why no more of the table is carried than its top speed.
        """
        table = [Left("duty table", duties, partly=True)] if self.model.drive == "duty" else []
        names = ("sensor_m", "sensor_rad", "drive_mps", "drive_radps")
        has = {
            "motor lag": self.get("base.motor_lag_s") > 0,
            "noise": any(self.get(f"noise.{name}") for name in names),
        }
        return [*table, *(Left(name, why) for name, there in has.items() if there)]

    def gains_left(self, where: str) -> list[Left]:
        """How far the real robot goes of what it is told, where wheels roll as they turn."""
        words = {"ahead": "ahead", "sideways": "sideways", "turning": "in turns"}
        gains = {way: f"{g:.3g}" for way, g in self.gains().items()}
        told = [f"{g} times as far {words[way]}" for way, g in gains.items() if g != "1"]
        why = f"{where} the robot moves as told; the real one moves {', '.join(told)}"
        return [Left("gains of speed and turning", why)] if told else []

    def wheels_left(self) -> list[Left]:
        """Wheels that a file needs to stand on, of a robot whose wheels nobody knows."""
        why = "the model knows none; four mecanum ones without a top speed stand in for them"
        return [Left("wheels", why)] if self.model.wheel_kind == "none" else []

    def sensor_left(self, why: str, *, partly: bool = False) -> list[Left]:
        """The camera's bit, if the model has a camera."""
        has = "sensor" in tomlkit.parse(self.file.text)
        return [Left("sensor", why, partly=partly)] if has else []

    def left_effects(
        self,
        target: str,
        carried: Mapping[str, Sequence[str]],
        parts: Mapping[str, str],
        reasons: Mapping[str, str],
    ) -> list[Left]:
        """Effects that are not carried whole; one whose values are all neutral does nothing.

        Args:
            target: what lacks them.
            carried: parameters that the file has, by the effect's name; of ALL: each.
            parts: what it has of another effect, a clause by the effect's name.
            reasons: why it has nothing of another one, where that is not for want of a place.
        """
        left = []
        for instance, card, values in self.effects():
            name, neutral = card["name"], {p["name"]: p["neutral"] for p in card["parameters"]}
            acts = [key for key, value in values.items() if value != neutral.get(key)]
            own = carried.get(name, ())
            missing = [key for key in acts if key not in own and own is not ALL]
            if not missing and (acts or not card["texts"]):
                continue
            has = [key for key in acts if key not in missing]
            if card["family"] == OF_A_LOG:
                why = "belongs to a recording's clocks, not to the robot"
            elif name in parts:
                why = parts[name]
            elif has:
                why = f"{target} has {' and '.join(has)} alone, not {' and '.join(missing)}"
            else:
                why = reasons.get(name, f"{target} has nothing for {card['equation']}")
            share, others = self.share_of(instance)
            left.append(Left(instance, why, share, others, partly=name in parts or bool(has)))
        return left

    def share_of(self, instance: str) -> tuple[float | None, tuple[str, ...]]:
        """Share of the squared error that an effect takes, and the effects that it counts too.

        As a diagnosis told, or as a model file keeps it; else from the scores before and after, of
        effects that were added at the same time and of the base's refit together.
        """
        if instance in self.shares:
            return self.shares[instance], ()
        tables = tomlkit.parse(self.file.text).get("effect", [])
        names = effect_names(self.model)
        own = tables[names.index(instance)]
        if "share" in own:
            return float(own["share"]), ()
        scores = [(t.get("error_before"), t.get("error_after")) for t in tables]
        before, after = scores[names.index(instance)]
        if not before or after is None:
            return None, ()
        same = [n for n, s in zip(names, scores, strict=True) if s == (before, after)]
        share = max(0.0, 1 - (float(after) / float(before)) ** 2)
        return share, tuple(n for n in same if n != instance)


def open_robot(file: ModelFile, robot_id: int | None, diagnosis: Path | None) -> RobotModel:
    """A model, as one robot has it, with what a diagnosis told of its effects.

    Raises:
        ValueError: the diagnosis is none.
    """
    model = file.model if robot_id is None else file.model.for_robot(robot_id)
    return RobotModel(file, model, _shares(diagnosis) if diagnosis else {})


def _shares(path: Path) -> dict[str, float]:
    """Shares of the squared error by effect, from the JSON of `diagnose` or `explain`."""
    try:
        data: Any = json.loads(path.read_text())
        found = data["findings"]
        return {str(f["effect"]): float(f["share"]) for f in found if f["share"] is not None}
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{option('diagnosis', str(path))}: cannot be read.") from error
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(
            f"{option('diagnosis', str(path))}: is not the JSON of a diagnosis; save that there."
        ) from error


def _cylinder(mass_kg: float, radius_m: float, height_m: float) -> tuple[float, float, float]:
    flat = mass_kg * (3 * radius_m**2 + height_m**2) / 12
    return flat, flat, mass_kg * radius_m**2 / 2
