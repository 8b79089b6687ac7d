# SPDX-License-Identifier: Apache-2.0
"""An effect written as a Python function, which the plants run as a formula.

The function is called once, with symbols in place of signals and numbers. What it does to them is
written down as the formula of the effect `equation`, so that fits, diagnoses, both plants and the
export to C++ have it at their usual speed.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
import twinmill_native as native
from numpy.lib.mixins import NDArrayOperatorsMixin

from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import FORMULA_NUMBERS, effect_names

PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_]*")  # names that the twin's formulas can have
STATES = ("state_rate", "second_rate")
EQUATION = ("adds_to", "formula", *STATES)  # those of the texts that compute
ANY_ROBOT = """name = "any"
[base]
drive = "twist"
wheels = "none"
control_period_s = 0.02
speed_per_input_mps = 0.1
"""
TRIED = np.random.default_rng(1).uniform(0.05, 0.4, (16, 32))  # signals, as of slow robots

# numpy's functions in the words of muParser.
WORDS: dict[Any, str] = {
    np.add: "({}+{})",
    np.subtract: "({}-{})",
    np.multiply: "({}*{})",
    np.true_divide: "({}/{})",
    np.power: "({}^{})",
    np.negative: "(-{})",
    np.positive: "{}",
    np.square: "({0}*{0})",
    np.hypot: "sqrt({0}*{0}+{1}*{1})",
    np.minimum: "min({},{})",
    np.maximum: "max({},{})",
    np.arctan2: "atan2({},{})",
    np.less: "({}<{})",
    np.less_equal: "({}<={})",
    np.greater: "({}>{})",
    np.greater_equal: "({}>={})",
    np.equal: "({}=={})",
    np.not_equal: "({}!={})",
    np.logical_and: "({}&&{})",
    np.bitwise_and: "({}&&{})",
    np.logical_or: "({}||{})",
    np.bitwise_or: "({}||{})",
    np.where: "({}?{}:{})",
    np.clip: "min(max({},{}),{})",
    np.absolute: "abs({})",
    np.log: "ln({})",
    np.arcsin: "asin({})",
    np.arccos: "acos({})",
    np.arctan: "atan({})",
    **{
        f: f"{f.__name__}({{}})"
        for f in (np.sqrt, np.exp, np.sign, np.sin, np.cos, np.tan, np.sinh, np.cosh, np.tanh)
    },
}


@dataclass(frozen=True)
class Number:
    """A number of an effect, which fits find.

    Attributes:
        unit: in which the function takes it.
        low, high: its range, which models that get the effect keep.
        prior: mean and standard deviation of what is known of it before; None: nothing. It is of
            `Model.add` alone, as no file has it: later fits take it as their `priors`.
    """

    unit: str = "1"
    low: float = -math.inf
    high: float = math.inf
    prior: tuple[float, float] | None = None

    def text(self, name: str) -> str:
        """The number, within its range, as a formula has it."""
        text = name if self.low == -math.inf else f"max({name},{_number(self.low)})"
        return text if self.high == math.inf else f"min({text},{_number(self.high)})"


class Symbol(NDArrayOperatorsMixin):
    """A part of a formula, on which numpy's functions and Python's operators work."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __array_ufunc__(self, function: Any, method: str, *given: Any, **options: Any) -> "Symbol":
        return _applied(function if method == "__call__" and not options else method, given)

    def __array_function__(self, function: Any, _: Any, given: Any, options: Any) -> "Symbol":
        return _applied(function, (*given, *options.values()))

    def __bool__(self) -> bool:
        raise TypeError(
            "an effect's function is written down as a formula and cannot branch on a signal; "
            "use np.where in place of if, and & and | in place of and and or."
        )

    def __float__(self) -> float:
        raise TypeError("an effect's function needs np.sin and the like, not those of math.")


def _applied(function: Any, given: tuple[Any, ...]) -> Symbol:
    if function not in WORDS:
        known = ", ".join(sorted(f"np.{f.__name__}" for f in WORDS))
        name = getattr(function, "__name__", function)
        raise TypeError(f"np.{name}: no formula has it; there are {known}, and + - * / **.")
    return Symbol(WORDS[function].format(*map(_text, given)))


def _text(part: Any) -> str:
    return part.text if isinstance(part, Symbol) else _number(part)


def _number(value: Any) -> str:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"an effect's function: {number} cannot stand in a formula.")
    return f"({number!r})" if number < 0 else repr(number)


class OfFile(Protocol):
    """A model of Python's, such as `tm.Model`."""

    @property
    def file(self) -> ModelFile:
        """Its file."""
        ...


class PythonEffect:
    """An effect that a Python function describes; made by `python_effect`.

    Attributes:
        name: of the function.
        adds_to: the quantity that it adds to.
        numbers: by name.
        texts: of the effect `equation` that it is in a model.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        adds_to: str,
        numbers: Mapping[str, Number],
        rates: Mapping[str, Callable[..., Any] | None],
    ) -> None:
        self.name = function.__name__
        self.adds_to, self.numbers = adds_to, dict(numbers)
        self._function = function
        self.__module__, self.__qualname__ = function.__module__, function.__qualname__
        if not 1 <= len(self.numbers) <= len(FORMULA_NUMBERS):
            raise ValueError(
                f"{self.name}: has {len(self.numbers)} numbers; an effect has one to four."
            )
        self.texts = {"adds_to": adds_to, "formula": self._formula(function)}
        self.texts |= {key: self._formula(rate) for key, rate in rates.items() if rate is not None}
        self.texts |= self._named()
        self._check_known()
        self._check_neutral()

    @property
    def card(self) -> dict[str, Any]:
        """Description in the fields of a card of the catalogue."""
        about = (inspect.getdoc(self._function) or "").partition("\n")[0]
        return {
            "name": self.name,
            "summary": about,
            "equation": "; ".join(
                f"{key}: {self.texts[key]}" for key in EQUATION if key in self.texts
            ),
            "parameters": [{"name": name, **vars(n)} for name, n in self.numbers.items()],
        }

    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Mean and standard deviation of those numbers of which something is known before."""
        return {name: n.prior for name, n in self.numbers.items() if n.prior is not None}

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Range of those numbers that have one."""
        ends = {name: (n.low, n.high) for name, n in self.numbers.items()}
        return {name: pair for name, pair in ends.items() if pair != (-math.inf, math.inf)}

    def names(self, model: "native.Model | OfFile") -> dict[str, str]:
        """Names of its numbers in a model, as `equation#air.drag`, by their own names.

        Raises:
            ValueError: the model does not have the effect.
        """
        own = model if isinstance(model, native.Model) else model.file.model
        for instance, texts in zip(effect_names(own), own.texts, strict=True):
            if all(texts.get(key) == text for key, text in self.texts.items()):
                return {name: f"{instance}.{name}" for name in self.numbers}
        raise ValueError(f"{self.name}: the model does not have this effect; add it first.")

    def __call__(self, *signals: Any, **named: Any) -> Any:
        """Value of the function itself."""
        return self._function(*signals, **named)

    def __reduce__(self) -> str:
        return self.__qualname__  # pickled by reference, as the function in whose place it stands

    def __repr__(self) -> str:
        return f"PythonEffect({self.name}: {self.adds_to} + {self.texts['formula']})"

    def _named(self) -> dict[str, str]:
        """Texts that name the effect and its numbers; a lambda has no name.

        Raises:
            ValueError: a number has a name or unit that a formula cannot have.
        """
        for name, number in self.numbers.items():
            if not PLAIN.fullmatch(name):
                raise ValueError(
                    f"{self.name}: its number '{name}' must be called by letters of English, "
                    "figures and underscores, since a formula has this name."
                )
            if "," in number.unit:
                raise ValueError(
                    f"{self.name}: the unit '{number.unit}' of {name} has a comma, which parts "
                    "numbers in a model's file; write it without."
                )
        named = {"called": self.name} if PLAIN.fullmatch(self.name) else {}
        units = (f"{name} {number.unit}".strip() for name, number in self.numbers.items())
        return {**named, "numbers": ", ".join(units)}

    def _formula(self, function: Callable[..., Any]) -> str:
        own = {name: number.text(name) for name, number in self.numbers.items()}
        return _text(function(*(Symbol(own.get(name, name)) for name in _arguments(function))))

    def _check_known(self) -> None:
        """Raises ValueError where the twin knows no such quantity, signal or number."""
        try:
            native.Model.from_toml(ANY_ROBOT, "any").add_effect("equation", self.texts)
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}.") from error

    def _check_neutral(self) -> None:
        """Raises ValueError where it adds something though its numbers are all zero."""
        zero = {name: np.clip(0.0, n.low, n.high) for name, n in self.numbers.items()}
        signals = iter(TRIED)
        given = [zero[n] if n in zero else next(signals) for n in _arguments(self._function)]
        with np.errstate(all="ignore"):
            if np.any(np.nan_to_num(self._function(*given))):
                raise ValueError(
                    f"{self.name}: adds something where its numbers are 0, or at the end of "
                    "their range nearest to it; write it so that it then adds nothing."
                )


def _arguments(function: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(function).parameters)


def python_effect(
    adds_to: str,
    numbers: Mapping[str, Number],
    *,
    state_rate: Callable[..., Any] | None = None,
    second_rate: Callable[..., Any] | None = None,
) -> Callable[[Callable[..., Any]], PythonEffect]:
    """Makes a Python function an effect that models can have.

    The function's arguments are the effect's numbers, and signals of the drive by their names in
    `effect("equation")`. It returns what is added to the quantity, in that one's unit. It is made
    of operators, `np.where` and other functions of numpy that work by element, and it adds nothing
    where its numbers are zero.

    Args:
        adds_to: the quantity: vx_mps, vy_mps, omega_radps, travel, motion, aside, theta_rad;
            of each wheel rim_mps, duty. `print(tm.effect("equation"))` tells what they
            are, and which signals each has.
        numbers: what fits find, by the name of the argument; one to four.
        state_rate: of an effect that remembers: ds/dt, a function of signals, numbers and `s`,
            which then are arguments of the effect's function, too.
        second_rate: dr/dt of a second state `r`.

    Returns:
        A decorator; what it makes goes into `Model.add`.

    Raises:
        ValueError: the function adds something where its numbers are zero, or has no number or too
            many; there is no such quantity, or no such signal there.
        TypeError: the function does what no formula can.

    Examples:
        >>> @tm.python_effect("vx_mps", {"drag": tm.Number("s/m", low=0)})
        ... def air(vx, drag):
        ...     return -drag * vx * abs(vx)
        >>> air
        PythonEffect(air: vx_mps + (((-max(drag,0.0))*vx)*abs(vx)))
    """
    rates = dict(zip(STATES, (state_rate, second_rate), strict=True))
    return partial(PythonEffect, adds_to=adds_to, numbers=numbers, rates=rates)
