# SPDX-License-Identifier: Apache-2.0
"""A formula of a model, as muParser reads it, said in C++.

Both have the same signs with another order among comparisons, and what C++ takes for a truth or a
whole number is a number to muParser: so the formula is read in muParser's order, and each part is
said with the brackets that C++ needs.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass

TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[A-Za-z_]\w*|[<>=!]=|&&|\|\||\S")
FUNCTIONS = {
    **{n: f"std::{n}({{}})" for n in ("abs", "sqrt", "exp", "sin", "cos", "tan", "log", "log2")},
    **{n: f"std::{n}({{}})" for n in ("asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")},
    **{n: f"std::{n}({{}})" for n in ("asinh", "acosh", "atanh", "log10")},
    **{n: f"std::{n}({{{{{{}}}}}})" for n in ("min", "max")},
    "ln": "std::log({})",
    "rint": "std::floor({} + 0.5)",
    "sign": "Sign({})",
}
FIGURES = {"_pi": "M_PI", "_e": "M_E"}
# Two-sided signs by how closely they hold their sides, as muParser has it.
SIGNS = (("||",), ("&&",), ("==", "!=", "<", ">", "<=", ">="), ("+", "-"), ("*", "/"))
CHOICE, OR, AND, COMPARISON, SUM, PRODUCT, WHOLE = range(-1, 6)


@dataclass(frozen=True)
class Said:
    """A part of a formula in C++, how closely it holds together, and whether it is a truth."""

    text: str
    level: int
    is_truth: bool = False

    def number(self, level: int) -> str:
        """As a number, in brackets unless it holds together as closely as asked."""
        if self.is_truth:
            return f"({self.text} ? 1.0 : 0.0)"
        return self.text if self.level >= level else f"({self.text})"

    def truth(self, within: int) -> str:
        """As a condition or a side of && or ||, whose level it is within."""
        if not self.is_truth:
            return f"{self.number(SUM)} != 0"
        return self.text if self.level in (within, COMPARISON) or within < OR else f"({self.text})"


class Reading:
    """A formula on its way from left to right."""

    def __init__(self, text: str, names: Collection[str]) -> None:
        self._text, self._names = text, names
        self._tokens = [*TOKEN.findall(text), ""]  # the end
        self._at = 0

    def choice(self) -> Said:
        """The whole formula, or what stands in brackets or between commas."""
        condition = self._sides(OR)
        if not self._take("?"):
            return condition
        first = self.choice().number(CHOICE)
        self._take(":")
        second = self.choice().number(CHOICE)
        return Said(f"{condition.truth(CHOICE)} ? {first} : {second}", CHOICE)

    def _sides(self, level: int) -> Said:
        if level == WHOLE:
            return self._signed()
        left = self._sides(level + 1)
        while sign := self._take(*SIGNS[level]):
            right = self._sides(level + 1)
            if level in (OR, AND):
                sides = left.truth(level), right.truth(level)
            else:
                sides = left.number(level), right.number(level + 1)
            left = Said(f"{sides[0]} {sign} {sides[1]}", level, is_truth=level <= COMPARISON)
        return left

    def _signed(self) -> Said:
        if self._take("+"):
            return self._signed()
        if self._take("-"):
            return Said(f"-{self._signed().number(WHOLE)}", PRODUCT)
        base = self._atom()
        if self._take("^"):
            return Said(f"std::pow({base.number(CHOICE)}, {self._signed().number(CHOICE)})", WHOLE)
        return base

    def _atom(self) -> Said:
        token = self._next()
        if token == "(":
            return self._arguments()[0]  # its level brings back the brackets that are needed
        if token in FUNCTIONS:
            self._take("(")
            each = SUM if token == "rint" else CHOICE
            inside = ", ".join(argument.number(each) for argument in self._arguments())
            return Said(FUNCTIONS[token].format(inside), WHOLE)
        if re.match(r"[\d.]", token):
            return Said(token if re.search(r"[.eE]", token) else f"{token}.0", WHOLE)
        if token in self._names or token in FIGURES:
            return Said(FIGURES.get(token, token), WHOLE)
        raise ValueError(
            f"'{self._text}': {token} is not written in C++; say it by other functions, such as "
            "a + b for sum(a, b), or keep the equation in the model."
        )

    def _arguments(self) -> list[Said]:
        """Up to the closing bracket."""
        found = [self.choice()]
        while self._next() == ",":
            found.append(self.choice())
        return found

    def _next(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1]

    def _take(self, *wanted: str) -> str:
        """The next token if it is one of these; else nothing is taken."""
        return self._next() if self._tokens[self._at] in wanted else ""


def in_cpp(text: str, names: Collection[str]) -> str:
    """A formula that muParser has read, as a C++ number.

    Args:
        text: of the formula.
        names: of variables and parameters in it.

    Raises:
        ValueError: C++ has no such function.
    """
    return Reading(text, names).choice().number(CHOICE)
