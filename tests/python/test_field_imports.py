# SPDX-License-Identifier: Apache-2.0
"""Tables, exports and bags as people wrote them, read as their owners would give them.

The recordings' README files say what is right, calculated without Twinmill.
"""

import pickle
import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from twinmill.data.log import read_log


@pytest.fixture
def case(data_dir):
    """Folder of one recording by its name."""

    def find(name):
        path = data_dir / "field_cases" / name
        if not path.is_dir():
            pytest.skip(f"no recording at {path}")
        return path

    return find


@pytest.fixture
def imported(twinmill, tmp_path):
    """The log of an import and what was said; arguments as of `twinmill import`."""

    def run(*words):
        out = tmp_path / "o.lcmlog"
        code, said, wrong = twinmill("import", *words, "-o", out, "--force")
        assert code == 0, wrong
        return read_log(out), " ".join(said.split())

    return run


def rows_of(path):
    """Numbers of a table, NaN where a cell is empty."""
    return np.genfromtxt(path, delimiter=",", skip_header=1)


@pytest.mark.parametrize(
    ("name", "pose", "commands"),
    [("one_table_two_rates", [0, 1, 2], [0, 4, 5, 6]), ("slash_names", [0, 8, 9], [0, 2, 3, 1])],
)
def test_one_table_of_two_topics_is_read_as_the_two(case, imported, name, pose, commands):
    """The rows of each topic, taken apart by hand: all are there, and no pose was lost."""
    table = case(name) / "all.csv"
    log, said = imported("--poses", table, "--commands", table, "--robot-id", 1, "--same-clock")
    rows = rows_of(table)
    seen, told = (rows[np.isfinite(rows[:, own]).all(axis=1)][:, own] for own in (pose, commands))
    robot = log.robots[1]
    assert len(robot.pose_t_s) == np.count_nonzero(robot.valid) == len(seen) == 1500
    np.testing.assert_allclose(robot.pose[:, :2], seen[:, 1:])
    told = told[np.append(np.diff(told[:, 0]) > 0, True)]
    np.testing.assert_allclose(robot.command[:, :3], told[:, 1:])
    np.testing.assert_allclose(robot.pose_t_s, seen[:, 0] - seen[0, 0], atol=1e-5)
    assert "!" not in said


def test_a_sign_is_changed_in_a_bag_and_in_an_export_of_vicon(case, imported, tmp_path):
    """Both files were written with vy of the wrong sign, and in Vicon y as well."""
    folder = tmp_path / "bag"
    shutil.copytree(case("options_ignored"), folder)
    subprocess.run([sys.executable, folder / "bag.py"], check=True)
    topics = ["--pose", "/r1/pose", "--command", "/r1/cmd_vel"]
    told = rows_of(folder / "commands.csv")[:, 3]
    log, said = imported("--bag", folder / "told_bag", *topics, "--flip", "vy_mps")
    np.testing.assert_allclose(log.robots[1].command[:, 1], -told)
    assert "wrong sign" not in said
    log, said = imported(
        *("--vicon", folder / "vicon.csv", "--commands", folder / "commands.csv"),
        *("--flip", "vy_mps", "--flip", "y_m"),
    )
    robot = log.robots[1]
    np.testing.assert_allclose(robot.command[:, 1], -told)
    np.testing.assert_allclose(robot.pose[:, 1], rows_of(folder / "poses.csv")[:, 3], atol=6e-6)
    assert "wrong sign" not in said


def test_speed_and_steering_angle_are_read_with_the_wheelbase(case, imported):
    """Omega = v tan(steering) / wheelbase; the truth has a lag of 0.10 s and a gain of 1."""
    folder = case("steering_csv")
    words = ["--poses", folder / "poses.csv", "--commands", folder / "commands.csv"]
    with pytest.raises(AssertionError, match="distance of the axles in m, --wheelbase-m"):
        imported(*words, "--same-clock")
    log, _ = imported(*words, "--same-clock", "--wheelbase-m", 0.3)
    _, _, speed, steering = rows_of(folder / "commands.csv").T
    command = log.robots[1].command
    np.testing.assert_allclose(command[:, 0], speed)
    np.testing.assert_allclose(command[:, 2], speed * np.tan(steering) / 0.3)


def test_stamps_of_date_and_time_in_digits_are_read(case, imported):
    folder = case("underscore_stamps")
    log, _ = imported(
        *("--poses", folder / "poses.csv", "--commands", folder / "commands.csv"),
        *("--robot-id", 1),
    )
    robot = log.robots[1]
    assert len(robot.pose_t_s) == 2000
    np.testing.assert_allclose(robot.pose_t_s, np.arange(2000) * 0.02, atol=1e-6)
    assert log.t0_utime_us == 1_767_607_230_000_000  # 2026-01-05 10:00:30 UTC, by date -u


@pytest.fixture
def dated(case, tmp_path):
    """Words of an import of tables stamped in a form of `strftime`, and their begin since 1970."""

    def make(form, begin):
        files = []
        for name in ("poses", "commands"):
            head, *rows = (case("underscore_stamps") / f"{name}.csv").read_text().split()
            at_s = 0.02 if name == "poses" else 0.05
            stamps = [begin + timedelta(seconds=k * at_s) for k in range(len(rows))]
            cells = [row.split(",", 1)[1] for row in rows]
            lines = [f"{s.strftime(form)},{c}" for s, c in zip(stamps, cells, strict=True)]
            files.append(tmp_path / f"{name}.csv")
            files[-1].write_text("\n".join([head, *lines]))
        words = ("--poses", files[0], "--commands", files[1], "--robot-id", 1)
        return words, round(begin.timestamp() * 1e6)

    return make


@pytest.mark.parametrize(
    "form",
    ["%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%m/%d/%Y %I:%M:%S.%f %p", "%Y/%m/%d %T.%f"],
)
def test_dates_with_slashes_are_read_where_a_day_above_12_tells_the_order(dated, imported, form):
    """Over midnight, as the standard library writes them."""
    words, begin_us = dated(form, datetime(2026, 3, 25, 23, 59, 50, tzinfo=UTC))
    log, _ = imported(*words)
    np.testing.assert_allclose(log.robots[1].pose_t_s, np.arange(2000) * 0.02, atol=1e-6)
    assert log.t0_utime_us == begin_us


def test_dates_that_tell_no_order_are_asked_about(dated, twinmill, tmp_path):
    words, _ = dated("%d/%m/%Y %H:%M:%S.%f", datetime(2026, 3, 5, 12, 15, tzinfo=UTC))
    code, _, wrong = twinmill("import", *words, "-o", tmp_path / "o.lcmlog")
    assert code == 1 and "the day or the month comes first" in wrong and "dayfirst" in wrong


def test_a_steering_angle_by_another_name_is_asked_for(case, imported, twinmill, tmp_path):
    folder = case("steering_csv")
    table = tmp_path / "c.csv"
    text = (folder / "commands.csv").read_text()
    table.write_text(text.replace("speed_mps,steering_rad", "v,delta"))
    words = ["--poses", folder / "poses.csv", "--commands", table, "--wheelbase-m", "0.3"]
    code, _, wrong = twinmill("import", *words, "-o", tmp_path / "o.lcmlog")
    assert code == 1 and "--rename COLUMN=steering_rad" in wrong
    log, _ = imported(*words, "--rename", "v=speed_mps", "--rename", "delta=steering_rad")
    _, _, speed, steering = rows_of(table).T
    np.testing.assert_allclose(log.robots[1].command[:, 2], speed * np.tan(steering) / 0.3)


def test_header_cells_of_motive_in_small_letters_are_read(case, imported):
    folder = case("motive_small_w")
    words = ["--motive", folder / "take.csv", "--commands", folder / "commands.csv"]
    robot = imported(*words)[0].robots[1]
    assert np.count_nonzero(robot.valid) == 2000 and np.ptp(robot.pose_t_s) == pytest.approx(39.98)


def test_poses_alone_make_a_log_and_what_needs_commands_says_so(case, imported, twinmill, tmp_path):
    """Metrics of it are those of the same poses heard with commands; compare asks for these."""
    folder = case("poses_only")
    log, said = imported("--poses", folder / "poses.csv")
    np.testing.assert_array_equal(
        log.robots[2].pose[:, :2], rows_of(folder / "poses.csv")[1::2, 2:4]
    )
    assert "no commands are given" in said
    out = str(tmp_path / "o.lcmlog")
    assert twinmill("metrics", out)[0] == 0
    assert twinmill("plot", out, "-o", tmp_path / "o.svg")[0] == 0
    assert twinmill("export", out, "--to", "csv", "-o", tmp_path / "o.csv")[0] == 0
    for words in (["compare"], ["diagnose"], ["fit", "-o", tmp_path / "m.toml"]):
        code, _, wrong = twinmill(*words, out, "--model", case("models") / "twist.toml")
        assert (
            code
            and "no commands of it" in wrong
            and "import anew" in wrong
            and "--commands" in wrong
        )
    words = ["--heading-from-path", "--same-clock"]
    for word in words:
        code, _, wrong = twinmill("import", "--poses", folder / "poses.csv", word, "-o", "x.lcmlog")
        assert code and word in wrong


@pytest.mark.parametrize(
    ("option", "name", "what", "remedy"),
    [
        ("--bag", "pointer.db3", "a Git LFS pointer", "git lfs pull"),
        ("--poses", "pointer.db3", "a Git LFS pointer", "git lfs pull"),
        ("--poses", "book.xlsx", "an Excel file", "save it as CSV"),
        ("--motive", "book.xlsx", "an Excel file", "save it as CSV"),
        ("--poses", "transposed.csv", "3 rows of 120 numbers", "turn it round"),
        ("--poses", "echo.yaml", "`ros2 topic echo`", "record a bag"),
    ],
)
def test_files_of_other_kinds_are_told_with_their_way_out(
    case, twinmill, tmp_path, option, name, what, remedy
):
    path = case("small_words") / name
    topics = ["--pose", "/r1/a", "--command", "/r1/b"] if option == "--bag" else []
    code, _, wrong = twinmill("import", option, path, *topics, "-o", tmp_path / "o.lcmlog")
    assert code == 1 and what in wrong and remedy in wrong and wrong.count("\n") == 1
    assert not (tmp_path / "o.lcmlog").exists()


@pytest.mark.parametrize(
    ("content", "what", "remedy"),
    [
        (pickle.dumps({"t_s": [0.0, 0.1]}), "a pickle of Python", "to_csv"),
        (b"ULog\x01\x12\x35\x01" + bytes(64), "a log of PX4", "ulog2csv"),
        (b"\x02\x50" + bytes(510), "a C3D file", "as CSV"),
        (b"ABCD" + bytes(64), "a binary file", "as CSV"),
    ],
)
def test_binary_files_are_told_by_their_first_bytes(tmp_path, twinmill, content, what, remedy):
    """By the specifications of ULog and C3D; no line of text has a zero byte."""
    path = tmp_path / "x.dat"
    path.write_bytes(content)
    code, _, wrong = twinmill("import", "--poses", path, "-o", tmp_path / "o.lcmlog")
    assert code == 1 and what in wrong and remedy in wrong and wrong.count("\n") == 1


def test_an_archive_of_numpy_is_no_archive_to_unpack(tmp_path, twinmill):
    np.savez(tmp_path / "x.npz", x_m=np.zeros(3))
    code, _, wrong = twinmill("import", "--poses", tmp_path / "x.npz", "-o", tmp_path / "o.lcmlog")
    assert code == 1 and "an archive of NumPy" in wrong and "numpy.savetxt" in wrong
