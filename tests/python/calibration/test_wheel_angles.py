# SPDX-License-Identifier: Apache-2.0
"""What a wheel does at its angle is told though the model has its radius wrong.

The robots are those of `conftest.py`, with 0.0325 m in their model's file.
"""

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.opening import open_measurements

STEP_S = 1 / 480  # of the robot
TOLD_M = 0.0325
FRONT_RIGHT = (0, 1, 0, 0)


@pytest.fixture
def uneven(tanh_robot):
    """A robot whose front right wheel runs unevenly, so many times a turn."""

    def make(times: int, share: float, radius_m: float):
        class Uneven(tanh_robot):
            def wheels_mps(self, duty):
                rims = super().wheels_mps(duty)
                angle = times * np.cumsum(rims[:, 1]) * STEP_S / radius_m
                return rims * (1 + share * np.cos(angle)[:, None] * FRONT_RIGHT)

        return Uneven()

    return make


def test_an_oval_wheel_is_no_effect_and_its_angle_is_told(uneven, measure, one_clock_base):
    found = diagnose([measure(uneven(2, 0.15, 1.05 * TOLD_M), 103, 80.0)], one_clock_base)
    assert found.rest.depends_on[:1] == ["angle of the front right wheel"]


def test_a_wheel_off_its_centre_is_found_with_its_radius(uneven, measure, one_clock_base):
    found = diagnose([measure(uneven(1, 0.2, 0.94 * TOLD_M), 104, 80.0)], one_clock_base)
    assert found.findings[0].effect == "wheel_eccentricity"
    values = {p.short: p.value for p in found.findings[0].parameters}
    assert values["radius_ratio"] == pytest.approx(0.94, abs=0.01)
    assert np.hypot(values["fr_cos"], values["fr_sin"]) == pytest.approx(0.2, abs=0.06)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_round_wheels_tell_no_radius(seed, tanh_robot, measure, one_clock_base):
    (opened,) = open_measurements([measure(tanh_robot(), seed, 60.0)], one_clock_base)
    assert opened.floor.response.radius_ratio == 1.0
