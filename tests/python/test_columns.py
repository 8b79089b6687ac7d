# SPDX-License-Identifier: Apache-2.0
"""Tables as people have them: units, usual names, order of rows, and the mapping file."""

import re
import shlex

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import app

POSES = "t_s,robot_id,x_m,y_m,theta_rad\n0,4,0,0,0\n1,4,0.5,0.25,0.5\n2,4,1,0.5,1\n"
COMMANDS = "t_s,robot_id,fl_pct,fr_pct,rl_pct,rr_pct\n0,4,10,20,30,40\n"


@pytest.fixture
def imported(tmp_path):
    """The robot 4 of a log made from two texts; its warnings."""

    def make(poses=POSES, commands=COMMANDS, **options):
        (tmp_path / "p.csv").write_text(poses)
        (tmp_path / "c.csv").write_text(commands)
        summary = import_log(
            tmp_path / "p.csv",
            tmp_path / "c.csv",
            tmp_path / "o.lcmlog",
            options=ImportOptions(force=True, **options),
        )
        return read_log(tmp_path / "o.lcmlog").robots[4], summary["warnings"]

    return make


def test_a_unit_in_a_name_is_converted(imported):
    robot, _ = imported(
        "t_ms,robot_id,x_mm,y_cm,theta_deg\n0,4,0,0,0\n1000,4,500,25,90\n2000,4,1000,50,180\n"
    )
    np.testing.assert_allclose(robot.pose_t_s, [0, 1, 2])
    np.testing.assert_allclose(robot.pose[:, :2], [[0, 0], [0.5, 0.25], [1, 0.5]])
    np.testing.assert_allclose(robot.pose[:, 2], [0, np.pi / 2, np.pi])


def test_a_new_name_may_have_another_unit(imported):
    robot, _ = imported(POSES.replace("theta_rad", "yaw"), rename={"yaw": "theta_deg"})
    np.testing.assert_allclose(robot.pose[:, 2], np.radians([0, 0.5, 1]))


def test_all_names_without_a_unit_are_asked_about_at_once(imported):
    poses = POSES.replace("x_m,y_m,theta_rad", "x,y,yaw")
    with pytest.raises(LogError, match=r"columns 'x' .*, 'y' .*, 'yaw' .* have no unit") as told:
        imported(poses)
    rename = {"x": "x_m", "y": "y_m", "yaw": "theta_rad"}
    assert str(rename) in str(told.value)
    robot, _ = imported(poses, rename=rename)
    np.testing.assert_array_equal(robot.pose, imported(POSES)[0].pose)


@pytest.mark.parametrize(
    ("column", "usual", "looks"), [("theta_rad", "yaw", "radians"), ("x_m", "x", "m")]
)
def test_a_name_without_a_unit_is_asked_about(imported, column, usual, looks):
    with pytest.raises(LogError, match=f"'{usual}' .*looks like {looks}.* no unit"):
        imported(POSES.replace(column, usual))


@pytest.mark.parametrize(
    ("column", "new", "target"),
    [
        ("x_m", "pose.x", "x_m"),
        ("theta_rad", "/turtle1/pose/theta", "theta_rad"),
        ("t_s", "%time", "t_s"),
    ],
)
def test_fields_of_messages_without_units_are_asked_about(imported, column, new, target):
    with pytest.raises(LogError, match=f"column '{re.escape(new)}' .*rename=.*{target}"):
        imported(POSES.replace(column, new))


@pytest.mark.parametrize(
    "path", ["pose.position.x", "field.pose.pose.position.x", "/a/transform/translation/x"]
)
def test_places_in_messages_are_in_metres(imported, path):
    """REP 103, "Units"; the topic does not matter."""
    robot, _ = imported(POSES.replace("x_m", path).replace("y_m", f"{path[:-1]}y"))
    expected, _ = imported(POSES)
    np.testing.assert_array_equal(robot.pose, expected.pose)


def test_velocities_of_the_room_are_asked_about_as_such(imported):
    rows = "t_s,robot_id,vx_world,vy_world\n0,4,0.1,0.2\n"
    with pytest.raises(
        LogError, match=r"'vx_world' .* no unit; .*rename={'vx_world': 'vx_world_mps', "
    ):
        imported(commands=rows)


@pytest.mark.parametrize(
    ("column", "rest", "ahead", "back"),
    [("left_pwm", 128, 192, 0), ("left", 90, 135, 0), ("left", 1500, 1750, 1000)],
    ids=["a byte", "a servo by its angle", "a servo by its pulse in us"],
)
def test_duties_about_a_middle_are_asked_about_and_kept(
    imported, tmp_path, monkeypatch, column, rest, ahead, back
):
    """Half ahead, then all back: 0.5 and -1 of full duty, and standstill is nothing at all."""
    monkeypatch.chdir(tmp_path)
    right = column.replace("left", "right")
    rows = [f"{k},{v},{v}\n" for k, v in enumerate((ahead, rest, back, rest))]
    commands = f"t_s,{column},{right}\n" + "".join(rows)
    with pytest.raises(LogError, match=f"ends at {rest}, so it looks as if that were standstill"):
        imported(commands=commands)
    options = ["--poses", "p.csv", "--commands", "c.csv", "--explain-columns", "m.toml"]
    assert CliRunner().invoke(app, ["import", *options]).exit_code == 0
    robot, _ = imported(commands=commands, mapping=tmp_path / "m.toml")
    told = robot.command[np.searchsorted(robot.command_t_s, [0, 1, 2, 3])]
    np.testing.assert_allclose(told[:, 0], [0.5, 0, -1, 0], atol=0.005)
    assert not told[[1, 3]].any()


@pytest.mark.parametrize(
    ("ahead", "back", "looks"),
    [("0.5", "-1", "a share of full duty"), ("1750", "1000", "pulses about 1500 us")],
)
def test_duties_that_do_not_fit_the_unit_in_their_name_are_asked_about(
    imported, tmp_path, monkeypatch, ahead, back, looks
):
    """Half ahead, then all back, of what is called PWM."""
    monkeypatch.chdir(tmp_path)
    commands = f"t_s,left_pwm,right_pwm\n0,{ahead},{back}\n1,{back},{ahead}\n"
    with pytest.raises(LogError, match=f"'left_pwm' .*looks like {looks}"):
        imported(commands=commands)
    options = ["--poses", "p.csv", "--commands", "c.csv", "--explain-columns", "m.toml"]
    assert CliRunner().invoke(app, ["import", *options]).exit_code == 0
    robot, _ = imported(commands=commands, mapping=tmp_path / "m.toml")
    np.testing.assert_allclose(robot.command[0], [0.5, -1, 0.5, -1])


def _mapped(imported, tmp_path, monkeypatch, poses, **factors):
    """The robot of a table as `--explain-columns` maps it, with the factors that it asks for."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.csv").write_text(poses)
    files = ["import", "--poses", "p.csv", "--explain-columns", "m.toml", "--force"]
    assert CliRunner().invoke(app, files).exit_code == 0
    mapping = tmp_path / "m.toml"
    given = [f'{name} = {{column = "{name}"}}\n' for name in COMMANDS.split("\n")[0].split(",")]
    text = mapping.read_text()
    for column, factor in factors.items():
        text = text.replace(f'"{column}", factor = nan', f'"{column}", factor = {factor}')
    mapping.write_text(text + "[commands]\n" + "".join(given))
    return imported(poses, mapping=mapping, robot_id=4)


def test_x_and_y_have_one_unit(imported, tmp_path, monkeypatch):
    """A corridor in millimetres: 900 mm along, 8 mm across."""
    rows = "".join(f"{k},{100 * k},{k % 2 * 8},0\n" for k in range(10))
    robot, _ = _mapped(imported, tmp_path, monkeypatch, "t,x,y,yaw\n" + rows)
    np.testing.assert_allclose(np.ptp(robot.pose[:, :2], axis=0), [0.9, 0.008])


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_the_order_of_numbered_quaternions_is_told_by_a_level_robot(
    imported, tmp_path, monkeypatch, order
):
    heading = np.linspace(0, 3, 10)
    part = dict(zip("wxyz", (np.cos(heading / 2), 0.01, -0.01, np.sin(heading / 2)), strict=True))
    rows = np.column_stack(
        [np.arange(10), 0.1 * np.arange(10), np.arange(10), *(part[c] + 0 * heading for c in order)]
    )
    table = "t,x,y,q0,q1,q2,q3\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    robot, _ = _mapped(imported, tmp_path, monkeypatch, table)
    np.testing.assert_allclose(robot.pose[:, 2], heading, atol=1e-3)


def test_pixels_and_frames_ask_for_the_number_that_no_table_has(imported, tmp_path, monkeypatch):
    """350 px a metre, 25 frames a second."""
    rows = "".join(f"{k},{35 * k},{7 * k},0\n" for k in range(10))
    table = "frame,x_px,y_px,yaw_rad\n" + rows
    with pytest.raises(LogError, match=r"x_m: has no factor yet; .* metres .* a pixel"):
        _mapped(imported, tmp_path, monkeypatch, table, frame=0.04)
    scale = {"frame": 0.04, "x_px": 1 / 350, "y_px": 1 / 350}
    robot, _ = _mapped(imported, tmp_path, monkeypatch, table, **scale)
    np.testing.assert_allclose(robot.pose_t_s, 0.04 * np.arange(10), atol=1e-6)
    np.testing.assert_allclose(robot.pose[9, :2], [0.9, 0.18])


def test_a_count_of_frames_is_no_time_by_any_of_its_names(imported):
    """Frames without the robot are missing, as of SLEAP: 25 a second, of which 3 to 7 are lost."""
    rows = "".join(f"{k},{0.01 * k},0,0\n" for k in (0, 1, 2, 8, 9))
    for name in ("frame_idx", "frameNumber", "Image_No"):
        for rename in ({}, {name: "t_s"}):
            with pytest.raises(LogError, match=f"'{name}' is a count of frames"):
                imported(f"{name},x_m,y_m,theta_rad\n" + rows, robot_id=4, rename=rename)


def test_stamps_coarser_than_frames_are_told_as_such(imported):
    """Whole seconds of frames at 5 Hz, too few to tell a beat: 8 of 10 are under another's."""
    rows = "".join(f"{k // 5},4,{0.01 * k},0,0\n" for k in range(10))
    robot, warnings = imported(POSES.splitlines()[0] + "\n" + rows)
    assert any("8 of 10 rows repeat a stamp" in w and "coarser" in w for w in warnings)
    np.testing.assert_allclose(robot.pose[:, 0], [0.04, 0.09])


def test_half_a_quaternion_is_no_heading_that_was_not_recorded(imported):
    with pytest.raises(LogError, match="column qw is missing"):
        imported(POSES.replace("theta_rad", "qz"))


@pytest.mark.parametrize("lost", ["null", "None", "NaN", "N/A", ""])
def test_words_for_a_lost_measurement_are_none(imported, lost):
    robot, _ = imported(POSES.replace("1,4,0.5,0.25,0.5", f"1,4,{lost},{lost},{lost}"))
    assert robot.valid.tolist() == [True, False, True]


def test_no_column_is_proposed_for_another_quantity(imported):
    with pytest.raises(LogError, match=r"x_m is missing; add it, or say which of vx_mps, u, "):
        imported("t_s,robot_id,vx_mps,u,y_m,q\n0,4,0,0,0,0\n")


def test_directions_beside_duties_are_not_dropped(imported):
    """An Arduino's way: how much, and which way."""
    rows = "t_s,left_pwm,left_dir,right_pwm,right_dir\n0,100,1,100,0\n"
    with pytest.raises(LogError, match="'left_dir' is a direction, and our duties have signs"):
        imported(commands=rows)


def test_forward_duties_that_stop_at_zero_are_no_middle(imported):
    rows = "0,255,255\n1,128,128\n2,0,0\n3,64,64\n4,0,0\n"
    robot, _ = imported(commands="t_s,left_pwm,right_pwm\n" + rows)
    np.testing.assert_allclose(robot.command[:2, 0], [1, 128 / 255])


def test_time_without_a_unit_looks_the_same_in_any_order_of_rows(imported):
    rows = [f"{0.02 * k:.2f},4,{k},0,0\n" for k in np.random.default_rng(1).permutation(200)]
    with pytest.raises(LogError, match=r"rows are 0\.02 apart, so it looks like s"):
        imported("time,robot_id,x_m,y_m,theta_rad\n" + "".join(rows))


def test_commands_without_a_robot_are_of_the_only_one_that_has_poses(imported):
    robot, _ = imported(commands=COMMANDS.replace("robot_id,", "").replace(",4,", ","))
    np.testing.assert_allclose(robot.command[0], [0.1, 0.2, 0.3, 0.4])
    two = POSES + POSES.split("\n", 1)[1].replace(",4,", ",5,")
    with pytest.raises(LogError, match="column robot_id is missing"):
        imported(two, commands=COMMANDS.replace("robot_id,", "").replace(",4,", ","))


def test_a_column_id_that_holds_names_is_asked_about(imported):
    with pytest.raises(LogError, match=r"'id' \(holds names\) .* may be robot_id"):
        imported(POSES.replace("robot_id", "id").replace(",4,", ",bot4,"))


def test_a_robot_without_a_valid_pose_is_named(tmp_path):
    poses = POSES + "0,5,nan,nan,nan\n1,5,nan,nan,nan\n"
    (tmp_path / "p.csv").write_text(poses)
    (tmp_path / "c.csv").write_text(COMMANDS + "0,5,10,20,30,40\n")
    done = import_log(tmp_path / "p.csv", tmp_path / "c.csv", tmp_path / "o.lcmlog")
    assert any(w.startswith("robot 5: 0 of its 2 poses are valid") for w in done["warnings"])


def test_rows_out_of_order_and_repeated_stamps_are_put_right_and_said(imported):
    robot, warnings = imported(
        "t_s,robot_id,x_m,y_m,theta_rad\n1,4,1,0,0\n0,4,0,0,0\n1,4,9,0,0\n-0.5,4,-1,0,0\n"
    )
    np.testing.assert_allclose(robot.pose[:, 0], [-1, 0, 9])
    assert any("2 rows earlier" in w for w in warnings)
    assert any("1 of 4 rows repeats a stamp" in w for w in warnings)


STAMPS_S = np.round(0.02 * np.arange(200), 2)  # of poses; a command is told each half second
TOLD_S = 0.5 * np.arange(8)


def _tables(stamps_s=STAMPS_S, told_s=TOLD_S):
    """Poses that move by 1 mm a frame, and another velocity each time."""
    poses = [f"{t:.10g},4,{0.001 * k:g},0,0" for k, t in enumerate(stamps_s)]
    told = [f"{t:.10g},4,{0.01 * k:g},0,0" for k, t in enumerate(told_s)]
    return [POSES.splitlines()[0], *poses], ["t_s,robot_id,vx_mps,vy_mps,omega_radps", *told]


def _text(lines):
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("stamp_s", [-1.5, 91.5, 1e15])
def test_a_damaged_stamp_is_named_by_its_row_and_left_out(imported, stamp_s):
    """A sign, a digit before it, or all of it: 1e15 s are no unit of all the others."""
    told_s, stamps_s = TOLD_S.copy(), STAMPS_S.copy()
    told_s[3] = stamps_s[50] = stamp_s
    poses, commands = _tables(stamps_s, told_s)
    robot, warnings = imported(_text(poses), _text(commands))
    np.testing.assert_allclose(robot.pose_t_s, np.delete(STAMPS_S, 50), atol=1e-6)
    np.testing.assert_allclose(robot.command_t_s, np.delete(TOLD_S, 3), atol=1e-6)
    for name, row in (("c.csv", 5), ("p.csv", 52)):
        (said,) = (w for w in warnings if w.startswith(name))
        assert f"row {row} (" in said and "damaged; left out" in said


def test_a_first_and_a_last_command_that_are_held_for_long_are_kept(imported):
    told_s = np.concatenate([[-30.0], TOLD_S, [40.0]])
    poses, commands = _tables(told_s=told_s)
    robot, warnings = imported(_text(poses), _text(commands))
    assert len(robot.command_t_s) == len(told_s)
    assert not any("damaged" in w for w in warnings)


def test_rows_that_are_written_twice_count_once(imported):
    """Stamps that stand twice with equal values are no jitter about a beat twice as fast."""
    poses, commands = _tables()
    twice = [poses[0], *(row for row in poses[1:] for _ in range(2))]
    robot, warnings = imported(_text(twice), _text(commands))
    np.testing.assert_allclose(robot.pose_t_s, STAMPS_S, atol=1e-6)
    assert any("200 rows repeat another's stamp and values" in w for w in warnings)
    assert not any("jitter" in w for w in warnings)


def test_signs_drift_and_shift_are_taken_out(imported):
    robot, _ = imported(flips={None: frozenset({"y_m", "fl_pct"})})
    np.testing.assert_allclose(robot.pose[:, 1], [0, -0.25, -0.5])
    np.testing.assert_allclose(robot.command[0] * 100, [-10, 20, 30, 40])
    robot, _ = imported(pose_clock_ppm=1000)
    np.testing.assert_allclose(np.diff(robot.pose_t_s), 1 / 1.001, atol=1e-6)


def test_columns_are_explained_and_the_mapping_kept(tmp_path, monkeypatch):
    poses, commands = tmp_path / "p.csv", tmp_path / "c.csv"
    rows = [f"{k * 50},{k * 20},{k},{k * 2}" for k in range(60)]
    poses.write_text("time,X,Y,yaw\n" + "\n".join(rows) + "\n")
    commands.write_text("time,left,right\n0,-255,255\n1000,127.5,0\n")
    mapping = tmp_path / "m.toml"
    files = ["import", "--poses", str(poses), "--commands", str(commands)]
    result = CliRunner().invoke(app, [*files, "--explain-columns", str(mapping)])
    assert result.exit_code == 0, result.output
    words = " ".join(result.output.split())
    assert "looks like mm" in words and "PWM of 255" in words
    # What it prints runs as it is, with a robot for tables that name none.
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, shlex.split(result.output.splitlines()[-1])[1:])
    assert result.exit_code == 0, result.output
    (robot,) = read_log(tmp_path / "run.lcmlog").robots.values()
    np.testing.assert_allclose(robot.pose_t_s[1], 0.05)
    np.testing.assert_allclose(robot.pose[-1, 0], 1.18)
    np.testing.assert_allclose(robot.pose[-1, 2], np.radians(118))
    np.testing.assert_allclose(robot.command[[0, -1]], [[-1, 1, -1, 1], [0.5, 0, 0.5, 0]])


def test_names_that_mean_nothing_to_us_are_asked_for(imported, tmp_path):
    """As they stand no import can come of them, so none is proposed before they are named."""
    strange = "t_s,robot_id,fahr,dreh\n0,4,0.2,0.5\n1,4,0,0\n"
    with pytest.raises(LogError, match=r"no column is known to be a command .*fahr, dreh.*rename"):
        imported(commands=strange)
    robot, _ = imported(commands=strange, rename={"fahr": "vx_mps", "dreh": "omega_radps"})
    np.testing.assert_allclose(robot.command[0], [0.2, 0, 0.5, 0])
    files = ["--commands", str(tmp_path / "c.csv"), "--explain-columns", str(tmp_path / "m.toml")]
    result = CliRunner().invoke(app, ["import", *files])
    assert 'write under [commands] what its columns hold, as in vx_mps = { column = "fahr"' in (
        " ".join(result.output.split())
    )


@pytest.mark.parametrize(
    ("text", "example"),
    [(",t_s,x,y_m,fahr\n0,0,1,2,3\n", "fahr"), ("Unnamed: 0,t_s,x,y_m,who\n0,0,1,2,R\n", None)],
)
def test_no_column_that_is_known_is_the_example_of_one_that_is_not(text, example, tmp_path):
    """Poses that were given as commands, with pandas' index before them."""
    (tmp_path / "c.csv").write_text(text)
    files = ["--commands", str(tmp_path / "c.csv"), "--explain-columns", str(tmp_path / "m.toml")]
    result = CliRunner().invoke(app, ["import", *files])
    assert result.exit_code == 0, result.output
    told = " ".join(result.output.split())
    assert "write under [commands] what its columns hold" in told
    assert re.findall(r'{ column = "(.*?)"', told) == ([example] if example else [])


def test_a_speed_and_a_turn_make_a_velocity_command(tmp_path):
    (tmp_path / "p.csv").write_text(POSES)
    (tmp_path / "c.csv").write_text("time,v,w\n0,0.2,0.5\n1.5,-0.2,0\n")
    mapping = tmp_path / "m.toml"
    mapping.write_text(
        "[poses]\n"
        + "".join(f"{n} = {{column='{n}'}}\n" for n in POSES.split("\n")[0].split(","))
        + "[commands]\nt_s = {column='time'}\nrobot_id = {value=4}\nvx_mps = {column='v'}\n"
        + "vy_mps = {value=0}\nomega_radps = {column='w'}\n"
    )
    import_log(
        tmp_path / "p.csv",
        tmp_path / "c.csv",
        tmp_path / "o.lcmlog",
        options=ImportOptions(mapping=mapping),
    )
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    np.testing.assert_allclose(robot.command, [[0.2, 0, 0.5, 0], [-0.2, 0, 0, 0]])


@pytest.mark.parametrize(
    "text", ["x_m = 3", 'x_m = {colum="x"}', 'zz = {column="x"}', "x_m = {value='a'}", "["]
)
def test_a_mapping_that_makes_no_sense_is_refused_in_a_sentence(imported, tmp_path, text):
    (tmp_path / "m.toml").write_text(f"[poses]\n{text}\n")
    with pytest.raises(LogError, match=r"m\.toml: .*; (correct it|check the name)\.$"):
        imported(mapping=tmp_path / "m.toml")


@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "cp1252", "utf-8-sig"])
def test_files_of_other_programs_encodings_are_read(tmp_path, encoding, marked):
    """As Motive, Excel and Windows' editor save them, with their marks or none."""
    marks = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}
    mark = marks.get(encoding, b"") if marked else b""
    text = POSES.replace("theta_rad", "Winkel (°)")
    (tmp_path / "p.csv").write_bytes(mark + text.encode(encoding))
    (tmp_path / "c.csv").write_bytes(mark + COMMANDS.encode(encoding))
    import_log(tmp_path / "p.csv", tmp_path / "c.csv", tmp_path / "o.lcmlog")
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    np.testing.assert_allclose(robot.pose[:, 2], np.radians([0, 0.5, 1]))


@pytest.mark.parametrize(
    "units", ["ms,-,mm,cm,deg", "[ms],,[mm],[cm],[°]", "(ms), 1 ,(mm),(cm),(Grad)"]
)
def test_a_row_of_units_below_the_names_is_read(imported, units):
    robot, warnings = imported(
        f"t,robot_id,x,y,heading\n{units}\n0,4,0,0,0\n1000,4,500,25,90\n2000,4,1000,50,180\n"
    )
    np.testing.assert_allclose(robot.pose_t_s, [0, 1, 2])
    np.testing.assert_allclose(robot.pose[:, :2], [[0, 0], [0.5, 0.25], [1, 0.5]])
    np.testing.assert_allclose(robot.pose[:, 2], [0, np.pi / 2, np.pi])
    assert any("taken for their units" in w for w in warnings)


def test_a_first_row_that_is_broken_is_no_row_of_units(imported):
    with pytest.raises(LogError, match=r"row 2: t_s is 'start', not a number"):
        imported("t_s,robot_id,x_m,y_m,theta_rad\nstart,4,m,0,0\n1,4,0,0,0\n2,4,0,0,0\n")


def test_german_names_are_asked_about_and_kept(tmp_path):
    poses, commands = tmp_path / "p.csv", tmp_path / "c.csv"
    rows = [f"{k / 20:g};{k * 20};{k};{k * 2}" for k in range(60)]
    poses.write_text("Zeit;X;Y;Winkel\n" + "\n".join(rows).replace(".", ",") + "\n")
    commands.write_text("Zeit;VL;VR;HL;HR\n0;0,5;-1;0,25;1\n2;0;0;0;0\n")
    with pytest.raises(LogError, match=r"'Zeit' .* no unit; .*explain_columns"):
        import_log(poses, commands, tmp_path / "o.lcmlog", options=ImportOptions(robot_id=4))
    mapping = tmp_path / "m.toml"
    files = ["import", "--poses", str(poses), "--commands", str(commands)]
    result = CliRunner().invoke(app, [*files, "--explain-columns", str(mapping)])
    assert result.exit_code == 0, result.output
    options = ImportOptions(robot_id=4, mapping=mapping)
    import_log(poses, commands, tmp_path / "o.lcmlog", options=options)
    robot = read_log(tmp_path / "o.lcmlog").robots[4]
    np.testing.assert_allclose(robot.command[0], [0.5, -1, 0.25, 1])
    np.testing.assert_allclose(robot.pose[-1, 2], np.radians(118))


@pytest.mark.parametrize(
    "names",
    ["r1_x_m,r1_y_m,r2_x_m,r2_y_m", "robot1.x_m,robot1.y_m,robot2.x_m,robot2.y_m", "x1,y1,x2,y2"],
)
def test_robots_side_by_side_are_read_one_by_one(tmp_path, names):
    """One drives along x, the other along y; the second is hidden once."""
    rows = ["0,0,1,5,0", "1,0.1,1,,", "2,0.2,1,5,0.4"]
    (tmp_path / "p.csv").write_text("\n".join([f"t_s,{names}", *rows]) + "\n")
    told = "t_s,r1_vx_mps,r1_omega_radps,r2_vx_mps,r2_omega_radps\n0,1,2,3,4\n"
    (tmp_path / "c.csv").write_text(told)
    given = {"x": "x_m", "y": "y_m"} if names == "x1,y1,x2,y2" else {}
    options = ImportOptions(rename=given)
    import_log(tmp_path / "p.csv", tmp_path / "c.csv", tmp_path / "o.lcmlog", options=options)
    robots = read_log(tmp_path / "o.lcmlog").robots
    np.testing.assert_allclose(robots[1].pose[:, :2], [[0, 1], [0.1, 1], [0.2, 1]])
    np.testing.assert_allclose(robots[2].pose[robots[2].valid, :2], [[5, 0], [5, 0.4]])
    np.testing.assert_allclose(robots[2].command[0], [3, 0, 4, 0])


def test_columns_with_numbers_that_are_no_robots_stay(imported):
    wheels = "t_s,robot_id,w1_radps,w2_radps,w3_radps,w4_radps\n0,4,1,2,3,4\n"
    for table in (wheels, wheels.replace("robot_id,", "").replace(",4,", ",", 1)):
        robot, warnings = imported(commands=table)
        np.testing.assert_allclose(robot.command[0], [1, 2, 3, 4])
        assert not any("side by side" in w for w in warnings)


def test_an_index_that_pandas_writes_without_a_name_is_the_time_if_it_holds_dates(imported):
    """`DataFrame.to_csv` of rows by a DatetimeIndex; rows by numbers say nothing of time."""
    stamps = pd.date_range("2026-01-05 10:00:30", periods=3, freq="20ms", tz="Europe/Berlin")
    frame = pd.DataFrame({"x_m": [0.0, 0.1, 0.2], "y_m": 0.0, "theta_rad": 0.0, "robot_id": 4})
    told = COMMANDS.replace("\n0,4", "\n2026-01-05T09:00:30Z,4")
    robot, said = imported(frame.set_index(stamps).to_csv(), told)
    np.testing.assert_allclose(np.diff(robot.pose_t_s), 0.02, atol=2e-6)
    assert any("first column has no name; taken for the time" in w for w in said)
    for index in (frame.index, stamps):  # beside a time of its own
        robot, _ = imported(frame.assign(t_s=[0.0, 0.5, 1.0]).set_index(index).to_csv())
        np.testing.assert_allclose(np.diff(robot.pose_t_s), 0.5, atol=2e-6)
    with pytest.raises(
        LogError, match=r"column t_s is missing.*that Unnamed: 0 holds it: .*Unnamed"
    ):
        imported(frame.set_index(pd.Index([0.0, 0.1, 0.2])).to_csv())


def test_a_robot_that_stops_when_it_hears_nothing_stands_until_the_next_command(imported):
    """As diff_drive_controller does by its `cmd_vel_timeout`: driven by hand, key by key."""
    rows = ((0, 0.2), (0.3, 0.1), (1.4, -0.2))
    told = "t_s,robot_id,vx_mps,vy_mps,omega_radps\n"
    told += "".join(f"{t_s},4,{vx_mps},0,0\n" for t_s, vx_mps in rows)
    robot, said = imported(commands=told, command_timeout_s=0.5)
    np.testing.assert_allclose(robot.command_t_s, [0, 0.3, 0.8, 1.4, 1.9], atol=2e-6)
    np.testing.assert_allclose(robot.command[:, 0], [0.2, 0.1, 0, -0.2, 0])
    assert any("robot 4: stopped 2 times, 0.5 s after" in words for words in said)
    held, _ = imported(commands=told)
    np.testing.assert_allclose(held.command[:, 0], [0.2, 0.1, -0.2])
    with pytest.raises(LogError, match=r"command_timeout_s=0: must be a time above 0 s"):
        imported(commands=told, command_timeout_s=0)
