# SPDX-License-Identifier: Apache-2.0
"""Robots of other makers: known by measured wheel speeds or by commanded velocities."""

import csv
import gzip

import numpy as np
import pytest
from scipy.signal import lfilter

from twinmill.data import measurement
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import RobotLog
from twinmill.data.measurement import load_measurements
from twinmill.data.time_base import find_time_base, retimed
from twinmill.diagnosis.diagnose import diagnose
from twinmill.experiment.design import Limits, check, design
from twinmill.fitting.add import add
from twinmill.model.model_file import ModelFile
from twinmill_cli import main as cli
from twinmill_cli import next as next_run

CART_S, LOST_S, GAIN_PER_S = 0.02, 0.5, 2.5  # of a cart whose turns are disturbed

OMNI4 = """
name = "omni4"
[robot]
wheel_radius_m = 0.03
half_wheelbase_m = 0.1
half_track_m = 0.1
body_radius_m = 0.2
[base]
drive = "wheel_speed"
wheels = "mecanum"
control_period_s = 0.01
"""
OMNI = """
name = "omni"
[robot]
body_radius_m = 0.15
[base]
drive = "twist"
wheels = "none"
motor_lag_s = 0
control_period_s = 0.05
"""
CART = """
name = "cart"
[robot]
half_track_m = 0.1
body_radius_m = 0.15
[base]
drive = "twist"
wheels = "differential"
control_period_s = 0.05
"""


def model_file(folder, text):
    path = folder / "model.toml"
    path.write_text(text)
    return ModelFile.load(str(path))


def drive_legs(count, random, straight_mps, turn_radps):
    """(count, 2) forward and turn: straights, turns on the spot, rests of about a second each."""
    rows = []
    while len(rows) < count:
        leg = [(random.choice(straight_mps), 0), (0, random.choice(turn_radps)), (0, 0)]
        rows += [leg[random.integers(3)]] * int(random.integers(60, 160))
    return np.array(rows[:count], float)


def encoder_log(straight, turning, offset_s, seed=1, later_s=0.0):
    """Wheel speeds in rows of 10 ms that lasted longer, and poses at 100 Hz of capture's clock.

    From 20 s on the robot does all of it `later_s` later.
    """
    random = np.random.default_rng(seed)
    legs = drive_legs(4000, random, (-0.1, 0.07, 0.1), (-0.5, 0.5))
    radius_m, lever_m = 0.03, 0.2
    left, right = legs[:, 0] - lever_m * legs[:, 1], legs[:, 0] + lever_m * legs[:, 1]
    wheels = np.column_stack([left, right, left, right]) / radius_m
    lasted_s = 0.01 * np.where(legs[:, 1] != 0, turning, straight)
    heading = np.cumsum(legs[:, 1] * lasted_s)
    x, y = (np.cumsum(legs[:, 0] * f(heading) * lasted_s) for f in (np.cos, np.sin))
    capture_s = offset_s + np.cumsum(lasted_s)
    seen_s = np.arange(0, capture_s[-1] + 1, 0.01)
    done_s = seen_s - later_s * (seen_s > 20)
    pose = np.column_stack([np.interp(done_s, capture_s, v) for v in (x, y, heading)])
    pose += random.normal(size=pose.shape) * (1e-4, 1e-4, 1e-3)
    nothing, count = np.empty(0), len(legs)
    return RobotLog(
        1, "robot", "", "wheel_speed", 0.01 * np.arange(count), wheels, np.full(count, np.nan),
        nothing, nothing, nothing, nothing, nothing, nothing, seen_s, pose, np.zeros(len(seen_s)),
        np.ones(len(seen_s), bool),
    )  # fmt: skip


def test_rows_that_last_longer_are_found_on_straights_and_in_turns():
    robot = encoder_log(1.12, 1.07, 2.5)
    base = find_time_base(robot)
    assert base.straight == pytest.approx(1.12, abs=0.01)
    assert base.turning == pytest.approx(1.07, abs=0.01)
    assert base.offset_s == pytest.approx(2.5, abs=0.05)
    assert find_time_base(retimed(robot, base)) is None


def test_a_log_whose_stamps_are_right_keeps_them():
    assert find_time_base(encoder_log(1.0, 1.0, 0.1)) is None


@pytest.mark.parametrize("later_s", [0.12, 0.2, -0.2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_robot_that_follows_later_from_some_time_on_has_no_other_seconds(later_s, seed):
    assert find_time_base(encoder_log(1.0, 1.0, 0.1, seed, later_s)) is None


@pytest.fixture(scope="module")
def omni4(data_dir, tmp_path_factory):
    """One square along the body's x, one along its y."""
    folder = data_dir / "mecanum_optiodom"
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}")
    out, logs = tmp_path_factory.mktemp("omni4"), []
    for run in ("01", "07"):
        stem = f"square_080920201810_run-{run}"
        commands, log = out / "commands.csv", out / f"{run}.lcmlog"
        write_wheel_speeds(folder / f"{stem}_odo.csv.gz", commands)
        options = ImportOptions(
            robot_id=1, rename={"yaw_rad": "theta_rad"}, heading_offset_rad=np.radians(-159)
        )
        import_log(folder / f"{stem}_mocap.csv.gz", commands, log, options=options)
        logs.append(log)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurement, "MOST_POSES", 4000)
        return load_measurements(logs)


def write_wheel_speeds(source, out):
    """Revolutions in a row of 10 ms to rad/s; its wheels are ours with signs -, +, -, +."""
    with gzip.open(source, "rt") as text:
        rows = [[float(cell) for cell in row.values()] for row in csv.DictReader(text)]
    speed = 2 * np.pi * np.array(rows)[:, 1:] * (-1, 1, -1, 1) / 0.01
    lines = ["t_s,w1_radps,w2_radps,w3_radps,w4_radps"]
    lines += [f"{0.01 * k:.2f}," + ",".join(f"{w:.6f}" for w in row) for k, row in enumerate(speed)]
    out.write_text("\n".join(lines) + "\n")


def test_a_real_encoder_log_shows_its_time_base(omni4):
    for run in omni4:
        # By hand: moving time over row time, on camera's clock.
        assert run.time_base.straight == pytest.approx(1.12, abs=0.015)
        assert run.time_base.turning == pytest.approx(1.075, abs=0.02)


def test_a_real_mecanum_robot_loses_sideways_and_its_tracked_point_is_off(omni4, tmp_path):
    result = add(
        "marker_offset", omni4, model_file(tmp_path, OMNI4), out=tmp_path / "m2.toml", command=""
    )
    assert result.heldout_after.score < 0.6 * result.heldout_refit.score
    model = ModelFile.load(str(tmp_path / "m2.toml")).model
    # By hand, from distances alone, which need no common clock.
    assert model.get("base.forward_gain") == pytest.approx(1.0255, abs=0.01)
    assert model.get("base.sideways_gain") == pytest.approx(0.981, abs=0.01)
    assert 0.4 / model.get("base.yaw_gain") == pytest.approx(0.411, abs=0.008)
    offset_m = np.hypot(model.get("marker_offset.x_m"), model.get("marker_offset.y_m"))
    assert offset_m == pytest.approx(0.05, abs=0.01)


def test_a_robot_told_velocities_is_seen_to_turn_faster_to_the_left(tmp_path):
    random = np.random.default_rng(3)
    asymmetry = 0.12
    legs = drive_legs(2500, random, (-0.2, 0.15, 0.25), (-1.0, -0.6, 0.6, 1.0))
    turn = legs[:, 1] + asymmetry * np.abs(legs[:, 1])
    found = diagnosed_cart(tmp_path, legs, np.column_stack([legs[:, 0], turn]), random)
    first = found.answer.findings[0]
    assert (first.effect, first.certainty) == ("turn_asymmetry", "sure")
    assert first.numbers["asymmetry"][0] == pytest.approx(asymmetry, abs=0.02)


def test_the_next_run_of_a_robot_told_velocities_shows_what_its_log_could_not(
    tmp_path, monkeypatch, capsys
):
    """It turned to the left alone: that it turns less to the right nothing can tell."""
    random, asymmetry = np.random.default_rng(8), 0.12
    legs = drive_legs(2500, random, (-0.2, 0.15, 0.25), (0.6, 1.0))
    driven = legs * (1, 1 + asymmetry)
    found = diagnosed_cart(tmp_path, legs, driven, random)
    assert not [f for f in found.answer.findings if f.certainty == "sure"]
    limits = Limits(30, (2.0, 2.0), 0.8)
    model = model_file(tmp_path, CART)
    check([o.measurement for o in found.opened], model, limits)
    plan = design(found, model, limits, print)
    told = plan.rows.command
    assert np.all(np.abs(told).max(axis=0) <= (0.2, 0, 0.8, 0))  # of the log's, and never sideways
    assert np.all(plan.extent_m <= 2.0)
    monkeypatch.setattr(next_run, "plan_run", lambda *_, own: plan)
    script, log = tmp_path / "script.csv", str(tmp_path / "run.lcmlog")
    words = ["next", log, "--model", str(tmp_path / "model.toml"), "-o", str(script)]
    cli.run([*words, "--script-as", "publisher"])
    said = "".join(capsys.readouterr().out.split())
    assert "Ontherobot:python3" in said and "script_publisher.py" in said
    assert "END_S = " in (tmp_path / "script_publisher.py").read_text()
    assert script.read_text().startswith("t_s,vx_mps,vy_mps,omega_radps\n")
    with pytest.raises(ValueError, match="leave --for out"):
        cli.run([*words, "--for", "milling", "--force"])


def test_a_top_speed_of_the_controller_is_no_slip(tmp_path):
    """Commands above 0.3 m/s are cut to it, in any direction; it turns apart from driving fast.

    So a limit of its wheels' speed says the same of this drive.
    """
    random = np.random.default_rng(5)
    limit_mps = 0.3
    levels_mps = (-0.5, -0.4, -0.2, -0.1, 0.1, 0.15, 0.25, 0.35, 0.45, 0.5)
    legs = drive_legs(3000, random, levels_mps, (-1.0, 1.0))
    driven = np.clip(legs, (-limit_mps, -np.inf), (limit_mps, np.inf))
    found = diagnosed_cart(tmp_path, legs, driven, random)
    first = found.answer.findings[0]
    assert {first.effect, *first.group} == {"speed_limit", "wheel_limit"}
    ((pace, _),) = found.table.numbers["speed_limit",].of_effects().values()
    assert 1 / pace == pytest.approx(limit_mps, abs=0.005)


def test_a_heading_that_a_robot_holds_and_nobody_recorded_is_found(tmp_path):
    """Three robots at 30, -150 and 5 degrees, 0.8 of what they are told, a lag of 0.2 s."""
    random = np.random.default_rng(11)
    held_rad = np.radians((30, -150, 5))
    logs = [strafing_log(tmp_path, k, angle, random) for k, angle in enumerate(held_rad, 1)]
    found = diagnose(load_measurements(logs), model_file(tmp_path, OMNI))
    headings_rad = [o.model.get("frame.heading_rad") for o in found.opened]
    off_rad = np.angle(np.exp(1j * (np.array(headings_rad) - held_rad)))
    assert off_rad == pytest.approx(0, abs=0.02)
    assert found.late.sum_s == pytest.approx(0.2, abs=0.01)
    assert found.model.get("base.forward_gain") == pytest.approx(0.8, abs=0.01)
    assert found.after.score == pytest.approx(1, abs=0.1)
    assert "heading_bias" in found.not_shown


def strafing_log(folder, number, held_rad, random, period_s=0.05):
    """A robot that drives along any direction and never turns; its poses are positions alone."""
    told = np.repeat(random.uniform(-0.3, 0.3, (50, 2)), 20, axis=0)
    parts = 20  # of a period
    step = 1 - np.exp(-period_s / parts / 0.2)
    driven = lfilter([step], [1, step - 1], 0.8 * np.repeat(told, parts, axis=0), axis=0)
    c, s = np.cos(held_rad), np.sin(held_rad)
    xy = (np.cumsum(driven @ [[c, s], [-s, c]], axis=0) * period_s / parts)[parts - 1 :: parts]
    t_s = period_s * np.arange(len(told))
    pose = np.column_stack([t_s + period_s, xy + 5e-4 * random.normal(size=xy.shape)])
    command = np.column_stack([t_s, told, 0 * t_s])
    poses, commands = folder / f"p{number}.csv", folder / f"c{number}.csv"
    write_csv(poses, "t_s,x_m,y_m", pose)
    write_csv(commands, "t_s,vx_mps,vy_mps,omega_radps", command)
    log = folder / f"run{number}.lcmlog"
    import_log(poses, commands, log, options=ImportOptions(robot_id=number, same_clock=True))
    return log


def strays(random, lost_s=LOST_S):
    """Turns that nobody told, rad/s: first order, 0.06 rad/s."""
    kicks = 0.06 * np.sqrt(2 * CART_S / lost_s) * random.normal(size=6000)
    return lfilter([1], [1, CART_S / lost_s - 1], kicks)


def drive(stray_radps, sees):
    """(K, 2) told and driven, by a controller that sees how it strays or not; 4 s a course."""
    random, heading, told = np.random.default_rng(8), 0.0, []
    course = np.repeat(random.uniform(-1.5, 1.5, len(stray_radps) // 200), 200)
    for wanted, stray in zip(course, stray_radps, strict=True):
        turn = float(np.clip(GAIN_PER_S * (wanted - heading), -1.0, 1.0))
        heading += CART_S * (turn + stray * sees)
        told.append((0.2, turn))
    told = np.array(told)
    return told, told + np.column_stack([0 * stray_radps, stray_radps])


@pytest.mark.parametrize(("seed", "lost_s"), [(53, LOST_S), (41, 2.0), (53, 2.0)])
def test_a_heading_that_wanders_is_noise(seed, lost_s, tmp_path):
    """The model is right, and what turns the cart is chance: of place or time it is independent.

    One run does not tell what wanders for 2 s from what depends on time: half of the floor's draws
    may have no such noise.
    """
    told, driven = drive(strays(np.random.default_rng(seed), lost_s), sees=False)
    log = cart_log(tmp_path, "run", told, driven, np.random.default_rng(seed + 9), CART_S)
    found = diagnose(load_measurements([log]), model_file(tmp_path, CART))
    assert found.before.score == pytest.approx(1, abs=0.25)
    assert found.answer.nothing > 0.05


def diagnosed_cart(folder, told, driven, random, period_s=0.02):
    """Diagnosis of a cart told (K, 2) speeds and rates of turn, which drives others."""
    log = cart_log(folder, "run", told, driven, random, period_s)
    return diagnose(load_measurements([log]), model_file(folder, CART))


def cart_log(folder, name, told, driven, random, period_s=0.02):
    """Its log, by way of import."""
    heading = np.cumsum(driven[:, 1]) * period_s
    middle = heading - driven[:, 1] * period_s / 2
    x, y = (np.cumsum(driven[:, 0] * f(middle)) * period_s for f in (np.cos, np.sin))
    pose = np.column_stack([x, y, heading]) + random.normal(size=(len(x), 3)) * (3e-4, 3e-4, 2e-3)
    t_s = period_s * np.arange(len(x))
    write_csv(folder / "c.csv", "t_s,vx_mps,vy_mps,omega_radps",
              np.column_stack([t_s, told[:, 0], 0 * t_s, told[:, 1]]))  # fmt: skip
    write_csv(folder / "p.csv", "t_s,x_m,y_m,theta_rad", np.column_stack([t_s + period_s, pose]))
    log = folder / f"{name}.lcmlog"
    import_log(folder / "p.csv", folder / "c.csv", log, options=ImportOptions(robot_id=2))
    return log


def write_csv(path, header, rows):
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header=header, comments="")
