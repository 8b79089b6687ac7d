# SPDX-License-Identifier: Apache-2.0
"""Steady-state tables of robots made in numpy, whose constants are known, and of real ones."""

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.compare import compare
from twinmill.model.model_file import ModelFile

HEADER = "robot_id,speed_input,direction_deg,turn_input,run,speed_mps,turn_radps,note\n"
LEVER_M = 0.126  # half wheelbase and half track of turbopi_nominal.toml
ROBOTS = (0.98, 0.99, 1.01, 1.02)  # times the speed of their kind
TOP_MPS, STILL_DUTY = 0.36, 0.2
MOVES = [(v, d, 0.0) for v in (30, 40, 50, 70, 100) for d in (90, 270, 0)] + [
    (v, 90, w) for v in (0, 30, 50, 70, 100) for w in (-1.5, -1.0, -0.7, -0.4, 0.4, 0.7, 1.0, 1.5)
]


def real_rim_mps(duty):
    """Stands still below a duty, then rises as a root: two thirds of full speed at half duty."""
    over = np.maximum(np.abs(duty) - STILL_DUTY, 0) / (1 - STILL_DUTY)
    return np.sign(duty) * TOP_MPS * np.sqrt(over)


def write_sheet(path, rim_mps, seed=1):
    """Four robots that differ, three runs that scatter by 2 %, one typing error."""
    random = np.random.default_rng(seed)
    rows = []
    for robot, own in enumerate(ROBOTS, 1):
        for v, d, w in MOVES:
            x, y = v * np.cos(np.radians(d)), v * np.sin(np.radians(d))
            asked = np.array([y + x + 126 * w, y - x - 126 * w, y - x + 126 * w, y + x - 126 * w])
            fl, fr, rl, rr = rim_mps(np.clip(np.trunc(asked), -100, 100) / 100)
            speed = np.hypot(fl + fr + rl + rr, -fl + fr + rl - rr) / 4 * own
            turn = (-fl + fr - rl + rr) / 4 / LEVER_M * own
            one_side = w != 0 and (fl == 0) != (fr == 0)
            for run in (1, 2, 3):
                seen = (speed, turn) * random.normal(1, 0.02, 2)
                if one_side:
                    cells = "nan,nan,one side does not spin"
                else:
                    cells = f"{seen[0]:.4f},{seen[1]:.4f},"
                rows.append(f"{robot},{v},{d},{w},{run},{cells}")
    typed = rows[4].split(",")
    rows[4] = ",".join([*typed[:5], "2.77", *typed[6:]])
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path


def test_a_linear_robot_moves_steadily_as_algebra_says():
    model = ModelFile.load("turbopi_nominal.toml").model
    left, right = 0.3, 0.9
    steady = native.steady(model, np.array([[left, right, left, right]]), [], np.zeros((1, 0)))[
        0, 0
    ]
    forward, turn = 0.36 * (left + right) / 2, 0.36 * (right - left) / 2 / LEVER_M
    assert steady == pytest.approx([forward, 0, turn, *(0.36 * np.array([left, right] * 2))])


def test_a_robot_that_stands_at_small_duties_and_has_a_curve_is_seen_to_have_both(tmp_path):
    sheets = load_measurements([write_sheet(tmp_path / "sheet.csv", real_rim_mps)])
    found = diagnose(sheets, ModelFile.load("turbopi_nominal.toml"))
    # Beside a free curve a dead zone and stiction differ next to the edge alone.
    assert "speed_curve" in found.found and {"dead_zone", "stiction"} & set(found.found)
    before, after = found.steps[0][1], found.steps[-1][1]
    assert after < 0.5 * before
    assert [name for name, _ in found.steps[1:]] == [f.effect for f in found.findings]
    hidden = dict(found.not_identifiable)
    assert "starts and stops" in hidden["coasting"]
    assert {"motor_lag", "input_delay", "clock_offset", "marker_offset"} <= set(hidden)
    # A linear robot's side would move at 0.07 m/s on average where it was seen to stand still.
    still = [s.predicted()[s.measurement.still, 2] for s in found.modelled]
    assert np.concatenate(still).mean() < 0.03


def test_nothing_is_missing_for_a_linear_robot(tmp_path):
    sheets = load_measurements([write_sheet(tmp_path / "sheet.csv", lambda u: 0.33 * u)])
    found = diagnose(sheets, ModelFile.load("turbopi_nominal.toml"))
    assert found.found == []
    assert found.verdict in ("refit_enough", "model_adequate")
    assert 0.5 < found.score_refit < 1.3


def test_scatter_is_that_of_the_runs_and_of_the_robots(tmp_path):
    sheets = load_measurements([write_sheet(tmp_path / "sheet.csv", lambda u: 0.33 * u)])
    for spread in sheets[0].spread:
        assert 0.015 < spread.runs < 0.025  # 2 % were put in
        assert 0.01 < spread.robots < 0.03  # the standard deviation of ROBOTS is 0.018


def test_a_wrong_cell_is_named(tmp_path):
    path = tmp_path / "sheet.csv"
    path.write_text(HEADER + "1,100,90,3.0,1,0.3,0,\n")
    with pytest.raises(LogError, match=r"row 2: turn_input is 3"):
        load_measurements([path])
    path.write_text("robot_id,speed_input\n1,100\n")
    with pytest.raises(LogError, match="direction_deg"):
        load_measurements([path])


@pytest.fixture(scope="module")
def real(data_dir):
    path = data_dir / "turbopi_actuation" / "steady_state.csv"
    if not path.is_file():
        pytest.skip(f"no table at {path}")
    return load_measurements([path])


def test_real_robots_stick_at_small_duties_and_have_a_curve_and_these_explain_most(real):
    found = diagnose(real, ModelFile.load("turbopi_nominal.toml"))
    assert {"stiction", "speed_curve"} <= set(found.found)
    # Seen on the floor: at 26 % a side stood still on all six robots, at 37 % on one of them.
    assert 0.26 <= found.model.get("stiction.below") < 0.37
    # Robots 1 and 3 predicted from 2 and 4 and the other way. By hand: alone 0.0 and 0.3 of the
    # squared error, together 0.8.
    # On robots that were not fitted to; by hand, on the fitted ones, four fifths.
    assert 1 - (found.steps[-1][1] / found.steps[0][1]) ** 2 > 0.5


def test_real_robots_differ_more_where_a_side_hardly_turns(real):
    result = compare(real, ModelFile.load("turbopi_nominal.toml"))
    slow, straight = [], []
    for robot in result.robots:
        for cell in robot.cells():
            inputs = (cell["speed_input"], cell["direction_deg"], abs(cell["turn_input"]))
            if inputs == (100, 90, 0.5):
                slow.append(cell["speed_mps"]["spread"])
            if inputs in ((100, 90, 0), (100, 0, 0), (50, 90, 0)):
                straight.append(cell["speed_mps"]["spread"])
    # By hand: 15 to 26 % near the dead zone, 1 to 3 % straight on.
    assert 0.10 < np.nanmean(slow) < 0.30
    assert np.nanmedian(straight) < 0.05
