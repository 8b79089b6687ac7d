# SPDX-License-Identifier: Apache-2.0
"""One robot of a table is bad: the others are as they are without it, and its remedy is its own.

The drive is algebra: unicycles that obey at once, whose paths are summed here.
"""

import re
import shlex
import warnings

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from twinmill.data.log import read_log
from twinmill_cli.main import app

STEP_S, HELD_S, DURATION_S = 0.02, 1.2, 40.0
POSE_NAMES, TOLD_NAMES = ["x_m", "y_m", "theta_rad"], ["vx_mps", "vy_mps", "omega_radps"]


def _drive(robot_id):
    """Tables of poses and commands of a robot, the latter with a row where they change."""
    random = np.random.default_rng(robot_id)
    t_s = np.arange(0, DURATION_S, STEP_S)
    choices = np.array([[0.25, 0], [-0.2, 0], [0, 1.0], [0, -0.8], [0.2, 0.7], [0.15, -0.9]])
    order = random.integers(0, len(choices), int(DURATION_S / HELD_S) + 1)
    told = choices[order[(t_s / HELD_S).astype(int)]]
    heading = np.concatenate([[0], np.cumsum(told[:-1, 1])]) * STEP_S
    middle = heading + told[:, 1] * STEP_S / 2
    steps = told[:, :1] * np.column_stack([np.cos(middle), np.sin(middle)]) * STEP_S
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps[:-1], axis=0)])
    place += random.normal(0, 3e-4, place.shape)
    poses = pd.DataFrame(np.column_stack([place, heading]), columns=POSE_NAMES)
    body = np.column_stack([told[:, 0], 0 * t_s, told[:, 1]])
    commands = pd.DataFrame(body, columns=TOLD_NAMES)
    for table in (poses, commands):
        table.insert(0, "robot_id", robot_id)
        table.insert(0, "t_s", t_s)
    changed = np.append(True, np.diff(told, axis=0).any(axis=1))
    return poses, commands[changed]


@pytest.fixture
def imports(tmp_path):
    """Imports tables of the robots 1 and 2 by the command line; of the log, and what was said."""

    def run(poses, commands, *options):
        for name, table in (("p.csv", poses), ("c.csv", commands)):
            pd.concat(table).to_csv(tmp_path / name, index=False, na_rep="nan")
        out = tmp_path / "o.lcmlog"
        words = ["--poses", tmp_path / "p.csv", "--commands", tmp_path / "c.csv", "--force"]
        result = CliRunner(env={"COLUMNS": "5000"}).invoke(
            app, ["import", *map(str, [*words, "-o", out]), *options]
        )
        assert result.exit_code == 0, result.output
        return read_log(out).robots, result.output

    return run


def _same(a, b):
    for series in ("pose_t_s", "pose", "command_t_s", "command"):
        np.testing.assert_array_equal(getattr(a, series), getattr(b, series))


@pytest.mark.parametrize(("late_s", "left_s"), [(5000.0, 0.0), (3.0, 0.02)])
def test_the_remedy_for_a_clock_of_one_robot_run_as_printed_shifts_that_robot_alone(
    imports, late_s, left_s
):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    late = p2.assign(t_s=p2.t_s + late_s)
    _, said = imports([p1, late], [c1, c2])
    (remedy,) = re.findall(r"--pose-shift-s [^;\s]*\d", said)
    robots, said = imports([p1, late], [c1, c2], *shlex.split(remedy))
    assert "!" not in said
    _same(robots[1], right[1])
    assert np.abs(robots[2].pose_t_s - right[2].pose_t_s).max() <= left_s + 1e-6
    np.testing.assert_array_equal(robots[2].command_t_s, right[2].command_t_s)


def test_a_drift_of_one_robots_clock_is_taken_out_of_it_alone(imports):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    fast = p2.assign(t_s=1.0015 * p2.t_s)
    robots, _ = imports([p1, fast], [c1, c2], "--pose-clock-ppm", "R02=1500")
    _same(robots[1], right[1])
    np.testing.assert_allclose(robots[2].pose_t_s, right[2].pose_t_s, atol=1e-6)


def test_shifts_of_all_and_of_one_robot_add_up(imports):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    early = [p1.assign(t_s=p1.t_s - 10), p2.assign(t_s=p2.t_s - 12)]
    given = ["10", "R02=1.5", "R2=0.5"]
    robots, _ = imports(early, [c1, c2], *(f"--pose-shift-s={text}" for text in given))
    for number in (1, 2):
        np.testing.assert_allclose(robots[number].pose_t_s, right[number].pose_t_s, atol=2e-6)


@pytest.mark.parametrize(
    ("column", "cell", "rows", "why"),
    [
        ("x_m", "lost", slice(700, 701), "row 2702: x_m is 'lost', not a number"),
        ("t_s", np.nan, slice(0, None), "row 2002: t_s is nan, but must be a finite number"),
        ("vx_mps", np.inf, slice(3, 4), "vx_mps is inf, but must be a finite number"),
        ("vx_mps", np.nan, slice(0, None), "rows with an empty cell or NaN"),
    ],
    ids=["a word", "no time", "infinity", "no commands"],
)
def test_what_cannot_be_read_of_one_robot_leaves_the_other_as_it_is(
    imports, column, cell, rows, why
):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    alone, _ = imports([p1], [c1])
    poses, commands = p2.astype(object), c2.astype(object)
    table = poses if column in ("x_m", "t_s") else commands
    table.iloc[rows, table.columns.get_loc(column)] = cell
    robots, said = imports([p1, poses], [c1, commands])
    _same(robots[1], alone[1])
    assert why in said and re.search(r"R02: has no (poses|commands)", said)


def test_infinity_in_a_pose_is_a_lost_pose_without_a_warning_of_numpy(imports):
    poses, commands = _drive(1)
    poses.loc[100:120, POSE_NAMES] = np.inf
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robots, _ = imports([poses], [commands])
    np.testing.assert_array_equal(np.flatnonzero(~robots[1].valid), np.arange(100, 121))


def test_a_command_that_never_changes_is_told_and_of_its_robot_alone(imports):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    held = c2.head(1)
    told_twice = pd.concat([held, held.assign(t_s=7.0)])
    for commands in (held, told_twice):
        robots, said = imports([p1, p2], [c1, commands])
        assert sorted(robots) == [1, 2]
        assert re.findall(r"robot (\d): its command never changes", said) == ["2"]
    assert "one is held for all 40 s" in said


def test_commands_are_counted_as_the_table_has_them(imports):
    """Duties are repeated in the log while they are held; the user gave three rows."""
    poses, _ = _drive(1)
    duties = pd.DataFrame(
        {"t_s": [0.0, 20.0, 30.0], "robot_id": 1, "left_pct": [40, 40, 20], "right_pct": 40}
    )
    robots, said = imports([poses], [duties])
    assert len(robots[1].command_t_s) > 1000
    row = next(line.split() for line in said.splitlines() if " duty " in line)
    assert row == ["1", "duty", "3", "1", "2000", "2000"]


def test_rows_without_a_robot_are_left_out_and_counted(imports):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    poses, commands = pd.concat([p1, p2]).astype(object), pd.concat([c1, c2]).astype(object)
    poses.iloc[[100, 101, 2500], poses.columns.get_loc("robot_id")] = ""
    robots, said = imports([poses], [commands])
    assert "p.csv: 3 rows without robot_id (the first is row 102); left out." in said
    for number, gone in ((1, [100, 101]), (2, [500])):
        assert np.array_equal(robots[number].pose, np.delete(right[number].pose, gone, axis=0))
        np.testing.assert_array_equal(robots[number].command, right[number].command)


@pytest.mark.parametrize(
    ("spoil", "option"),
    [
        (lambda p: p.assign(y_m=-p.y_m, theta_rad=-p.theta_rad), "--flip R02="),
        (lambda p: p.assign(theta_rad=p.theta_rad - np.pi / 2), "--heading-offset-deg R02=90"),
    ],
    ids=["mirrored", "turned"],
)
def test_a_mistake_of_one_robot_has_a_remedy_of_that_robot_alone(imports, spoil, option):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    _, said = imports([p1, spoil(p2)], [c1, c2])
    assert option in said
    *_, remedy = re.search(r"import anew with ([^.;]*)", said)[1].split(", or ")
    robots, said = imports([p1, spoil(p2)], [c1, c2], *shlex.split(remedy))
    assert "!" not in said
    _same(robots[1], right[1])
    np.testing.assert_allclose(robots[2].pose, right[2].pose, atol=1e-6)


def _swapped(table, *names):
    """The table with two columns under each other's names, in their place."""
    return table.rename(columns=dict(zip(names, names[::-1], strict=True)))[list(table.columns)]


@pytest.mark.parametrize(
    ("spoil_poses", "spoil_commands"),
    [
        (lambda p: _swapped(p, "x_m", "y_m"), lambda c: c),
        (lambda p: p, lambda c: _swapped(c, "vx_mps", "omega_radps")),
        (lambda p: p.assign(theta_rad=np.degrees(p.theta_rad)), lambda c: c),
        (lambda p: p, lambda c: c.assign(vx_mps=1000 * c.vx_mps)),
    ],
    ids=["axes", "commands", "degrees", "millimetres"],
)
def test_a_column_of_one_robot_is_read_by_the_remedy_as_printed(
    imports, spoil_poses, spoil_commands
):
    (p1, c1), (p2, c2) = _drive(1), _drive(2)
    right, _ = imports([p1, p2], [c1, c2])
    poses, commands = [p1, spoil_poses(p2)], [c1, spoil_commands(c2)]
    _, said = imports(poses, commands)
    remedy = re.search(r"import anew with (--rename R02=[^.;,]*)", said)[1]
    robots, _ = imports(poses, commands, *shlex.split(remedy))
    _same(robots[1], right[1])
    np.testing.assert_allclose(robots[2].pose, right[2].pose, atol=1e-6)
    np.testing.assert_allclose(robots[2].command, right[2].command, atol=1e-6)


def test_a_remedy_in_our_names_holds_for_columns_of_other_names(imports):
    tables = [_drive(1), _drive(2)]
    right, _ = imports(*zip(*tables, strict=True))
    as_mm = {"x_m": "y_mm", "y_m": "x_mm"}
    poses = [p.assign(x_m=1e3 * p.x_m, y_m=1e3 * p.y_m).rename(columns=as_mm) for p, _ in tables]
    commands = [c for _, c in tables]
    _, said = imports(poses, commands)
    assert "import anew with --rename x_m=y_m --rename y_m=x_m." in said
    robots, said = imports(poses, commands, "--rename=x_m=y_m", "--rename=y_m=x_m")
    assert "!" not in said
    np.testing.assert_allclose(robots[2].pose, right[2].pose, atol=1e-6)


@pytest.mark.parametrize("under", [{1: 2, 2: 1, 3: 3}, {1: 2, 2: 3, 3: 1}], ids=["two", "three"])
def test_names_that_are_exchanged_are_put_right_by_the_remedy_as_printed(imports, under):
    tables = {k: _drive(k) for k in under}
    poses, commands = zip(*tables.values(), strict=True)
    right, _ = imports(poses, commands)
    wrong = [table.assign(robot_id=under[k]) for k, table in zip(tables, poses, strict=True)]
    _, said = imports(wrong, commands)
    (remedy,) = set(re.findall(r"import anew with (--exchange[^.;]*)", said))
    robots, said = imports(wrong, commands, *shlex.split(remedy))
    assert "!" not in said
    for number in tables:
        _same(robots[number], right[number])


def test_a_mistake_of_all_robots_has_one_remedy(imports):
    tables = [(p.assign(y_m=-p.y_m, theta_rad=-p.theta_rad), c) for p, c in map(_drive, (1, 2))]
    _, said = imports(*zip(*tables, strict=True))
    assert said.count(" --flip y_m --flip theta_rad.") == 2 and "R02=" not in said
