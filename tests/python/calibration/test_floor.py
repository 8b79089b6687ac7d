# SPDX-License-Identifier: Apache-2.0
"""The floor against closed forms, and against runs that a log repeats."""

import numpy as np
import pytest

from twinmill.data.measurement import Measurement, _played
from twinmill.data.track import make_track
from twinmill.fitting.compare import compare, open_scenes
from twinmill.predict.floor import measure_floor
from twinmill.predict.noise import ChannelNoise, Noise
from twinmill.predict.problem import Scene
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import HORIZONS_S, Windows, difference, rms

SPEED_MPS = 0.3
NOISE = Noise(ChannelNoise(3e-4, 3e-3, 0.15), ChannelNoise(1.75e-3, 0.03, 0.25))
HORIZON = np.array(HORIZONS_S)


def wandered(drive, memory_s, weight):
    """(H,) variance of the integral of a first-order process times a weight, by quadrature."""
    variances = []
    for horizon_s in HORIZON:
        t_s = (np.arange(400) + 0.5) * horizon_s / 400
        kernel = drive**2 * np.exp(-np.abs(t_s[:, None] - t_s) / memory_s)
        w = weight(t_s, horizon_s) * horizon_s / 400
        variances.append(w @ kernel @ w)
    return np.array(variances)


def closed_form():
    """(H, 3) RMS for straight driving: sensor at both ends, heading at the start, drive noise."""
    position, heading = NOISE.position, NOISE.heading
    pushed = wandered(position.drive, position.memory_s, lambda t, h: np.ones_like(t))
    # A turn at time t bends all of the way that is left; heading noise at the start, all of it.
    bent = SPEED_MPS**2 * wandered(heading.drive, heading.memory_s, lambda t, h: h - t)
    askew = (SPEED_MPS * HORIZON * heading.sensor) ** 2
    turned = wandered(heading.drive, heading.memory_s, lambda t, h: np.ones_like(t))
    return np.sqrt(
        np.column_stack(
            [
                2 * position.sensor**2 + pushed,
                2 * position.sensor**2 + pushed + bent + askew,
                2 * heading.sensor**2 + turned,
            ]
        )
    )


def test_quadrature_agrees_with_the_integral_by_hand():
    # Uhlenbeck and Ornstein 1930: 2 s^2 tau^2 (h/tau - 1 + exp(-h/tau)).
    ratio = HORIZON / 0.15
    by_hand = 2 * (3e-3 * 0.15) ** 2 * (ratio - 1 + np.exp(-ratio))
    assert wandered(3e-3, 0.15, lambda t, h: np.ones_like(t)) == pytest.approx(by_hand, rel=1e-3)


def test_bootstrap_floor_of_straight_driving_is_the_closed_form(driven, model_file):
    """10 %: three times the scatter of the RMS of 400 s x 4 replicas / 2 s independent errors."""
    robot = driven(400.0)
    robot.command[:] = SPEED_MPS / 0.4
    robot.pose[:] = 0
    robot.pose[:, 0] = SPEED_MPS * robot.pose_t_s
    model = model_file(
        ("[0, 25, 50, 75, 100]", "[0, 100]"), ("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.4]")
    ).model
    track = make_track(robot)
    run = Measurement("run", "0", track, _played(track), [], 0)
    scene = Scene(run, model, StepGrid.of(run), False, NOISE)
    floor = measure_floor(scene, Windows.of(track))
    assert floor.kind == "bootstrap"
    assert floor.rms == pytest.approx(closed_form(), rel=0.10)


def legs(random):
    """Arcs of half a second to one and a half, each of four wheels' duties in percent."""
    sides = random.choice([-100, -75, -50, 50, 75, 100], (20, 2))
    return np.repeat([(a, b, a, b) for a, b in sides], random.integers(24, 72, 20), axis=0)


@pytest.fixture(scope="module")
def scripts():
    """One that repeats itself, and one that does not."""
    random, rest = np.random.default_rng(4), np.zeros((48, 4), int)
    once, other = legs(random), legs(random)
    return np.vstack([once, rest, once, rest]), np.vstack([once, rest, other, rest])


def test_repeats_are_found_where_they_are(scripts, tanh_robot, measure, model_file):
    kinds = [
        compare([measure(tanh_robot(), 2, script_pct=s)], model_file()).robots[0].floor.kind
        for s in scripts
    ]
    assert kinds == ["repeat", "bootstrap"]


def test_floor_of_repeats_is_the_noise_whatever_the_model(scripts, tanh_robot, measure, model_file):
    """Its truth: how far noise takes the robot from where it would have gone without any.

    25 %: the scatter of an RMS of some ten independent pairs 2 s ahead; most cells are far nearer.
    """
    runs = [
        measure(robot, 2, script_pct=scripts[0])
        for robot in (
            tanh_robot(),
            tanh_robot(sensor_m=0, sensor_rad=0, drive_mps=0, drive_radps=0),
        )
    ]
    poor = model_file(("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.3, 0.4, 0.5, 0.6]"))
    scene, ideal = (open_scenes([run], model_file())[0] for run in runs)
    windows = Windows.of(scene.measurement.track)
    floor = measure_floor(scene, windows)
    truth = rms(difference(windows.measured(scene), windows.measured(ideal)))
    assert floor.rms == pytest.approx(truth, rel=0.25)
    (blind,) = open_scenes([runs[0]], poor)
    assert measure_floor(blind, windows).rms == pytest.approx(floor.rms)
