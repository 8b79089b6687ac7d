# SPDX-License-Identifier: Apache-2.0
"""Effects that a log cannot show are said with why, and do not compete."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.diagnosis.diagnose import diagnose


@pytest.fixture(scope="module")
def without_voltage(tanh_robot, measure, model_file):
    """Log of the unchanged robot, whose battery nobody measured."""
    run = measure(tanh_robot(), 1, 20.0)
    unknown_V = np.full(len(run.track.command_t_s), np.nan)
    return diagnose([replace(run, track=replace(run.track, battery_V=unknown_V))], model_file())


def test_a_log_without_voltage_says_that_this_hides_the_battery(without_voltage):
    assert "no voltage" in without_voltage.not_shown["battery_sag"]
    assert "battery_sag" not in without_voltage.answer.effects
