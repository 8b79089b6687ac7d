# SPDX-License-Identifier: Apache-2.0
"""Models in other simulators' files: MuJoCo itself runs them, their own tools check them."""

import ctypes
import ctypes.util
import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
import twinmill_native as native
import yaml
from mujoco import rollout

import twinmill as tm
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.measurement import load_measurements
from twinmill.export.carried import open_robot
from twinmill.export.mjcf import mjcf
from twinmill.model.model_file import ModelFile
from twinmill.predict.windows import Windows
from twinmill_cli.main import run

DOCS = Path(__file__).resolve().parents[2] / "docs"
(DRIVEN_BY_DUTY,) = re.findall(
    r"```python\n(.*?)```", (DOCS / "two-hours.md").read_text(), re.DOTALL
)
CARRIED_BY_THREE = """
[[effect]]
name = "mass_offset"
x_m = 0.004
y_m = -0.003
[[effect]]
name = "dead_zone"
width = 0.1
[[effect]]
name = "motor_lag"
extra_s = 0.03
[[effect]]
name = "wheel_gain"
w1 = 0.05
w3 = -0.04
"""
CARRIED = """
[[effect]]
name = "dead_zone"
width = 0.1
[[effect]]
name = "speed_curve"
bend = 0.3
skew = 0.1
[[effect]]
name = "reverse_asymmetry"
left = 0.1
right = -0.05
[[effect]]
name = "motor_lag"
extra_s = 0.03
[[effect]]
name = "input_delay"
delay_s = 0.03
[[effect]]
name = "wheel_gain"
fl = 0.05
rr = -0.04
[[effect]]
name = "mass_offset"
x_m = 0.004
y_m = -0.003
"""
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
KINDS = ("mjcf", "sdf", "urdf", "ros2_control", "json")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty one to be in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def open_text(folder, text):
    """A model file of that text, as exporters see it."""
    path = folder / "m.toml"
    path.write_text(text)
    return open_robot(ModelFile.load(str(path)), None, None)


def in_mujoco(xml, commands, command_t_s, end_s):
    """(K,) times and (K, 3) poses of the file alone: (M, 4) commands held, duties in percent.

    Duties go the way that the page shows.
    """
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)

    def step(row):
        data.ctrl[: len(row)] = row
        mujoco.mj_step(model, data)

    if "duty_pct" in [model.numeric(i).name for i in range(model.nnumeric)]:
        Path("better.xml").write_text(xml)
        exec(DRIVEN_BY_DUTY, names := {})
        model, data, step = (names[name] for name in ("model", "data", "step"))
    t_s = np.arange(command_t_s[0], end_s, model.opt.timestep)
    poses = np.empty((len(t_s), 3))
    for k, r in enumerate(np.searchsorted(command_t_s, t_s + 1e-9, "right") - 1):
        poses[k] = data.qpos
        step(commands[r])
    return t_s, poses


def predicted(model, commands, command_t_s, end_s):
    """(3,) pose of the planar plant at the end, from (0, 0, 0)."""
    wide = np.zeros((len(commands), 4))
    wide[:, : commands.shape[1]] = commands / (100 if model.drive == "duty" else 1)
    pose_t_s = np.array([0.0, end_s])
    unknown_V = np.full(len(commands), np.nan)
    still, whole = np.zeros((2, 3)), np.zeros(2, np.int64)
    track = native.Track(command_t_s, wide, unknown_V, pose_t_s, still, whole)
    return native.windows(model, track, np.array([0]), np.array([[1]]))[0, 0]


@pytest.mark.parametrize(
    ("change", "highest", "columns"),
    [
        ({}, 100, 4),
        ({"drive": "twist"}, (0.3, 0.2, 1.5), 3),
        ({"drive": "wheel_speed", "wheels": "omni3"}, 8, 3),
        ({"wheels": "omni3"}, 100, 3),
        ({"drive": "twist", "wheels": "differential"}, (0.3, 0, 1.5), 3),
        ({"drive": "wheel_speed", "wheels": "differential"}, 8, 4),
    ],
)
def test_stock_mujoco_drives_the_path_of_the_planar_plant(
    change, highest, columns, model_text, folder
):
    """Five seconds of random commands. 2 mm and 5 mrad: the body settles a millisecond late."""
    text = model_text("m", forward_gain=0.97, sideways_gain=0.88, yaw_gain=0.9)
    for key, old in (("drive", "duty"), ("wheels", "mecanum")):
        text = text.replace(f'{key} = "{old}"', f'{key} = "{change.get(key, old)}"')
    if "drive" in change:
        text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
        text += '[[effect]]\nname = "input_delay"\ndelay_s = 0.02\n'
        left, right = ("w1", "w3") if change.get("wheels") == "omni3" else ("fl", "rr")
        text += f'[[effect]]\nname = "wheel_gain"\n{left} = -0.12\n{right} = 0.05\n'
        text += '[[effect]]\nname = "mass_offset"\nx_m = 0.004\ny_m = -0.003\n'
    else:
        text += CARRIED if not change else CARRIED_BY_THREE
    robot = open_text(folder, text)
    random = np.random.default_rng(3)
    commands = random.uniform(-1, 1, (10, columns)) * highest
    commands = commands if "drive" in change else np.rint(commands)
    command_t_s = np.arange(10) * 0.5
    t_s, poses = in_mujoco(mjcf(robot)[0], commands, command_t_s, 5.0005)
    assert t_s[-1] == pytest.approx(5)
    miss = np.abs(poses[-1] - predicted(robot.model, commands, command_t_s, 5.0))
    assert np.all(miss < (0.002, 0.002, 0.005)), miss
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() > 0.2  # it did move


STRAIGHT = {"mecanum": (1, 1, 1, 1), "differential": (1, 1, 1, 1), "omni3": (-1, 0, 1)}


@pytest.mark.parametrize("wheels", STRAIGHT)
@pytest.mark.parametrize("lag_s", [0.05, 0.1])
def test_in_stock_mujoco_a_robot_has_63_percent_of_its_speed_after_the_lag(
    wheels, lag_s, folder, model_text
):
    """A first-order lag by algebra, 1 - 1/e; a millisecond of the body's settling is allowed."""
    text = model_text("m", motor_lag_s=lag_s).replace('"mecanum"', f'"{wheels}"')
    model = mujoco.MjModel.from_xml_string(mjcf(open_text(folder, text))[0])
    data = mujoco.MjData(model)
    data.ctrl[: len(STRAIGHT[wheels])] = 0.3 * np.array(STRAIGHT[wheels])
    mujoco.mj_step(model, data, round(lag_s / model.opt.timestep))
    after_lag_mps = data.qvel[0]
    mujoco.mj_step(model, data, 3000)
    assert data.qvel[0] > 0.2  # it does drive straight on
    slack = 1.5 * 0.001 / lag_s / np.e  # slope of the curve there
    assert after_lag_mps / data.qvel[0] == pytest.approx(1 - 1 / np.e, abs=slack)


def delayed(folder, model_text, delay_s=0.03, lag=True):
    """An MJCF file of a robot with a delay, and without a lag if wanted."""
    text = model_text("m", **({} if lag else {"motor_lag_s": 0}))
    robot = open_text(folder, text + f'[[effect]]\nname = "input_delay"\ndelay_s = {delay_s}\n')
    return mjcf(robot)[0]


def first_moves(model, data, steps=200):
    """The step, counted from 0, after which a robot at rest first moves."""
    for step in range(steps):
        mujoco.mj_step(model, data)
        if abs(data.qvel[0]) > 1e-6:
            return step
    return None


@pytest.mark.parametrize("delay_s", [0.03, 0.0304, 0.3])
@pytest.mark.parametrize("step_s", [0.002, 0.0005, 0.0001])
def test_a_delay_in_stock_mujoco_is_as_long_at_any_step(step_s, delay_s, folder, model_text):
    """Told to drive at rest, it moves after the delay, and as late an hour later."""
    text = delayed(folder, model_text, delay_s)
    model = mujoco.MjModel.from_xml_string(text.replace("0.001", f"{step_s}", 1))
    assert model.opt.timestep == step_s
    data = mujoco.MjData(model)
    for begins_s in (0, *np.cumsum([step_s] * 2500)[::499], 3600):
        mujoco.mj_resetData(model, data)
        data.time, data.ctrl[:] = begins_s, 0.3
        assert first_moves(model, data, 4000) == np.ceil(delay_s / step_s - 1e-6)


def test_what_the_file_says_of_its_delay_holds_in_mujoco(folder, model_text):
    text = delayed(folder, model_text, lag=False)
    assert "mj_initCtrlHistory" in text and "MJX with JAX" in text
    key = '<keyframe><key name="go" ctrl="0.3 0.3 0.3 0.3"/></keyframe></mujoco>'
    model = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", key))
    data, delayed_steps = mujoco.MjData(model), 30
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert first_moves(model, data) == delayed_steps  # for all that ctrl is 0.3 before the first

    mujoco.mj_resetDataKeyframe(model, data, 0)
    for k in range(model.nu):
        told = np.full(model.actuator_history[k, 0], data.ctrl[k])
        mujoco.mj_initCtrlHistory(model, data, k, None, told)
    assert first_moves(model, data) == 0

    mujoco.mj_resetData(model, data)
    data.time, data.ctrl[:] = -1, 0.3
    assert first_moves(model, data) == 1  # no delay: the command of the step before

    data.ctrl[:], zero = 0.3, np.zeros(mujoco.mj_stateSize(model, STATE))
    after_reset = np.copy(zero)
    mujoco.mj_resetData(model, data)
    mujoco.mj_getState(model, data, after_reset, STATE)
    ahead = np.full((1, 40, model.nu), 0.3)
    for begun, moves in ((zero, 1), (after_reset, delayed_steps)):
        states, _ = rollout.rollout(model, data, begun[None], ahead)
        assert np.argmax(np.abs(states[0, :, 1 + model.nq]) > 1e-6) == moves


def speed_in(path, rim_mps):
    """Speed of a robot in MuJoCo after 0.1 s, all rims told one speed."""
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    data.ctrl[:] = rim_mps
    mujoco.mj_step(model, data, 100)
    return data.qvel[0]


def test_what_the_page_on_other_simulators_shows_runs(folder, model_text):
    text = model_text("m", motor_lag_s=0) + '[[effect]]\nname = "input_delay"\ndelay_s = 0.03\n'
    text += "[base.std]\nforward_gain = 0.04\n[idiosyncrasy]\ntheta_a1_std = 0.03\n"
    (folder / "better.toml").write_text(text)
    run(["export-model", "better.toml", "--to", "mjcf", "--ranges", "--samples", "60"])
    run(["export-model", "better.toml", "--to", "urdf"])
    page = (DOCS / "simulators.md").read_text()
    exec("".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)), names := {})
    model, data, swarm = (names[name] for name in ("model", "data", "swarm"))
    names["begin"]([0.3] * 4)
    assert first_moves(model, data) == 0
    mujoco.mj_setState(model, data, names["state"], names["full"])
    data.ctrl[:] = 0.3
    assert first_moves(model, data) == 30

    many = mujoco.MjData(swarm)
    many.ctrl[4:8] = 0.3  # the second of three
    mujoco.mj_step(swarm, many, 530)
    assert many.qpos[3] == pytest.approx(0.15, abs=0.001)  # half a second ahead
    np.testing.assert_allclose(np.delete(many.qpos, 3), 0, atol=1e-6)

    free = names["free"]
    assert free.body_mass.sum() == pytest.approx(1.2)
    driven = mujoco.MjData(free)
    driven.qpos[2] = 0  # base_footprint on the floor
    driven.ctrl[:] = 0.2 / 0.0325  # rim speed over wheel radius
    mujoco.mj_step(free, driven, round(2 / free.opt.timestep))
    assert driven.qpos[0] == pytest.approx(0.4, rel=0.05)  # it slips a little while it starts

    told = dict(zip(names["ranges"]["names"], names["ranges"]["samples"].T, strict=True))
    speeds = [speed_in(f"better_{k:03}.xml", 0.3) for k in range(60)]
    gains = told["base.forward_gain"] * told["theta_a1"]
    np.testing.assert_allclose(speeds, 0.3 * gains, rtol=1e-4)


@pytest.mark.parametrize(
    ("signs", "axis", "gain", "delay_s"),
    [((1, 1, 1, 1), 0, 1.0, 0), ((-1, 1, 1, -1), 1, 0.89, 0), ((1, 1, 1, 1), 0, 1.0, 0.05)],
)
def test_the_ways_that_the_page_tells_to_check_with(signs, axis, gain, delay_s, folder):
    """A first-order lag's way by algebra, speed times (time less lag and delay)."""
    text = tm.Model.load("turbopi.toml").file.text
    text += f'[[effect]]\nname = "input_delay"\ndelay_s = {delay_s}\n' if delay_s else ""
    model = mujoco.MjModel.from_xml_string(mjcf(open_text(folder, text))[0])
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.366 * np.array(signs)
    mujoco.mj_step(model, data, 2000)
    by_hand_m = 0.366 * gain * (2 - 0.06 - delay_s)
    assert data.qpos[axis] == pytest.approx(by_hand_m, abs=0.001)
    assert f"{data.qpos[axis]:.3f} m" in (DOCS / "simulators.md").read_text()


def two_wheeled(model_text):
    """A model on two wheels of one axle."""
    text = model_text("m").replace("half_wheelbase_m = 0.059", "half_wheelbase_m = 0")
    return text.replace('"mecanum"', '"differential"')


@pytest.mark.parametrize("told", [(0.2, 0.0), (-0.2, 0.0), (0.15, 1.0), (0.0, 2.0)])
def test_a_robot_on_two_wheels_stays_level_and_drives_as_told(told, folder, model_text):
    """MuJoCo reads the URDF as the page shows; rims by the kinematics of a unicycle."""
    open_text(folder, two_wheeled(model_text))
    run(["export-model", "m.toml", "--to", "urdf", "--out", "better.urdf"])
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "simulators.md").read_text(), re.DOTALL)
    (block,) = [b for b in blocks if "better.urdf" in b]
    exec(block, names := {"mujoco": mujoco})
    data = mujoco.MjData(model := names["free"])
    v_mps, w_radps = told
    rims_mps = v_mps + w_radps * 0.067 * np.array([-1, 1])
    data.ctrl[:] = rims_mps / 0.0325
    mujoco.mj_step(model, data, 250)
    tilts_deg = []
    for _ in range(500):
        mujoco.mj_step(model, data)
        tilts_deg.append(np.degrees(np.arccos(min(1.0, data.body("base_footprint").xmat[8]))))
    assert max(tilts_deg) < 0.5
    assert data.qvel[5] == pytest.approx(w_radps, abs=0.03)
    assert np.hypot(*data.qvel[:2]) == pytest.approx(abs(v_mps), abs=0.005)


def test_in_gazebo_the_supports_slide(folder, model_text):
    open_text(folder, two_wheeled(model_text))
    run(["export-model", "m.toml", "--to", "sdf"])
    collisions = ET.parse("m.sdf").findall("model/link[@name='base_link']/collision")
    balls = [c for c in collisions if c.find("geometry/sphere") is not None]
    assert [c.findtext("pose").split()[0][0] == "-" for c in balls] == [False, True]
    for ball in balls:
        assert [ball.findtext(f"surface/friction/ode/{mu}") for mu in ("mu", "mu2")] == ["0", "0"]


BY_HAND = """
[[effect]]
name = "lag_by_duty"
extra_s = 0.15
"""
COASTING = '[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.68\n'
AHEAD_S = (0.1, 0.2, 0.5, 1.0, 2.0)


@pytest.fixture(scope="module")
def drives(data_dir, tmp_path_factory):
    """A real TurboPi's straight drives under OptiTrack: a track, and windows of 0.1 to 2 s."""
    source = data_dir / "turbopi_optitrack_straight"
    if not source.is_dir():
        pytest.skip(f"no recordings at {source}")
    log = tmp_path_factory.mktemp("real") / "run.lcmlog"
    options = ImportOptions(heading_offset_rad=np.pi)
    import_log(source / "poses.csv", source / "commands.csv", log, options=options)
    (measurement,) = load_measurements([log])
    windows = Windows.of(measurement.track)
    whole = np.all(windows.ends >= 0, axis=1)
    return measurement, windows.starts[whole], windows.ends[whole]


def misses_m(robot, measurement, starts, ends):
    """(H,) RMS misses in place ahead of our plant, and of MuJoCo with the exported file."""
    track, clock_s = measurement.track, robot.get("clock.offset_s")
    ours = native.windows(robot.model, measurement.started, starts, ends)
    t_s = track.pose_t_s - clock_s
    at_s, poses = in_mujoco(mjcf(robot)[0], 100 * track.command, track.command_t_s, t_s[-1] + 0.1)
    path = np.column_stack([np.interp(t_s, at_s, column) for column in poses.T])
    turned = track.heading_smooth[starts] - path[starts, 2]
    c, s = np.cos(turned)[:, None], np.sin(turned)[:, None]
    x, y = np.moveaxis(path[ends, :2] - path[starts, None, :2], -1, 0)
    theirs = track.pose[starts, None, :2] + np.stack([c * x - s * y, s * x + c * y], -1)
    return [
        np.sqrt(np.mean(np.sum((p[..., :2] - track.pose[ends, :2]) ** 2, -1), 0))
        for p in (ours, theirs)
    ]


@pytest.mark.parametrize("more", ["", COASTING])
def test_stock_mujoco_predicts_real_drives_as_well_as_the_twin(more, drives, folder, model_text):
    """Miss in place at each horizon, with numbers that were measured by hand: within 1.1 times."""
    text = model_text(
        "m",
        duty_pct=[0, 50, 60, 70, 80, 90, 100],
        wheel_speed_mps=[0, 0.282, 0.309, 0.329, 0.340, 0.348, 0.365],
        motor_lag_s=0.04,
    )
    robot = open_text(folder, text + BY_HAND + more + "[clock]\noffset_s = 0.05\n")
    ours, theirs = misses_m(robot, *drives)
    assert np.all(theirs < 1.1 * ours), dict(zip(AHEAD_S, theirs / ours, strict=True))
    assert ours[2] < 0.01  # half a second ahead: the model is no straw man


def test_a_model_fitted_to_some_real_drives_predicts_others_in_stock_mujoco(data_dir, folder):
    """Duties of 100, 80 and 60 % tell a TurboPi's model; those of 90, 70 and 50 % judge it.

    To hold the offset of its mass is needed, since it runs to the left when driven straight.
    """
    source = data_dir / "turbopi_optitrack_straight"
    if not source.is_dir():
        pytest.skip(f"no recordings at {source}")
    poses, commands = (pd.read_csv(source / f"{name}.csv") for name in ("poses", "commands"))
    for name, duties in (("told", (100, 80, 60)), ("held_out", (90, 70, 50))):
        begins_s = commands.t_s[commands.fl_pct.abs().isin(duties)]
        for table, kind in ((poses, "poses"), (commands, "commands")):
            own = [table[(table.t_s >= t - 0.1) & (table.t_s < t + 8.5)] for t in begins_s]
            pd.concat(own).to_csv(f"{name}_{kind}.csv", index=False)
        files = (folder / f"{name}_{kind}.csv" for kind in ("poses", "commands"))
        options = ImportOptions(heading_offset_rad=np.pi)
        import_log(*files, folder / f"{name}.lcmlog", options=options)
    text = tm.Model.load("turbopi.toml").file.text
    for effect in ("coasting", "lag_by_duty", "mass_offset"):
        text += f'[[effect]]\nname = "{effect}"\n'
    (folder / "begun.toml").write_text(text)
    tm.fit("told.lcmlog", "begun.toml").model.save("found.toml")
    (measurement,) = load_measurements([folder / "held_out.lcmlog"])
    windows = Windows.of(measurement.track)
    whole = np.all(windows.ends >= 0, axis=1)
    robot = open_robot(ModelFile.load("found.toml"), None, None)
    offset_s = tm.compare("held_out.lcmlog", "found.toml").to_json()["time_offset_s"]
    robot.model.set("clock.offset_s", offset_s)
    ours, theirs = misses_m(robot, measurement, windows.starts[whole], windows.ends[whole])
    assert np.all(theirs < 1.1 * ours), dict(zip(AHEAD_S, theirs / ours, strict=True))


def test_what_a_file_does_not_carry_is_named_with_its_share(folder, model_text):
    text = model_text("m") + (
        '[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.7\nerror_before = 4.0\n'
        'error_after = 2.0\n[[effect]]\nname = "floor_tilt"\ndrift_x_mps = 0.01\n'
    )
    open_text(folder, text)
    findings = [{"effect": "floor_tilt", "share": 0.31}]
    (folder / "d.json").write_text(json.dumps({"findings": findings}))
    data = run(["export-model", "m.toml", "--to", "mjcf", "--diagnosis", "d.json", "--json"])
    shares = {item["name"]: item["share"] for item in data["not_carried"]}
    assert shares["coasting"] == pytest.approx(0.75)  # a score halved
    assert shares["floor_tilt"] == 0.31
    written = (folder / "m.xml").read_text()
    assert "coasting (75 % of the squared error)" in written
    assert "floor_tilt (31 % of the squared error)" in written


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_model_gives_the_same_bytes_and_nothing_is_replaced_unasked(kind, folder):
    run(["export-model", "turbopi.toml", "--to", kind, "--out", "a"])
    first = (folder / "a").read_bytes()
    with pytest.raises(ValueError, match="exists"):
        run(["export-model", "turbopi.toml", "--to", kind, "--out", "a"])
    run(["export-model", "turbopi.toml", "--to", kind, "--out", "a", "--force"])
    assert (folder / "a").read_bytes() == first


@pytest.mark.parametrize("wheels", ["mecanum", "differential", "omni3"])
def test_urdf_passes_its_own_checker_and_weighs_what_the_robot_does(wheels, folder, model_text):
    if not shutil.which("check_urdf"):
        pytest.skip("check_urdf is not installed (Debian: liburdfdom-tools)")
    drive = "duty" if wheels == "mecanum" else "twist"
    text = model_text("m").replace('"mecanum"', f'"{wheels}"').replace('"duty"', f'"{drive}"')
    if drive == "twist":
        text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
    open_text(folder, text)
    run(["export-model", "m.toml", "--to", "urdf"])
    done = subprocess.run(["check_urdf", "m.urdf"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "Successfully Parsed" in done.stdout, done.stderr
    assert not done.stderr  # it passes a file with a mass that is no number, but says so here
    masses = [float(m.get("value")) for m in ET.parse("m.urdf").iter("mass")]
    assert sum(masses) == pytest.approx(1.2)


@pytest.mark.parametrize("wheels", ["mecanum", "differential", "two"])
def test_sdf_passes_its_own_library(wheels, folder, model_text):
    library = ctypes.util.find_library("sdformat12")
    if not library:
        pytest.skip("libsdformat12 is not installed (Debian: libsdformat12-12)")
    four = model_text("m").replace('"mecanum"', f'"{wheels}"')
    open_text(folder, two_wheeled(model_text) if wheels == "two" else four)
    run(["export-model", "m.toml", "--to", "sdf"])
    check = ctypes.CDLL(library).cmdCheck  # what `sdf --check` calls; prints what is wrong
    assert check(b"m.sdf") == 0
    (folder / "broken.sdf").write_text((folder / "m.sdf").read_text().replace(">base_link<", ">?<"))
    assert check(b"broken.sdf") != 0


@pytest.mark.parametrize(("wheels", "rolling"), [("mecanum", 4), ("omni3", 3), ("differential", 4)])
def test_sdformat_holds_the_frame_of_friction_by_the_letters_that_each_gazebo_asks_for(
    wheels, rolling, folder, model_text, capfd
):
    """Gazebo's physics compares `ignition:` in Fortress, `gz:` since Garden, as letters.

    What the library prints is what it holds. For XML the two are one name if they stand for one
    address, and no other parser would then open the file.
    """
    library = ctypes.util.find_library("sdformat12")
    if not library:
        pytest.skip("libsdformat12 is not installed (Debian: libsdformat12-12)")
    open_text(folder, model_text("m").replace('"mecanum"', f'"{wheels}"'))
    run(["export-model", "m.toml", "--to", "sdf"])
    capfd.readouterr()
    ctypes.CDLL(library).cmdPrint(b"m.sdf", 0, 0, 0, 17, 0)
    ctypes.CDLL(None).fflush(None)
    printed = capfd.readouterr().out
    ET.fromstring(printed)
    frames = re.findall(r"<fdir1 (\S+)='base_link' (\S+)='base_link'>", printed)
    assert frames == [("ignition:expressed_in", "gz:expressed_in")] * rolling


@pytest.mark.parametrize("to", ["urdf", "sdf", "ros2_control"])
def test_a_gain_of_one_to_three_digits_is_none(to, folder, model_text):
    """The sentence that would tell it has as many."""
    gains = {"forward_gain": 1.0004, "sideways_gain": 1.0001, "yaw_gain": 0.7}
    open_text(folder, model_text("m", **gains))
    left = run(["export-model", "m.toml", "--to", to, "--json"])["not_carried"]
    assert not [item for item in left if " 1 times" in item["why"]]


@pytest.mark.parametrize("wheels", ["mecanum", "differential"])
def test_gazebo_whose_physics_has_no_gains_drives_as_told(wheels, folder, model_text):
    """The inverse kinematics of Gazebo's own drives, by hand, on the wheels of the same file."""
    gains = {"forward_gain": 0.8, "sideways_gain": 0.72, "yaw_gain": 0.7}
    text = model_text("m", **gains).replace('"mecanum"', f'"{wheels}"')
    file = open_text(folder, text)
    (gain,) = [
        item["why"]
        for item in run(["export-model", "m.toml", "--to", "sdf", "--json"])["not_carried"]
        if "gain" in item["name"]
    ]
    assert "the real one moves 0.8 times as far ahead" in gain and "0.7 times as far in t" in gain
    assert ("0.72 times as far sideways" in gain) == (wheels == "mecanum")
    plugin = ET.parse("m.sdf").find("model/plugin")
    told = {key: float(plugin.find(key).text) for key in ("wheel_separation", "wheel_radius")}
    lever_m = told["wheel_separation"] / 2
    vx, vy, omega = 0.2, 0.0, 1.5
    if wheels == "mecanum":
        vy, lever_m = 0.1, lever_m + float(plugin.find("wheelbase").text) / 2
    places = [(wheel["x_m"], np.sign(wheel["y_m"])) for wheel in file.model.wheels()]
    rims_mps = [vx - np.sign(x) * left * vy - left * lever_m * omega for x, left in places]
    ideal = file.model.body_velocity([v / told["wheel_radius"] for v in rims_mps])
    np.testing.assert_allclose(ideal, (vx, vy, omega), rtol=1e-6, atol=1e-9)


def test_a_controller_told_the_exported_numbers_drives_as_fast_as_it_is_asked(folder, model_text):
    """The inverse kinematics of ros2_control's mecanum controller, by hand: both gains undone."""
    file = open_text(folder, model_text("m", forward_gain=0.9, sideways_gain=0.9, yaw_gain=0.8))
    run(["export-model", "m.toml", "--to", "ros2_control"])
    data = yaml.safe_load((folder / "m_control.yaml").read_text())
    told = data["mecanum_drive_controller"]["ros__parameters"]["kinematics"]
    lever_m, radius_m = told["sum_of_robot_center_projection_on_X_Y_axis"], told["wheels_radius"]
    vx, vy, omega = 0.2, 0.1, 1.5
    sides, turns = np.array([-1, 1, 1, -1]), np.array([-1, 1, -1, 1])
    wheels = (vx + sides * vy + turns * lever_m * omega) / radius_m
    ideal = file.model.body_velocity(list(wheels))
    np.testing.assert_allclose(np.multiply(ideal, (0.9, 0.9, 0.8)), (vx, vy, omega), rtol=1e-4)


def test_an_export_hides_no_file_that_comes_with_the_twin(folder):
    """twin_run looks for its robot in the working directory first, by names of these files."""
    installed = {path.name for path in (DOCS.parent / "twin" / "models").rglob("*")}
    assert {"turbopi.xml", "turbopi.toml"} <= installed
    for to in KINDS:
        (written,) = run(["export-model", "turbopi.toml", "--to", to, "--json"])["files"]
        assert written not in installed and (folder / written).exists()


def root_link(path):
    """Name of the one link that is no joint's child."""
    robot = ET.parse(path).getroot()
    children = {joint.find("child").get("link") for joint in robot.iter("joint")}
    (root,) = {link.get("name") for link in robot.iter("link")} - children
    return root


@pytest.mark.parametrize("wheels", ["mecanum", "differential"])
def test_odometry_moves_the_root_of_the_urdf_so_no_frame_has_two_parents(
    wheels, folder, model_text
):
    """Controllers publish the transform from odom to base_frame_id, in tf a tree."""
    open_text(folder, model_text("m").replace("mecanum", wheels))
    for to in ("urdf", "ros2_control"):
        run(["export-model", "m.toml", "--to", to])
    _, controller = yaml.safe_load((folder / "m_control.yaml").read_text()).values()
    assert controller["ros__parameters"]["base_frame_id"] == root_link(folder / "m.urdf")


def test_a_differential_controller_knows_that_the_left_wheel_is_weak(folder, model_text):
    """The inverse kinematics of ros2_control's diff_drive_controller, by hand."""
    text = model_text("m").replace("mecanum", "differential")
    text += '[[effect]]\nname = "wheel_gain"\nfl = -0.2\nrl = -0.1\nfr = 0.03\nrr = 0.03\n'
    file = open_text(folder, text)
    left_out = run(["export-model", "m.toml", "--to", "ros2_control", "--json"])["not_carried"]
    assert "wheel_gain" not in [item["name"] for item in left_out]
    data = yaml.safe_load((folder / "m_control.yaml").read_text())
    told = data["diff_drive_controller"]["ros__parameters"]
    v_mps, w_radps = 0.2, 1.5
    rims = {}
    for side, sign, weak in (("left", -1, 0.85), ("right", 1, 1.03)):
        rim_mps = v_mps + sign * w_radps * told["wheel_separation"] / 2
        radius_m = told[f"{side}_wheel_radius_multiplier"] * told["wheel_radius"]
        rims[side] = weak * rim_mps / radius_m  # what the real wheel makes of it, rad/s
    wheels = [rims["left" if w["y_m"] > 0 else "right"] for w in file.model.wheels()]
    ideal = file.model.body_velocity(wheels)
    np.testing.assert_allclose(ideal, (v_mps, 0, w_radps), rtol=1e-4, atol=1e-9)


def test_json_has_every_number_with_unit_and_every_equation(folder, model_text):
    robot = open_text(folder, model_text("m") + CARRIED)
    run(["export-model", "m.toml", "--to", "json"])
    data = json.loads((folder / "m.json").read_text())
    for entry in robot.model.values():
        assert data["numbers"][entry["name"]]["value"] == entry["value"]
        assert data["numbers"][entry["name"]]["unit"] == entry["unit"]
    assert data["effects"][0]["equation"] == "u' = sign(u) max(0, |u| - width)"
    assert data["duty_pct"] == [0, 100]


def test_what_cannot_be_written_is_one_sentence(folder, model_text):
    text = model_text("m").replace('"mecanum"', '"ackermann"').replace('"duty"', '"twist"')
    open_text(folder, text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", ""))
    with pytest.raises(ValueError, match=r"a steered robot.*use --to urdf"):
        run(["export-model", "m.toml", "--to", "mjcf"])
    with pytest.raises(ValueError, match=r"--to: is missing"):
        run(["export-model", "m.toml"])
    (folder / "d.json").write_text("[]")
    with pytest.raises(ValueError, match=r"--diagnosis d.json: is not the JSON"):
        run(["export-model", "m.toml", "--to", "json", "--diagnosis", "d.json"])
    assert sorted(p.name for p in folder.iterdir()) == ["d.json", "m.toml"]
