# SPDX-License-Identifier: Apache-2.0
"""Scripts for robots on ROS: bytes of the bag by hand, the publisher run on a stand-in of rclpy."""

import signal
import sqlite3
import struct
import types

import numpy as np
import pytest
import yaml

from twinmill_cli.main import run

SCRIPT = "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,0,0,0,0\n1,50,50,50,50\n2,-40,40,-40,40\n3,0,0,0,0\n"
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


class StandIn:
    """As much of rclpy as a publisher needs; its clock runs a tick at a time."""

    def __init__(self, monkeypatch, stop_after=10**9):
        self.said, self.now_s, self.stop_after = [], 0.0, stop_after
        stand_in = self

        class Node:
            def __init__(self, name):
                pass

            def create_publisher(self, kind, topic, depth):
                return types.SimpleNamespace(publish=stand_in.hear)

            def create_timer(self, period_s, call):
                stand_in.period_s, stand_in.call = period_s, call

            def destroy_node(self):
                pass

        def vector():
            return types.SimpleNamespace(x=0.0, y=0.0, z=0.0)

        def twist():
            return types.SimpleNamespace(linear=vector(), angular=vector())

        rclpy = types.ModuleType("rclpy")
        rclpy.init, rclpy.spin = lambda **_: None, self.spin
        rclpy.shutdown = lambda: None
        modules = {
            "rclpy": rclpy,
            "rclpy.node": types.SimpleNamespace(Node=Node),
            "rclpy.signals": types.SimpleNamespace(
                SignalHandlerOptions=types.SimpleNamespace(NO=0)
            ),
            "geometry_msgs": types.ModuleType("geometry_msgs"),
            "geometry_msgs.msg": types.SimpleNamespace(Twist=twist),
        }
        for name, module in modules.items():
            monkeypatch.setitem(__import__("sys").modules, name, module)

    def hear(self, twist):
        self.said.append((self.now_s, twist.linear.x, twist.linear.y, twist.angular.z))

    def spin(self, node):
        while True:
            self.now_s += self.period_s
            if self.now_s > self.stop_after:
                raise KeyboardInterrupt
            self.call()

    def run(self, path, monkeypatch):
        """The program, on this clock; what it does to signals is undone."""
        monkeypatch.setattr("time.monotonic", lambda: self.now_s)
        monkeypatch.setattr("time.sleep", lambda _: None)
        before = signal.getsignal(signal.SIGTERM)
        try:
            exec(compile(path.read_text(), path, "exec"), {"__name__": "__main__"})
        finally:
            signal.signal(signal.SIGTERM, before)


def test_a_publisher_says_the_script_and_then_stops(folder, monkeypatch):
    assert convert("publisher", "p.py") == 0
    stand_in = StandIn(monkeypatch)
    stand_in.run(folder / "p.py", monkeypatch)
    said = np.array(stand_in.said)
    for at_s, wanted in zip((0.5, 1.5, 2.5), WANTED, strict=True):
        row = np.argmin(np.abs(said[:, 0] - at_s))
        np.testing.assert_allclose(said[row, 1:], wanted, atol=1e-5)
    assert said[-1, 0] == pytest.approx(3, abs=0.06) and not said[-5:, 1:].any()


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
    with pytest.raises(ValueError, match=r"the script holds duties.*--model"):
        convert("publisher", "p.py")
    assert not (folder / "p.py").exists()
