# SPDX-License-Identifier: Apache-2.0
"""Headings of robots of which positions alone are known, against a simulation that knows them."""

import numpy as np
import pandas as pd
import pytest

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError, read_log

LAG_S, RATE_HZ = 0.1, 50
AHEAD, CURVE, ASIDE, SPIN, STOP = (1, 0, 0), (0.8, 0, 0.8), (0, 1, 0), (0, 0, 2), (0, 0, 0)


def driven(moves, hold_s, strafes=True, noise_m=0.001, seed=1):
    """(M, 4) commands with times, (N,) s, (N, 3) poses: first-order lag, forward Euler."""
    random = np.random.default_rng(seed)
    commands = np.array([(k * hold_s, 0.3 * m[0], 0.3 * m[1], m[2]) for k, m in enumerate(moves)])
    dt_s, velocity, poses = 0.001, np.zeros(3), []
    place, theta = 0j, 0.4
    for t_s in np.arange(0, hold_s * len(moves), dt_s):
        told = commands[np.searchsorted(commands[:, 0], t_s, "right") - 1, 1:]
        velocity += dt_s / LAG_S * (told * (1, 0.8, 1) - velocity)
        place += dt_s * np.exp(1j * theta) * (velocity[0] + 1j * velocity[1])
        theta += dt_s * velocity[2]
        poses.append((place.real, place.imag, theta))
    every = round(1 / RATE_HZ / dt_s)
    poses = np.array(poses)[::every]
    noise = noise_m * random.normal(size=(len(poses), 2))
    return commands, np.arange(len(poses)) / RATE_HZ, poses + np.pad(noise, ((0, 0), (0, 1)))


@pytest.fixture
def imported(tmp_path):
    """The robot of a log of these positions alone."""

    def make(commands, t_s, poses, **more):
        columns = {"t_s": t_s, "x_m": poses[:, 0], "y_m": poses[:, 1]} | more
        pd.DataFrame(columns).to_csv(tmp_path / "p.csv", index=False)
        names = ["t_s", "vx_mps", "vy_mps", "omega_radps"]
        pd.DataFrame(commands, columns=names).to_csv(tmp_path / "c.csv", index=False)
        options = ImportOptions(robot_id=1, path_heading=True, same_clock=True)
        import_log(tmp_path / "p.csv", tmp_path / "c.csv", tmp_path / "o.lcmlog", options=options)
        return read_log(tmp_path / "o.lcmlog").robots[1]

    return make


def off_rad(robot, poses):
    return np.angle(np.exp(1j * (robot.pose[:, 2] - poses[:, 2])))[robot.valid]


@pytest.mark.parametrize(
    "moves",
    [
        [AHEAD, CURVE, STOP, (-1, 0, 0), SPIN, (-0.8, 0, 0.8), AHEAD, STOP] * 3,
        [AHEAD, ASIDE, STOP, (0, -1, 0), SPIN, (-1, 0, 0), ASIDE, CURVE] * 3,
    ],
    ids=["ahead and back", "to the sides, too"],
)
def test_the_path_tells_the_heading_where_the_robot_is_told_to_go_along_an_axis(imported, moves):
    commands, t_s, poses = driven(moves, 2.0)
    robot = imported(commands, t_s, poses)
    off = off_rad(robot, poses)
    assert robot.valid.mean() > 0.4
    assert np.sqrt(np.mean(off**2)) < np.radians(2) and np.abs(off).max() < np.radians(10)
    spinning = np.isin(np.floor(t_s / 2), [k for k, m in enumerate(moves) if m == SPIN])
    assert not robot.valid[spinning].any()


def test_the_heading_goes_on_over_stops_and_ways_back_on_a_straight_line(imported):
    commands, t_s, poses = driven([STOP, AHEAD, STOP, (-1, 0, 0), AHEAD, STOP] * 3, 1.5)
    robot = imported(commands, t_s, poses)
    assert robot.valid.all()
    assert np.abs(off_rad(robot, poses)).max() < np.radians(5)


def test_what_shows_no_heading_is_refused(imported):
    commands, t_s, poses = driven([SPIN, STOP, (0.5, 0.5, 1)] * 5, 2.0)
    with pytest.raises(LogError, match=r"shows the heading of robot 1 in \d+ %"):
        imported(commands, t_s, poses)
    with pytest.raises(LogError, match="robot 1 has headings"):
        imported(commands, t_s, poses, theta_rad=poses[:, 2])
