# SPDX-License-Identifier: Apache-2.0
"""Axes that a sweep can vary, under the names that people use for them."""

import difflib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.numbers_typed import typed_float

Set = Callable[[native.Model, float], None]


def _setter(*names: str, scale: float = 1.0) -> Set:
    def apply(model: native.Model, value: float) -> None:
        for name in names:
            model.set(name, value * scale)

    return apply


@dataclass(frozen=True)
class Quantity:
    """One name that --x takes. `set` is None where the swarm, not the model, is changed."""

    label: str
    set: Set | None = None
    whole: bool = False


QUANTITIES = {
    "n": Quantity("robots", whole=True),
    "v_mps": Quantity("speed (m/s)"),
    "omega_degps": Quantity("turn rate (deg/s)"),
    "range_m": Quantity("view range (m)", _setter("sensor.range_m")),
    "cone_deg": Quantity("view cone (deg)", _setter("sensor.cone_rad", scale=math.pi / 180)),
    "theta_a": Quantity(
        "spread of robots (std of theta_a)",
        _setter("idiosyncrasy.theta_a1_std", "idiosyncrasy.theta_a2_std"),
    ),
    "miss_rate": Quantity("missed detections", _setter("sensor.false_negative_rate")),
    "false_rate": Quantity("false detections", _setter("sensor.false_positive_rate")),
    "delay_s": Quantity("sensor delay (s)", _setter("sensor.delay_s")),
    "vote": Quantity("frames that vote", _setter("sensor.vote_frames"), whole=True),
    "target_radius_m": Quantity("radius of what is seen (m)", _setter("sensor.target_radius_m")),
    "spread_m": Quantity("width of the start area (m)"),
}
ALIASES = {"gamma": "range_m", "phi": "cone_deg"}


@dataclass(frozen=True)
class Axis:
    """A quantity and its values, in the order of the sweep."""

    name: str
    values: tuple[float, ...]

    @property
    def label(self) -> str:
        """Varied quantity in words; its name where there are none."""
        return QUANTITIES[self.name].label if self.name in QUANTITIES else self.name

    @property
    def whole(self) -> bool:
        """True if its values are whole numbers, as of robots."""
        return self.name in QUANTITIES and QUANTITIES[self.name].whole


def parse_axis(text: str, model: native.Model) -> Axis:
    """`name=from:to:count` or `name=value,value,...`.

    Raises:
        ValueError: in one sentence.
    """
    name, equals, rest = text.partition("=")
    name = ALIASES.get(name, name)
    if not equals:
        raise ValueError(f"'{text}': write an axis as name=from:to:count or name=value,value,...")
    _check_name(name, model)
    axis = Axis(name, _values(text, rest))
    if axis.whole and any(value != round(value) for value in axis.values):
        raise ValueError(
            f"'{text}': {name} counts in whole numbers, but this asks for "
            f"{', '.join(f'{v:g}' for v in axis.values[:4])} ...; choose from, to and count to fit."
        )
    return axis


def _check_name(name: str, model: native.Model) -> None:
    known = [*QUANTITIES, *ALIASES]
    in_model = [row["name"] for row in model.values()]
    if name in known or name in in_model:
        return
    near = difflib.get_close_matches(name, known + in_model, n=1, cutoff=0.3)
    hint = f"; the nearest is '{near[0]}'" if near else ""
    raise ValueError(
        f"there is no axis '{name}'{hint}. Axes: {', '.join(known)}, or any quantity of the "
        "model file by its full name, such as base.motor_lag_s."
    )


def _values(text: str, rest: str) -> tuple[float, ...]:
    try:
        if ":" in rest:
            first, last, count = rest.split(":")
            if not re.fullmatch(r"[1-9][0-9]{0,3}", count):
                raise ValueError
            values = np.linspace(typed_float(first), typed_float(last), int(count))
            if len(values) == 1 and float(first) != float(last):
                raise ValueError
        else:
            values = np.array([typed_float(word) for word in rest.split(",")])
    except ValueError:
        raise ValueError(
            f"'{text}': after = must come from:to:count with a count of 2 to 9999, as in "
            "v_mps=0.1:0.3:5, or one value, or several with commas between."
        ) from None
    rounded = tuple(float(f"{value:.12g}") for value in values)
    if not all(map(math.isfinite, rounded)) or len(set(rounded)) < len(rounded):
        raise ValueError(f"'{text}': the values of an axis must be finite and differ.")
    return rounded


def set_speeds(
    model: native.Model, table: list[int], v_mps: float | None, omega_radps: float | None
) -> None:
    """Scales a twist-driven model so that this table's largest inputs give these speeds.

    Raises:
        ValueError: another drive, or a table that has no speed or turn to scale.
    """
    if v_mps is None and omega_radps is None:
        return
    if model.drive != "twist":
        raise ValueError(
            f"v_mps and omega_degps need a model with base.drive = 'twist', and this one has "
            f"'{model.drive}', where speed and turn rate cannot be chosen freely; vary "
            f"base.forward_gain and base.yaw_gain, or take {option('model', 'paper.toml')}."
        )
    for name, value, inputs, scale in (
        ("speed", v_mps, table[::2], 1),
        ("turn", omega_radps, table[1::2], 1000),
    ):
        if value is None:
            continue
        largest = max(map(abs, inputs)) / scale
        if largest == 0:
            raise ValueError(f"the behaviour's table has no {name} input that could be varied.")
        unit = "speed_per_input_mps" if name == "speed" else "turn_per_input_radps"
        model.set(f"base.{unit}", value / largest)
