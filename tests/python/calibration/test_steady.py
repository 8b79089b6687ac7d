# SPDX-License-Identifier: Apache-2.0
"""Steady-state tables of robots made in numpy, whose constants are known, and of real ones."""

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.log import LogError
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.better import better
from twinmill.diagnosis.infer import infer
from twinmill.fitting.compare import compare
from twinmill.inference.keeping import with_its_error
from twinmill.inference.readings import Readings
from twinmill.model.model_file import ModelFile
from twinmill.predict.steady_states import SteadyStates

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


def curved_rim_mps(duty):
    """A cubic through zero and full duty: half duty gives half of the bend over 4 more."""
    return TOP_MPS * (duty + 0.6 * duty * (1 - np.abs(duty)))


def dead_rim_mps(duty):
    """As `dead_zone` on its card: each duty is less by the width."""
    return TOP_MPS * np.sign(duty) * np.maximum(np.abs(duty) - 0.08, 0)


def write_sheet(path, rim_mps, seed=1, left=1.0, robots=ROBOTS):
    """Robots that differ, three runs that scatter by 2 %, one typing error.

    Args:
        path: of the table.
        rim_mps: speed of a wheel by its duty.
        seed: of the scatter.
        left: times the speed of the left wheels.
        robots: times the speed of their kind.
    """
    random = np.random.default_rng(seed)
    rows = []
    for robot, own in enumerate(robots, 1):
        for v, d, w in MOVES:
            x, y = v * np.cos(np.radians(d)), v * np.sin(np.radians(d))
            asked = np.array([y + x + 126 * w, y - x - 126 * w, y - x + 126 * w, y + x - 126 * w])
            fl, fr, rl, rr = rim_mps(np.clip(asked, -100, 100) / 100) * [left, 1, left, 1]
            speed = np.hypot(fl + fr + rl + rr, -fl + fr + rl - rr) / 4 * own
            turn = (-fl + fr - rl + rr) / 4 / LEVER_M * own
            # By tape: half a wheel's turn in a circle is none, nor are 3 degrees in a second.
            speed, turn = (0.0 if abs(x) < 0.05 else x for x in (speed, turn))
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


def judged(path):
    return infer(load_measurements([path]), ModelFile.load("turbopi_nominal.toml"))


def names(found):
    return [f.effect for f in found.answer.findings]


def test_a_robot_that_stands_at_small_duties_and_has_a_curve_is_seen_to_have_both(tmp_path):
    found = judged(write_sheet(tmp_path / "sheet.csv", real_rim_mps))
    # Beside a free curve a dead zone and stiction differ next to the edge alone.
    assert names(found)[0] == "speed_curve" and {"dead_zone", "stiction"} & {*names(found)}
    assert found.after.score < 0.6 * found.before.score
    hidden = found.not_shown
    assert "starts and stops" in hidden["coasting"]
    assert {"motor_lag", "input_delay", "clock_offset", "marker_offset"} <= set(hidden)
    assert not {*hidden} & {*found.answer.effects}
    # A linear robot's side would move at 0.07 m/s on average where it was seen to stand still.
    still = [r.predicted[r.measurement.still, 2] for r in found.after.robots]
    assert np.concatenate(still).mean() < 0.03


@pytest.mark.parametrize("robots", [ROBOTS, (1.0,)])
@pytest.mark.parametrize(
    ("rim_mps", "left", "effect", "numbers"),
    [
        (dead_rim_mps, 1.0, "dead_zone", {"width": 0.08}),
        (curved_rim_mps, 1.0, "speed_curve", {"bend": 0.6, "skew": 0.0}),
        (lambda u: TOP_MPS * u, 0.9, "wheel_gain", {}),
    ],
)
def test_what_is_hidden_is_surely_named(tmp_path, rim_mps, left, effect, numbers, robots):
    path = write_sheet(tmp_path / "sheet.csv", rim_mps, left=left, robots=robots)
    found = judged(path)
    (first,) = found.answer.findings
    assert (first.effect, first.certainty) == (effect, "sure")
    for name, true in numbers.items():
        value, std = first.numbers[name]
        assert abs(value - true) < 3 * std
    if effect == "wheel_gain":  # their mean is the base's gain
        fl, fr, rl, rr = (first.numbers[w][0] for w in ("fl", "fr", "rl", "rr"))
        assert (2 + fl + rl) / (2 + fr + rr) == pytest.approx(left, abs=0.01)
    assert found.after.score < 1.2 < 3 < found.before.score


@pytest.mark.parametrize("robots", [ROBOTS, (1.0,)])
@pytest.mark.parametrize("seed", [1, 3, 5])
def test_nothing_is_missing_for_a_linear_robot(tmp_path, seed, robots):
    path = write_sheet(tmp_path / "sheet.csv", lambda u: 0.33 * u, seed, robots=robots)
    found = judged(path)
    assert names(found) == [] and not found.added
    assert found.answer.verdict == "refit_enough"  # its speed is 0.36 m/s on the sheet
    assert 0.5 < found.refitted.score < 1.3


def test_robots_whose_wheels_differ_do_not_lack_an_effect_of_all(tmp_path):
    """Each of four robots has a weak side of its own, two the left and two the right."""
    rows = []
    for robot, left in enumerate((0.96, 1.04, 0.97, 1.03), 1):
        path = write_sheet(tmp_path / "one.csv", lambda u: 0.36 * u, robot, left, robots=(1.0,))
        rows += [f"{robot},{row[2:]}" for row in path.read_text().splitlines()[1:]]
    path = tmp_path / "sheet.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    assert not any(f.certainty == "sure" for f in judged(path).answer.findings)


def test_the_model_with_what_was_found_lacks_nothing_and_has_no_lag_of_a_table(tmp_path):
    path, file = write_sheet(tmp_path / "sheet.csv", dead_rim_mps), tmp_path / "better.toml"
    model = ModelFile.load("turbopi_nominal.toml")
    tables = load_measurements([path])
    made = better(infer(tables, model), model, file, "explain").file
    assert list(made.model.effects) == ["dead_zone"]
    assert made.model.get("dead_zone.width") == pytest.approx(0.08, abs=0.005)
    assert "base.motor_lag_s" not in made.covariance.names
    assert names(infer(tables, made)) == []
    assert with_its_error(made, tables) is made


def test_readings_that_are_errors_of_typing_do_not_hide_an_effect(tmp_path):
    path = write_sheet(tmp_path / "sheet.csv", dead_rim_mps, robots=(1.0,))
    lines = path.read_text().splitlines()
    for row in (31, 32, 33):  # one input, all its runs: ten times too fast
        cells = lines[row].split(",")
        cells[5] = f"{10 * float(cells[5]):.4f}"
        lines[row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    first = judged(path).answer.findings[0]
    assert (first.effect, first.certainty) == ("dead_zone", "sure")
    assert first.numbers["width"][0] == pytest.approx(0.08, abs=0.01)


def test_logs_and_tables_are_judged_apart(tmp_path, measure):
    tables = load_measurements([write_sheet(tmp_path / "sheet.csv", dead_rim_mps)])
    model = ModelFile.load("turbopi_nominal.toml")
    with pytest.raises(LogError, match="which are judged apart"):
        infer([*tables, measure(duration_s=20.0)], model)
    with pytest.raises(LogError, match="without own logs"):
        infer(tables, model, tables)


def test_a_reading_changes_with_the_motion_as_algebra_says(tmp_path):
    """A dependence on speed changes readings by the chain rule over the body's velocity."""
    model = ModelFile.load("turbopi_nominal.toml").model
    (table,) = load_measurements([write_sheet(tmp_path / "s.csv", curved_rim_mps, robots=(1.0,))])
    readings = Readings([SteadyStates.of(table, model)])
    motion, change = readings.motion(model)
    before = readings.errors(model)[0, :, 0]
    for axis, gain in enumerate(("forward", "sideways", "yaw")):  # of the body's velocity
        faster = model.copy()
        faster.set(f"base.{gain}_gain", 1 + 1e-6)
        told = (before - readings.errors(faster)[0, :, 0]) / 1e-6
        expected = change[:, axis] * motion.moved[:, axis]
        assert np.abs(told).max() > 1
        np.testing.assert_allclose(told, expected, rtol=1e-3, atol=1e-3)


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


def test_real_robots_have_a_curve_and_stand_at_small_duties(real):
    found = infer(real, ModelFile.load("turbopi_nominal.toml"))
    assert found.answer.nothing < 1e-6
    assert names(found)[:2] == ["speed_curve", "stiction"]
    # By hand: half duty gives three quarters of full speed.
    numbers = {f.effect: f.numbers for f in found.answer.findings}
    bend = numbers["speed_curve"]["bend"][0]
    assert 0.5 + bend / 4 == pytest.approx(0.75, abs=0.05)
    # Seen on the floor: at 26 % a side stood still on all six robots, at 37 % on one of them. The
    # edge is of the curve's duty.
    skew, edge = numbers["speed_curve"]["skew"][0], numbers["stiction"]["below"][0]
    duty = np.linspace(0, 1, 1001)
    curved = duty + duty * (1 - duty) * (bend + skew * (1 - 2 * duty))
    assert 0.26 <= np.interp(edge, curved, duty) < 0.37


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
