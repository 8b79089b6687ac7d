# SPDX-License-Identifier: Apache-2.0
"""Tables of other people: what is not sure is refused or said, what is obvious is read."""

import csv
import math

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import app

T_S = np.arange(0, 30, 0.04)
FORWARD_MPS, TURN_RADPS = 0.3, 0.5
NOISE = np.random.default_rng(4).normal(0, 1e-5, (3, len(T_S)))


def _driven() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Robot 4 as its commands say: straight, a left curve, straight, a right curve, and so on."""
    t_s = np.arange(0, 30, 0.1)
    turn = TURN_RADPS * np.array([0, 1, 0, -1])[(t_s // 1.5).astype(int) % 4]
    forward = np.where(t_s % 9 < 1, 0, FORWARD_MPS)
    fine_s = np.arange(0, 30, 0.001)
    row = np.minimum((fine_s / 0.1 + 1e-9).astype(int), len(t_s) - 1)
    theta = np.cumsum(turn[row]) * 0.001
    place = np.cumsum(forward[row] * np.exp(1j * theta)) * 0.001
    k = np.round(T_S / 0.001).astype(int)
    poses = pd.DataFrame(
        {
            "t_s": T_S,
            "robot_id": 4,
            "x_m": place.real[k] + NOISE[0],
            "y_m": place.imag[k] + NOISE[1],
            "theta_rad": np.angle(np.exp(1j * (theta[k] + NOISE[2]))),
        }
    )
    commands = pd.DataFrame(
        {"t_s": t_s, "robot_id": 4, "vx_mps": forward, "vy_mps": 0.0, "omega_radps": turn}
    )
    return poses, commands


POSES, COMMANDS = _driven()


@pytest.fixture
def imported(tmp_path):
    """Result of two tables: the robots of the log, and the warnings."""

    def make(poses=POSES, commands=COMMANDS, options=None, **how):
        for name, table in (("p.csv", poses), ("c.csv", commands)):
            if isinstance(table, bytes):
                (tmp_path / name).write_bytes(table)
            else:
                table.to_csv(tmp_path / name, index=False, **how)
        out = tmp_path / "o.lcmlog"
        out.unlink(missing_ok=True)
        files = tmp_path / "p.csv", tmp_path / "c.csv"
        summary = import_log(*files, out, options=ImportOptions(**(options or {})))
        return read_log(out).robots, summary["warnings"]

    return make


def _same_poses(robot, poses=POSES):
    np.testing.assert_allclose(robot.pose_t_s - robot.pose_t_s[0], poses.t_s, atol=2e-6)
    np.testing.assert_allclose(robot.pose[:, :2], poses[["x_m", "y_m"]], atol=1e-9)
    np.testing.assert_allclose(robot.pose[:, 2], np.unwrap(poses.theta_rad), atol=1e-9)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (pd.DataFrame({"x_mm": POSES.x_m * 1000 + 7}), "'x_m' and 'x_mm' hold one quantity"),
        (pd.DataFrame({"x_m": POSES.x_m + 5}), "two columns are called 'x_m'"),
        (pd.DataFrame({"X [cm]": POSES.x_m}), r"'x_m' and 'X \[cm\]' hold one quantity"),
    ],
)
def test_two_columns_of_one_quantity_are_refused(imported, more, why):
    with pytest.raises(LogError, match=why):
        imported(pd.concat([POSES, more], axis=1))


@pytest.mark.parametrize(
    ("rename", "why"),
    [
        ({"nope": "x_m"}, r"rename={'nope': 'x_m'}: no table has a column 'nope' \(p\.csv has t_s"),
        ({"x_m": "foo"}, "foo is not one of our columns"),
        ({"x_m": "theta_deg"}, "m is no unit of what theta_deg holds"),
    ],
)
def test_a_rename_that_makes_no_sense_is_refused(imported, rename, why):
    with pytest.raises(LogError, match=why):
        imported(options={"rename": rename})


@pytest.mark.parametrize("new", ["theta_rad", "theta_deg"])
def test_a_unit_in_the_old_name_is_converted_and_said(imported, new):
    poses = POSES.drop(columns="theta_rad").assign(bearing_deg=np.degrees(POSES.theta_rad))
    robots, warnings = imported(poses, options={"rename": {"bearing_deg": new}})
    _same_poses(robots[4])
    assert any("converted to theta_rad" in w for w in warnings) == (new == "theta_rad")


def test_the_advice_for_a_strange_name_works_as_printed(imported):
    poses = POSES.drop(columns="theta_rad").assign(rot_deg=np.degrees(POSES.theta_rad))
    with pytest.raises(LogError, match=r"rename={'rot_deg': 'theta_deg'}"):
        imported(poses)
    _same_poses(imported(poses, options={"rename": {"rot_deg": "theta_deg"}})[0][4])


@pytest.mark.parametrize(("top", "new"), [(255, "left_pwm"), (80, "left_pct"), (0.5, "left_unit")])
def test_the_advice_for_a_name_without_a_unit_is_the_unit_that_it_looks_like(imported, top, new):
    rows = pd.DataFrame({"t_s": [0.0, 1, 2], "robot_id": 4, "left": top, "right_pct": 50})
    with pytest.raises(LogError, match=f"rename={{'left': '{new}'}} "):
        imported(commands=rows)
    robot = imported(commands=rows, options={"rename": {"left": new}})[0][4]
    assert robot.command[-1, 0] == pytest.approx({255: 1, 80: 0.8, 0.5: 0.5}[top], abs=1e-6)


def test_wrong_units_are_named_before_any_advice_on_the_heading(imported):
    degrees = POSES.assign(theta_rad=np.degrees(POSES.theta_rad))
    _, warnings = imported(degrees)
    assert any("the headings are in degrees" in w for w in warnings)
    assert not any("--heading-offset-deg" in w for w in warnings)
    _, warnings = imported(POSES.assign(x_m=POSES.x_m * 1000, y_m=POSES.y_m * 1000))
    assert any("the positions are in mm" in w for w in warnings)
    robots, warnings = imported(degrees, options={"rename": {"theta_rad": "theta_deg"}})
    _same_poses(robots[4])
    assert not any("degrees:" in w for w in warnings)


def test_degrees_that_pass_the_half_turn_are_refused_under_any_command(imported):
    turning = np.degrees(np.angle(np.exp(1j * 0.5 * T_S)))
    duties = pd.DataFrame({"t_s": [0.0, 1], "robot_id": 4, "left_pct": 50, "right_pct": 60})
    with pytest.raises(LogError, match=r"jumps by 360 .*rename={'theta_rad': 'theta_deg'}"):
        imported(POSES.assign(theta_rad=turning), duties)
    # Radians that go on and on are no degrees.
    imported(POSES.assign(theta_rad=10 * T_S), duties)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"sep": ";"}, "by semicolons."),
        ({"sep": "\t"}, "by tabs."),
        ({"sep": ";", "decimal": ","}, "by semicolons, and numbers have decimal commas."),
        ({"sep": "\t", "decimal": ","}, "by tabs, and numbers have decimal commas."),
    ],
)
def test_other_delimiters_and_decimal_commas_are_found_and_said(imported, how, words):
    robots, warnings = imported(**how)
    _same_poses(robots[4])
    np.testing.assert_allclose(robots[4].command[:, 0], COMMANDS.vx_mps)
    assert [w for w in warnings if words in w] == [
        f"{n}.csv: cells are separated {words}" for n in "pc"
    ]


def test_quoted_decimal_commas_between_commas_are_found_and_said(imported):
    """As spreadsheets on the web write a table where commas are decimal points."""
    robots, warnings = imported(decimal=",", quoting=csv.QUOTE_NONNUMERIC)
    _same_poses(robots[4])
    assert "p.csv: cells are separated by commas, and numbers have decimal commas." in warnings


def test_commas_of_thousands_are_no_decimal_points(imported):
    """1,000 and 1,250 millimetres may be metres and may be kilometres: neither is guessed."""
    poses = POSES.assign(x_mm=[f"1,{k % 1000:03}" for k in range(len(POSES))]).drop(columns="x_m")
    with pytest.raises(LogError, match="x_m is '1,000', not a number"):
        imported(poses)


def test_the_line_that_tells_excel_the_delimiter_is_passed_over(imported):
    table = POSES.to_csv(index=False, sep=";", decimal=",")
    robots, warnings = imported(f"sep=;\r\n{table}".encode())
    _same_poses(robots[4])
    assert "p.csv: cells are separated by semicolons, and numbers have decimal commas." in warnings


def test_a_table_of_numpy_is_read(imported, tmp_path):
    np.savetxt(tmp_path / "np.txt", POSES, header=" ".join(POSES.columns))
    robots, _ = imported((tmp_path / "np.txt").read_bytes())
    _same_poses(robots[4])


def test_units_in_brackets_are_known(imported):
    poses = pd.DataFrame(
        {
            "Time (s)": POSES.t_s,
            "Robot": 4,
            "X [mm]": POSES.x_m * 1000,
            "Y [cm]": POSES.y_m * 100,
            "Yaw (deg)": np.degrees(POSES.theta_rad),
        }
    )
    _same_poses(imported(poses)[0][4])


@pytest.mark.parametrize(
    ("columns", "kind", "expected"),
    [
        ({"v_mps": 0.2, "omega_degps": 90}, "twist", [0.2, 0, math.pi / 2, 0]),
        ({"v_mmps": 200, "w_radps": -1}, "twist", [0.2, 0, -1, 0]),
        ({"speed_kmh": 3.6, "w_radps": -1}, "twist", [1, 0, -1, 0]),
        ({"Speed (km/h)": 7.2, "w_radps": -1}, "twist", [2, 0, -1, 0]),
        ({"v_mph": 3600 / 5280 / 0.3048, "w_radps": -1}, "twist", [1, 0, -1, 0]),
        ({"left_pwm": 255, "right_pwm": -51}, "duty", [1, -0.2, 1, -0.2]),
        ({"left_pct": 12.5, "right_pct": 58.25}, "duty", [0.125, 0.5825, 0.125, 0.5825]),
        ({"left_rpm": 60, "right_radps": 3}, "wheel_speed", [2 * math.pi, 3, 2 * math.pi, 3]),
    ],
)
def test_commands_by_their_usual_names(imported, columns, kind, expected):
    rows = pd.DataFrame({"t_s": [0.0, 1, 2], "robot_id": 4, **columns})
    robot = imported(commands=rows)[0][4]
    assert robot.command_kind == kind
    np.testing.assert_allclose(robot.command[-1], expected, atol=1e-7)


def test_speeds_of_the_rim_need_the_radius_and_the_mapping_asks_for_it(imported, tmp_path):
    rows = pd.DataFrame({"t_s": [0.0, 1, 2], "robot_id": 4, "left_mps": 0.3, "right_mps": 0.15})
    with pytest.raises(LogError, match=r"'left_mps' is a speed of the wheel's rim"):
        imported(commands=rows)
    mapping = tmp_path / "m.toml"
    files = ["--commands", str(tmp_path / "c.csv"), "--poses", str(tmp_path / "p.csv")]
    result = CliRunner().invoke(app, ["import", *files, "--explain-columns", str(mapping)])
    assert result.exit_code == 0, result.output
    with pytest.raises(LogError, match="w1_radps: has no factor yet"):
        imported(commands=rows, options={"mapping": mapping})
    mapping.write_text(mapping.read_text().replace("nan", str(1 / 0.03)))
    robot = imported(commands=rows, options={"mapping": mapping})[0][4]
    np.testing.assert_allclose(robot.command[-1], [10, 5, 10, 5])


def test_shares_of_full_duty_under_percent_are_refused(imported):
    rows = pd.DataFrame({"t_s": [0.0, 1, 2], "robot_id": 4, "left_pct": 0.5, "right_pct": 0.25})
    with pytest.raises(LogError, match="a share of full duty"):
        imported(commands=rows)


@pytest.mark.parametrize(
    "form",
    [
        *("%Y-%m-%dT%H:%M:%S.%fZ", "%Y-%m-%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f"),
        *("%H:%M:%S.%f", "%M:%S.%f", "%M:%S,%f"),
    ],
)
def test_dates_and_times_of_day_go_on_over_midnight_and_the_hour(imported, form):
    start = pd.Timestamp("2026-03-07 23:59:50")
    times = [
        table.assign(t_s=(start + pd.to_timedelta(table.t_s, unit="s")).dt.strftime(form))
        for table in (POSES, COMMANDS)
    ]
    robots, _ = imported(*times, **({"sep": ";"} if "," in form else {}))
    _same_poses(robots[4])
    np.testing.assert_allclose(np.diff(robots[4].command_t_s), np.diff(COMMANDS.t_s), atol=2e-6)


def test_comments_are_passed_over_and_rows_still_named_by_their_line(imported):
    text = POSES.to_csv(index=False)
    robots, _ = imported(b"# by Ann, room 5\n# 7 March\n" + text.encode())
    _same_poses(robots[4])
    lines = text.splitlines()
    lines[3] = lines[3].replace(",4,", ",123,", 1)
    with pytest.raises(LogError, match=r"row 5: robot_id is 123"):
        imported("\n".join(["# by Ann", *lines, ""]).encode())


def test_an_empty_cell_of_a_command_holds_the_one_before(imported):
    gaps = COMMANDS.assign(vx_mps=COMMANDS.vx_mps.where(COMMANDS.index % 50 != 20))
    robots, warnings = imported(commands=gaps)
    np.testing.assert_allclose(robots[4].command_t_s, gaps.t_s[gaps.vx_mps.notna()], atol=2e-6)
    assert any("6 rows with an empty cell or NaN (the first is row 22)" in w for w in warnings)


@pytest.mark.parametrize("cut", [5, 25])
def test_a_table_that_was_cut_is_read_to_there_and_that_is_said(imported, cut):
    text = POSES.to_csv(index=False, float_format="%.9f").encode()
    end = text.index(b"\n15.000000000") + 1
    robots, warnings = imported(text[: end + cut])
    assert len(robots[4].pose_t_s) == np.count_nonzero(POSES.t_s < 14.99)
    assert any("ends in the middle of row 377" in w for w in warnings)
    _, warnings = imported(text.rstrip())
    assert not any("ends in the middle" in w for w in warnings)


def test_robots_with_names_are_numbered_by_a_mapping(imported):
    names = ("alice", "bob")
    both = [
        pd.concat([t.assign(robot_id=n) for n in names]).sort_values("t_s", kind="stable")
        for t in (POSES, COMMANDS)
    ]
    with pytest.raises(LogError, match=r"robot={'alice': 1, 'bob': 2}"):
        imported(*both)
    robots, _ = imported(*both, options={"robots": {"alice": 1, "bob": 12}})
    assert sorted(robots) == [1, 12]
    _same_poses(robots[12])
    with pytest.raises(LogError, match=r"robot=\{'carl': 3\}: no robot"):
        imported(*both, options={"robots": {"alice": 1, "bob": 2, "carl": 3}})


@pytest.mark.parametrize(
    ("name", "options", "number"),
    [("turbopi_07", {}, 7), ("alice", {"robot_id": 5}, 5), ("8", {"robots": {"8": 2}}, 2)],
)
def test_one_robot_with_a_name(imported, name, options, number):
    tables = [table.assign(robot_id=name) for table in (POSES, COMMANDS)]
    assert list(imported(*tables, options=options)[0]) == [number]


@pytest.mark.parametrize("words", [("True", "False"), ("yes", "no"), ("1", "0")])
def test_detections_say_seen_in_words_and_have_no_range_of_nothing(imported, tmp_path, words):
    imported()
    seen = np.arange(40) % 4 == 0
    rows = pd.DataFrame({"t_s": np.arange(40) * 0.5, "robot_id": 4, "range_mm": 1000.0})
    rows["seen"] = np.where(seen, *words)
    rows.to_csv(tmp_path / "d.csv", index=False)
    files = tmp_path / "p.csv", tmp_path / "c.csv"
    summary = import_log(*files, tmp_path / "d.lcmlog", detections=tmp_path / "d.csv")
    np.testing.assert_array_equal(read_log(tmp_path / "d.lcmlog").robots[4].seen, seen)
    assert any("30 rows with range_m though seen is 0" in w for w in summary["warnings"])


@pytest.mark.parametrize("turns", [1.3, 30.0])
@pytest.mark.parametrize("factor", [1.0, 180 / np.pi])
@pytest.mark.parametrize("aside", [False, True])
def test_a_heading_without_a_unit_is_told_by_how_its_path_turns(imported, turns, factor, aside):
    """On a circle of 0.3 m the heading is the course, by algebra, however often it goes round."""
    t_s = np.arange(0, 30, 0.05)
    theta = 2 * np.pi * turns * t_s / 30
    noise = np.random.default_rng(1).normal(0, 0.0005, (2, len(t_s)))
    x, y = 0.3 * np.array([np.sin(theta), -np.cos(theta)]) + noise
    rows = pd.DataFrame({"t_s": t_s, "x_m": x, "y_m": y, "theta": factor * theta})
    if aside:
        own = rows.drop(columns="t_s")
        rows = pd.concat([rows[["t_s"]], own.add_prefix("r4_"), own.add_prefix("r5_")], axis=1)
    else:
        rows["robot_id"] = 4
    unit = "theta_rad" if factor == 1 else "theta_deg"
    with pytest.raises(LogError, match=f"so it looks like .*rename={{'theta': '{unit}'}}") as told:
        imported(rows)
    assert "turns as the path does" in str(told.value)


def test_a_heading_that_nothing_tells_may_be_of_either_unit(imported):
    """It goes to 8 on a straight line: 8 degrees, or a robot that drives sideways."""
    t_s = np.arange(0, 30, 0.05)
    rows = {"t_s": t_s, "robot_id": 4, "x_m": 0.1 * t_s, "y_m": 0.0, "theta": 8 * t_s / 30}
    with pytest.raises(LogError, match="like degrees, or like radians that go on beyond a whole"):
        imported(pd.DataFrame(rows))
