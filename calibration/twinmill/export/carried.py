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
from twinmill.model.parameters import catalogue_name, catalogue_of, effect_names

HULL_HEIGHT_M = 0.08  # of the body: no model file states it
WHEEL_SHARE = 0.03  # of the robot's mass, each, as in the twin's own MuJoCo robots
WHEEL_WIDTH = 0.8  # of its radius
OF_A_LOG = "clock"  # family of effects that say nothing of the robot


@dataclass(frozen=True)
class Left:
    """Something that a file for another simulator does not carry.

    Attributes:
        name: an effect's, or a quantity's.
        why: a clause.
        share: of the squared error that it explains, 0..1; None where nobody has told.
        together_with: other effects that were added at the same time, which the share counts too.
    """

    name: str
    why: str
    share: float | None = None
    together_with: tuple[str, ...] = ()

    def sentence(self) -> str:
        """What the file carries of the effect, or why not, with its share of the error."""
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
        """Of the robot without its wheels."""
        return self.get("robot.mass_kg") - len(self.model.wheels()) * self.wheel_mass_kg

    def hull_inertia_kgm2(self) -> tuple[float, float, float]:
        """Of a full cylinder about its middle, x, y, z."""
        return _cylinder(self.hull_mass_kg, self.get("robot.body_radius_m"), HULL_HEIGHT_M)

    def wheel_inertia_kgm2(self) -> tuple[float, float, float]:
        """Of one wheel, a full cylinder with its axle along z."""
        radius_m = self.get("robot.wheel_radius_m")
        return _cylinder(self.wheel_mass_kg, radius_m, WHEEL_WIDTH * radius_m)

    @property
    def top_rim_mps(self) -> float | None:
        """Highest rim speed of a duty table; None where the model states none."""
        names = [v["name"] for v in self.model.values()]
        table = [n for n in names if n.startswith("base.wheel_speed_mps.")]
        return max(map(self.get, table)) if self.model.drive == "duty" else None

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
        cards = catalogue_of(self.model)
        found = []
        for instance in effect_names(self.model):
            card = cards[catalogue_name(instance)]
            values = {
                p["name"]: self.model.get(f"{instance}.{p['name']}") for p in card["parameters"]
            }
            found.append((instance, card, values))
        return found

    def base_left(self, why: str) -> list[Left]:
        """Duty table, lag and noise of the base, as far as the model has them."""
        has = {
            "duty table": self.model.drive == "duty",
            "motor lag": self.get("base.motor_lag_s") > 0,
            "noise": True,
        }
        return [Left(name, why) for name, there in has.items() if there]

    def left_effects(self, carried: Sequence[str], target: str) -> list[Left]:
        """Effects that are not among those carried."""
        left = []
        for instance, card, _ in self.effects():
            name = card["name"]
            if name in carried:
                continue
            why = (
                "belongs to a recording's clocks, not to the robot"
                if card["family"] == OF_A_LOG
                else f"{target} has nothing for {card['equation']}"
            )
            share, others = self.share_of(instance)
            left.append(Left(instance, why, share, others))
        return left

    def share_of(self, instance: str) -> tuple[float | None, tuple[str, ...]]:
        """Of the squared error, and the effects that it counts too.

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
    """Of the squared error by effect, from the JSON of `diagnose` or `explain`."""
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
