# SPDX-License-Identifier: Apache-2.0
"""A wheel's fault at its angle is told though the model has its radius wrong.

The robots are those of `conftest.py`, with 0.0325 m in their model's file.
"""

import numpy as np
import pytest

from twinmill.diagnosis.better import better
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import effect_parameters

STEP_S = 1 / 480  # of the robot
TOLD_M = 0.0325
FRONT_RIGHT = (0, 1, 0, 0)
OFF = 0.2
APART_RAD = 2.0


@pytest.fixture(scope="module")
def uneven(tanh_robot):
    """A robot whose front right wheel runs unevenly, so many times a turn."""

    def make(times: int, share: float, radius_m: float, begins_rad: float = 0.0):
        class Uneven(tanh_robot):
            def wheels_mps(self, duty):
                rims = super().wheels_mps(duty)
                turned_rad = np.cumsum(rims[:, 1]) * STEP_S / radius_m
                angle = times * (begins_rad + turned_rad)
                return rims * (1 + share * np.cos(angle)[:, None] * FRONT_RIGHT)

        return Uneven()

    return make


@pytest.fixture(scope="module")
def two_runs(uneven, measure):
    """Two logs of a robot whose front right axle is off its centre by OFF, begun at two angles."""
    begins_rad = (0.5, 0.5 + APART_RAD)
    return [measure(uneven(1, OFF, TOLD_M, a), 110 + k, 60.0) for k, a in enumerate(begins_rad)]


def size_of(model) -> float:
    return np.hypot(*(model.get(f"wheel_eccentricity.fr_{part}") for part in ("cos", "sin")))


def test_what_one_log_told_of_an_axle_predicts_the_next(two_runs, one_clock_base, tmp_path):
    """Wheels stand anywhere when the next log begins."""
    first, second = two_runs
    found = diagnose([first], one_clock_base)
    axle = found.answer.findings[0]
    assert axle.effect == "wheel_eccentricity"
    (cos, _), (sin, _) = (axle.numbers[f"fr_{part}"] for part in ("cos", "sin"))
    assert np.hypot(cos, sin) == pytest.approx(OFF, abs=0.06)
    explained = better(found, one_clock_base, tmp_path / "explained.toml", "").file
    own, other = (compare([m], explained) for m in two_runs)
    assert compare([second], one_clock_base).score > 1.3 * other.score
    assert other.score == pytest.approx(own.score, rel=0.1)
    angles_rad = [c.main.wheel_angles_rad["fr"] for c in (own, other)]
    assert angles_rad[0] == pytest.approx(0, abs=0.05)
    assert angles_rad[1] == pytest.approx(APART_RAD, abs=0.15)
    named = diagnose([second], explained).answer.findings
    assert not [f for f in named if f.certainty == "sure"]


def test_two_logs_of_an_axle_are_fitted_with_an_angle_each(two_runs, one_clock_base, tmp_path):
    out = tmp_path / "both.toml"
    found = add("wheel_eccentricity", two_runs, one_clock_base, out=out, command="")
    model = ModelFile.load(str(out))
    assert size_of(model.model) == pytest.approx(OFF, abs=0.02)
    assert found.heldout_after.score < 0.7 * found.heldout_refit.score
    scores = [r.score for r in compare(two_runs, model).robots]
    assert scores == pytest.approx(2 * [compare([two_runs[0]], model).score], rel=0.05)
    again = tmp_path / "again.toml"
    told = {p.name: p for p in fit(two_runs, model, again, "").parameters}
    assert told["wheel_eccentricity.fr_cos"].seen
    assert size_of(ModelFile.load(str(again)).model) == pytest.approx(OFF, abs=0.02)


def test_a_robot_on_one_axle_has_two_wheels(model_file):
    """Its speeds are half the sum of theirs, and their difference over the track.

    One of four wheels that was asked before has four.
    """
    four = model_file(('"mecanum"', '"differential"')).model
    four.add_effect("wheel_eccentricity")
    assert len(effect_parameters(four, "wheel_eccentricity")) == 9
    one_axle = ("half_wheelbase_m = 0.059", "half_wheelbase_m = 0")
    model = model_file(one_axle, ('"mecanum"', '"differential"')).model
    assert [w["words"] for w in model.wheels()] == ["left wheel", "right wheel"]
    rolled_radps = [0.1 / TOLD_M, 0.3 / TOLD_M]
    assert model.body_velocity(rolled_radps) == pytest.approx([0.2, 0, 0.2 / (2 * 0.067)])
    model.add_effect("wheel_eccentricity")
    names = [p.name.split(".")[1] for p in effect_parameters(model, "wheel_eccentricity")]
    assert names == ["fl_cos", "fl_sin", "fr_cos", "fr_sin", "radius_ratio"]
