# SPDX-License-Identifier: Apache-2.0
"""Equations of the catalogue as pages show them."""

import re

import pytest

from twinmill.model.parameters import catalogue
from twinmill.workbench.typeset import typeset

FRACTION = re.compile(r'<span class="frac"><span>(.*?)</span><span>(.*?)</span></span>')


@pytest.mark.parametrize(
    ("equation", "above", "below"),
    [
        ("v' = v min(1, 1 / (pace |v|))", "1", "pace |<i>v</i>|"),
        ("w = (x - y) / (0.1 m)^2", "<i>x</i> \N{MINUS SIGN} <i>y</i>", "(0.1 m)<sup>2</sup>"),
        ("60 s dh/dt = u^2 - h", "<i>dh</i>", "<i>dt</i>"),
        ("w = 1 - loss tanh(|v|) / |v|", "tanh(|<i>v</i>|)", "|<i>v</i>|"),
    ],
)
def test_what_is_divided_stands_above_what_it_is_divided_by(equation, above, below):
    assert FRACTION.findall(typeset(equation)) == [(above, below)]


def test_units_keep_their_stroke():
    assert "frac" not in typeset("w = 0.02 m/s") and "0.02 m/s" in typeset("w = 0.02 m/s")


def test_a_genitive_is_no_derivative():
    assert (
        typeset("t since the log's start")
        == "<i>t</i> since the log\N{RIGHT SINGLE QUOTATION MARK}s start"
    )
    assert "<i>v</i>\N{PRIME}" in typeset("v' = v")


def test_a_minus_is_one_wherever_it_stands():
    for equation in ("a - b", "exp(-t)", "s = -1"):
        assert "\N{MINUS SIGN}" in typeset(equation) and "-" not in typeset(equation)


@pytest.mark.parametrize("entry", catalogue().values(), ids=lambda entry: entry["name"])
def test_every_division_of_the_catalogue_is_a_fraction(entry):
    equation = entry["equation"]
    divided = len(re.findall(r" / |\bd\w+'?/dt\b", equation))
    assert typeset(equation).count('class="frac"') == divided
