# SPDX-License-Identifier: Apache-2.0
"""No option of `twinmill import` is dropped: of each source it works, or is refused by name.

The sources and the options are two tables; each pair of them is tried, so that a new source or a
new option cannot forget one. So is every remedy that the checks print.
"""

import ast
import dataclasses
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from twinmill.data.importers import import_log as importing
from twinmill.data.importers.series import with_z_up
from twinmill.data.log import read_log
from twinmill_cli import import_log as command
from twinmill_cli.main import COMMANDS, LazyCommand, app
from twinmill_cli.spelling import typed

sys.path.insert(0, str(Path(__file__).parent))
from import_sources import OF_DUTIES, SOURCES, Drive, drive

RIGHT = drive()
EVERY = {**SOURCES, **OF_DUTIES}
WORDS = r"\s--[a-z-]+(?:[ =](?!--)[\w=.-]+)?"


@pytest.fixture
def unchecked(monkeypatch):
    """Leaves out what is said of a log that was written; it takes most of the time."""
    monkeypatch.setattr(importing, "_told_of", lambda robots: [])


def run(folder, words, *options):
    """Result of `twinmill import`, and the log if there is one."""
    out = folder / "o.lcmlog"
    out.unlink(missing_ok=True)
    done = CliRunner().invoke(app, ["import", *words, *options, "-o", str(out)])
    return done, read_log(out).robots[1] if out.exists() else None


def said(done) -> str:
    """Output of a command, or the sentence that it ends with."""
    return " ".join(f"{done.output} {done.exception or ''}".split())


def held(path):
    """Contents of a log, but for the words on where it comes from."""
    log = read_log(path)
    series = ("pose_t_s", "pose", "z_m", "valid", "command_t_s", "command")
    return log.t0_utime_us, {
        number: (robot.same_clock, *(getattr(robot, name).tobytes() for name in series))
        for number, robot in log.robots.items()
    }


def alike(one, other, atol=(2e-3, 2e-3)):
    """Poses and commands of two robots are the same, times, too; angles are taken round."""
    np.testing.assert_allclose(one.pose_t_s, other.pose_t_s, atol=0.02)
    np.testing.assert_allclose(one.pose[:, :2], other.pose[:, :2], atol=atol[0])
    off_rad = np.angle(np.exp(1j * (one.pose[:, 2] - other.pose[:, 2])))
    assert np.abs(off_rad).max() < atol[1]
    rows = np.searchsorted(other.command_t_s, one.command_t_s + 1e-4) - 1
    np.testing.assert_allclose(one.command, other.command[rows], atol=0.02)


def changed(**changes) -> Drive:
    return dataclasses.replace(RIGHT, **changes)


def _in_room() -> Drive:
    turned = (RIGHT.told[:, 0] + 1j * RIGHT.told[:, 1]) * np.exp(1j * RIGHT.heading_rad)
    return changed(told=np.column_stack([turned.real, turned.imag, RIGHT.told[:, 2]]))


def _laid(order, sign) -> Drive:
    return changed(place_m=RIGHT.place_m[:, order] * sign)


# Each mistake, and an option that its remedy must have.
MISTAKES = {
    "vy has the wrong sign": (changed(told=RIGHT.told * [1, -1, 1]), "--flip vy_mps"),
    "omega has the wrong sign": (changed(told=RIGHT.told * [1, 1, -1]), "--flip omega_radps"),
    "velocities are swapped": (changed(told=RIGHT.told[:, [1, 0, 2]]), "--rename vx_mps=vy_mps"),
    "y has the wrong sign": (_laid([0, 1, 2], [1, -1, 1]), "--flip y_m"),
    "x and y are swapped": (_laid([1, 0, 2], [1, 1, 1]), "--rename x_m=y_m"),
    "the poses are mirrored": (
        changed(place_m=RIGHT.place_m * [1, -1, 1], heading_rad=-RIGHT.heading_rad),
        "--flip y_m --flip theta_rad",
    ),
    "the heading is a compass": (changed(heading_rad=-RIGHT.heading_rad), "--flip theta_rad"),
    "the heading is turned": (
        changed(heading_rad=RIGHT.heading_rad - np.pi / 2),
        "--heading-offset-deg",
    ),
    "positions are in mm": (changed(place_m=RIGHT.place_m * 1000), "--rename x_m=x_mm"),
    "positions are in cm": (changed(place_m=RIGHT.place_m * 100), "--rename x_m=x_cm"),
    "speeds are in mm/s": (
        changed(told=RIGHT.told * [1000, 1000, 1]),
        "--rename vx_mps=vx_mmps",
    ),
    "turns are in degrees": (
        changed(told=RIGHT.told * [1, 1, 180 / np.pi]),
        "--rename omega_radps=omega_degps",
    ),
    "velocities are the room's": (_in_room(), "--rename vx_mps=vx_world_mps"),
    "the poses come late": (changed(pose_t_s=RIGHT.pose_t_s + 3.0), "--pose-shift-s"),
    "the poses come late and the heading is turned": (
        changed(pose_t_s=RIGHT.pose_t_s + 3.0, heading_rad=RIGHT.heading_rad - np.pi / 2),
        "--heading-offset-deg",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_printed_remedy_puts_right_a_log_of_every_source(mistake, tmp_path, monkeypatch):
    wrong, option = MISTAKES[mistake]
    done, _ = run(tmp_path, SOURCES["tables"](tmp_path, wrong))
    remedy = said(done).partition("import anew with ")[2]
    printed = re.findall(WORDS, " " + remedy.partition(", or")[0].partition(";")[0])
    options = [part.rstrip(".") for word in printed for part in shlex.split(word)]
    assert option in " ".join(options), said(done)
    monkeypatch.setattr(importing, "_told_of", lambda robots: [])
    of_poses = wrong.told is RIGHT.told
    for made in (EVERY if of_poses else SOURCES).values():
        _, right = run(tmp_path, made(tmp_path, RIGHT))
        put_right, log = run(tmp_path, made(tmp_path, wrong), *options)
        assert log is not None, (made.__name__, options, said(put_right))
        if "--pose-shift-s" in " ".join(options):
            log = dataclasses.replace(log, pose_t_s=log.pose_t_s - log.pose_t_s[0])
            log = dataclasses.replace(log, command_t_s=right.command_t_s)
        alike(log, right, (2e-3, 0.02))


@pytest.mark.parametrize("up", ["x", "y"])
def test_the_axis_that_is_up_is_told_and_put_right_in_every_source(up, tmp_path, unchecked):
    """The room's axes in an export whose other axis is up, by the algebra of a cyclic turn."""
    place, turn = {
        "x": (RIGHT.place_m[:, [2, 0, 1]], RIGHT.quaternion[:, [0, 3, 1, 2]]),
        "y": (
            RIGHT.place_m[:, [0, 2, 1]] * [1, 1, -1],
            RIGHT.quaternion[:, [0, 1, 3, 2]] * [1, 1, 1, -1],
        ),
    }[up]
    back = with_z_up(place, turn, up)
    np.testing.assert_allclose(back[0], RIGHT.place_m)
    np.testing.assert_allclose(back[1], RIGHT.quaternion)

    class Laid(Drive):
        quaternion = turn

    laid = Laid(RIGHT.t_s, RIGHT.pose_t_s, RIGHT.told, place, RIGHT.heading_rad)
    for name, made in EVERY.items():
        if name == "motive":  # its own axes are laid down already: what is z there is -y of others
            continue
        _, right = run(tmp_path, made(tmp_path, RIGHT))
        done, log = run(tmp_path, made(tmp_path, laid), "--up", up)
        assert log is not None, said(done)
        alike(log, right)


def test_the_axis_that_is_up_is_told_with_an_option_that_every_source_has(tmp_path):
    for order, sign, remedy in (
        ([2, 0, 1], [1, 1, 1], "--up x"),
        ([0, 2, 1], [1, 1, -1], "the other --up"),
    ):
        wall = RIGHT.place_m * [1, 1, 0]
        wall[:, 2] = RIGHT.place_m[:, 2] + 1e-4 * np.sin(RIGHT.t_s)
        done, _ = run(tmp_path, SOURCES["tables"](tmp_path, changed(place_m=wall[:, order] * sign)))
        assert f"import anew with {remedy}" in said(done)


def test_the_heading_of_the_path_is_that_of_every_source(tmp_path, unchecked):
    still = changed(heading_rad=np.zeros(len(RIGHT.t_s)))
    logs = [
        run(tmp_path, made(tmp_path, still), "--heading-from-path")[1] for made in SOURCES.values()
    ]
    for log in logs:
        known = log.valid & logs[0].valid
        assert known.mean() > 0.2 and (log.valid == logs[0].valid).mean() > 0.98
        off_rad = np.angle(np.exp(1j * (log.pose[known, 2] - RIGHT.heading_rad[known])))
        assert np.median(np.abs(off_rad)) < 0.03


# Of each option of the command one that is to change the log, or to be refused by its name.
ASKED = {
    "--detections": None,  # a source of its own
    "--robot": ["--robot", "rover_1=7"],
    "--robot-id": ["--robot-id", "5"],
    "--rename": ["--rename", "x_m=y_m", "--rename", "y_m=x_m"],
    "--exchange": ["--exchange", "R01=R02"],
    "--mapping": ["--mapping", "m.toml"],
    "--explain-columns": None,  # writes no log
    "--flip": ["--flip", "y_m"],
    "--up": ["--up", "x"],
    "--pose-shift-s": ["--pose-shift-s", "0.25"],
    "--pose-clock-ppm": ["--pose-clock-ppm", "900"],
    "--heading-offset-deg": ["--heading-offset-deg", "30"],
    "--heading-from-path": ["--heading-from-path"],
    "--same-clock": ["--same-clock"],
    "--receive-stamps": ["--receive-stamps"],
    "--wheelbase-m": ["--wheelbase-m", "0.3"],
    "--full-duty": ["--full-duty", "255"],
    "--wheel-factor": ["--wheel-factor", "0.1"],
    "--command-timeout-s": ["--command-timeout-s", "0.004"],
    "--pose": ["--pose", "/r2/pose"],
    "--command": ["--command", "/r2/cmd_vel"],
}
FILES = {"--out", "--poses", "--motive", "--vicon", "--commands", "--io-tsv", "--bag"}
ANYWHERE = {"--force", "--json"}


def options_of_the_command() -> set[str]:
    module = next(m for name, m, _ in COMMANDS if name == "import")
    known = LazyCommand("import", module, "").command().params
    return {p.opts[0] for p in known if p.opts[0].startswith("--")} - FILES - ANYWHERE - {"--help"}


def test_every_option_of_the_command_is_asked_of_every_source():
    assert options_of_the_command() == set(ASKED)


def test_every_option_that_a_sentence_on_logs_names_is_asked_of_every_source():
    """Or is a file of the import, or of another command; as the sources of the library print it."""
    calls = [
        call
        for path in sorted(Path(importing.__file__).parents[1].rglob("*.py"))
        for call in ast.walk(ast.parse(path.read_text()))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("option", "options")
    ]
    first = [call.args[0] for call in calls]
    named = {
        part.value
        for given in first
        for part in (given.keys if isinstance(given, ast.Dict) else [given])
        if isinstance(part, ast.Constant)
    }
    named = {typed({name: None}, None) for name in named}
    assert len(named) > 20
    assert named <= set(ASKED) | FILES | {
        "--family",
        "--lcm-url",
        "--local",
        "--multicast",
        "--server",
    }


@pytest.mark.parametrize("source", EVERY)
def test_each_option_changes_the_log_or_is_refused_by_its_name(source, tmp_path, unchecked):
    words = EVERY[source](tmp_path, RIGHT)
    (tmp_path / "m.toml").write_text(
        '[poses]\nt_s = { column = "t_s" }\nx_m = { column = "x_m", factor = 2.0 }\n'
        'y_m = { column = "y_m" }\n[commands]\nt_s = { column = "t_s" }\n'
        'vx_mps = { column = "vx_mps", factor = 2.0 }\nvy_mps = { value = 0.0 }\n'
        'omega_radps = { column = "omega_radps" }\n'
    )
    done, _ = run(tmp_path, words)
    assert done.exit_code == 0, said(done)
    plain = held(tmp_path / "o.lcmlog")
    for option, asked in ASKED.items():
        if asked is None:
            continue
        given = [str(tmp_path / word) if word == "m.toml" else word for word in asked]
        own = list(words)
        if option in ("--robot-id", "--pose", "--command") and option in words:
            own = words[: words.index(option)] + words[words.index(option) + 2 :]
        out = tmp_path / "o.lcmlog"
        out.unlink(missing_ok=True)
        done = CliRunner().invoke(app, ["import", *own, *given, "-o", str(out)])
        if done.exit_code == 0:
            assert held(out) != plain, (source, option)
            robots = read_log(out).robots
            assert option != "--robot-id" or list(robots) == [5]
            assert option != "--robot" or list(robots) == [7]
        else:
            assert option.strip("-") in said(done) or given[-1] in said(done), (source, said(done))


def test_what_is_printed_of_times_that_do_not_meet_works_for_every_source(tmp_path, unchecked):
    late = changed(pose_t_s=RIGHT.pose_t_s + 100.0)
    for made in EVERY.values():
        options, log = [], None
        for _ in range(3):  # of a bag receipt first, and then a shift
            done, log = run(tmp_path, made(tmp_path, late), *options)
            printed = re.findall(r"--(?:pose-shift-s[ =]\S+\d|receive-stamps)", said(done))
            options += [word for option in printed for word in option.split()] if not log else []
        assert log is not None, (made.__name__, said(done))
        assert log.pose_t_s[0] == pytest.approx(log.command_t_s[0], abs=0.01)


def test_signs_of_what_nothing_holds_are_refused(tmp_path, unchecked):
    for name, made in EVERY.items():
        column = "vy_mps" if name in OF_DUTIES else "fl_pct"
        done, log = run(tmp_path, made(tmp_path, RIGHT), "--flip", column)
        assert log is None and f"--flip {column}: nothing that was read holds {column}" in said(
            done
        )


@pytest.mark.parametrize("mode", ["explain", "list"])
def test_where_no_log_is_written_other_options_are_refused(mode, tmp_path):
    words = {
        "explain": [*SOURCES["tables"](tmp_path, RIGHT), "--explain-columns", "m.toml"],
        "list": SOURCES["bag"](tmp_path, RIGHT)[:2],
    }[mode]
    used = {"explain": command.EXPLAINED, "list": command.LISTED}[mode]
    for option, given in ASKED.items():
        if given and option not in used and option not in ("--pose", "--command"):
            done = CliRunner().invoke(app, ["import", *words, *given])
            assert done.exit_code and f"{option}: does nothing here" in said(done)


def test_duties_that_follow_from_inputs_change_their_sign_and_their_side(tmp_path, unchecked):
    """Left, counter-clockwise: the left side is the slow one; mirrored it is the right one."""
    words = SOURCES["tables"](tmp_path, RIGHT)
    (tmp_path / "c.csv").write_text("t_s,speed_input,turn_input\n0,100,0.5\n")
    for options in (
        ["--flip", "turn_input"],
        [
            *("--rename", "fl_pct=fr_pct", "--rename", "fr_pct=fl_pct"),
            *("--rename", "rl_pct=rr_pct", "--rename", "rr_pct=rl_pct"),
        ],
    ):
        _, log = run(tmp_path, words, *options)
        np.testing.assert_array_equal(log.command[0] * 100, [100, 37, 100, 37])
    _, log = run(tmp_path, words, "--flip", "fl_pct")
    np.testing.assert_array_equal(log.command[0] * 100, [-37, 100, 37, 100])


def test_signs_of_one_robot_change_that_one_alone(tmp_path, unchecked):
    rows = "".join(f"{k / 10},{robot},{k},{robot}\n" for k in range(9) for robot in (1, 2))
    (tmp_path / "p.csv").write_text("t_s,robot_id,x_m,y_m\n" + rows)
    out = tmp_path / "o.lcmlog"
    words = ["import", "--poses", str(tmp_path / "p.csv"), "--flip", "R02=y_m", "-o", str(out)]
    assert CliRunner().invoke(app, words).exit_code == 0
    robots = read_log(out).robots
    assert (robots[1].pose[0, 1], robots[2].pose[0, 1]) == (1, -2)
