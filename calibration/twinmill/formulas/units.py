# SPDX-License-Identifier: Apache-2.0
"""Units of the numbers in a formula: those with which it has the unit of what it adds to."""

from dataclasses import dataclass
from fractions import Fraction

from twinmill.formulas.forms import C, D, Form, L


@dataclass(frozen=True)
class Unit:
    """Powers of metre and second; angles have none. A plain figure beside it has its unit.

    Raises:
        ValueError: units that do not agree are added or compared.
    """

    m: Fraction = Fraction(0)
    s: Fraction = Fraction(0)

    def __mul__(self, other: "Unit | float") -> "Unit":
        return Unit(self.m + other.m, self.s + other.s) if isinstance(other, Unit) else self

    def __truediv__(self, other: "Unit | float") -> "Unit":
        return Unit(self.m - other.m, self.s - other.s) if isinstance(other, Unit) else self

    def __rtruediv__(self, other: float) -> "Unit":
        return Unit(-self.m, -self.s)

    def __add__(self, other: "Unit | float") -> "Unit":
        if isinstance(other, Unit) and other != self:
            raise ValueError(f"a quantity in {self} is added to one in {other}")
        return self

    def __gt__(self, other: "Unit | float") -> "Unit":
        self + other
        return PLAIN

    __sub__, __lt__, __radd__, __rsub__, __rmul__ = __add__, __gt__, __add__, __add__, __mul__

    def __str__(self) -> str:
        parts = [_power(n, p) for n, p in (("m", self.m), ("s", self.s)) if p > 0]
        under = [_power(n, -p) for n, p in (("m", self.m), ("s", self.s)) if p < 0]
        return "/".join([" ".join(parts) or "1", *under]) if parts or under else "1"


def _power(name: str, power: Fraction) -> str:
    return name if power == 1 else f"{name}^{power}"


PLAIN = Unit()
ONE = Fraction(1)
NAMES = {
    "vx": Unit(ONE, -ONE),
    "vy": Unit(ONE, -ONE),
    "omega": Unit(s=-ONE),
    "x": Unit(ONE),
    "y": Unit(ONE),
    "theta": PLAIN,
    "course": PLAIN,
    "t": Unit(s=ONE),
    "moves": PLAIN,
    "target": Unit(ONE, -ONE),
}
ADDS_TO = {
    "rim_mps": NAMES["vx"],
    "vx_mps": NAMES["vx"],
    "vy_mps": NAMES["vx"],
    "room_mps": NAMES["vx"],
    "omega_radps": NAMES["omega"],
    "travel": PLAIN,
    "aside": PLAIN,
    "motion": PLAIN,
    "theta_rad": PLAIN,
}
FUNCTIONS = {
    "abs": lambda a: a,
    "sign": lambda a: PLAIN,
    "sqrt": lambda a: Unit(a.m / 2, a.s / 2),
    "cos": lambda a: PLAIN,
    "sin": lambda a: PLAIN,
    "max": lambda a, b: a if isinstance(a, Unit) else b,
}
CONSTANTS = {"": PLAIN, "rad": PLAIN, "s": NAMES["t"], "m": NAMES["x"], "1/s": NAMES["omega"]}
CONSTANTS |= {"1/m": PLAIN / NAMES["x"], "m/s": NAMES["vx"], "rad/s": NAMES["omega"]}


def units_of(form: Form) -> list[str]:
    """Units of a form's numbers, in their order.

    Raises:
        ValueError: the form adds or compares what differs in unit, or its rate is not one.
    """
    to = ADDS_TO[form.adds_to]
    names = {**NAMES, "c": CONSTANTS[form.unit], "l": NAMES["x"]}
    if form.state and not form.state.goal:
        names["s"] = _unit(form.state.rate, names) * NAMES["t"]
    elif form.state and form.state.swings:
        names["s"] = _unit(form.state.goal, names)
        names["r"] = names["s"] / NAMES["t"]
        for text in form.state.second_text.split(", "):
            if (rate := _unit(text, names)) != names["r"] / NAMES["t"]:
                raise ValueError(f"a second rate of change in {rate}: {text}")
    elif form.state:
        names["s"] = _unit(form.state.goal, names)
        if (rate := _unit(form.state.rate, names)) != NAMES["omega"]:
            raise ValueError(f"a rate of change in {rate} is no 1/s: {form.state.rate}")
    return [str(to / _unit(shape, names)) for shape in form.shapes]


def _unit(text: str, names: dict[str, Unit]) -> Unit:
    plain = text.replace(C, "c").replace(D, "1.0").replace(L, "l")
    return eval(plain, {"__builtins__": {}, **FUNCTIONS}, names) * PLAIN
