# SPDX-License-Identifier: Apache-2.0
"""A formula outdoes an effect only by what it explains; truth: errors made of known columns."""

from types import SimpleNamespace

import numpy as np
import pytest

from twinmill.diagnosis import diagnose
from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.rest import Products
from twinmill.diagnosis.rivals import Rival, in_another_form, rival_of

BLOCKS, LONG = 20, 50
NAME = "the formula"


def outdoing(
    effect: np.ndarray, formula: np.ndarray, errors: np.ndarray, name: str = "speed_curve"
) -> Rival | None:
    """Rival that outdoes an effect, which moves the rows by `effect`, all (R,)."""
    blocks = np.repeat(np.arange(BLOCKS), LONG)
    columns = np.column_stack([effect, formula])
    alike = {"weight": np.ones(len(errors)), "free": np.zeros((len(errors), 0))}
    products = Products(Columns([columns]), errors, blocks, **alike)
    formulas = SimpleNamespace(
        terms=[NAME], products=lambda *_: products, changed=lambda *_: [effect]
    )
    less, whole = SimpleNamespace(fit=None), SimpleNamespace(fit=None)
    return rival_of(formulas, name, less, whole)


@pytest.fixture(params=range(5))
def noise(request):
    """(R, 3) of independent columns."""
    return np.random.default_rng(request.param).normal(size=(BLOCKS * LONG, 3))


def test_the_form_that_the_errors_have_outdoes_one_that_resembles_it(noise):
    formula, other, rest = noise.T
    assert outdoing(formula + other, formula, formula + rest) == Rival(NAME, outdoes=True)


def test_a_form_that_takes_little_more_and_leaves_nothing_makes_doubtful(noise):
    formula, other, rest = noise.T
    # An effect at this angle to the errors takes 1 / (1 + 0.3^2) = 92 % of what they are.
    assert outdoing(formula + 0.3 * other, formula, formula + rest) == Rival(NAME, outdoes=False)


def test_the_effect_that_the_errors_have_is_outdone_by_nothing(noise):
    effect, other, rest = noise.T
    assert outdoing(effect, effect + other, effect + rest) is None


def test_a_loss_that_lies_within_one_block_is_outdone_by_nothing_that_takes_less(noise):
    """Other blocks tell nothing of its size, so that no fit to them predicts it."""
    while_it_lasts, formula, rest = noise.T
    effect = while_it_lasts * (np.arange(len(rest)) // LONG == 3)
    errors = 4 * effect + 0.3 * formula + rest
    assert outdoing(4 * effect, formula, errors, "transient_loss") is None


def test_a_formula_that_explains_nothing_outdoes_no_effect(noise):
    effect, formula, rest = noise.T
    changing = np.repeat(np.resize([1, 1, -1, -1, 1], BLOCKS), LONG)  # worse than nothing if held
    assert outdoing(effect, formula, changing * effect + rest) is None


def test_a_formula_of_other_physics_does_not_take_the_effects_place(noise):
    effect, formula, rest = noise.T
    assert outdoing(effect, formula, effect + 2 * formula + rest) is None


def takes(first: np.ndarray, second: np.ndarray, errors: np.ndarray, family: np.ndarray) -> bool:
    """True if (R, k) formulas that make up a first effect take the share of a second one."""
    blocks = np.repeat(np.arange(BLOCKS), LONG)
    own, larger = (
        Products(
            Columns([np.column_stack([effect, family])]),
            errors,
            blocks,
            weight=np.ones(len(errors)),
            free=known[:, None],
        )
        for effect, known in ((second, first), (first, second))
    )
    formulas = np.arange(1 + family.shape[1]) > 0
    return in_another_form(own, larger, [formulas], local=False)


def in_parts(values: np.ndarray) -> np.ndarray:
    """(R, 4) the values where the largest are, where smaller ones are, and so on."""
    quarter = np.searchsorted(np.quantile(np.abs(values), (0.25, 0.5, 0.75)), np.abs(values))
    return values[:, None] * (quarter[:, None] == np.arange(4))


def test_the_rest_of_a_wrong_form_is_no_second_effect(noise):
    """The errors go with the square of what the first goes with, and the second resembles that.

    Of normal numbers x the mean of |x|^3 is 1.6, so that x |x| - 1.6 x has nothing of x.
    """
    first, other, rest = noise.T
    square = first * np.abs(first)
    assert takes(first, square - 1.6 * first + 0.5 * other, square + rest, in_parts(first))


def test_a_second_effect_that_is_there_is_no_rest_of_the_first(noise):
    first, second, rest = noise.T
    assert not takes(first, second, 3 * first + 0.4 * second + rest, in_parts(first))


def test_a_formula_may_stand_in_the_place_of_a_doubtful_effect_beside_a_sure_one(monkeypatch):
    monkeypatch.setattr(diagnose, "formulas_of", lambda *_, forms_alone: "formulas")
    findings = [
        SimpleNamespace(effect="coasting", certainty="sure"),
        SimpleNamespace(effect="floor_tilt", certainty="doubtful"),
    ]
    less = {f.effect: SimpleNamespace(fit=f"without {f.effect}") for f in findings}
    doubted = diagnose._doubted(findings, less, [])
    assert doubted.names == ("floor_tilt",) and doubted.fit == "without floor_tilt"
    assert diagnose._doubted(findings[:1], less, []) is None
