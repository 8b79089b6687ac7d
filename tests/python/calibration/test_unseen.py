# SPDX-License-Identifier: Apache-2.0
"""A log's, or its robot's, blind spots are told, and the drive that would show them."""

from dataclasses import replace

import numpy as np
import pytest
import twinmill_native as native

from twinmill.diagnosis.diagnose import DRIVES, diagnose, drives_for
from twinmill.model.parameters import catalogue


@pytest.mark.parametrize("wheels", ["mecanum", "omni3", "differential", "ackermann"])
def test_no_robot_is_told_to_drive_where_its_wheels_do_not_go(wheels, model_text):
    """By geometry: wheels that grip forward alone move nothing to the left."""
    text = model_text("m").replace('"mecanum"', f'"{wheels}"').replace('"duty"', '"twist"')
    text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
    model = native.Model.from_toml(text, "m.toml")
    strafes = any(abs(wheel["grip"][1]) > 0.1 for wheel in model.wheels())
    told = drives_for(list(catalogue()), [], model.wheel_kind)[0].split(", ")
    assert {DRIVES["strafe"] in told, DRIVES["diagonal"] in told} == {strafes}
    assert DRIVES["straight"] in told and DRIVES["arcs"] in told


@pytest.fixture(scope="module")
def without_voltage(tanh_robot, measure, model_file):
    """Log of the unchanged robot, whose battery nobody measured."""
    run = measure(tanh_robot(), 1, 20.0)
    unknown_V = np.full(len(run.track.command_t_s), np.nan)
    return diagnose([replace(run, track=replace(run.track, battery_V=unknown_V))], model_file())


def test_a_log_without_voltage_says_that_this_hides_the_battery(without_voltage):
    assert "no voltage" in dict(without_voltage.not_identifiable)["battery_sag"]
    plan = without_voltage.next_experiment
    assert plan is None or "battery_sag" not in plan["separates"]  # no drive would show it


def test_a_drive_is_asked_for_by_those_that_it_would_show():
    """By their cards: a long run with steps shows clock_rate, diagonals show strafe_loss."""
    seen = [name for name, card in catalogue().items() if "diagonal" not in card["identify"]]
    hidden = ["clock_rate", "strafe_loss"]
    assert drives_for(hidden, seen, "mecanum") == ("diagonally", ["strafe_loss"])
    assert drives_for(["clock_rate"], seen, "mecanum") == ("", [])
    words, names = drives_for(hidden, [], "mecanum")
    assert names == hidden and words == "diagonally, from rest, for two minutes or more"
