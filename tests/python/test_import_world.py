# SPDX-License-Identifier: Apache-2.0
"""Poses without a heading, velocities along the room's axes, one clock."""

import numpy as np
import pytest

from twinmill.data.clock import estimate_offset
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log
from twinmill.data.measurement import load_measurements
from twinmill.data.track import make_track

WORLD = "t_s,robot_id,vx_world_mps,vy_world_mps\n"


@pytest.fixture
def imported(tmp_path):
    """The robot 4 of a log made from two texts."""

    def make(poses, commands, **options):
        (tmp_path / "p.csv").write_text(poses)
        (tmp_path / "c.csv").write_text(commands)
        out = tmp_path / "o.lcmlog"
        import_log(
            tmp_path / "p.csv",
            tmp_path / "c.csv",
            out,
            options=ImportOptions(force=True, robot_id=4, **options),
        )
        return read_log(out).robots[4]

    return make


def _poses(t_s, theta_rad=None, speed_mps=0.2):
    heading = "" if theta_rad is None else ",theta_rad"
    rows = [f"t_s,robot_id,x_m,y_m{heading}"]
    for k, t in enumerate(t_s):
        end = "" if theta_rad is None else f",{theta_rad[k]:.6f}"
        rows.append(f"{t:.4f},4,{speed_mps * t:.6f},0{end}")
    return "\n".join(rows) + "\n"


def test_world_velocity_turns_into_the_bodys_by_the_heading_of_its_time(imported):
    t_s = np.arange(0, 4, 0.01)
    robot = imported(_poses(t_s, 0.5 * t_s), WORLD + "0,4,0.2,0\n2,4,0,0.2\n")
    assert robot.command_kind == "twist"
    theta_rad = 0.5 * robot.command_t_s
    early = robot.command_t_s < 2
    # A vector of the room, seen from a frame that is turned by theta: turned by -theta.
    expected = np.where(
        early[:, None],
        0.2 * np.column_stack([np.cos(theta_rad), -np.sin(theta_rad)]),
        0.2 * np.column_stack([np.sin(theta_rad), np.cos(theta_rad)]),
    )
    np.testing.assert_allclose(robot.command[:, :2], expected, atol=1e-6)
    assert np.diff(robot.command_t_s).max() < 0.06  # never further than 0.02 rad at 0.5 rad/s


def test_without_a_heading_the_body_is_the_world_at_heading_zero(imported):
    robot = imported(_poses(np.arange(0, 4, 0.01)), WORLD + "0,4,0.2,0.1\n")
    np.testing.assert_allclose(robot.command, [[0.2, 0.1, 0, 0]])
    assert robot.valid.all() and not robot.has_heading
    assert np.isnan(robot.pose[:, 2]).all()
    track = make_track(robot)
    assert not track.has_heading
    assert (track.heading_smooth[track.segment >= 0] == 0).all()
    assert (track.segment == 0).all()
    assert any("heading is not recorded" in note for note in track.notes)


def test_a_heading_under_another_name_is_not_taken_for_a_missing_one(imported):
    poses = _poses(np.arange(0, 1, 0.1), np.zeros(10)).replace("theta_rad", "yaw")
    with pytest.raises(LogError, match=r"'yaw' .* no unit"):
        imported(poses, WORLD + "0,4,0.2,0\n")


@pytest.mark.parametrize("same", [True, False])
def test_one_clock_is_kept_in_the_log(imported, same):
    robot = imported(_poses(np.arange(0, 4, 0.01)), WORLD + "0,4,0.2,0\n", same_clock=same)
    assert robot.same_clock is same
    assert make_track(robot).same_clock is same


def test_every_hera_run_imports_and_loads(data_dir, tmp_path):
    runs = sorted((data_dir / "hera_swarm").glob("*_poses.csv.gz"))
    logs = []
    for poses in runs:
        commands = poses.with_name(poses.name.replace("poses", "commands"))
        logs.append(tmp_path / f"{poses.name[:7]}.lcmlog")
        import_log(poses, commands, logs[-1], options=ImportOptions(same_clock=True))
    measurements = load_measurements(logs)
    assert not measurements.excluded
    assert len({m.log_name for m in measurements}) == 59  # by the recording's description
    assert all(m.same_clock and not m.track.has_heading for m in measurements)
    # Every step between poses is one of the robot's: it was never picked up.
    assert all(m.track.segment.max() == 0 for m in measurements if m.log_name != "run-112.lcmlog")


def test_offset_is_found_from_positions_alone(imported):
    t_s = np.arange(0, 40, 0.05)
    speed = 0.2 * np.sign(np.sin(2 * np.pi * t_s / 5))
    x_m = np.concatenate([[0], np.cumsum(speed[:-1] * 0.05)])
    rows = [f"{t + 0.15:.4f},4,{x:.6f},0" for t, x in zip(t_s, x_m, strict=True)]
    poses = "t_s,robot_id,x_m,y_m\n" + "\n".join(rows) + "\n"
    steps = [f"{t:.4f},4,{v},0" for t, v in zip(t_s, speed, strict=True)]
    robot = imported(poses, WORLD + "\n".join(steps) + "\n")
    assert estimate_offset(make_track(robot)).offset_s == pytest.approx(0.15, abs=0.02)


def test_a_robot_that_cannot_be_judged_is_left_out_and_the_rest_is_not(tmp_path):
    t_s = np.arange(0, 20, 0.05)
    rows = [f"{t:.3f},1,{0.2 * t:.5f},0,0" for t in t_s] + [f"{t:.3f},2,0,0,0" for t in t_s[:60]]
    (tmp_path / "p.csv").write_text("t_s,robot_id,x_m,y_m,theta_rad\n" + "\n".join(rows) + "\n")
    commands = "t_s,robot_id,fl_pct,fr_pct,rl_pct,rr_pct\n0,1,50,50,50,50\n0,2,50,50,50,50\n"
    (tmp_path / "c.csv").write_text(commands)
    good, broken = tmp_path / "good.lcmlog", tmp_path / "broken.lcmlog"
    import_log(tmp_path / "p.csv", tmp_path / "c.csv", good, options=ImportOptions())
    broken.write_bytes(b"no log")
    measurements = load_measurements([good, broken])
    assert [m.track.robot_id for m in measurements] == [1]
    assert len(measurements.excluded) == 2
    assert "good.lcmlog: robot 2 has" in measurements.excluded[0]
    assert "broken.lcmlog" in measurements.excluded[1]
    with pytest.raises(LogError, match=r"broken\.lcmlog"):
        load_measurements([broken])
