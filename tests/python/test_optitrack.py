# SPDX-License-Identifier: Apache-2.0
"""`twinmill track optitrack` against a server whose packets are laid out by hand."""

import json
import math
import socket
import struct
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinmill.data import natnet_stream
from twinmill.data.log import read_log
from twinmill.data.natnet_stream import Stream, StreamError, find_server
from twinmill.data.optitrack import Robots, View
from twinmill_cli.main import run

sys.path.insert(0, str(Path(__file__).parent))
from motive_server import PERIOD_S, START_S, Body, Motive, frame, models

LONGEST_S = 30.0  # on a busy machine; all end when they have what they need
TURN_RAD = 0.8


def turned(about):
    """A body that stood for 20 frames and then stands turned by TURN_RAD."""
    half = TURN_RAD / 2
    vector = {axis: math.sin(half) * (axis == about) for axis in "xyz"}
    quaternion = (*vector.values(), math.cos(half))
    return lambda number, body: body if number < 20 else replace(body, quaternion_xyzw=quaternion)


def listen(motive, view=None, multicast=None, frames=60, listens_s=LONGEST_S):
    """Messages heard in so many frames, and the poses."""
    server = find_server("127.0.0.1", port=motive.port)
    robots, poses = Robots(Stream(server, multicast), view or View()), []
    try:
        for stamped in robots.stream.frames(listens_s):
            poses += robots.take(*stamped)
            if robots.frames >= frames and robots.stream.names:
                break
    finally:
        robots.stream.close()
    return robots, poses


def wrong(robots):
    return {check.what: check.words for check in robots.checks() if check.ok is False}


@pytest.mark.parametrize("version", [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2)])
def test_poses_come_with_z_up_and_named_by_the_bodies(version):
    bodies = [Body(17, "robot_03"), Body(5, "robot 4", (0.0, 0.1, 0.5))]
    with Motive(bodies, version, turn=turned("y")) as motive:
        robots, poses = listen(motive)
    named = [p for p in poses if p.robot_id == 3]
    assert robots.stream.names == {17: "robot_03", 5: "robot 4"} and not wrong(robots)
    # Motive's y is up: its x to the right and z towards the viewer are our x and -y.
    np.testing.assert_allclose(named[-1].position_m, [1.0, 2.0, 0.1], atol=1e-6)
    w, x, y, z = named[-1].orientation_wxyz
    assert (x, y) == (0, 0) and 2 * math.atan2(z, w) == pytest.approx(TURN_RAD, abs=1e-6)
    assert [c.ok for c in robots.checks()] == [True] * 4
    assert named[-1].valid == 1 and {p.robot_id for p in poses[-2:]} == {3, 4}


def test_stamps_are_motives_on_our_clock():
    """The offset only falls: that of the quickest packet so far."""
    with Motive([Body(3, "r3")]) as motive:
        _, poses = listen(motive, frames=100)
    taken_s = START_S + PERIOD_S * np.array([p.seq for p in poses])
    offset_us = np.array([p.utime_us for p in poses]) - 1e6 * taken_s
    assert len(poses) > 50 and np.diff(offset_us).max() <= 1


def test_multicast_is_heard_where_the_server_says_so():
    with Motive([Body(3, "r3")], multicast=True) as motive:
        robots, _ = listen(motive)
    assert robots.stream.multicast and robots.poses[3] > 30 and not wrong(robots)


def test_what_is_not_tracked_or_not_numbered_is_said():
    bodies = [
        Body(1, "r3", tracked=False),
        Body(2, "wand"),
        Body(4, "a7"),
        Body(5, "b7"),
        Body(6, "alice"),
    ]
    with Motive(bodies) as motive:
        robots, poses = listen(motive, View(robots={"alice": 9}))
    assert {(p.robot_id, p.valid) for p in poses if p.seq > 30} == {(3, 0), (9, 1)}
    assert math.isnan(next(p for p in poses if p.robot_id == 3).position_m[0])
    said = wrong(robots)
    assert "wand, a7, b7" in said["numbers"] and "r3 is tracked in 0%" in said["tracked"]


@pytest.mark.parametrize(("about", "up", "word"), [("y", "z", "say up='y'"), ("z", "y", "up='z'")])
def test_the_axis_that_is_up_is_found(about, up, word):
    with Motive([Body(3, "r3")], turn=turned(about)) as motive:
        robots, _ = listen(motive, View(up))
    assert word in wrong(robots)["up axis"]


def test_broken_packets_are_dropped_and_said():
    def extra(number):
        whole = b"\7\0\xff\xff" + bytes([number % 256, 1, 2, 3]) * 3
        return whole[: number % len(whole)]

    with Motive([Body(3, "r3")], extra=extra) as motive:
        robots, _ = listen(motive)
    assert robots.poses[3] > 30 and "cannot be read" in wrong(robots)["packets"]


def test_no_packet_takes_longer_than_its_bytes():
    """Counts that are not true end in an error, not in gigabytes or minutes."""
    random = np.random.default_rng(1)
    bodies = [Body(3, "r3"), Body(4, "r4")]
    with Motive(bodies, (4, 1), streams=False) as motive:
        stream = Stream(find_server("127.0.0.1", port=motive.port))
    for whole in 100 * [frame(5, bodies, (4, 1)), models(bodies, (4, 1))]:
        changed = bytearray(whole)
        for place in random.integers(4, len(whole), 3):
            changed[place] = random.integers(256)
        stream._read(bytes(changed[: random.integers(4, len(whole) + 1)]))
    stream.close()
    assert stream.broken > 50


def test_frames_that_can_be_none_are_dropped_and_bodies_without_a_pose_are_lost():
    bodies = [Body(3, "r3"), Body(4, "r4", position=(math.nan, 0, 0)),
              Body(5, "r5", quaternion_xyzw=(3.0, 0.0, 0.0, 1e30))]  # fmt: skip
    with Motive(bodies, streams=False) as motive:
        stream = Stream(find_server("127.0.0.1", port=motive.port))
    robots = Robots(stream, View())
    stream._read(models(bodies, (3, 1)))
    poses = list(robots.take(1000.0, stream._read(frame(7, bodies, (3, 1)))))
    stream.close()
    assert {p.robot_id: p.valid for p in poses} == {3: 1, 4: 0, 5: 0}
    assert all(pose.encode() for pose in poses)
    assert stream._read(frame(2**31, bodies, (3, 1))) is None
    stamp, none = (struct.pack("<d", t_s) for t_s in (START_S, math.nan))
    assert stream._read(frame(0, bodies, (3, 1)).replace(stamp, none)) is None
    assert stream.broken == 2


def test_others_on_the_port_are_not_heard_but_named():
    with Motive([Body(3, "r3")], multicast=True) as motive:
        server = replace(find_server("127.0.0.1", port=motive.port), address="127.0.0.2")
        robots = Robots(Stream(server), View())
        for _ in robots.stream.frames(0.5):
            pass
        robots.stream.close()
    assert "give server='127.0.0.1'" in wrong(robots)["frames"]


def test_why_nothing_arrives(monkeypatch):
    with Motive([], streams=False, told=True) as motive:
        robots, _ = listen(motive, listens_s=0.3)
    assert "no frame comes by multicast to 239.255.42.99" in wrong(robots)["frames"]
    with Motive([], streams=False) as motive:
        robots, _ = listen(motive, listens_s=0.3)
    assert "by unicast" in wrong(robots)["frames"]
    with Motive([]) as motive:
        robots, _ = listen(motive, listens_s=1)
    assert "make one for each robot" in wrong(robots)["rigid bodies"]
    with pytest.raises(StreamError, match="nothing listens on its port"):
        find_server("127.0.0.1", port=motive.port)
    with pytest.raises(StreamError, match=r"local='203.0.113.9': .*ip address"):
        find_server("127.0.0.1", "203.0.113.9", motive.port)
    monkeypatch.setattr(natnet_stream, "ANSWER_S", 0.2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        with pytest.raises(StreamError, match=r"does not answer.*firewall"):
            find_server("127.0.0.1", port=silent.getsockname()[1])


def test_the_command_puts_poses_on_the_bus(tmp_path, capsys):
    log = tmp_path / "bus.lcmlog"
    words = ["optitrack", "--server", "127.0.0.1", "--duration-s", "1", "--json"]
    with Motive([Body(17, "robot_03")], turn=turned("y")) as motive:
        words += ["--command-port", str(motive.port)]
        assert run([*words, "--lcm-url", f"file://{log}?mode=w", "--heading-offset-deg", "90"]) == 0
    said = json.loads(capsys.readouterr().out)
    robot = read_log(log).robots[3]
    assert list(read_log(log).robots) == [3]  # and no robot of the stream's own number
    assert len(robot.pose) == said["poses"]["3"] > 0.5 * said["frames"]
    np.testing.assert_allclose(robot.pose[-1], [1, 2, TURN_RAD + math.pi / 2], atol=1e-5)


def test_the_check_says_what_is_wrong(capsys):
    with Motive([Body(17, "wand")]) as motive:
        words = ["--server", "127.0.0.1", "--command-port", str(motive.port), "--duration-s", "1"]
        assert run(["optitrack", *words, "--check"]) == 1
    assert "give --robot NAME=ID" in " ".join(capsys.readouterr().out.split())


def test_without_frames_the_command_says_why(monkeypatch):
    monkeypatch.setattr("twinmill_cli.optitrack.PATIENCE_S", 0.3)
    with Motive([], streams=False) as motive:
        words = ["--server", "127.0.0.1", "--command-port", str(motive.port)]
        with pytest.raises(ValueError, match="no frame comes by unicast: is Motive live"):
            run(["optitrack", *words, "--lcm-url", "memq://"])
