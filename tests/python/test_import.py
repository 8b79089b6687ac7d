# SPDX-License-Identifier: Apache-2.0
import gzip
import json
import re
import resource
from pathlib import Path

import lcm
import numpy as np
import pandas as pd
import pytest
import turbopi
import twinmill_native as native
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import twinmill as tm
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill.model.mixing import duties_from_inputs, duties_from_vendor_move
from twinmill_cli.main import app

POSES = "t_s,robot_id,x_m,y_m,theta_rad\n0,4,0,0,3\n0.5,4,0.1,0.2,-3\n1.0,4,0.3,0.2,-2.5\n"
COMMANDS = "t_s,robot_id,fl_pct,fr_pct,rl_pct,rr_pct\n0,4,0,0,0,0\n0.1,4,10,-20,30,-100\n"


def _in_unit(table, of_a_second):
    header, *rows = (line.split(",", 1) for line in table.splitlines())
    rows = [[str(float(t) * of_a_second), rest] for t, rest in rows]
    return "".join(f"{t},{rest}\n" for t, rest in (header, *rows))


@pytest.fixture
def put(tmp_path):
    """Writes text to a file of that name, compressed if it ends in .gz."""

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
        return path

    return write


@pytest.fixture
def imported(put, tmp_path):
    """The robot 4 of a log made from two texts."""

    def make(poses=POSES, commands=COMMANDS, **options):
        import_log(
            put("p.csv", poses),
            put("c.csv.gz", commands),
            tmp_path / "o.lcmlog",
            options=ImportOptions(**options),
        )
        return read_log(tmp_path / "o.lcmlog").robots[4]

    return make


@pytest.mark.parametrize("missing_bytes", [1, 5000], ids=["last byte", "most"])
def test_full_disk_leaves_no_log(put, tmp_path, missing_bytes):
    """The newest events are in LCM's memory, and it closes a log without a word."""
    sources, out = (put("p.csv", POSES), put("c.csv.gz", COMMANDS)), tmp_path / "o.lcmlog"
    import_log(*sources, out)
    limit_bytes = out.stat().st_size - missing_bytes
    out.unlink()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, before[1]))
    try:
        with pytest.raises(ValueError, match=r"o\.lcmlog: cannot be written \((File too|No space)"):
            import_log(*sources, out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.csv.gz", "p.csv"]


def test_poses_come_back_as_written(imported):
    robot = imported()
    np.testing.assert_array_equal(robot.pose_t_s, [0, 0.5, 1.0])
    np.testing.assert_array_equal(robot.pose[:, :2], [[0, 0], [0.1, 0.2], [0.3, 0.2]])
    # The heading goes on over the half turn: -3 is 2 pi - 3.
    np.testing.assert_allclose(robot.pose[:, 2], [3, 2 * np.pi - 3, 2 * np.pi - 2.5], atol=1e-12)


@pytest.mark.parametrize(
    "rows", ["0,4,0.1,0.2,3\n0.5,4,0.3,0.2,-3\n", "0;4;0,1;0,2;3\n0,5;4;0,3;0,2;-3\n"]
)
def test_a_table_without_names_is_read_by_the_numbers_of_its_columns(imported, rows):
    with pytest.raises(LogError, match=r"no names, so its columns are called column_1 to column_5"):
        imported(poses=rows)
    ours = ("t_s", "robot_id", "x_m", "y_m", "theta_rad")
    told = {f"column_{k}": name for k, name in enumerate(ours, 1)}
    robot = imported(poses=rows, rename=told)
    np.testing.assert_array_equal(robot.pose_t_s, [0, 0.5])
    np.testing.assert_array_equal(robot.pose[:, :2], [[0.1, 0.2], [0.3, 0.2]])


def test_the_row_that_pandas_writes_over_an_array_is_no_measurement(imported):
    """`pandas.DataFrame(array).to_csv(index=False)` calls the columns 0, 1, 2 ..."""
    array = pd.DataFrame(np.array([[0, 4, 0.1, 0.2, 3], [0.5, 4, 0.3, 0.2, -3]]))
    ours = ("t_s", "robot_id", "x_m", "y_m", "theta_rad")
    told = {str(k): name for k, name in enumerate(ours)}
    robot = imported(poses=array.to_csv(index=False), rename=told)
    np.testing.assert_array_equal(robot.pose[:, :2], [[0.1, 0.2], [0.3, 0.2]])


def test_duties_are_held_to_the_last_pose_and_told_every_22_ms(imported):
    robot = imported()
    held = np.concatenate([np.arange(0, 0.1, 0.022), np.arange(0.1, 1.0001, 0.022)])
    np.testing.assert_allclose(robot.command_t_s, held, atol=1e-9)
    late = held >= 0.1
    np.testing.assert_array_equal(robot.command[~late], np.zeros((5, 4)))
    np.testing.assert_array_equal(
        robot.command[late], np.tile([0.1, -0.2, 0.3, -1.0], (late.sum(), 1))
    )
    assert np.isnan(robot.battery_V).all() and (robot.mode == 2).all()


def test_duties_between_whole_percents_are_held_as_long_as_it_takes(put, tmp_path, model_text):
    """A robot that follows at once is told 154 of 255, then 77: its way is speed times time."""
    t_s = np.arange(0, 12, 0.02)
    x_m = 0.36 / 255 * (154 * np.minimum(t_s, 6) + 77 * np.maximum(t_s - 6, 0))
    rows = [f"{t:.2f},{x:.6f},0,0\n" for t, x in zip(t_s, x_m, strict=True)]
    poses = put("p.csv", "t_s,x_m,y_m,theta_rad\n" + "".join(rows))
    commands = put("c.csv", "t_s,left_pwm,right_pwm\n0,154,154\n6,77,77\n")
    out = tmp_path / "o.lcmlog"
    import_log(poses, commands, out, options=ImportOptions(robot_id=4, same_clock=True))
    model = put("m.toml", model_text("m", motor_lag_s=0.0))
    errors = tm.compare(out, str(model)).to_json()["errors"]
    assert max(e["rms"] for e in errors if e["channel"] == "forward") < 0.0005


@pytest.mark.parametrize(
    ("columns", "kind", "row"),
    [
        ("w1_radps,w2_radps,w3_radps,w4_radps", "wheel_speed", [1.5, -2.25, 3.125, 4.0]),
        ("vx_mps,vy_mps,omega_radps", "twist", [0.25, -0.1, 1.0]),
    ],
)
def test_wheel_speeds_and_twists_stay_at_their_rows(imported, columns, kind, row):
    cells = ",".join(map(str, row))
    robot = imported(commands=f"t_s,robot_id,{columns}\n0,4,{cells}\n0.7,4,{cells}\n")
    assert robot.command_kind == kind
    np.testing.assert_array_equal(robot.command_t_s, [0, 0.7])
    np.testing.assert_array_equal(robot.command[:, : len(row)], [row, row])


def test_inputs_become_duties_and_are_kept(imported):
    robot = imported(commands="t_s,robot_id,speed_input,turn_input\n0,4,100,0.5\n")
    # Left, counter-clockwise: the left side is the slow one (37 of the vendor's table).
    np.testing.assert_array_equal(robot.command[0] * 100, [37, 100, 37, 100])
    assert (robot.speed_input[0], robot.turn_input[0]) == (100, 0.5)


def test_lost_poses_and_renamed_columns_and_files_of_one_robot(imported):
    robot = imported(
        "t_s,x_m,y_m,yaw_rad\n0,1,2,0\n0.01,nan,nan,nan\n0.02,,,\n0.03,1,2,0\n",
        "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,1,1,1,1\n",
        rename={"yaw_rad": "theta_rad"},
        robot_id=4,
    )
    assert robot.valid.tolist() == [True, False, False, True]


def test_heading_offset_and_shift_move_the_poses_alone(imported):
    robot = imported(heading_offset_rad=0.25, pose_shift_s=0.125)
    assert robot.pose[0, 2] == pytest.approx(3.25 - 2 * np.pi)
    assert (robot.pose_t_s[0], robot.command_t_s[0]) == (0.125, 0)


@pytest.mark.parametrize(
    ("poses", "commands", "sentence"),
    [
        (POSES.replace("theta_rad", "theta"), COMMANDS, r"'theta' .* no unit.*rename={'theta': "),
        (POSES.replace("0.3", "x"), COMMANDS, r"p\.csv: row 4: x_m is 'x', not a number"),
        (POSES.replace("1.0,4", "1.0,123"), COMMANDS, r"row 4: robot_id is 123, .*0\.\.99"),
        (POSES + "1,4,0\n", COMMANDS, r"row 5: has 3 cells"),
        ("", COMMANDS, r"p\.csv: has no rows"),
        (POSES.replace("robot_id", "number"), COMMANDS, r"robot_id is missing.*robot_id"),
        (POSES, COMMANDS.replace("-100", "-101"), r"row 3: rr_pct is -101, .*-100\.\.100"),
        (POSES, COMMANDS.replace("-100", "?"), r"row 3: rr_pct is '\?', not a number"),
        (POSES, COMMANDS.replace("-100", "inf"), r"row 3: rr_pct is inf, .*finite"),
        (POSES, COMMANDS.replace("rr_pct", "rr"), r"'rr' .*percent.* no unit"),
        (
            POSES.replace("x_m,", "")
            .replace(",0.1,", ",")
            .replace(",0,0,", ",0,")
            .replace("0.3,", ""),
            COMMANDS,
            r"column x_m is missing; add it",
        ),
        (
            POSES,
            "t_s,robot_id,speed_input,turn_input\n0,4,10,2.5\n",
            r"turn_input is 2\.5, .*-2\.\.2",
        ),
        (POSES, COMMANDS.replace(",4,", ",5,"), r"no robot has both"),
        (
            POSES,
            COMMANDS.replace("\n0,4", "\n50,4").replace("0.1,4", "51,4"),
            r"do not overlap.*pose_shift_s=50\.0",
        ),
        (
            "\n".join(POSES.split("\n")[:2]) + "\n",
            COMMANDS,
            r"robot 4: has one pose, at .*tells no motion",
        ),
        (POSES.replace("1.0,4", "1750000000,4"), COMMANDS, r"held for 1\d+ s"),
        (
            POSES,
            COMMANDS.replace("\n0.1,4", "\n1000,4"),
            r"times of the commands are in ms, so name that column t_ms",
        ),
        # Both in one unit that is no second: lengths agree, steps and stamps tell it.
        (
            _in_unit(POSES + "1.5,4,0,0,0\n2,4,0,0,0\n", 1e3),
            _in_unit(COMMANDS + "1.9,4,0,0,0,0\n", 1e3),
            r"poses are 500 s apart.* times are in ms,.* rename={'t_s': 't_ms'}",
        ),
        (
            POSES.replace("\n", "\n1772366400000000", 1),
            COMMANDS,
            r"p.csv: t_s goes to 1.772e\+16.*counts us since 1970, name the column t_us",
        ),
        ("t_s,robot_id,x_m,y_m,qw,qx,qy,qz\n0,4,0,0,1,1,0,0\n", COMMANDS, r"row 2: .*must be 1"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_written(put, tmp_path, poses, commands, sentence):
    with pytest.raises(LogError, match=sentence) as caught:
        import_log(put("p.csv", poses), put("c.csv", commands), tmp_path / "o.lcmlog")
    assert "\n" not in str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.csv", "p.csv"]


@pytest.mark.parametrize(
    ("their_poses", "their_commands", "why"),
    [
        ([10.5, 11, 12], [10], "do not overlap"),  # one command, before its first pose
        ([10, 11, 12], [20, 21], "do not overlap"),
        ([0, 5000], [0], r"held for 5000 s"),
        ([0, 10, 20, 30, 40], [0, 40], r"10 s apart"),
    ],
)
def test_one_robot_of_no_run_is_left_out_with_the_reason(
    put, tmp_path, their_poses, their_commands, why
):
    """The others' verdict is as it would be without it, and so are the cameras' detections."""
    poses = POSES + "".join(f"{t},7,0,0,0\n" for t in their_poses)
    told = "t_s,robot_id,vx_mps,vy_mps,omega_radps\n0,4,0,0,0\n0.1,4,0.1,0,0.5\n"
    commands = told + "".join(f"{t},7,0.1,0,0\n" for t in their_commands)
    seen = put("s.csv", "t_s,robot_id,seen\n0.2,4,1\n11,7,1\n")
    logs = {}
    for name, texts in (("alone", (POSES, told)), ("beside", (poses, commands))):
        files = (put(f"{name}_{k}.csv", text) for k, text in enumerate(texts))
        done = import_log(*files, tmp_path / name, detections=None if name == "alone" else seen)
        logs[name] = read_log(tmp_path / name).robots
    assert list(logs["alone"]) == list(logs["beside"]) == [4]
    for series in ("pose_t_s", "pose", "command_t_s", "command"):
        alone, beside = (getattr(logs[name][4], series) for name in logs)
        np.testing.assert_array_equal(alone, beside)
    (left_out,) = (w for w in done["warnings"] if w.startswith("Left out: robot 7: "))
    assert re.search(why, left_out)


def test_existing_and_unwritable_outputs_are_refused(put, tmp_path):
    poses, commands = put("p.csv", POSES), put("c.csv", COMMANDS)
    with pytest.raises(ValueError, match=r"exists; .* force=True"):
        import_log(poses, commands, put("o.csv", "mine"))
    with pytest.raises(ValueError, match=r"o\.lcmlog: cannot be written"):
        import_log(poses, commands, tmp_path / "none" / "o.lcmlog")
    with pytest.raises(ValueError, match=r"/dev/null: is a device"):
        import_log(poses, commands, Path("/dev/null"), options=ImportOptions(force=True))


def test_not_gzip_and_not_text_are_refused(put, tmp_path):
    commands = put("c.csv", COMMANDS)
    for name in ("p.csv.gz", "p.csv"):
        (tmp_path / name).write_bytes(b"\x89ABC\r\n\x1a\n\0\0\0\rIHDR")
        with pytest.raises(LogError, match="cannot be read as text"):
            import_log(tmp_path / name, commands, tmp_path / "o.lcmlog")


def test_lcm_reads_the_log_and_it_tells_its_sources(put, tmp_path):
    import_log(put("p.csv", POSES), put("c.csv", COMMANDS), tmp_path / "o.lcmlog")
    events = list(lcm.EventLog(str(tmp_path / "o.lcmlog"), "r"))
    stamps = [event.timestamp for event in events]
    assert stamps == sorted(stamps)
    run = turbopi.run_t.decode(next(e.data for e in events if e.channel == "R04_RUN"))
    assert (run.source, run.robot_id) == ("robot", 4)
    assert "p.csv" in run.config_toml and "sha256" in run.config_toml


def test_same_input_same_bytes(put, tmp_path):
    poses, commands = put("p.csv", POSES), put("c.csv", COMMANDS)
    for name in "ab":
        import_log(poses, commands, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


# The vendor's mixing as documented: (v, d, w) to left and right duty.
@pytest.mark.parametrize(
    ("move", "left", "right"),
    [
        ((100, 90, 0.5), 100, 37),
        ((100, 90, -0.5), 37, 100),
        ((100, 90, 0.65), 100, 18),
        ((75, 90, -0.5), 12, 100),
        ((100, 90, -2), -100, 100),
        ((0, 90, 0.5), 63, -63),
        ((0, 270, 2), 100, -100),
    ],
)
def test_mixing_is_the_vendors_table(move, left, right):
    assert duties_from_vendor_move(*move) == (left, right, left, right)
    if move[1] == 90:
        assert duties_from_inputs(move[0], -move[2]) == (left, right, left, right)


def test_backward_keeps_the_vendors_rounding_in_its_logs_alone():
    assert duties_from_vendor_move(50, 270, 0) == (-50, -49, -49, -50)
    assert duties_from_inputs(-50, 0) == (-50, -50, -50, -50)


@given(st.integers(-100, 100), st.integers(-2000, 2000))
def test_mixing_is_the_firmwares_and_mirrors(speed, turn_milli):
    duties = duties_from_inputs(speed, turn_milli / 1000)
    assert list(duties) == native.mix(speed, turn_milli)
    left, right, _, _ = duties
    assert duties_from_inputs(speed, -turn_milli / 1000)[:2] == (right, left)
    assert duties_from_inputs(-speed, -turn_milli / 1000)[:2] == (-left, -right)


MOTIVE = """Format Version,1.23,Take Name,T,Capture Start Time,2025-12-05 03.07.49.500 PM,\
Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global

,Type,Marker,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body
,Name,other,turbopi-04,turbopi-04,turbopi-04,turbopi-04,turbopi-04,turbopi-04,turbopi-04,turbopi-04
,ID,M,B,B,B,B,B,B,B,B
,,Position,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error
Frame,Time (Seconds),X,X,Y,Z,W,X,Y,Z,
0,0.000,1,0,0.0,0,1,100,50,200,0.1
1,0.010,1,0,0.6,0,0.8,100,50,-200,0.1
2,0.020,,,,,,,,,
"""


# Saved again by a spreadsheet of a country that writes decimal commas.
SAVED_AGAIN = MOTIVE.replace(",", ";").replace("0.", "0,")
# Format 1.25 has a row of parents; with time codes a column stands behind the times.
WITH_PARENTS = MOTIVE.replace("1.23", "1.25").replace("\n,,Pos", "\n,Parent,,,,,,,,,\n,,Pos")
WITH_TIME_CODE = re.sub(r"(?m)^(Frame,[^,]*|\d+,[^,]*|,[^,\n]*)", r"\1,", MOTIVE)


@pytest.mark.parametrize(
    "take", [MOTIVE, "\ufeff" + MOTIVE, SAVED_AGAIN, WITH_PARENTS, WITH_TIME_CODE]
)
def test_motive_y_up_millimetres_become_z_up_metres(put, tmp_path, take):
    import_log(None, put("c.csv", COMMANDS), tmp_path / "o.lcmlog", motive=put("take.csv", take))
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    np.testing.assert_allclose(robot.pose[:2, :2], [[0.1, -0.2], [0.1, 0.2]])
    np.testing.assert_allclose(robot.z_m[:2], 0.05)
    # A turn about Motive's vertical is the heading: 2 atan(0.6 / 0.8).
    np.testing.assert_allclose(robot.pose[:2, 2], [0, 2 * np.arctan2(0.6, 0.8)])
    assert robot.valid.tolist() == [True, True, False]


def take_of_angles(head, angles):
    """An export with three angles in place of a quaternion."""
    for old, new in (
        ("Rotation,Rotation,Rotation,Rotation", "Rotation,Rotation,Rotation"),
        (",X,X,Y,Z,W,X", ",X,X,Y,Z,X"),
        (",turbopi-04" * 8, ",turbopi-04" * 7),
        (",Rigid Body" * 8, ",Rigid Body" * 7),
        (",B" * 8, ",B" * 7),
    ):
        head = head.replace(old, new)
    rows = "".join(
        f"{k},{k / 100:.3f},1,{x},{y},{z},100,50,200,0.1\n" for k, (x, y, z) in enumerate(angles)
    )
    return head[: head.index("0,0.000")] + rows


@pytest.mark.parametrize("take", [MOTIVE, "\ufeff" + MOTIVE, SAVED_AGAIN])
def test_motive_exports_given_as_a_table_are_told_by_their_option(put, tmp_path, take):
    """A ragged row had been blamed instead."""
    with pytest.raises(LogError, match="is an export of Motive; give it with motive"):
        import_log(put("take.csv", take), put("c.csv", COMMANDS), tmp_path / "o.lcmlog")


def test_motive_euler_angles_are_about_axes_that_turn_with_the_body(put, tmp_path):
    """Yaw about Y first, by the vector that is carried along: turned 90 degrees, then nodding."""
    head = MOTIVE.replace("Quaternion", "YXZ")
    take = take_of_angles(head, [(20, 90 * k, 0) for k in range(3)])
    import_log(None, put("c.csv", COMMANDS), tmp_path / "o.lcmlog", motive=put("take.csv", take))
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    # A nod about the body's own x axis leaves where that axis points.
    np.testing.assert_allclose(robot.pose[:, 2], [0, np.pi / 2, np.pi], atol=1e-9)


def test_motive_exports_of_older_formats_are_read(put, tmp_path):
    """Format 1.21 calls its column Time; angles whose order no file names are X, Y, Z."""
    head = MOTIVE.replace("1.23", "1.21").replace("Time (Seconds)", "Time")
    take = take_of_angles(head.replace("Rotation Type,Quaternion,", ""), [(30, 40, 0)] * 2)
    import_log(None, put("c.csv", COMMANDS), tmp_path / "o.lcmlog", motive=put("take.csv", take))
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    # About X first, then about the new Y, which leans by 30 degrees: the body's x axis then has
    # sin 40 of its length across the first, cos 30 of that in the floor.
    across, along = np.sin(np.radians(40)) * np.cos(np.radians(30)), np.cos(np.radians(40))
    np.testing.assert_allclose(robot.pose[:, 2], np.arctan2(across, along))


def test_motive_bodies_that_are_no_robots_are_left_out_and_named(put, tmp_path):
    take = MOTIVE.replace("turbopi-04,turbopi-04\n", "turbopi-04,box\n")
    types, names, ids, parts, axes = take.splitlines()[2:7]
    wide = [f"{row}{more}" for row, more in zip(
        (types, names, ids, parts, axes),
        (",Rigid Body" * 7, ",box" * 7, ",X" * 7,
         ",Rotation" * 4 + ",Position" * 3, ",X,Y,Z,W,X,Y,Z"), strict=True)]  # fmt: skip
    frames = [row + ",0,0,0,1,5,5,5" for row in MOTIVE.splitlines()[7:]]
    text = "\n".join([*MOTIVE.splitlines()[:2], *wide, *frames, ""])
    done = import_log(None, put("c.csv", COMMANDS), tmp_path / "o.lcmlog",
                      motive=put("take.csv", text))  # fmt: skip
    assert [robot["robot_id"] for robot in done["robots"]] == [4]
    assert "rigid body 'box' gives no robot_id" in done["warnings"][0]


def test_motive_z_up_is_left_as_it_is(put, tmp_path):
    import_log(
        None,
        put("c.csv", COMMANDS.replace(",4,", ",7,")),
        tmp_path / "o.lcmlog",
        motive=put("take.csv", MOTIVE),
        options=ImportOptions(up="z", robots={"turbopi-04": 7}),
    )
    robot = read_log(tmp_path / "o.lcmlog").robots[7]
    np.testing.assert_allclose(robot.pose[:2, :2], [[0.1, 0.05], [0.1, 0.05]])


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("Quaternion", "Matrix", "Rotation Type is 'Matrix'"),
        ("Millimeters", "Inches", "Length Units is 'Inches'"),
        ("Format", "Farmat", "no Motive export"),
        ("Rigid Body", "Bone", "has no rigid body"),
        ("turbopi-04", "robot", r"robot={'robot': 'ID'}"),
        ("Rotation,Position", "Speed,Position", "lacks Rotation W"),
        ("0.010", "0.000", "frame 1 is not later"),
        ("1,100,50,200", "1,100,fifty,200", "row 8: holds no number"),
    ],
)
def test_wrong_motive_export_is_one_sentence(put, tmp_path, old, new, sentence):
    with pytest.raises(LogError, match=sentence):
        import_log(
            None,
            put("c.csv", COMMANDS),
            tmp_path / "o.lcmlog",
            motive=put("take.csv", MOTIVE.replace(old, new)),
        )


IO_TSV = (
    "time_ns\tdetected [0, 1]\tsmoothed_detected [0, 1] (10)\tmoves [(v, d, w), ...]\n"
    "1764947269500000000\t1\t0\t[(100, 90, -0.5)]\n"
    "1764947269533000000\t0\t1\t[(50, 90, 0), (50, 270, 0.0)]\n"
)


def test_io_tsv_goes_with_the_take_of_the_same_hour(put, tmp_path):
    # 1764947269.5 s is 2025-12-05 15:07:49.5 UTC, the capture start above (date -u -d @...).
    import_log(
        None,
        None,
        tmp_path / "o.lcmlog",
        motive=put("take.csv", MOTIVE),
        io_tsv=(put("251205-150749-Milling-turbopi-04/io.tsv", IO_TSV),),
    )
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    assert robot.command_t_s.tolist() == [0, 0.033]
    assert robot.pose_t_s[0] == 0
    np.testing.assert_array_equal(
        np.round(robot.command * 100), [[37, 100, 37, 100], [-50, -49, -49, -50]]
    )
    # The vendor turns clockwise, we count counter-clockwise.
    np.testing.assert_allclose(robot.turn_input, [0.5, 0])
    np.testing.assert_allclose(robot.speed_input, [100, -50])
    assert (robot.detected_raw.tolist(), robot.detected.tolist()) == ([1, 0], [0, 1])
    assert (robot.mode == 1).all()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[(100, 90, -0.5)]", "[(100, 90)]", r"row 2: .* list of moves"),
        ("[(100, 90, -0.5)]", "__import__('os')", r"row 2: .* list of moves"),
        ("533000000", "400000000", r"row 3: .*not later"),
        ("smoothed_detected", "smooth", "the header is"),
    ],
)
def test_wrong_io_tsv_is_one_sentence(put, tmp_path, old, new, sentence):
    with pytest.raises(LogError, match=sentence):
        import_log(
            None,
            None,
            tmp_path / "o.lcmlog",
            motive=put("take.csv", MOTIVE),
            io_tsv=(put("turbopi-04/io.tsv", IO_TSV.replace(old, new)),),
        )


def test_recorded_straight_runs_come_back_whole(data_dir, tmp_path):
    folder = data_dir / "turbopi_optitrack_straight"
    table = np.genfromtxt(folder / "poses.csv", delimiter=",", names=True)
    summary = import_log(folder / "poses.csv", folder / "commands.csv", tmp_path / "o.lcmlog")
    robot = read_log(tmp_path / "o.lcmlog").robots[1]
    np.testing.assert_array_equal(robot.pose[:, 0], table["x_m"])
    np.testing.assert_allclose(robot.pose_t_s, table["t_s"], atol=1e-9)
    assert summary["robots"][0]["poses_valid"] == np.count_nonzero(table["valid"])
    # The rigid body was defined facing backward: +100 duty moves it against its x axis.
    assert any("180 degrees" in text for text in summary["warnings"])


def test_recorded_mecanum_poses_import_with_a_renamed_column(data_dir, put, tmp_path):
    path = data_dir / "mecanum_optiodom" / "square_080920201810_run-01_mocap.csv.gz"
    table = np.genfromtxt(path, delimiter=",", names=True)
    commands = "t_s,w1_radps,w2_radps,w3_radps,w4_radps\n0,0,0,0,0\n1,1,1,1,1\n"
    import_log(
        path,
        put("c.csv", commands),
        tmp_path / "o.lcmlog",
        options=ImportOptions(rename={"yaw_rad": "theta_rad"}, robot_id=1),
    )
    robot = read_log(tmp_path / "o.lcmlog").robots[1]
    np.testing.assert_array_equal(robot.valid, np.isfinite(table["x_m"]))
    np.testing.assert_array_equal(robot.pose[:, 1], table["y_m"])


def run_command(*arguments):
    return CliRunner().invoke(app, ["import", *map(str, arguments)])


def test_command_prints_one_json_object(put, tmp_path):
    result = run_command(
        "--poses",
        put("p.csv", POSES),
        "--commands",
        put("c.csv", COMMANDS),
        "--out",
        tmp_path / "o.lcmlog",
        "--json",
    )
    summary = json.loads(result.stdout)
    assert summary["robots"] == [
        {
            "robot_id": 4,
            "command_kind": "duty",
            "commands": 46,
            "command_rows": 2,
            "command_changes": 1,
            "poses": 3,
            "poses_valid": 3,
        }
    ]
    assert summary["duration_s"] == 1.0 and summary["out"].endswith("o.lcmlog")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "a log needs one source of poses"),
        (["--rename", "yaw"], "--rename yaw: must have the form OLD=NEW"),
        (["--robot", "a=b"], "'b' is no robot number"),
        (["--up", "w"], "--up w: must be x, y or z"),
    ],
)
def test_wrong_options_are_one_sentence_on_stderr(twinmill, tmp_path, arguments, sentence):
    code, out, err = twinmill("import", "--out", tmp_path / "o.lcmlog", *arguments)
    assert code == 1 and not out
    assert sentence in err and err.count("\n") == 1
