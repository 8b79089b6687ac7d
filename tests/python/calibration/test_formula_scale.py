# SPDX-License-Identifier: Apache-2.0
"""Formulas whose numbers are far from one: a robot ten times slower than the usual one.

It loses speed with heat, written here in NumPy, so that the loss per squared speed is a hundred.
"""

import pytest
from scipy.signal import lfilter

from twinmill.diagnosis.explain import Explanation, explain
from twinmill.fitting.add import AddResult, add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_names

STEP_S = 1 / 480  # of the robot
LOSS_S2_PER_M2, MEMORY_S = 160.0, 15.0
SLOW = {"top_mps": 0.06, "sensor_m": 6e-5, "sensor_rad": 3.5e-4}
SLOW |= {"drive_mps": 6e-4, "drive_radps": 6e-3}
HEAT = "((vx*vx + vy*vy) - s)*(1/15)"


@pytest.fixture(scope="module")
def warming(tanh_robot) -> type:
    """All of its speeds fall with the heat of its way."""

    class Warming(tanh_robot):
        def hindered(self, motion):
            load = (motion[:, :2] ** 2).sum(axis=1)
            heat = lfilter([STEP_S / MEMORY_S], [1, STEP_S / MEMORY_S - 1], load)
            return motion * (1 - LOSS_S2_PER_M2 * heat)[:, None]

    return Warming


@pytest.fixture(scope="module")
def base(tanh_robot, measure, model_file, tmp_path_factory) -> ModelFile:
    """Fitted to a drive of the robot without its heat."""
    path = tmp_path_factory.mktemp("base") / "base.toml"
    guess = model_file(extra="[clock]\nsame = true\n")
    fit([measure(tanh_robot(**SLOW), 1, 60.0)], guess, path, "")
    return ModelFile.load(str(path))


@pytest.fixture(scope="module")
def explained(warming, measure, base, tmp_path_factory) -> Explanation:
    """Result of `explain` for one drive."""
    out = tmp_path_factory.mktemp("explained") / "explained.toml"
    return explain([measure(warming(**SLOW), 101, 100.0)], base, out=out, command="")


@pytest.fixture(scope="module")
def added(warming, measure, base, tmp_path_factory) -> AddResult:
    """Result of `add equation` for it, told the form."""
    return add(
        "equation",
        [measure(warming(**SLOW), 101, 100.0)],
        base,
        out=tmp_path_factory.mktemp("added") / "added.toml",
        command="",
        texts={"adds_to": "motion", "formula": "p0*s", "state_rate": HEAT},
    )


def test_a_number_of_hundreds_is_fitted_as_any_other(added):
    (number,) = added.added
    assert number.value == pytest.approx(-LOSS_S2_PER_M2, rel=0.1)
    assert number.seen and not number.at_bound
    assert added.heldout_after.score < 1.2 < added.heldout_refit.score


def test_a_proven_formula_is_taken_whatever_the_size_of_its_numbers(explained):
    assert explained.formula.kept
    number = explained.formula.numbers[0]
    assert number.value == pytest.approx(-LOSS_S2_PER_M2, rel=0.2)


def test_beside_it_no_loss_from_a_moment_or_at_a_place_stays(explained, warming, measure, base):
    """Nothing broke, and the floor is even: another drive is predicted without them."""
    model = ModelFile.load(str(explained.path))
    assert effect_names(model.model) == ["equation"]
    other = [measure(warming(**SLOW), 77, 60.0)]
    assert compare(other, model).score < 1.2 < compare(other, base).score


def test_what_the_formula_does_as_well_is_not_told_as_sure(explained):
    local = ("abrupt_loss", "transient_loss", "floor_patch")
    assert not [f for f in explained.diagnosis.findings if f.effect in local and not f.why]
