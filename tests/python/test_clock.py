# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from twinmill.data.checks.lateness import _stepwise
from twinmill.data.clock import estimate_offset
from twinmill.data.log import LogError, read_log
from twinmill.data.track import make_track

LAG_S = 0.08


@pytest.fixture
def steps(driven):
    """A robot with a first-order lag under random duties, its poses stamped by another clock."""

    def make(offset_s):
        rng, dt_s = np.random.default_rng(5), 1e-3
        robot = driven(60)
        held = rng.uniform(-1, 1, (70, 2))[(robot.command_t_s / 0.9).astype(int)]
        time_s = np.arange(0, 60, dt_s)
        now = held[np.searchsorted(robot.command_t_s, time_s, side="right") - 1]
        side_mps = np.zeros((len(time_s), 2))
        for k in range(1, len(time_s)):
            side_mps[k] = side_mps[k - 1] + (0.36 * now[k - 1] - side_mps[k - 1]) * dt_s / LAG_S
        theta = np.cumsum(side_mps[:, 1] - side_mps[:, 0]) * dt_s / 0.25
        xy = np.cumsum(side_mps.mean(1) * np.exp(1j * theta)) * dt_s
        at = np.searchsorted(time_s, robot.pose_t_s - 1e-9)
        pose = np.column_stack([xy.real, xy.imag, theta])[at]
        pose += rng.normal(0, [0.0003, 0.0003, 0.002], pose.shape)
        return replace(
            robot, command=held[:, [0, 1, 0, 1]], pose=pose, pose_t_s=robot.pose_t_s + offset_s
        )

    return make


@pytest.mark.parametrize("offset_s", [-0.2, -0.03, 0.0, 0.117])
def test_known_offset_and_lag_are_found(steps, offset_s):
    found = estimate_offset(make_track(steps(offset_s)))
    assert found.offset_s == pytest.approx(offset_s, abs=0.002)  # a quarter of a frame
    assert found.lag_s == LAG_S
    assert 0 < found.std_s < 0.002
    assert found.explained > 0.95


@pytest.mark.parametrize("every", [4, 5])
def test_a_slow_camera_shows_the_offset_too(steps, every):
    """Only 30 or 24 of 120 Hz are kept: neighbours are farther apart than the usual window."""
    robot = steps(0.05)
    slow = {k: getattr(robot, k)[::every] for k in ("pose_t_s", "pose", "z_m", "valid")}
    found = estimate_offset(make_track(replace(robot, **slow)))
    assert found.offset_s == pytest.approx(0.05, abs=0.01)  # a quarter of a frame


def test_recordings_on_the_same_clocks_agree(data_dir):
    paths = sorted((data_dir / "hidden_effects").glob("case_[a-f].lcmlog"))
    offsets_s = [estimate_offset(make_track(read_log(path).robots[3])).offset_s for path in paths]
    assert len(paths) == 6
    assert np.ptp(offsets_s) < 0.004  # by the description one constant; half a frame


def test_motion_that_commands_do_not_explain_is_refused(steps):
    robot = steps(0.0)
    with pytest.raises(LogError, match="robot 3: the clock offset is not identifiable"):
        estimate_offset(make_track(replace(robot, command=robot.command[::-1])))


def test_constant_commands_are_refused(driven):
    with pytest.raises(LogError, match="never change"):
        estimate_offset(make_track(driven()))


def test_steps_of_lateness_are_those_of_an_exhaustive_search():
    """All ways to part eight stretches into pieces of two or more are tried, one shift each."""
    left = np.random.default_rng(3).random((5, 8))
    for found in _stepwise(left, np.arange(5.0))[:4]:
        ways = [
            (0, *inner, 8)
            for inner in combinations(range(1, 8), found.pieces - 1)
            if np.diff((0, *inner, 8)).min() >= 2
        ]
        costs = [sum(left[:, a:b].sum(1).min() for a, b in pairwise(way)) for way in ways]
        assert found.edges == ways[int(np.argmin(costs))]
