# SPDX-License-Identifier: Apache-2.0
"""Knobs of a model: its quantities with value, reach and the interval that a fit told."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import tomlkit

from twinmill.estimation.opened import Opened
from twinmill.fitting.fit import base_names
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    Parameter,
    all_effect_parameters,
    base_parameters,
    card_of,
    effect_names,
    instance_of,
    key_of,
)

WITHIN_95 = 1.96
HAND = 500  # steps of a knob from end to end
BASE_WORDS = {
    "base.forward_gain": "speed forward over the table's",
    "base.sideways_gain": "speed sideways over the table's",
    "base.yaw_gain": "rate of turn over that of ideal wheels",
    "base.motor_lag_s": "time constant of the motors",
    "base.steering_lag_s": "time constant of the steering",
}


@dataclass(frozen=True)
class Knob:
    """One quantity.

    Attributes:
        name, unit: in the model.
        group: `base`, or the effect's name with its number.
        label, words: for people.
        value: in the model.
        low, high: what the knob reaches.
        least, most: bounds of the model.
        interval: 95 % interval that a fit told, or None.
        fitted: `fit` moves it.
    """

    name: str
    unit: str
    group: str
    label: str
    words: str
    value: float
    low: float
    high: float
    least: float
    most: float
    interval: tuple[float, float] | None
    fitted: bool

    @property
    def step(self) -> float:
        """Step of the knob: a round number."""
        rough = (self.high - self.low) / HAND
        return 10 ** math.floor(math.log10(rough)) if rough > 0 else 1e-6


def knobs(model_file: ModelFile, told: ModelFile, opened: Sequence[Opened]) -> list[Knob]:
    """All that a fit of these logs can move, then what is left of the base, then effects.

    Args:
        model_file: the model.
        told: the file whose intervals count: where a hand moved a value, that before it.
        opened: the logs; those that are not judged yet tell nothing.
    """
    model = model_file.model
    names = base_names(model, opened) if opened else []
    rest = [
        v["name"]
        for v in model.values()
        if v["name"].startswith("base.") and not v["held"] and v["name"] not in names
    ]
    intervals = _intervals(told)
    base = [_knob(p, "base", intervals, p.name in names) for p in base_parameters(model, names)]
    others = [_knob(p, "base", intervals, False) for p in base_parameters(model, rest)]
    effects = [_knob(p, instance_of(p.name), intervals, True) for p in all_effect_parameters(model)]
    words = {
        f"{instance}.{p['name']}": p["doc"]
        for instance in effect_names(model)
        for p in card_of(model, instance)["parameters"]
    }
    known = {**BASE_WORDS, **words}
    return [_worded(k, known.get(k.name, "")) for k in [*base, *effects, *others]]


def _worded(knob: Knob, words: str) -> Knob:
    return replace(knob, words=knob.words or words)


def _knob(
    p: Parameter, group: str, intervals: dict[str, tuple[float, float]], fitted: bool
) -> Knob:
    interval = intervals.get(p.name)
    spread = (interval[1] - interval[0]) if interval else 0.0
    reach = max(p.std if group == "base" else 2 * p.std, 1.5 * spread, 0.05 * abs(p.value))
    if p.name.endswith("lag_s"):  # its prior is far wider than any motor
        reach = max(0.1, 1.5 * spread)
    middle = [p.value, *(interval or ())] if group == "base" else [p.value, p.usual]
    low, high = max(p.min, min(middle) - reach), min(p.max, max(middle) + reach)
    label = p.words or key_of(p.name)
    return Knob(
        p.name, p.unit, group, label, p.words, p.value, low, high, p.min, p.max, interval, fitted
    )


def _intervals(told: ModelFile) -> dict[str, tuple[float, float]]:
    """95 % intervals by name, of all values that the file gives a standard deviation."""
    document = tomlkit.parse(told.text)
    stds: dict[str, float] = {}
    for key, std in document.get("base", {}).get("std", {}).items():
        if isinstance(std, list):
            stds |= {f"base.{key}.{i}": float(s) for i, s in enumerate(std)}
        else:
            stds[f"base.{key}"] = float(std)
    for instance, table in zip(effect_names(told.model), document.get("effect", []), strict=True):
        stds |= {f"{instance}.{key}": float(s) for key, s in table.get("std", {}).items()}
    found = {}
    for name, std in stds.items():
        if math.isfinite(std):
            value = told.model.get(name)
            found[name] = (value - WITHIN_95 * std, value + WITHIN_95 * std)
    return found
