# SPDX-License-Identifier: Apache-2.0
"""Bench tests: duties and speeds of wheels in the air, whose constants are known."""

import numpy as np
import pytest

from twinmill.data.log import LogError
from twinmill.data.measurement import load_measurements
from twinmill.data.steady_table import read_steady_tables
from twinmill.diagnosis.infer import infer
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

RADIUS_M, TOP_MPS, DEAD = 0.022, 0.161, 0.06
MODEL = """
[robot]
wheel_radius_m = 0.022
half_wheelbase_m = 0.0
half_track_m = 0.0475
mass_kg = 0.3
[base]
drive = "duty"
wheels = "differential"
motor_lag_s = 0.05
control_period_s = 0.1
duty_pct = [0, 100]
wheel_speed_mps = [0, 0.161]
"""


def written(path, text):
    path.write_text(text)
    return path


@pytest.fixture
def model(tmp_path):
    return ModelFile.load(str(written(tmp_path / "model.toml", MODEL)))


def bench(path, rim_mps, pwm=(26, 51, 77, 102, 153, 204, 255), runs=4):
    """Both wheels at each duty, in turns a minute, read with a scatter of 0.5 %."""
    random = np.random.default_rng(2)
    rows = ["duty_pwm,run,left_rpm,right_rpm"]
    for own in pwm:
        for run in range(runs):
            rpm = rim_mps(own / 255) / RADIUS_M * 30 / np.pi * random.normal(1, 0.005, 2)
            rows.append(f"{own},{run + 1},{rpm[0]:.2f},{rpm[1]:.2f}")
    return written(path, "\n".join(rows) + "\n")


def test_wheels_that_turn_as_the_model_says_lack_nothing(tmp_path, model):
    sheets = load_measurements([bench(tmp_path / "b.csv", lambda duty: TOP_MPS * duty)])
    told = compare(sheets, model)
    assert told.score < 1.5
    cell = told.robots[0].cells()[-1]
    assert cell["fl_pct"] == cell["rr_pct"] == 100
    assert cell["w2_radps"]["predicted"] == pytest.approx(TOP_MPS / RADIUS_M)
    assert infer(sheets, model).answer.verdict == "model_adequate"


def test_a_dead_zone_is_found_on_the_bench(tmp_path, model):
    path = bench(tmp_path / "b.csv", lambda duty: TOP_MPS * max(0.0, duty - DEAD))
    sheets = load_measurements([path])
    (found,) = infer(sheets, model).answer.findings
    assert (found.effect, found.certainty) == ("dead_zone", "sure")
    assert found.numbers["width"][0] == pytest.approx(DEAD, abs=0.002)


def test_a_weak_side_is_found_on_the_bench(tmp_path, model):
    path = bench(tmp_path / "b.csv", lambda duty: TOP_MPS * duty * np.array([0.9, 1.0]))
    (found,) = infer(load_measurements([path]), model).answer.findings
    assert (found.effect, found.certainty) == ("wheel_gain", "sure")
    left, right = (value for value, _ in found.numbers.values())
    assert (1 + left) / (1 + right) == pytest.approx(0.9, abs=0.01)


def test_a_speed_of_the_base_is_fitted_on_the_bench(tmp_path, model):
    sheets = load_measurements([bench(tmp_path / "b.csv", lambda duty: 0.9 * TOP_MPS * duty)])
    found = fit(sheets, model, out=tmp_path / "fitted.toml", command="fit")
    assert found.after.score < 1.5 < found.before.score
    again = ModelFile.load(str(tmp_path / "fitted.toml")).model
    (speed,) = (v for v in again.values() if v["name"].startswith("base.wheel_speed_mps."))
    assert again.get("base.forward_gain") == 1.0  # of rolling, which no bench tells
    assert speed["value"] == pytest.approx(0.9 * TOP_MPS, rel=0.005)


@pytest.mark.parametrize(
    ("text", "duty", "speed"),
    [
        ("duty_pct,left_rpm,right_rpm\n50,30,60\n", [50] * 4, [np.pi, 2 * np.pi, None, None]),
        ("pwm,rpm\n255,60\n", [100] * 4, [2 * np.pi, None, None, None]),
        ("Duty [%],motor 2 speed [rad/s]\n-40,3\n", [-40] * 4, [None, -3, None, None]),
        ("wheel,duty_unit,rpm\nrear left,0.5,30\n", [0, 0, 50, 0], [None, None, np.pi, None]),
        (
            "fl_pct,fr_pct,rl_pct,rr_pct,w1_radps,w2_radps,w3_radps,w4_radps\n1,2,3,4,5,6,7,8\n",
            [1, 2, 3, 4],
            [5, 6, 7, 8],
        ),
        ("left_pct,right_pct,left_rps,right_rps\n10,-20,1,-2\n", [10, -20] * 2, None),
    ],
)
def test_duties_and_speeds_are_read_by_the_names_of_their_columns(tmp_path, text, duty, speed):
    (sheet,) = read_steady_tables(written(tmp_path / "b.csv", text))
    speed = speed or [2 * np.pi, -4 * np.pi, None, None]
    np.testing.assert_allclose(sheet.inputs[0], duty)
    np.testing.assert_allclose(sheet.value[0], [np.nan if v is None else v for v in speed])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t_s,duty_pct,rpm\n0,1,2\n", "over time (t_s)"),
        ("duty,rpm\n1,2\n", "column duty names no unit; call it duty_pct"),
        ("duty_pct,third_rpm\n1,2\n", "which wheel is 'third'"),
        ("duty_pct,rpm,left_rpm\n1,2,3\n", "left_rpm tells the speed of wheel 1"),
        ("duty_pct,rpm\n120,2\n", "the duty in percent is 120"),
        ("duty_pct,rpm\n10,x\n", "row 2: rpm is 'x'"),
    ],
)
def test_what_is_no_bench_test_is_refused_by_its_cause(tmp_path, text, words):
    with pytest.raises(LogError) as told:
        read_steady_tables(written(tmp_path / "b.csv", text))
    assert words in str(told.value)


def test_a_model_of_another_drive_is_refused(tmp_path, model):
    sheets = load_measurements([bench(tmp_path / "b.csv", lambda duty: TOP_MPS * duty)])
    text = '[base]\ndrive = "twist"\nwheels = "none"\nmotor_lag_s = 0.1\ncontrol_period_s = 0.05\n'
    twist = ModelFile.load(str(written(tmp_path / "twist.toml", text)))
    with pytest.raises(LogError, match='take a model with drive = "duty"'):
        compare(sheets, twist)


def test_the_command_shows_wheels_by_duty(tmp_path, model, twinmill):
    path = bench(tmp_path / "b.csv", lambda duty: TOP_MPS * max(0.0, duty - DEAD))
    code, said, wrong = twinmill("compare", path, "--model", model.path, "--out", tmp_path / "r")
    assert code == 0, wrong
    assert "wheel 1" in said and "of the error comes at duty below 45%" in " ".join(said.split())
