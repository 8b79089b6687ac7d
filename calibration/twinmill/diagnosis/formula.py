# SPDX-License-Identifier: Apache-2.0
"""A formula for what is left that was proven, for reports and JSON."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from twinmill.diagnosis.known_physics import resembles
from twinmill.formulas.forms import ROOM, Form, joined, with_rates


@dataclass(frozen=True)
class Number:
    """One number of a formula: its value and 95 % interval.

    Attributes:
        name: p0 to p3; empty of a constant that the text has in figures.
        unit: of the number.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return vars(self)


@dataclass(frozen=True)
class Curve:
    """Residual over one variable, and the formula's curve over it.

    Attributes:
        name: the variable, as formulas name it.
        at: (B,) means of bins of it.
        left: (B,) what is left there, in the unit of what the formula adds to, per `carrier`.
        spread: (B,) its standard error.
        drawn: (B,) the formula.
        carrier: name of the motion that all terms are multiplied by; empty if there is none.
        period: of the variable, within which `at` is, since all comes again; 0 if it does not.
    """

    name: str
    carrier: str
    period: float
    at: np.ndarray
    left: np.ndarray
    spread: np.ndarray
    drawn: np.ndarray


@dataclass(frozen=True)
class Formula:
    """A formula that was proven on blocks which neither chose nor fitted it.

    Attributes:
        forms: its terms, all of one place.
        numbers: p0 and so on, in their order, then the constant of each term that has one.
        takes: share of what is left that it took on the half that judged it.
        chance: of such a fall if it were noise, for both halves together.
        tried: forms that it was chosen of.
        again: share of resamplings of the stretches in which the same place and dependence win.
        holds: names of the motion in it, with the least and largest value seen.
        curve: what the report draws; None of single wheels and of a push in the room.
        instead_of: findings in doubt, without which it was found.
        goes_on: its first term comes again by the clock: the first part of the run, taken by
            itself, predicts the rest.
    """

    forms: tuple[Form, ...]
    numbers: tuple[Number, ...]
    takes: float
    chance: float
    tried: int
    again: float
    holds: dict[str, tuple[float, float]]
    curve: Curve | None
    instead_of: tuple[str, ...] = ()
    goes_on: bool = False

    @property
    def equation(self) -> dict[str, str]:
        """Texts of the effect `equation` that adds it to a model."""
        return joined(self.forms)

    @property
    def depends_on(self) -> list[str]:
        """Groups of its terms, each once."""
        return list(dict.fromkeys(f.group for f in self.forms))

    @property
    def names_time(self) -> bool:
        """It has moments of the run."""
        return any(f.names_time for f in self.forms)

    @property
    def passing(self) -> bool:
        """It has moments of the run that do not come again by the clock."""
        return any(self._passes(f) for f in self.forms)

    def _passes(self, form: Form) -> bool:
        return form.names_time and not (self.goes_on and form.recurs)

    @property
    def lasting(self) -> "Formula":
        """Without the terms that have moments of the run alone, if there are others."""
        kept = [form for form in self.forms if not self._passes(form)]
        return self if len(kept) in (0, len(self.forms)) else self._of(kept)

    def without(self, k: int) -> "Formula | None":
        """Without p0 or another of its first numbers; None if that is all of it, or of a pair."""
        first = 0
        for form in self.forms:
            at, first = k - first, first + len(form.shapes)
            if at >= len(form.shapes):
                continue
            if len(form.shapes) == 1:
                others = [f for f in self.forms if f is not form]
                return self._of(others) if others else None
            if form.adds_to == ROOM:
                return None
            less = form.without(at)
            forms = tuple(less if f is form else f for f in self.forms)
            own = [n for n in self.numbers if n.name != f"p{k}"]
            return replace(self, forms=forms, numbers=_named(own))
        return None

    def _of(self, kept: Sequence[Form]) -> "Formula":
        """With some of its terms alone."""
        shapes = [n for n in self.numbers if n.name]
        constants = [n for n in self.numbers if not n.name]
        own: list[Number] = []
        others: list[Number] = []
        for form in self.forms:
            first, last = len(form.shapes), len(form.searched)
            if any(form is k for k in kept):
                own += shapes[:first]
                others += constants[:last]
            shapes, constants = shapes[first:], constants[last:]
        timed = any(form.names_time for form in kept)
        holds = {name: span for name, span in self.holds.items() if timed or name != "t"}
        return replace(self, forms=tuple(kept), numbers=_named([*own, *others]), holds=holds)

    @property
    def is_late(self) -> bool:
        """It says how a speed follows what it should be."""
        return any(f.is_late for f in self.forms)

    @property
    def text(self) -> str:
        """With its numbers in place of their names."""
        return with_rates(self.forms, [f"{n.value:.3g}" for n in self.numbers if n.name])

    @property
    def equals(self) -> str:
        """Equation of the formula, with its numbers."""
        return f"{self.forms[0].adds_to} += {self.text}"

    @property
    def like(self) -> str:
        """Known physics that it looks like; empty if none."""
        return resembles(self.forms, [n.value for n in self.numbers], self.holds)

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return {
            "equation": self.equation,
            "text": self.equals,
            "depends_on": self.depends_on,
            "numbers": [n.to_json() for n in self.numbers],
            "takes": self.takes,
            "chance": self.chance,
            "tried": self.tried,
            "again": self.again,
            "goes_on": self.goes_on,
            "like": self.like,
            "instead_of": list(self.instead_of),
            "holds": {name: list(span) for name, span in self.holds.items()},
        }


def _named(numbers: Sequence[Number]) -> tuple[Number, ...]:
    """With the names p0 and so on in their order; constants have none."""
    count = iter(range(len(numbers)))
    return tuple(replace(n, name=f"p{next(count)}") if n.name else n for n in numbers)
