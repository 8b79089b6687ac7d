# SPDX-License-Identifier: Apache-2.0
"""Comparisons of logs and a model: of several logs, of chaotic motion, of odd input."""

from dataclasses import replace

import numpy as np
import pytest

from twinmill.data.checks import InputFinding
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.predict.regimes import where_it_fails

from .conftest import STEP_S

ROBOTS, RANGE_M, HALF_CONE_RAD, LOOK_EVERY = 4, 1.5, 0.6, 12  # a new bit every quarter second
SIDES = np.array([(0.25, 1.0, 0.25, 1.0), (1.0, 0.25, 1.0, 0.25)])  # sees nobody, somebody


def test_errors_beside_the_score_of_several_logs_are_of_all_of_them(
    tanh_robot, measure, true_model
):
    """Truth: root mean squares over the predictions of both; the second robot is more sluggish."""
    runs = [measure(tanh_robot(), 61, 20.0), measure(tanh_robot(lag_s=0.15), 62, 40.0)]
    found = compare(runs, true_model)
    told = found.to_json()
    both = np.sqrt(np.nanmean(np.concatenate([r.errors for r in found.robots]) ** 2, axis=0))
    assert [row["rms"] for row in told["errors"]] == pytest.approx(both.T.ravel(), rel=0.02)
    for robot, own in zip(told["robots"], found.robots, strict=True):
        alone = np.sqrt(np.nanmean(own.errors**2, axis=0))
        assert [row["rms"] for row in robot["errors"]] == pytest.approx(alone.T.ravel())


def test_one_score_for_one_log_and_model(measure, tanh_robot, known_base, tmp_path):
    """`compare`, `fit`, `add` and `diagnose` say the same of the model as given."""
    logs = [measure(tanh_robot(), 5, 30.0)]
    told = [
        compare(logs, known_base).score,
        fit(logs, known_base, tmp_path / "f.toml", "").before.score,
        add("marker_offset", logs, known_base, out=tmp_path / "a.toml", command="").before.score,
        diagnose(logs, known_base).before.score,
    ]
    assert told == pytest.approx([told[0]] * 4, rel=0.01)


def milling(robot, start, seconds, seed):
    """(C, N, 4) duties and (120 Hz, N, 3) poses of robots that turn by whether they see another."""
    controls = round(seconds * 48)
    random = np.random.default_rng(seed)
    keep = np.exp(-STEP_S / robot.memory_s)
    drift = np.zeros((ROBOTS, 3))
    size = np.sqrt(1 - keep**2) * np.array([robot.drive_mps, robot.drive_mps, robot.drive_radps])
    pose, rims = start.copy(), np.zeros((ROBOTS, 4))
    duties, seen = [], []
    for control in range(controls):
        if control % LOOK_EVERY == 0:
            away = pose[None, :, :2] - pose[:, None, :2]
            bearing = np.arctan2(away[..., 1], away[..., 0]) - pose[:, None, 2]
            off = np.abs(np.remainder(bearing + np.pi, 2 * np.pi) - np.pi)
            near = np.hypot(*np.moveaxis(away, -1, 0)) < RANGE_M
            bits = np.any(near & (off < HALF_CONE_RAD) & ~np.eye(ROBOTS, dtype=bool), axis=1)
        duties.append(SIDES[bits.astype(int)] * (24 <= control < controls - 24))
        target = robot.speed_mps(duties[-1])
        for step in range(10):
            rims = rims + STEP_S / robot.lag_s * (target - rims)
            drift = keep * drift + size * random.normal(size=drift.shape)
            fl, fr, rl, rr = rims.T
            moving = rims.max(axis=1) > 1e-3
            forward = (fl + fr + rl + rr) / 4 + drift[:, 0] * moving
            left = robot.sideways * (-fl + fr + rl - rr) / 4 + drift[:, 1] * moving
            turn = robot.yaw * (-fl + fr - rl + rr) / 4 / robot.lever_m + drift[:, 2] * moving
            pose[:, 2] += turn * STEP_S
            c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            pose[:, 0] += (c * forward - s * left) * STEP_S
            pose[:, 1] += (s * forward + c * left) * STEP_S
            if (10 * control + step) % 4 == 3:
                seen.append(pose.copy())
    return np.array(duties), np.array(seen)


def test_a_chaotic_swarm_is_judged_by_short_predictions(tanh_robot, measure, one_clock_base):
    """Paths from a millimetre beside part fiftyfold, all noise the same; the model is right."""
    robot, seconds, beside_m = tanh_robot(), 40.0, 1e-3
    start = np.random.default_rng(12).normal(0, 0.4, (ROBOTS, 3)) * (1, 1, 4)
    moved = start + beside_m * np.array([1, 0, 0]) * np.eye(ROBOTS)[:, :1]
    duties, poses = milling(robot, start, seconds, 6)
    _, others = milling(robot, moved, seconds, 6)
    assert np.linalg.norm((others - poses)[-1, :, :2], axis=-1).max() > 50 * beside_m
    noise = (robot.sensor_m, robot.sensor_m, robot.sensor_rad)

    def filmed(pose, valid):
        return poses[:, 0] + np.random.default_rng(7).normal(size=pose.shape) * noise, valid

    script_pct = np.rint(100 * duties[24:-24, 0]).astype(int)
    run = measure(robot, 7, script_pct=script_pct, spoil=filmed)
    assert compare([run], one_clock_base).score == pytest.approx(1, abs=0.3)


def test_a_comparison_does_not_deny_what_the_input_tells(measure, tanh_robot, true_model):
    run = measure(tanh_robot(), 7, 40.0)
    what = "the robot follows its commands later from about 33 s on"
    (silent, told) = (
        compare([replace(run, findings=found)], true_model).verdict
        for found in ((), (InputFinding(what, "", "", False, steady=False),))
    )
    assert "nothing is missing" in silent
    assert "follows its commands later" in told and "nothing is missing" not in told


def test_where_no_channel_has_a_floor_nothing_is_said_of_where_it_fails():
    """As of poses that come once in a second, at a horizon of half a second."""
    assert where_it_fails(None, None, np.ones((9, 5, 3)), np.full((5, 3), np.nan)) == []
