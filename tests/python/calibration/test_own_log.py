# SPDX-License-Identifier: Apache-2.0
"""A log of the twin scores 1 against the model that made it, whatever that is told."""

import subprocess

import numpy as np
import pytest

import twinmill as tm
from twinmill.programs import find_program

MODEL = """
name = "own"
[robot]
half_wheelbase_m = 0.1
half_track_m = 0.08
max_steering_rad = 0.5
[base]
drive = "{drive}"
wheels = "{wheels}"
speed_per_input_mps = 0.005
turn_per_input_radps = 1.0
steering_per_input_rad = 0.4
control_period_s = 0.02
motor_lag_s = 0.05
[clock]
same = true
[noise]
sensor_m = 0.0005
sensor_rad = 0.002
drive_mps = 0.01
drive_radps = 0.05
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """Half a minute of random inputs."""
    random = np.random.default_rng(1)
    t_s = np.cumsum(random.uniform(0.5, 1.5, 30))
    rows = [f"{t:.2f},{random.integers(20, 80)},{random.uniform(-1, 1):.2f}" for t in t_s]
    path = tmp_path_factory.mktemp("own") / "script.csv"
    path.write_text("\n".join(["t_s,speed_input,turn_input", "0,0,0", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("drive", "wheels", "kind"),
    [
        ("duty", "differential", "duty"),
        ("twist", "none", "twist"),
        ("twist", "mecanum", "twist"),
        ("twist", "ackermann", "twist"),
        ("steering", "ackermann", "twist"),  # as importers tell steering angles, too
    ],
)
def test_a_twin_agrees_with_the_model_that_drove_it(drive, wheels, kind, script, tmp_path):
    driven, judged = tmp_path / "driven.toml", tmp_path / "judged.toml"
    driven.write_text(MODEL.format(drive=drive, wheels=wheels))
    judged.write_text(MODEL.format(drive=kind, wheels=wheels))
    path = tmp_path / "own.lcmlog"
    words = [find_program("twin_run"), "--plant", "planar", "--n", "1", "--model", driven]
    subprocess.run([*words, "--script", script, "--log", path], check=True, capture_output=True)
    log = tm.load(path)
    compared = tm.compare(log, tm.Model.load(judged))
    assert compared.score == pytest.approx(1, abs=0.2)
    assert set(log.commands()["kind"]) == {kind}
    if drive != kind:  # no log holds angles
        with pytest.raises(tm.LogError, match='drive = "twist"'):
            tm.compare(log, tm.Model.load(driven))
