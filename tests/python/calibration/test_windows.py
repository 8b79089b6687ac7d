# SPDX-License-Identifier: Apache-2.0
"""Short predictions against geometry: the circle that the fixture `driven` drives."""

from dataclasses import replace

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.data.track import make_track
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import HORIZONS_S, Windows, difference, rms, score

SPEED_MPS, TURN_RADPS, LEVER_M = 0.3, 0.5, 0.126  # of `driven`, and of the model's wheels


@pytest.fixture
def modelled_of(model_file):
    """A run with a model of any gains, without its noise."""

    def make(robot, yaw_gain=1.0, top_mps=0.4):
        track = make_track(robot)
        model = model_file(
            ("[0, 25, 50, 75, 100]", "[0, 100]"),
            ("[0, 0.1, 0.2, 0.3, 0.4]", f"[0, {top_mps!r}]"),
            ("motor_lag_s = 0.05", f"motor_lag_s = 0.0\nyaw_gain = {yaw_gain!r}"),
        ).model
        run = Measurement("run", "0", track, [], 0)
        return ModelledLog(run, model, StepGrid.of(run), False)

    return make


def circle_m_rad():
    """(H, 3) displacement on a circle of radius v/w, seen from its start."""
    turn = TURN_RADPS * np.array(HORIZONS_S)
    radius_m = SPEED_MPS / TURN_RADPS
    return np.column_stack([radius_m * np.sin(turn), radius_m * (1 - np.cos(turn)), turn])


def test_measured_displacement_on_a_circle(driven, modelled_of):
    modelled = modelled_of(driven())
    measured = Windows.of(modelled.measurement.track).measured(modelled.measurement)
    whole = np.isfinite(measured).all(axis=(1, 2))
    assert np.count_nonzero(whole) == pytest.approx((10 - 2) / 0.25, abs=1)
    assert measured[whole] == pytest.approx(np.tile(circle_m_rad(), (whole.sum(), 1, 1)), abs=1e-9)


def test_predicted_displacement_on_a_circle(driven, modelled_of):
    # Duties 0.5 left and 0.8 right: v = 0.65 top, and w = gain 0.15 top / lever.
    top_mps = SPEED_MPS / 0.65
    modelled = modelled_of(driven(), TURN_RADPS * LEVER_M / (0.15 * top_mps), top_mps)
    predicted = Windows.of(modelled.measurement.track).predicted(
        modelled.measurement, modelled.model
    )
    whole = np.isfinite(predicted).all(axis=(1, 2))
    # Steps of 1/120 s and shorter, each an arc: only rounding is left.
    assert predicted[whole] == pytest.approx(np.tile(circle_m_rad(), (whole.sum(), 1, 1)), abs=1e-7)


def test_any_number_of_threads_predicts_the_same_bytes(driven, modelled_of):
    modelled = modelled_of(driven())
    rows = np.linspace(0.5, 1.5, 16)[:, None]

    def predict(part):  # no more threads than rows
        return native.one_step_batch(
            modelled.model, modelled.measurement.played, ["base.yaw_gain"], part
        )

    alone = np.concatenate([predict(rows[[i]]) for i in range(len(rows))])
    assert predict(rows).tobytes() == alone.tobytes()
    assert len(np.unique(alone[:, -1], axis=0)) == len(rows)


@pytest.mark.parametrize("angle_rad", [0.7, 3.0, -2.0])
def test_displacement_is_the_same_wherever_and_however_the_room_is_turned(
    driven, modelled_of, angle_rad
):
    robot = driven()
    x, y, theta = robot.pose.T
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turned = np.column_stack([c * x - s * y + 5, s * x + c * y - 3, theta + angle_rad])
    modelled_logs = [modelled_of(r) for r in (robot, replace(robot, pose=turned))]
    windows = [Windows.of(s.measurement.track) for s in modelled_logs]
    first, second = (w.measured(s.measurement) for w, s in zip(windows, modelled_logs, strict=True))
    assert first == pytest.approx(second, abs=1e-9, nan_ok=True)
    first, second = (
        w.predicted(s.measurement, s.model) for w, s in zip(windows, modelled_logs, strict=True)
    )
    assert first == pytest.approx(second, abs=1e-9, nan_ok=True)


def test_a_heading_error_shows_as_motion_to_the_side(driven, modelled_of):
    """Poses look 0.1 rad to the left of the path: all moves to the right."""
    robot = driven()
    pose = robot.pose + np.array([0, 0, 0.1])
    modelled = modelled_of(replace(robot, pose=pose))
    measured = Windows.of(modelled.measurement.track).measured(modelled.measurement)[0]
    x, y = circle_m_rad()[:, :2].T
    c, s = np.cos(0.1), np.sin(0.1)
    assert measured[:, 0] == pytest.approx(c * x + s * y, abs=1e-9)
    assert measured[:, 1] == pytest.approx(c * y - s * x, abs=1e-9)


def test_noise_of_the_first_heading_turns_a_prediction_by_that_of_a_mean_of_seven(
    driven, modelled_of
):
    """The line over 50 ms, seven poses at 120 Hz, has in its middle the noise of their mean."""
    robot, noise_rad = driven(200.0), 0.02
    wrong_rad = np.random.default_rng(1).normal(0, noise_rad, len(robot.pose))
    pose = robot.pose + wrong_rad[:, None] * [0, 0, 1]
    top_mps = SPEED_MPS / 0.65
    modelled = modelled_of(
        replace(robot, pose=pose), TURN_RADPS * LEVER_M / (0.15 * top_mps), top_mps
    )
    errors = Windows.of(modelled.measurement.track).errors(modelled)
    chord_m = np.linalg.norm(circle_m_rad()[:, :2], axis=1)
    missed_m = np.linalg.norm(rms(errors)[:, :2], axis=1)
    # 800 windows tell an RMS to 3 %.
    assert missed_m == pytest.approx(chord_m * noise_rad / np.sqrt(7), rel=0.1)


def test_no_prediction_crosses_a_break(driven, modelled_of):
    robot = driven()
    valid = robot.valid.copy()
    valid[(robot.pose_t_s > 5) & (robot.pose_t_s < 5.3)] = False
    track = make_track(replace(robot, valid=valid))
    windows = Windows.of(track)
    there = windows.ends >= 0
    starts = np.broadcast_to(windows.starts[:, None], there.shape)
    assert np.all(track.segment[windows.ends[there]] == track.segment[starts[there]])
    end_s = track.pose_t_s[windows.starts][:, None] + np.array(HORIZONS_S)
    before = track.segment[windows.starts] == 0
    # The first stretch ends 0.1 s before the break: what ends earlier is all there.
    assert np.all(there[before] == (end_s[before] < 4.9 + 0.5 / 120))
    assert np.all(np.diff(there.astype(int), axis=1) <= 0)


def test_score_is_error_over_floor():
    random = np.random.default_rng(1)
    floor = random.uniform(0.5, 2, (len(HORIZONS_S), 3))
    unit = random.choice([-1, 1], (40, len(HORIZONS_S), 3)) * floor
    assert score(unit, floor) == pytest.approx(1)
    assert score(2 * unit, floor) == pytest.approx(2)
    # One of 15 cells three times its floor: sqrt((14 + 9) / 15).
    unit[:, 2, 1] *= 3
    assert score(unit, floor) == pytest.approx(np.sqrt(23 / 15))
    unit[:20] = np.nan
    assert score(unit, floor) == pytest.approx(np.sqrt(23 / 15))


def test_rms_leaves_out_what_is_not_there():
    errors = np.array([[[3.0, 0, 0]], [[4.0, 0, 0]], [[np.nan, np.nan, np.nan]]])
    assert rms(errors)[0, 0] == pytest.approx(np.sqrt(12.5))


def test_headings_differ_the_short_way_round():
    a, b = np.array([[0, 0, 3.1]]), np.array([[0, 0, -3.1]])
    assert difference(a, b)[0, 2] == pytest.approx(6.2 - 2 * np.pi)
