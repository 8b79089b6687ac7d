# SPDX-License-Identifier: Apache-2.0
"""Parameters of a model: what a fit may change, within which bounds, and what is usual."""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from typing import Any, Protocol

import twinmill_native as native

MOTION_STAGES = ("duty", "wheel", "ground", "observe")  # what the path of one robot shows
CAMERA_STAGES = ("view", "decide")  # what detections show
CLOCK, CLOCK_RATE = "clock.offset_s", "clock.rate_ppm"
HEADING = "frame.heading_rad"  # that a robot holds in a log that does not record it
WHEEL_ANGLES = tuple(f"frame.wheel_{k}_rad" for k in range(4))  # at which the wheels begin a log
ALIGNMENT = (CLOCK, CLOCK_RATE, HEADING, *WHEEL_ANGLES)  # of one log, not of a robot
NORMAL_95 = 1.96  # standard errors to either side
GAINS = ("theta_a1", "theta_a2")  # of one robot: speed, and rate of turn
BASE_GAINS = ("base.forward_gain", "base.sideways_gain", "base.yaw_gain")
LAG = "base.motor_lag_s"
LEVER_EFFECT = "marker_offset"  # its x_m and y_m are where the tracked point is
LAG_EFFECT = "motor_lag"  # adds to LAG: beside it only their sum can be told

# Standard deviations of the base's priors: as robots differ from their data sheets.
ANY_ANGLE_RAD = 10.0  # so wide that it draws an angle nowhere
PHASE_STD_RAD = 0.5  # around the best of a whole period, which is looked for before
PHASE_STEP_RAD = 0.05
USUAL_STD = {
    LAG: 0.3,
    CLOCK: 0.3,
    CLOCK_RATE: 30.0,
    HEADING: 1.0,
    **dict.fromkeys(WHEEL_ANGLES, ANY_ANGLE_RAD),
}
GAIN_STD = 0.15
ROUGH = 0.3  # standard deviation of what is known to a factor of the root of two, share
BASE_STEP = {
    LAG: 0.004,
    CLOCK: 0.006,
    CLOCK_RATE: 5.0,
    HEADING: 0.005,
    **dict.fromkeys(WHEEL_ANGLES, 0.01),
}
GAIN_STEP = 0.004
# Which part of a robot's lateness an effect changes, by its stage; "lag" at the others.
LATE_PARTS = {"duty": "delay", "observe": "clock"}
DURATION = "duration"  # role of how long an effect takes to come
# Roles of what says where an effect is, or from when on.
WHERE_OR_WHEN = ("place", "moment", DURATION)
PHASE = "phase"  # role of where a formula's period is when a log begins
NO_SIZE = (*WHERE_OR_WHEN, "radius", PHASE)  # roles that say nothing of how strong an effect is
EFFECT_STEP = 0.05  # times the distance of an effect's default from its neutral value
UNKNOWN = 20.0  # so many times what is known of the size of a formula's number it may be
# `sin(0.2*t + p1)`, `cos(t/5 - p3)`: what ends the angle of a wave of the time.
IN_A_WAVE = re.compile(r"\b(?:sin|cos)\(([^()]*\bt\b[^()]*)[+-]\s*([A-Za-z]\w*)\s*\)")
RATES = {"state_rate": "s", "second_rate": "r"}  # texts of a formula, and states of which they are
FORMULAS = ("formula", *RATES)  # those of its texts that compute
FORMULA_NUMBERS = ("p0", "p1", "p2", "p3")  # where its author has no names for them


@dataclass(frozen=True)
class Parameter:
    """One free quantity of a fit.

    Attributes:
        name, unit: in the model.
        value: where the fit begins.
        min, max: bounds.
        usual: centre of the prior.
        std: standard deviation of the prior.
        step: of finite differences.
        central: differences are taken to both sides, where times make one-sided ones crude.
        role: "size", "place" (where in the room), "moment" or "lateness", as on the effect's card;
            or PHASE.
        strength: an effect's default less its neutral value.
        words: what it is, where its name does not say so: `speed at 50 % duty`.
        prior: the prior was given as what is known; else it is weak, about a usual size.
    """

    name: str
    unit: str
    value: float
    min: float
    max: float
    usual: float
    std: float
    step: float
    central: bool = False
    role: str = "size"
    strength: float = 0.0
    words: str = ""
    prior: bool = False

    def at(self, value: float) -> "Parameter":
        """A parameter that starts elsewhere; the prior of a place or a moment moves with it."""
        return replace(self, value=value, usual=value if self.role in NO_SIZE else self.usual)


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted quantity.

    Attributes:
        std: half of a 95 % interval over 1.96, from left-out blocks.
        at_bound: it ended at a bound.
        seen: false where the log does not tell it by itself, and the prior holds it.
        together: the log tells it once others are known, as left wheels of which the sum is told.
        words, prior: as of the parameter.
    """

    name: str
    value: float
    std: float
    unit: str
    at_bound: bool
    seen: bool
    together: bool = False
    words: str = ""
    prior: bool = False

    @property
    def told(self) -> bool:
        """True if the log determines it, by itself or in combination with others."""
        return self.seen or self.together

    @property
    def short(self) -> str:
        """For people: its words, or its name without the effect's before."""
        return self.words or key_of(self.name)

    @property
    def of_unit(self) -> str:
        """The unit behind a number, for people; nothing behind a pure one."""
        return "" if self.unit == "1" else f" {self.unit.replace('^2', '²')}"

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return vars(self)


def instance_of(name: str) -> str:
    """Whose a quantity is: `dead_zone#2` of `dead_zone#2.width`, `base` of `base.motor_lag_s`."""
    return name.split(".", 1)[0]


def key_of(name: str) -> str:
    """A quantity without whose it is: `width` of `dead_zone#2.width`; else as it stands."""
    return name.split(".", 1)[-1]


def catalogue_name(name: str) -> str:
    """The catalogue's name of an instance of an effect, or of the effect that a quantity is of."""
    return instance_of(name).split("#")[0]


@cache
def catalogue() -> dict[str, dict[str, Any]]:
    """The twin's effects by name."""
    return {entry["name"]: entry for entry in native.catalogue()}


def find_effect(name: str) -> dict[str, Any]:
    """The catalogue's entry of that name.

    Raises:
        ValueError: there is none; the message names the nearest.
    """
    entries = catalogue()
    if name in entries:
        return entries[name]
    near = get_close_matches(name, entries, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]}?" if near else "`twinmill twin effects` lists them all."
    raise ValueError(f"effect '{name}': not in the catalogue; {hint}")


def is_of_camera(effect: str) -> bool:
    """True if an effect changes what a camera sees, and not the motion; false of unknown names."""
    return effect in catalogue() and catalogue()[effect]["stage"] in CAMERA_STAGES


def needing(need: str) -> list[str]:
    """Effects that show only in data that hold this, as `needs` on their cards says."""
    return [name for name, entry in catalogue().items() if entry["needs"] == need]


def acting_by_wheel_angle(model: native.Model) -> list[str]:
    """Instances of a model's effects that depend on where a wheel stands in its turn."""
    phased = needing("wheel_angle")
    return [
        instance
        for instance, texts in zip(effect_names(model), model.texts, strict=True)
        if catalogue_name(instance) in phased or "angle" in words_of(texts)
    ]


def starting_angles(model: native.Model) -> list[Parameter]:
    """Angles at which the wheels begin a log, from where the model has them; none if none acts."""
    if not acting_by_wheel_angle(model):
        return []
    return base_parameters(model, WHEEL_ANGLES[: len(model.wheels())])


def phases(model: native.Model) -> list[Parameter]:
    """Where the periods of a model's formulas are when a log begins, from where the model has them.

    They are the numbers that do nothing but to end the angle of a wave of the time: no other log
    begins at the same moment of the period.
    """
    found = []
    for instance, texts in zip(effect_names(model), model.texts, strict=True):
        found += [f"{instance}.{key}" for key in _phase_keys(texts)]
    values = {v["name"]: v for v in model.values()} if found else {}
    return [_phase(values[name]) for name in found]


def _phase_keys(texts: Mapping[str, str]) -> list[str]:
    """Numbers of a formula that are phases in an effect's texts."""
    whole = " ".join(texts.get(key, "") for key in FORMULAS)
    at = [key for _, key in IN_A_WAVE.findall(whole) if key in numbers_of(texts)]
    return [k for k in dict.fromkeys(at) if len(re.findall(rf"\b{k}\b", whole)) == at.count(k)]


def _phase(v: dict[str, Any]) -> Parameter:
    at = v["value"]
    return Parameter(
        name=v["name"],
        unit="rad",
        value=at,
        min=v["min"],
        max=v["max"],
        usual=at,
        std=PHASE_STD_RAD,
        step=PHASE_STEP_RAD,
        central=True,
        role=PHASE,
        words="moment of its period at which the log begins",
    )


def of_each_log(model: native.Model) -> list[Parameter]:
    """Parameters of each log alone: wheels' angles at the start, if any acts, and phases."""
    return [*starting_angles(model), *phases(model)]


def take_alignment(model: native.Model, of: native.Model) -> None:
    """Sets a model to the clock, heading, angles and phases of another one of the same log.

    Phases of a formula that the other one lacks stay.
    """
    texts = dict(zip(effect_names(of), of.texts, strict=True))
    own = dict(zip(effect_names(model), model.texts, strict=True))
    alike = {name for name, text in own.items() if texts.get(name) == text}
    known = [p.name for p in phases(model) if instance_of(p.name) in alike]
    for name in (*ALIGNMENT, *known):
        model.set(name, of.get(name))


def unevenness(model: native.Model, wheel: str) -> float:
    """Ripple of a wheel over its angle, relative to its speed; 0 if only a formula describes it."""
    own = [
        model.get(f"{instance}.{p['name']}")
        for instance in acting_by_wheel_angle(model)
        for p in card_of(model, instance)["parameters"]
        if p["name"].startswith(f"{wheel}_")
    ]
    return math.hypot(*own)


def drives_sideways(model: native.Model) -> bool:
    """True if a robot on such wheels can drive sideways, or its wheels are unknown."""
    return model.wheel_kind not in ("differential", "ackermann")


def gains_of(model: native.Model) -> list[str]:
    """Gains of the base that a robot on such wheels has."""
    return [n for n in BASE_GAINS if drives_sideways(model) or n != BASE_GAINS[1]]


def with_role(effect: str, role: str) -> list[str]:
    """Parameters of an effect that have this role on its card; none of what is no effect."""
    card = catalogue().get(effect, {"parameters": ()})
    return [p["name"] for p in card["parameters"] if p["role"] == role]


def beginning_at_a_moment() -> list[str]:
    """Effects that act from a moment of their log on."""
    return [name for name in catalogue() if with_role(name, "moment")]


def lasts_for_a_while(effect: str) -> bool:
    """True if an effect begins at one time of its log and ends at another."""
    return len(with_role(effect, "moment")) > 1


def is_local(effect: str) -> bool:
    """True if an effect may lie in one part of a log: a transient, or one at a place."""
    return lasts_for_a_while(effect) or bool(with_role(effect, "place"))


def late_part(effect: str) -> tuple[str, str] | None:
    """Kind of lateness of an effect, and its parameter; None if it makes nothing late.

    Returns:
        "lag", "delay" or "clock", and the parameter of role "lateness".
    """
    own = with_role(effect, "lateness")
    return (LATE_PARTS.get(catalogue()[effect]["stage"], "lag"), own[0]) if own else None


def making_late(part: str) -> list[str]:
    """Effects whose `late_part` this is."""
    return [name for name in catalogue() if (late := late_part(name)) and late[0] == part]


_of_kind: dict[tuple[str, str, int], dict[str, dict[str, Any]]] = {}


def catalogue_of(model: native.Model) -> dict[str, dict[str, Any]]:
    """Effects that a robot like the model's can have, parameters by its own wheels."""
    kind = (model.wheel_kind, model.drive, len(model.wheels()))
    if kind not in _of_kind:
        _of_kind[kind] = {entry["name"]: entry for entry in model.catalogue()}
    return _of_kind[kind]


class Instances(Protocol):
    """A model that names its effects; the twin's, or one of joints."""

    @property
    def instances(self) -> Sequence[str]:
        """Names of its effects in their order, each once."""
        ...


def effect_names(model: Instances) -> list[str]:
    """Instance names of a model's effects in their order.

    They are `dead_zone` and `dead_zone#2`; `equation#air` is a formula that its author calls air.
    """
    return list(model.instances)


def numbered(names: Sequence[str]) -> list[str]:
    """Names of which each stands once: the second `dead_zone` is `dead_zone#2`."""
    seen: dict[str, int] = {}
    told = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        told.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return told


def card_of(model: native.Model, instance: str) -> dict[str, Any]:
    """Card of one effect of a model, with the parameters that it has there.

    Those of a formula have the names and units that its author gave them.
    """
    card = catalogue_of(model)[catalogue_name(instance)]
    if not card["texts"]:
        return card
    place = effect_names(model).index(instance)
    own: dict[str, Any] = model.cards[place]
    return {**own, "equation": equation_of(model.texts[place])}


def equation_of(texts: Mapping[str, str]) -> str:
    """Formula of an effect in one line, with what it is added to and the rates of its states."""
    rates = [f"d{of}/dt = {texts[key]}" for key, of in RATES.items() if texts.get(key)]
    start = f"{' = '.join(list(RATES.values())[: len(rates)])} = 0 at the start"
    to = texts["adds_to"]
    return ", ".join([f"{to}' = {to} + {texts['formula']}", *rates, *([start] if rates else [])])


def newest_instance(model: native.Model, effect: str) -> str:
    """Name of the instance of an effect that was added last.

    Raises:
        IndexError: the model has none.
    """
    return [n for n in effect_names(model) if catalogue_name(n) == effect][-1]


def base_parameters(model: native.Model, names: Iterable[str]) -> list[Parameter]:
    """Quantities of the base by name; the centre of each prior is the model's value."""
    values = {v["name"]: v for v in model.values()}
    found = []
    for name in names:
        v = values[name]
        std, step = USUAL_STD.get(name, GAIN_STD), BASE_STEP.get(name, GAIN_STEP)
        timed = name in (LAG, CLOCK)
        at = v["value"]
        found.append(
            Parameter(
                name=name,
                unit=v["unit"],
                value=at,
                min=v["min"],
                max=v["max"],
                usual=at,
                std=std,
                step=step,
                central=timed,
                words=v["doc"],
            )
        )
    return found


def begun_about(parameters: Iterable[Parameter], near: Mapping[str, float]) -> list[Parameter]:
    """Quantities, those of some names begun at rough values.

    Their priors are there, and as wide as these are rough.
    """
    return [
        replace(p, value=v, usual=v, std=max(p.std, ROUGH * abs(v)))
        if (v := near.get(p.name)) is not None
        else p
        for p in parameters
    ]


def begun_at(parameters: Iterable[Parameter], start: Mapping[str, float]) -> list[Parameter]:
    """Quantities begun where a start says; a place in the room is usual where it begins."""
    return [_told_lever(p.at(start.get(p.name, p.value))) for p in parameters]


def _told_lever(p: Parameter) -> Parameter:
    """A lever that a model or a log tells may be as long as it is, however long levers usually are.

    Other quantities as they are.
    """
    of_lever = catalogue_name(p.name) == LEVER_EFFECT
    return replace(p, std=max(p.std, abs(p.value))) if of_lever else p


def effect_parameters(
    model: native.Model, instance: str, fresh: bool = False, gradual: bool = False
) -> list[Parameter]:
    """Free quantities of one effect of a model; a fresh one begins at its defaults.

    How long an effect takes to come is free if it may be `gradual`.

    Of a formula only those parameters that it names are free, but for its phases, which are of one
    log; nothing is known of their size but that they are no larger by far than 1, or than they are
    in the model.
    """
    place = effect_names(model).index(instance)
    texts = model.texts[place]
    own = _phase_keys(texts)
    found = []
    for p in card_of(model, instance)["parameters"]:
        if texts and p["name"] not in words_of(texts):
            continue
        if p["name"] in own or (p["role"] == DURATION and not gradual):
            continue
        full = f"{instance}.{p['name']}"
        strength = p["default"] - p["neutral"]
        value = min(max(p["default"], p["min"]), p["max"]) if fresh else model.get(full)
        found.append(
            _told_lever(
                Parameter(
                    name=full,
                    unit=p["unit"],
                    value=value,
                    min=p["min"],
                    max=p["max"],
                    usual=p["neutral"],
                    std=UNKNOWN * max(1.0, abs(value)) if texts else p["usual_size"],
                    step=EFFECT_STEP * abs(strength),
                    central=p["unit"] == "s",
                    role=p["role"],
                    strength=strength,
                )
            )
        )
    return found


def base_lag_is_identifiable(model: native.Model) -> bool:
    """True if data determine the base's lag, and not only its sum with an effect's."""
    return LAG_EFFECT not in model.effects


def all_effect_parameters(
    model: native.Model, stages: Collection[str] = MOTION_STAGES
) -> list[Parameter]:
    """Free quantities of all of a model's effects at some stages; by default those on motion."""
    return [
        p
        for instance in effect_names(model)
        if catalogue()[catalogue_name(instance)]["stage"] in stages
        for p in effect_parameters(model, instance)
    ]


def duty_table(model: native.Model) -> list[str]:
    """Names of the free speeds of a duty robot's table; empty for other drives."""
    if model.drive != "duty":
        return []
    return [v["name"] for v in model.values() if v["name"].startswith("base.wheel_speed_mps.")]


def words(formula: str) -> set[str]:
    """Names of parameters and signals in a formula."""
    return set(re.findall(r"[A-Za-z_]\w*", formula))


def words_of(texts: Mapping[str, str]) -> set[str]:
    """Names of numbers and signals in the formulas of an effect."""
    return words(" ".join(texts.get(key, "") for key in FORMULAS))


def numbers_of(texts: Mapping[str, str]) -> tuple[str, ...]:
    """Names of a formula's numbers: those in the list `drag s/m, ratio` of its texts, or p0 to p3.

    The twin, which reads that list, refuses what is no list of names.
    """
    listed = texts.get("numbers", "")
    own = (entry.split() for entry in listed.split(","))
    return tuple(words[0] for words in own if words) or FORMULA_NUMBERS


def stated_names(model: native.Model, robot_id: int) -> set[str]:
    """Names of what [robots.Rnn] states of one robot: no fit of all robots moves it."""
    keys: Collection[str] = model.stated_of(robot_id)
    return {k if "." in k or k in GAINS else f"base.{k}" for k in keys}
