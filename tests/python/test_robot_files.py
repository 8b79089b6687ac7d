# SPDX-License-Identifier: Apache-2.0
"""Tables of which each holds one robot become one log of all; whose each is, is said or asked."""

import numpy as np
import pytest
from typer.testing import CliRunner

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import app

T_S = np.arange(0, 10, 0.05)
SPEEDS_MPS = (0.1, -0.2, 0.3)  # of each robot: by it a pose tells whose it is


def _poses(k):
    rows = "".join(f"{t:.3f},{SPEEDS_MPS[k] * t:.6f},{k},0\n" for t in T_S)
    return f"t_s,x_m,y_m,theta_rad\n{rows}"


def _commands(k):
    return f"t_s,vx_mps,vy_mps,omega_radps\n0,{SPEEDS_MPS[k]},0,0\n9,{SPEEDS_MPS[k]},0,0\n"


@pytest.fixture
def imported(tmp_path):
    """The robots of the log and what was said, of tables by name, robot k's in the k-th place."""

    def make(poses, commands, **options):
        for names, text_of in ((poses, _poses), (commands, _commands)):
            for k, name in enumerate(names):
                (tmp_path / name).write_text(text_of(k))
        files = [[tmp_path / name for name in names] for names in (poses, commands)]
        out = tmp_path / "o.lcmlog"
        done = import_log(*files, out, options=ImportOptions(same_clock=True, **options))
        return read_log(out).robots, done["warnings"]

    return make


def _are(robots, numbers):
    """Asserts that the k-th robot has the k-th number, in its poses and in its commands."""
    assert sorted(robots) == sorted(numbers)
    for k, number in enumerate(numbers):
        assert robots[number].pose[-1, 0] == pytest.approx(SPEEDS_MPS[k] * T_S[-1], abs=1e-5)
        assert robots[number].command[0, 0] == pytest.approx(SPEEDS_MPS[k])


@pytest.mark.parametrize(
    ("poses", "commands", "numbers"),
    [
        (["poses_R0.csv", "poses_R1.csv"], ["commands_R0.csv", "commands_R1.csv"], [0, 1]),
        (["7.csv", "3.csv", "12.csv"], ["cmd7.csv", "cmd3.csv", "cmd12.csv"], [7, 3, 12]),
        # The day and the run are in all names, and say nothing of robots.
        (["26-03-01_robot2_run7.csv", "26-03-01_robot7_run7.csv"], ["u2.csv", "u7.csv"], [2, 7]),
        # So does the time at which each file was begun.
        (["robot4 10-31-02.csv", "robot5 10-31-09.csv"], ["u4.csv", "u5.csv"], [4, 5]),
        # Named by words: in the order of the poses.
        (["alice.csv", "bob.csv"], ["told_alice.csv", "told_bob.csv"], [1, 2]),
    ],
)
def test_a_file_for_each_robot_makes_one_log_of_all(imported, poses, commands, numbers):
    robots, said = imported(poses, commands)
    _are(robots, numbers)
    for name, number in zip(poses + commands, numbers * 2, strict=True):
        assert f"{name} is taken for robot {number}." in said


def test_commands_are_matched_by_names_not_by_order(imported, tmp_path):
    robots, _ = imported(["alice.csv", "bob.csv"], ["told_alice.csv", "told_bob.csv"])
    _are(robots, [1, 2])
    crossed = [tmp_path / "told_bob.csv", tmp_path / "told_alice.csv"]
    poses = [tmp_path / "alice.csv", tmp_path / "bob.csv"]
    import_log(poses, crossed, tmp_path / "p.lcmlog", options=ImportOptions(same_clock=True))
    _are(read_log(tmp_path / "p.lcmlog").robots, [1, 2])


def test_names_are_numbered_by_the_option(imported):
    names = {"alice": 8, "bob": 5}
    robots, _ = imported(["alice.csv", "bob.csv"], ["u_alice.csv", "u_bob.csv"], robots=names)
    _are(robots, [8, 5])


@pytest.mark.parametrize(
    ("poses", "commands", "why"),
    [
        (["a.csv", "b.csv"], ["x.csv", "y.csv"], r"a.csv: .*robot={'a': 1, 'b': 2}"),
        (["p1.csv", "p01.csv"], ["c1.csv", "c2.csv"], r"p1.csv: .*robot={'p1': 1, 'p01': 2}"),
        (["p1.csv", "p2.csv"], ["c5.csv", "c6.csv"], r"robots \[1, 2\], commands of \[5, 6\]"),
        # All robots may have been told the same, or one of them.
        (["p1.csv", "p2.csv"], ["c.csv"], "c.csv: column robot_id is missing"),
    ],
)
def test_files_whose_robots_are_not_clear_are_refused(imported, poses, commands, why):
    with pytest.raises(LogError, match=why):
        imported(poses, commands)


def test_one_bad_file_among_many_is_left_out_with_its_reason(imported, tmp_path):
    names = [f"{kind}_R{k}.csv" for kind in "pc" for k in range(3)]
    imported(names[:3], names[3:])
    (tmp_path / "p_R1.csv").write_text(_poses(1) + "camera lost\n")
    files = [tmp_path / name for name in names]
    options = ImportOptions(same_clock=True)
    done = import_log(files[:3], files[3:], tmp_path / "l.lcmlog", options=options)
    robots = read_log(tmp_path / "l.lcmlog").robots
    _are({k: robots[k] for k in (0,)}, [0])
    assert len(robots[1].pose) == 0 and len(robots[2].pose) == len(T_S)
    assert "Left out: p_R1.csv: row 202: has 1 cells" in " ".join(done["warnings"])

    (tmp_path / "p_R0.csv").write_text("lost\n")
    (tmp_path / "p_R2.csv").write_text("lost\n")
    with pytest.raises(LogError, match=r"p_R0.csv: has no rows"):
        import_log(files[:3], files[3:], tmp_path / "m.lcmlog", options=options)


def test_two_runs_of_one_robot_are_no_two_robots(tmp_path):
    for k, name in enumerate(("run1.csv", "run2.csv")):
        table = _poses(k).replace("t_s", "robot_id,t_s", 1).replace("\n", "\n4,").removesuffix("4,")
        (tmp_path / name).write_text(table)
    (tmp_path / "c.csv").write_text(_commands(0))
    files = [tmp_path / "run1.csv", tmp_path / "run2.csv"]
    with pytest.raises(LogError, match=r"run1.csv and run2.csv both hold poses of robot 4; .*runs"):
        import_log(files, tmp_path / "c.csv", tmp_path / "o.lcmlog")


def test_a_quoted_pattern_stands_for_the_files_and_an_unquoted_one_is_explained(
    tmp_path, monkeypatch, twinmill
):
    monkeypatch.chdir(tmp_path)
    for k in range(2):
        (tmp_path / f"poses_R{k}.csv").write_text(_poses(k))
        (tmp_path / f"commands_R{k}.csv").write_text(_commands(k))
    words = ["import", "--poses", "poses_R*.csv", "--commands", "commands_R*.csv", "--same-clock"]
    done = CliRunner().invoke(app, [*words, "-o", "o.lcmlog"])
    assert done.exit_code == 0, done.output
    _are(read_log(tmp_path / "o.lcmlog").robots, [0, 1])

    spread = ["import", "--poses", "poses_R0.csv", "poses_R1.csv", "-o", "p.lcmlog"]
    code, _, said = twinmill(*spread)
    assert code == 1
    assert "poses_R1.csv: stands alone; write the option before each file" in said
    _, _, said = twinmill("import", "--poses", "no*.csv", "-o", "p.lcmlog")
    assert "--poses 'no*.csv': no file has such a name" in said
