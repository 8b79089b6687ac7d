# SPDX-License-Identifier: Apache-2.0
"""Formulas of one's own that make no sense: each is said in a sentence."""

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.filters import filtered
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import ParameterEstimate
from twinmill.report import tables

EULER_S = 1 / 480
HEAT_S, LOSS_PER_HEAT = 6.0, 8.0  # of a robot that warms; s^2/m^2


@pytest.fixture(scope="module")
def log(measure):
    """Drive of the unchanged robot."""
    return measure(seed=5)


@pytest.fixture
def adding(log, one_clock_base, tmp_path):
    """Adds a formula to the base."""

    def make(formula, *, held=(), **others):
        texts = {"adds_to": "vx_mps", "formula": formula, **others}
        out = tmp_path / "added.toml"
        return add("equation", [log], one_clock_base, out=out, command="", texts=texts, held=held)

    return make


@pytest.fixture
def written(one_clock_base, tmp_path):
    """The base with a formula that was put in by hand."""

    def make(formula, adds_to="vx_mps", **rates) -> ModelFile:
        path = tmp_path / "by_hand.toml"
        texts = {"name": "equation", "adds_to": adds_to, "formula": formula, **rates}
        lines = [f'{key} = "{text}"' for key, text in texts.items()]
        path.write_text("\n".join([one_clock_base.text, "[[effect]]", *lines, "p0 = 1.0", ""]))
        return ModelFile.load(str(path))

    return make


# The solutions are e^(100 t), e^(10 t) and e^(-10 t), and tan t: within ten seconds, and for the
# last after pi/2 of them, beyond all bounds.
@pytest.mark.parametrize(
    ("rates", "says"),
    [
        ({"state_rate": "100*s + 1"}, r"its state s grows .*ds/dt = 100\*s \+ 1"),
        ({"state_rate": "r", "second_rate": "100*s + vx"}, r"its states s and r grow"),
        ({"state_rate": "s*s + 1"}, r"its state s grows .*ds/dt = s\*s \+ 1"),
    ],
)
def test_a_state_that_grows_is_named(rates, says, adding, written, log, tmp_path, recwarn):
    with pytest.raises(ModelError, match=says):
        adding("p0*s", **rates)
    by_hand = written("p0*s", **rates)
    with pytest.raises(ModelError, match=says):
        compare([log], by_hand)
    with pytest.raises(ModelError, match=says):
        fit([log], by_hand, tmp_path / "fitted.toml", "")
    with pytest.raises(ModelError, match=says):
        diagnose([log], by_hand)
    assert not (tmp_path / "fitted.toml").exists() and not recwarn.list


def test_a_turn_that_grows_is_named(written, log):
    """Headings are compared the short way round: errors of turns have a bound, and turns none."""
    with pytest.raises(ModelError, match="its state s grows"):
        compare([log], written("p0*s", adds_to="omega_radps", state_rate="s*s + 1"))


def test_a_state_that_comes_back_is_taken(written, log):
    assert not compare([log], written("p0*(s - vx)", state_rate="(vx - s)/0.001")).warnings


def test_a_formula_that_has_no_value_anywhere_is_told(written, log, one_clock_base):
    """There is none of 1/0: the model predicts as if it had no formula."""
    found = compare([log], written("p0/(vx - vx)"))
    assert any("has no finite value" in words for words in found.warnings)
    assert found.score == pytest.approx(compare([log], one_clock_base).score)


def test_a_state_without_a_rate_is_told_where_to_give_it(adding):
    with pytest.raises(ValueError, match=r"the state 's' has no rate of change.*--state-rate"):
        adding("p0*s")


def test_a_number_that_is_not_there_yet_cannot_be_held(adding):
    with pytest.raises(ModelError, match=r"equation\.p0: is of what is added.*twinmill twin set"):
        adding("p0*vx", held=["equation.p0"])


def test_what_spoils_left_out_predictions_is_told(adding):
    """Only the product of the two numbers is told: from near zero a fit may land anywhere."""
    result = adding("p0*vx*p1", adds_to="omega_radps")
    assert result.heldout_after.score > result.heldout_refit.score
    (note,) = result.notes
    assert "worse with it" in note and "twinmill twin set" in note


def test_what_left_out_predictions_do_not_mind_is_told(adding):
    (note,) = adding("p0*vx*vx").notes
    assert "no better with it" in note


def test_a_number_at_its_bound_is_told_as_such():
    cut = ParameterEstimate("equation.p0", -10.0, 20.0, "1", at_bound=True, seen=False)
    (row,) = tables.parameters([cut]).rows
    assert row[-1].text == "at its bound"


@pytest.fixture(scope="module")
def warming(tanh_robot, measure):
    """Drive of a robot that loses speed with its heat, whose time constant is 6 s."""

    class Warming(tanh_robot):
        def hindered(self, motion):
            keep = np.exp(-EULER_S / HEAT_S)
            heat = filtered([1 - keep], [1, -keep], motion[:, :1] ** 2, axis=0)
            return motion * np.hstack([1 - LOSS_PER_HEAT * heat, np.ones((len(heat), 2))])

    return measure(Warming(), 6, 60.0)


@pytest.mark.parametrize(
    ("rate", "value"),
    [
        ("(vx*vx - s)*p1", 1 / HEAT_S),
        ("(vx*vx - s)/p1", HEAT_S),
        ("(s - vx*vx)*p1", -1 / HEAT_S),
    ],
)
def test_a_number_in_a_rate_is_fitted_like_others(
    rate, value, warming, one_clock_base, tmp_path, recwarn
):
    """However it is written, and whatever sign keeps the state from growing."""
    texts = {"adds_to": "vx_mps", "formula": "p0*s*vx", "state_rate": rate}
    out = tmp_path / "added.toml"
    found = add("equation", [warming], one_clock_base, out=out, command="", texts=texts)
    loss, own = (p for p in found.parameters if p.name in ("equation.p0", "equation.p1"))
    assert own.value == pytest.approx(value, abs=max(3 * own.std, 0.1 * abs(value)))
    assert loss.value == pytest.approx(-LOSS_PER_HEAT, abs=max(3 * loss.std, 0.1 * LOSS_PER_HEAT))
    assert not [w for w in recwarn if issubclass(w.category, RuntimeWarning)]
