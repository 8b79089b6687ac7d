# SPDX-License-Identifier: Apache-2.0
"""Scripts for robots on ROS: bytes of the bag by hand, the publisher run on a stand-in of rclpy."""

import sqlite3
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from twinmill_cli.main import run

sys.path.insert(0, str(Path(__file__).parent))
from ros_stand_in import StandIn

SCRIPT = "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,0,0,0,0\n1,50,50,50,50\n2,-40,40,-40,40\n3,0,0,0,0\n"
PUBLISHER = ("--script-as", "publisher", "--output", "p.py")
# Of the model below: 0.36 m/s at full duty; turning 0.4 * 0.36 / 0.126 at duty 40 %.
WANTED = [(0, 0, 0), (0.18, 0, 0), (0, 0, 0.4 * 0.36 / 0.126)]


@pytest.fixture
def folder(tmp_path, monkeypatch, model_text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(model_text("m"))
    (tmp_path / "s.csv").write_text(SCRIPT)
    return tmp_path


def convert(form, out, *more):
    words = ["characterise", "--robot", "3", "--script", "s.csv", "--model", "m.toml"]
    return run([*words, "--script-as", form, "--out", out, *more])


def test_a_bag_holds_the_velocities_that_the_model_reaches(folder):
    """Read as SQLite and CDR (OMG DDS-XTypes): a header of four bytes, then six doubles."""
    assert convert("bag", "bag") == 0
    info = yaml.safe_load((folder / "bag/metadata.yaml").read_text())
    (topic,) = info["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert topic["topic_metadata"]["name"] == "/cmd_vel"
    assert topic["topic_metadata"]["type"] == "geometry_msgs/msg/Twist"
    with sqlite3.connect(next((folder / "bag").glob("*.db3"))) as base:
        rows = base.execute("select timestamp, data from messages order by timestamp").fetchall()
    t_s = np.array([stamp for stamp, _ in rows]) * 1e-9
    values = np.array([struct.unpack("<6d", data[4:52]) for _, data in rows])
    assert np.diff(t_s).max() < 0.051  # said again before a robot would stop
    for at_s, wanted in zip((0.5, 1.5, 2.5), WANTED, strict=True):
        row = np.searchsorted(t_s, at_s + 1e-6) - 1
        np.testing.assert_allclose(values[row, [0, 1, 5]], wanted, atol=1e-5)
    assert t_s[-1] == 3 and not values[-1].any()


def test_a_publisher_says_the_script_and_then_stops(folder, monkeypatch):
    assert convert("publisher", "p.py") == 0
    stand_in = StandIn(monkeypatch)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    for at_s, wanted in zip((0.5, 1.5, 2.5), WANTED, strict=True):
        row = np.argmin(np.abs(said[:, 0] - at_s))
        np.testing.assert_allclose(said[row, 1:], wanted, atol=1e-5)
    assert said[-1, 0] - said[0, 0] == pytest.approx(3, abs=0.06) and not said[-5:, 1:].any()
    header, *rows = (folder / "p_sent.csv").read_text().split()
    sent = np.array([row.split(",") for row in rows], float)
    assert header == "t_s,vx_mps,vy_mps,omega_radps"
    np.testing.assert_allclose(sent[:3, 1:], WANTED, atol=1e-5)  # a row for each change
    np.testing.assert_allclose(np.diff(sent[:, 0]), 1, atol=0.06)


def test_a_publisher_stamps_what_it_says_for_controllers_that_want_it(folder, monkeypatch):
    assert convert("publisher", "p.py") == 0
    stand_in = StandIn(monkeypatch, stamped=True)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    np.testing.assert_allclose(stand_in.stamps_s, said[:, 0], atol=1e-6)
    np.testing.assert_allclose(said[np.argmin(np.abs(said[:, 0] - 1.5)), 1:], WANTED[1], atol=1e-5)
    assert not said[-5:, 1:].any()


def test_a_script_of_velocities_is_published_as_it_is(folder, monkeypatch):
    rows = [(0, 0, 0, 0), (1, 0.2, -0.1, 0), (2, 0, 0, 1.5), (3, 0, 0, 0)]
    text = "".join(f"{t},{x},{y},{w}\n" for t, x, y, w in rows)
    (folder / "s.csv").write_text("t_s,vx_mps,vy_mps,omega_radps\n" + text)
    assert convert("publisher", "p.py") == 0 == convert("bag", "bag")
    stand_in = StandIn(monkeypatch)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    for at_s, wanted in zip((0.5, 1.5, 2.5), np.array(rows)[:, 1:], strict=False):
        row = np.argmin(np.abs(said[:, 0] - at_s))
        np.testing.assert_allclose(said[row, 1:], wanted, atol=1e-5)
    assert said[-1, 0] - said[0, 0] == pytest.approx(3, abs=0.06) and not said[-5:, 1:].any()
    (folder / "s.csv").write_text("t_s,vx_mps,vy_mps,omega_radps\n" + text[: text.index("3,")])
    with pytest.raises(ValueError, match="end with a row of zeros, which stops the robot"):
        convert("publisher", "q.py")
    assert not (folder / "q.py").exists()


def test_one_wheel_at_a_time_is_published_as_what_it_does_to_the_body(folder, monkeypatch):
    """Mecanum wheels (Lynch and Park 2017, section 13.2.1): each a fourth of its rim's speed."""
    assert run(["wheels", "--duty-pct", "40", "--model", "m.toml", *PUBLISHER]) == 0
    StandIn(monkeypatch).run(folder / "p.py", monkeypatch)
    _, *rows = (folder / "p_sent.csv").read_text().split()
    sent = np.array([row.split(",")[1:] for row in rows], float)
    signs = [(1, -1, -1), (1, 1, 1), (1, 1, -1), (1, -1, 1)]  # fl, fr, rl, rr
    each = 0.4 * 0.36 / 4 * np.array(signs) / (1, 1, 0.126)
    driven = sent[sent.any(axis=1)]
    np.testing.assert_allclose(driven, np.column_stack([each, -each]).reshape(8, 3), atol=1e-5)


def test_a_publisher_waits_until_someone_listens(folder, monkeypatch):
    """Nodes of ROS 2 find each other in a second or more; until then what is said is lost."""
    convert("publisher", "p.py")
    stand_in = StandIn(monkeypatch, listens_at_s=2.7)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    assert said[0, 0] == pytest.approx(2.7, abs=0.06)
    moving = said[said[:, 1:].any(axis=1), 0]
    np.testing.assert_allclose(moving[[0, -1]] - said[0, 0], [1, 3], atol=0.06)


def test_a_publisher_that_is_interrupted_stops_the_robot(folder, monkeypatch):
    convert("publisher", "p.py")
    stand_in = StandIn(monkeypatch, stop_after=1.5)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    assert said[-6, 1] > 0 and not said[-5:, 1:].any()


def test_what_cannot_be_written_is_one_sentence(folder, model_text):
    with pytest.raises(ValueError, match="above the cap"):
        convert("bag", "bag", "--cap-pct", "30")
    (folder / "bag").mkdir()
    with pytest.raises(ValueError, match="bag: exists"):
        convert("bag", "bag")
    twist = model_text("m").replace('"duty"', '"twist"')
    (folder / "m.toml").write_text(
        twist.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
    )
    with pytest.raises(ValueError, match=r"the script holds duties.*model"):
        convert("publisher", "p.py")
    assert not (folder / "p.py").exists()
