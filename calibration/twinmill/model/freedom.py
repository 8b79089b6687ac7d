# SPDX-License-Identifier: Apache-2.0
"""Which quantities of a model a fit may change, and how far they may be from what is known."""

import re
from collections.abc import Collection
from dataclasses import dataclass

import twinmill_native as native

MOTION_STAGES = ("duty", "wheel", "ground", "observe")  # what the path of one robot shows
BASE = ("base.forward_gain", "base.sideways_gain", "base.yaw_gain", "base.motor_lag_s")
# Widths of the weak prior, centred on the value at the start: wide against what any log tells, so
# that only what the log does not show is held.
PRIOR = {"base.motor_lag_s": 0.3}
GAIN_PRIOR = 0.5
EFFECT_PRIOR = 2  # times the distance of an effect's default from its neutral value
STEP = 0.02  # times the same distance: finite differences of effects
BASE_STEP = 0.002


@dataclass(frozen=True)
class Free:
    """One free quantity.

    Attributes:
        name, unit: in the model.
        start: centre of the weak prior, and where the fit begins unless `begin` says otherwise.
        min, max: bounds.
        prior_std: width of the prior.
        step: of finite differences.
        begin: where the fit begins.
    """

    name: str
    unit: str
    start: float
    min: float
    max: float
    prior_std: float
    step: float
    begin: float | None = None


def catalogue() -> dict[str, dict]:
    """The twin's effects by name."""
    return {entry["name"]: entry for entry in native.catalogue()}


def effect_names(model: native.Model) -> list[str]:
    """Instance names of a model's effects in their order: `dead_zone`, `dead_zone#2`."""
    seen: dict[str, int] = {}
    names = []
    for name in model.effects:
        seen[name] = seen.get(name, 0) + 1
        names.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return names


def base_quantities(model: native.Model, told: Collection[str]) -> list[Free]:
    """The base model's free quantities.

    Args:
        model: whose base it is.
        told: names of what other logs told. These quantities are held, but for the gains, since
            batteries and floors change. Without any, the speeds of the duty table are free in place
            of the forward gain.
    """
    values = {v["name"]: v for v in model.values()}
    table = [n for n in values if n.startswith("base.wheel_speed_mps.")]
    has_table = model.drive == "duty" and len(table) > 1
    names = [*(table if has_table else []), *(BASE[1:] if has_table and not told else BASE)]
    free = []
    for name in names:
        if name in told and not name.endswith("_gain"):
            continue
        v = values[name]
        width = PRIOR.get(name, GAIN_PRIOR)
        free.append(Free(name, v["unit"], v["value"], v["min"], v["max"], width, BASE_STEP))
    return free


def effect_quantities(model: native.Model, fresh: str | None = None) -> list[Free]:
    """Free quantities of a model's effects on motion; those of `fresh` begin at their defaults.

    Of a formula only those parameters that it names are free, and nothing is known of their size.
    """
    entries = catalogue()
    bounds = {v["name"]: (v["min"], v["max"]) for v in model.values()}
    free = []
    for instance, texts in zip(effect_names(model), model.texts, strict=True):
        entry = entries[instance.split("#")[0]]
        if entry["stage"] not in MOTION_STAGES:
            continue
        for p in entry["parameters"]:
            if texts and not any(p["name"] in words(text) for text in texts.values()):
                continue
            name = f"{instance}.{p['name']}"
            low, high = bounds[name]
            reach = abs(p["default"] - p["neutral"])
            is_fresh = instance == fresh
            free.append(
                Free(
                    name,
                    p["unit"],
                    p["neutral"] if is_fresh else model.get(name),
                    low,
                    high,
                    high - low if texts else EFFECT_PRIOR * reach,
                    min(STEP * reach, 0.05 * max(abs(p["default"]), 1e-6)),
                    p["default"] if is_fresh else None,
                )
            )
    return free


def words(formula: str) -> set[str]:
    """Names in a formula."""
    return set(re.findall(r"[A-Za-z_]\w*", formula))


@dataclass(frozen=True)
class Estimate:
    """A fitted quantity. `seen` is false where the log does not tell it and the prior holds it."""

    name: str
    value: float
    std: float
    unit: str
    at_bound: bool
    seen: bool

    def to_json(self) -> dict:
        """Fields of the interface."""
        return vars(self)
