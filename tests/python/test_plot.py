# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm plot`: what is drawn is what was driven."""

import shutil
from dataclasses import replace

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from twinmill.data.multi_log import RecordedRobot, read_multi_log
from twinmill.data.world_bodies import world_bodies
from twinmill.report.log_figures import Drawing, paint_bodies
from twinmill_cli.main import run


@pytest.fixture
def log(write_log, message):
    """A robot at 0.25 m/s along x, and its twin, which starts a second later, along y."""
    events = []
    for k in range(300):
        utime_us = 1_700_000_000_000_000 + 10_000 * k
        robot = message("pose", utime_us=utime_us, robot_id=1)
        robot.position_m = [0.0025 * k, 0.0, 0.1]
        twin = message("pose", utime_us=utime_us + 1_000_000, robot_id=1)
        twin.position_m = [0.0, 0.0025 * k, 0.1]
        telemetry = message("telemetry", utime_us=utime_us, robot_id=1, detected=k // 150)
        telemetry.wheel_duty_pct = [-50, 100, -50, 100]
        events += [("R01_POSE", robot), ("R01_TELEMETRY", telemetry), ("TWIN_R01_POSE", twin)]
    return write_log(*events)


def painted(robots, name):
    axes = Figure().subplots()
    getattr(Drawing(robots), name)(axes)
    return axes


def test_speed_and_turn_of_a_circle(driven):
    robot = RecordedRobot("", driven())
    (speed,), (turn,) = (painted([robot], name).lines for name in ("speed", "turn"))
    # Parabolas over 0.4 s cut the corner of a circle by less than 0.5 %.
    np.testing.assert_allclose(speed.get_ydata(), 0.3, rtol=5e-3)
    np.testing.assert_allclose(turn.get_ydata(), np.degrees(0.5), rtol=1e-3)


def test_robot_and_twin_are_drawn_on_one_time_axis(log):
    robots = read_multi_log(log).robots
    assert [recorded.name for recorded in robots] == ["R01", "TWIN_R01"]
    robot, twin = painted(robots, "speed").lines
    assert (robot.get_xdata()[0], twin.get_xdata()[0]) == (0.0, 1.0)
    assert (robot.get_linestyle(), twin.get_linestyle()) == ("-", "--")
    along = painted(robots, "paths").lines[0]
    assert np.ptp(along.get_xdata()) == pytest.approx(0.7475, abs=0.13)
    assert np.ptp(along.get_ydata()) == 0


def test_bits_are_green_from_when_it_sees_and_commands_have_their_signs(log):
    robots = read_multi_log(log).robots
    (bits,) = painted(robots, "bits").images
    row = bits.get_array()[0]
    green = (row == matplotlib.colors.to_rgb("#009e73")).all(axis=1)
    cell_s = bits.get_extent()[1] / len(row)
    assert green.argmax() * cell_s == pytest.approx(1.5, abs=2 * cell_s)
    (duties,) = painted(robots, "commands").images
    assert np.array(duties.get_array())[:, 5].tolist() == [-50, 100, -50, 100]


def test_each_bit_of_a_robot_is_a_row_of_its_own(driven):
    """A number that runs 0, 1, 2, 3: bit 1 in its 2nd and 4th quarter, bit 2 in its last half."""
    robot = driven()
    count = len(robot.command_t_s)
    number = (4 * np.arange(count) // count).astype(np.int8)
    axes = painted(
        [RecordedRobot("", replace(robot, detected=number, detected_raw=number))], "bits"
    )
    rows = axes.images[0].get_array()
    green = (rows == matplotlib.colors.to_rgb("#009e73")).all(axis=2)
    middles = [int((k + 0.5) / 4 * green.shape[1]) for k in range(4)]
    assert green[:, middles].tolist() == [[False, True, False, True], [False, False, True, True]]
    assert [label.get_text()[-5:] for label in axes.get_yticklabels()] == ["bit 1", "bit 2"]


def test_bodies_of_a_world_are_drawn_where_they_are(write_log, message):
    """All points of a wall's outline are as far from its line as it is thick, ends included."""
    start, end = np.array([1.0, 2.0]), np.array([4.0, 6.0])
    told = [
        message("body", utime_us=k, name="wall", from_m=start, to_m=end, radius_m=0.1)
        for k in range(2)
    ]
    (wall,) = world_bodies([m.encode() for m in told], 0)
    assert not wall.moves
    points = wall.outline()
    part = np.clip((points - start) @ (end - start) / 25, 0, 1)
    np.testing.assert_allclose(
        np.linalg.norm(points - start - part[:, None] * (end - start), axis=1), 0.1
    )
    axes = Figure().subplots()
    paint_bodies(axes, [wall])
    np.testing.assert_allclose(axes.patches[0].get_xy()[:-1], points)


def test_where_no_camera_was_recorded_nobody_is_said_to_see_nobody(driven):
    """As in logs of imported commands: telemetry with neither frames nor detections."""
    robot = driven()
    none = np.zeros_like(robot.detected)
    blind = replace(robot, detected=none, frame_t_s=np.full(len(none), np.nan))
    other = replace(blind, seen_t_s=np.arange(0, 4, 0.1), seen=np.arange(40) >= 20)
    drawing = Drawing([RecordedRobot("", blind), RecordedRobot("", other)])
    assert drawing.telling == [1]
    axes = Figure().subplots()
    drawing.bits(axes)
    (row,) = axes.images[0].get_array()
    assert (row[50] == matplotlib.colors.to_rgb("#009e73")).all()
    assert not (row[10] == row[50]).all()


def test_a_robot_that_fell_silent_is_neither_blind_nor_driven(driven):
    robot = driven()
    speaks = robot.command_t_s < 5
    quiet = ("command_t_s", "command", "battery_V", "frame_t_s", "mode", "detected_raw", "detected")
    silent = replace(robot, **{name: getattr(robot, name)[speaks] for name in quiet})
    (duties,) = painted([RecordedRobot("", silent)], "commands").images
    known = np.isfinite(np.ma.filled(duties.get_array().astype(float), np.nan)[0])
    assert known[:100].all() and not known[106:].any()


@pytest.mark.parametrize("suffix", ["png", "svg", "html"])
def test_same_log_same_picture(log, tmp_path, suffix):
    out, made = tmp_path / f"o.{suffix}", []
    for _ in range(2):
        run(["plot", str(log), "-o", str(out), "--force"])
        made.append(out.read_bytes())
    assert made[0] == made[1]
    if suffix == "png":
        assert len(Image.open(out).convert("RGB").getcolors(1 << 24)) > 10


def test_bad_input_is_one_sentence_and_nothing_is_written(log, write_log, message, tmp_path):
    write_log(("R01_RUN", message("run", robot_id=1)), name="empty.lcmlog")
    before = set(tmp_path.iterdir())
    for name, out, sentence in (
        ("made.lcmlog", "o.jpg", r"o\.jpg: must end in"),
        ("empty.lcmlog", "o.png", "no channel"),
        ("none", "o.png", "cannot be read"),
    ):
        with pytest.raises(ValueError, match=sentence):
            run(["plot", str(tmp_path / name), "-o", str(tmp_path / out)])
    assert set(tmp_path.iterdir()) == before


def test_a_name_is_no_formula(log, tmp_path, twinmill):
    named = shutil.copy(log, tmp_path / r"a$\frac{$.lcmlog")
    assert twinmill("plot", named, "-o", tmp_path / "sheet.svg")[0] == 0
