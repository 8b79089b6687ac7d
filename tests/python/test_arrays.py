# SPDX-License-Identifier: Apache-2.0
"""Logs from numbers in memory: what went in comes out, and what makes no run is refused."""

import sys

import lcm
import numpy as np
import pandas as pd
import pytest
import turbopi

import twinmill as tm

RADIUS_M, OMEGA_RADPS = 0.5, 0.4
T_S = np.arange(0, 30, 0.02)
# By algebra: a robot that drives at v and omega is on a circle of radius v / omega.
POSE = np.column_stack(
    [
        RADIUS_M * np.sin(OMEGA_RADPS * T_S),
        RADIUS_M * (1 - np.cos(OMEGA_RADPS * T_S)),
        OMEGA_RADPS * T_S,
    ]
)
COMMANDS_T_S = np.arange(0, 30, 0.1)
COMMANDS = np.tile([RADIUS_M * OMEGA_RADPS, OMEGA_RADPS], (len(COMMANDS_T_S), 1))
POSES_FRAME = {"t_s": T_S, "x_m": POSE[:, 0], "y_m": POSE[:, 1], "theta_rad": POSE[:, 2]}
COMMANDS_FRAME = {
    "t_s": COMMANDS_T_S,
    "vx_mps": COMMANDS[:, 0],
    "vy_mps": np.zeros(len(COMMANDS)),
    "omega_radps": COMMANDS[:, 1],
}


def circle(**options) -> tm.Log:
    return tm.Log.from_arrays(T_S, POSE, COMMANDS_T_S, COMMANDS, **{"kind": "twist", **options})


def test_what_went_in_comes_out():
    log = circle(robot_id=7, name="circle", same_clock=True)
    table, commands = log.table(), log.commands()
    assert repr(log) == "Log(circle: robot 7, 30 s)"
    np.testing.assert_allclose(table[["x_m", "y_m", "theta_rad"]], POSE, atol=1e-12)
    np.testing.assert_allclose(table["t_s"], T_S, atol=1e-6)  # stamps are whole microseconds
    np.testing.assert_array_equal(commands[["vx_mps", "omega_radps"]], COMMANDS)
    (run,) = log.measurements()
    assert run.same_clock and not circle().measurements()[0].same_clock


def test_a_pose_has_the_command_that_was_in_force():
    frame = tm.Log.from_arrays(
        T_S, POSE, [1.0, 2.0], [[0.1, 0.0], [0.2, 0.0]], kind="twist"
    ).to_pandas()
    told = frame.set_index("t_s")["vx_mps"]
    assert told[0.98:0.99].isna().all() and told[1.0] == 0.1 == told[1.98] and told[2.0] == 0.2
    assert len(frame) == len(T_S)


def test_without_xarray_the_sentence_says_what_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ModuleNotFoundError, match=r"'xarray'.* not installed.*pip install xarray$"):
        circle().to_xarray()


def frames(kind: str):
    if kind == "dictionary":
        return POSES_FRAME, COMMANDS_FRAME
    package = pytest.importorskip(kind)
    make = package.Dataset.from_dataframe if kind == "xarray" else package.DataFrame
    if kind == "xarray":
        return make(pd.DataFrame(POSES_FRAME)), make(pd.DataFrame(COMMANDS_FRAME))
    return make(POSES_FRAME), make(COMMANDS_FRAME)


@pytest.mark.parametrize("kind", ["dictionary", "pandas", "polars", "xarray"])
def test_frames_of_any_kind_give_the_log_of_the_arrays(kind):
    log = tm.Log.from_frames(*frames(kind), name="arrays")
    assert log.to_pandas().equals(circle().to_pandas())


def test_frames_hold_several_robots_and_lost_poses():
    two = pd.concat([pd.DataFrame(POSES_FRAME).assign(robot_id=k) for k in (3, 5)])
    told = pd.concat([pd.DataFrame(COMMANDS_FRAME).assign(robot_id=k) for k in (3, 5)])
    two["valid"] = (two["robot_id"] == 3) | (two["t_s"] > 2)
    log = tm.Log.from_frames(two, told)
    assert log.robots == [3, 5]
    lost = log.table().query("not valid")
    assert set(lost["robot_id"]) == {5} and lost["x_m"].isna().all()
    assert len(lost) == np.count_nonzero(T_S <= 2)


def test_stamps_of_pandas_are_the_epochs():
    stamps = pd.to_datetime("2026-05-04T12:00:00") + pd.to_timedelta(T_S, unit="s")
    log = tm.Log.from_arrays(stamps, POSE, stamps, np.tile([0.2, 0.4], (len(T_S), 1)), kind="twist")
    assert log.measurements()[0].recorded_utime_us == 1_777_896_000_000_000  # date -d ... +%s
    assert log.duration_s == pytest.approx(T_S[-1])


def test_stamps_with_a_zone_are_the_epochs_and_an_index_of_stamps_is_said():
    """Noon in UTC is two o'clock in a summer of Berlin."""
    local = pd.to_datetime("2026-05-04T14:00:00").tz_localize("Europe/Berlin")
    stamps = local + pd.to_timedelta(T_S, unit="s")
    poses = pd.DataFrame(POSE, columns=["x_m", "y_m", "theta_rad"]).assign(t_s=stamps)
    told = pd.DataFrame({"t_s": stamps, "vx_mps": 0.2, "vy_mps": 0.0, "omega_radps": 0.4})
    log = tm.Log.from_frames(poses, told)
    assert log.measurements()[0].recorded_utime_us == 1_777_896_000_000_000
    indexed = poses.set_index("t_s")
    with pytest.raises(tm.LogError, match=r"no column t_s.*frame.reset_index\(names='t_s'\)"):
        tm.Log.from_frames(indexed, told)
    tm.Log.from_frames(indexed.reset_index(names="t_s"), told)


def test_durations_of_pandas_and_numpy_are_told_in_their_unit():
    def since(frame, unit):
        return dict(frame, t_s=pd.to_timedelta(frame["t_s"], "s").as_unit(unit))

    from_s = tm.Log.from_frames(POSES_FRAME, COMMANDS_FRAME)
    for unit in ("ns", "us", "ms"):
        log = tm.Log.from_frames(since(POSES_FRAME, unit), since(COMMANDS_FRAME, unit))
        assert log.duration_s == pytest.approx(from_s.duration_s, 1e-3)


def test_headings_of_frames_are_quaternions_or_none():
    """A turn by theta about z is cos(theta/2), 0, 0, sin(theta/2); positions alone are poses."""
    theta = POSES_FRAME["theta_rad"]
    turned = {k: v for k, v in POSES_FRAME.items() if k != "theta_rad"}
    wxyz = dict(zip(("qw", "qx", "qy", "qz"), np.zeros((4, len(theta))), strict=True))
    wxyz |= {"qw": np.cos(theta / 2), "qz": np.sin(theta / 2)}
    found = tm.Log.from_frames(turned | wxyz, COMMANDS_FRAME).table()
    np.testing.assert_allclose(np.exp(1j * found["theta_rad"]), np.exp(1j * theta))
    lost = {k: np.where(T_S < 1, 0, v) for k, v in wxyz.items()}  # as captures tell a lost body
    valid = tm.Log.from_frames(turned | lost, COMMANDS_FRAME).table()["valid"]
    np.testing.assert_array_equal(valid, T_S >= 1)
    with pytest.raises(tm.LogError, match=r"row 0: .* is 2 long, must be 1"):
        tm.Log.from_frames(turned | {k: 2 * v for k, v in wxyz.items()}, COMMANDS_FRAME)
    alone = tm.Log.from_frames(turned, COMMANDS_FRAME)
    assert alone.table()["valid"].all() and not alone.warnings
    np.testing.assert_allclose(alone.table()["x_m"], POSES_FRAME["x_m"])


def test_epochs_in_ns_are_no_seconds():
    late = dict(POSES_FRAME, t_s=(T_S * 1e9).astype(int) + 1_777_896_000_000_000_000)
    with pytest.raises(tm.LogError, match="is no time in s; divide by 1e9"):
        tm.Log.from_frames(late, COMMANDS_FRAME)


def test_steering_turns_as_a_bicycle():
    angle_rad = np.arctan(0.25 * OMEGA_RADPS / COMMANDS[0, 0])
    told = np.column_stack([COMMANDS[:, 0], np.full(len(COMMANDS), angle_rad)])
    log = tm.Log.from_arrays(T_S, POSE, COMMANDS_T_S, told, kind="steering", wheelbase_m=0.25)
    np.testing.assert_allclose(log.commands()["omega_radps"], OMEGA_RADPS)


WHEEL_M, HALF_TRACK_M, LAG_S = 0.03, 0.08, 0.1
TWO_WHEELS = f"""[robot]
wheel_radius_m = {WHEEL_M}
half_track_m = {HALF_TRACK_M}
[base]
drive = "wheel_speed"
wheels = "differential"
motor_lag_s = {LAG_S}
control_period_s = 0.1
"""


def two_wheels():
    """Times, poses and commands of two wheels that lag, integrated here: speed R (l + r) / 2."""
    random = np.random.default_rng(0)
    told_t_s, t_s = np.arange(0, 90, 0.1), np.arange(0, 90, 0.005)
    told = np.repeat(random.uniform(-8, 8, (60, 2)), 15, axis=0)
    wheels, pose = np.zeros(2), np.zeros((len(t_s) + 1, 3))
    for k in range(len(t_s)):
        before, wheels = wheels, told[k // 20] + (wheels - told[k // 20]) * np.exp(-0.005 / LAG_S)
        mean = (before + wheels) / 2
        v, turn = WHEEL_M * mean.mean(), WHEEL_M * np.diff(mean)[0] / (2 * HALF_TRACK_M)
        theta = pose[k, 2] + 0.0025 * turn
        pose[k + 1] = pose[k] + 0.005 * np.array([v * np.cos(theta), v * np.sin(theta), turn])
    seen = pose[1::4] + random.normal(0, [5e-4, 5e-4, 3e-3], (len(t_s) // 4, 3))
    return t_s[::4] + 0.005, seen, told_t_s, told


@pytest.mark.parametrize("more", ["", "half_wheelbase_m = 0"])
def test_two_columns_are_left_and_right_of_every_axle(tmp_path, more):
    t_s, pose, told_t_s, told = two_wheels()
    (tmp_path / "two.toml").write_text(TWO_WHEELS.replace("[base]", f"{more}\n[base]"))
    log = tm.Log.from_arrays(t_s, pose, told_t_s, told, kind="wheel_speed", same_clock=True)
    found = tm.compare(log, tmp_path / "two.toml")
    assert found.score < 1.3 and not found.left_out
    stored = log.commands()[["w1_radps", "w2_radps", "w3_radps", "w4_radps"]]
    np.testing.assert_allclose(stored, told[:, [0, 1, 0, 1]])
    axle = np.column_stack([told, np.zeros_like(told)])
    idle = tm.Log.from_arrays(t_s, pose, told_t_s, axle, kind="wheel_speed", same_clock=True)
    said = " ".join(tm.compare(idle, tmp_path / "two.toml").left_out)
    assert ("no command drives rear left wheel and rear right wheel" in said) == (not more)


NAMED = {
    "w1_radps,w2_radps": ("wheel_speed", 1.0),
    "left_radps,right_radps": ("wheel_speed", 1.0),
    "left_rpm,right_rpm": ("wheel_speed", np.pi / 30),
    "left_pct,right_pct": ("duty", 1.0),
    "left_pwm,right_pwm": ("duty", 100 / 255),
}


@pytest.mark.parametrize("names", NAMED)
def test_frames_and_files_of_two_wheels_tell_one_thing(tmp_path, names):
    kind, factor = NAMED[names]
    told = pd.DataFrame(np.tile([[20.0, 30.0], [-7.0, 25.0]], (150, 1)), columns=names.split(","))
    told.insert(0, "t_s", COMMANDS_T_S)
    log = tm.Log.from_frames(POSES_FRAME, told)
    stored = log.commands().query("t_s == t_s.round(1)").iloc[:2]
    assert set(stored["kind"]) == {kind}
    both = factor * told.iloc[:2, [1, 2, 1, 2]].to_numpy()
    np.testing.assert_allclose(stored.iloc[:, 4:8], both)
    told.to_csv(tmp_path / "commands.csv", index=False)
    pd.DataFrame(POSES_FRAME).to_csv(tmp_path / "poses.csv", index=False)
    again = tm.import_log(tmp_path / "poses.csv", tmp_path / "commands.csv", robot_id=0)
    np.testing.assert_allclose(again.commands().query("t_s == t_s.round(1)").iloc[:2, 4:8], both)


@pytest.mark.parametrize("kind", [None, "twist"])
def test_frames_arrays_and_files_without_a_sideways_speed_tell_one_thing(tmp_path, kind):
    told = pd.DataFrame(COMMANDS_FRAME).drop(columns="vy_mps")
    log = tm.Log.from_frames(POSES_FRAME, told, kind=kind, name="arrays")
    assert log.to_pandas().equals(circle().to_pandas())
    told.to_csv(tmp_path / "commands.csv", index=False)
    pd.DataFrame(POSES_FRAME).to_csv(tmp_path / "poses.csv", index=False)
    again = tm.import_log(tmp_path / "poses.csv", tmp_path / "commands.csv", robot_id=0)
    velocities = ["vx_mps", "vy_mps", "omega_radps"]
    np.testing.assert_array_equal(again.commands()[velocities], log.commands()[velocities])


def test_other_numbers_of_wheels_are_refused_or_told(tmp_path):
    t_s, pose, told_t_s, told = two_wheels()
    for kind in ("duty", "wheel_speed"):
        with pytest.raises(tm.LogError, match=r"2 \(left, right\), 3 \(omni wheels\) or 4 \(fl"):
            tm.Log.from_arrays(t_s, pose, told_t_s, told[:, :1], kind=kind)
    (tmp_path / "omni.toml").write_text(TWO_WHEELS.replace("differential", "omni3"))
    log = tm.Log.from_arrays(t_s, pose, told_t_s, told, kind="wheel_speed", same_clock=True)
    with pytest.raises(tm.LogError):
        tm.compare(log, tmp_path / "omni.toml")
    odd = pd.DataFrame({"t_s": told_t_s, "left_radps": told[:, 0], "left_rpm": told[:, 0]})
    with pytest.raises(tm.LogError, match="left_rpm: holds what left_radps does"):
        tm.Log.from_frames(POSES_FRAME, odd)


def test_a_saved_log_is_one_of_lcm(tmp_path):
    circle().save(tmp_path / "circle.lcmlog")
    events = [e for e in lcm.EventLog(str(tmp_path / "circle.lcmlog"), "r")]
    poses = [turbopi.pose_t.decode(e.data) for e in events if e.channel == "R00_POSE"]
    assert [e.eventnum for e in events] == list(range(len(events)))
    np.testing.assert_array_equal([p.position_m[:2] for p in poses], POSE[:, :2])
    again = tm.load(tmp_path / "circle.lcmlog")
    assert again.to_pandas().drop(columns="log").equals(circle().to_pandas().drop(columns="log"))
    files = circle().export(tmp_path / "tables", to="csv")
    assert len(pd.read_csv(next(f for f in files if f.name == "pose.csv"), comment="#")) == len(T_S)


BACK_S = np.r_[T_S[1], T_S[0], T_S[2:]]
WRONG = {
    "widths": ((T_S, POSE[:, :1], COMMANDS_T_S, COMMANDS), "pose: has shape .* 2 or 3 columns"),
    "lengths": ((T_S, POSE[1:], COMMANDS_T_S, COMMANDS), r"pose: has shape \(1499, 3\), .* 1500"),
    "order": ((BACK_S, POSE, COMMANDS_T_S, COMMANDS), "t_s: row 1 is not later"),
    "NaN": ((T_S, POSE, COMMANDS_T_S, COMMANDS * np.nan), "commands: have NaN"),
    "no pose": ((T_S, POSE * np.nan, COMMANDS_T_S, COMMANDS), "pose: has no row"),
    "apart": ((T_S - 1e3, POSE, COMMANDS_T_S, COMMANDS), "poses go from -1000 to .* in one time"),
    "words": ((T_S, POSE, COMMANDS_T_S, [["a", "b"]]), "commands: is not all numbers"),
}


@pytest.mark.parametrize(("arrays", "said"), WRONG.values(), ids=WRONG)
def test_what_makes_no_run_is_refused_in_a_sentence(arrays, said):
    with pytest.raises(tm.LogError, match=said) as refused:
        tm.Log.from_arrays(*arrays, kind="twist")
    assert "\n" not in str(refused.value)


def test_a_frame_that_lacks_a_column_is_refused_by_its_name():
    with pytest.raises(tm.LogError, match="poses: has no column y_m"):
        tm.Log.from_frames({"t_s": T_S, "x_m": T_S}, COMMANDS_FRAME)
    with pytest.raises(tm.LogError, match="commands: must have one of these groups"):
        tm.Log.from_frames(POSES_FRAME, {"t_s": T_S, "speed": T_S})
    with pytest.raises(tm.LogError, match="kind: is 'velocity'"):
        circle(kind="velocity")
    with pytest.raises(tm.LogError, match="robot_id: is 100"):
        circle(robot_id=100)


def test_a_predicted_path_is_the_circle_that_the_commands_describe(tmp_path):
    """Half of the speed and of the turning rate: a circle as large, half of it in the time."""
    twist = '[base]\ndrive = "twist"\nwheels = "none"\nspeed_per_input_mps = 0.0036\n'
    (tmp_path / "half.toml").write_text(
        f'name = "half"\n{twist}forward_gain = 0.5\nyaw_gain = 0.5\ncontrol_period_s = 0.02\n'
    )
    found = tm.compare(circle(same_clock=True), tmp_path / "half.toml")
    predicted = ["x_predicted_m", "y_predicted_m", "theta_predicted_rad"]
    turned = 0.5 * OMEGA_RADPS * T_S
    ways = np.column_stack([RADIUS_M * np.sin(turned), RADIUS_M * (1 - np.cos(turned)), turned])
    np.testing.assert_allclose(found.paths(np.inf)[predicted], ways, atol=2e-3)

    parts = found.paths(restart_s=5)
    np.testing.assert_allclose(parts[["x_m", "y_m", "theta_rad"]], POSE, atol=1e-6)
    np.testing.assert_allclose(parts["since_s"].unique(), np.arange(0, 30, 5), atol=0.02)
    turned = parts["since_s"] + 0.5 * (parts["t_s"] - parts["since_s"])
    np.testing.assert_allclose(parts["theta_predicted_rad"], OMEGA_RADPS * turned, atol=2e-3)
    with pytest.raises(ValueError, match=r"restart_s: 0 s"):
        found.paths(0)
