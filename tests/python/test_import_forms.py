# SPDX-License-Identifier: Apache-2.0
"""Forms that other programs write: trajectories, messages of ROS in text, dates in many ways.

Each form holds one path, x = t / 10 and y = t / 20 at a heading of 0.4 rad; its layout is that of
the format's own page or program.
"""

import math

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import app

START_S = 1_700_000_000  # 2023-11-14 22:13:20 UTC, by date -u
T_S = np.arange(20) / 10
Z, W = math.sin(0.2), math.cos(0.2)
ECHO = "{sec},{nanosec},map,{x},{y},0.0,0.0,0.0,{z},{w}"


def _text(form: str, header: str = "") -> str:
    rows = []
    for t in T_S.tolist():
        whole, part = divmod(round(t * 1e9), 10**9)
        values = {"t": f"{START_S + t:.6f}", "ns": START_S * 10**9 + round(t * 1e9)}
        values |= {"sec": START_S + whole, "nanosec": part, "x": t / 10, "y": t / 20}
        values |= {"date": "2023-11-14", "time": f"22:13:{20 + t:09.6f}", "ms": f"{part // 10**6}"}
        values |= {"s": 20 + whole, "z": Z, "w": W}
        rows.append(form.format(**values))
    return "\n".join([header, *rows] if header else rows) + "\n"


EUROC = ",".join(
    ["#timestamp [ns]"]
    + [f"p_RS_R_{axis} [m]" for axis in "xyz"]
    + [f"q_RS_{axis} []" for axis in "wxyz"]
)
FORMS = {
    "TUM without names": _text("{t} {x} {y} 0 0 0 {z} {w}"),
    "of a quaternion what turns on the floor": _text("{t},{x},{y},{z},{w}", "t,x_m,y_m,qz,qw"),
    "TUM": _text("{t} {x} {y} 0 0 0 {z} {w}", "# timestamp tx ty tz qx qy qz qw"),
    "TUM in nanoseconds": _text("{ns} {x} {y} 0 0 0 {z} {w}"),
    "TUM with spaces at the ends": _text("{t}  {x} {y} 0 0 0  {z} {w} "),
    "the way to a field once": _text(
        "{t} {x} {y} 0 0 0 {z} {w}", "#Time pose.position.x y z pose.orientation.x y z w"
    ),
    "commas behind the numbers": _text("{t},{x},{y},0.4,", "t_s,x_m,y_m,theta_rad"),
    "a comma behind the names": _text("{t},{x},{y},0.4", "t_s,x_m,y_m,theta_rad,"),
    "EuRoC": _text("{ns},{x},{y},0,{w},0,0,{z}", EUROC),
    "a count before the stamps": _text("7,{t},{x},{y},0,0,0,{z},{w}", "num,t,x,y,z,qx,qy,qz,qw"),
    "ros2 topic echo --csv": _text(ECHO),
    "days beside times": _text("{date},{time},{x},{y},0.4", "Date,Time,x_m,y_m,theta_rad"),
    "digits": _text("2023_11_14_22_13_{s}_{ms},{x},{y},0.4", "timestamp,x_m,y_m,theta_rad"),
    "nanoseconds": _text("{ns},{x},{y},0.4", "time,x_m,y_m,theta_rad"),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_form_of_another_program_is_read_without_an_option(form, tmp_path):
    path, out = tmp_path / "p.txt", tmp_path / "o.lcmlog"
    path.write_text(FORMS[form])
    import_log(path, None, out, options=ImportOptions(robot_id=1))
    log = read_log(out)
    robot = log.robots[1]
    np.testing.assert_allclose(robot.pose_t_s, T_S, atol=2e-6)
    np.testing.assert_allclose(robot.pose[:, 0], T_S / 10)
    np.testing.assert_allclose(robot.pose[:, 2], 0.4)
    assert log.t0_utime_us == START_S * 10**6


def _table(stamps_s) -> str:
    rows = [f"{t:.3f},{k / 10},{k / 20},0.4" for k, t in enumerate(stamps_s)]
    return "\n".join(["t_s,x_m,y_m,theta_rad", *rows]) + "\n"


def test_a_clock_that_was_set_back_within_a_table_is_told_and_nothing_mixed(tmp_path):
    """30 rows at 10 Hz, then 2 s less: the 31st, row 32 of the file, stands at 1 s again."""
    path, out = tmp_path / "p.csv", tmp_path / "o.lcmlog"
    path.write_text(_table([k / 10 - 2 * (k >= 30) for k in range(60)]))
    with pytest.raises(LogError, match=r"row 32 is 1\.9 s earlier .* 20 rows behind it"):
        import_log(path, None, out, options=ImportOptions(robot_id=1))
    assert not out.exists()


def test_packets_that_came_late_are_put_where_they_belong(tmp_path):
    path, out = tmp_path / "p.csv", tmp_path / "o.lcmlog"
    order = [*range(20), 23, 20, 21, 22, *range(24, 40)]
    lines = _table([k / 10 for k in range(40)]).splitlines()
    path.write_text("\n".join([lines[0], *(lines[1 + k] for k in order)]) + "\n")
    import_log(path, None, out, options=ImportOptions(robot_id=1))
    np.testing.assert_allclose(read_log(out).robots[1].pose[:, 0], np.arange(40) / 10)


def test_odometry_stands_in_for_commands_and_is_said_to(tmp_path):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds, odometry = store.types, "nav_msgs/msg/Odometry"

    def vector(x=0.0, z=0.0):
        return kinds["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=z)

    with Writer(tmp_path / "bag", version=9) as writer:
        topic = writer.add_connection("/r1/odom", odometry, typestore=store)
        for k in range(40):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=k // 10, nanosec=k % 10 * 10**8)
            turned = kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=Z, w=W)
            pose = kinds["geometry_msgs/msg/Pose"](
                position=kinds["geometry_msgs/msg/Point"](x=0.02 * k, y=0.0, z=0.0),
                orientation=turned,
            )
            twist = kinds["geometry_msgs/msg/Twist"](linear=vector(0.2), angular=vector(z=0.1))
            sure = np.zeros(36)
            message = kinds[odometry](
                header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="odom"),
                child_frame_id="base_link",
                pose=kinds["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=sure),
                twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=sure),
            )
            writer.write(topic, k * 10**8, store.serialize_cdr(message, odometry))
    listed = CliRunner().invoke(app, ["import", "--bag", str(tmp_path / "bag")]).output
    assert "pose, command" in listed and "--pose /r1/odom --command /r1/odom" in listed
    assert "stand in for commands" in listed
    options = ImportOptions(pose_topics=("/r1/odom",), command_topics=("/r1/odom",))
    done = import_log(None, None, tmp_path / "o.lcmlog", bag=tmp_path / "bag", options=options)
    robot = read_log(tmp_path / "o.lcmlog").robots[1]
    np.testing.assert_allclose(robot.command[:, :3], np.tile([0.2, 0, 0.1], (40, 1)))
    np.testing.assert_allclose(robot.pose[:, 0], 0.02 * np.arange(40))
    assert any("stand in for commands" in warning for warning in done["warnings"])


def test_odometry_in_a_table_stands_in_for_commands_and_is_said_to(tmp_path):
    fields = ["pose.pose.position.x", "pose.pose.position.y", "twist.twist.linear.x"]
    names = ["Time", *fields, "twist.twist.linear.y", "twist.twist.angular.z"]
    rows = [f"{START_S + t},{t / 10},{t / 20},0.1,0,0.2" for t in T_S]
    path = tmp_path / "odom.csv"
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    options = ImportOptions(robot_id=1)
    done = import_log(path, path, tmp_path / "o.lcmlog", options=options)
    robot = read_log(tmp_path / "o.lcmlog").robots[1]
    np.testing.assert_allclose(robot.command[:, :3], np.tile([0.1, 0, 0.2], (len(T_S), 1)))
    assert any("stand in for commands" in warning for warning in done["warnings"])


def test_a_table_of_wheels_on_the_bench_is_told_with_its_way_out(tmp_path):
    path = tmp_path / "bench.csv"
    rows = "".join(f"{k},{2 * k},{2 * k}\n" for k in range(9))
    path.write_text(f"duty_pct,left_rpm,right_rpm\n{rows}")
    with pytest.raises(LogError, match="bench test; it needs no import: give it to compare"):
        import_log(path, None, tmp_path / "o.lcmlog", options=ImportOptions(robot_id=1))


MERGED_POSE = "/mocap/pose/pose"
MERGED_TOLD = ["/cmd_vel/linear/x", "/cmd_vel/angular/z"]


def _merged(first: str, names: dict[str, str] | None = None) -> tuple[pd.DataFrame, ...]:
    """Poses at 25 Hz, commands at 20 Hz, and one table of both with commands filled forward.

    Args:
        first: topic whose row comes first where both have a stamp.
        names: new ones of columns.
    """
    seen_s, told_s = START_S + np.arange(1000) / 25, START_S + np.arange(800) / 20
    turn_rad = np.cumsum(np.full(1000, 0.3 / 25))
    seen = {"position/x": np.sin(turn_rad), "position/y": np.cos(turn_rad), "position/z": 0.05}
    seen |= {f"orientation/{axis}": 0.0 for axis in "xy"}
    seen |= {"orientation/z": np.sin(turn_rad / 2), "orientation/w": np.cos(turn_rad / 2)}
    poses = pd.DataFrame({f"{MERGED_POSE}/{k}": v for k, v in seen.items()} | {"__time": seen_s})
    speeds = 0.1 + np.arange(800) // 50 / 100
    commands = pd.DataFrame({"__time": told_s, MERGED_TOLD[0]: speeds, MERGED_TOLD[1]: 0.3})
    both = [poses, commands] if first == "pose" else [commands, poses]
    table = pd.concat(both).sort_values("__time", kind="stable")
    table[MERGED_TOLD] = table[MERGED_TOLD].ffill()
    table = table[["__time", *table.columns.drop("__time")]]
    return poses, commands, table.rename(columns=names or {})


OWN_NAMES = {"__time": "t_s", MERGED_TOLD[0]: "vx_mps", MERGED_TOLD[1]: "omega_radps"} | {
    f"{MERGED_POSE}/{theirs}/{axis}": f"{ours}{axis}{unit}"
    for theirs, ours, unit, axes in (
        ("position", "", "_m", "xyz"),
        ("orientation", "q", "", "wxyz"),
    )
    for axis in axes
}


@pytest.mark.parametrize("first", ["pose", "command"])
@pytest.mark.parametrize("names", [None, OWN_NAMES], ids=["paths", "own names"])
def test_commands_filled_forward_make_no_lost_poses(tmp_path, first, names):
    """Made by pandas' `concat`, `sort_values` and `ffill`: what was joined comes out again."""
    poses, commands, table = _merged(first, names)
    path = tmp_path / "all.csv"
    table.to_csv(path, index=False, float_format="%.7f")
    options = ImportOptions(robot_id=1, same_clock=True)
    said = import_log(path, path, tmp_path / "o.lcmlog", options=options)
    robot = read_log(tmp_path / "o.lcmlog").robots[1]
    assert len(robot.pose_t_s) == np.count_nonzero(robot.valid) == len(poses)
    np.testing.assert_allclose(robot.pose[:, 0], poses[f"{MERGED_POSE}/position/x"], atol=1e-6)
    told_s = commands["__time"] - START_S
    held = np.searchsorted(robot.command_t_s, told_s + 1e-5) - 1
    np.testing.assert_allclose(robot.command[held, 0], commands[MERGED_TOLD[0]], atol=1e-6)
    changes = np.count_nonzero(np.diff(commands[MERGED_TOLD[0]]))
    assert said["robots"][0]["command_changes"] == changes
    assert not any("stamp" in w or "empty" in w or "cut" in w for w in said["warnings"])


def test_lost_poses_of_a_table_of_frames_stay_lost(tmp_path):
    """A row a frame, with the command in each: every tenth frame and one second were lost."""
    _, _, table = _merged("pose", OWN_NAMES)
    frames = table[table.x_m.notna()].reset_index(drop=True)
    lost = (frames.index % 10 == 9) | ((frames.index > 500) & (frames.index <= 525))
    frames.loc[lost, ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"]] = np.nan
    frames = frames[frames.vx_mps.notna()]
    frames.to_csv(tmp_path / "all.csv", index=False, float_format="%.7f")
    path, out = tmp_path / "all.csv", tmp_path / "o.lcmlog"
    import_log(path, path, out, options=ImportOptions(robot_id=1, same_clock=True))
    robot = read_log(out).robots[1]
    assert len(robot.pose_t_s) == len(frames)
    assert np.count_nonzero(~robot.valid) == np.count_nonzero(frames.x_m.isna())


def test_rows_without_anything_are_lost_poses_and_no_commands(tmp_path):
    """A tracker's row without a number, beside a table that lacks the sideways speed."""
    poses, commands, _ = _merged("pose")
    poses.loc[300:311, poses.columns.drop("__time")] = np.nan
    table = pd.concat([poses, commands]).sort_values("__time", kind="stable")
    path, out = tmp_path / "all.csv", tmp_path / "o.lcmlog"
    table.to_csv(path, index=False, float_format="%.7f")
    said = import_log(path, path, out, options=ImportOptions(robot_id=1, same_clock=True))
    robot = read_log(out).robots[1]
    assert len(robot.pose_t_s) == len(poses)
    np.testing.assert_array_equal(np.flatnonzero(~robot.valid), np.arange(300, 312))
    assert said["robots"][0]["command_rows"] == len(commands)
    assert not any("empty" in w for w in said["warnings"])


def test_a_quaternion_whose_columns_hold_nothing_is_a_heading_that_is_not_recorded(tmp_path):
    """As PlotJuggler wrote them: names of its columns, and no values."""
    poses, _, table = _merged("pose")
    table[[f"{MERGED_POSE}/orientation/{axis}" for axis in "xyzw"]] = np.nan
    path, out = tmp_path / "all.csv", tmp_path / "o.lcmlog"
    table.to_csv(path, index=False, float_format="%.7f")
    said = import_log(path, path, out, options=ImportOptions(robot_id=1, same_clock=True))
    robot = read_log(out).robots[1]
    assert robot.valid.all() and len(robot.valid) == len(poses) and not robot.has_heading
    assert any("the heading is not recorded" in w for w in said["warnings"])


@pytest.mark.parametrize("topic", ["/mocap", "/mocap/pose", "mocap.pose"])
def test_a_topic_of_a_table_is_named_whole_or_without_its_end(tmp_path, topic):
    poses, _, table = _merged("command")
    table[["/odom/pose/pose/position/x", "/odom/pose/pose/position/y"]] = 0.0
    path, out = tmp_path / "all.csv", tmp_path / "o.lcmlog"
    table.to_csv(path, index=False, float_format="%.7f")
    options = ImportOptions(robot_id=1, same_clock=True, pose_topics=(topic,))
    import_log(path, path, out, options=options)
    got = read_log(out).robots[1].pose[:, 0]
    np.testing.assert_allclose(got, poses[f"{MERGED_POSE}/position/x"], atol=1e-6)
    with pytest.raises(LogError, match=r"no column is of the topic /mocap/twist"):
        options = ImportOptions(robot_id=1, pose_topics=("/mocap/twist",))
        import_log(path, path, tmp_path / "p.lcmlog", options=options)
